//! Motions of KRL: their positions, and what they set for themselves.

use std::collections::BTreeSet;

use super::{KRL, Reading};
use crate::flow::{Known, Setting, Slot, Step, unknown};
use crate::lex::{Kind, Token, tokens};
use crate::names::{Scope, parts};
use crate::program::{File, Motion, Position, Reads, Shape, Stated, Target, Turn, Way};
use crate::reading::{Common, Here, NOT_SPLIT, Shaped, beside, shown, split};
use crate::refusal::Refusal;
use crate::value::{Cursor, Number, Value};

/// Motions, how many positions each has, and whether it reads S and T.
const MOTIONS: [(&str, usize, Reads); 14] = [
    ("PTP", 1, Reads::Always),
    ("LIN", 1, Reads::Never),
    ("CIRC", 2, Reads::Never),
    ("SPTP", 1, Reads::Always),
    ("SLIN", 1, Reads::Never),
    ("SCIRC", 2, Reads::Never),
    ("SPL", 1, Reads::Never),
    ("PTP_REL", 0, Reads::Always),
    ("LIN_REL", 0, Reads::Never),
    ("CIRC_REL", 0, Reads::Never),
    ("SPTP_REL", 0, Reads::Always),
    ("SLIN_REL", 0, Reads::Never),
    ("SCIRC_REL", 0, Reads::Never),
    ("SPL_REL", 0, Reads::Never),
];

pub(super) fn is_motion(word: &str) -> bool {
    matches!(word, "SPLINE" | "PTP_SPLINE" | "ENDSPLINE")
        || MOTIONS.iter().any(|(own, ..)| *own == word)
}

/// Why a motion behind a TRIGGER or `$OUT_C` gets no further points.
pub(super) const TRIGGERED: &str = "a TRIGGER before it is for its begin or its end";

/// A circle with an angle ends beyond its last position or before it, and is another.
fn way(word: &str) -> Way {
    match word {
        "PTP" | "SPTP" => Way::Joints,
        "LIN" | "SLIN" => Way::Straight,
        "CIRC" | "SCIRC" => Way::Circle,
        _ => Way::Other,
    }
}

/// Words behind the positions of a motion.
fn ends_positions(word: &str) -> bool {
    word == "WITH" || is_blend(word)
}

fn is_blend(word: &str) -> bool {
    matches!(word, "C_DIS" | "C_ORI" | "C_PTP" | "C_SPL" | "C_VEL")
}

impl Reading<'_> {
    pub(super) fn motion(
        &mut self,
        here: &Here<'_>,
        word: &str,
        rest: Cursor<'_>,
        steps: &mut Vec<Step>,
    ) {
        let (mut positions, with) = parted(rest);
        let own = self.with(here, with);
        match word {
            "SPLINE" | "PTP_SPLINE" => return steps.push(Step::With(own)),
            "ENDSPLINE" => return steps.push(Step::EndWith),
            _ => {}
        }
        let Some((_, count, reads)) = MOTIONS.iter().find(|(own, ..)| *own == word) else {
            return;
        };
        let mut given = Vec::new();
        while let Some(part) = positions.take_part(b',') {
            given.push(part);
        }
        let points = if word.contains("CIRC") { 2 } else { 1 };
        let used = given.len().min(points);
        let target = |part: &Cursor<'_>| match count {
            0 => Target::Computed(shown(*part)),
            _ => self.target(here, word, *part),
        };
        let targets = given.iter().take(used).map(target).collect();
        // An angle behind the positions reads names as any expression does.
        given.iter().skip(used).for_each(|part| self.common.reads(here, *part));
        let is_triggering = std::mem::take(&mut self.triggers.any_open);
        let split = match word {
            "LIN" | "CIRC" if is_triggering => Err(TRIGGERED),
            "LIN" | "CIRC" if with.is_empty() && given.len() == points => split(word, rest, &given),
            "LIN" | "CIRC" => Err("it has settings of its own"),
            _ => Err(NOT_SPLIT),
        };
        steps.push(self.common.moves(Motion {
            file: here.file,
            line: here.line,
            word: word.to_owned(),
            targets,
            own,
            is_held: false,
            reads: *reads,
            way: if given.len() > used { Way::Other } else { way(word) },
            is_blended: place_of(rest, is_blend) < rest.tokens.len(),
            split,
            obstacle: None,
            holds_part: false,
        }));
    }

    /// `WITH $BASE = SBASE(FP1.BASE_NO), $TOOL = STOOL2(FP1)`.
    fn with(&mut self, here: &Here<'_>, with: Cursor<'_>) -> Vec<(Slot, Known)> {
        let mut own = Vec::new();
        let mut rest = with;
        while let Some(mut part) = rest.take_part(b',') {
            let name = part.take_name().unwrap_or_default();
            let is_whole = part.take_sign(b'=');
            let at = || self.common.at(here);
            let slot = match name.as_str() {
                "$BASE" => Slot::Base,
                "$TOOL" => Slot::Tool,
                "$IPO_MODE" => Slot::Mode,
                "$ORI_TYPE" => Slot::Turn,
                _ => continue,
            };
            let to = match slot {
                _ if !is_whole => unknown(Refusal::AtRunTime { what: name, at: at() }),
                Slot::Mode => self.mode_of(here, part),
                Slot::Turn => self.turn(here, part),
                _ => self.frames(here, &name, part),
            };
            own.push((slot, to));
        }
        own
    }

    /// `#BASE`, or `SIPO_MODE(FP1.IPO_FRAME)`.
    fn mode_of(&mut self, here: &Here<'_>, expression: Cursor<'_>) -> Known {
        let mut call = expression;
        if !(call.take_word("SIPO_MODE") && call.take_sign(b'(')) {
            return self.mode(here, expression);
        }
        let mut rest = call.take_part(b')').unwrap_or(call);
        let data = rest.take_part(b'.').unwrap_or(rest);
        let inline = self.inline(here, data);
        match &inline {
            Ok(setting) => match &**setting {
                Setting::Inline(frames) => frames[2].clone(),
                _ => inline,
            },
            Err(_) => inline,
        }
    }

    fn target(&mut self, here: &Here<'_>, word: &str, part: Cursor<'_>) -> Target {
        let found = match part.value() {
            Value::Fields { .. } => Some(self.common.inline(here, word, part)),
            Value::Name(name) if name.starts_with('$') => None,
            Value::Name(name) => self.common.declared(here, &name),
            _ => self.beside(here, part).or_else(|| self.common.elements(here, part)),
        };
        self.common.target(here, part, found)
    }

    /// `XP1:{Z 100}`: a point beside a declared position.
    fn beside(&mut self, here: &Here<'_>, part: Cursor<'_>) -> Option<Target> {
        let mut rest = part;
        let Value::Name(name) = rest.take_part(b':')?.value() else {
            return None;
        };
        let is_offset = matches!(rest.value(), Value::Fields { .. });
        let variable = self.common.names.find(here.scopes, parts(&name).0)?;
        let is_pose = is_offset && variable.kind.ends_with("POS");
        if !is_pose {
            return None;
        }
        beside(&self.common.declared(here, &name)?)
    }
}

/// The positions of a motion, and what follows `WITH`.
fn parted(rest: Cursor<'_>) -> (Cursor<'_>, Cursor<'_>) {
    let positions = &rest.tokens[..place_of(rest, ends_positions)];
    let with = place_of(rest, |word| word == "WITH");
    let behind = Cursor { tokens: rest.tokens.get(with + 1..).unwrap_or_default(), ..rest };
    let with = &behind.tokens[..place_of(behind, is_blend)];
    (Cursor { tokens: positions, ..rest }, Cursor { tokens: with, ..rest })
}

/// Where the first of such words stands outside brackets; the number of tokens where there is none.
fn place_of(rest: Cursor<'_>, is: impl Fn(&str) -> bool) -> usize {
    let mut depth = 0_i32;
    let found = rest.tokens.iter().position(|token| {
        depth += i32::from(token.is(b'{') || token.is(b'[') || token.is(b'('));
        depth -= i32::from(token.is(b'}') || token.is(b']') || token.is(b')'));
        let is_word = depth == 0 && token.kind == Kind::Name;
        is_word && is(&crate::lex::capitals(rest.text(token)))
    });
    found.unwrap_or(rest.tokens.len())
}

/// The numbers of a position, and an external axis that is not at 0.
pub(super) fn shape(_: &Common<'_>, _: &[Scope], value: &Value, kind: &str) -> Shaped {
    (numbers(value, kind), external(value))
}

fn numbers(value: &Value, kind: &str) -> Result<Shape, Refusal> {
    let Value::Fields { fields, kind: own } = value else {
        return Err(Refusal::Other("its value is no position that is written out".to_owned()));
    };
    let kind = own.as_deref().unwrap_or(kind);
    let all = |names: &[&str], what| -> Result<Vec<Number>, Refusal> {
        let number = |name: &&str| match value.field(name) {
            Some(Value::Number(number)) => Ok(number.clone()),
            Some(_) => Err(Refusal::Other(format!(
                "its {name} is worked out when the program runs; write it as a plain number"
            ))),
            None => Err(Refusal::Partial { what }),
        };
        names.iter().map(number).collect()
    };
    let is_joints = fields.iter().any(|(name, _)| name == "A1") || kind.ends_with("AXIS");
    if is_joints {
        let joints =
            all(&["A1", "A2", "A3", "A4", "A5", "A6"], "angle of each of the axes A1 to A6")?;
        return Ok(Shape::Joints(joints));
    }
    let [x, y, z] = three(all(&["X", "Y", "Z"], "X, Y and Z")?)?;
    let [a, b, c] = three(all(&["A", "B", "C"], "A, B and C")?)?;
    let stated = value.number_of("S").map(|status| Stated::Status {
        status: status.clone(),
        turn: value.number_of("T").cloned(),
    });
    Ok(Shape::Pose { xyz: [x, y, z], turn: Turn::Abc([a, b, c]), stated })
}

fn three(numbers: Vec<Number>) -> Result<[Number; 3], Refusal> {
    numbers.try_into().map_err(|_| Refusal::Partial { what: "three numbers" })
}

const EXTERNAL: [&str; 6] = ["E1", "E2", "E3", "E4", "E5", "E6"];

/// The external axes that anything in a file gives a value that may be other than 0.
pub(super) fn moved(bytes: &[u8], tokens: &[Token]) -> BTreeSet<&'static str> {
    let all = tokens.windows(3).enumerate();
    let moved = all.filter_map(|(place, own)| {
        let name = Cursor::new(bytes, &own[1..]).peek_name()?;
        let mut value = Cursor::new(bytes, &tokens[place + 2..]);
        let is_given = match own[0].kind {
            Kind::Sign(b'{' | b',') => !matches!(own[2].kind, Kind::Sign(b',' | b')')),
            Kind::Sign(b'.') => value.take_sign(b'='),
            _ => false,
        };
        let is_moved = is_given && value.take_number().is_none_or(|own| own.value != 0.0);
        EXTERNAL.into_iter().find(|own| *own == name && is_moved)
    });
    moved.collect()
}

/// Positions that do not state an axis that anything moves leave it where it is.
pub(super) fn refuse_unstated(
    files: &[File],
    positions: &mut [Position],
    moved: &BTreeSet<&'static str>,
) {
    let own = positions.iter_mut().filter(|own| files[own.file].is_of(&KRL));
    for position in own.filter(|own| own.shape.is_ok() && own.external.is_none()) {
        let bytes = &files[position.file].bytes[position.span.clone()];
        let tokens = if moved.is_empty() { Vec::new() } else { tokens(bytes, &KRL) };
        let value = Cursor::new(bytes, &tokens);
        let unstated = moved.iter().find(|name| !value.has_name(&[name]));
        position.external =
            unstated.map(|name| ((*name).to_owned(), "the last value that it got".to_owned()));
    }
}

/// An external axis that is not at 0.
fn external(value: &Value) -> Option<(String, String)> {
    EXTERNAL.iter().find_map(|name| match value.field(name)? {
        Value::Number(number) if number.value == 0.0 => None,
        Value::Number(number) => Some(((*name).to_owned(), number.value.to_string())),
        _ => Some(((*name).to_owned(), "no number".to_owned())),
    })
}
