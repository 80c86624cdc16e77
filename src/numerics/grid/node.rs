//! Nodes of a grid: the joint angles of the arm at each, and the error there.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::lattice::{InCell, Lattice};
use crate::fit::ErrorFrame;
pub use crate::fit::Refusal;
use crate::join::Station;
use crate::kinematics::{Anywhere, Arm, Configuration, Inverse, InverseError, InverseSettings};
use crate::progress::Progress;

/// The error at a node, base frame, mm, or why there is none.
pub type NodeError = Result<Vector3<f64>, Refusal>;

/// A station in the form that grids need.
#[derive(Debug, Clone, PartialEq)]
pub struct GridStation {
    pub number: usize,
    /// Number of the station that names its pose; all visits of one pose share it.
    pub pose: usize,
    /// Commanded position of the tool point in the base frame, mm.
    pub position: Point3<f64>,
    /// Orientation of the tool in the base frame.
    pub orientation: UnitQuaternion<f64>,
    /// Reported joint angles, rad.
    pub joints: Vec<f64>,
    /// The arm configuration, for six-axis arms.
    pub configuration: Option<Configuration>,
    /// Attained minus commanded position of the tool point in the base frame, mm.
    pub error: Vector3<f64>,
    /// The fold that holds it out.
    pub fold: usize,
    /// Changes of its error that another session may bring, mm: several, all equally likely; empty where not known.
    pub between_sessions: Vec<Vector3<f64>>,
}

impl GridStation {
    /// A paired station for grids: `commanded` is the tool's commanded pose in the base frame, where there is one. `None`
    /// for a station without a measurement. It is taken as the only visit of its pose.
    pub fn of(
        station: &Station,
        commanded: Option<Point3<f64>>,
        error_frame: &ErrorFrame<'_>,
        reach: &Reach<'_>,
        fold: usize,
    ) -> Option<Self> {
        let nominal = error_frame.nominal_tool(&station.joints);
        let position = commanded.unwrap_or_else(|| Point3::from(nominal.translation.vector));
        Some(Self {
            number: station.number,
            pose: station.number,
            position,
            orientation: nominal.rotation,
            configuration: reach.configuration(&station.joints),
            joints: station.joints.clone(),
            error: error_frame.tool_error(station, &position)?,
            fold,
            between_sessions: Vec::new(),
        })
    }

    /// Norms, mm, of its errors with between-session variation after `interpolated` is subtracted.
    pub(super) fn left_between_sessions(
        &self,
        interpolated: &Vector3<f64>,
    ) -> impl Iterator<Item = f64> {
        let left = self.error - interpolated;
        self.between_sessions.iter().map(move |moved| (left + moved).norm())
    }
}

/// Smallest singularity factor of a usable node (0 at a singularity, about 1 far away): nearer to one, joint angles and
/// with them the error change within less than any step.
const LEAST_SINGULARITY_FACTOR: f64 = 0.02;
/// By how much the tool of an arm with fewer than six joints may be turned from a pose whose position it has, rad: a command
/// that is some millimetres away from its target turns such a tool by as many milliradians.
const ORIENTATION_SLACK_RAD: f64 = 0.01;
/// Largest difference of joint angles between a cell's vertices on one branch, rad; lengths of a joint that slides count by
/// [`Joint::counted`](crate::kinematics::Joint::counted).
const BRANCH_RAD: f64 = 1.5;

/// Finds joint angles for tool poses near measured stations.
#[derive(Debug)]
pub struct Reach<'a> {
    arm: &'a Arm,
    flange_from_tool: Isometry3<f64>,
    settings: InverseSettings,
    pub inverse: Inverse<'a>,
    /// Radians that one unit of each joint's variable counts as, in the arm's order.
    pub counted: Vec<f64>,
}

impl<'a> Reach<'a> {
    /// The reach of the nominal `arm` for tool poses.
    pub fn new(arm: &'a Arm, flange_from_tool: Isometry3<f64>) -> Self {
        let settings = InverseSettings {
            least_singularity_factor: LEAST_SINGULARITY_FACTOR,
            orientation_slack_rad: ORIENTATION_SLACK_RAD,
            ..InverseSettings::default()
        };
        let inverse = Inverse::new(arm, &arm.no_offsets(), flange_from_tool, settings);
        Self { arm, flange_from_tool, settings, inverse, counted: arm.counted() }
    }

    /// Joint angles for a tool pose, in the arm configuration of `seed`.
    pub fn joints(
        &self,
        position: &Point3<f64>,
        orientation: &UnitQuaternion<f64>,
        seed: &[f64],
    ) -> Result<Vec<f64>, Refusal> {
        let pose = Isometry3::from_parts(Translation3::from(position.coords), *orientation);
        self.inverse.joints(&pose, seed).map_err(|error| match error {
            InverseError::NotReachable { .. }
            | InverseError::Orientation { .. }
            | InverseError::LimitReached { .. } => Refusal::OutOfReach,
            InverseError::ConfigurationChanged { .. } | InverseError::BranchChanged => {
                Refusal::OtherConfiguration
            }
            InverseError::NearSingularity { .. } => Refusal::Singularity,
        })
    }

    /// Joint angles for a tool pose that `accepts`, from seeds all over the joint limits.
    pub fn anywhere(
        &self,
        pose: &Isometry3<f64>,
        accepts: impl Fn(&[f64]) -> bool,
    ) -> Result<Vec<f64>, InverseError> {
        let tool = self.flange_from_tool;
        let anywhere = Anywhere::new(self.arm, &self.arm.no_offsets(), tool, self.settings);
        anywhere.joints_where(pose, None, accepts)
    }

    /// The arm configuration at reported joint angles; `None` for an arm that has none.
    pub fn configuration(&self, joints: &[f64]) -> Option<Configuration> {
        self.inverse.factors(joints).map(|factors| factors.configuration())
    }
}

/// Nodes between two looks at the progress, and at whether an end is asked for.
const SHOWN_EVERY: usize = 256;

/// A node of a lattice: the joint angles of the arm there, or why there are none.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Joint angles, rad.
    pub joints: Result<Vec<f64>, Refusal>,
    /// Distance to the nearest station of the same arm configuration, mm.
    pub nearest_mm: f64,
}

/// The nodes of a grid with the joint angles at which each is evaluated, and its usable cells.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedGrid {
    pub lattice: Lattice,
    pub orientation: UnitQuaternion<f64>,
    /// The nodes in the lattice's order.
    pub nodes: Vec<Placed>,
    /// Radians that one unit of each joint's variable counts as.
    counted: Vec<f64>,
}

impl PlacedGrid {
    /// Places nodes by inverse kinematics seeded at the nearest of `stations` (of one configuration): every node, or `some` by number.
    pub fn new(
        reach: &Reach<'_>,
        lattice: Lattice,
        orientation: UnitQuaternion<f64>,
        stations: &[&GridStation],
        some: Option<&BTreeSet<usize>>,
        progress: &dyn Progress,
    ) -> Self {
        let count = lattice.node_count();
        progress.begin("nodes placed", count as u64);
        let place = |number: usize| {
            if number.is_multiple_of(SHOWN_EVERY) {
                progress.advance(SHOWN_EVERY.min(count - number) as u64);
            }
            let position = lattice.position(number);
            let distance = |station: &GridStation| (station.position - position).norm();
            let is_asked = some.is_none_or(|some| some.contains(&number));
            let nearest = stations
                .iter()
                .filter(|_| is_asked)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)));
            nearest.map_or(
                Placed { joints: Err(Refusal::OutOfReach), nearest_mm: f64::INFINITY },
                |station| Placed {
                    joints: reach.joints(&position, &orientation, &station.joints),
                    nearest_mm: distance(station),
                },
            )
        };
        let nodes = (0..count).into_par_iter().map(place).collect();
        progress.end();
        Self { lattice, orientation, nodes, counted: reach.counted.clone() }
    }

    /// The cell of a point, or why it cannot serve; `None` outside the grid.
    pub fn cell(&self, point: &Point3<f64>) -> Option<Result<InCell, Refusal>> {
        let cell = self.lattice.locate(point)?;
        Some(self.usable(&cell.vertices).map(|()| cell))
    }

    pub fn refused_nodes(&self) -> BTreeMap<Refusal, usize> {
        count(self.nodes.iter().filter_map(|node| node.joints.as_ref().err().copied()))
    }

    pub fn refused_cells(&self) -> BTreeMap<Refusal, usize> {
        let cells = self.lattice.cells();
        count(cells.filter_map(|index| self.usable(&self.lattice.vertices(index)).err()))
    }

    /// Whether a cell of these nodes can serve, or why not.
    pub(super) fn usable(&self, vertices: &[usize; 8]) -> Result<(), Refusal> {
        let mut joints = Vec::with_capacity(8);
        for &vertex in vertices {
            joints.push(self.nodes[vertex].joints.as_deref().map_err(|refusal| *refusal)?);
        }
        if on_one_branch(&joints, &self.counted) { Ok(()) } else { Err(Refusal::Branches) }
    }
}

/// Whether no joint differs by more than `BRANCH_RAD` between any two of the joint vectors.
///
/// `counted` has the radians that one unit of each joint's variable counts as ([`Arm::counted`]); empty where all are angles.
pub fn on_one_branch(vectors: &[&[f64]], counted: &[f64]) -> bool {
    let Some(first) = vectors.first() else { return true };
    (0..first.len()).all(|joint| {
        let angles = vectors.iter().map(|vector| vector[joint]);
        let (low, high) =
            angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(q), h.max(q)));
        (high - low) * counted.get(joint).unwrap_or(&1.0) <= BRANCH_RAD
    })
}

pub fn count(refusals: impl Iterator<Item = Refusal>) -> BTreeMap<Refusal, usize> {
    let mut counts = BTreeMap::new();
    refusals.for_each(|refusal| *counts.entry(refusal).or_default() += 1);
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slide_counts_by_its_kind_where_a_cell_is_held_against_a_branch() {
        // A mm counts as a mrad: 400 mm apart are on one branch with the 0.4 rad of the other joint, 1600 mm are not.
        let counted = [1.0 / crate::units::SLIDE_MM_PER_RAD, 1.0];
        let near: [&[f64]; 2] = [&[100.0, 0.1], &[500.0, 0.5]];
        let far: [&[f64]; 2] = [&[100.0, 0.1], &[1700.0, 0.5]];
        assert!(on_one_branch(&near, &counted));
        assert!(!on_one_branch(&far, &counted));
        let flipped: [&[f64]; 2] = [&[100.0, -0.8], &[100.0, 0.8]];
        assert!(!on_one_branch(&flipped, &counted));
        // Without a list every joint is an angle.
        assert!(!on_one_branch(&near, &[]));
    }
}
