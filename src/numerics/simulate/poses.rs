//! The poses of a session: commanded poses of the measured target, and the joint angles that the controller computes.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::SimulateError;
use super::random::{Ingredient, Stream};
use super::settings::{Poses, SimulateSettings};
use crate::geometry::isometry_from_rpy;
use crate::kinematics::{Arm, InverseError, InverseSettings, inverse};
use crate::units::whole;

/// A commanded pose of the measured target in the base frame, and the nominal arm's joint angles for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Commanded {
    pub base_from_target: Isometry3<f64>,
    /// The nominal arm's reported angles at the pose, rad.
    pub joints: Vec<f64>,
}

/// Redraws per random pose before the box is called unreachable.
const REDRAWS: usize = 100;
/// Poses nearer to a singularity than this factor are not visited.
const LEAST_SINGULARITY_FACTOR: f64 = 0.03;
/// The most poses one session may have: a month of measuring.
const MOST_POSES: usize = 1_000_000;

pub(super) fn commanded(
    arm: &Arm,
    settings: &SimulateSettings,
) -> Result<Vec<Commanded>, SimulateError> {
    let cell = &settings.cell;
    let controller = Controller {
        arm,
        nominal: arm.no_offsets(),
        flange_from_target: isometry_from_rpy(
            cell.flange_from_target_mm,
            cell.flange_from_target_rpy,
        ),
        home: &settings.home,
        seed: settings.seed,
    };
    let turned = |rpy: &[f64; 3]| isometry_from_rpy([0.0; 3], *rpy).rotation;
    match &settings.poses {
        Poses::Grid { lower_mm, upper_mm, step_mm, orientation_rpy } => {
            controller.grid(&serpentine(*lower_mm, *upper_mm, *step_mm)?, turned(orientation_rpy))
        }
        Poses::Box { count, lower_mm, upper_mm, orientation_rpy, cone_rad } => {
            controller.random(*count, [*lower_mm, *upper_mm], turned(orientation_rpy), *cone_rad)
        }
        Poses::Joints { count, lower, upper } => controller.random_joints(*count, lower, upper),
        Poses::Listed { joints } => controller.listed(joints),
    }
}

/// Nodes of a grid, x fastest; each line and layer runs in the direction opposite to the last one.
fn serpentine(
    lower: [f64; 3],
    upper: [f64; 3],
    step: f64,
) -> Result<Vec<Vector3<f64>>, SimulateError> {
    let [nx, ny, nz] = node_counts(lower, upper, step)?;
    let back = |turn: usize, i: usize, n: usize| if turn % 2 == 1 { n - 1 - i } else { i };
    let mut nodes = Vec::with_capacity(nx * ny * nz);
    for z in 0..nz {
        for row in 0..ny {
            let y = back(z, row, ny);
            for column in 0..nx {
                let x = back(z * ny + row, column, nx);
                let index = Vector3::new(x as f64, y as f64, z as f64);
                nodes.push(Vector3::from(lower) + index * step);
            }
        }
    }
    Ok(nodes)
}

/// `⌊Δ/L⌋ + 1` nodes along each axis ([`crate::method::grids`]), at least one and together no more than a session can have.
fn node_counts(lower: [f64; 3], upper: [f64; 3], step: f64) -> Result<[usize; 3], SimulateError> {
    // The tolerance allows for the rounding of a size that is a whole number of steps.
    let steps = |axis: usize| ((upper[axis] - lower[axis]) / step + 1e-9).floor();
    let counts: [f64; 3] = std::array::from_fn(|axis| steps(axis) + 1.0);
    if !counts.iter().all(|&count| count >= 1.0) || step <= 0.0 {
        return Err(SimulateError::EmptyBox { lower, upper, step });
    }
    check_count(counts.iter().product())?;
    Ok(counts.map(whole))
}

fn check_count(asked: f64) -> Result<(), SimulateError> {
    if asked > MOST_POSES as f64 {
        Err(SimulateError::TooManyPoses { asked, most: MOST_POSES })
    } else {
        Ok(())
    }
}

/// The controller: it knows the nominal arm and the nominal place of the measured target.
struct Controller<'a> {
    arm: &'a Arm,
    nominal: Vec<f64>,
    flange_from_target: Isometry3<f64>,
    home: &'a [f64],
    seed: u64,
}

impl Controller<'_> {
    /// Joint angles for a pose, searched from the last pose and, where that fails, from home.
    fn angles(&self, pose: &Isometry3<f64>, last: &[f64]) -> Result<Vec<f64>, InverseError> {
        let settings = InverseSettings {
            least_singularity_factor: LEAST_SINGULARITY_FACTOR,
            ..InverseSettings::default()
        };
        let from = |seed| {
            inverse(self.arm, &self.nominal, pose, &self.flange_from_target, seed, &settings)
        };
        from(last).or_else(|_| from(self.home))
    }

    fn grid(
        &self,
        nodes: &[Vector3<f64>],
        turned: UnitQuaternion<f64>,
    ) -> Result<Vec<Commanded>, SimulateError> {
        let mut last = self.home.to_vec();
        let mut poses = Vec::with_capacity(nodes.len());
        for node in nodes {
            let pose = Isometry3::from_parts(Translation3::from(*node), turned);
            last = self
                .angles(&pose, &last)
                .map_err(|source| SimulateError::Node { node: (*node).into(), source })?;
            poses.push(Commanded { base_from_target: pose, joints: last.clone() });
        }
        Ok(poses)
    }

    fn random(
        &self,
        count: usize,
        [lower, upper]: [[f64; 3]; 2],
        turned: UnitQuaternion<f64>,
        cone_rad: f64,
    ) -> Result<Vec<Commanded>, SimulateError> {
        let mut stream = Stream::new(self.seed, Ingredient::Poses);
        let draw = |last: &[f64]| {
            let place = Vector3::from_fn(|axis, _| stream.between(lower[axis], upper[axis]));
            let axis = nalgebra::Unit::new_normalize(stream.normal3());
            let turn = UnitQuaternion::from_axis_angle(&axis, cone_rad * stream.uniform());
            let pose = Isometry3::from_parts(Translation3::from(place), turn * turned);
            let joints = self.angles(&pose, last)?;
            Ok(Commanded { base_from_target: pose, joints })
        };
        self.drawn(count, draw)
    }

    fn random_joints(
        &self,
        count: usize,
        lower: &[f64],
        upper: &[f64],
    ) -> Result<Vec<Commanded>, SimulateError> {
        let joints = self.arm.joints().len();
        for bounds in [lower, upper] {
            super::check_length("bounds of joint poses", joints, bounds.len())?;
        }
        let mut stream = Stream::new(self.seed, Ingredient::Poses);
        let draw = |_: &[f64]| {
            let sides = lower.iter().zip(upper);
            let joints: Vec<f64> = sides.map(|(from, to)| stream.between(*from, *to)).collect();
            let pose = self.arm.flange(&joints).isometry() * self.flange_from_target;
            // Only poses that are reached in home's arm configuration within the limits are visited.
            self.angles(&pose, &joints).map(|joints| Commanded { base_from_target: pose, joints })
        };
        self.drawn(count, draw)
    }

    fn listed(&self, joints: &[Vec<f64>]) -> Result<Vec<Commanded>, SimulateError> {
        check_count(joints.len() as f64)?;
        let at = |joints: &Vec<f64>| {
            super::check_length("listed poses", self.arm.joints().len(), joints.len())?;
            Ok(Commanded {
                base_from_target: self.arm.flange(joints).isometry() * self.flange_from_target,
                joints: joints.clone(),
            })
        };
        joints.iter().map(at).collect()
    }

    /// `count` poses, each drawn from the one before until it can be reached.
    fn drawn(
        &self,
        count: usize,
        mut draw: impl FnMut(&[f64]) -> Result<Commanded, InverseError>,
    ) -> Result<Vec<Commanded>, SimulateError> {
        check_count(count as f64)?;
        let mut poses: Vec<Commanded> = Vec::with_capacity(count);
        for number in 0..count {
            let last = poses.last().map_or(self.home, |pose| &pose.joints);
            let pose = reachable(|| draw(last)).map_err(|source| SimulateError::Unreachable {
                number,
                redraws: REDRAWS,
                source,
            })?;
            poses.push(pose);
        }
        Ok(poses)
    }
}

/// The first of [`REDRAWS`] draws that can be reached, or why the last one cannot.
fn reachable(
    mut draw: impl FnMut() -> Result<Commanded, InverseError>,
) -> Result<Commanded, InverseError> {
    let mut outcome = draw();
    for _ in 1..REDRAWS {
        if outcome.is_ok() {
            break;
        }
        outcome = draw();
    }
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_serpentine_never_jumps() {
        let nodes = serpentine([0.0; 3], [200.0, 300.0, 100.0], 100.0).expect("a box");
        // 3 × 4 × 2 nodes, neighbours in time are neighbours in space.
        assert_eq!(nodes.len(), 24);
        for pair in nodes.windows(2) {
            assert!(((pair[1] - pair[0]).norm() - 100.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_box_is_cut_to_whole_steps() {
        let nodes = serpentine([0.0; 3], [250.0, 0.0, 0.0], 100.0).expect("a line is a box too");
        assert_eq!(nodes.len(), 3);
    }

    #[test]
    fn boxes_without_nodes_or_with_too_many_are_refused() {
        assert!(matches!(
            serpentine([0.0; 3], [-1.0, 1.0, 1.0], 100.0),
            Err(SimulateError::EmptyBox { .. })
        ));
        assert!(matches!(
            serpentine([0.0; 3], [1e9; 3], 1e-3),
            Err(SimulateError::TooManyPoses { .. })
        ));
        assert!(serpentine([0.0; 3], [1.0; 3], f64::NAN).is_err());
    }
}
