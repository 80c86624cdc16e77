//! Statements → values of names, and steps.

use super::Reading;
use super::motion::{named, value, way};
use super::statement::{Statements, assignment};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::{Kind, capitals};
use crate::names::Written;
use crate::reading::{Here, has};
use crate::refusal::Refusal;
use crate::value::{Cursor, Value};

/// Functions of the controller that neither move the arm nor set a tool, and beginnings of such.
const HARMLESS: &str = "ABS ACOS ASIN ATAN ATAN2 CEIL COS D2R FLOOR HALT INTEGER_TO_BINARY_LIST BINARY_LIST_TO_INTEGER INTERPOLATE_POSE INV \
    KILL LENGTH LOG NORM POINT_DIST POW R2D RANDOM RETURN ROTVEC2RPY RPY2ROTVEC SIN SIZE SLEEP SQRT STOPJ STOPL SYNC TAN TEXTMSG POPUP PAUSE TO_NUM \
    TO_STR STR_AT STR_CAT STR_EMPTY STR_FIND STR_LEN STR_SUB TRANSPOSE WRENCH_TRANS XMLRPC AND OR NOT XOR IF WHILE ELIF ENCODER_GET_TICK_COUNT";
const HARMLESS_BEGINS: [&str; 16] = [
    "GET_",
    "SET_",
    "IS_",
    "POSE_",
    "READ_",
    "WRITE_",
    "SOCKET_",
    "MODBUS_",
    "RTDE_",
    "RPC_",
    "ASSERT",
    "TOOL_CONTACT",
    "ENTER_",
    "EXIT_",
    "BINARY_",
    "STR_",
];
/// What moves positions at run time, and what ends it.
const DISPLACES: &str =
    "TRACK_CONVEYOR_LINEAR TRACK_CONVEYOR_CIRCULAR PATH_OFFSET_ENABLE FORCE_MODE SCREW_DRIVING";
const REPLACES: &str =
    "STOP_CONVEYOR_TRACKING PATH_OFFSET_DISABLE END_FORCE_MODE END_SCREW_DRIVING";

pub(super) fn is_harmless(name: &str) -> bool {
    has(HARMLESS, name) || HARMLESS_BEGINS.iter().any(|begin| name.starts_with(begin))
}

enum Block {
    Function { is_thread: bool },
    If,
    Loop,
}

/// The functions that are open, each with its steps; the first is what stands outside all.
struct Walked<'s, 'f> {
    script: &'s Statements<'f>,
    bodies: Vec<(String, Vec<Step>)>,
    blocks: Vec<Block>,
}

impl Walked<'_, '_> {
    fn push(&mut self, step: Step) {
        if let Some((_, steps)) = self.bodies.last_mut() {
            steps.push(step);
        }
    }

    fn function(&self) -> Option<&str> {
        self.bodies.last().map(|(name, _)| name.as_str()).filter(|name| !name.is_empty())
    }
}

/// Names that stand before a bracket, in their order.
fn calls(statement: Cursor<'_>) -> Vec<String> {
    let pairs = statement.tokens.windows(2);
    let called = pairs.filter(|pair| pair[0].kind == Kind::Name && pair[1].is(b'('));
    called.map(|pair| capitals(statement.text(&pair[0]))).collect()
}

/// The arguments of the call that a statement is.
fn inside(statement: Cursor<'_>) -> Cursor<'_> {
    let mut rest = statement;
    rest.take();
    rest.take();
    rest.take_part(b')').unwrap_or(rest)
}

impl Reading<'_> {
    /// Values of all assignments: names hold in their whole file, whatever function has them.
    pub(super) fn data(&mut self, script: &Statements<'_>) {
        let scope = self.scopes(script.file, None)[0].clone();
        for (statement, line) in script.all() {
            let Some((name, part, is_element)) = assignment(statement) else {
                continue;
            };
            let at = self.common.files[script.file].at(line);
            let variable = self.common.names.declare(&scope, &name, "VAR");
            let value = value(part);
            if is_element || matches!(value, Value::Expression) {
                variable.touch("", &at);
                continue;
            }
            let written = Written { file: script.file, line, value, span: part.span() };
            variable.values.entry(String::new()).or_default().push(written);
        }
    }

    pub(super) fn steps(&mut self, script: &Statements<'_>) {
        let bodies = vec![(String::new(), Vec::new())];
        let mut walked = Walked { script, bodies, blocks: Vec::new() };
        let scopes = self.scopes(script.file, None);
        for (statement, line) in script.all() {
            let first = self.common.motions.len();
            self.statement(&mut walked, statement, line);
            if walked.function().is_none() {
                let steps = walked.bodies.last_mut().map(|own| std::mem::take(&mut own.1));
                let here = Here { file: script.file, line, scopes: &scopes };
                self.common.outside(&here, first, steps.unwrap_or_default());
            }
        }
        // A function that does not end is refused by its open block.
        while walked.bodies.len() > 1 {
            walked.push(Step::If);
            self.close_function(&mut walked, false);
        }
    }

    fn statement(&mut self, walked: &mut Walked<'_, '_>, statement: Cursor<'_>, line: u32) {
        let mut rest = statement;
        while !rest.is_empty() {
            rest = self.part(walked, rest, line);
        }
    }

    /// The head of a block or a whole statement; what stands behind it in its line.
    fn part<'t>(
        &mut self,
        walked: &mut Walked<'_, '_>,
        statement: Cursor<'t>,
        line: u32,
    ) -> Cursor<'t> {
        let mut rest = statement;
        let word = rest.take_name().unwrap_or_default();
        let none = Cursor { tokens: &[], ..rest };
        match word.as_str() {
            "DEF" | "THREAD" | "SEC" => {
                self.open_function(walked, rest, word == "THREAD");
                return none;
            }
            "IF" | "WHILE" | "ELIF" => {
                let condition = rest.take_part(b':').unwrap_or(rest);
                self.plain(walked, condition, line);
                let (step, block) = match word.as_str() {
                    "IF" => (Step::If, Some(Block::If)),
                    "WHILE" => (Step::Loop, Some(Block::Loop)),
                    _ => (Step::Else { is_last: false }, None),
                };
                walked.push(step);
                walked.blocks.extend(block);
            }
            "ELSE" => {
                rest.take_sign(b':');
                walked.push(Step::Else { is_last: true });
            }
            "END" => match walked.blocks.pop() {
                Some(Block::Function { is_thread }) => self.close_function(walked, is_thread),
                Some(Block::Loop) => walked.push(Step::EndLoop),
                Some(Block::If) | None => walked.push(Step::EndIf),
            },
            _ => {
                self.plain(walked, statement, line);
                return none;
            }
        }
        rest
    }

    fn open_function(&mut self, walked: &mut Walked<'_, '_>, head: Cursor<'_>, is_thread: bool) {
        let mut rest = head;
        let name = rest.take_name().unwrap_or_default();
        let scope = self.scopes(walked.script.file, Some(&name))[0].clone();
        let parameters = rest.take_sign(b'(').then(|| rest.take_part(b')')).flatten();
        for (named, mut part) in parameters.map(named).unwrap_or_default() {
            let name = if named.is_empty() { part.take_name().unwrap_or_default() } else { named };
            self.common.names.declare(&scope, &name, "VAR").is_parameter = true;
        }
        walked.bodies.push((name, Vec::new()));
        walked.blocks.push(Block::Function { is_thread });
    }

    fn close_function(&mut self, walked: &mut Walked<'_, '_>, is_thread: bool) {
        let Some((name, steps)) = walked.bodies.pop() else {
            return;
        };
        if is_thread {
            let at = self.common.files[walked.script.file].at(1);
            self.threads.push((name.clone(), at));
        }
        self.common.routines.insert(name, Routine { steps });
    }

    /// A statement that is no block.
    fn plain(&mut self, walked: &mut Walked<'_, '_>, statement: Cursor<'_>, line: u32) {
        let file = walked.script.file;
        let scopes = self.scopes(file, walked.function());
        let here = Here { file, line, scopes: &scopes };
        let mut steps = Vec::new();
        let calls = calls(statement);
        let begins = |name: &str| statement.peek_name().is_some_and(|own| own == name);
        // What stands inside happens first.
        for (place, name) in calls.iter().enumerate().rev() {
            let is_first = place == 0 && begins(name);
            let inside =
                if is_first { inside(statement) } else { Cursor { tokens: &[], ..statement } };
            match name.as_str() {
                "SET_TCP" => steps.push(Step::Set(Slot::Tool, self.tool(&here, inside))),
                own if way(own).is_some() => self.motion(&here, own, inside, &mut steps),
                own if has(DISPLACES, own) || has(REPLACES, own) => {
                    self.any_displacement = true;
                    let what = "a conveyor, a path offset or force mode";
                    let displaced = unknown(Refusal::Displaced { what });
                    let to = if has(REPLACES, own) { known(Setting::On(false)) } else { displaced };
                    steps.push(Step::Set(Slot::Displacement, to));
                }
                _ if begins("RUN") => {}
                own => {
                    self.called.insert(own.to_owned());
                    steps.push(Step::Call { routine: own.to_owned(), at: self.common.at(&here) });
                }
            }
        }
        let is_motion = calls.first().is_some_and(|name| begins(name) && way(name).is_some());
        if !is_motion {
            let read = assignment(statement).map_or(statement, |(_, part, _)| part);
            self.common.reads(&here, read);
        }
        for step in steps {
            walked.push(step);
        }
    }

    fn tool(&self, here: &Here<'_>, inside: Cursor<'_>) -> Known {
        let first = named(inside).first().map(|(_, part)| *part);
        let found = first.and_then(|part| self.frame(here, part, "tcp"));
        found.unwrap_or_else(|| {
            unknown(Refusal::AtRunTime { what: "set_tcp".to_owned(), at: self.common.at(here) })
        })
    }
}
