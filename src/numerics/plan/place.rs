//! Poses of a region: the joint angles of the nominal arm for each, in the arm configuration of the plan.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::PlanError;
use super::line_of_sight::Unsuitable;
use super::settings::{PlanSettings, Region};
use crate::grid::{GridStation, Lattice, PlacedGrid, Reach, Refusal, WorkBox};
use crate::kinematics::Arm;
use crate::progress::Quiet;
use crate::simulate::{Commanded, Stream};

/// Number of draws per wanted pose before the region counts as out of reach.
const DRAWS: usize = 20;

/// Places poses: the arm's inverse kinematics, and start poses all over the region.
#[derive(Debug)]
pub struct Placer<'a> {
    arm: &'a Arm,
    flange_from_target: Isometry3<f64>,
    pub reach: Reach<'a>,
    seeds: Vec<GridStation>,
    /// Joints that slide on an arm with more joints than a pose needs: a pose leaves them free.
    free: Vec<usize>,
}

/// A pose of the target, with the positions of the free slides that it is to be reached from, mm.
struct Drawing {
    pose: Isometry3<f64>,
    slides: Vec<f64>,
}

impl<'a> Placer<'a> {
    /// Starts from home, then from the middle of the box, then from the 27 nodes of a coarse lattice in it.
    pub fn new(arm: &'a Arm, settings: &PlanSettings) -> Result<Self, PlanError> {
        let reach = Reach::new(arm, settings.flange_from_target);
        let region = &settings.region;
        let (flange_from_target, free) = (settings.flange_from_target, free_slides(arm));
        let mut placer = Self { arm, flange_from_target, reach, seeds: Vec::new(), free };
        let home = arm.flange(&settings.home).isometry() * settings.flange_from_target;
        placer.add(&home, settings.home.clone());
        let lattice = Lattice::of_cells(&region.bounds, [2; 3])?;
        let mut order: Vec<usize> = (0..lattice.node_count()).collect();
        let middle = lattice.position(lattice.node_count() / 2);
        let away = |&node: &usize| (lattice.position(node) - middle).norm();
        order.sort_by(|a, b| away(a).total_cmp(&away(b)));
        for node in order {
            let pose = posed(&lattice.position(node), &region.orientation);
            if let Ok(joints) = placer.joints(&pose) {
                placer.add(&pose, joints);
            }
        }
        Ok(placer)
    }

    fn add(&mut self, pose: &Isometry3<f64>, joints: Vec<f64>) {
        self.seeds.push(GridStation {
            number: self.seeds.len(),
            pose: self.seeds.len(),
            position: Point3::from(pose.translation.vector),
            orientation: pose.rotation,
            configuration: self.reach.configuration(&joints),
            joints,
            error: Vector3::zeros(),
            fold: 0,
            between_sessions: Vec::new(),
        });
    }

    pub fn joints(&self, pose: &Isometry3<f64>) -> Result<Vec<f64>, Refusal> {
        let position = Point3::from(pose.translation.vector);
        let away = |seed: &GridStation| (seed.position - position).norm();
        let nearest = self.seeds.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        self.reach.joints(&position, &pose.rotation, &nearest.expect("home is a seed").joints)
    }

    pub fn commanded(&self, pose: Isometry3<f64>) -> Result<Commanded, Refusal> {
        let joints = self.joints(&pose)?;
        Ok(Commanded { base_from_target: pose, joints })
    }

    /// A drawing as a command: from the known pose that is nearest once its free slides are where the drawing has them.
    fn drawn(&self, drawing: &Drawing) -> Result<Commanded, Refusal> {
        if self.free.is_empty() {
            return self.commanded(drawing.pose);
        }
        let slid = |seed: &GridStation| {
            let mut joints = seed.joints.clone();
            for (&joint, &place) in self.free.iter().zip(&drawing.slides) {
                joints[joint] = place;
            }
            let target = self.arm.flange(&joints).isometry() * self.flange_from_target;
            let away = target.translation.vector - drawing.pose.translation.vector;
            (away.norm(), joints)
        };
        let nearest = self.seeds.iter().map(slid).min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, seed) = nearest.expect("home is a seed");
        let position = Point3::from(drawing.pose.translation.vector);
        let joints = self.reach.joints(&position, &drawing.pose.rotation, &seed)?;
        Ok(Commanded { base_from_target: drawing.pose, joints })
    }

    /// A random pose of a region; each free slide anywhere within its limits.
    fn draw(&self, region: &Region, stream: &mut Stream) -> Drawing {
        let pose = draw(region, stream);
        let own = self.free.iter().map(|&joint| &self.arm.joints()[joint]);
        let slides = own.map(|joint| stream.between(joint.lower, joint.upper));
        Drawing { pose, slides: slides.collect() }
    }

    /// A lattice with every node placed at the table's orientation.
    pub fn grid(&self, lattice: Lattice, orientation: UnitQuaternion<f64>) -> PlacedGrid {
        let seeds: Vec<&GridStation> = self.seeds.iter().collect();
        PlacedGrid::new(&self.reach, lattice, orientation, &seeds, None, &Quiet)
    }

    /// `count` random poses of the region that `suits` accepts, in a seeded order, and the number of poses drawn. An arm that slides
    /// and has more joints than a pose needs has each pose from anywhere on its slides.
    pub fn random(
        &self,
        region: &Region,
        count: usize,
        stream: &mut Stream,
        suits: &(dyn Fn(&[f64]) -> Result<(), Unsuitable> + Sync),
    ) -> Result<(Vec<Commanded>, Drawn), PlanError> {
        let placed = |drawing: &Drawing| {
            let command = self.drawn(drawing).map_err(Refusal::name)?;
            suits(&command.joints).map_err(|why| why.name())?;
            Ok(command)
        };
        let mut found: Vec<Commanded> = Vec::new();
        let mut drawn = Drawn::default();
        for _ in 0..DRAWS {
            if found.len() == count {
                break;
            }
            let batch: Vec<Drawing> = (0..count).map(|_| self.draw(region, stream)).collect();
            let batch: Vec<Result<Commanded, &'static str>> =
                batch.par_iter().map(placed).collect();
            for pose in batch {
                if found.len() == count {
                    break;
                }
                drawn.poses += 1;
                match pose {
                    Ok(command) => found.push(command),
                    Err(reason) => *drawn.refused.entry(reason).or_default() += 1,
                }
            }
        }
        if found.len() < count {
            return Err(PlanError::OutOfReach {
                wanted: count,
                found: found.len(),
                drawn: drawn.poses,
                refused: drawn.refused,
            });
        }
        Ok((found, drawn))
    }
}

/// Joints of a redundant arm that slide between finite limits.
fn free_slides(arm: &Arm) -> Vec<usize> {
    let joints = arm.joints();
    let is_free = |joint: &usize| {
        let own = &joints[*joint];
        own.slides && own.lower.is_finite() && own.upper.is_finite()
    };
    (0..joints.len()).filter(|_| joints.len() > 6).filter(is_free).collect()
}

/// Random poses that were drawn, and the reasons why some were not taken.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Drawn {
    pub poses: usize,
    pub refused: BTreeMap<&'static str, usize>,
}

pub(super) fn posed(position: &Point3<f64>, orientation: &UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(position.coords), *orientation)
}

/// A random pose of a region: uniform in the box, turned about a random axis by a uniform angle up to the cone's.
fn draw(region: &Region, stream: &mut Stream) -> Isometry3<f64> {
    let WorkBox { low_mm, high_mm } = region.bounds;
    let place =
        Point3::from(Vector3::from_fn(|axis, _| stream.between(low_mm[axis], high_mm[axis])));
    let axis = nalgebra::Unit::new_normalize(stream.normal3());
    let turn = UnitQuaternion::from_axis_angle(&axis, region.cone_rad * stream.uniform());
    posed(&place, &(turn * region.orientation))
}
