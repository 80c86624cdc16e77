//! The judgement of a step, always on stations that took no part.
//!
//! *Table*: the very nodes that would be published, for held-out stations in the box, of the same configuration and within the
//! orientation tolerance. *Local cell*: the same stations, each at one random place of a cell of the lattice's pitches, for a
//! table's targets lie anywhere in their cells, and stations may lie on its nodes. The larger bound of both is that of the step
//! ([`crate::method::grids`]).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use rayon::prelude::*;

use super::answers::{Answer, Answers, ByNumber};
use super::interpolation::{Interpolation, corner};
use super::lattice::{InCell, WorkBox};
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
    /// Norm of the errors that the model leaves on the same stations, without any grid, mm; empty for measured nodes.
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
    pub station: usize,
    /// Number of the station that names its pose.
    pub pose: usize,
    /// Number of the grid that judged, where several do; otherwise 0.
    pub sample: usize,
    /// Commanded position of the tool point in the base frame, mm.
    pub at: Point3<f64>,
    /// Error without any correction, mm.
    pub before: Vector3<f64>,
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
            at: station.position,
            before: station.error,
            error: station.error - interpolated,
        };
        let norm = left.error.norm();
        self.norms.push(norm);
        self.by_pose.add(left.pose, left.station, sample, norm);
        let days = station.between_sessions.len();
        for (day, norm) in station.left_between_sessions(interpolated).enumerate() {
            let sample = sample * days + day;
            self.between_sessions.add(left.pose, left.station, sample, norm);
        }
        self.left.push(left);
        self.blocks.insert(station.fold);
        answer.predicted.iter().for_each(|predicted| self.add_direct(station, predicted));
    }

    /// Adds what the model without a grid leaves there.
    fn add_direct(&mut self, station: &GridStation, predicted: &Vector3<f64>) {
        let norm = (station.error - predicted).norm();
        self.direct.push(norm);
        self.direct_by_pose.add(station.pose, station.number, 0, norm);
        for (day, norm) in station.left_between_sessions(predicted).enumerate() {
            self.direct_another_day.add(station.pose, station.number, day, norm);
        }
    }

    /// Number of poses and stations of the norms: fewer than norms where a station is judged by several decimated grids.
    pub fn counted(&self) -> Counted {
        self.by_pose.counted()
    }

    /// Mean of the error that the grid leaves beyond that of the model itself, and its standard error, mm; `None` for
    /// measured nodes and with fewer than two stations.
    pub fn excess(&self) -> Option<(f64, f64)> {
        let excess: Vec<f64> =
            self.norms.iter().zip(&self.direct).map(|(grid, model)| grid - model).collect();
        let mean = excess.iter().sum::<f64>() / excess.len() as f64;
        let squares: f64 = excess.iter().map(|e| (e - mean).powi(2)).sum();
        let n = excess.len() as f64;
        (excess.len() > 1).then(|| (mean, (squares / (n - 1.0) / n).sqrt()))
    }

    /// Whether the remaining errors are, on average, no smaller than the uncorrected ones: the grid does not help.
    pub fn is_no_help(&self) -> bool {
        let before = self.left.iter().map(|left| left.before.norm());
        !self.norms.is_empty() && self.norms.iter().sum::<f64>() >= before.sum::<f64>()
    }
}

/// A cell of a lattice's pitches with a station at a random place of it.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalCell {
    /// Index of the station among those judged.
    station: usize,
    /// Place of the station in the cell along each axis, 0 to 1.
    fraction: Vector3<f64>,
    /// Errors by the model of the station's fold at the eight vertices and at the station, mm.
    errors: Result<(Vec<Vector3<f64>>, Vector3<f64>), Refusal>,
}

/// Places a cell of `pitch` (mm along each axis) around each station, at the table's `orientation` or else at the station's own.
///
/// A cell of the table does not leave its box: the place is mirrored along each axis where that leaves less of the cell outside, and
/// along others where the arm does not serve the cell.
pub(super) fn local_cells(
    reach: &Reach<'_>,
    stations: &[&GridStation],
    folds: &[ToolErrors<'_>],
    pitch: [f64; 3],
    bounds: &WorkBox,
    orientation: Option<UnitQuaternion<f64>>,
) -> Vec<LocalCell> {
    let place = |(station, own): (usize, &&GridStation)| {
        let drawn = random_place(own.number);
        let fraction = Vector3::from_fn(|axis, _| {
            let mirrored = 1.0 - drawn[axis];
            let outside = |fraction: f64| {
                let low = own.position[axis] - fraction * pitch[axis];
                (bounds.low_mm[axis] - low).max(low + pitch[axis] - bounds.high_mm[axis])
            };
            let is_less = outside(mirrored).max(0.0) < outside(drawn[axis]).max(0.0);
            if is_less { mirrored } else { drawn[axis] }
        });
        let orientation = orientation.unwrap_or(own.orientation);
        let vertices = |fraction: &Vector3<f64>| {
            let joints = |vertex: usize| {
                let offset = (corner(vertex) - fraction).component_mul(&Vector3::from(pitch));
                reach.joints(&(own.position + offset), &orientation, &own.joints)
            };
            let vertices = (0..8).map(joints).collect::<Result<Vec<_>, _>>()?;
            let slices: Vec<&[f64]> = vertices.iter().map(Vec::as_slice).collect();
            on_one_branch(&slices, &reach.counted).then_some(vertices).ok_or(Refusal::Branches)
        };
        let mirrored = |axes: usize| {
            let of = |axis: usize, f: f64| if axes >> axis & 1 == 1 { 1.0 - f } else { f };
            Vector3::from_fn(|axis, _| of(axis, fraction[axis]))
        };
        let first = vertices(&fraction);
        let others = if first.is_ok() { 1..1 } else { 1..8 };
        let served = |own: Vector3<f64>| Some((own, Ok(vertices(&own).ok()?)));
        let (fraction, vertices) =
            others.map(mirrored).find_map(served).unwrap_or((fraction, first));
        let errors = vertices.and_then(|vertices| {
            let error =
                |joints: &Vec<f64>| folds[own.fold].error(joints).map_err(|gap| gap.refusal());
            let at_vertices = vertices.iter().map(error).collect::<Result<_, _>>()?;
            Ok((at_vertices, error(&own.joints)?))
        });
        LocalCell { station, fraction, errors }
    };
    stations.par_iter().enumerate().map(place).collect()
}

/// What a measured station adds to the model at its node: the part of its error that the model without its block leaves, mm.
pub(super) fn left_by_model(
    stations: &[&GridStation],
    folds: &[ToolErrors<'_>],
) -> Result<Vec<Vector3<f64>>, Refusal> {
    let left = |own: &&GridStation| {
        Ok(own.error - folds[own.fold].error(&own.joints).map_err(|gap| gap.refusal())?)
    };
    stations.par_iter().map(left).collect()
}

/// What the model leaves at another station, chosen by the station and the vertex of its cell.
fn left_elsewhere(left: &[Vector3<f64>], station: usize, vertex: usize) -> Vector3<f64> {
    let other = (8 * station + vertex) % left.len();
    left[if other == station { (other + 1) % left.len() } else { other }]
}

/// What local cells answer at their stations: vertices have the value of the model of the station's fold and, where nodes are
/// measured, what the model leaves at another station (`measured`, one each in the order of the stations).
pub(super) fn by_local_cell(
    stations: &[&GridStation],
    cells: &[LocalCell],
    pitch: &[f64; 3],
    interpolation: Interpolation,
    power: f64,
    measured: Option<&[Vector3<f64>]>,
) -> Answers {
    let mut answers = Answers::default();
    for cell in cells {
        let added = |vertex: usize| {
            measured.map_or_else(Vector3::zeros, |left| left_elsewhere(left, cell.station, vertex))
        };
        let weights = interpolation.weights(&cell.fraction, pitch, power);
        let found = cell.errors.as_ref().map(|(at_vertices, predicted)| {
            let nodes = at_vertices.iter().zip(weights).enumerate();
            let weighted = nodes.map(|(vertex, (error, weight))| (error + added(vertex)) * weight);
            (weighted.sum(), measured.is_none().then_some(*predicted))
        });
        answers.add(stations[cell.station], 0, found.map_err(|refusal| *refusal));
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
    let mut needed: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for station in stations.iter().filter(|own| like(own)) {
        let cell = grid.cell(&station.position).and_then(Result::ok);
        let vertices = cell.into_iter().flat_map(|cell| cell.vertices);
        needed.entry(station.fold).or_default().extend(vertices);
    }
    let at = |(fold, nodes)| (fold, errors_at(grid, nodes, &folds[fold]));
    let tables: BTreeMap<usize, BTreeMap<usize, NodeError>> = needed.into_iter().map(at).collect();
    let mut answers = Answers::default();
    for station in stations {
        if !like(station) {
            answers.unlike += 1;
            continue;
        }
        let errors = |node| tables[&station.fold][&node];
        let found = by_nodes(grid, errors, &station.position, interpolation, power);
        answers.add_found(station, found, &folds[station.fold]);
    }
    answers
}

/// The error at a point from those at the nodes; `None` outside the grid, or why its cell cannot serve.
pub fn by_nodes(
    grid: &PlacedGrid,
    errors: impl Fn(usize) -> NodeError,
    point: &Point3<f64>,
    interpolation: Interpolation,
    power: f64,
) -> Option<Result<Vector3<f64>, Refusal>> {
    let interpolated = |cell: InCell| {
        let weights = interpolation.weights(&cell.fraction, &grid.lattice.step, power);
        let weighted = cell.vertices.iter().zip(weights);
        weighted.map(|(&vertex, weight)| Ok(errors(vertex)? * weight)).sum()
    };
    Some(grid.cell(point)?.and_then(interpolated))
}

pub fn node_errors(grid: &PlacedGrid, model: &ToolErrors<'_>) -> Vec<NodeError> {
    errors_at(grid, (0..grid.nodes.len()).collect(), model).into_values().collect()
}

/// The model's error at some nodes, by their numbers.
fn errors_at(
    grid: &PlacedGrid,
    nodes: BTreeSet<usize>,
    model: &ToolErrors<'_>,
) -> BTreeMap<usize, NodeError> {
    let joints = |node: &usize| grid.nodes[*node].joints.as_deref();
    let sound: Vec<&[f64]> = nodes.iter().flat_map(joints).collect();
    let mut found = model.errors(&sound).into_iter();
    let error = |node: usize| {
        joints(&node).map_err(|refusal| *refusal)?;
        let found = found.next().expect("an error for each node with joint angles");
        found.map_err(|gap| gap.refusal())
    };
    let nodes: Vec<usize> = nodes.into_iter().collect();
    let errors: Vec<NodeError> = nodes.iter().copied().map(error).collect();
    nodes.into_iter().zip(errors).collect()
}

/// A place in the unit cell, uniform along each axis and seeded by the station's number.
fn random_place(number: usize) -> Vector3<f64> {
    let mut stream = ChaCha8Rng::seed_from_u64(number as u64);
    // The upper 53 bits are the digits that a number below one can have.
    let mut uniform = || (stream.next_u64() >> 11) as f64 * 2.0_f64.powi(-53);
    Vector3::from_fn(|_, _| uniform())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_the_cell_evenly() {
        let places = || (0..10_000).map(random_place);
        let mean = places().sum::<Vector3<f64>>() / 1e4;
        // A uniform number has a variance of 1/12: three standard errors of the mean of 10,000 are 0.009.
        assert!((mean - Vector3::repeat(0.5)).amax() < 0.009, "{mean}");
        let square = places().map(|own| own.map(|f| f * (1.0 - f))).sum::<Vector3<f64>>() / 1e4;
        // f(1 − f) has a mean of 1/6 and a standard deviation of 0.075.
        assert!((square - Vector3::repeat(1.0 / 6.0)).amax() < 0.003, "{square}");
    }
}
