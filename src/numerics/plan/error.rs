//! Errors of planning.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::grid::NoLattice;

/// The reason why there is no plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// A box or a step that makes no lattice.
    #[error(transparent)]
    NoLattice(#[from] NoLattice),
    /// Too few poses of the region can be used.
    #[error(
        "only {found} of {drawn} random poses of the region can be measured, but {wanted} are wanted ({}): move or shrink \
         [grid] box or [plan] cone_deg, give another home_deg, or loosen [plan.constraints]",
        reasons(refused)
    )]
    OutOfReach {
        /// Number of poses wanted.
        wanted: usize,
        /// Number of poses found.
        found: usize,
        /// Number of poses drawn.
        drawn: usize,
        /// Number of poses that cannot be measured, by reason.
        refused: BTreeMap<&'static str, usize>,
    },
    /// Fewer candidates than poses.
    #[error(
        "{candidates} candidate poses are fewer than the {poses} a design may have: raise [plan] candidates, best to several \
         times as many, or lower [plan] poses"
    )]
    FewCandidates {
        /// Number of candidates asked for.
        candidates: usize,
        /// Most poses of a design.
        poses: usize,
    },
}

/// Counts as text.
fn reasons(refused: &BTreeMap<&'static str, usize>) -> String {
    let words: Vec<String> = refused
        .iter()
        .map(|(reason, count)| format!("{count} {}", reason.replace('_', " ")))
        .collect();
    words.join(", ")
}
