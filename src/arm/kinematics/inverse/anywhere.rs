//! Joint angles for a pose alone: the search from seeds all over the joint limits.

use nalgebra::Isometry3;

use super::search::Search;
use super::variables::spread;
use super::{InverseError, InverseSettings};
use crate::kinematics::arm::Arm;

/// Joint angles that a search may begin at, spread evenly over the limits.
const SEEDS: u32 = 512;
/// Seeds tried, the nearest to the pose first.
const NEAREST: usize = 16;
/// Seeds tried after them, evenly from the nearest to the furthest.
const OTHERS: usize = 80;

#[derive(Debug)]
struct Seed {
    joints: Vec<f64>,
    base_from_end: Isometry3<f64>,
}

/// Finds joint angles of any arm for poses all over its working space, without a seed.
///
/// It holds the seeds: one is made for an arm, and serves many poses.
///
/// ```
/// use nalgebra::Isometry3;
/// use posegrid_arm::kinematics::{Anywhere, InverseSettings, RobotFile};
///
/// let file: RobotFile = toml::from_str(&std::fs::read_to_string("../../pipelines/robots/ur10.toml")?)?;
/// let arm = file.arm()?;
/// let nominal = arm.no_offsets();
/// let anywhere = Anywhere::new(&arm, &nominal, Isometry3::identity(), InverseSettings::default());
/// let pose = *arm.flange(&[0.3, -1.2, 1.5, -1.8, -1.5, 0.4]).isometry();
/// let found = anywhere.joints_where(&pose, None, |_| true)?;
/// assert!((arm.flange(&found).isometry().translation.vector - pose.translation.vector).norm() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Anywhere<'a> {
    search: Search<'a>,
    seeds: Vec<Seed>,
}

impl<'a> Anywhere<'a> {
    /// Seeds within the limits of an arm with parameter offsets, as [`super::inverse`] takes them.
    pub fn new(
        arm: &'a Arm,
        offsets: &[f64],
        flange_from_end: Isometry3<f64>,
        settings: InverseSettings,
    ) -> Self {
        let search = Search::new(arm, offsets, flange_from_end, settings);
        let joints = search.variables.iter().zip(arm.joints());
        let ranges: Vec<_> = joints.map(|(own, joint)| own.range(joint)).collect();
        let seed = |number| {
            let joints = spread(number, &ranges);
            Seed { base_from_end: search.end(&joints), joints }
        };
        let seeds = (0..SEEDS).map(seed).collect();
        Self { search, seeds }
    }

    /// Joint angles within the limits at which the end has the pose. With `near`, joints take the turn nearest to it;
    /// without, the one nearest the middle of their limits. The error is of the seed that came nearest to a solution. Of joint angles
    /// those that `accepts`; where it accepts none, the error is of seeds without a solution.
    pub fn joints_where(
        &self,
        base_from_end: &Isometry3<f64>,
        near: Option<&[f64]>,
        accepts: impl Fn(&[f64]) -> bool,
    ) -> Result<Vec<f64>, InverseError> {
        let search = &self.search;
        search.within_links(base_from_end)?;
        let mut nearest: Option<InverseError> = None;
        for seed in self.order(base_from_end) {
            match search.tried(base_from_end, &seed.joints, near) {
                Ok(joints) if accepts(&joints) => return Ok(joints),
                Err(error) if nearest.as_ref().is_none_or(|near| key(&error) < key(near)) => {
                    nearest = Some(error);
                }
                Ok(_) | Err(_) => {}
            }
        }
        Err(nearest.unwrap_or_else(|| search.not_reachable(base_from_end, &self.seeds[0].joints)))
    }

    fn order(&self, pose: &Isometry3<f64>) -> impl Iterator<Item = &Seed> {
        let lever = self.search.settings.lever_mm;
        let apart = |seed: &Seed| {
            let end = &seed.base_from_end;
            let place = (end.translation.vector - pose.translation.vector).norm();
            place + lever * end.rotation.angle_to(&pose.rotation)
        };
        let mut seeds: Vec<(f64, &Seed)> =
            self.seeds.iter().map(|seed| (apart(seed), seed)).collect();
        seeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let stride = seeds.len() / OTHERS;
        let places = (0..NEAREST).chain((NEAREST..seeds.len()).step_by(stride));
        places.map(move |place| seeds[place].1)
    }
}

impl Search<'_> {
    fn tried(
        &self,
        base_from_end: &Isometry3<f64>,
        seed: &[f64],
        near: Option<&[f64]>,
    ) -> Result<Vec<f64>, InverseError> {
        let found = match self.solve(base_from_end, seed) {
            Ok(found) => found,
            Err(ended) if seed.len() < 6 => self.nearest_orientation(base_from_end, &ended)?,
            Err(ended) => return Err(self.not_reachable(base_from_end, &ended)),
        };
        let found = self.within_limits(base_from_end, self.turned(&found, near));
        self.check_limits(&found)?;
        self.check_singularity(&found)?;
        Ok(found)
    }

    /// Joint values on the turns within the limits that are nearest to `near`, or to the middle of the limits.
    fn turned(&self, joints: &[f64], near: Option<&[f64]>) -> Vec<f64> {
        let own = self.arm.joints().iter().zip(&self.variables);
        let turned = own.enumerate().map(|(place, (joint, variable))| {
            let [low, high] = variable.range(joint);
            let near = near.map_or(low.midpoint(high), |near| near[place]);
            variable.within(joint, joints[place], near)
        });
        turned.collect()
    }
}

/// Smaller for an error that is nearer to a solution: first by its kind, then by how far off it is.
fn key(error: &InverseError) -> (u8, f64) {
    match error {
        InverseError::NearSingularity { factor, .. } => (0, -factor),
        InverseError::LimitReached { value, lower, upper, .. } => {
            (1, (lower - value).max(value - upper))
        }
        InverseError::Orientation { off_deg, .. } => (2, *off_deg),
        InverseError::NotReachable { position_mm, orientation_rad } => {
            (3, position_mm.hypot(*orientation_rad * 500.0))
        }
        InverseError::ConfigurationChanged { .. } | InverseError::BranchChanged => (4, 0.0),
    }
}
