//! A promise held against what was measured after: that of a plan against the session that was measured by it.
//!
//! Inputs: a [`PlanPromise`], the session's stations, and what a model that did not see them leaves on each. Output: a
//! [`PromiseKept`], which the promise of a table is held by too ([`super::driven`]). Only visits that were planned to verify count; they are found by their joint angles.

use std::collections::BTreeSet;

use crate::figures::{Counted, Figures, PoseErrors, share_interval};

/// A station is at a planned pose where no joint differs by more than this, rad (half a degree): joint angles are all that
/// is planned. [`crate::fit::visits`] finds which stations are visits of one pose.
const SAME_POSE_RAD: f64 = 8.726_646_259_971_648e-3;

/// What was promised of errors before they were measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promise {
    /// Promised mean error, mm; `None` where it is not promised.
    pub mean_mm: Option<f64>,
    /// What `share` of errors stays below, mm; `None` where nothing is promised of it.
    pub bound_mm: Option<f64>,
    pub share: f64,
    pub confidence: f64,
}

/// What a plan promised, and the poses that verify it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanPromise {
    pub plan: String,
    pub verify: Vec<Vec<f64>>,
    /// Radians that one unit of each joint's variable counts as; 1 beyond its end.
    pub counted: Vec<f64>,
    pub promise: Promise,
}

/// A station with the error that a model which did not see it leaves there.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    pub joints: Vec<f64>,
    /// Number of the station that names its pose; all visits of one pose share it.
    pub pose: usize,
    pub left_mm: f64,
}

/// A promise held against errors that were measured. A pose counts once however often it was visited, with its worst visit.
#[derive(Debug, Clone, PartialEq)]
pub struct PromiseKept {
    pub promise: Promise,
    /// Figures of the errors, mm; `None` without any.
    pub figures: Option<Figures>,
    pub counted: Counted,
    pub within: usize,
    /// Limits of the share of all errors within the bound, two-sided at the promise's confidence.
    pub interval: (f64, f64),
}

impl PromiseKept {
    pub fn new(promise: Promise, by_pose: &PoseErrors, figures: Option<Figures>) -> Self {
        let bound_mm = promise.bound_mm.unwrap_or(0.0);
        let within = by_pose.worst().iter().filter(|&&norm| norm <= bound_mm).count();
        let counted = by_pose.counted();
        let interval = share_interval(within, counted.poses, promise.confidence);
        Self { promise, figures, counted, within, interval }
    }

    pub fn is_broken(&self) -> bool {
        self.interval.1 < self.promise.share
    }

    pub fn verdict(&self) -> &'static str {
        if self.is_broken() { "not kept" } else { "not contradicted" }
    }

    /// The share of all errors that may be within the bound, as text.
    pub fn possible(&self) -> String {
        let shares = [self.interval.0, self.interval.1, self.promise.confidence];
        let [low, high, confidence] = shares.map(|share| 100.0 * share);
        format!("{low:.1} to {high:.1} % of all with {confidence} % confidence")
    }
}

impl PlanPromise {
    /// Compares the promise with stations at the verification poses.
    pub fn held_against(&self, stations: &[Verified]) -> PromiseKept {
        let visited = self.verify.iter().filter_map(|pose| at(pose, stations, &self.counted));
        let visited: BTreeSet<usize> = visited.collect();
        let mut by_pose = PoseErrors::default();
        for (visit, station) in stations.iter().enumerate() {
            if visited.contains(&station.pose) {
                by_pose.add(station.pose, visit, 0, station.left_mm);
            }
        }
        PromiseKept::new(self.promise, &by_pose, Figures::of(&by_pose.worst()))
    }

    pub fn words(&self, kept: &PromiseKept) -> String {
        let promise = &self.promise;
        let mm = |value: Option<f64>| value.map_or("–".to_owned(), |mm| format!("{mm:.3} mm"));
        let head = format!(
            "plan {}: promised mean below {}, {} % of errors below {}",
            self.plan,
            mm(promise.mean_mm),
            100.0 * promise.share,
            mm(promise.bound_mm)
        );
        let Some(figures) = kept.figures else {
            return format!(
                "{head}; none of its {} verification poses was measured: nothing to compare it with",
                self.verify.len()
            );
        };
        format!(
            "{head}; found, with measurement noise, on {} of {} verification poses: mean {:.3} mm, largest {:.3} mm, {} within \
             the bound ({}): {}",
            kept.counted.poses,
            self.verify.len(),
            figures.mean,
            figures.max,
            kept.within,
            kept.possible(),
            kept.verdict()
        )
    }
}

/// Whether joint angles (rad; mm where a joint slides) are those of one pose; `counted` are the radians that one unit of each joint
/// counts as, 1 beyond its end.
pub fn is_same_pose(one: &[f64], other: &[f64], counted: &[f64]) -> bool {
    one.len() == other.len() && apart(one, other, counted) <= SAME_POSE_RAD
}

fn apart(one: &[f64], other: &[f64], counted: &[f64]) -> f64 {
    let counted = counted.iter().copied().chain(std::iter::repeat(1.0));
    let joints = one.iter().zip(other).zip(counted);
    joints.map(|((a, b), counted)| (a - b).abs() * counted).fold(0.0, f64::max)
}

/// The pose of the station nearest to a planned pose; `None` where no station is there.
fn at(pose: &[f64], stations: &[Verified], counted: &[f64]) -> Option<usize> {
    let away = |station: &Verified| apart(&station.joints, pose, counted);
    let nearest = stations.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    (away(nearest) <= SAME_POSE_RAD).then_some(nearest.pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn promise() -> PlanPromise {
        PlanPromise {
            plan: "00ff".to_owned(),
            verify: (0..20).map(|i| vec![f64::from(i) * 0.1, 0.5]).collect(),
            counted: Vec::new(),
            promise: Promise {
                mean_mm: Some(0.1),
                bound_mm: Some(0.2),
                share: 0.95,
                confidence: 0.95,
            },
        }
    }

    /// A station a quarter of a degree from each planned pose except the last two.
    fn stations(left_mm: f64) -> Vec<Verified> {
        let beside = |i: i32| Verified {
            joints: vec![f64::from(i) * 0.1 + 0.004, 0.496],
            pose: usize::try_from(i).expect("counted up"),
            left_mm,
        };
        (0..18).map(beside).collect()
    }

    #[test]
    fn a_promise_is_held_against_the_poses_that_verify() {
        let kept = promise().held_against(&stations(0.1));
        assert_eq!((kept.counted.poses, kept.within), (18, 18));
        // 18 of 18: the lower limit solves p^18 = 0.025, 0.8147.
        assert!((kept.interval.0 - 0.025f64.powf(1.0 / 18.0)).abs() < 1e-6, "{kept:?}");
        assert!(
            !kept.is_broken() && promise().words(&kept).contains("18 of 20 verification poses"),
            "{}",
            promise().words(&kept)
        );
        let broken = promise().held_against(&stations(0.3));
        assert!(
            broken.is_broken() && promise().words(&broken).ends_with("not kept"),
            "{}",
            promise().words(&broken)
        );
    }

    #[test]
    fn a_pose_that_was_visited_again_counts_once_with_its_worst_visit() {
        let mut visits = stations(0.1);
        let again = |station: &Verified, left_mm| Verified { left_mm, ..station.clone() };
        let worse: Vec<Verified> = visits.iter().map(|visit| again(visit, 0.3)).collect();
        let better: Vec<Verified> = visits.iter().map(|visit| again(visit, 0.05)).collect();
        visits.extend(better);
        let kept = promise().held_against(&visits);
        assert_eq!((kept.counted.poses, kept.within), (18, 18));
        visits.extend(worse);
        let kept = promise().held_against(&visits);
        assert_eq!((kept.counted.poses, kept.within), (18, 0));
    }

    #[test]
    fn a_session_that_left_its_plan_shows_nothing() {
        let elsewhere: Vec<Verified> = stations(0.1)
            .into_iter()
            .map(|station| Verified { joints: vec![station.joints[0], 2.0], ..station })
            .collect();
        let kept = promise().held_against(&elsewhere);
        assert_eq!((kept.counted.poses, kept.interval), (0, (0.0, 1.0)));
        assert!(!kept.is_broken() && promise().words(&kept).contains("nothing to compare it with"));
    }
}
