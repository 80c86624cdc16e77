//! The errors that an identified arm may make in another session, station by station, as one Gaussian.
//!
//! Inputs: a trained [`FullModel`], joint angles of another session. Output: a square root of the covariance of its errors there:
//! what training left open, how far sessions differ (curves, command–feedback weights), the warm-up that they repeat, and a drift of its own,
//! whose size past sessions leave open.
//! Base, scale and, where it is the session's own, target are left out: they are found from its stations ([`crate::fit::locate`]). What is
//! left of the covariance is that of a target of which nothing is known before.

use nalgebra::{DMatrix, UnitVector3};
use rayon::prelude::*;

use super::layout::Block;
use super::next::{Mounted, Mounting, Placed, WarmUp};
use super::{FullModel, FullSettings, Query};
use crate::fit::problem::Owner;
use crate::kinematics::Arm;
use crate::linalg::beside;
use crate::units::whole;

/// Poses that a worker takes at once; fixed, so that results do not depend on the number of threads.
const AT_ONCE: usize = 64;

/// The model of an arm in a session that took no part in its training.
#[derive(Debug)]
pub struct Elsewhere {
    model: FullModel,
    /// Columns of base and scale, which the session's own stations find.
    found: Vec<usize>,
    targets: Vec<usize>,
}

impl FullModel {
    /// Number of stations of the longest session that it learned from: its drift is told over as many.
    pub const fn span_stations(&self) -> usize {
        whole(self.trained.span)
    }

    /// The arm in another session, with base and targets of the one given; `None` where rounding makes a factorisation fail.
    pub fn elsewhere(
        &self,
        arm: &Arm,
        session: usize,
        settings: &FullSettings,
        up: Option<UnitVector3<f64>>,
    ) -> Option<Elsewhere> {
        let frames = &self.frames[session];
        let mounting = Mounting {
            session,
            sources: frames.sources().iter().map(|base| Placed::Moved(*base)).collect(),
            targets: vec![Mounted::Same; frames.targets().len()],
        };
        let stations = self.span_stations();
        let model = self.coming(arm, &mounting, stations, settings, up, WarmUp::Repeats)?;
        let columns = |is_own: fn(&Owner) -> bool| {
            let unknowns = model.unknowns().iter().enumerate();
            unknowns.filter(move |(_, unknown)| is_own(&unknown.owner)).map(|(column, _)| column)
        };
        let scale = model.trained.layout.columns(Block::Scale(0));
        let base = columns(|owner| matches!(owner, Owner::Source { .. }));
        Some(Elsewhere {
            found: base.chain(scale.into_iter().flatten()).collect(),
            targets: columns(|owner| matches!(owner, Owner::Target { .. })).collect(),
            model,
        })
    }
}

impl Elsewhere {
    /// Square root of the covariance of the errors at these queries, with the known target or with one of the session's own, in the axes
    /// of the base: `HᵀH`, three columns each, mm.
    pub fn half(&self, queries: &[Query<'_>], own_target: bool) -> DMatrix<f64> {
        let part =
            |queries: &[Query<'_>]| self.model.posterior.half(&self.rows(queries, own_target));
        let parts: Vec<DMatrix<f64>> = queries.par_chunks(AT_ONCE).map(part).collect();
        beside(self.model.trained.layout.size(), &parts)
    }

    /// The motion of each point by every column that the session's stations do not find, in the axes of the base.
    fn rows(&self, queries: &[Query<'_>], own_target: bool) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(3 * queries.len(), self.model.trained.layout.size());
        for (place, query) in queries.iter().enumerate() {
            let query = Query { session: 0, own: true, ..*query };
            let base = self.model.frames[0].tracker_from_base(query.source).isometry();
            let turn = base.rotation.inverse().to_rotation_matrix();
            let own = turn.matrix() * self.model.predict(&query).rows;
            rows.rows_mut(3 * place, 3).copy_from(&own);
        }
        for &column in self.found.iter().chain(self.targets.iter().filter(|_| own_target)) {
            rows.fill_column(column, 0.0);
        }
        rows
    }
}
