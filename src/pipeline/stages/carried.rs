//! Sessions that are learnt one on top of the other: what those so far said, and where their poses were.
//!
//! Each session is trained alone, on top of what those before it said ([`crate::fit::full::Carried`]): on all its stations, and without
//! each fold's. The folds are those of the first session's blocks, and a pose is in the fold of its first visit, in whichever session; so
//! what a fold carries over never saw a station that it holds out, of any session.

use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use crate::fit::commanded::CommandedPose;
use crate::fit::full::{Carried, Carrying, Sizes};
use crate::fit::holdout::{Blocks, FOLDS, extent};
use crate::fit::saved::SavedError;
use crate::fit::stored::StoredModels;
use crate::fit::visits::{self, Dwell};
use crate::fit::{Models, TrainingSettings};
use crate::kinematics::Arm;

/// What some sessions said, for the next to be learnt on top of.
#[derive(Debug, Clone)]
pub struct Learnt {
    /// All stations.
    whole: Arc<Carried>,
    /// Those that each fold does not hold out.
    folds: Vec<Arc<Carried>>,
    seen: Seen,
    /// The models of all stations, which the next session judges.
    models: StoredModels,
}

/// The sizes with which sessions are learnt again.
#[derive(Debug, Clone)]
pub struct Held {
    whole: Arc<Sizes>,
    folds: Vec<Arc<Sizes>>,
}

/// Blocks and poses of some sessions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Seen {
    /// Those of the first session.
    blocks: Blocks,
    poses: Vec<Pose>,
}

/// A pose, by its first visit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    command: Option<(Point3<f64>, Option<UnitQuaternion<f64>>)>,
    joints: Vec<f64>,
    counted: Vec<f64>,
    /// Position of the nominal flange in the base frame, mm.
    flange: Point3<f64>,
}

impl Pose {
    fn of(dwell: &Dwell<'_>, flange: Point3<f64>) -> Self {
        let command = dwell.command.as_ref();
        Self {
            command: command.map(|own| (own.position, own.orientation)),
            joints: dwell.joints.to_vec(),
            counted: dwell.counted.to_vec(),
            flange,
        }
    }

    fn dwell(&self) -> Dwell<'_> {
        let command = self.command.as_ref();
        Dwell {
            command: command.map(|(position, orientation)| CommandedPose {
                position: *position,
                orientation: *orientation,
            }),
            joints: &self.joints,
            counted: &self.counted,
        }
    }
}

impl Seen {
    /// The fold of each dwell of a session, whose nominal flange is at these places; and what was seen with it.
    pub(super) fn folds(
        before: Option<&Self>,
        dwells: &[Dwell<'_>],
        flanges: &[Point3<f64>],
        blocks: &Blocks,
    ) -> (Vec<usize>, Self) {
        let mut seen = before
            .cloned()
            .unwrap_or_else(|| Self { blocks: stated(blocks, flanges), poses: Vec::new() });
        let earlier = seen.poses.len();
        let all = seen.poses.iter().map(Pose::dwell);
        let all: Vec<Dwell<'_>> = all.chain(dwells.iter().copied()).collect();
        let firsts = visits::poses(&all).split_off(earlier);
        let place = |first: usize| match first.checked_sub(earlier) {
            None => seen.poses[first].flange,
            Some(own) => flanges[own],
        };
        let places: Vec<Point3<f64>> = firsts.iter().map(|&first| place(first)).collect();
        let folds = seen.blocks.folds(&places);
        let new = firsts.iter().enumerate();
        let new = new.filter(|(own, first)| **first == own + earlier);
        let new: Vec<Pose> = new.map(|(own, _)| Pose::of(&dwells[own], flanges[own])).collect();
        seen.poses.extend(new);
        (folds, seen)
    }
}

/// Blocks with the size and the corner that they have for these positions.
fn stated(blocks: &Blocks, positions: &[Point3<f64>]) -> Blocks {
    let (low, high) = extent(positions);
    Blocks {
        size_mm: Some(blocks.size_of(&low, &high)),
        origin_mm: Some(blocks.origin_mm.unwrap_or(low)),
    }
}

/// How the trainings of a session carry over what those before it said.
#[derive(Debug)]
pub struct Learning {
    whole: Carrying,
    folds: Vec<Carrying>,
    pub(super) before: Option<Seen>,
    /// The models of the sessions so far.
    models: Option<StoredModels>,
}

impl Learning {
    /// On top of these sessions; of none before the first.
    pub fn after(before: Option<&Learnt>) -> Self {
        Self::with(before, None, before)
    }

    /// Again with these sizes, on top of what the sessions before say with them; the session judges what they said `first`, as the sizes are
    /// its own too.
    pub fn again(before: Option<&Learnt>, held: &Held, first: Option<&Learnt>) -> Self {
        Self::with(before, Some(held), first)
    }

    fn with(before: Option<&Learnt>, held: Option<&Held>, first: Option<&Learnt>) -> Self {
        let fold = |fold: usize| Carrying {
            before: before.and_then(|own| own.folds.get(fold)).cloned(),
            held: held.and_then(|own| own.folds.get(fold)).cloned(),
        };
        Self {
            whole: Carrying {
                before: before.map(|own| Arc::clone(&own.whole)),
                held: held.map(|own| Arc::clone(&own.whole)),
            },
            folds: (0..FOLDS).map(fold).collect(),
            before: before.map(|own| own.seen.clone()),
            models: first.map(|own| own.models.clone()),
        }
    }

    /// The models of the sessions before, to be judged by the session that is learnt on top of them; `None` before the first, and where a joint
    /// was repaired in between, so that the arm is another.
    pub(super) fn models_before(
        &self,
        arm: &Arm,
        day: Option<f64>,
        settings: &TrainingSettings<'_>,
    ) -> Option<Result<Models, SavedError>> {
        let models = self.models.clone()?;
        let before = self.whole.before.as_ref()?;
        let repaired = before.repaired_since(&settings.full.repaired, day);
        repaired.is_empty().then(|| models.for_another_session(arm, settings))
    }

    /// Number of sessions before.
    pub fn sessions(&self) -> usize {
        self.whole.before.as_ref().map_or(0, |own| own.sessions())
    }

    /// The settings of the training on all stations.
    pub(super) const fn whole<'s>(
        &'s self,
        settings: TrainingSettings<'s>,
    ) -> TrainingSettings<'s> {
        TrainingSettings { carrying: Some(&self.whole), ..settings }
    }

    /// The settings of the training without a fold.
    pub(super) fn fold<'s>(
        &'s self,
        fold: usize,
        settings: TrainingSettings<'s>,
    ) -> TrainingSettings<'s> {
        TrainingSettings { carrying: self.folds.get(fold), ..settings }
    }
}

impl Learnt {
    /// What these trainings leave; `None` where one has no full error model.
    pub(super) fn of(models: &Models, folds: &[Option<Models>], seen: Seen) -> Option<Self> {
        let leaves = |models: &Models| models.full.as_ref()?.leaves().cloned();
        let folds = folds.iter().map(|own| leaves(own.as_ref()?));
        Some(Self {
            whole: leaves(models)?,
            folds: folds.collect::<Option<_>>()?,
            seen,
            models: StoredModels::of(models),
        })
    }

    /// The sizes with which all sessions are to be learnt again, as they have moved; `None` where they have not.
    pub fn stale(&self) -> Option<Held> {
        self.whole.stale().then(|| self.sizes())
    }

    fn sizes(&self) -> Held {
        Held { whole: self.whole.held(), folds: self.folds.iter().map(|own| own.held()).collect() }
    }

    /// These as bytes.
    ///
    /// # Errors
    /// Where a number cannot be written as text, which only one that is not finite could cause.
    pub fn packed(&self) -> serde_json::Result<Vec<u8>> {
        let head = serde_json::to_vec(&(&self.seen, &self.models))?;
        let trainings = std::iter::once(&self.whole).chain(&self.folds);
        let parts = trainings.map(|own| own.packed());
        let mut bytes = Vec::new();
        for part in std::iter::once(Ok(head)).chain(parts) {
            let part = part?;
            bytes.extend((part.len() as u64).to_le_bytes());
            bytes.extend(part);
        }
        Ok(bytes)
    }

    /// What was packed; `None` of bytes that are not, or were changed.
    pub fn unpacked(mut bytes: &[u8]) -> Option<Self> {
        let mut parts = Vec::new();
        while !bytes.is_empty() {
            let (length, behind) = bytes.split_first_chunk::<8>()?;
            let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
            let (part, behind) = behind.split_at_checked(length)?;
            parts.push(part);
            bytes = behind;
        }
        let (head, trainings) = parts.split_first()?;
        let (seen, models) = serde_json::from_slice(head).ok()?;
        let mut trainings = trainings.iter().map(|own| Carried::unpacked(own).map(Arc::new));
        Some(Self {
            whole: trainings.next()??,
            folds: trainings.collect::<Option<_>>()?,
            seen,
            models,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dwell(joints: &[f64]) -> Dwell<'_> {
        Dwell { command: None, joints, counted: &[] }
    }

    #[test]
    fn a_pose_is_in_the_fold_of_its_first_visit_and_blocks_are_those_of_the_first_session() {
        let joints: Vec<[f64; 2]> = (0..5).map(|k| [f64::from(k), 0.0]).collect();
        let dwells: Vec<Dwell<'_>> = joints.iter().map(|own| dwell(own)).collect();
        let place = |x: f64| Point3::new(x, 0.0, 0.0);
        // Blocks of 100 mm from 0: indices 0, 1, 2, 3 and 4.
        let flanges: Vec<Point3<f64>> = (0..5).map(|k| place(100.0 * f64::from(k))).collect();
        let (folds, first) = Seen::folds(None, &dwells, &flanges, &Blocks::default());
        assert_eq!(folds, [0, 1, 0, 1, 0]);
        // The second pose again, seen over the edge of its block; a new pose far outside; and that once more over its edge.
        let (new, again) = ([9.0, 0.0], [9.0005, 0.0]);
        let dwells = [dwell(&joints[1]), dwell(&new), dwell(&again)];
        let flanges = [place(99.9), place(1150.0), place(1201.0)];
        let (folds, second) = Seen::folds(Some(&first), &dwells, &flanges, &Blocks::default());
        assert_eq!(folds, [1, 1, 1]);
        assert_eq!((first.poses.len(), second.poses.len()), (5, 6));
        assert_eq!(first.blocks, second.blocks);
    }
}
