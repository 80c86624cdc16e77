//! Grids whose node values are the stations measured at the nodes: the seed paper's own way.
//!
//! Only a session measured on a grid has them. Coarser steps come from decimation: every phase of every multiple of the
//! pitch is a grid of its own, judged on all stations inside it that are not its nodes.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use super::answers::Answers;
use super::interpolation::Interpolation;
use super::lattice::{Lattice, PLANE_MM};
use super::node::{GridStation, Refusal, on_one_branch};
use crate::kinematics::Configuration;
use crate::units::whole;

/// A session's own grid: the station at each node.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredGrid {
    /// The lattice of the session's pitch.
    pub lattice: Lattice,
    /// Index in the list of stations for each node that was measured.
    pub stations: BTreeMap<[usize; 3], usize>,
    /// Radians that one unit of each joint's variable counts as.
    counted: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotOnGrid {
    #[error("the commanded positions do not lie on planes of equal pitch along {axis}")]
    NoPitch { axis: char },
    /// More than half of the nodes were not visited.
    #[error("only {measured} of the {nodes} nodes of its pitch were measured")]
    Sparse { measured: usize, nodes: usize },
    #[error("its stations have more than one tool orientation")]
    Mixed,
}

/// Largest difference of tool orientations in one grid, rad.
const ONE_ORIENTATION_RAD: f64 = 0.02;

impl MeasuredGrid {
    /// The grid that `stations` are on. `counted`: radians that one unit of each joint's variable counts as; empty: all are angles.
    pub fn of(stations: &[GridStation], counted: &[f64]) -> Result<Self, NotOnGrid> {
        let axes: Vec<_> = (0..3).map(|axis| planes(stations, axis)).collect::<Result<_, _>>()?;
        let lattice = Lattice {
            origin: Point3::new(axes[0].first, axes[1].first, axes[2].first),
            step: std::array::from_fn(|axis| axes[axis].pitch),
            counts: std::array::from_fn(|axis| axes[axis].count),
        };
        let first = stations.first().ok_or(NotOnGrid::Sparse { measured: 0, nodes: 0 })?;
        let angle_rad = |s: &GridStation| s.orientation.angle_to(&first.orientation);
        if !stations.iter().all(|s| angle_rad(s) < ONE_ORIENTATION_RAD) {
            return Err(NotOnGrid::Mixed);
        }
        // A node visited twice keeps its first visit; later ones judge other phases, but not their own node.
        let node = |s: &GridStation| std::array::from_fn(|axis| axes[axis].index(s.position[axis]));
        let latest_first = stations.iter().enumerate().rev();
        let places: BTreeMap<_, _> = latest_first.map(|(place, s)| (node(s), place)).collect();
        if 2 * places.len() < lattice.node_count() {
            return Err(NotOnGrid::Sparse { measured: places.len(), nodes: lattice.node_count() });
        }
        Ok(Self { lattice, stations: places, counted: counted.to_vec() })
    }

    /// The step in pitches along each axis; `None` where it is no whole multiple or leaves no cell.
    pub(super) fn multiples(&self, step_mm: f64) -> Option<[usize; 3]> {
        let multiple = |axis: usize| {
            let exact = step_mm / self.lattice.step[axis];
            (1..self.lattice.counts[axis]).find(|&whole| (whole as f64 - exact).abs() < 1e-3)
        };
        Some([multiple(0)?, multiple(1)?, multiple(2)?])
    }

    /// What every phase of the decimation by `multiples` answers at the stations that are no nodes of it, and how much of the
    /// interpolation error these can show.
    pub fn answers(
        &self,
        stations: &[GridStation],
        multiples: [usize; 3],
        interpolation: Interpolation,
        power: f64,
    ) -> (Answers, Option<f64>) {
        let (mut answers, mut shown) = (Answers::default(), Vec::new());
        let [mx, my, mz] = multiples;
        for (sample, phase) in (0..mz)
            .flat_map(|z| (0..my).flat_map(move |y| (0..mx).map(move |x| [x, y, z])))
            .enumerate()
        {
            let Some(decimated) = self.decimated(multiples, phase) else { continue };
            let before = answers.given.len();
            for place in 0..stations.len() {
                decimated.add(&mut answers, stations, place, sample, interpolation, power);
            }
            let given: BTreeSet<usize> =
                answers.given[before..].iter().map(|own| own.station).collect();
            let judging = stations.iter().filter(|own| given.contains(&own.number));
            let of_phase = decimated.lattice.interpolation_shown(judging.map(|own| &own.position));
            shown.extend(of_phase.map(|share| share * given.len() as f64));
        }
        let share = shown.iter().sum::<f64>() / answers.given.len() as f64;
        let share = (!answers.given.is_empty()).then_some(share);
        (answers, share)
    }

    /// The grid of every `multiples`-th node from `phase`; `None` where it has no cell.
    pub(super) fn decimated(&self, multiples: [usize; 3], phase: [usize; 3]) -> Option<Decimated> {
        let counts: [usize; 3] = std::array::from_fn(|axis| {
            (self.lattice.counts[axis].saturating_sub(1 + phase[axis])) / multiples[axis] + 1
        });
        if counts.iter().any(|&count| count < 2) {
            return None;
        }
        let at =
            |axis: usize| self.lattice.origin[axis] + phase[axis] as f64 * self.lattice.step[axis];
        let step = std::array::from_fn(|axis| multiples[axis] as f64 * self.lattice.step[axis]);
        let lattice = Lattice { origin: Point3::new(at(0), at(1), at(2)), step, counts };
        let fine = |number: usize| {
            let [nx, ny, _] = counts;
            let index = [number % nx, number / nx % ny, number / (nx * ny)];
            std::array::from_fn::<_, 3, _>(|axis| phase[axis] + multiples[axis] * index[axis])
        };
        let nodes = (0..lattice.node_count())
            .map(|number| self.stations.get(&fine(number)).copied())
            .collect();
        let counted = self.counted.clone();
        Some(Decimated { lattice, nodes, counted })
    }
}

/// One decimated grid: the station at each of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimated {
    pub lattice: Lattice,
    /// Index in the list of stations; `None` where the node was not measured.
    pub nodes: Vec<Option<usize>>,
    /// Radians that one unit of each joint's variable counts as.
    counted: Vec<f64>,
}

impl Decimated {
    /// Adds the answer of this grid, number `sample` of several, at the station at `place`; visits of its own nodes take no part.
    fn add(
        &self,
        answers: &mut Answers,
        stations: &[GridStation],
        place: usize,
        sample: usize,
        interpolation: Interpolation,
        power: f64,
    ) {
        if self.nodes.contains(&Some(place)) {
            return;
        }
        let station = &stations[place];
        let Some(cell) = self.lattice.locate(&station.position) else {
            answers.outside += 1;
            return;
        };
        let is_own = |node: &GridStation| {
            node.pose == station.pose || (node.position - station.position).norm() < PLANE_MM
        };
        let nodes = cell.vertices.iter().filter_map(|&vertex| self.nodes[vertex]);
        if nodes.map(|node| &stations[node]).any(is_own) {
            return;
        }
        let weights = interpolation.weights(&cell.fraction, &self.lattice.step, power);
        let found = self.serving(&cell.vertices, stations, station.configuration).map(|vertices| {
            (vertices.iter().zip(weights).map(|(vertex, w)| vertex.error * w).sum(), None)
        });
        answers.add(station, sample, found);
    }

    /// The stations at the vertices of a cell, if they can serve a target of this arm configuration; otherwise why not.
    pub(super) fn serving<'s>(
        &self,
        vertices: &[usize; 8],
        stations: &'s [GridStation],
        configuration: Option<Configuration>,
    ) -> Result<Vec<&'s GridStation>, Refusal> {
        let station =
            |&vertex: &usize| Ok(&stations[self.nodes[vertex].ok_or(Refusal::Unmeasured)?]);
        let stations: Vec<&GridStation> = vertices.iter().map(station).collect::<Result<_, _>>()?;
        if stations.iter().any(|s| s.configuration != configuration) {
            return Err(Refusal::OtherConfiguration);
        }
        let joints: Vec<&[f64]> = stations.iter().map(|s| s.joints.as_slice()).collect();
        if on_one_branch(&joints, &self.counted) { Ok(stations) } else { Err(Refusal::Branches) }
    }
}

/// Equally spaced planes along one axis.
struct Planes {
    first: f64,
    pitch: f64,
    count: usize,
}

impl Planes {
    fn index(&self, value: f64) -> usize {
        whole(((value - self.first) / self.pitch).round().clamp(0.0, (self.count - 1) as f64))
    }
}

fn planes(stations: &[GridStation], axis: usize) -> Result<Planes, NotOnGrid> {
    let none = NotOnGrid::NoPitch { axis: ['x', 'y', 'z'][axis] };
    let mut values: Vec<f64> = stations.iter().map(|station| station.position[axis]).collect();
    values.sort_by(f64::total_cmp);
    let planes = values.chunk_by(|before, value| value - before <= PLANE_MM);
    let starts: Vec<f64> = planes.map(|plane| plane[0]).collect();
    let gaps: Vec<f64> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let pitch = gaps.iter().copied().reduce(f64::min).ok_or(none)?;
    let is_whole = |gap: f64| (gap / pitch - (gap / pitch).round()).abs() * pitch <= PLANE_MM;
    if pitch <= 4.0 * PLANE_MM || !gaps.iter().all(|&gap| is_whole(gap)) {
        return Err(none);
    }
    let (first, last) = (starts[0], starts[starts.len() - 1]);
    let count = whole(((last - first) / pitch).round()) + 1;
    // The smallest gap includes the rounding of two commands; the whole extent distributes it over all gaps.
    Ok(Planes { first, pitch: (last - first) / (count - 1) as f64, count })
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::figures::Counted;
    use crate::grid::HeldOut;
    use crate::grid::answers::by_number;

    /// Every node of 3 × 3 × 3 with a pitch of 100 mm, visited twice, one round after the other. The second round's
    /// commands are `off_mm` away from the first's.
    fn twice(off_mm: f64, is_one_pose: bool) -> Vec<GridStation> {
        let station = |number: usize| {
            let node = number % 27;
            let [x, y, z] = [node % 3, node / 3 % 3, node / 9].map(|index| 100.0 * index as f64);
            let again = (number / 27) as f64;
            GridStation {
                number,
                pose: if is_one_pose { node } else { number },
                position: Point3::new(x + again * off_mm, y, z),
                orientation: UnitQuaternion::identity(),
                joints: vec![0.0; 6],
                configuration: None,
                error: Vector3::new(0.1 * node as f64 + 0.01 * again, 0.0, 0.0),
                fold: 0,
                between_sessions: Vec::new(),
            }
        };
        (0..54).map(station).collect()
    }

    fn judged(stations: &[GridStation], multiple: usize) -> HeldOut {
        let grid = MeasuredGrid::of(stations, &[]).expect("a grid");
        let (answers, _) = grid.answers(stations, [multiple; 3], Interpolation::Trilinear, 2.0);
        HeldOut::left_by(&answers, &by_number(stations))
    }

    #[test]
    fn another_visit_of_a_node_is_no_held_out_station() {
        // Each station is a node or is at one: its own measurement would judge it.
        let stations = twice(0.0, true);
        assert_eq!(judged(&stations, 1).counted(), Counted::default());
        // A command rounded otherwise is another pose, and at the same node.
        assert_eq!(judged(&twice(0.05, false), 1).counted(), Counted::default());
        // With every second node the eight corners are left; the 19 poses between them judge, each visited twice.
        let held_out = judged(&stations, 2);
        let expected = Counted { poses: 19, visits: 38 };
        assert_eq!(held_out.counted(), expected);
        assert_eq!(held_out.norms.len(), 38);
    }
}
