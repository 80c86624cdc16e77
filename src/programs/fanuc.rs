//! Listings `.ls` of FANUC's teach pendant programs (*Operator's manual*, `R-30iB`): statements under `/MN`, positions under `/POS`.
//!
//! 1. Each listing becomes statements and positions (`listing`, `position`).
//! 2. The statements become steps (`steps`): `UFRAME_NUM` and `UTOOL_NUM`, blocks, jumps, calls, motions (`motion`).
//! 3. The programs are walked ([`crate::flow`]).
//!
//! Frames: a position states the numbers of its user frame and its tool, `UF : 1, UT : 2`, or `F` for those that are set. The controller
//! stops where others are set, and so it is refused here. No listing has the frames' numbers: the cell has them as `UFRAME[1]` and `UTOOL[2]`.
//! 0 is the world, and the flange. FANUC's world lies on axis 1 at the height of axis 2; where the calibrated arm's base is in it, the
//! cell says as `base_frame`.
//!
//! `CONFIG` is read by J and by `Wjnt`; L, C and A go on in the arm configuration in which they begin. Its letters are the sides of the
//! three singularities, and its turns those of joints 1, 4 and 6 ([`Stated::Config`](crate::program::Stated)).

pub(crate) mod further;
mod listing;
pub(crate) mod mark;
mod motion;
mod position;
mod steps;

use std::collections::{BTreeMap, BTreeSet};

use crate::flow::{Known, Others, SLOTS, Setting, Slot, State, known, unknown};
use crate::frame::{Cell, Chain, not_given};
use crate::kinematics::Arm;
use crate::lex::Dialect;
use crate::postures::counts_from_horizontal;
use crate::program::{File, Programs, Shape};
use crate::reading::{Common, Shaped, Used};
use crate::refusal::{Place, Refusal};
use listing::Listing;
use position::Listed;

pub const FANUC: Dialect = Dialect {
    name: "fanuc",
    endings: &["ls"],
    comment: '!',
    statement_end: "",
    // `!` is a comment at the head of a statement only, and elsewhere the negation.
    comments: &[],
    header: None,
    text_quote: b'"',
    number_quote: None,
    comments_elements: true,
    in_names: b"_$",
};

/// FANUC prints three decimals, and is not known to take more.
const DECIMALS: [usize; 2] = [3, 3];

pub(crate) struct Reading<'f> {
    common: Common<'f>,
    /// By their files and numbers.
    positions: BTreeMap<(usize, u32), Listed>,
    /// Frames that statements write, each with the place; without a number any.
    written: BTreeMap<String, Place>,
    /// Of each file a motion to a position that is worked out.
    pointed: BTreeMap<usize, Place>,
    /// What statements other than motions do with a position of each file that is worked out.
    any_used: BTreeMap<usize, Refusal>,
    any_displacement: bool,
}

/// Positions and motions of the listings among `files`, behind those that are found already, and the arm's base.
pub(crate) fn read(files: &[File], cell: &Cell, found: Used) -> (Used, Chain) {
    let own = FANUC.files(files).map(|(place, file)| Listing::new(place, file));
    let listings: Vec<Listing<'_>> = own.collect();
    let mut reading = Reading {
        common: Common::new(files, cell, found, no_shape, "the whole listing"),
        positions: BTreeMap::new(),
        written: BTreeMap::new(),
        any_used: BTreeMap::new(),
        pointed: BTreeMap::new(),
        any_displacement: false,
    };
    for pass in [Reading::data, Reading::steps] {
        for listing in &listings {
            pass(&mut reading, listing);
        }
    }
    reading.walk();
    let give = "where the base of the calibrated arm is in FANUC's world, which lies on axis 1 at the height of axis 2: [frames.base_frame] place in \
                the file of the cell, zeros for a ready robot file";
    (reading.common.found, Chain::one("base_frame", not_given("base_frame", give)))
}

/// Positions are read by [`position`], never from values.
fn no_shape(_: &Common<'_>, _: &[String], _: &crate::value::Value, _: &str) -> Shaped {
    (Err(Refusal::Other("it is no position".to_owned())), None)
}

impl Reading<'_> {
    fn data(&mut self, listing: &Listing<'_>) {
        let file = listing.file;
        let full = self.full_name(listing);
        self.common.global.entry(listing.name.clone()).or_default().push(full);
        for (number, own) in listing.positions() {
            let at = self.common.files[file].at(own.line);
            let Some(first) = self.positions.get_mut(&(file, number)) else {
                self.positions.insert((file, number), own);
                continue;
            };
            let (name, second) = (format!("P[{number}]"), at);
            let first_at = self.common.files[file].at(first.line);
            first.shape = Err(Refusal::TwoValues { name, first: first_at, second });
        }
        for statement in listing.statements() {
            let at = self.common.files[file].at(statement.line);
            for name in steps::written_frames(statement.all) {
                self.written.entry(name).or_insert_with(|| at.clone());
            }
        }
    }

    fn full_name(&self, listing: &Listing<'_>) -> String {
        format!("{}/{}", self.common.files[listing.file].name, listing.name)
    }

    /// The user frame or the tool of a number.
    fn frame(&self, slot: Slot, number: u32) -> Known {
        if number == 0 {
            return known(Setting::Frames(Chain::default()));
        }
        let word = if slot == Slot::Base { "UFRAME" } else { "UTOOL" };
        let name = format!("{word}[{number}]");
        let written = self.written.get(&name).or_else(|| self.written.get(word));
        let value = written.map_or_else(
            || not_given(&name, &to_write(&name)),
            |at| Err(Refusal::AtRunTime { what: name.clone(), at: at.clone() }),
        );
        known(Setting::Frames(Chain::one(name, value)))
    }

    fn walk(&mut self) {
        let mut changed = [false; SLOTS];
        for slot in [Slot::Base, Slot::Tool, Slot::Branch, Slot::Place] {
            changed[slot as usize] = true;
        }
        changed[Slot::Displacement as usize] = self.any_displacement;
        for ((file, _), own) in &self.positions {
            // One that states no frames may be used under others there.
            let at = self.pointed.get(file).filter(|_| own.frames.contains(&None));
            let read = at.map(|at| Refusal::Read { at: at.clone() });
            let obstacle = own.obstacle.as_ref().or_else(|| self.any_used.get(file));
            if let (Some(position), Some(why)) = (own.position, obstacle.or(read.as_ref())) {
                let position = &mut self.common.found.positions[position];
                position.obstacle.get_or_insert_with(|| why.clone());
                if matches!(why, Refusal::AtRunTime { .. }) {
                    position.shape = Err(why.clone());
                }
            }
        }
        let others = Others {
            harmless: |_| false,
            changed,
            has_tools_on_arm: true,
            interrupts_come_back: true,
            ends_loops_at_head: false,
        };
        self.common.walk(others, &[], &BTreeSet::new(), |_| None, entry);
    }
}

/// What to write for a frame that no listing has.
fn to_write(name: &str) -> String {
    format!(
        "its numbers in the file of the cell: [frames.{name:?}] found = \"surveyed\", place = {{ xyz_mm = [X, Y, Z], euler_deg = [W, P, R], \
         euler_order = \"fixed-xyz\" }}"
    )
}

/// What holds where a program begins, which anyone may call.
fn entry(routine: &str) -> State {
    State::new(|slot| match slot {
        Slot::Mode | Slot::Turn => known(Setting::On(true)),
        Slot::Displacement | Slot::ConfJ | Slot::ConfL => known(Setting::On(false)),
        Slot::Branch => unknown(Refusal::NoBranch { routine: routine.to_owned() }),
        _ => unknown(Refusal::NotSet { what: slot.name(), routine: routine.to_owned() }),
    })
}

impl Programs {
    /// Refuses FANUC's positions in joint angles where an arm counts joint 3 in another way.
    pub(crate) fn hold_joints(&mut self, arm: &Arm) {
        if counts_from_horizontal(arm) {
            return;
        }
        let words = "FANUC counts joint 3 against the horizontal, and the calibrated arm has no joint_map that says so; calibrate with a robot file that \
                     has it, or write the position as X, Y, Z, W, P, R";
        for position in &mut self.positions {
            let is_joints = matches!(position.shape, Ok(Shape::Joints(_)));
            if is_joints && self.files[position.file].is_of(&FANUC) {
                position.shape = Err(Refusal::Other(words.to_owned()));
            }
        }
    }
}

#[cfg(test)]
mod tests;
