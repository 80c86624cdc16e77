//! What holds at each motion of a routine: its base, its tool, and whatever else earlier statements have set.
//!
//! A routine is walked once in the order of its text. Where ways meet, a setting that differs becomes unknown; at the head of a
//! loop it is what holds whenever the loop begins anew; at a label it is what holds before the first jump or label, outside all
//! blocks, and nothing behind that changes; in an error handler what nothing in the routine changes; after a call it is what the called routine
//! always sets or does not change, and nothing at all where the routine is in no given file. A routine that an interrupt's leaves early, or
//! behind whose error its caller goes on, ends anywhere: behind it holds what nothing in it changes. So a setting that is known holds on every way through the program.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::frame::Chain;
use crate::refusal::{Place, Refusal};
use crate::value::Letters;

/// What statements set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    Base,
    Tool,
    /// Whether the tool is on the arm.
    Mode,
    /// Whether the tool turns to the orientations that positions state.
    Turn,
    /// The frames of an inline form that wait to be set.
    Waiting,
    Displacement,
    ConfJ,
    ConfL,
    /// The position that last stated an arm configuration.
    Branch,
    /// The position that the last motion ended at.
    Place,
}

pub const SLOTS: usize = 10;

impl Slot {
    const ALL: [Self; SLOTS] = [
        Self::Base,
        Self::Tool,
        Self::Mode,
        Self::Turn,
        Self::Waiting,
        Self::Displacement,
        Self::ConfJ,
        Self::ConfL,
        Self::Branch,
        Self::Place,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Base => "the base",
            Self::Tool => "the tool",
            Self::Mode => "the interpolation mode",
            Self::Turn => "$ORI_TYPE",
            Self::Waiting => "FDAT_ACT",
            Self::Displacement => "the displacement",
            Self::ConfJ => "ConfJ",
            Self::ConfL => "ConfL",
            Self::Branch => "the arm configuration",
            Self::Place => "the position of the arm",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub enum Setting {
    Frames(Chain),
    On(bool),
    /// Base, tool and mode of an inline form.
    Inline(Box<[Known; 3]>),
    /// Its index among the positions.
    Position(usize),
    Config(Letters),
    /// S of KUKA.
    Status(u8),
}

impl Setting {
    pub const fn position(&self) -> Option<usize> {
        match self {
            Self::Position(place) => Some(*place),
            _ => None,
        }
    }
}

pub type Known = Result<Arc<Setting>, Arc<Refusal>>;

#[expect(clippy::unnecessary_wraps, reason = "the other half of `unknown`")]
pub fn known(setting: Setting) -> Known {
    Ok(Arc::new(setting))
}

pub fn unknown(refusal: Refusal) -> Known {
    Err(Arc::new(refusal))
}

#[derive(Debug, Clone, PartialEq)]
pub struct State {
    slots: [Known; SLOTS],
}

impl State {
    pub fn new(of: impl Fn(Slot) -> Known) -> Self {
        Self { slots: Slot::ALL.map(of) }
    }

    pub const fn get(&self, slot: Slot) -> &Known {
        &self.slots[slot as usize]
    }

    pub fn set(&mut self, slot: Slot, to: Known) {
        self.slots[slot as usize] = to;
    }

    /// How many slots are known.
    fn known(&self) -> usize {
        self.slots.iter().filter(|slot| slot.is_ok()).count()
    }

    /// What holds on both of two ways.
    pub fn join(&mut self, other: &Self) {
        for slot in Slot::ALL {
            let same = match (self.get(slot), other.get(slot)) {
                (Ok(own), Ok(other)) => own == other,
                (Err(_), _) => true,
                (Ok(_), Err(_)) => {
                    self.set(slot, other.get(slot).clone());
                    true
                }
            };
            if !same {
                self.set(slot, ways(slot));
            }
        }
    }

    /// After statements that may have happened or not.
    fn after(&mut self, effects: &Effects) {
        for slot in Slot::ALL {
            self.after_one(slot, &effects[slot as usize]);
        }
    }

    fn after_one(&mut self, slot: Slot, effect: &Effect) {
        let kept = match effect {
            Effect::None => true,
            Effect::One(to) => to == self.get(slot),
            Effect::Many(_) => false,
        };
        if !kept {
            self.set(slot, effect.refusal(slot));
        }
    }
}

fn ways(slot: Slot) -> Known {
    unknown(if slot == Slot::Branch {
        Refusal::TwoBranches
    } else {
        Refusal::Ways { what: slot.name() }
    })
}

#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    Set(Slot, Known),
    /// The frames that wait are set.
    Apply,
    /// Its index among the motions.
    Move(usize),
    Call {
        routine: String,
        at: Place,
    },
    If,
    /// An `ELSE` is the last, an `ELSEIF` is not.
    Else {
        is_last: bool,
    },
    /// The condition of an `ELSEIF` or of a loop is worked out: what it did holds on all ways behind it.
    Tested,
    EndIf,
    Loop,
    EndLoop,
    Switch,
    Case {
        is_default: bool,
    },
    EndSwitch,
    /// A jump to a label may begin here.
    Jump,
    /// The routine, or a pass of its loop, may end here. Whether one that gives a value is called at all may be for what stands beside
    /// its call to say.
    Return {
        with_value: bool,
    },
    /// Of an interrupt's routine: those that were called since it was declared end where they are.
    Resume,
    /// A place that the program may jump to.
    Label,
    /// An error handler, up to the end: it may be entered from anywhere, and may go back to there.
    Handler,
    /// An error handler goes on behind the statement that failed, be it a call.
    GoesOn,
    /// Settings for all up to [`Step::EndWith`].
    With(Vec<(Slot, Known)>),
    EndWith,
}

#[derive(Debug, Clone, PartialEq, Default)]
enum Effect {
    #[default]
    None,
    One(Known),
    /// With the call that does it, where one does.
    Many(Option<Arc<Refusal>>),
}

type Effects = [Effect; SLOTS];

impl Effect {
    fn add(&mut self, other: &Self) {
        match (&*self, other) {
            (_, Self::None) | (Self::Many(_), _) => {}
            (Self::One(own), Self::One(to)) if own == to => {}
            (Self::None, other) => *self = other.clone(),
            (Self::One(_), Self::Many(why)) => *self = Self::Many(why.clone()),
            (Self::One(_), Self::One(_)) => *self = Self::Many(None),
        }
    }

    /// It only rises while effects are gathered, so that gathering ends.
    const fn level(&self) -> u8 {
        match self {
            Self::None => 0,
            Self::One(_) => 1,
            Self::Many(_) => 2,
        }
    }

    fn refusal(&self, slot: Slot) -> Known {
        match self {
            Self::Many(Some(why)) => Err(why.clone()),
            _ => ways(slot),
        }
    }
}

/// A motion's part in the flow.
pub trait Motions {
    /// The arm configuration that the motion states for those behind it; `None` where none. Without a state: where it
    /// may state one.
    fn branch(&self, motion: usize, state: Option<&State>) -> Option<Known>;
    fn end(&self, motion: usize) -> Known;
    fn happens(&mut self, motion: usize, state: &State);
    fn calls(&mut self, routine: &str, state: &State);
}

#[derive(Debug, Clone, Default)]
pub struct Routine {
    pub steps: Vec<Step>,
}

impl Routine {
    /// The first step, outside all blocks, before which no jump begins and no label stands: an error handler is entered from anywhere.
    fn first_jump(&self) -> usize {
        if self.steps.contains(&Step::Handler) {
            return 0;
        }
        let (mut outside, mut depth) = (0, 0_i32);
        for (place, step) in self.steps.iter().enumerate() {
            if depth == 0 {
                outside = place;
            }
            match step {
                Step::Jump | Step::Label => return outside,
                Step::If | Step::Loop | Step::Switch | Step::With(_) => depth += 1,
                Step::EndIf | Step::EndLoop | Step::EndSwitch | Step::EndWith => depth -= 1,
                _ => {}
            }
        }
        self.steps.len()
    }

    /// Full names of the routines that it calls, and where.
    pub fn calls(&self) -> impl Iterator<Item = (&str, &Place)> {
        self.steps.iter().filter_map(|step| match step {
            Step::Call { routine, at } => Some((routine.as_str(), at)),
            _ => None,
        })
    }

    /// Whether it ends behind its last step, or where it returns, and nowhere else.
    fn ends_where_it_says(&self) -> bool {
        let jumps = |step: &Step| {
            let is_value = *step == Step::Return { with_value: true };
            is_value || matches!(step, Step::Jump | Step::Label | Step::Handler)
        };
        self.has_closed_blocks() && !self.steps.iter().any(jumps)
    }

    /// Whether its blocks close as they open.
    pub fn has_closed_blocks(&self) -> bool {
        let mut open = Vec::new();
        let closes = self.steps.iter().all(|step| match step {
            Step::If | Step::Loop | Step::Switch | Step::With(_) => {
                open.push(step);
                true
            }
            Step::Else { .. } => open.last() == Some(&&Step::If),
            Step::Case { .. } => open.last() == Some(&&Step::Switch),
            Step::EndIf => open.pop() == Some(&Step::If),
            Step::EndLoop => open.pop() == Some(&Step::Loop),
            Step::EndSwitch => open.pop() == Some(&Step::Switch),
            Step::EndWith => matches!(open.pop(), Some(Step::With(_))),
            _ => true,
        });
        closes && open.is_empty()
    }
}

/// Effects of all routines by their names, each with those of the routines it calls.
#[derive(Debug)]
pub struct Summaries {
    of: HashMap<String, Effects>,
    /// What always holds behind a routine, whatever was before it.
    exits: HashMap<String, State>,
    /// Whether interrupts end routines where they are.
    resumes: bool,
    /// What interrupts may do.
    any_time: AtAnyTime,
    others: Others,
}

/// The routines that call each one, by its name.
fn callers(routines: &BTreeMap<String, Routine>) -> BTreeMap<&str, BTreeSet<&str>> {
    let mut callers = BTreeMap::<&str, BTreeSet<&str>>::new();
    for (name, own) in routines {
        for (routine, _) in own.calls() {
            callers.entry(routine).or_default().insert(name);
        }
    }
    callers
}

/// The routines given with those that they call.
pub fn reached<'r>(
    routines: &'r BTreeMap<String, Routine>,
    given: impl Iterator<Item = &'r str>,
) -> BTreeSet<&'r str> {
    let (mut open, mut seen) = (given.collect::<Vec<_>>(), BTreeSet::new());
    while let Some(name) = open.pop() {
        let Some(routine) = routines.get(name).filter(|_| seen.insert(name)) else { continue };
        open.extend(routine.calls().map(|(own, _)| own));
    }
    seen
}

/// Whether an interrupt's routine, or one that it calls, ends others where they are.
fn resume(routines: &BTreeMap<String, Routine>, interrupts: &[(String, Place)]) -> bool {
    let reached = reached(routines, interrupts.iter().map(|(name, _)| name.as_str()));
    reached.iter().any(|name| routines[*name].steps.contains(&Step::Resume))
}

/// Motions of a routine that is walked for its exit alone.
struct Unseen<'m>(&'m dyn Motions);

impl Motions for Unseen<'_> {
    fn branch(&self, motion: usize, state: Option<&State>) -> Option<Known> {
        self.0.branch(motion, state)
    }

    fn end(&self, motion: usize) -> Known {
        self.0.end(motion)
    }

    fn happens(&mut self, _: usize, _: &State) {}

    fn calls(&mut self, _: &str, _: &State) {}
}

/// What calls of routines do that are in no given file.
#[derive(Debug, Clone, Copy)]
pub struct Others {
    /// Whether a routine of the controller sets nothing that is followed here.
    pub harmless: fn(&str) -> bool,
    /// Slots that any other may change.
    pub changed: [bool; SLOTS],
    /// Whether all frames that wait to be set are for a tool on the arm.
    pub has_tools_on_arm: bool,
    /// Whether the arm is back where it was when an interrupt's routine ends; a thread leads it on.
    pub interrupts_come_back: bool,
    /// Whether loops end where they begin alone.
    pub ends_loops_at_head: bool,
}

impl Others {
    fn applied_mode(&self) -> Effect {
        if self.has_tools_on_arm {
            Effect::One(known(Setting::On(true)))
        } else {
            Effect::Many(None)
        }
    }
}

impl Summaries {
    pub fn new(
        routines: &BTreeMap<String, Routine>,
        motions: &impl Motions,
        interrupts: &[(String, Place)],
        others: Others,
    ) -> Self {
        let none = routines.keys().map(|name| (name.clone(), Effects::default()));
        let resumes = resume(routines, interrupts);
        let (exits, any_time) = (HashMap::new(), AtAnyTime::default());
        let mut own = Self { of: none.collect(), exits, resumes, any_time, others };
        let mut changed = true;
        while changed {
            changed = false;
            for (name, routine) in routines.iter().chain(routines.iter().rev()) {
                let effects = own.effects(&routine.steps, motions);
                let before = own.of.get(name).map(|own| own.each_ref().map(Effect::level));
                if before != Some(effects.each_ref().map(Effect::level)) {
                    own.of.insert(name.clone(), effects);
                    changed = true;
                }
            }
        }
        if !resumes {
            own.find_exits(routines, motions);
        }
        own.any_time = own.at_any_time(interrupts);
        own
    }

    /// Finds what holds behind the routines that are called where nothing interrupts them, and again behind their callers where more is known.
    fn find_exits(&mut self, routines: &BTreeMap<String, Routine>, motions: &impl Motions) {
        let none = unknown(Refusal::Other(String::new()));
        let entry = State::new(|_| none.clone());
        let callers = callers(routines);
        let mut open: Vec<&str> = callers.keys().copied().collect();
        while let Some(name) = open.pop() {
            let Some(routine) = routines.get(name).filter(|own| own.ends_where_it_says()) else {
                continue;
            };
            let exit = self.walk_with(routine, &entry, &mut Unseen(motions), 0);
            let before = self.exits.get(name).map_or(0, State::known);
            if exit.known() > before {
                open.extend(callers[name].iter().filter(|own| callers.contains_key(**own)));
            }
            self.exits.insert(name.to_owned(), exit);
        }
    }

    /// What routines may do at any time, as interrupts call them.
    fn at_any_time(&self, routines: &[(String, Place)]) -> AtAnyTime {
        let mut all = AtAnyTime::default();
        for (routine, at) in routines {
            let mut effects = self.call(routine, at);
            if self.others.interrupts_come_back && !self.resumes {
                effects[Slot::Branch as usize] = Effect::None;
                effects[Slot::Place as usize] = Effect::None;
            }
            for (slot, effect) in Slot::ALL.into_iter().zip(&effects) {
                if matches!(effect, Effect::One(_) | Effect::Many(None)) {
                    let (what, at) = (slot.name(), at.clone());
                    let routine = routine.rsplit('/').next().unwrap_or_default().to_owned();
                    let why = || Arc::new(Refusal::Interrupt { what, routine, at });
                    all.by[slot as usize].get_or_insert_with(why);
                }
            }
            add(&mut all.effects, &effects);
        }
        all
    }

    fn effects(&self, steps: &[Step], motions: &impl Motions) -> Effects {
        let mut all = Effects::default();
        for step in steps {
            self.add(&mut all, step, motions);
        }
        all
    }

    fn add(&self, all: &mut Effects, step: &Step, motions: &impl Motions) {
        match step {
            Step::Set(slot, to) => all[*slot as usize].add(&Effect::One(to.clone())),
            Step::Apply => {
                for slot in [Slot::Base, Slot::Tool] {
                    all[slot as usize].add(&Effect::Many(None));
                }
                all[Slot::Mode as usize].add(&self.others.applied_mode());
            }
            Step::Move(motion) => {
                if let Some(branch) = motions.branch(*motion, None) {
                    all[Slot::Branch as usize].add(&Effect::One(branch));
                }
                all[Slot::Place as usize].add(&Effect::One(motions.end(*motion)));
            }
            Step::Call { routine, at } => add(all, &self.call(routine, at)),
            _ => {}
        }
    }

    fn call(&self, routine: &str, at: &Place) -> Effects {
        if let Some(effects) = self.of.get(routine) {
            return effects.clone();
        }
        if (self.others.harmless)(routine) {
            return Effects::default();
        }
        Slot::ALL.map(|slot| {
            if !self.others.changed[slot as usize] {
                return Effect::None;
            }
            let routine = routine.to_owned();
            let what = slot.name();
            Effect::Many(Some(Arc::new(Refusal::Call { what, routine, at: at.clone() })))
        })
    }
}

fn add(all: &mut Effects, more: &Effects) {
    for (own, more) in all.iter_mut().zip(more) {
        own.add(more);
    }
}

/// What may happen between any two statements.
#[derive(Debug, Clone, Default)]
struct AtAnyTime {
    effects: Effects,
    /// The first interrupt that changes each slot.
    by: [Option<Arc<Refusal>>; SLOTS],
}

enum Block {
    If { entry: State, then: Option<State>, has_else: bool },
    Loop { head: State },
    Switch { entry: State, ends: Option<State>, has_default: bool, is_begun: bool },
    With { before: State },
}

struct Walk<'w, M> {
    summaries: &'w Summaries,
    motions: &'w mut M,
    /// What may happen before any motion.
    any_time: AtAnyTime,
    /// Whether the routine handles errors, also those of routines that it calls.
    has_handler: bool,
    /// Whether such a call may end anywhere.
    goes_on: bool,
    state: State,
    blocks: Vec<Block>,
}

/// Loops within each other that are looked into for what no pass changes, and blocks within each other in which they are.
const LOOPS: usize = 3;
const BLOCKS: usize = 8;

impl Summaries {
    /// Walks a routine whose blocks close as they open.
    pub fn walk(&self, routine: &Routine, entry: &State, motions: &mut impl Motions) {
        self.walk_with(routine, entry, motions, LOOPS);
    }

    /// Walks a routine, looking into `into` loops within each other, and gives what holds wherever it ends.
    fn walk_with(
        &self,
        routine: &Routine,
        entry: &State,
        motions: &mut impl Motions,
        into: usize,
    ) -> State {
        let loops = loop_effects(&routine.steps, self, motions);
        let first_jump = routine.first_jump();
        let mut any_time = self.any_time.clone();
        let handler = routine.steps.iter().position(|step| *step == Step::Handler);
        if let Some(handler) = handler {
            add(&mut any_time.effects, &self.effects(&routine.steps[handler..], motions));
        }
        let (has_handler, state) = (handler.is_some(), entry.clone());
        let goes_on = routine.steps.contains(&Step::GoesOn);
        let blocks = Vec::new();
        let mut walk =
            Walk { summaries: self, motions, any_time, has_handler, goes_on, state, blocks };
        let (mut before_jumps, mut returned) = (entry.clone(), Vec::new());
        let behind = self.effects(&routine.steps[first_jump..], walk.motions);
        for (place, step) in routine.steps.iter().enumerate() {
            if place == first_jump {
                before_jumps = walk.state.clone();
            }
            match step {
                Step::Loop => {
                    let body = loops.get(&place).map(|(effects, end)| {
                        let is_tried = into > 0 && walk.blocks.len() < BLOCKS && !has_handler;
                        (effects, is_tried.then(|| &routine.steps[place + 1..*end]))
                    });
                    walk.open_loop(body, into);
                }
                Step::Label | Step::Handler => {
                    walk.state = before_jumps.clone();
                    walk.state.after(&behind);
                }
                Step::Return { .. } => returned.push(walk.state.clone()),
                step => walk.step(step),
            }
        }
        for end in &returned {
            walk.state.join(end);
        }
        walk.state
    }

    /// What holds whenever a routine begins that runs again and again: of what holds at its first begin what no run changes, otherwise
    /// what holds at `any`.
    pub fn recurring(
        &self,
        routine: &Routine,
        begins: (State, State),
        motions: &dyn Motions,
    ) -> State {
        self.again(routine, begins, motions, LOOPS)
    }

    fn again(
        &self,
        routine: &Routine,
        (first, any): (State, State),
        motions: &dyn Motions,
        into: usize,
    ) -> State {
        if !routine.ends_where_it_says() {
            return any;
        }
        let mut entry = first;
        loop {
            let mut exit = self.walk_with(routine, &entry, &mut Unseen(motions), into);
            exit.after(&self.any_time.effects);
            let differs = |a: &State, b: &State, slot: Slot| a.get(slot) != b.get(slot);
            let mut changed = Slot::ALL.into_iter();
            let changed =
                changed.find(|slot| differs(&entry, &any, *slot) && differs(&entry, &exit, *slot));
            let Some(slot) = changed else { return entry };
            entry.set(slot, any.get(slot).clone());
        }
    }
}

/// The motions and calls of a routine that is not followed: all happen in one state.
pub fn refuse(routine: &Routine, state: &State, motions: &mut impl Motions) {
    for step in &routine.steps {
        match step {
            Step::Move(motion) => motions.happens(*motion, state),
            Step::Call { routine, .. } => motions.calls(routine, state),
            _ => {}
        }
    }
}

/// Effects of each loop and the place of its last step, by that of its first.
fn loop_effects(
    steps: &[Step],
    summaries: &Summaries,
    motions: &impl Motions,
) -> HashMap<usize, (Effects, usize)> {
    let mut done = HashMap::new();
    let mut open: Vec<(usize, Effects)> = Vec::new();
    for (place, step) in steps.iter().enumerate() {
        match step {
            Step::Loop => open.push((place, Effects::default())),
            Step::EndLoop => {
                if let Some((first, effects)) = open.pop() {
                    if let Some((_, outer)) = open.last_mut() {
                        add(outer, &effects);
                    }
                    done.insert(first, (effects, place));
                }
            }
            step => {
                if let Some((_, effects)) = open.last_mut() {
                    summaries.add(effects, step, motions);
                }
            }
        }
    }
    done
}

impl<M: Motions> Walk<'_, M> {
    fn step(&mut self, step: &Step) {
        match step {
            Step::Set(slot, to) => self.state.set(*slot, to.clone()),
            Step::Apply => self.apply(),
            Step::Move(motion) => self.motion(*motion),
            Step::Call { routine, at } => self.call(routine, at),
            Step::If => self.open_if(),
            Step::Switch => self.open_switch(),
            Step::With(own) => self.with(own),
            Step::Loop
            | Step::Jump
            | Step::Return { .. }
            | Step::Resume
            | Step::Label
            | Step::Handler
            | Step::GoesOn => {}
            Step::Else { is_last } => self.branch_else(*is_last),
            Step::Tested => match self.blocks.last_mut() {
                Some(Block::If { entry, .. }) => entry.clone_from(&self.state),
                Some(Block::Loop { head }) if self.summaries.others.ends_loops_at_head => {
                    head.clone_from(&self.state);
                }
                _ => {}
            },
            Step::Case { is_default } => self.case(*is_default),
            Step::EndIf | Step::EndLoop | Step::EndSwitch | Step::EndWith => self.close(),
        }
    }

    fn apply(&mut self) {
        let slots = [Slot::Base, Slot::Tool, Slot::Mode];
        match self.state.get(Slot::Waiting).clone() {
            Ok(setting) => {
                let Setting::Inline(frames) = &*setting else {
                    return;
                };
                for (slot, to) in slots.into_iter().zip(frames.iter()) {
                    self.state.set(slot, to.clone());
                }
            }
            Err(why) => slots.into_iter().for_each(|slot| self.state.set(slot, Err(why.clone()))),
        }
    }

    fn call(&mut self, routine: &str, at: &Place) {
        self.interrupted();
        let effects = self.summaries.call(routine, at);
        if self.has_handler {
            // The handler may make the call again after an error within it.
            self.state.after(&effects);
        }
        self.motions.calls(routine, &self.state);
        self.state.after(&effects);
        let exit = self.summaries.exits.get(routine).filter(|_| !self.goes_on);
        let exit = exit.iter().flat_map(|exit| &exit.slots);
        for (own, exit) in self.state.slots.iter_mut().zip(exit).filter(|(_, exit)| exit.is_ok()) {
            own.clone_from(exit);
        }
    }

    /// After interrupts and error handlers, which may have run before this statement.
    fn interrupted(&mut self) {
        let AtAnyTime { effects, by } = &self.any_time;
        for (slot, by) in Slot::ALL.into_iter().zip(by) {
            if self.state.get(slot).is_ok() {
                self.state.after_one(slot, &effects[slot as usize]);
                if let (Some(by), Err(_)) = (by, self.state.get(slot)) {
                    self.state.set(slot, Err(by.clone()));
                }
            }
        }
    }

    fn motion(&mut self, motion: usize) {
        self.interrupted();
        self.motions.happens(motion, &self.state);
        if let Some(branch) = self.motions.branch(motion, Some(&self.state)) {
            self.state.set(Slot::Branch, branch);
        }
        self.state.set(Slot::Place, self.motions.end(motion));
    }

    /// In a loop holds what holds again whenever its steps begin; behind one that may be left anywhere what nothing in it changes.
    fn open_loop(&mut self, body: Option<(&Effects, Option<&[Step]>)>, into: usize) {
        let before = self.state.clone();
        if let Some((effects, _)) = body {
            self.state.after(effects);
        }
        let mut head = self.state.clone();
        if let Some((_, Some(steps))) = body {
            let routine = Routine { steps: steps.to_vec() };
            let begins = (before, head.clone());
            self.state = self.summaries.again(&routine, begins, self.motions, into - 1);
            if self.summaries.others.ends_loops_at_head {
                head.clone_from(&self.state);
            }
        }
        self.blocks.push(Block::Loop { head });
    }

    fn open_if(&mut self) {
        let entry = self.state.clone();
        self.blocks.push(Block::If { entry, then: None, has_else: false });
    }

    fn open_switch(&mut self) {
        let entry = self.state.clone();
        self.blocks.push(Block::Switch { entry, ends: None, has_default: false, is_begun: false });
    }

    fn with(&mut self, own: &[(Slot, Known)]) {
        self.blocks.push(Block::With { before: self.state.clone() });
        for (slot, to) in own {
            self.state.set(*slot, to.clone());
        }
    }

    fn branch_else(&mut self, is_last: bool) {
        let Some(Block::If { entry, then, has_else }) = self.blocks.last_mut() else {
            return;
        };
        *has_else |= is_last;
        let ended = std::mem::replace(&mut self.state, entry.clone());
        // Of `ELSEIF` there may be many.
        match then {
            Some(then) => then.join(&ended),
            None => *then = Some(ended),
        }
    }

    fn case(&mut self, is_default: bool) {
        let Some(Block::Switch { entry, ends, has_default, is_begun }) = self.blocks.last_mut()
        else {
            return;
        };
        *has_default |= is_default;
        let ended = std::mem::replace(&mut self.state, entry.clone());
        match ends {
            Some(ends) => ends.join(&ended),
            None if *is_begun => *ends = Some(ended),
            // What stands before the first case is no way of its own.
            None => {}
        }
        *is_begun = true;
    }

    fn close(&mut self) {
        match self.blocks.pop() {
            Some(Block::If { entry, then, has_else }) => {
                if !has_else {
                    self.state.join(&entry);
                }
                if let Some(then) = then {
                    self.state.join(&then);
                }
            }
            Some(Block::Loop { head }) => self.state = head,
            Some(Block::Switch { entry, ends, has_default, .. }) => {
                if !has_default {
                    self.state.join(&entry);
                }
                if let Some(ends) = ends {
                    self.state.join(&ends);
                }
            }
            Some(Block::With { mut before }) => {
                for slot in [Slot::Branch, Slot::Place] {
                    before.set(slot, self.state.get(slot).clone());
                }
                self.state = before;
            }
            None => {}
        }
    }
}
