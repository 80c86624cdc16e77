//! RAPID of ABB (*Technical reference manual: RAPID instructions, functions and data types*): modules `.mod`, `.prg`, `.sys`,
//! `.modx`, with `MOC.cfg` for the arm's base.
//!
//! 1. Statements of all modules ([`statement`]): declarations and values, and every assignment ([`data`]).
//! 2. Each routine becomes steps ([`steps`]): displacements, `ConfJ`, `ConfL`, blocks, calls, motions.
//! 3. The routines are walked ([`crate::flow`]).
//!
//! Frames: a position stands in its work object's object frame, that in its user frame, that in the world; without `\WObj` in
//! the world itself. The arm's base in the world is its mechanical unit's base frame.
//!
//! The configuration data of a position are read by `MoveJ` under `ConfJ\On` and by `MoveL` and `MoveC` under `ConfL\On`; otherwise
//! a motion goes on in the arm configuration in which it begins.

mod base_frame;
mod data;
pub(crate) mod motion;
mod statement;
mod steps;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::flow::{Others, Routine, SLOTS, Setting, Slot, State, Summaries, known, unknown, walk};
use crate::frame::{Cell, Chain};
use crate::lex::{Dialect, Token, tokens};
use crate::names::{Names, Scope};
use crate::program::{Computed, File, Motion, Position, Recorder};
use crate::refusal::Refusal;
use statement::Statement;

pub(crate) use motion::quaternion;

pub const RAPID: Dialect = Dialect {
    name: "RAPID",
    comments: &[b"!"],
    header: Some(b'%'),
    text_quote: b'"',
    number_quote: None,
    in_names: b"_",
};

pub(crate) fn is_module(file: &File) -> bool {
    matches!(file.ending().as_str(), "mod" | "prg" | "sys" | "modx" | "sysx")
}

/// Whether a file is a module or says where the arm's base is.
pub(crate) fn is_known(file: &File) -> bool {
    is_module(file) || base_frame::is_configuration(file)
}

pub(crate) struct Reading<'f> {
    pub(crate) files: &'f [File],
    cell: &'f Cell,
    names: Names,
    /// Full names of the routines that a short name may mean from anywhere.
    global: BTreeMap<String, Vec<String>>,
    /// Routines by their full names, and whether they may change what is passed to them.
    given: HashMap<String, bool>,
    routines: BTreeMap<String, Routine>,
    motions: Vec<Motion>,
    positions: Vec<Position>,
    computed: Vec<Computed>,
    any_displacement: bool,
    any_offset: bool,
    any_conf_off: [bool; 2],
}

/// Positions, computed targets and the arm's base of the RAPID modules among `files`,
/// behind those that are there already.
pub(crate) fn read(
    files: &[File],
    cell: &Cell,
    positions: Vec<Position>,
    computed: Vec<Computed>,
) -> (Vec<Position>, Vec<Computed>, Chain) {
    let own = files.iter().enumerate().filter(|(_, file)| is_module(file));
    let own: Vec<(usize, Vec<Token>)> =
        own.map(|(place, file)| (place, tokens(&file.bytes, &RAPID))).collect();
    let split =
        |(file, tokens): &(usize, Vec<Token>)| (*file, statement::without_line_ends(tokens));
    let own: Vec<(usize, Vec<Token>)> = own.iter().map(split).collect();
    let statements: Vec<(usize, Vec<Statement<'_>>)> = own
        .iter()
        .map(|(file, tokens)| (*file, statement::all(&files[*file].bytes, tokens)))
        .collect();
    let mut reading = Reading {
        files,
        cell,
        names: Names::default(),
        global: BTreeMap::new(),
        given: HashMap::new(),
        routines: BTreeMap::new(),
        motions: Vec::new(),
        positions,
        computed,
        any_displacement: false,
        any_offset: false,
        any_conf_off: [false; 2],
    };
    for (file, statements) in &statements {
        reading.data(*file, statements);
    }
    for (file, statements) in &statements {
        reading.touches(*file, statements);
    }
    for (file, statements) in &statements {
        reading.steps(*file, statements);
    }
    reading.walk();
    reading.names.forbid(&mut reading.positions);
    (reading.positions, reading.computed, base_frame::read(files))
}

impl Reading<'_> {
    fn module(&self, file: usize) -> String {
        self.files[file].name.to_ascii_uppercase()
    }

    fn scopes(&self, file: usize, routine: Option<&str>) -> Vec<Scope> {
        let module = self.module(file);
        let own = routine.map(|routine| format!("{module}/{routine}"));
        own.into_iter().chain([module, String::new()]).collect()
    }

    fn walk(&mut self) {
        let entries: Vec<State> =
            self.routines.values().map(|routine| self.entry(&routine.name)).collect();
        let mut recorder = Recorder { motions: &self.motions, positions: &mut self.positions };
        let mut changed = [false; SLOTS];
        changed[Slot::Branch as usize] = true;
        changed[Slot::Displacement as usize] = self.any_displacement;
        changed[Slot::Mode as usize] = self.any_offset;
        [changed[Slot::ConfJ as usize], changed[Slot::ConfL as usize]] = self.any_conf_off;
        let others = Others { harmless: steps::is_harmless, changed };
        let summaries = Summaries::new(&self.routines, &recorder, others);
        for (routine, entry) in self.routines.values().zip(entries) {
            let before: Vec<usize> =
                recorder.positions.iter().map(|position| position.uses.len()).collect();
            if !walk(routine, &summaries, &entry, &mut recorder) {
                let why = Arc::new(Refusal::Blocks { routine: routine.name.clone() });
                for (position, before) in recorder.positions.iter_mut().zip(before) {
                    for own in &mut position.uses[before..] {
                        (own.base, own.tool) = (Err(why.clone()), Err(why.clone()));
                    }
                }
            }
        }
    }

    /// What holds where a routine begins. The controller begins `main` with `ConfJ` and `ConfL` on.
    fn entry(&self, routine: &str) -> State {
        let routine = routine.rsplit('/').next().unwrap_or(routine).to_owned();
        let conf = |which: usize, name: &str| {
            if routine == "MAIN" || !self.any_conf_off[which] {
                known(Setting::On(true))
            } else {
                let words = format!(
                    "{name} may be on or off where routine {routine} begins; set it there by {name}\\On or {name}\\Off"
                );
                unknown(Refusal::Other(words))
            }
        };
        let off = |any: bool, what| {
            if any { unknown(Refusal::Displaced { what }) } else { known(Setting::On(false)) }
        };
        State::new(|slot| match slot {
            Slot::Mode => off(self.any_offset, "EOffs"),
            Slot::Displacement => off(self.any_displacement, "PDisp"),
            Slot::ConfJ => conf(0, "ConfJ"),
            Slot::ConfL => conf(1, "ConfL"),
            Slot::Branch => unknown(Refusal::NoBranch { routine: routine.clone() }),
            Slot::Base | Slot::Tool | Slot::Waiting => {
                unknown(Refusal::NotSet { what: slot.name(), routine: routine.clone() })
            }
        })
    }
}

#[cfg(test)]
mod tests;
