//! Motions: `L P[2] 100mm/sec CNT50 ACC80 Wjnt`, `C P[3] P[4] …`.

use std::sync::Arc;

use super::{DECIMALS, Reading};
use crate::flow::{Known, Slot, Step};
use crate::lex::{Kind, Token, capitals};
use crate::program::{Motion, Position, Reads, Split, Target, Way};
use crate::reading::{Here, NOT_SPLIT, beside, has, one, shown, split};
use crate::refusal::Refusal;
use crate::value::Cursor;

use super::position::number;

/// Options that leave a motion's end where it is, without their digits, and the words in them.
const HARMLESS: &str = "ACC ALIM AP_LD ARC BREAK CTV CV END EV IND JPOS LBL LPOS MROT OFFSET PR PSPD PTH R RT_LD AR SKIP START TOOL_OFFSET WELD WJNT";
/// Options with which it ends beside its position.
const OFFSETS: &str = "OFFSET TOOL_OFFSET";
/// Options that begin what happens beside the motion.
const BESIDE: &str = "TB TA DB PS CALL SPOT";
/// Options that are for each part of a way as for the whole of it.
const OF_PARTS: &str = "ACC ALIM AR BREAK MROT PSPD PTH R";
/// Options that are for the motion wherever they stand.
const OF_MOTION: &str = "COORD INC OFFSET RTCP SEARCH SKIP TOOL_OFFSET TRACK VOFFSET WJNT";

/// The word of a motion; `None` for another statement.
pub(super) fn motion(statement: Cursor<'_>) -> Option<(String, Cursor<'_>)> {
    let mut rest = statement;
    let word = rest.take_name()?;
    let is_motion = matches!(word.as_str(), "J" | "L" | "C" | "A" | "S");
    // `A[1]=ON` sets an output of a German controller, and `C TOOL CHANGE` is a macro.
    let is_macro =
        rest.peek_name().is_some() && !rest.tokens.get(1).is_some_and(|own| own.is(b'['));
    let is_other = rest.first().is_none_or(|token| token.is(b'[') || token.is(b'=')) || is_macro;
    (is_motion && !is_other).then_some((word, rest))
}

/// Names outside brackets.
fn names(rest: Cursor<'_>) -> impl Iterator<Item = (usize, String)> {
    let mut depth = 0_i32;
    let outside = rest.tokens.iter().enumerate().filter(move |(_, token)| {
        depth += i32::from(token.is(b'[') || token.is(b'('));
        depth -= i32::from(token.is(b']') || token.is(b')'));
        depth == 0 && token.kind == Kind::Name
    });
    outside.map(move |(place, token)| (place, capitals(rest.text(token))))
}

/// A name without the number behind it: `CNT` of `CNT100`, `CR` of `CR20mm`.
fn without_number(name: &str) -> &str {
    name.trim_end_matches("MM").trim_end_matches(|letter: char| letter.is_ascii_digit())
}

fn is_end(name: &str) -> bool {
    matches!(without_number(name), "FINE" | "CNTR" | "CNT" | "CR" | "CD")
}

/// Numbers of a position's user frame and its tool; `None` for those that are set.
type Frames = [Option<u32>; 2];

/// What a motion is written of.
struct Parts<'t> {
    targets: Vec<Target>,
    /// Where they stand.
    places: Vec<Cursor<'t>>,
    /// Of its listed positions.
    frames: Vec<Frames>,
    /// `FINE`, `CNT50`; `None` where neither stands.
    end: Option<String>,
    options: Vec<String>,
    /// Whether its parts may be motions like it: nothing happens beside it, and its speed is no time.
    is_plain: bool,
}

impl Parts<'_> {
    fn has(&self, option: &str) -> bool {
        self.options.iter().any(|own| own == option)
    }

    fn way(&self, word: &str) -> Way {
        match word {
            _ if self.has("SKIP") || self.has("WJNT") => Way::Other,
            "J" => Way::Joints,
            "L" => Way::Straight,
            "C" if self.targets.len() == 2 => Way::Circle,
            _ => Way::Other,
        }
    }

    fn split(&self, word: &str, rest: Cursor<'_>) -> Result<Split, &'static str> {
        match self.way(word) {
            Way::Straight | Way::Circle if self.is_plain => split(word, rest, &self.places),
            Way::Straight | Way::Circle => Err("its time or an option is for it alone"),
            _ => Err(NOT_SPLIT),
        }
    }

    /// The first option of a motion that is not followed, or that it has no end.
    fn unknown(&self, word: &str) -> Option<String> {
        let is_known = |own: &&String| has(HARMLESS, without_number(own));
        let option = self.options.iter().find(|own| !is_known(own));
        let none = || self.end.is_none().then(|| format!("{word} without FINE or CNT"));
        option.map(|option| format!("{word} with {option}")).or_else(none)
    }
}

impl Reading<'_> {
    pub(super) fn motion(
        &mut self,
        here: &Here<'_>,
        word: &str,
        rest: Cursor<'_>,
        tracks: Option<u32>,
        steps: &mut Vec<Step>,
    ) {
        let parts = self.parts(here, word, rest);
        let is_read = word == "J" || parts.has("WJNT");
        steps.push(self.common.moves(Motion {
            file: here.file,
            line: here.line,
            word: word.to_owned(),
            own: self.own(parts.frames.last()),
            is_held: true,
            reads: if is_read { Reads::Always } else { Reads::Never },
            way: parts.way(word),
            is_blended: parts.end.as_ref().is_none_or(|end| end != "FINE"),
            split: parts.split(word, rest),
            obstacle: self.obstacle(here, word, &parts, tracks).map(Arc::new),
            holds_part: false,
            targets: parts.targets,
        }));
        self.beside(here, rest, steps);
    }

    fn parts<'t>(&mut self, here: &Here<'_>, word: &str, rest: Cursor<'t>) -> Parts<'t> {
        let mut rest = rest;
        let (mut targets, mut places, mut frames) = (Vec::new(), Vec::new(), Vec::new());
        let count = if word == "C" { 2 } else { 1 };
        let is_target = |own: &[Token]| own[0].kind == Kind::Name && own[1].is(b'[');
        // What stands between two positions is an option of the first, and `PR[1]` behind a comma a part of it.
        let mut between = Vec::new();
        while targets.len() < count {
            let mut all = rest.tokens.windows(2).enumerate();
            let is_free = |place: usize| place == 0 || !rest.tokens[place - 1].is(b',');
            let is_next = |(place, own): (usize, &[Token])| is_target(own) && is_free(place);
            let Some(next) = all.position(is_next).filter(|next| *next == 0 || count == 2) else {
                break;
            };
            let (options, tokens) = rest.tokens.split_at(next);
            between.extend(options_of(Cursor { tokens: options, ..rest }));
            rest.tokens = tokens;
            let (target, own, place) = self.target(here, &mut rest);
            targets.push(target);
            places.push(place);
            frames.extend(own);
        }
        let end = names(rest).find(|(_, name)| is_end(name));
        let behind =
            end.as_ref().map(|(place, _)| Cursor { tokens: &rest.tokens[place + 1..], ..rest });
        let is_plain = between.is_empty() && behind.is_some_and(is_of_parts) && !has_time(rest);
        between.extend(behind.into_iter().flat_map(options_of));
        let end = end.map(|(_, name)| name);
        if between.iter().any(|own| has(OFFSETS, own)) {
            targets = targets.into_iter().map(|own| beside(&own).unwrap_or(own)).collect();
        }
        Parts { targets, places, frames, end, options: between, is_plain }
    }

    fn obstacle(
        &self,
        here: &Here<'_>,
        word: &str,
        parts: &Parts,
        tracks: Option<u32>,
    ) -> Option<Refusal> {
        if let Some(line) = tracks {
            let at = self.common.files[here.file].at(line);
            return Some(Refusal::Moving { name: "its user frame".to_owned(), at });
        }
        if let Some(word) = parts.unknown(word) {
            return Some(Refusal::Instruction { word, at: self.common.at(here) });
        }
        let differs = parts.frames.windows(2).any(|own| own[0] != own[1]);
        let words = "the positions of its motion state two user frames or tools; give them one";
        differs.then(|| Refusal::Other(words.to_owned()))
    }

    /// The frames that a position states.
    fn own(&self, frames: Option<&Frames>) -> Vec<(Slot, Known)> {
        let frames = frames.copied().unwrap_or_default();
        let stated = [Slot::Base, Slot::Tool].into_iter().zip(frames);
        stated.filter_map(|(slot, number)| Some((slot, self.frame(slot, number?)))).collect()
    }

    /// `P[1]`, `P[2:name]`; `PR[1]` and `P[R[1]]` are worked out when the program runs.
    fn target<'t>(
        &mut self,
        here: &Here<'_>,
        rest: &mut Cursor<'t>,
    ) -> (Target, Option<Frames>, Cursor<'t>) {
        let whole = *rest;
        let name = rest.take_name().unwrap_or_default();
        rest.take_sign(b'[');
        let inside = rest.take_part(b']').unwrap_or(*rest);
        let text =
            Cursor { tokens: &whole.tokens[..whole.tokens.len() - rest.tokens.len()], ..whole };
        let (target, frames) = match number(inside).filter(|_| name == "P") {
            Some(number) => self.listed(here, number),
            None if name == "P" => {
                self.pointed.entry(here.file).or_insert_with(|| self.common.at(here));
                (Target::Computed(shown(text)), None)
            }
            None => (Target::Computed(shown(text)), None),
        };
        (target, frames, text)
    }

    fn listed(&mut self, here: &Here<'_>, number: u32) -> (Target, Option<Frames>) {
        let name = format!("P[{number}]");
        let next = self.common.found.positions.len();
        let mut position = Position {
            file: here.file,
            line: here.line,
            name: name.clone(),
            shape: Err(Refusal::NotGiven { name, give: "it under /POS".to_owned() }),
            external: None,
            obstacle: None,
            uses: Vec::new(),
            span: 0..0,
            decimals: DECIMALS,
        };
        let mut frames = None;
        if let Some(own) = self.positions.get_mut(&(here.file, number)) {
            if let Some(position) = own.position {
                return (one(position), Some(own.frames));
            }
            own.position = Some(next);
            frames = Some(own.frames);
            position.line = own.line;
            position.shape.clone_from(&own.shape);
            position.external.clone_from(&own.external);
            position.span = own.span.clone();
        }
        self.common.found.positions.push(position);
        (one(next), frames)
    }
}

/// Whether options are for each part of a way as for the whole of it.
fn is_of_parts(options: Cursor<'_>) -> bool {
    names(options).all(|(_, name)| has(OF_PARTS, without_number(&name)))
}

/// Whether a motion has a time in place of a speed: `2sec`, not `100mm/sec`.
fn has_time(rest: Cursor<'_>) -> bool {
    let is_speed = |place: usize| place > 0 && rest.tokens[place - 1].is(b'/');
    names(rest).any(|(place, name)| matches!(name.as_str(), "SEC" | "MSEC") && !is_speed(place))
}

/// The words of a motion's options, without those of what happens beside it. A text that does not end is none that is known.
fn options_of(rest: Cursor<'_>) -> Vec<String> {
    let is_open = rest.tokens.iter().any(|token| token.kind == Kind::OpenText);
    let mut is_beside = false;
    let words = names(rest).map(|(_, name)| name).filter(|name| {
        is_beside |= has(BESIDE, without_number(name));
        !is_beside || has(OF_MOTION, name)
    });
    words.chain(is_open.then(|| "a text that does not end".to_owned())).collect()
}
