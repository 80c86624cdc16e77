//! Errors of planning.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::grid::NoLattice;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    #[error(transparent)]
    NoLattice(#[from] NoLattice),
    #[error(
        "only {found} of {drawn} random poses of the region can be measured, but {wanted} are wanted ({}): move or shrink \
         [grid] box or [plan] cone_deg, give another home_deg, or loosen [plan.constraints]",
        reasons(refused)
    )]
    OutOfReach { wanted: usize, found: usize, drawn: usize, refused: BTreeMap<&'static str, usize> },
    #[error(
        "{candidates} candidate poses are fewer than the {poses} a design may have: raise [plan] candidates, best to several \
         times as many, or lower [plan] poses"
    )]
    FewCandidates { candidates: usize, poses: usize },
}

fn reasons(refused: &BTreeMap<&'static str, usize>) -> String {
    let words: Vec<String> = refused
        .iter()
        .map(|(reason, count)| format!("{count} {}", reason.replace('_', " ")))
        .collect();
    words.join(", ")
}
