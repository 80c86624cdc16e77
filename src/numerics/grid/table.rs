//! The table of the chosen step: its nodes with their errors and covariances, and its judgement by other sessions.

use nalgebra::{Matrix3, Point3, Vector3};

use super::answers::{Answers, by_number};
use super::judge::HeldOut;
use super::lattice::{InCell, Lattice};
use super::node::{GridStation, Refusal, on_one_branch};
use super::rows::{Judging, StepAnswers};
use super::{Judged, Source, Table, TableNode};
use crate::fit::{Gap, ToolErrors};
use crate::progress::Progress;

/// The nodes of the chosen row, with their values and covariances; `None` where the row has no lattice.
pub(super) fn table(
    judging: &Judging<'_>,
    chosen: &Judged,
    answers: &[StepAnswers],
    progress: &dyn Progress,
) -> Option<Table> {
    let lattice = chosen.lattice?;
    let (lattice, nodes) = match chosen.source {
        Source::Model => model_nodes(judging, lattice, progress),
        Source::Measured => measured_nodes(judging, chosen.step_mm)?,
    };
    let (plan, settings) = (judging.plan, judging.settings);
    Some(Table {
        step_mm: chosen.step_mm,
        lattice,
        orientation: plan.orientation,
        configuration: plan.configuration,
        source: chosen.source,
        interpolation: chosen.interpolation,
        idw_power: settings.idw_power,
        orientation_tolerance_rad: settings.orientation_tolerance_deg.to_radians(),
        counted: judging.reach.counted.clone(),
        interpolation_mm2: judging.interpolation(&lattice, chosen, answers),
        nodes,
    })
}

impl Table {
    /// Judges the table by stations of another session, in comparison with the model's prediction there.
    pub(super) fn judged_by(&self, stations: &[GridStation], model: &ToolErrors<'_>) -> HeldOut {
        let mut answers = Answers::default();
        for station in stations {
            if !self.is_like(station) {
                answers.unlike += 1;
                continue;
            }
            answers.add_found(station, self.error_at(&station.position), model);
        }
        HeldOut::left_by(&answers, &by_number(stations))
    }

    /// How much of the interpolation error the stations that it covers can show.
    pub(super) fn interpolation_shown(&self, stations: &[GridStation]) -> Option<f64> {
        let like = stations.iter().filter(|own| self.is_like(own));
        self.lattice.interpolation_shown(like.map(|own| &own.position))
    }

    /// Whether the table covers a station: its configuration, and its orientation within the tolerance.
    fn is_like(&self, station: &GridStation) -> bool {
        let turned = station.orientation.angle_to(&self.orientation);
        station.configuration == self.configuration && turned <= self.orientation_tolerance_rad
    }

    /// The error at a point from the nodes around it, mm; `None` outside the table, or why its cell cannot serve.
    fn error_at(&self, point: &Point3<f64>) -> Option<Result<Vector3<f64>, Refusal>> {
        let cell = self.lattice.locate(point)?;
        Some(self.interpolated(&cell.vertices.map(|vertex| &self.nodes[vertex]), &cell))
    }

    fn interpolated(
        &self,
        nodes: &[&TableNode; 8],
        cell: &InCell,
    ) -> Result<Vector3<f64>, Refusal> {
        let (mut joints, mut errors) = (Vec::with_capacity(8), Vec::with_capacity(8));
        for node in nodes {
            joints.push(node.joints.as_deref().map_err(|refusal| *refusal)?);
            errors.push(node.error.as_ref().map_err(|refusal| *refusal)?.0);
        }
        if !on_one_branch(&joints, &self.counted) {
            return Err(Refusal::Branches);
        }
        let (fraction, step) = (&cell.fraction, &self.lattice.step);
        let weights = self.interpolation.weights(fraction, step, self.idw_power);
        Ok(errors.iter().zip(weights).map(|(error, w)| error * w).sum())
    }
}

/// Number of nodes whose covariances are found between two looks at the progress.
const SHOWN_EVERY: usize = 4096;

fn model_nodes(
    judging: &Judging<'_>,
    lattice: Lattice,
    progress: &dyn Progress,
) -> (Lattice, Vec<TableNode>) {
    let grid = judging.placed(lattice, None, progress);
    let reached = grid.nodes.iter().filter_map(|node| node.joints.as_deref().ok());
    let reached: Vec<&[f64]> = reached.collect();
    let model = &judging.input.model;
    progress.begin("nodes of the table", reached.len() as u64);
    let found = reached.chunks(SHOWN_EVERY).flat_map(|some| {
        progress.advance(some.len() as u64);
        model.errors_with_covariance(some)
    });
    let mut errors = found.collect::<Vec<_>>().into_iter();
    progress.end();
    let mut error = |joints: &Result<Vec<f64>, Refusal>| {
        joints.as_ref().map_err(|refusal| *refusal)?;
        errors.next().unwrap_or(Err(Gap::NoJoints)).map_err(|gap| gap.refusal())
    };
    let errors: Vec<_> = grid.nodes.iter().map(|node| error(&node.joints)).collect();
    let nodes = grid.nodes.into_iter().zip(errors).map(|(node, error)| TableNode {
        error,
        joints: node.joints,
        nearest_mm: node.nearest_mm,
    });
    (lattice, nodes.collect())
}

/// The stations of the session's own grid at this step; `None` where the step is none of its own.
fn measured_nodes(judging: &Judging<'_>, step_mm: f64) -> Option<(Lattice, Vec<TableNode>)> {
    let (input, plan) = (judging.input, judging.plan);
    let own = judging.own.as_ref().ok()?;
    let grid = own.decimated(own.multiples(step_mm)?, [0; 3])?;
    let instrument = Matrix3::identity() * (input.guard_mm / 2.0).powi(2);
    let refused = |refusal: Refusal, nearest_mm: f64| TableNode {
        joints: Err(refusal),
        error: Err(refusal),
        nearest_mm,
    };
    let node = |place: &Option<usize>| match place.map(|place| &input.stations[place]) {
        None => refused(Refusal::Unmeasured, f64::INFINITY),
        Some(station) if station.configuration != plan.configuration => {
            refused(Refusal::OtherConfiguration, 0.0)
        }
        Some(station) => TableNode {
            joints: Ok(station.joints.clone()),
            // The visit that was measured, and the visit of a target.
            error: Ok((station.error, instrument + input.model.visit(&station.joints) * 2.0)),
            nearest_mm: 0.0,
        },
    };
    Some((grid.lattice, grid.nodes.iter().map(node).collect()))
}
