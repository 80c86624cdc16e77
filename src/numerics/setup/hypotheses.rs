//! The usual mistakes: every one a set-up that differs from the stated one in one thing, with the key to edit.

mod frames;
mod joints;
pub(super) mod links;
mod readings;

use std::sync::{Arc, LazyLock};

use super::set_up::SetUp;
use frames::frames;
use joints::joints;
use links::links;
use readings::readings;

pub use frames::{FrameKey, OtherReading};

/// One usual mistake: what would be wrong, what to edit, and the set-up without it.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    pub mistake: String,
    pub edit: String,
    pub set_up: SetUp,
    pub sort: Sort,
    /// Whether it is two mistakes at once.
    pub is_pair: bool,
}

/// Sorts of mistakes, by how well they have to explain the logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// A mistake of kind: a unit, an order, a sign, a frame.
    Kind,
    /// Another ready arm. Nobody's arm is nearer to another model than to its own, so less has to be explained.
    Arm,
    /// A number found from the same logs: it agrees with them better than any mistake of kind.
    Size,
}

impl Hypothesis {
    fn new(mistake: impl Into<String>, edit: impl Into<String>, set_up: SetUp) -> Self {
        let (mistake, edit) = (mistake.into(), edit.into());
        Self { mistake, edit, set_up, sort: Sort::Kind, is_pair: false }
    }

    /// A change by a number that was found from the same logs.
    pub(super) fn of_size(mistake: String, edit: String, set_up: SetUp) -> Self {
        Self { sort: Sort::Size, ..Self::new(mistake, edit, set_up) }
    }

    pub(super) fn key(&self) -> &str {
        self.edit.split([':', '=']).next().unwrap_or_default()
    }
}

/// A known arm that the stated one may have been taken for.
#[derive(Debug, Clone)]
pub struct KnownArm {
    pub file: String,
    pub arm: crate::kinematics::Arm,
}

/// What else the search needs to know about the files.
#[derive(Debug, Clone, Default)]
pub struct Alternatives {
    /// Ready robot files, read where they are first needed: where logs disagree with their set-up.
    pub arms: Arc<LazyLock<Vec<KnownArm>>>,
    /// Placements with the stated numbers, read by other conventions.
    pub readings: Vec<OtherReading>,
    /// The stated robot file's arm by another convention of its table, by that convention's word; `None` of a file without a table.
    pub convention: Option<KnownArm>,
}

impl Alternatives {
    /// Whether the stated arm is a ready one: then its links are as they are.
    pub(super) fn is_ready(&self, stated: &SetUp) -> bool {
        self.arms.iter().any(|known| known.arm.chain() == stated.arm.chain())
    }
}

/// All usual mistakes about `stated`: those of readings first, then of frames, then of robot files.
pub(super) fn all(stated: &SetUp, alternatives: &Alternatives) -> Vec<Hypothesis> {
    let mut all = readings(stated);
    all.extend(frames(stated, &alternatives.readings));
    all.extend(other_arms(stated, &alternatives.arms));
    all.extend(joints(stated));
    if !alternatives.is_ready(stated) {
        all.extend(alternatives.convention.as_ref().and_then(|other| convention(stated, other)));
        all.extend(links(stated));
    }
    all
}

/// Those mistakes that change whether arm and readings agree: the ones that can keep two logs from being joined.
pub(super) fn of_the_join(stated: &SetUp, alternatives: &Alternatives) -> Vec<Hypothesis> {
    let mut all = all(stated, alternatives);
    all.retain(|hypothesis| hypothesis.set_up.joins_otherwise(stated));
    all
}

/// Every ready robot file of another model in place of the stated one; models with one chain are one mistake. One with the chain of the
/// stated model's own is that ([`ready_file`]).
fn other_arms(stated: &SetUp, known: &[KnownArm]) -> Vec<Hypothesis> {
    let own = known.iter().find(|known| known.arm.model() == stated.arm.model());
    let is_other = |known: &&KnownArm| {
        known.arm.model() != stated.arm.model()
            && own.is_none_or(|own| own.arm.chain() != known.arm.chain())
    };
    let others: Vec<&KnownArm> = known.iter().filter(is_other).collect();
    let alike = |own: &KnownArm| {
        let same = others.iter().filter(|other| other.arm.chain() == own.arm.chain());
        same.map(|other| other.arm.model()).collect::<Vec<_>>()
    };
    let other = |known: &&KnownArm| {
        let models = alike(known);
        if models.first() != Some(&known.arm.model()) {
            return None;
        }
        let mistake = format!(
            "the robot file is of another arm, {}: the logs are of {}",
            stated.arm.model(),
            models.join(" or ")
        );
        let hypothesis = in_place_of(stated, known, mistake)?;
        Some(Hypothesis { sort: Sort::Arm, ..hypothesis })
    };
    others.iter().filter_map(other).collect()
}

/// The ready robot file of the same model, where the stated one has other numbers.
pub(super) fn ready_file(stated: &SetUp, known: &[KnownArm]) -> Option<Hypothesis> {
    let own = known.iter().find(|known| known.arm.model() == stated.arm.model())?;
    let mistake = format!("the robot file has other numbers than the ready one, {}", own.file);
    let hypothesis = in_place_of(stated, own, mistake)?;
    Some(Hypothesis { sort: Sort::Size, ..hypothesis })
}

/// The robot file's table in another convention.
fn convention(stated: &SetUp, other: &KnownArm) -> Option<Hypothesis> {
    let word = &other.file;
    let mistake = format!("the robot file's table is in another convention, {word}");
    let edit = format!("robot file: convention = \"{word}\"");
    Some(Hypothesis { edit, ..in_place_of(stated, other, mistake)? })
}

/// The set-up with a ready arm; `None` where that is the stated one or has another number of joints.
fn in_place_of(stated: &SetUp, known: &KnownArm, mistake: String) -> Option<Hypothesis> {
    let fits = known.arm.joints().len() == stated.arm.joints().len()
        && known.arm.chain() != stated.arm.chain();
    let set_up = SetUp { arm: known.arm.clone(), ..stated.clone() };
    fits.then(|| Hypothesis::new(mistake, format!("[robot] file: {}", known.file), set_up))
}
