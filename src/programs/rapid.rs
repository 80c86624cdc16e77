//! RAPID of ABB (*Technical reference manual: RAPID instructions, functions and data types*): modules `.mod`, `.prg`, `.sys`,
//! `.modx`, with `MOC.cfg` for the arm's base.
//!
//! 1. Statements of all modules (`statement`): declarations and values, and every assignment (`data`).
//! 2. Each routine becomes steps (`steps`): displacements, `ConfJ`, `ConfL`, blocks, calls, motions.
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

use std::collections::{BTreeSet, HashMap};

use crate::flow::{Others, Routine, SLOTS, Setting, Slot, State, Step, known, reached, unknown};
use crate::frame::{Cell, Chain};
use crate::lex::{Dialect, Token, tokens};
use crate::names::Scope;
use crate::program::File;
use crate::reading::{Common, Used};
use crate::refusal::{Place, Refusal};
use statement::Statement;

pub(crate) use base_frame::is_configuration;
pub use motion::is_motion;
pub(crate) use motion::quaternion;

pub const RAPID: Dialect = Dialect {
    name: "rapid",
    endings: &["mod", "prg", "sys", "modx", "sysx"],
    comment: '!',
    statement_end: ";",
    comments: &[b"!"],
    header: Some(b"%%%"),
    text_quote: b'"',
    number_quote: None,
    comments_elements: false,
    in_names: b"_",
};

pub(crate) struct Reading<'f> {
    common: Common<'f>,
    cell: &'f Cell,
    /// The tasks that modules stand in.
    tasks: BTreeSet<String>,
    /// Routines by their full names, and whether they may change what is passed to them.
    given: HashMap<String, bool>,
    /// Full names of the routines that interrupts call, with their places.
    traps: Vec<(String, Place)>,
    /// By `PDisp` and by `EOffs`.
    any_displaced: [bool; 2],
    any_conf_off: [bool; 2],
    /// Full names of all PROCs, and short ones.
    procedures: BTreeSet<String>,
    named: BTreeSet<String>,
    /// Whether the name of a call is worked out, which may be that of any of them.
    any_late_call: bool,
    /// Whether a cycle may end anywhere.
    any_exit_cycle: bool,
    /// Whether the instruction that is read stands in a compact IF.
    is_in_if: bool,
}

/// Positions, motions and the arm's base of the RAPID modules among `files`, behind those that are found already.
pub(crate) fn read(files: &[File], cell: &Cell, found: Used) -> (Used, Chain) {
    let tokens = |file: &File| statement::without_line_ends(&tokens(&file.bytes, &RAPID));
    let own = RAPID.files(files).map(|(place, file)| (place, tokens(file)));
    let own: Vec<(usize, Vec<Token>)> = own.collect();
    let statements: Vec<(usize, Vec<Statement<'_>>)> = own
        .iter()
        .map(|(file, tokens)| (*file, statement::all(&files[*file].bytes, tokens)))
        .collect();
    let give = "the module that declares it";
    let mut reading = Reading {
        common: Common::new(files, cell, found, motion::shape, give),
        cell,
        tasks: BTreeSet::new(),
        given: HashMap::new(),
        traps: Vec::new(),
        any_displaced: [false; 2],
        any_conf_off: [false; 2],
        procedures: BTreeSet::new(),
        named: BTreeSet::new(),
        any_late_call: false,
        any_exit_cycle: false,
        is_in_if: false,
    };
    reading.tasks = own.iter().map(|(file, _)| reading.task(*file)).collect();
    // What routines change of their parameters is known once all bodies are read.
    let passes = [Reading::data, Reading::touches, Reading::calls, Reading::steps];
    for pass in passes {
        for (file, own) in &statements {
            pass(&mut reading, *file, own);
        }
    }
    reading.walk();
    (reading.common.found, base_frame::read(files))
}

impl Reading<'_> {
    fn module(&self, file: usize) -> String {
        self.common.files[file].name.to_ascii_uppercase()
    }

    fn scopes(&self, file: usize, routine: Option<&str>) -> Vec<Scope> {
        let module = self.module(file);
        let own = routine.map(|routine| format!("{module}/{routine}"));
        own.into_iter().chain([module, self.task(file)]).collect()
    }

    /// The folder of the task in a backup; empty for a module that stands in none. Each task has its own names.
    fn task(&self, file: usize) -> String {
        task_of(&self.module(file))
    }

    /// The arm's task that a path names, in its folder or its name: `T_ROB1`, `Weld_T_ROB2.mod`.
    fn arm(&self, file: usize) -> Option<String> {
        let name = self.module(file);
        let (_, arm) = name.rsplit_once("T_ROB")?;
        // What follows a number is no part of the task's name: `Weld_T_ROB1_003.mod`.
        let is_numbered = arm.starts_with(|letter: char| letter.is_ascii_digit());
        let is_end = |letter: char| match letter {
            '0'..='9' => false,
            letter => is_numbered || !(letter.is_ascii_alphabetic() || letter == '_'),
        };
        Some(format!("T_ROB{}", arm.split(is_end).next()?))
    }

    /// Whether a task has a module loaded: all have where no folder names a task.
    fn is_loaded(&self, file: usize) -> bool {
        self.tasks.iter().all(String::is_empty) || !self.task(file).is_empty()
    }

    /// Refuses the positions of modules that lie in a backup outside the folders of its tasks: no task has them loaded.
    fn refuse_unloaded(&mut self) {
        let words = "its module stands outside the folders of the tasks, so none has it loaded; give its file alone";
        let files = 0..self.common.files.len();
        let is_loaded: Vec<bool> = files.map(|file| self.is_loaded(file)).collect();
        for position in &mut self.common.found.positions {
            if self.common.files[position.file].is_of(&RAPID) && !is_loaded[position.file] {
                position.obstacle.get_or_insert_with(|| Refusal::Other(words.to_owned()));
            }
        }
    }

    /// Refuses the positions of several tasks: each may be of another arm.
    fn refuse_several_tasks(&mut self) {
        let motions = self.common.motions.iter();
        let files = motions.map(|motion| motion.file).filter(|file| self.is_loaded(*file));
        let files: BTreeSet<usize> = files.collect();
        let tasks = files.iter().map(|file| self.task(*file));
        let tasks: BTreeSet<String> = tasks.filter(|task| !task.is_empty()).collect();
        let arms: BTreeSet<String> = files.iter().filter_map(|file| self.arm(*file)).collect();
        let tasks = if tasks.len() < 2 { arms } else { tasks };
        if tasks.len() < 2 {
            return;
        }
        let tasks: Vec<String> = tasks.into_iter().collect();
        let words = format!(
            "motions stand in the tasks {}, which may be of several arms; give the folder of one",
            tasks.join(", ")
        );
        for position in &mut self.common.found.positions {
            if self.common.files[position.file].is_of(&RAPID) {
                position.obstacle.get_or_insert_with(|| Refusal::Other(words.clone()));
            }
        }
    }

    /// Motions that may be cleared get no further points.
    fn keep_whole(&mut self) {
        let clears = |own: &Routine| own.calls().any(|(own, _)| own == steps::CLEARS);
        if self.common.routines.values().any(clears) {
            self.common.keep_whole("ClearPath ends it, and the next one goes on from there");
        }
    }

    /// The call of a routine in no given file, which may set anything, and end the cycle.
    fn unseen(&self) -> Option<Refusal> {
        let routines = &self.common.routines;
        let is_known = |own: &str| {
            self.given.contains_key(own) || routines.contains_key(own) || steps::is_harmless(own)
        };
        let mut calls = routines.values().flat_map(Routine::calls);
        let (routine, at) = calls.find(|(own, _)| !is_known(own))?;
        let (what, routine, at) = (Slot::Displacement.name(), routine.to_owned(), at.clone());
        Some(Refusal::Call { what, routine, at })
    }

    /// Whether `main` begins with nothing set at first: the controller begins it so, unless a cycle ends anywhere, a routine calls it, or
    /// one that nothing calls, as the controller does at its events, sets anything.
    fn begins_clean(&self, is_main: impl Fn(&str) -> bool, any_unseen: bool) -> bool {
        let routines = &self.common.routines;
        let mains = routines.keys().map(String::as_str).filter(|own| is_main(own));
        let traps = self.traps.iter().map(|(own, _)| own.as_str());
        let of_main = reached(routines, mains.chain(traps));
        let others = routines.keys().map(String::as_str).filter(|own| !of_main.contains(own));
        let sets = |own: &Routine| {
            let is_set = |step: &Step| match step {
                Step::Set(Slot::Displacement | Slot::Mode, to) => *to != known(Setting::On(false)),
                Step::Set(_, to) => *to != known(Setting::On(true)),
                _ => false,
            };
            own.steps.iter().any(is_set)
        };
        let mut calls = routines.values().flat_map(Routine::calls);
        let is_called = calls.any(|(own, _)| is_main(own));
        let is_set = reached(routines, others).iter().any(|own| sets(&routines[*own]));
        !(self.any_exit_cycle || any_unseen || is_called || is_set)
    }

    fn walk(&mut self) {
        self.keep_whole();
        let mut changed = [false; SLOTS];
        for slot in [Slot::Branch, Slot::Place, Slot::Displacement] {
            changed[slot as usize] = true;
        }
        let off = self.any_displaced;
        changed[Slot::Mode as usize] = off[1];
        [changed[Slot::ConfJ as usize], changed[Slot::ConfL as usize]] = self.any_conf_off;
        let others = Others {
            harmless: steps::is_harmless,
            changed,
            has_tools_on_arm: true,
            interrupts_come_back: true,
            ends_loops_at_head: true,
        };
        let conf = self.any_conf_off;
        let is_main = |full: &str| full.rsplit('/').next() == Some("MAIN");
        let tasks = self.procedures.iter().filter(|full| is_main(full));
        let tasks: BTreeSet<String> = tasks.map(|full| task_of(full)).collect();
        let unseen = self.unseen();
        let begins_clean = self.begins_clean(is_main, unseen.is_some());
        // Without `main`, files that are not given call routines too.
        let any_late_call = self.any_late_call;
        // The controller begins `main` too.
        self.procedures
            .retain(|full| !any_late_call && tasks.contains(&task_of(full)) && !is_main(full));
        let first = |routine: &str| {
            let is_clean = routine == "MAIN" && begins_clean;
            is_clean.then(|| entry(routine, [false; 2], [false; 2]))
        };
        let any = |routine: &str| {
            let mut begins = entry(routine, off, conf);
            if let Some(why) = unseen.as_ref().filter(|_| routine == "MAIN") {
                begins.set(Slot::Displacement, unknown(why.clone()));
            }
            begins
        };
        self.common.walk(others, &self.traps, &self.procedures, first, any);
        self.refuse_unloaded();
        self.refuse_several_tasks();
    }
}

/// The folder of a task in a path in capitals.
fn task_of(path: &str) -> String {
    let is_task = |part: &&str| {
        let number = part.strip_prefix("TASK");
        number.is_some_and(|own| !own.is_empty() && own.bytes().all(|byte| byte.is_ascii_digit()))
    };
    path.replace('\\', "/").split('/').find(is_task).unwrap_or_default().to_owned()
}

/// What holds where a routine begins. `main` begins with what its last cycle left.
fn entry(
    routine: &str,
    [any_displacement, any_offset]: [bool; 2],
    any_conf_off: [bool; 2],
) -> State {
    let routine = routine.to_owned();
    let conf = |which: usize, name: &str| {
        if any_conf_off[which] {
            let words = format!(
                "{name} may be on or off where routine {routine} begins; set it there by {name}\\On or {name}\\Off"
            );
            unknown(Refusal::Other(words))
        } else {
            known(Setting::On(true))
        }
    };
    let off = |any: bool, what| {
        if any { unknown(Refusal::Displaced { what }) } else { known(Setting::On(false)) }
    };
    State::new(|slot| match slot {
        Slot::Turn => known(Setting::On(true)),
        Slot::Mode => off(any_offset, "EOffs"),
        Slot::Displacement => off(any_displacement, "PDisp"),
        Slot::ConfJ => conf(0, "ConfJ"),
        Slot::ConfL => conf(1, "ConfL"),
        Slot::Branch => unknown(Refusal::NoBranch { routine: routine.clone() }),
        Slot::Base | Slot::Tool | Slot::Waiting | Slot::Place => {
            unknown(Refusal::NotSet { what: slot.name(), routine: routine.clone() })
        }
    })
}

#[cfg(test)]
mod tests;
