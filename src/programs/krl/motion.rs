//! Motions of KRL: their positions, and what they set for themselves.

use std::sync::Arc;

use super::Reading;
use super::frames::Here;
use crate::flow::{Known, Setting, Slot, Step, unknown};
use crate::names::{Scope, Written, parts};
use crate::program::{Computed, Motion, Position, Reads, Shape, Stated, Target, Turn};
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
    ("PTP_REL", 0, Reads::Never),
    ("LIN_REL", 0, Reads::Never),
    ("CIRC_REL", 0, Reads::Never),
    ("SPTP_REL", 0, Reads::Never),
    ("SLIN_REL", 0, Reads::Never),
    ("SCIRC_REL", 0, Reads::Never),
    ("SPL_REL", 0, Reads::Never),
];

pub(super) fn is_motion(word: &str) -> bool {
    matches!(word, "SPLINE" | "PTP_SPLINE" | "ENDSPLINE")
        || MOTIONS.iter().any(|(own, ..)| *own == word)
}

/// Words behind the positions of a motion.
fn ends_positions(word: &str) -> bool {
    word == "WITH" || word.starts_with("C_")
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
        let mut targets = Vec::new();
        let mut given = Vec::new();
        while let Some(part) = positions.take_part(b',') {
            given.push(part);
        }
        let used = if *count == 0 { given.len().min(1) } else { *count };
        for part in given.iter().take(used) {
            let target = if *count == 0 {
                Target::Computed(shown(*part))
            } else {
                self.target(here, word, *part)
            };
            if let Target::Computed(text) = &target {
                let (file, line) = (here.file, here.line[0].line);
                let computed = Computed { file, line, word: word.to_owned(), text: text.clone() };
                self.computed.push(computed);
            }
            targets.push(target);
        }
        // An angle behind the positions reads names as any expression does.
        given.iter().skip(used).for_each(|part| self.reads(here, *part));
        let motion = Motion {
            file: here.file,
            line: here.line[0].line,
            word: word.to_owned(),
            targets,
            own,
            reads: *reads,
            obstacle: None::<Arc<Refusal>>,
        };
        steps.push(Step::Move(self.motions.len()));
        self.motions.push(motion);
    }

    /// `WITH $BASE = SBASE(FP1.BASE_NO), $TOOL = STOOL2(FP1)`.
    fn with(&mut self, here: &Here<'_>, with: Cursor<'_>) -> Vec<(Slot, Known)> {
        let mut own = Vec::new();
        let mut rest = with;
        while let Some(mut part) = rest.take_part(b',') {
            let name = part.take_name().unwrap_or_default();
            let is_whole = part.take_sign(b'=');
            let at = || self.files[here.file].at(here.line[0].line);
            let slot = match name.as_str() {
                "$BASE" => Slot::Base,
                "$TOOL" => Slot::Tool,
                "$IPO_MODE" => Slot::Mode,
                _ => continue,
            };
            let to = if !is_whole {
                unknown(Refusal::AtRunTime { what: name, at: at() })
            } else if slot == Slot::Mode {
                self.mode_of(here, part)
            } else {
                self.frames(here, &name, part)
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
        let computed = || Target::Computed(shown(part));
        if part.tokens.iter().any(|token| token.is(b':')) && !is_aggregate(part) {
            return self.beside(here, part).unwrap_or_else(computed);
        }
        match part.value() {
            value @ Value::Fields { .. } => {
                let span =
                    part.tokens[0].span().start..part.tokens[part.tokens.len() - 1].span().end;
                let line = part.tokens[0].line;
                let written = Written { file: here.file, line, value, span };
                Target::Literal {
                    positions: vec![self.add(word, &written, None)],
                    is_beside: false,
                }
            }
            Value::Name(name) if !name.starts_with('$') => {
                self.declared(here, &name).unwrap_or_else(computed)
            }
            _ => {
                let all = all_of(part).and_then(|name| self.elements(here.scopes, &name));
                all.unwrap_or_else(|| {
                    self.reads(here, part);
                    computed()
                })
            }
        }
    }

    /// `XP1:{Z 100}`: a point beside a declared position.
    fn beside(&mut self, here: &Here<'_>, part: Cursor<'_>) -> Option<Target> {
        let mut rest = part;
        let first = rest.take_part(b':');
        let is_offset = |rest: Cursor<'_>| matches!(rest.value(), Value::Fields { .. });
        if let Some(Value::Name(name)) = first.map(Cursor::value)
            && is_offset(rest)
            && self.kind(here.scopes, &name).is_some_and(|kind| kind.ends_with("POS"))
            && let Some(Target::Literal { positions, .. }) = self.declared(here, &name)
        {
            return Some(Target::Literal { positions, is_beside: true });
        }
        self.reads(here, part);
        None
    }

    fn kind(&self, scopes: &[Scope], name: &str) -> Option<&str> {
        self.names.find(scopes, parts(name).0).map(|variable| variable.kind.as_str())
    }

    /// A declared position by its name; `None` where it is a parameter.
    fn declared(&mut self, here: &Here<'_>, name: &str) -> Option<Target> {
        let (own, element) = parts(name);
        let literal =
            |position| Some(Target::Literal { positions: vec![position], is_beside: false });
        let module = &here.scopes[here.scopes.len() - 2];
        let Some(variable) = self.names.find(here.scopes, own) else {
            // Its value stands in a file that is not given.
            self.names.declare(module, own, "");
            let variable = self.names.find_mut(here.scopes, own)?;
            let position = self.positions.len();
            variable.positions.insert(element.to_owned(), position);
            self.positions.push(missing(here, name));
            return literal(position);
        };
        if variable.is_parameter {
            return None;
        }
        if let Some(position) = variable.positions.get(element) {
            return literal(*position);
        }
        let kind = variable.kind.clone();
        let position = self.of_variable(here, name, &kind);
        if let Some(variable) = self.names.find_mut(here.scopes, own) {
            variable.positions.insert(element.to_owned(), position);
        }
        literal(position)
    }

    /// All elements of an array.
    fn elements(&mut self, scopes: &[Scope], name: &str) -> Option<Target> {
        let variable = self.names.find(scopes, name)?;
        let elements: Vec<String> = variable.values.keys().cloned().collect();
        let file = variable.values.values().flatten().next()?.file;
        let here = Here { file, line: &[], scopes };
        let mut positions = Vec::new();
        for element in elements {
            match self.declared(&here, &format!("{name}{element}"))? {
                Target::Literal { positions: own, .. } => positions.extend(own),
                Target::Computed(_) => return None,
            }
        }
        (!positions.is_empty()).then_some(Target::Literal { positions, is_beside: false })
    }

    fn of_variable(&mut self, here: &Here<'_>, name: &str, kind: &str) -> usize {
        let give = "the .dat file that declares it";
        match self.names.constant(here.scopes, name, self.files, give) {
            Ok(written) => {
                let written = written.clone();
                let position = self.add(name, &written, Some(kind));
                let file = &self.files[written.file];
                if super::data::is_system(&file.stem()) {
                    let shared = Refusal::Shared { file: file.base_name().to_owned() };
                    self.positions[position].obstacle = Some(shared);
                }
                position
            }
            Err(why) => {
                let mut position = missing(here, name);
                position.obstacle = Some(why);
                self.positions.push(position);
                self.positions.len() - 1
            }
        }
    }

    fn add(&mut self, name: &str, written: &Written, kind: Option<&str>) -> usize {
        self.positions.push(Position {
            file: written.file,
            line: written.line,
            name: name.to_owned(),
            shape: shape(&written.value, kind),
            external: external(&written.value),
            obstacle: None,
            uses: Vec::new(),
            span: written.span.clone(),
        });
        self.positions.len() - 1
    }
}

/// A position whose value is in no given file.
fn missing(here: &Here<'_>, name: &str) -> Position {
    let give = "the .dat file that declares it".to_owned();
    let why = Refusal::NotGiven { name: name.to_owned(), give };
    Position {
        file: here.file,
        line: here.line.first().map_or(0, |token| token.line),
        name: name.to_owned(),
        shape: Err(why.clone()),
        external: None,
        obstacle: Some(why),
        uses: Vec::new(),
        span: 0..0,
    }
}

/// The positions of a motion, and what follows `WITH`.
fn parted(rest: Cursor<'_>) -> (Cursor<'_>, Cursor<'_>) {
    let mut depth = 0_i32;
    let mut first_end = rest.tokens.len();
    for (place, token) in rest.tokens.iter().enumerate() {
        depth += i32::from(token.is(b'{') || token.is(b'[') || token.is(b'('));
        depth -= i32::from(token.is(b'}') || token.is(b']') || token.is(b')'));
        if depth != 0 || token.kind != crate::lex::Kind::Name {
            continue;
        }
        let word = crate::lex::capitals(rest.text(token));
        if ends_positions(&word) {
            first_end = first_end.min(place);
        }
        if word == "WITH" {
            let with = Cursor { tokens: &rest.tokens[place + 1..], ..rest };
            return (Cursor { tokens: &rest.tokens[..first_end], ..rest }, with);
        }
    }
    let positions = Cursor { tokens: &rest.tokens[..first_end], ..rest };
    (positions, Cursor { tokens: &[], ..rest })
}

fn is_aggregate(part: Cursor<'_>) -> bool {
    matches!(part.value(), Value::Fields { .. })
}

/// The array of `P[i]`, where nothing follows.
fn all_of(part: Cursor<'_>) -> Option<String> {
    let mut rest = part;
    let name = rest.take_name()?;
    let is_element = rest.take_sign(b'[') && rest.take_part(b']').is_some() && rest.is_empty();
    is_element.then_some(name)
}

/// The text of an expression, shortened.
fn shown(part: Cursor<'_>) -> String {
    let (Some(first), Some(last)) = (part.tokens.first(), part.tokens.last()) else {
        return String::new();
    };
    let end = last.span().end.min(first.span().start + 60);
    let text = &part.bytes[first.span().start..end];
    text.iter()
        .map(
            |byte| {
                if byte.is_ascii() && !byte.is_ascii_control() { char::from(*byte) } else { '?' }
            },
        )
        .collect()
}

/// The numbers of a position.
pub(super) fn shape(value: &Value, kind: Option<&str>) -> Result<Shape, Refusal> {
    let kind = kind.filter(|kind| !kind.is_empty());
    let Value::Fields { fields, kind: own } = value else {
        return Err(Refusal::Other("its value is no position that is written out".to_owned()));
    };
    let kind = own.as_deref().or(kind);
    let all = |names: &[&str], what| -> Result<Vec<Number>, Refusal> {
        let found: Option<Vec<Number>> =
            names.iter().map(|name| value.number_of(name).cloned()).collect();
        found.ok_or(Refusal::Partial { what })
    };
    let is_joints = fields.iter().any(|(name, _)| name == "A1")
        || kind.is_some_and(|kind| kind.ends_with("AXIS"));
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

/// An external axis that is not at 0.
fn external(value: &Value) -> Option<(String, String)> {
    ["E1", "E2", "E3", "E4", "E5", "E6"].iter().find_map(|name| match value.field(name)? {
        Value::Number(number) if number.value == 0.0 => None,
        Value::Number(number) => Some(((*name).to_owned(), number.value.to_string())),
        _ => Some(((*name).to_owned(), "no number".to_owned())),
    })
}
