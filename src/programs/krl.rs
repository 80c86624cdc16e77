//! KRL of KUKA (KSS 5 to 8; *Operating and Programming Instructions for System Integrators*): modules of `.src` and `.dat`,
//! with `$config.dat` and `$machine.dat` for the frames.
//!
//! 1. Every file's declarations and values are read ([`data`]), and every assignment of the routines.
//! 2. Each routine becomes steps ([`steps`]): what sets `$BASE`, `$TOOL` and `$IPO_MODE`, blocks, calls, motions.
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

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::flow::Setting;
use crate::flow::{Others, Routine, SLOTS, Slot, State, Summaries, known, unknown, walk};
use crate::frame::Chain;
use crate::lex::{Dialect, Token, tokens};
use crate::names::{Names, Scope};
use crate::program::{Computed, File, Motion, Position, Recorder};
use crate::refusal::Refusal;

pub(crate) use frames::abc;

pub const KRL: Dialect = Dialect {
    name: "KRL",
    comments: &[b";"],
    header: Some(b'&'),
    text_quote: b'"',
    number_quote: Some(b'\''),
    in_names: b"_$",
};

/// What is read of the files so far.
pub(crate) struct Reading<'f> {
    pub(crate) files: &'f [File],
    names: Names,
    /// Full names of the routines that a short name may mean from anywhere.
    global: BTreeMap<String, Vec<String>>,
    routines: BTreeMap<String, Routine>,
    motions: Vec<Motion>,
    positions: Vec<Position>,
    computed: Vec<Computed>,
    /// Whether anything sets a tool that stands in the cell.
    any_fixed_tool: bool,
    /// Full names of all routines.
    local: BTreeSet<String>,
    /// Routines that interrupts call.
    interrupts: Vec<String>,
}

/// Positions, computed targets and the arm's base of the KRL files among `files`.
pub(crate) fn read(files: &[File]) -> (Vec<Position>, Vec<Computed>, Chain) {
    let krl = |file: &File| matches!(file.ending().as_str(), "src" | "sub" | "dat");
    let own: Vec<(usize, Vec<Token>)> = files
        .iter()
        .enumerate()
        .filter(|(_, file)| krl(file))
        .map(|(place, file)| (place, tokens(&file.bytes, &KRL)))
        .collect();
    let mut reading = Reading {
        files,
        names: Names::default(),
        global: BTreeMap::new(),
        routines: BTreeMap::new(),
        motions: Vec::new(),
        positions: Vec::new(),
        computed: Vec::new(),
        any_fixed_tool: false,
        local: BTreeSet::new(),
        interrupts: Vec::new(),
    };
    for (file, tokens) in &own {
        reading.data(*file, tokens);
    }
    for (file, tokens) in &own {
        reading.touches(*file, tokens);
    }
    for (file, tokens) in &own {
        reading.steps(*file, tokens);
    }
    let root = reading.root();
    reading.walk();
    reading.names.forbid(&mut reading.positions);
    (reading.positions, reading.computed, root)
}

impl Reading<'_> {
    /// The scopes of a file's data list: what is in it, then what is everywhere.
    fn scopes(&self, file: usize, routine: Option<&str>) -> Vec<Scope> {
        let module = self.module(file);
        let own = routine.map(|routine| format!("{module}/{routine}"));
        own.into_iter().chain([module, String::new()]).collect()
    }

    /// A module's `.src` and `.dat` have one name.
    fn module(&self, file: usize) -> String {
        let name = &self.files[file].name;
        name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem).to_ascii_uppercase()
    }

    fn walk(&mut self) {
        let recorder = Recorder { motions: &self.motions, positions: &mut self.positions };
        let mut changed = [false; SLOTS];
        for slot in [Slot::Base, Slot::Tool, Slot::Waiting, Slot::Branch] {
            changed[slot as usize] = true;
        }
        changed[Slot::Mode as usize] = self.any_fixed_tool;
        let others = Others { harmless: steps::is_harmless, changed };
        let summaries = Summaries::new(&self.routines, &recorder, others);
        let mut recorder = recorder;
        for routine in self.routines.values() {
            let entry = entry(&routine.name, self.any_fixed_tool);
            let before: Vec<usize> =
                recorder.positions.iter().map(|position| position.uses.len()).collect();
            if !walk(routine, &summaries, &entry, &mut recorder) {
                refuse_since(recorder.positions, &before, &routine.name);
            }
        }
        let changes = |name: &String| {
            [Slot::Base, Slot::Tool, Slot::Mode].iter().any(|slot| summaries.changes(name, *slot))
        };
        if let Some(name) = self.interrupts.iter().find(|name| changes(name)) {
            let words =
                format!("interrupt routine {name} changes a frame, at any time; take that out");
            for position in &mut self.positions {
                position.obstacle.get_or_insert_with(|| Refusal::Other(words.clone()));
            }
        }
    }
}

/// Refuses the uses of a routine whose blocks do not close.
fn refuse_since(positions: &mut [Position], before: &[usize], routine: &str) {
    let why = Arc::new(Refusal::Blocks { routine: short(routine).to_owned() });
    for (position, before) in positions.iter_mut().zip(before) {
        for own in &mut position.uses[*before..] {
            (own.base, own.tool) = (Err(why.clone()), Err(why.clone()));
        }
    }
}

/// A routine's name without its module.
pub(crate) fn short(routine: &str) -> &str {
    routine.rsplit('/').next().unwrap_or(routine)
}

/// What holds where a routine begins: nothing is known of its caller's frames.
fn entry(routine: &str, any_fixed_tool: bool) -> State {
    let routine = short(routine).to_owned();
    State::new(|slot| match slot {
        Slot::Mode if !any_fixed_tool => known(Setting::On(true)),
        Slot::Displacement | Slot::ConfJ | Slot::ConfL => known(Setting::On(false)),
        Slot::Branch => unknown(Refusal::NoBranch { routine: routine.clone() }),
        _ => unknown(Refusal::NotSet { what: slot.name(), routine: routine.clone() }),
    })
}

#[cfg(test)]
mod tests;
