//! The judgement of a step, always on stations that took no part.
//!
//! *Local cell*: a cell of the lattice's pitches around each held-out station, at that station's own orientation and configuration,
//! the station at a quasi-random place of it (a table's targets lie anywhere in their cells). *Table*: the very nodes
//! that would be published, for held-out stations in the box, of the same configuration and within the orientation
//! tolerance. Only *table* gives the verdict ([`crate::method::grids`]).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::answers::{Answer, Answers, ByNumber};
use super::interpolation::Interpolation;
use super::lattice::InCell;
use super::node::{GridStation, NodeError, PlacedGrid, Reach, Refusal, on_one_branch};
use crate::figures::{Counted, PoseErrors};
use crate::fit::ToolErrors;

/// Remaining errors on held-out stations, and the stations that could not be judged.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HeldOut {
    /// Norm of measured minus interpolated error, in station order, mm.
    pub norms: Vec<f64>,
    /// Measured minus interpolated error of the same stations.
    pub left: Vec<LeftAt>,
    /// Norms by pose, for the bound.
    pub by_pose: PoseErrors,
    /// Norms by pose of the errors of these stations with between-session variation, the same number for each; empty where
    /// that variation is not known, and in a row of steps, which keeps the bound they have.
    pub between_sessions: PoseErrors,
    /// Norm of the same stations' errors without any correction, mm.
    pub uncorrected: Vec<f64>,
    /// Norm of the errors that the model itself leaves on the same stations, without any grid, mm; empty for measured
    /// nodes.
    pub direct: Vec<f64>,
    /// Norms by pose of the errors that the model itself leaves there, for its bound; empty for measured nodes.
    pub direct_by_pose: PoseErrors,
    /// Norms by pose of the errors that the model itself leaves there, with between-session variation; empty where
    /// `between_sessions` is.
    pub direct_another_day: PoseErrors,
    /// Blocks of the stations: those of one block are not independent.
    pub blocks: BTreeSet<usize>,
    /// Number of stations in a refused cell, by reason.
    pub refused: BTreeMap<Refusal, usize>,
    /// Number of stations outside the box.
    pub outside: usize,
    /// Number of stations of another configuration or beyond the orientation tolerance.
    pub unlike: usize,
}

/// The remaining error of one station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftAt {
    /// Number of the station.
    pub station: usize,
    /// Number of the station that names its pose.
    pub pose: usize,
    /// Number of the grid that judged, where several do; otherwise 0.
    pub sample: usize,
    /// Measured minus interpolated, mm.
    pub error: Vector3<f64>,
}

impl HeldOut {
    /// What answers leave of the errors of their stations.
    pub(super) fn left_by(answers: &Answers, stations: &ByNumber<'_>) -> Self {
        let mut held_out = Self {
            refused: answers.refused.clone(),
            outside: answers.outside,
            unlike: answers.unlike,
            ..Self::default()
        };
        for own in &answers.given {
            if let Some(station) = stations.get(&own.station) {
                held_out.add(station, own);
            }
        }
        held_out
    }

    /// Adds what an answer leaves of the error of its station.
    fn add(&mut self, station: &GridStation, answer: &Answer) {
        let (interpolated, sample) = (&answer.interpolated, answer.sample);
        let left = LeftAt {
            station: station.number,
            pose: station.pose,
            sample,
            error: station.error - interpolated,
        };
        let norm = left.error.norm();
        self.norms.push(norm);
        self.by_pose.add(left.pose, left.station, sample, norm);
        let days = station.between_sessions.len();
        for (day, norm) in station.left_between_sessions(interpolated).enumerate() {
            let sample = sample * days + day;
            self.between_sessions
                .add(left.pose, left.station, sample, norm);
        }
        self.left.push(left);
        self.uncorrected.push(station.error.norm());
        self.blocks.insert(station.fold);
        if let Some(predicted) = &answer.predicted {
            self.add_direct(station, predicted);
        }
    }

    /// Adds what the model without a grid leaves there.
    fn add_direct(&mut self, station: &GridStation, predicted: &Vector3<f64>) {
        let norm = (station.error - predicted).norm();
        self.direct.push(norm);
        self.direct_by_pose
            .add(station.pose, station.number, 0, norm);
        for (day, norm) in station.left_between_sessions(predicted).enumerate() {
            self.direct_another_day
                .add(station.pose, station.number, day, norm);
        }
    }

    /// Number of poses and stations of the norms: fewer than norms where a station is judged by several decimated grids.
    pub fn counted(&self) -> Counted {
        self.by_pose.counted()
    }

    /// Mean of the error that the grid leaves beyond that of the model itself, and its standard error, mm; `None` for
    /// measured nodes and with fewer than two stations.
    pub fn excess(&self) -> Option<(f64, f64)> {
        let excess: Vec<f64> = self
            .norms
            .iter()
            .zip(&self.direct)
            .map(|(grid, model)| grid - model)
            .collect();
        let mean = excess.iter().sum::<f64>() / excess.len() as f64;
        let squares: f64 = excess.iter().map(|e| (e - mean).powi(2)).sum();
        let n = excess.len() as f64;
        (excess.len() > 1).then(|| (mean, (squares / (n - 1.0) / n).sqrt()))
    }

    /// Whether the remaining errors are, on average, no smaller than the uncorrected ones: the grid does not help.
    pub(super) fn is_no_help(&self) -> bool {
        !self.norms.is_empty()
            && self.norms.iter().sum::<f64>() >= self.uncorrected.iter().sum::<f64>()
    }
}

/// The eight joint vectors of a local cell around one station.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalCell {
    fraction: Vector3<f64>,
    vertices: Result<Vec<Vec<f64>>, Refusal>,
}

/// Places a cell of `pitch` (mm along each axis) around each station, at the station's own orientation and configuration.
pub(super) fn local_cells(
    reach: &Reach<'_>,
    stations: &[GridStation],
    pitch: [f64; 3],
) -> Vec<LocalCell> {
    let place = |station: &GridStation| {
        let fraction = quasi_random(station.number);
        let least = station.position - fraction.component_mul(&Vector3::from(pitch));
        let vertices = (0..8).map(|vertex: usize| {
            let offset = Vector3::from_fn(|axis, _| {
                if vertex >> axis & 1 == 1 {
                    pitch[axis]
                } else {
                    0.0
                }
            });
            reach.joints(
                &Point3::from(least.coords + offset),
                &station.orientation,
                &station.joints,
            )
        });
        let vertices = vertices
            .collect::<Result<Vec<_>, _>>()
            .and_then(|vertices| {
                let slices: Vec<&[f64]> = vertices.iter().map(Vec::as_slice).collect();
                if on_one_branch(&slices, reach.counted()) {
                    Ok(vertices)
                } else {
                    Err(Refusal::Branches)
                }
            });
        LocalCell { fraction, vertices }
    };
    stations.par_iter().map(place).collect()
}

/// What local cells answer at their stations, each with the model of its station's fold.
pub(super) fn by_local_cell(
    stations: &[GridStation],
    cells: &[LocalCell],
    folds: &[ToolErrors<'_>],
    pitch: &[f64; 3],
    interpolation: Interpolation,
    power: f64,
) -> Answers {
    let interpolated = |(station, cell): (&GridStation, &LocalCell)| {
        let vertices = cell.vertices.as_ref().map_err(|refusal| *refusal)?;
        let weights = interpolation.weights(&cell.fraction, pitch, power);
        let error = |joints: &Vec<f64>| {
            let error = folds[station.fold].error(joints);
            error.map_err(|gap| gap.refusal())
        };
        let errors = vertices.iter().zip(weights);
        let errors = errors.map(|(joints, weight)| Ok(error(joints)? * weight));
        Ok([
            errors.sum::<Result<Vector3<f64>, Refusal>>()?,
            error(&station.joints)?,
        ])
    };
    let found: Vec<Result<[Vector3<f64>; 2], Refusal>> =
        stations.par_iter().zip(cells).map(interpolated).collect();
    let mut answers = Answers::default();
    for (station, found) in stations.iter().zip(found) {
        answers.add(station, found);
    }
    answers
}

/// What the nodes that would be published answer at `stations`, with node values from the model of each station's fold.
pub fn by_table(
    stations: &[GridStation],
    grid: &PlacedGrid,
    like: impl Fn(&GridStation) -> bool,
    folds: &[ToolErrors<'_>],
    interpolation: Interpolation,
    power: f64,
) -> Answers {
    let used: Vec<usize> = {
        let mut used: Vec<usize> = stations.iter().map(|station| station.fold).collect();
        used.sort_unstable();
        used.dedup();
        used
    };
    let tables: BTreeMap<usize, Vec<NodeError>> = used
        .into_iter()
        .map(|fold| (fold, node_errors(grid, &folds[fold])))
        .collect();
    let mut answers = Answers::default();
    for station in stations {
        if !like(station) {
            answers.unlike += 1;
            continue;
        }
        let found = by_nodes(
            grid,
            &tables[&station.fold],
            &station.position,
            interpolation,
            power,
        );
        answers.add_found(station, found, &folds[station.fold]);
    }
    answers
}

/// The error at a point from those at the nodes; `None` outside the grid, or why its cell cannot serve.
pub fn by_nodes(
    grid: &PlacedGrid,
    errors: &[NodeError],
    point: &Point3<f64>,
    interpolation: Interpolation,
    power: f64,
) -> Option<Result<Vector3<f64>, Refusal>> {
    let interpolated = |cell: InCell| {
        let weights = interpolation.weights(&cell.fraction, &grid.lattice.step, power);
        let weighted = cell.vertices.iter().zip(weights);
        weighted
            .map(|(&vertex, weight)| Ok(errors[vertex]? * weight))
            .sum()
    };
    Some(grid.cell(point)?.and_then(interpolated))
}

/// The model's error at every node.
pub fn node_errors(grid: &PlacedGrid, model: &ToolErrors<'_>) -> Vec<NodeError> {
    let nodes = || grid.nodes.iter().map(|node| node.joints.as_deref());
    let mut found = model
        .errors(&nodes().flatten().collect::<Vec<_>>())
        .into_iter();
    let error = |joints: Result<&[f64], &Refusal>| {
        joints.map_err(|refusal| *refusal)?;
        let found = found
            .next()
            .expect("an error for each node with joint angles");
        found.map_err(|gap| gap.refusal())
    };
    nodes().map(error).collect()
}

/// A place in the unit cell, different for each station and evenly spread over all (Halton 1960, bases 2, 3, 5).
fn quasi_random(number: usize) -> Vector3<f64> {
    let radical_inverse = |base: usize| {
        let (mut rest, mut digit, mut value) = (number + 1, 1.0, 0.0);
        while rest > 0 {
            digit /= base as f64;
            value += digit * (rest % base) as f64;
            rest /= base;
        }
        value
    };
    Vector3::new(radical_inverse(2), radical_inverse(3), radical_inverse(5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_the_cell_evenly() {
        assert_eq!(quasi_random(0), Vector3::new(0.5, 1.0 / 3.0, 0.2));
        let mean = (0..1000).map(quasi_random).sum::<Vector3<f64>>() / 1000.0;
        assert!((mean - Vector3::repeat(0.5)).norm() < 0.01);
    }
}
