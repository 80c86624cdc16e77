//! Motion instructions: their positions, work objects and tools.

use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::Reading;
use crate::flow::{Known, Setting, Slot, Step, known, unknown};
use crate::frame::Chain;
use crate::lex::{Kind, capitals};
use crate::names::{Scope, parts};
use crate::program::{Motion, Reads, Shape, Stated, Target, Turn, Way};
use crate::reading::{Common, Here, NOT_SPLIT, Shaped, beside, shown, split};
use crate::refusal::Refusal;
use crate::value::{Cursor, Number, Value};

/// Where a motion's tool stands among its arguments without a backslash.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Tool {
    At(usize),
    Last,
    Refused,
}

/// A motion instruction: the places of its positions and of its tool, and when it reads configuration data.
struct Instruction {
    words: &'static [&'static str],
    positions: &'static [usize],
    tool: Tool,
    reads: Reads,
}

const fn instruction(
    words: &'static [&'static str],
    positions: &'static [usize],
    tool: Tool,
    reads: Reads,
) -> Instruction {
    Instruction { words, positions, tool, reads }
}

impl Instruction {
    fn way(&self) -> Way {
        match (self.positions.len(), self.reads) {
            _ if self.tool == Tool::Refused => Way::Other,
            (2, _) => Way::Circle,
            (_, L) => Way::Straight,
            _ => Way::Joints,
        }
    }

    /// Whether the zone, which stands before the tool, is another than `fine`.
    fn is_blended(&self, valued: &[&Argument<'_>]) -> bool {
        let tool =
            if let Tool::At(place) = self.tool { place } else { valued.len().saturating_sub(1) };
        let zone = tool.checked_sub(1).and_then(|place| valued.get(place));
        zone.is_some_and(|zone| zone.value.value() != Value::Name("FINE".to_owned()))
    }
}

const J: Reads = Reads::With(Slot::ConfJ);
const L: Reads = Reads::With(Slot::ConfL);

const INSTRUCTIONS: [Instruction; 17] = [
    instruction(&["MOVEABSJ"], &[0], Tool::At(3), Reads::Always),
    instruction(
        &["MOVEJ", "MOVEJDO", "MOVEJAO", "MOVEJGO", "MOVEJSYNC", "TRIGGJIOS"],
        &[0],
        Tool::At(3),
        J,
    ),
    instruction(
        &["MOVEL", "MOVELDO", "MOVELAO", "MOVELGO", "MOVELSYNC", "TRIGGLIOS"],
        &[0],
        Tool::At(3),
        L,
    ),
    instruction(&["MOVEC", "MOVECDO", "MOVECAO", "MOVECGO", "MOVECSYNC"], &[0, 1], Tool::At(4), L),
    instruction(&["TRIGGABSJ"], &[0], Tool::At(4), Reads::Always),
    instruction(&["TRIGGJ"], &[0], Tool::At(4), J),
    instruction(&["TRIGGL", "SPOTL"], &[0], Tool::At(4), L),
    instruction(&["SPOTJ"], &[0], Tool::At(4), J),
    instruction(&["TRIGGC"], &[0, 1], Tool::At(5), L),
    instruction(&["ARCL", "ARCLSTART", "ARCLEND", "ARCL1", "ARCL2"], &[0], Tool::Last, L),
    instruction(&["ARCC", "ARCCSTART", "ARCCEND", "ARCC1", "ARCC2"], &[0, 1], Tool::Last, L),
    instruction(&["CAPL", "DISPL", "GLUEL", "NUTL", "PAINTL", "SPOTML"], &[0], Tool::Last, L),
    instruction(&["CAPC", "DISPC", "GLUEC", "PAINTC"], &[0, 1], Tool::Last, L),
    instruction(&["NUTJ", "SPOTMJ"], &[0], Tool::Last, J),
    instruction(&["SEARCHL"], &[2], Tool::Refused, L),
    instruction(&["SEARCHC"], &[2, 3], Tool::Refused, L),
    instruction(&["MOVEEXTJ"], &[0], Tool::Refused, Reads::Never),
];

fn known_instruction(word: &str) -> Option<&'static Instruction> {
    INSTRUCTIONS.iter().find(|own| own.words.contains(&word))
}

pub fn is_motion(word: &str) -> bool {
    known_instruction(&word.to_ascii_uppercase()).is_some()
}

/// An argument with its options.
struct Argument<'t> {
    value: Cursor<'t>,
    /// Names in capitals, each with the expression behind its `:=`.
    options: Vec<(String, Cursor<'t>)>,
}

fn arguments(rest: Cursor<'_>) -> Vec<Argument<'_>> {
    let mut rest = rest;
    let mut all = Vec::new();
    while let Some(mut part) = rest.take_part(b',') {
        let begins = part.first().is_some_and(|token| token.is(b'\\'));
        let value = if begins {
            part.take();
            Cursor { tokens: &[], ..part }
        } else {
            part.take_part(b'\\').unwrap_or(part)
        };
        let mut options = Vec::new();
        while let Some(mut option) = part.take_part(b'\\') {
            let name = option.take_name().unwrap_or_default();
            let _ = option.take_sign(b':') && option.take_sign(b'=');
            options.push((name, option));
        }
        all.push(Argument { value, options });
    }
    all
}

impl Reading<'_> {
    /// The controller's instruction that a word is or, by the cell, is like.
    fn like(&self, word: &str) -> Option<&'static Instruction> {
        let like = self.cell.motions.iter().find(|(own, _)| own.eq_ignore_ascii_case(word));
        // Without an option of the controller its instruction may be a PROC of the user's.
        like.map_or_else(
            || known_instruction(word).filter(|_| !self.named.contains(word)),
            |(_, like)| known_instruction(&like.to_ascii_uppercase()),
        )
    }

    pub(super) fn is_motion(&self, word: &str) -> bool {
        self.like(word).is_some()
    }

    /// The point that a search writes: `pFound` of `SearchL di1, pFound, p10, …`.
    pub(super) fn found<'t>(&self, statement: Cursor<'t>) -> Option<Cursor<'t>> {
        let mut rest = statement;
        let like = self.like(&rest.take_name()?).filter(|like| like.tool == Tool::Refused)?;
        let place = like.positions.first()?.checked_sub(1)?;
        let mut valued = arguments(rest).into_iter().filter(|own| !own.value.is_empty());
        valued.nth(place).map(|own| own.value)
    }

    pub(super) fn motion(
        &mut self,
        here: &Here<'_>,
        word: &str,
        rest: Cursor<'_>,
        steps: &mut Vec<Step>,
    ) {
        let Some(instruction) = self.like(word) else {
            return;
        };
        let all = arguments(rest);
        let valued: Vec<&Argument<'_>> = all.iter().filter(|own| !own.value.is_empty()).collect();
        let places = instruction.positions.iter().filter_map(|place| valued.get(*place));
        let places: Vec<Cursor<'_>> = places.map(|own| own.value).collect();
        let targets = places.iter().map(|own| self.target(here, word, *own)).collect();
        let mut options = all.iter().flat_map(|own| &own.options);
        let is_plain = options.all(|(name, _)| crate::reading::has("V Z INPOS WOBJ TLOAD", name));
        let (own, holds_part) = self.frames(here, instruction, &all, &valued);
        let split = match word {
            _ if holds_part => Err(NOT_SPLIT),
            "MOVEL" | "MOVEC" if self.is_in_if => Err("an IF decides on it"),
            "MOVEL" | "MOVEC" if is_plain => split(word, rest, &places),
            "MOVEL" | "MOVEC" => Err("it has options that are for it alone"),
            _ => Err(NOT_SPLIT),
        };
        let motion = Motion {
            file: here.file,
            line: here.line,
            word: word.to_owned(),
            targets,
            own,
            is_held: false,
            reads: instruction.reads,
            way: if holds_part { Way::Other } else { instruction.way() },
            is_blended: instruction.is_blended(&valued),
            split,
            obstacle: self.obstacle(here, word, instruction, &all),
            holds_part,
        };
        steps.push(self.common.moves(motion));
        let last = valued.last().and_then(|own| own.value.first());
        if let Some(text) = last.filter(|own| own.kind == Kind::Text && word.ends_with("SYNC")) {
            // It names a procedure that runs in the middle of the corner.
            let name = capitals(rest.text(text));
            let routine = self.full_name(here.file, name.trim_matches('"'));
            steps.push(Step::Call { routine, at: self.common.at(here) });
        }
    }

    fn obstacle(
        &self,
        here: &Here<'_>,
        word: &str,
        instruction: &Instruction,
        all: &[Argument<'_>],
    ) -> Option<Arc<Refusal>> {
        let at = || self.common.at(here);
        if instruction.tool == Tool::Refused {
            return Some(Arc::new(Refusal::Instruction { word: word.to_owned(), at: at() }));
        }
        let mut options = all.iter().flat_map(|own| &own.options);
        let found =
            options.find(|(name, _)| matches!(name.as_str(), "ID" | "CORR" | "CORRTIME" | "TRACK"));
        found.map(|(name, _)| {
            Arc::new(Refusal::Instruction { word: format!("{word} with \\{name}"), at: at() })
        })
    }

    /// Base and tool of a motion, and whether the arm holds the part: the base is that of the tool then, and the tool that of the part.
    fn frames(
        &self,
        here: &Here<'_>,
        instruction: &Instruction,
        all: &[Argument<'_>],
        valued: &[&Argument<'_>],
    ) -> (Vec<(Slot, Known)>, bool) {
        let mut options = all.iter().flat_map(|own| &own.options);
        let object = options.find(|(name, _)| name == "WOBJ").map(|(_, expression)| *expression);
        let tool = match instruction.tool {
            Tool::At(place) => valued.get(place),
            Tool::Last | Tool::Refused => valued.last(),
        };
        let none = || {
            let what = "the tool".to_owned();
            unknown(Refusal::AtRunTime { what, at: self.common.at(here) })
        };
        let tool = |on_arm: bool| tool.map_or_else(none, |own| self.tool(here, own.value, on_arm));
        let base = |on_arm: bool| match object {
            Some(expression) => self.work_object(here, expression, on_arm),
            None => known(Setting::Frames(Chain::default())),
        };
        let refused = |own: &[Known; 2]| own.iter().all(Result::is_err);
        let mut frames = [base(false), tool(true)];
        // Of a circle the helper is a place of the tool, which stands.
        let may_hold = instruction.positions.len() == 1 && object.is_some() && refused(&frames);
        let held = may_hold.then(|| [tool(false), base(true)]);
        let held = held.filter(|own| own.iter().all(Result::is_ok));
        let holds_part = held.is_some();
        if let Some(held) = held {
            frames = held;
        }
        let [base, tool] = frames;
        let mut own = vec![(Slot::Base, base), (Slot::Tool, tool)];
        if instruction.reads == Reads::Always {
            // A displacement moves no joint angles.
            own.push((Slot::Displacement, known(Setting::On(false))));
        }
        (own, holds_part)
    }

    fn tool(&self, here: &Here<'_>, expression: Cursor<'_>, on_arm: bool) -> Known {
        self.data_of(here, expression, if on_arm { "TOOL0" } else { "" }, |name, parts| {
            let [holds, frame, ..] = parts else {
                return None;
            };
            self.stands(here, holds, on_arm, || Some(Chain::one(name, Ok(pose(frame.list()?)?))))
        })
    }

    fn work_object(&self, here: &Here<'_>, expression: Cursor<'_>, on_arm: bool) -> Known {
        self.data_of(here, expression, if on_arm { "" } else { "WOBJ0" }, |name, parts| {
            let [holds, fixed, _, user, object] = parts else {
                return None;
            };
            let is = |value: &Value, word: &str| *value == Value::Name(word.to_owned());
            if is(fixed, "FALSE") && !is(holds, "TRUE") {
                let at = self.common.at(here);
                return Some(Err(Refusal::Moving { name: name.to_owned(), at }));
            }
            self.stands(here, holds, on_arm, || {
                let mut chain = Chain::one(format!("{name}.UFRAME"), Ok(pose(user.list()?)?));
                chain.0.extend(Chain::one(format!("{name}.OFRAME"), Ok(pose(object.list()?)?)).0);
                is(fixed, "TRUE").then_some(chain)
            })
        })
    }

    /// Frames of data whose `robhold` has to say whether they are on the arm.
    fn stands(
        &self,
        here: &Here<'_>,
        robhold: &Value,
        on_arm: bool,
        frames: impl Fn() -> Option<Chain>,
    ) -> Option<Result<Chain, Refusal>> {
        match robhold {
            Value::Name(word) if matches!(word.as_str(), "TRUE" | "FALSE") => {
                let is_as_asked = (word == "TRUE") == on_arm;
                let refusal = || Refusal::FixedTool { at: self.common.at(here) };
                if is_as_asked { frames().map(Ok) } else { Some(Err(refusal())) }
            }
            _ => None,
        }
    }

    /// The frame of data of type `pose`.
    pub(super) fn pose_data(&self, here: &Here<'_>, expression: Cursor<'_>) -> Known {
        self.data_of(here, expression, "", |name, parts| {
            Some(Ok(Chain::one(name, Ok(pose(parts)?))))
        })
    }

    /// The frames of a tool or work object by its name; `predefined` is the identity.
    fn data_of(
        &self,
        here: &Here<'_>,
        expression: Cursor<'_>,
        predefined: &str,
        frames: impl Fn(&str, &[Value]) -> Option<Result<Chain, Refusal>>,
    ) -> Known {
        let at = || self.common.at(here);
        let Value::Name(name) = expression.value() else {
            return unknown(Refusal::AtRunTime { what: shown(expression), at: at() });
        };
        match self.common.names.find(here.scopes, parts(&name).0) {
            None if name == predefined => return known(Setting::Frames(Chain::default())),
            Some(variable) if variable.is_parameter => {
                return unknown(Refusal::AtRunTime {
                    what: format!("{name}, a parameter,"),
                    at: at(),
                });
            }
            _ => {}
        }
        let found = self.common.constant(here.scopes, &name).and_then(|written| {
            let own = written.value.list().and_then(|parts| frames(&name, parts));
            let at = self.common.files[written.file].at(written.line);
            own.unwrap_or(Err(Refusal::NoFrame { name: name.clone(), at }))
        });
        match found {
            Ok(chain) => known(Setting::Frames(chain)),
            Err(why) => unknown(why),
        }
    }

    fn target(&mut self, here: &Here<'_>, word: &str, value: Cursor<'_>) -> Target {
        let found = match value.value() {
            Value::List(_) => Some(self.common.inline(here, word, value)),
            Value::Name(name) => self.common.declared(here, &name),
            _ => self.beside(here, value).or_else(|| self.common.elements(here, value)),
        };
        self.common.target(here, value, found)
    }

    /// `Offs(p10, 0, 0, 50)`, `RelTool(p10, 0, 0, 50)`.
    fn beside(&mut self, here: &Here<'_>, value: Cursor<'_>) -> Option<Target> {
        let mut rest = value;
        let word = rest.take_name()?;
        if !matches!(word.as_str(), "OFFS" | "RELTOOL") || !rest.take_sign(b'(') {
            return None;
        }
        let mut inside = rest.take_part(b')').filter(|_| rest.is_empty())?;
        let first = inside.take_part(b',')?;
        let target = match first.value() {
            Value::Name(name) => self.common.declared(here, &name)?,
            Value::Expression => self.common.elements(here, first)?,
            _ => return None,
        };
        self.common.reads(here, inside);
        beside(&target)
    }

    /// Positions that are passed to a routine other than a motion.
    pub(super) fn passed(&mut self, here: &Here<'_>, word: &str, rest: Cursor<'_>) {
        let all = arguments(rest);
        let options = all.iter().flat_map(|own| own.options.iter().map(|(_, value)| *value));
        for argument in all.iter().map(|own| own.value).chain(options) {
            let mut inside = argument;
            if inside.take_sign(b'(') {
                self.passed(here, word, inside.take_part(b')').unwrap_or(inside));
            } else if self.is_position(here, argument) {
                self.common.compute(here, word, shown(argument));
            }
        }
    }

    /// Whether an argument is a position: declared, an element of an array, one beside another, or written out.
    fn is_position(&self, here: &Here<'_>, argument: Cursor<'_>) -> bool {
        let is_declared = |name: &str| {
            let variable = self.common.names.find(here.scopes, parts(name).0);
            variable.is_some_and(|own| matches!(own.kind.as_str(), "ROBTARGET" | "JOINTTARGET"))
        };
        match argument.value() {
            Value::Name(name) => is_declared(&name),
            Value::List(parts) => {
                let length = |part: &Value| part.list().map_or(0, <[Value]>::len);
                let lengths: Vec<usize> = parts.iter().map(length).collect();
                matches!(lengths.as_slice(), [3, 4, 4, _] | [6, _])
            }
            Value::Expression => {
                let mut rest = argument;
                let name = rest.take_name().unwrap_or_default();
                let is_element = is_declared(&name) && rest.take_sign(b'{');
                matches!(name.as_str(), "OFFS" | "RELTOOL")
                    || (is_element && rest.take_part(b'}').is_some() && rest.is_empty())
            }
            _ => false,
        }
    }
}

/// The numbers of a position, and an external axis that is there.
pub(super) fn shape(common: &Common<'_>, scopes: &[Scope], value: &Value, _: &str) -> Shaped {
    let no = |words: &str| (Err(Refusal::Other(words.to_owned())), None);
    match value.list() {
        Some([joints, external]) => match joints.numbers::<6>() {
            Some(joints) => {
                let shape = Shape::Joints(joints.map(Clone::clone).to_vec());
                with_external(common, scopes, shape, external)
            }
            None => no("its joint angles are not all written out"),
        },
        Some([place, turn, stated, external]) => {
            let (Some(xyz), Some(turn)) = (place.numbers::<3>(), turn.numbers::<4>()) else {
                return no("its position and orientation are not all written out");
            };
            let stated = stated.numbers::<4>().map(|own| Stated::Quadrants(own.map(Clone::clone)));
            let (xyz, turn) = (xyz.map(Clone::clone), Turn::Quaternion(turn.map(Clone::clone)));
            with_external(common, scopes, Shape::Pose { xyz, turn, stated }, external)
        }
        _ => no("its value is no position that is written out"),
    }
}

/// A position whose external axes are known; those at 9E9 are not there.
fn with_external(common: &Common<'_>, scopes: &[Scope], shape: Shape, external: &Value) -> Shaped {
    let named = match external {
        Value::Name(name) => common.constant(scopes, name).ok().map(|own| &own.value),
        value => Some(value),
    };
    let Some(numbers) = named.and_then(Value::numbers::<6>) else {
        return (Err(Refusal::Partial { what: "numbers of its external axes" }), None);
    };
    let is_there = |number: &Number| number.value != 0.0 && number.value < 8.9e9;
    let mut numbers = numbers.iter().zip(["eax_a", "eax_b", "eax_c", "eax_d", "eax_e", "eax_f"]);
    let found = numbers.find(|(number, _)| is_there(number));
    let found = found.map(|(number, name)| (name.to_owned(), number.value.to_string()));
    (Ok(shape), found)
}

/// `[[x, y, z], [q1, q2, q3, q4]]` as an isometry.
fn pose(parts: &[Value]) -> Option<Isometry3<f64>> {
    let [place, turn] = parts else {
        return None;
    };
    let at = place.numbers::<3>()?.map(|number| number.value);
    let turn = quaternion(turn.numbers::<4>()?.map(|number| number.value))?;
    Some(Isometry3::from_parts(Translation3::from(at), turn))
}

/// A rotation by its four numbers, real part first; `None` where they are far from a unit quaternion.
pub fn quaternion([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    let quaternion = Quaternion::new(w, x, y, z);
    let is_unit = (quaternion.norm() - 1.0).abs() < 1e-2;
    is_unit.then(|| UnitQuaternion::from_quaternion(quaternion))
}
