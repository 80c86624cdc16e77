//! Programs `.script` of Universal Robots (*The `URScript` Programming Language*), as `PolyScope` saves them or off-line tools write them.
//!
//! 1. Each file becomes statements (`statement`): a line each, which goes on inside brackets. A line with `$` is a label of `PolyScope`.
//! 2. Assignments are values, and functions steps (`steps`): `set_tcp`, blocks, calls, motions (`motion`).
//! 3. The functions are walked ([`crate::flow`]).
//!
//! Frames: `p[x, y, z, rx, ry, rz]`, m and rad, stands in the controller's base, or in a feature by `pose_trans(feature, p[…])`. The cell says
//! where the base of the calibrated arm is in it, as `base`; a tool that no `set_tcp` states, as `tcp`.
//!
//! Joint angles are commands whatever the arm is. A pose becomes joint angles by the calibration that the controller has of its own arm, so it is
//! corrected only where the nominal arm is that one ([`Programs::hold_poses`]).
//!
//! A list of joint angles states an arm configuration, and so does `qnear`. A motion to any other pose goes on in the one in which it begins.

mod motion;
mod statement;
mod steps;

use std::collections::{BTreeMap, BTreeSet};

use crate::flow::{Others, SLOTS, Setting, Slot, State, known, unknown};
use crate::frame::{Cell, Chain, not_given};
use crate::kinematics::Arm;
use crate::lex::Dialect;
use crate::names::Scope;
use crate::program::{File, Programs, Shape};
use crate::reading::{Common, Shaped, Used};
use crate::refusal::{Place, Refusal};
use crate::value::Value;
use statement::Statements;

pub(crate) use motion::vector_near;

pub const URSCRIPT: Dialect = Dialect {
    name: "urscript",
    endings: &["script", "urscript"],
    comment: '#',
    statement_end: "",
    comments: &[b"#"],
    header: Some(b"$"),
    text_quote: b'"',
    number_quote: None,
    comments_elements: false,
    in_names: b"_",
};

pub(crate) struct Reading<'f> {
    common: Common<'f>,
    /// Functions that others call.
    called: BTreeSet<String>,
    /// Threads with the places that begin them: they run beside everything.
    threads: Vec<(String, Place)>,
    any_displacement: bool,
    /// The variable of the script being read that [`Slot::Base`] follows: a feature that is assigned several values.
    feature: Option<String>,
}

/// Positions and motions of the scripts among `files`, behind those that are found already, and the arm's base.
pub(crate) fn read(files: &[File], cell: &Cell, found: Used) -> (Used, Chain) {
    let own = URSCRIPT.files(files).map(|(place, file)| Statements::new(place, &file.bytes));
    let scripts: Vec<Statements<'_>> = own.collect();
    let mut reading = Reading {
        common: Common::new(files, cell, found, shape, "the file that declares it"),
        called: BTreeSet::new(),
        threads: Vec::new(),
        any_displacement: false,
        feature: None,
    };
    for pass in [Reading::data, Reading::steps] {
        for script in &scripts {
            pass(&mut reading, script);
        }
    }
    reading.walk();
    if let Some(why) = scripts.iter().find_map(|own| reading.unlike(own)) {
        for position in &mut reading.common.found.positions {
            if files[position.file].is_of(&URSCRIPT) {
                position.obstacle = Some(why.clone());
            }
        }
    }
    let give = "where the base of the calibrated arm is in the controller's base: [frames.base] found = \"surveyed\" with place in the file of the \
                cell, zeros for a ready robot file or the robot's own calibration file";
    (reading.common.found, Chain::one("base", not_given("base", give)))
}

/// Positions are made of values as the dialect writes them (`motion`).
fn shape(_: &Common<'_>, _: &[Scope], value: &Value, _: &str) -> Shaped {
    let none = || Refusal::Other("it is no position of six plain numbers".to_owned());
    (motion::shape(value).ok_or_else(none), None)
}

impl Reading<'_> {
    /// The scopes within functions that stand in each other, the outermost first, or of the file alone.
    fn scopes<'n>(
        &self,
        file: usize,
        functions: impl IntoIterator<Item = &'n str, IntoIter: DoubleEndedIterator>,
    ) -> Vec<Scope> {
        let name = self.common.files[file].name.to_ascii_uppercase();
        let own = functions.into_iter().rev().map(|own| format!("{name}/{own}"));
        own.chain([name.clone(), String::new()]).collect()
    }

    /// What forbids to read a script: a name that differs from another, or from one of the controller's, in capitals alone.
    fn unlike(&self, script: &Statements<'_>) -> Option<Refusal> {
        let mut known = BTreeMap::new();
        let (name, line, other) = script.names().find_map(|(name, line)| {
            let word = name.to_ascii_uppercase();
            let is_controllers = motion::way(&word).is_some() || steps::is_followed(&word);
            let first = if is_controllers { name.to_ascii_lowercase() } else { name.clone() };
            let other = known.entry(word).or_insert(first).clone();
            (other != name).then_some((name, line, other))
        })?;
        let at = self.common.files[script.file].at(line);
        Some(Refusal::Other(format!(
            "the script has a name {name} ({at}), which is not {other}; rename it"
        )))
    }

    fn walk(&mut self) {
        let mut changed = [false; SLOTS];
        for slot in [Slot::Base, Slot::Tool, Slot::Branch, Slot::Place] {
            changed[slot as usize] = true;
        }
        changed[Slot::Displacement as usize] = self.any_displacement;
        let others = Others {
            harmless: steps::is_harmless,
            changed,
            has_tools_on_arm: true,
            interrupts_come_back: false,
            ends_loops_at_head: false,
        };
        self.common.walk(others, &self.threads, &self.called, |_| None, entry);
        motion::keep_behind_blends(&mut self.common);
    }
}

/// What holds where a program begins.
fn entry(routine: &str) -> State {
    State::new(|slot| match slot {
        Slot::Tool => {
            let give = "it by set_tcp with plain numbers before the motion, or in the file of the cell: [frames.tcp] found = \"surveyed\" with place";
            known(Setting::Frames(Chain::one("tcp", not_given("tcp", give))))
        }
        Slot::Mode | Slot::Turn => known(Setting::On(true)),
        Slot::Displacement | Slot::ConfJ | Slot::ConfL => known(Setting::On(false)),
        Slot::Branch => unknown(Refusal::NoBranch { routine: routine.to_owned() }),
        _ => unknown(Refusal::NotSet { what: slot.name(), routine: routine.to_owned() }),
    })
}

impl Programs {
    /// Refuses poses of `URScript` where an arm is no calibration that a controller has of its own arm: such an arm stands at angles that no
    /// drawing has.
    pub(crate) fn hold_poses(&mut self, arm: &Arm) {
        let flange = arm.flange(&vec![0.0; arm.joints().len()]);
        let turn = flange.isometry().rotation.to_rotation_matrix();
        let is_drawn = turn.matrix().iter().all(|own| (own - own.round()).abs() < 1e-9);
        if !is_drawn {
            return;
        }
        let words = "the controller makes joint angles of a pose by the calibration that it has of its own arm, and the calibrated arm's nominal one is a \
                     drawing; calibrate with the robot's own file (YAML of ur_calibration) as the robot file, or write the position as joint angles";
        for position in &mut self.positions {
            let is_pose = matches!(position.shape, Ok(Shape::Pose { .. }));
            if is_pose && self.files[position.file].is_of(&URSCRIPT) {
                position.shape = Err(Refusal::Other(words.to_owned()));
            }
        }
    }
}

#[cfg(test)]
mod tests;
