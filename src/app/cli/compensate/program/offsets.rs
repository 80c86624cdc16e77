//! The error that stays at motions beside a position (`Offs`, `RelTool`, `:`): they get the correction of the position, and end where the
//! arm needs another one.

use nalgebra::Vector3;

use super::densify::Known;
use super::solve::Solver;
use crate::programs::write::Command;
use crate::programs::{Asked, Wanted};

/// How far from a position its correction is looked at, mm.
pub(super) const AWAY_MM: f64 = 100.0;

impl Solver<'_> {
    /// The largest difference between the correction of a position that motions move beside, and that 100 mm away along each axis of the
    /// base, mm; `None` where no such position is corrected.
    pub(super) fn left_by_offsets(&self, known: &Known<'_>) -> Option<f64> {
        let Known { programs, asked, commands } = known;
        let is_beside =
            |own: &&Asked| programs.positions[own.position].uses.iter().any(|own| own.is_beside);
        let beside = asked.iter().flatten().filter(is_beside);
        let corrected = beside
            .filter_map(|own| Some((own, correction(own, commands[own.position].as_ref()?)?)));
        let pairs = corrected.flat_map(|(own, at)| {
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let ways = axes.into_iter().flat_map(|axis| [AWAY_MM * axis, -AWAY_MM * axis]);
            ways.filter_map(move |by| Some((moved(own, &by)?, at)))
        });
        let (moved, at): (Vec<Asked>, Vec<Vector3<f64>>) = pairs.unzip();
        let solved = self.solve(&moved.iter().collect::<Vec<_>>());
        let left = solved.iter().zip(&moved).zip(&at).filter_map(|((done, own), at)| {
            Some((correction(own, &done.as_ref().ok()?.command)? - at).norm())
        });
        left.max_by(f64::total_cmp)
    }
}

fn correction(asked: &Asked, command: &Command) -> Option<Vector3<f64>> {
    asked.correction(command.base_from_tool.as_ref()?)
}

fn moved(asked: &Asked, by: &Vector3<f64>) -> Option<Asked> {
    let mut moved = asked.clone();
    let Wanted::Pose { base_from_tool, programmed, .. } = &mut moved.wanted else { return None };
    base_from_tool.translation.vector += by;
    programmed.translation.vector += by;
    Some(moved)
}
