//! The usual mistakes: every one a set-up that differs from the stated one in one thing, with the key to edit.

mod frames;
mod joints;
pub(super) mod links;

use std::sync::{Arc, LazyLock};

use super::set_up::SetUp;
use crate::units::MM_PER_M;
use frames::frames;
use joints::joints;
use links::links;

pub use frames::{FrameKey, OtherReading};

/// One usual mistake: what would be wrong, what to edit, and the set-up without it.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    pub mistake: String,
    pub edit: String,
    pub set_up: SetUp,
    pub sort: Sort,
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
        Self { mistake: mistake.into(), edit: edit.into(), set_up, sort: Sort::Kind }
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
}

/// All usual mistakes about `stated`, the simpler ones first.
pub(super) fn all(stated: &SetUp, alternatives: &Alternatives) -> Vec<Hypothesis> {
    let mut all = units(stated);
    all.extend(frames(stated, &alternatives.readings));
    all.extend(other_arms(stated, &alternatives.arms));
    all.extend(joints(stated));
    all.extend(links(stated));
    all
}

/// Those mistakes that change whether arm and readings agree: the ones that can keep two logs from being joined.
pub(super) fn of_the_join(stated: &SetUp, alternatives: &Alternatives) -> Vec<Hypothesis> {
    let mut all = all(stated, alternatives);
    all.retain(|hypothesis| hypothesis.set_up.joins_otherwise(stated));
    all
}

/// The positions of joints that slide in another unit; `None` for an arm without one.
fn positions(stated: &SetUp, factor: f64, unit: &str) -> Option<Hypothesis> {
    if !stated.arm.has_slides() {
        return None;
    }
    let mut joints_from_reported = stated.joints_from_reported.clone();
    let columns = joints_from_reported.column_iter_mut();
    for (mut column, joint) in columns.zip(stated.arm.joints()) {
        if joint.slides {
            column *= factor;
        }
    }
    let set_up = SetUp { joints_from_reported, ..stated.clone() };
    let mistake = format!("the reported positions of joints that slide are in {unit}");
    let edit = format!("{} = \"{unit}\"", stated.unit_keys.slides);
    Some(Hypothesis::new(mistake, edit, set_up))
}

fn units(stated: &SetUp) -> Vec<Hypothesis> {
    let angle = |unit: &str, factor: f64| {
        let mut joints_from_reported = stated.joints_from_reported.clone();
        let joints = stated.arm.joints().iter();
        let columns = joints_from_reported.column_iter_mut().zip(joints);
        for (mut column, _) in columns.filter(|(_, joint)| !joint.slides) {
            column *= factor;
        }
        let set_up = SetUp { joints_from_reported, ..stated.clone() };
        let mistake = format!("the reported joint angles are in {unit}");
        let edit = format!("{} = \"{unit}\"", stated.unit_keys.angles);
        Hypothesis::new(mistake, edit, set_up)
    };
    let mut all = vec![angle("deg", 1.0_f64.to_radians()), angle("rad", 1.0_f64.to_degrees())];
    for (factor, wider) in [(MM_PER_M, true), (1.0 / MM_PER_M, false)] {
        let unit = if wider { "m" } else { "mm" };
        all.extend(positions(stated, factor, unit));
        let reading = SetUp { reading_scale: factor, ..stated.clone() };
        let edit = format!("{} = \"{unit}\"", stated.unit_keys.readings);
        all.push(Hypothesis::new(format!("the tracker's positions are in {unit}"), edit, reading));
        let command = SetUp { command_scale: factor, ..stated.clone() };
        let edit = format!("{} = \"{unit}\"", stated.unit_keys.commands);
        all.push(Hypothesis::new(format!("the commanded positions are in {unit}"), edit, command));
    }
    all
}

/// Every ready robot file of another model in place of the stated one; models with one chain are one mistake.
fn other_arms(stated: &SetUp, known: &[KnownArm]) -> Vec<Hypothesis> {
    let is_other = |known: &&KnownArm| known.arm.model() != stated.arm.model();
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

/// The set-up with a ready arm; `None` where that is the stated one or has another number of joints.
fn in_place_of(stated: &SetUp, known: &KnownArm, mistake: String) -> Option<Hypothesis> {
    let fits = known.arm.joints().len() == stated.arm.joints().len()
        && known.arm.chain() != stated.arm.chain();
    let set_up = SetUp { arm: known.arm.clone(), ..stated.clone() };
    fits.then(|| Hypothesis::new(mistake, format!("[robot] file: {}", known.file), set_up))
}
