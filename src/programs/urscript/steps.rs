//! Statements → values of names, and steps.

use std::collections::BTreeSet;

use super::Reading;
use super::motion::{named, value, way};
use super::statement::{Statements, assignment, is_global};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::{Kind, Token, capitals};
use crate::names::Written;
use crate::reading::{Here, has};
use crate::refusal::Refusal;
use crate::value::{Cursor, Value};

/// Functions of the controller that neither move the arm nor set a tool, and words before a bracket that are none. Any other name is a
/// function of a file that is not given, whatever it begins with.
const HARMLESS: &str = "ABS ACOS ASIN ATAN ATAN2 CEIL COS D2R FLOOR INV LENGTH LOG NORM POINT_DIST POSE_ADD POSE_DIST POSE_INV POSE_SUB POSE_TRANS POW R2D \
    RANDOM ROTVEC2RPY RPY2ROTVEC SIN SIZE SQRT TAN TRANSPOSE WRENCH_TRANS INTERPOLATE_POSE INTEGER_TO_BINARY_LIST BINARY_LIST_TO_INTEGER TO_NUM TO_STR \
    STR_AT STR_CAT STR_EMPTY STR_FIND STR_LEN STR_SUB AND OR NOT XOR IF WHILE ELIF RETURN HALT KILL PAUSE POPUP SLEEP SYNC TEXTMSG STOPJ STOPL XMLRPC \
    GET_ACTUAL_JOINT_POSITIONS GET_ACTUAL_JOINT_SPEEDS GET_ACTUAL_TCP_POSE GET_ACTUAL_TCP_SPEED GET_ACTUAL_TOOL_FLANGE_POSE GET_CONTROLLER_TEMP \
    GET_FORWARD_KIN GET_INVERSE_KIN GET_INVERSE_KIN_HAS_SOLUTION GET_JOINT_TEMP GET_JOINT_TORQUES GET_STEPTIME GET_TARGET_JOINT_POSITIONS \
    GET_TARGET_JOINT_SPEEDS GET_TARGET_PAYLOAD GET_TARGET_PAYLOAD_COG GET_TARGET_TCP_POSE GET_TARGET_TCP_SPEED GET_TARGET_WAYPOINT GET_TCP_FORCE \
    GET_TCP_OFFSET GET_TOOL_CURRENT GET_ANALOG_IN GET_ANALOG_OUT GET_DIGITAL_IN GET_DIGITAL_OUT GET_CONFIGURABLE_DIGITAL_IN GET_CONFIGURABLE_DIGITAL_OUT \
    GET_STANDARD_ANALOG_IN GET_STANDARD_ANALOG_OUT GET_STANDARD_DIGITAL_IN GET_STANDARD_DIGITAL_OUT GET_TOOL_ANALOG_IN GET_TOOL_DIGITAL_IN \
    GET_TOOL_DIGITAL_OUT GET_FLAG GET_EULER_ANGLES IS_STEADY IS_WITHIN_SAFETY_LIMITS TOOL_CONTACT \
    SET_ANALOG_INPUTRANGE SET_ANALOG_OUT SET_ANALOG_OUTPUTDOMAIN SET_CONFIGURABLE_DIGITAL_OUT SET_DIGITAL_OUT SET_FLAG SET_GRAVITY \
    SET_INPUT_ACTIONS_TO_DEFAULT SET_PAYLOAD SET_PAYLOAD_COG SET_PAYLOAD_MASS SET_RUNSTATE_CONFIGURABLE_DIGITAL_OUTPUT_TO_VALUE \
    SET_RUNSTATE_STANDARD_ANALOG_OUTPUT_TO_VALUE SET_RUNSTATE_STANDARD_DIGITAL_OUTPUT_TO_VALUE SET_RUNSTATE_TOOL_DIGITAL_OUTPUT_TO_VALUE \
    SET_SAFETY_MODE_TRANSITION_HARDNESS SET_STANDARD_ANALOG_INPUT_DOMAIN SET_STANDARD_ANALOG_OUT SET_STANDARD_ANALOG_OUTPUT_DOMAIN \
    SET_STANDARD_DIGITAL_INPUT_ACTION SET_STANDARD_DIGITAL_OUT SET_TARGET_PAYLOAD SET_TOOL_ANALOG_INPUT_DOMAIN SET_TOOL_COMMUNICATION \
    SET_TOOL_DIGITAL_INPUT_ACTION SET_TOOL_DIGITAL_OUT SET_TOOL_OUTPUT_MODE SET_TOOL_VOLTAGE SET_WATCHDOG \
    READ_INPUT_BOOLEAN_REGISTER READ_INPUT_FLOAT_REGISTER READ_INPUT_INTEGER_REGISTER READ_OUTPUT_BOOLEAN_REGISTER READ_OUTPUT_FLOAT_REGISTER \
    READ_OUTPUT_INTEGER_REGISTER READ_PORT_BIT READ_PORT_REGISTER WRITE_OUTPUT_BOOLEAN_REGISTER WRITE_OUTPUT_FLOAT_REGISTER \
    WRITE_OUTPUT_INTEGER_REGISTER WRITE_PORT_BIT WRITE_PORT_REGISTER ENCODER_GET_TICK_COUNT ENCODER_ENABLE_SET_TICK_COUNT \
    MODBUS_ADD_SIGNAL MODBUS_DELETE_SIGNAL MODBUS_GET_SIGNAL_STATUS MODBUS_SEND_CUSTOM_COMMAND MODBUS_SET_DIGITAL_INPUT_ACTION \
    MODBUS_SET_OUTPUT_REGISTER MODBUS_SET_OUTPUT_SIGNAL MODBUS_SET_RUNSTATE_DEPENDENT_CHOICE MODBUS_SET_SIGNAL_UPDATE_FREQUENCY RPC_FACTORY SET_TOOL_DIGITAL_OUTPUT_MODE STRUCT \
    RTDE_SET_WATCHDOG SOCKET_CLOSE SOCKET_GET_VAR SOCKET_OPEN SOCKET_READ_ASCII_FLOAT SOCKET_READ_BINARY_INTEGER SOCKET_READ_BYTE_LIST \
    SOCKET_READ_LINE SOCKET_READ_STRING SOCKET_SEND_BYTE SOCKET_SEND_INT SOCKET_SEND_LINE SOCKET_SEND_STRING SOCKET_SET_VAR \
    ENTER_CRITICAL EXIT_CRITICAL FORCE ASSERT FORCE_MODE_SET_DAMPING FORCE_MODE_SET_GAIN_SCALING FT_RTDE_INPUT_ENABLE GET_ACTUAL_JOINT_POSITIONS_HISTORY GET_CONVEYOR_TICK_COUNT \
    GET_TARGET_TCP_POSE_ALONG_PATH GET_TARGET_TCP_SPEED_ALONG_PATH GET_TOOL_ACCELEROMETER_READING SET_CONFIGURABLE_DIGITAL_INPUT_ACTION \
    SET_GP_BOOLEAN_INPUT_ACTION SET_RUNSTATE_GP_BOOLEAN_OUTPUT_TO_VALUE TOOL_CONTACT_EXAMPLES GET_LIST_LENGTH GET_TARGET_PAYLOAD_INERTIA POSITION_DEVIATION_WARNING POWERDOWN PROTECTIVE_STOP TIME ZERO_FTSENSOR";
/// What moves positions at run time, and what ends it.
const DISPLACES: &str =
    "TRACK_CONVEYOR_LINEAR TRACK_CONVEYOR_CIRCULAR PATH_OFFSET_ENABLE FORCE_MODE SCREW_DRIVING";
const REPLACES: &str =
    "STOP_CONVEYOR_TRACKING PATH_OFFSET_DISABLE END_FORCE_MODE END_SCREW_DRIVING";
/// What leads the arm to where no statement says.
const LEADS: &str = "SPEEDJ SPEEDL FREEDRIVE_MODE END_FREEDRIVE_MODE TEACH_MODE END_TEACH_MODE";

/// Words of the language and functions of the controller that are followed, beside motions.
pub(super) fn is_followed(word: &str) -> bool {
    const WORDS: &str =
        "ELIF ELSE END GET_INVERSE_KIN GLOBAL IF LOCAL POSE_TRANS RETURN RUN SET_TCP WHILE";
    is_function(word) || [WORDS, DISPLACES, REPLACES, LEADS].iter().any(|own| has(own, word))
}

pub(super) fn is_harmless(name: &str) -> bool {
    has(HARMLESS, name)
}

pub(super) fn is_function(word: &str) -> bool {
    matches!(word, "DEF" | "THREAD" | "SEC")
}

enum Block {
    Function,
    /// With its line.
    Thread(u32),
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
}

/// Names that stand before a bracket, in their order, but those of another program: `camera.get_pose(`.
fn calls(statement: Cursor<'_>) -> Vec<String> {
    let tokens = statement.tokens;
    let is_of_another = |place: usize| place > 0 && tokens[place - 1].is(b'.');
    let pairs = tokens.windows(2).enumerate();
    let is_called = |own: &(usize, &[Token])| {
        let (place, pair) = own;
        pair[0].kind == Kind::Name && pair[1].is(b'(') && !is_of_another(*place)
    };
    pairs.filter(is_called).map(|(_, pair)| capitals(statement.text(&pair[0]))).collect()
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
            let mut head = statement;
            if head.take_name().is_some_and(|word| is_function(&word)) {
                let name = head.take_name().unwrap_or_default();
                let full = format!("{scope}/{name}");
                self.common.global.entry(name).or_default().push(full);
                continue;
            }
            let Some((name, part, is_element)) = assignment(statement) else { continue };
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
        self.feature = self.varying(script);
        let bodies = vec![(String::new(), Vec::new())];
        let mut walked = Walked { script, bodies, blocks: Vec::new() };
        for (statement, line) in script.all() {
            self.statement(&mut walked, statement, line);
        }
        // A function that does not end is refused by its open block.
        while walked.bodies.len() > 1 {
            walked.push(Step::If);
            self.close_function(&mut walked, None);
        }
        // What stands outside all functions is a program too, as it is sent line by line.
        self.close_function(&mut walked, None);
    }

    /// The one feature of a script that is assigned several values, as off-line tools do it: a global variable.
    fn varying(&self, script: &Statements<'_>) -> Option<String> {
        let scopes = self.scopes(script.file, None);
        let mut found = BTreeSet::new();
        for (statement, _) in script.all() {
            for own in statement.tokens.windows(4) {
                let is_feature = own[1].is(b'(') && own[3].is(b',');
                if is_feature && capitals(statement.text(&own[0])) == "POSE_TRANS" {
                    let name = capitals(statement.text(&own[2]));
                    let value = self.common.constant(&scopes, &name);
                    found.extend(matches!(value, Err(Refusal::TwoValues { .. })).then_some(name));
                }
            }
        }
        let [name] = found.into_iter().collect::<Vec<_>>().try_into().ok()?;
        let of_name = |(own, _): &(Cursor<'_>, u32)| {
            assignment(*own).is_some_and(|(assigned, ..)| assigned == name)
        };
        let said: Vec<bool> =
            script.all().filter(of_name).filter_map(|(own, _)| is_global(own)).collect();
        (said.contains(&true) && !said.contains(&false)).then_some(name)
    }

    /// The head of a block, its end or any other statement.
    fn statement(&mut self, walked: &mut Walked<'_, '_>, statement: Cursor<'_>, line: u32) {
        let mut rest = statement;
        let word = rest.take_name().unwrap_or_default();
        match word.as_str() {
            own if is_function(own) => {
                let block = if word == "THREAD" { Block::Thread(line) } else { Block::Function };
                self.open_function(walked, rest, block);
            }
            "IF" | "WHILE" | "ELIF" => {
                let condition = rest.take_part(b':').unwrap_or(rest);
                if word == "IF" {
                    self.plain(walked, condition, line);
                    walked.push(Step::If);
                    return walked.blocks.push(Block::If);
                }
                let is_loop = word == "WHILE";
                walked.push(if is_loop { Step::Loop } else { Step::Else { is_last: false } });
                self.plain(walked, condition, line);
                walked.push(Step::Tested);
                walked.blocks.extend(is_loop.then_some(Block::Loop));
            }
            "ELSE" => walked.push(Step::Else { is_last: true }),
            "END" => match walked.blocks.pop() {
                Some(Block::Function) => self.close_function(walked, None),
                Some(Block::Thread(line)) => self.close_function(walked, Some(line)),
                Some(Block::Loop) => walked.push(Step::EndLoop),
                Some(Block::If) | None => walked.push(Step::EndIf),
            },
            // Of a loop that is begun anew from within none knows what it begins with.
            "RETURN" | "CONTINUE" => {
                self.plain(walked, statement, line);
                walked.push(Step::Return { with_value: statement.tokens.len() > 1 });
            }
            _ => self.plain(walked, statement, line),
        }
    }

    fn open_function(&mut self, walked: &mut Walked<'_, '_>, head: Cursor<'_>, block: Block) {
        let mut rest = head;
        let name = rest.take_name().unwrap_or_default();
        let scope = self.scopes(walked.script.file, [name.as_str()])[0].clone();
        let parameters = rest.take_sign(b'(').then(|| rest.take_part(b')')).flatten();
        for (named, mut part) in parameters.map(named).unwrap_or_default() {
            let name = if named.is_empty() { part.take_name().unwrap_or_default() } else { named };
            self.common.names.declare(&scope, &name, "VAR").is_parameter = true;
        }
        walked.bodies.push((name, Vec::new()));
        walked.blocks.push(block);
    }

    fn close_function(&mut self, walked: &mut Walked<'_, '_>, thread: Option<u32>) {
        let Some((name, steps)) = walked.bodies.pop() else { return };
        let full = format!("{}/{name}", self.scopes(walked.script.file, None)[0]);
        if let Some(line) = thread {
            let at = self.common.files[walked.script.file].at(line);
            self.threads.push((full.clone(), at));
        }
        self.common.routines.insert(full, Routine { steps });
    }

    /// The function that a name means in a file: its own, or the only one of all. Of two that differ in capitals alone neither is known.
    fn full_name(&self, file: usize, name: &str) -> String {
        let own = format!("{}/{name}", self.scopes(file, None)[0]);
        let all = self.common.global.get(name).into_iter().flatten();
        let is_own = all.filter(|full| **full == own).count() == 1;
        self.common.full_name(own, name, is_own)
    }

    /// A statement that is no block.
    fn plain(&mut self, walked: &mut Walked<'_, '_>, statement: Cursor<'_>, line: u32) {
        let file = walked.script.file;
        // Within a function are those that it stands in.
        let functions = walked.bodies.iter().map(|(name, _)| name.as_str());
        let scopes = self.scopes(file, functions.filter(|name| !name.is_empty()));
        let here = Here { file, line, scopes: &scopes };
        let mut steps = Vec::new();
        let calls = calls(statement);
        let begins = |name: &str| statement.peek_name().is_some_and(|own| own == name);
        // What stands inside happens first.
        for (place, name) in calls.iter().enumerate().rev() {
            let is_first = place == 0 && begins(name);
            let none = Cursor { tokens: &[], ..statement };
            let (whole, inside) =
                if is_first { (statement, inside(statement)) } else { (none, none) };
            // What it starts runs beside the program.
            if !statement.has_name(&["RUN"]) {
                self.call(&here, name, [whole, inside], &mut steps);
            }
        }
        let assigned = assignment(statement);
        if let Some((name, part, _)) = &assigned
            && self.feature.as_ref() == Some(name)
        {
            let value = self.set_to(&here, Some(*part), name, name);
            steps.push(Step::Set(Slot::Base, value));
        }
        let is_motion = calls.first().is_some_and(|name| begins(name) && way(name).is_some());
        if !is_motion {
            let read = assigned.map_or(statement, |(_, part, _)| part);
            self.common.reads(&here, read);
        }
        if let Some((_, own)) = walked.bodies.last_mut() {
            own.extend(steps);
        }
    }

    /// What a call does, whose statement and arguments are given where it is the whole of one.
    fn call(
        &mut self,
        here: &Here<'_>,
        name: &str,
        [whole, inside]: [Cursor<'_>; 2],
        steps: &mut Vec<Step>,
    ) {
        match name {
            "SET_TCP" => {
                let first = named(inside).first().map(|(_, part)| *part);
                steps.push(Step::Set(Slot::Tool, self.set_to(here, first, "tcp", "set_tcp")));
            }
            own if way(own).is_some() => self.motion(here, own, [whole, inside], steps),
            own if has(DISPLACES, own) || has(REPLACES, own) => {
                self.any_displacement = true;
                let what = "a conveyor, a path offset or force mode";
                let displaced = unknown(Refusal::Displaced { what });
                let to = if has(REPLACES, own) { known(Setting::On(false)) } else { displaced };
                steps.push(Step::Set(Slot::Displacement, to));
            }
            own if has(LEADS, own) => {
                let (own, at) = (own.to_ascii_lowercase(), self.common.at(here));
                let words = format!(
                    "nothing says where {own} leads the arm ({at}); state an arm configuration behind it by joint angles or qnear"
                );
                let why = unknown(Refusal::Other(words));
                steps.extend([Slot::Branch, Slot::Place].map(|slot| Step::Set(slot, why.clone())));
            }
            own => {
                let (routine, at) = (self.full_name(here.file, own), self.common.at(here));
                self.called.insert(routine.clone());
                // Another file has a feature of its own.
                let module = &here.scopes[here.scopes.len() - 2];
                let is_of_another = routine.rsplit_once('/').is_some_and(|(of, _)| of != module);
                let why = unknown(Refusal::Ways { what: Slot::Base.name() });
                let around = is_of_another.then_some(Step::Set(Slot::Base, why));
                steps.extend(around.clone());
                steps.push(Step::Call { routine, at });
                steps.extend(around);
            }
        }
    }

    /// The frame that a statement sets, by its name; `what` sets it where it is worked out.
    fn set_to(&self, here: &Here<'_>, part: Option<Cursor<'_>>, name: &str, what: &str) -> Known {
        part.and_then(|part| self.frame(here, part, name)).unwrap_or_else(|| {
            unknown(Refusal::AtRunTime { what: what.to_owned(), at: self.common.at(here) })
        })
    }
}
