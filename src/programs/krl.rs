//! KRL of KUKA (KSS 5 to 8; *Operating and Programming Instructions for System Integrators*): modules of `.src` and `.dat`,
//! with `$config.dat` and `$machine.dat` for the frames.
//!
//! 1. Every file's declarations and values are read (`data`), and every assignment of the routines.
//! 2. Each routine becomes steps (`steps`): what sets `$BASE`, `$TOOL` and `$IPO_MODE`, blocks, calls, motions.
//! 3. The routines are walked ([`crate::flow`]): each motion's position has the frames that hold at it.
//!
//! Frames: `$BASE` stands in `$WORLD`, and the arm's base in `$WORLD` is `$ROBROOT`. `BAS(#BASE, n)` sets `BASE_DATA[n]`, an
//! inline form sets those of its FDAT; 0 is `$NULLFRAME`. What sets a frame in any other way makes it unknown.
//!
//! S and T are read by PTP and SPTP alone. LIN, CIRC and splines go on in the arm configuration in which they begin.

mod data;
pub(crate) mod frames;
mod motion;
mod steps;

use std::collections::BTreeSet;

use crate::flow::{Known, Others, SLOTS, Setting, Slot, State, known, unknown};
use crate::frame::{Cell, Chain};
use crate::lex::{Dialect, Token, tokens};
use crate::names::Scope;
use crate::program::File;
use crate::reading::{Common, Used, has};
use crate::refusal::{Place, Refusal};

pub(crate) use frames::abc;

pub const KRL: Dialect = Dialect {
    name: "krl",
    endings: &["src", "sub", "dat"],
    comment: ';',
    statement_end: "",
    comments: &[b";"],
    header: Some(b"&"),
    text_quote: b'"',
    number_quote: Some(b'\''),
    comments_elements: false,
    in_names: b"_$",
};

/// Programs of the system itself in every backup: what they do is known by their routines' names, and their own statements are not followed.
const SYSTEM: &str = "BAS.SRC IR_STOPM.SRC P00.SRC";

/// The content of the KRL files that have been read.
pub(crate) struct Reading<'f> {
    common: Common<'f>,
    /// Full names of all routines.
    local: BTreeSet<String>,
    /// Those of them that only their own module calls.
    private: BTreeSet<String>,
    /// Where the tools of all files stand.
    tools: Tools,
    /// Whether anything lets a sensor move the arm.
    any_sensor: bool,
    /// Whether anything lets the tool keep its orientation.
    any_kept_turn: bool,
    /// By the data of an inline form, until BAS sets it in one of the next statements.
    turn_waits: Option<Known>,
    triggers: Triggers,
    /// Routines that interrupts call, each with the place that says so.
    interrupts: Vec<(String, Place)>,
    /// An element of `BASE_DATA` or `TOOL_DATA` that a statement wrote, and its frames: this one, and the one before it.
    written: Option<(String, Known)>,
    before: Option<(String, Known)>,
}

#[derive(Default)]
struct Triggers {
    /// Whether one stands before the next motion.
    any_open: bool,
    /// Whether one stands before a motion that is not the next of the text.
    any_late: bool,
}

/// Where tools stand, as far as anything says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Tools {
    OnArm,
    /// The frames of an inline form are not known.
    Open,
    /// One stands in the cell.
    Fixed,
}

/// Positions, motions and the arm's base of the KRL files among `files`.
pub(crate) fn read(files: &[File], cell: &Cell, found: Used) -> (Used, Chain) {
    let own =
        KRL.files(files).filter(|(_, file)| !has(SYSTEM, &file.base_name().to_ascii_uppercase()));
    let own = own.map(|(place, file)| (place, tokens(&file.bytes, &KRL)));
    let mut own: Vec<(usize, Vec<Token>)> = own.collect();
    // What routines assign is known once lists have declared it.
    own.sort_by_key(|(file, _)| !files[*file].is_list());
    let give = "the .dat file that declares it";
    let common = Common::new(files, cell, found, motion::shape, give);
    let mut reading = Reading {
        common,
        local: BTreeSet::new(),
        private: BTreeSet::new(),
        tools: Tools::OnArm,
        any_sensor: false,
        any_kept_turn: false,
        turn_waits: None,
        triggers: Triggers::default(),
        interrupts: Vec::new(),
        written: None,
        before: None,
    };
    // What holds a frame everywhere is known as such without the list that declares it.
    for name in ["BASE_DATA", "TOOL_DATA", "$ROBROOT"] {
        reading.common.names.declare("", name, "");
    }
    for pass in [Reading::data, Reading::touches, Reading::steps] {
        for (file, tokens) in &own {
            pass(&mut reading, *file, tokens);
        }
    }
    if reading.triggers.any_late {
        reading.common.keep_whole(motion::TRIGGERED);
    }
    let root = reading.root();
    reading.walk();
    let moved = own.iter().flat_map(|(file, tokens)| motion::moved(&files[*file].bytes, tokens));
    motion::refuse_unstated(files, &mut reading.common.found.positions, &moved.collect());
    (reading.common.found, root)
}

impl Reading<'_> {
    /// The scopes of a file: its routine, its module, everywhere.
    fn scopes(&self, file: usize, routine: Option<&str>) -> Vec<Scope> {
        let module = self.module(file);
        let own = routine.map(|routine| format!("{module}/{routine}"));
        own.into_iter().chain([module, String::new()]).collect()
    }

    /// A module's `.src` and `.dat` have one name.
    fn module(&self, file: usize) -> String {
        let name = &self.common.files[file].name;
        name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem).to_ascii_uppercase()
    }

    fn walk(&mut self) {
        let mut changed = [false; SLOTS];
        for slot in [Slot::Base, Slot::Tool, Slot::Waiting, Slot::Branch, Slot::Place] {
            changed[slot as usize] = true;
        }
        let any_fixed_tool = self.tools == Tools::Fixed;
        changed[Slot::Mode as usize] = any_fixed_tool;
        changed[Slot::Displacement as usize] = self.any_sensor;
        changed[Slot::Turn as usize] = self.any_kept_turn;
        let has_tools_on_arm = self.tools == Tools::OnArm;
        let others = Others {
            harmless: steps::is_harmless,
            changed,
            has_tools_on_arm,
            interrupts_come_back: true,
            ends_loops_at_head: false,
        };
        let own = [any_fixed_tool, self.any_sensor, self.any_kept_turn];
        let begins = |routine: &str| entry(routine, own);
        self.common.walk(others, &self.interrupts, &self.private, |_| None, begins);
    }
}

/// What holds where a routine begins that anyone may call: nothing is known of its caller's frames.
fn entry(routine: &str, [any_fixed_tool, any_sensor, any_kept_turn]: [bool; 3]) -> State {
    let routine = routine.to_owned();
    State::new(|slot| match slot {
        Slot::Mode if !any_fixed_tool => known(Setting::On(true)),
        Slot::Turn if !any_kept_turn => known(Setting::On(true)),
        Slot::Displacement if any_sensor => unknown(Refusal::Displaced { what: steps::SENSOR }),
        Slot::Displacement | Slot::ConfJ | Slot::ConfL => known(Setting::On(false)),
        Slot::Branch => unknown(Refusal::NoBranch { routine: routine.clone() }),
        _ => unknown(Refusal::NotSet { what: slot.name(), routine: routine.clone() }),
    })
}

#[cfg(test)]
mod tests;
