//! What the readers of all dialects share: positions that motions name, routines, and the walk through them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::flow::{Others, Routine, State, Step, Summaries, refuse};
use crate::frame::Cell;
use crate::lex::{Kind, capitals};
use crate::names::{Names, Scope, Variable, Written, parts};
use crate::program::{Computed, File, Motion, Path, Position, Recorder, Shape, Split, Target};
use crate::refusal::{Place, Refusal};
use crate::value::{Cursor, DEGREE_DECIMALS, MM_DECIMALS, Value};

/// The numbers of a position, and an external axis that is not at 0.
pub(crate) type Shaped = (Result<Shape, Refusal>, Option<(String, String)>);

/// Where a statement stands.
#[derive(Clone, Copy)]
pub(crate) struct Here<'h> {
    pub(crate) file: usize,
    pub(crate) line: u32,
    /// From within: the routine's, the module's, everywhere.
    pub(crate) scopes: &'h [Scope],
}

/// What motions use and where they lead.
#[derive(Default)]
pub(crate) struct Used {
    pub(crate) positions: Vec<Position>,
    pub(crate) computed: Vec<Computed>,
    pub(crate) paths: Vec<Path>,
}

/// The content of the files that have been read, whatever their dialect.
pub(crate) struct Common<'f> {
    pub(crate) files: &'f [File],
    pub(crate) names: Names,
    /// Full names of the routines that a short name may mean from anywhere.
    pub(crate) global: BTreeMap<String, Vec<String>>,
    pub(crate) routines: BTreeMap<String, Routine>,
    pub(crate) motions: Vec<Motion>,
    pub(crate) found: Used,
    /// The numbers of a value of a type.
    shape: fn(&Self, &[Scope], &Value, &str) -> Shaped,
    /// What to give where a position has no value.
    give: &'static str,
}

impl<'f> Common<'f> {
    pub(crate) fn new(
        files: &'f [File],
        cell: &Cell,
        found: Used,
        shape: fn(&Self, &[Scope], &Value, &str) -> Shaped,
        give: &'static str,
    ) -> Self {
        // As if they were given, without a statement.
        let harmless = |own: &String| (capitals(own.as_bytes()), Routine::default());
        Self {
            files,
            names: Names::default(),
            global: BTreeMap::new(),
            routines: cell.harmless.iter().map(harmless).collect(),
            motions: Vec::new(),
            found,
            shape,
            give,
        }
    }

    pub(crate) fn at(&self, here: &Here<'_>) -> Place {
        self.files[here.file].at(here.line)
    }

    /// The value of a name that nothing changes.
    pub(crate) fn constant(&self, scopes: &[Scope], name: &str) -> Result<&Written, Refusal> {
        self.names.constant(scopes, name, self.files, self.give)
    }

    /// A position that is written out in its motion.
    pub(crate) fn inline(&mut self, here: &Here<'_>, word: &str, part: Cursor<'_>) -> Target {
        let span = part.span();
        let written = Written { file: here.file, line: here.line, value: part.value(), span };
        one(self.add(here, word, &written, ""))
    }

    /// A declared position by its name; `None` where it is a parameter.
    pub(crate) fn declared(&mut self, here: &Here<'_>, name: &str) -> Option<Target> {
        let (own, element) = parts(name);
        let mut kind = String::new();
        match self.names.find(here.scopes, own) {
            Some(variable) if variable.is_parameter => return None,
            Some(variable) => {
                if let Some(position) = variable.positions.get(element) {
                    return Some(one(*position));
                }
                kind.clone_from(&variable.kind);
            }
            None => {
                // Its value stands in a file that is not given.
                self.names.declare(&here.scopes[here.scopes.len() - 2], own, "");
            }
        }
        let written = self.names.only(here.scopes, name, self.files, self.give);
        let position = match written.cloned() {
            Ok(written) => self.add(here, name, &written, &kind),
            Err(why) => self.missing(here, name, why),
        };
        self.names.find_mut(here.scopes, own)?.positions.insert(element.to_owned(), position);
        Some(one(position))
    }

    /// All elements of an array whose index is worked out: `P[i]`, `p{i}`.
    pub(crate) fn elements(&mut self, here: &Here<'_>, part: Cursor<'_>) -> Option<Target> {
        let mut rest = part;
        let name = rest.take_name()?;
        let close = if rest.take_sign(b'[') { b']' } else { b'}' };
        let is_open = close == b']' || rest.take_sign(b'{');
        if !is_open || rest.take_part(close).is_none() || !rest.is_empty() {
            return None;
        }
        let variable = self.names.find(here.scopes, &name)?;
        let elements: Vec<String> = variable.values.keys().cloned().collect();
        let mut positions = Vec::new();
        for element in elements {
            match self.declared(here, &format!("{name}{element}"))? {
                Target::Literal { positions: own, .. } => positions.extend(own),
                Target::Computed(_) => return None,
            }
        }
        (!positions.is_empty()).then_some(Target::Literal { positions, is_beside: false })
    }

    pub(crate) fn add(
        &mut self,
        here: &Here<'_>,
        name: &str,
        written: &Written,
        kind: &str,
    ) -> usize {
        let (shape, external) = (self.shape)(self, here.scopes, &written.value, kind);
        let file = &self.files[written.file];
        let shared = || Refusal::Shared { file: file.base_name().to_owned() };
        let obstacle = file.is_of_system().then(shared);
        self.found.positions.push(Position {
            file: written.file,
            line: written.line,
            name: name.to_owned(),
            shape,
            external,
            obstacle,
            uses: Vec::new(),
            span: written.span.clone(),
            decimals: [MM_DECIMALS, DEGREE_DECIMALS],
        });
        self.found.positions.len() - 1
    }

    fn missing(&mut self, here: &Here<'_>, name: &str, why: Refusal) -> usize {
        self.found.positions.push(Position {
            file: here.file,
            line: here.line,
            name: name.to_owned(),
            shape: Err(why.clone()),
            external: None,
            obstacle: Some(why),
            uses: Vec::new(),
            span: 0..0,
            decimals: [MM_DECIMALS, DEGREE_DECIMALS],
        });
        self.found.positions.len() - 1
    }

    /// The target that was found in an expression; a computed one where there is none, and what the expression reads is marked.
    pub(crate) fn target(
        &mut self,
        here: &Here<'_>,
        expression: Cursor<'_>,
        found: Option<Target>,
    ) -> Target {
        found.unwrap_or_else(|| {
            self.reads(here, expression);
            Target::Computed(shown(expression))
        })
    }

    /// Counts a position that the program works out, or passes on.
    pub(crate) fn compute(&mut self, here: &Here<'_>, word: &str, text: String) {
        let (file, line, word) = (here.file, here.line, word.to_owned());
        self.found.computed.push(Computed { file, line, word, text });
    }

    /// Adds a motion, and its computed targets to those; one without a target is computed.
    pub(crate) fn moves(&mut self, mut motion: Motion) -> Step {
        let (file, line) = (motion.file, motion.line);
        if motion.targets.is_empty() {
            motion.targets.push(Target::Computed(String::new()));
        }
        for target in &motion.targets {
            if let Target::Computed(text) = target {
                let (word, text) = (motion.word.clone(), text.clone());
                self.found.computed.push(Computed { file, line, word, text });
            }
        }
        self.motions.push(motion);
        Step::Move(self.motions.len() - 1)
    }

    /// Forbids further points before any motion.
    pub(crate) fn keep_whole(&mut self, why: &'static str) {
        let splits = self.motions.iter_mut().map(|own| &mut own.split);
        splits.filter(|own| own.is_ok()).for_each(|own| *own = Err(why));
    }

    /// Motions from an index on that stand outside all routines: they are counted, and refused.
    pub(crate) fn outside(&mut self, here: &Here<'_>, from: usize, steps: Vec<Step>) {
        let words = "its motion stands in no routine; give the whole program".to_owned();
        let why = Arc::new(Refusal::Other(words));
        for motion in &mut self.motions[from..] {
            motion.obstacle = Some(why.clone());
        }
        let name = format!("{}/", self.files[here.file].name);
        self.routines.entry(name).or_default().steps.extend(steps);
    }

    /// A routine's full name: of its own module first.
    pub(crate) fn full_name(&self, own: String, name: &str, is_own: bool) -> String {
        match self.global.get(name).map(Vec::as_slice) {
            _ if is_own => own,
            Some([only]) => only.clone(),
            _ => name.to_owned(),
        }
    }

    pub(crate) fn reads(&mut self, here: &Here<'_>, statement: Cursor<'_>) {
        let at = self.at(here);
        self.each_variable(here.scopes, statement, |variable| {
            variable.read.get_or_insert_with(|| at.clone());
        });
    }

    /// Marks what a statement may change.
    pub(crate) fn touches(&mut self, here: &Here<'_>, statement: Cursor<'_>) {
        let at = self.at(here);
        self.each_variable(here.scopes, statement, |variable| variable.touch("", &at));
    }

    fn each_variable(
        &mut self,
        scopes: &[Scope],
        statement: Cursor<'_>,
        on: impl Fn(&mut Variable),
    ) {
        for token in statement.tokens.iter().filter(|token| token.kind == Kind::Name) {
            if let Some(variable) = self.names.find_mut(scopes, &capitals(statement.text(token))) {
                on(variable);
            }
        }
    }

    /// Walks all routines, callers first; `interrupts` are those that run at any time. A routine of `private` is called from the files
    /// alone, and begins with what holds at all of its calls; any other with what `entry` gives for it, and `first`
    /// for its first begin where that is another.
    pub(crate) fn walk(
        &mut self,
        others: Others,
        interrupts: &[(String, Place)],
        private: &BTreeSet<String>,
        first: impl Fn(&str) -> Option<State>,
        entry: impl Fn(&str) -> State,
    ) {
        let order = self.callers_first(private);
        let Used { positions, paths, .. } = &mut self.found;
        let entries = HashMap::new();
        let mut recorder = Recorder { motions: &self.motions, positions, paths, entries };
        let summaries = Summaries::new(&self.routines, &recorder, interrupts, others);
        for (full, is_open) in order {
            let Some(routine) = self.routines.get(&full) else { continue };
            let name = full.rsplit('/').next().unwrap_or_default();
            let is_open = is_open || interrupts.iter().any(|(own, _)| *own == full);
            let called = recorder.entries.remove(&full).filter(|_| !is_open);
            let entry = called.unwrap_or_else(|| match first(name) {
                Some(first) => summaries.recurring(routine, (first, entry(name)), &recorder),
                None => entry(name),
            });
            if routine.has_closed_blocks() {
                summaries.walk(routine, &entry, &mut recorder);
            } else {
                let why = Arc::new(Refusal::Blocks { routine: name.to_owned() });
                refuse(routine, &State::new(|_| Err(why.clone())), &mut recorder);
            }
        }
        self.names.forbid(&mut self.found.positions);
    }

    /// Names of all routines, each behind those that call it; true for those that are called from elsewhere too, or in a circle.
    fn callers_first(&self, private: &BTreeSet<String>) -> Vec<(String, bool)> {
        let calls = |routine: &Routine| {
            let callee = |step: &Step| match step {
                Step::Call { routine, .. } if private.contains(routine) => Some(routine.clone()),
                _ => None,
            };
            routine.steps.iter().filter_map(callee).collect::<BTreeSet<String>>()
        };
        let calls: BTreeMap<&String, BTreeSet<String>> =
            self.routines.iter().map(|(name, routine)| (name, calls(routine))).collect();
        let mut open: HashMap<&str, usize> = HashMap::new();
        for callee in calls.values().flatten() {
            *open.entry(callee).or_default() += 1;
        }
        let is_ready = |name: &&String| !open.contains_key(name.as_str());
        let mut ready: Vec<String> = self.routines.keys().filter(is_ready).cloned().collect();
        let mut order = Vec::new();
        while let Some(name) = ready.pop() {
            for callee in calls.get(&name).into_iter().flatten() {
                if let Some(left) = open.get_mut(callee.as_str()) {
                    *left -= 1;
                    if *left == 0 {
                        ready.push(callee.clone());
                    }
                }
            }
            let is_open = !private.contains(&name);
            order.push((name, is_open));
        }
        let done: BTreeSet<String> = order.iter().map(|(name, _)| name.clone()).collect();
        let rest = self.routines.keys().filter(|name| !done.contains(*name));
        order.extend(rest.map(|name| (name.clone(), true)));
        order
    }
}

pub(crate) fn one(position: usize) -> Target {
    Target::Literal { positions: vec![position], is_beside: false }
}

pub(crate) fn beside(target: &Target) -> Option<Target> {
    match target {
        Target::Literal { positions, .. } => {
            Some(Target::Literal { positions: positions.clone(), is_beside: true })
        }
        Target::Computed(_) => None,
    }
}

/// Why other motions get no further points.
pub(crate) const NOT_SPLIT: &str =
    "only LIN and CIRC, MoveL and MoveC, L and C, movel and movec get further points";

/// Where points may be written before a motion, by what follows its word and by its positions.
pub(crate) fn split(
    word: &str,
    rest: Cursor<'_>,
    positions: &[Cursor<'_>],
) -> Result<Split, &'static str> {
    let begin = rest.span().start;
    let before = rest.bytes[..begin].trim_ascii_end();
    let (head, own) = before.split_at(before.len().saturating_sub(word.len()));
    let statement = head.len()..rest.span().end;
    // A line of a listing begins with its number: `3:`.
    let is_blank = |byte: &u8| matches!(byte, b' ' | b'\t');
    let is_digit = |byte: &u8| byte.is_ascii_digit();
    let head = without_last(head, is_blank);
    let head = head.strip_suffix(b":").map_or(head, |own| without_last(own, is_digit));
    let line_start = without_last(head, is_blank).len();
    let is_first = line_start == 0 || is_line_end(head[line_start - 1]);
    let is_parted = rest.bytes[before.len()..begin].iter().any(|byte| is_line_end(*byte));
    if !is_first || is_parted || !own.eq_ignore_ascii_case(word.as_bytes()) {
        return Err("it is not alone in its line");
    }
    Ok(Split { line_start, statement, targets: positions.iter().map(Cursor::span).collect() })
}

/// Bytes without the last ones of a kind.
fn without_last(bytes: &[u8], is_of: impl Fn(&u8) -> bool) -> &[u8] {
    let kept = bytes.iter().rposition(|byte| !is_of(byte));
    &bytes[..kept.map_or(0, |last| last + 1)]
}

const fn is_line_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

/// The text of an expression, shortened.
pub(crate) fn shown(part: Cursor<'_>) -> String {
    let span = part.span();
    let text = &part.bytes[span.start..span.end.min(span.start + 60)];
    let shown = |byte: &u8| {
        if byte.is_ascii_graphic() || *byte == b' ' { char::from(*byte) } else { '?' }
    };
    text.iter().map(shown).collect()
}

/// Names that stand before a bracket, in capitals.
pub(crate) fn called(statement: Cursor<'_>) -> impl Iterator<Item = String> {
    let pairs = statement.tokens.windows(2);
    let calls = pairs.filter(|pair| pair[0].kind == Kind::Name && pair[1].is(b'('));
    calls.map(move |pair| capitals(statement.text(&pair[0])))
}

/// Whether a list of words has one.
pub(crate) fn has(words: &str, word: &str) -> bool {
    words.split_ascii_whitespace().any(|own| own == word)
}
