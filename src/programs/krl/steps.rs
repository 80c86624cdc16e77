//! Routines of a `.src` → steps.

use std::sync::Arc;

use super::data::{Statement, lines, routine, statement};
use super::{Reading, Tools};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::{Kind, Token};
use crate::reading::{Here, has, shown};
use crate::refusal::Refusal;
use crate::value::{Cursor, Value};

/// Words that begin a statement which neither declares nor assigns.
const KEYWORDS: &str = "ANIN ANOUT BRAKE CASE CIRC CIRC_REL CONTINUE DEFAULT DEFDAT ELSE END ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP \
    ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXT EXTFCT FOR GOTO HALT IF IMPORT INTERRUPT LIN LIN_REL LOOP PTP \
    PTP_REL PTP_SPLINE PULSE REPEAT RESUME RETURN SCIRC SCIRC_REL SIGNAL SLIN SLIN_REL SPL SPLINE SPL_REL \
    SPTP SPTP_REL STRUC SWITCH TRIGGER UNTIL WAIT";

pub(super) fn is_keyword(word: &str) -> bool {
    has(KEYWORDS, word) || matches!(word, "WHILE" | "TIME_BLOCK" | "CONST_VEL" | "STOP")
}

/// Routines and functions of the system that set no frame and move nothing.
const HARMLESS: &str = "ABS ACOS ARCGETDELAY ARCGETPATH ARCMAINNG ATAN2 B_AND B_EXOR B_NOT B_OR CASTFROM CASTTO CAST_FROM CAST_TO CCLOSE CCHANNEL CLEAR_KRLMSG COPEN COS CREAD CWRITE \
    DELETE_BACKWARD_BUFFER EK EKI_CHECKBUFFER EKI_CLEAR EKI_CLOSE EKI_GETBOOL EKI_GETFRAME EKI_GETINT EKI_GETREAL EKI_GETSTRING EKI_INIT \
    EKI_OPEN EKI_SEND EKI_SETBOOL EKI_SETFRAME EKI_SETINT EKI_SETREAL EKI_SETSTRING ERR_CLEAR ERR_RAISE EXISTS_KRLDLG EXISTS_KRLMSG FORWARD H50 INVERSE INV_POS IR_STOPM IR_STOPMESS MBX_REC MSGDIALOG MSGLOOP MSGNOTIFY \
    MSGQUIT MSGSTATE P00 ROUND SACC_JOINT SACC_CP SACC_ORI SAPO SAPO_PTP SAPO_CP SBASE SCIRC_M SCIRC_TYP SCIRC_TYPE SET_CD_PARAMS \
    SET_KRLDLG SET_KRLDLGANSWER SET_KRLMSG SET_TQ_VALUES SEXIST_KRLDLG SGEAR_JERK SIN SIPO_MODE SJERK SLOAD SORI_TYP SQRT SREAD STOOL \
    STOOL2 STRADD STRCLEAR STRCOMP STRCOPY STRDECLLEN STRFIND STRLEN SYNC SVEL_CP SVEL_JOINT SVEL_ORI SWRITE TAN \
    USE_CM_PRO_VALUES VARSTATE";

pub(super) fn is_harmless(name: &str) -> bool {
    has(HARMLESS, name)
}

/// How a displacement by a sensor is named.
pub(super) const SENSOR: &str = "a sensor: RSI, ST_ON";
/// How a displacement by a correction of BAS is named.
const CORRECTION: &str = "BASE_CORR_ON, TOOL_CORR_ON";
/// What switches corrections of BAS.
const CORRECTIONS: &str = "BASE_CORR_ON M_BAS_COR_ON TOOL_CORR_ON TOOL_CORR_W_ON";
/// Functions that let a sensor move the arm, and those that end it.
const SENSOR_ON: &str = "RSI_MOVECORR RSI_ON ST_ON ST_ON1 ST_PATHCORR ST_AXISCORR";
const SENSOR_OFF: &str = "RSI_OFF ST_OFF ST_OFF1 ST_RESET";

/// Routines of technology packages that the INI fold of every program declares for interrupts; they set no base and no tool.
const TECHNOLOGY: &str = "A10 A20 H70";
/// Functions of the system that write variables which are passed to them.
const WRITING: &str = "CASTFROM CAST_FROM CREAD EKI_GETBOOL EKI_GETFRAME EKI_GETINT EKI_GETREAL EKI_GETSTRING MBX_REC SREAD";

/// Under these the tool turns to the orientation that a position states; under others it keeps that of the motion's begin.
const TURNS: &str = "#JOINT #VAR";

/// What a routine sets that it is passed to, where that writes it.
const SETTINGS: [&str; 6] = ["$BASE", "$TOOL", "FDAT_ACT", "$IPO_MODE", "$ORI_TYPE", "LDAT_ACT"];

/// Words before a bracket that call nothing.
const NO_CALLS: &str = "AND CASE DO EXOR FOR IF NOT OR RETURN SWITCH TO UNTIL WAIT WHILE";

impl Reading<'_> {
    pub(super) fn steps(&mut self, file: usize, tokens: &[Token]) {
        let bytes = &self.common.files[file].bytes;
        let mut scopes = Vec::new();
        let mut inside = String::new();
        for line in lines(tokens) {
            let cursor = Cursor::new(bytes, line);
            if let Some((name, ..)) = routine(cursor) {
                scopes = self.scopes(file, Some(&name));
                inside.clone_from(&scopes[0]);
                self.common.routines.insert(inside.clone(), Routine::default());
            } else if !inside.is_empty() {
                let mut steps = Vec::new();
                self.step(&Here { file, line: line[0].line, scopes: &scopes }, cursor, &mut steps);
                if let Some(routine) = self.common.routines.get_mut(&inside) {
                    routine.steps.extend(steps);
                }
            } else if cursor.peek_name().is_some_and(|word| super::motion::is_motion(&word)) {
                let scopes = self.scopes(file, None);
                let here = Here { file, line: line[0].line, scopes: &scopes };
                let (from, mut steps) = (self.common.motions.len(), Vec::new());
                self.step(&here, cursor, &mut steps);
                self.common.outside(&here, from, steps);
            }
        }
    }

    fn step(&mut self, here: &Here<'_>, line: Cursor<'_>, steps: &mut Vec<Step>) {
        self.before = self.written.take();
        let mut line = line;
        while let Some(behind) = behind_label(line) {
            self.before = None;
            steps.push(Step::Label);
            line = behind;
        }
        let mut rest = line;
        let Some(word) = rest.take_name() else { return };
        if !matches!(word.as_str(), "LDAT_ACT" | "FDAT_ACT" | "BAS") {
            self.turn_waits = None;
        }
        self.triggers.any_late |=
            self.triggers.any_open && self.leads_elsewhere(here.file, &word, line);
        if super::motion::is_motion(&word) {
            self.calls(here, rest, steps);
            self.motion(here, &word, rest, steps);
            return;
        }
        match block(&word) {
            Some(block) => {
                // The condition is worked out before the block, and of a loop again in it.
                let is_condition = !matches!(word.as_str(), "DEFAULT" | "ELSE" | "LOOP");
                if block == Step::Loop {
                    steps.push(block);
                    self.conditions(here, rest, steps);
                } else {
                    if is_condition {
                        self.conditions(here, rest, steps);
                    }
                    steps.push(block);
                }
            }
            None => self.plain(here, &word, line, rest, steps),
        }
    }

    /// Whether the next motion may be another than the next of the text.
    fn leads_elsewhere(&self, file: usize, word: &str, line: Cursor<'_>) -> bool {
        let mut called = called(line).map(|name| self.full_name(file, &name));
        let mut is_call = || called.any(|name| self.local.contains(&name));
        match word {
            "TRIGGER" | "INTERRUPT" | "GLOBAL" => false,
            "GOTO" | "RETURN" | "EXIT" | "END" | "ENDFCT" => true,
            _ => block(word).is_some() || is_call(),
        }
    }

    fn conditions(&mut self, here: &Here<'_>, rest: Cursor<'_>, steps: &mut Vec<Step>) {
        self.calls(here, rest, steps);
        self.common.reads(here, rest);
    }

    fn plain(
        &mut self,
        here: &Here<'_>,
        word: &str,
        line: Cursor<'_>,
        rest: Cursor<'_>,
        steps: &mut Vec<Step>,
    ) {
        match word {
            "BAS" => {
                self.calls(here, rest, steps);
                self.bas(here, rest, steps);
            }
            // What a trigger calls moves nothing, and runs at some later time.
            "INTERRUPT" | "GLOBAL" => self.interrupt(here, line, true),
            "TRIGGER" => {
                self.triggers.any_open = true;
                let late = behind_do(line).map_or(0, |own| own.tokens.len());
                let tokens = &line.tokens[..line.tokens.len() - late];
                let names = called(Cursor { tokens, ..line });
                let names = names.map(|name| self.full_name(here.file, &name));
                let given = names.filter(|name| self.local.contains(name));
                let at = self.common.at(here);
                steps.extend(given.map(|routine| Step::Call { routine, at: at.clone() }));
                self.interrupt(here, line, false);
            }
            "GOTO" => steps.push(Step::Jump),
            "RESUME" => steps.push(Step::Resume),
            "RETURN" => {
                self.conditions(here, rest, steps);
                steps.push(Step::Return { with_value: !rest.is_empty() });
            }
            "DECL" | "EXT" | "EXTFCT" | "SIGNAL" | "ENUM" | "STRUC" => {}
            _ => {
                // It is set at the end of the next motion.
                self.triggers.any_open |= line.has_name(&["$OUT_C"]);
                self.calls(here, line, steps);
                let Some(statement) = statement(line).filter(|_| !is_keyword(word)) else {
                    self.passed(here, word, line);
                    return self.common.reads(here, line);
                };
                let Some(value) = statement.value else {
                    return;
                };
                let name = statement.names.first().map_or("", String::as_str);
                self.assigned(here, name, statement.part, value, steps);
                let is_data = name.starts_with("BASE_DATA[") || name.starts_with("TOOL_DATA[");
                self.written = (is_data && !statement.part)
                    .then(|| (name.to_owned(), self.frames(here, name, value)));
            }
        }
    }

    /// Positions that are passed to a routine in no file, which may move to them.
    fn passed(&mut self, here: &Here<'_>, word: &str, line: Cursor<'_>) {
        let is_given = self.local.contains(&self.full_name(here.file, word));
        if is_given || is_keyword(word) || is_harmless(word) {
            return;
        }
        if line.has_name(&["X", "A1"]) && line.tokens.iter().any(|token| token.is(b'{')) {
            self.common.compute(here, word, shown(Cursor { tokens: &line.tokens[1..], ..line }));
        }
        for token in line.tokens.iter().filter(|token| token.kind == Kind::Name) {
            let name = crate::lex::capitals(line.text(token));
            let variable = self.common.names.find(here.scopes, &name);
            if variable.is_some_and(|own| has("AXIS E6AXIS E6POS POS", &own.kind)) {
                self.common.compute(here, word, name);
            }
        }
    }

    fn assigned(
        &mut self,
        here: &Here<'_>,
        name: &str,
        is_part: bool,
        value: Cursor<'_>,
        steps: &mut Vec<Step>,
    ) {
        let at = self.common.at(here);
        let at_run_time =
            |what: &str| unknown(Refusal::AtRunTime { what: what.to_owned(), at: at.clone() });
        let slot = match name {
            "$BASE" => Some(Slot::Base),
            "$TOOL" => Some(Slot::Tool),
            _ => None,
        };
        if let Some(slot) = slot {
            let to =
                if is_part { at_run_time(name) } else { self.written_before(here, name, value) };
            steps.push(Step::Set(slot, to));
        }
        match name {
            "$ORI_TYPE" => {
                let to = self.turn(here, value);
                steps.push(Step::Set(Slot::Turn, to));
            }
            // A number is of another part.
            "LDAT_ACT" if is_part && value.value().number().is_some() => {}
            "LDAT_ACT" => {
                let to = self.turn(here, value);
                self.turn_waits = to.is_ok().then(|| to.clone());
                steps.extend(to.is_err().then_some(Step::Set(Slot::Turn, to)));
            }
            "$IPO_MODE" => {
                let to = self.mode(here, value);
                steps.push(Step::Set(Slot::Mode, to));
            }
            "FDAT_ACT" => {
                let to = if is_part { at_run_time(name) } else { self.inline(here, value) };
                self.tools = self.tools.max(tools(&to));
                steps.push(Step::Set(Slot::Waiting, to));
            }
            // BAS puts a correction before or behind the frames that it sets.
            _ if has(CORRECTIONS, name) && value.value() != Value::Name("FALSE".to_owned()) => {
                self.any_sensor = true;
                let what = CORRECTION;
                steps.push(Step::Set(Slot::Displacement, unknown(Refusal::Displaced { what })));
            }
            "$H_POS" => {}
            _ => self.common.reads(here, value),
        }
    }

    /// The frames of an expression; of data that the statement before wrote, as off-line tools do it, those.
    fn written_before(&self, here: &Here<'_>, name: &str, value: Cursor<'_>) -> Known {
        match (&self.before, value.value()) {
            (Some((own, written)), Value::Name(name)) if *own == name => written.clone(),
            _ => self.frames(here, name, value),
        }
    }

    pub(super) fn mode(&mut self, here: &Here<'_>, value: Cursor<'_>) -> Known {
        let at = self.common.at(here);
        if value.value() == Value::Name("#BASE".to_owned()) {
            return known(Setting::On(true));
        }
        self.tools = Tools::Fixed;
        unknown(Refusal::FixedTool { at })
    }

    /// Whether the tool turns as positions state it: by `$ORI_TYPE`, or the data of an inline form that BAS sets it by.
    pub(super) fn turn(&mut self, here: &Here<'_>, value: Cursor<'_>) -> Known {
        let mut inner = value;
        let is_of_data = inner.take_word("SORI_TYP") && inner.take_sign(b'(');
        let own = inner.take_part(b')').filter(|_| is_of_data).unwrap_or(value);
        let stated = match own.value() {
            Value::Name(name) if !name.starts_with('#') => {
                self.common.constant(here.scopes, &name).ok().map(|own| own.value.clone())
            }
            own => Some(own),
        };
        let turns = stated.is_some_and(|own| match own.field("ORI_TYP").unwrap_or(&own) {
            Value::Name(word) => has(TURNS, word),
            own => matches!(own, Value::Fields { .. }),
        });
        self.any_kept_turn |= !turns;
        let at = self.common.at(here);
        let words = format!(
            "$ORI_TYPE may be #CONSTANT or #IGNORE ({at}), where the tool does not turn to the orientation that the position states; set #VAR"
        );
        if turns { known(Setting::On(true)) } else { unknown(Refusal::Other(words)) }
    }

    /// `BAS(#BASE, 1)`.
    fn bas(&mut self, here: &Here<'_>, rest: Cursor<'_>, steps: &mut Vec<Step>) {
        let at = self.common.at(here);
        let mut rest = rest;
        rest.take_sign(b'(');
        let mut arguments = rest.take_part(b')').unwrap_or(rest);
        let command = arguments.take_part(b',').map(Cursor::value);
        let command = match &command {
            Some(Value::Name(name)) => name.as_str(),
            _ => "",
        };
        let number = arguments.value();
        let number = number.number().and_then(|number| super::frames::whole(number.value));
        let unknown_frames = |steps: &mut Vec<Step>, slots: &[Slot]| {
            for &slot in slots {
                let what = format!("{} by BAS({command})", slot.name());
                let why = Arc::new(Refusal::AtRunTime { what, at: at.clone() });
                steps.push(Step::Set(slot, Err(why)));
            }
        };
        match (command, number) {
            ("#BASE" | "#TOOL", Some(number)) => {
                let (slot, data) = if command == "#BASE" {
                    (Slot::Base, "BASE_DATA")
                } else {
                    (Slot::Tool, "TOOL_DATA")
                };
                let frames = Setting::Frames(self.data_frame(data, number));
                steps.push(Step::Set(slot, known(frames)));
            }
            ("#PTP_PARAMS" | "#CP_PARAMS" | "#FRAMES", _) => {
                steps.push(Step::Apply);
                let turn = self.turn_waits.take().filter(|_| command == "#CP_PARAMS");
                steps.extend(turn.map(|to| Step::Set(Slot::Turn, to)));
            }
            (
                "#VEL_PTP" | "#ACC_PTP" | "#VEL_CP" | "#ACC_CP" | "#OV_PRO" | "#PTP_DAT"
                | "#CP_DAT" | "#ACC_GLOBAL" | "#OUT_SYNC" | "#OUT_ASYNC" | "#GROUP",
                _,
            ) => {}
            ("#BASE" | "#EX_BASE", _) => unknown_frames(steps, &[Slot::Base]),
            ("#TOOL", _) => unknown_frames(steps, &[Slot::Tool]),
            _ => unknown_frames(steps, &[Slot::Base, Slot::Tool, Slot::Waiting]),
        }
    }

    /// `INTERRUPT DECL 3 WHEN … DO IR_STOPM()`, or an assignment in place of the call.
    fn interrupt(&mut self, here: &Here<'_>, line: Cursor<'_>, with_others: bool) {
        let (Some(own), at) = (behind_do(line), self.common.at(here)) else { return };
        if let Some(Statement { names, part, value: Some(value), .. }) = statement(own) {
            let mut steps = Vec::new();
            self.assigned(here, &names[0], part, value, &mut steps);
            if !steps.is_empty() {
                let name = format!("{at}/DO {}", names[0]);
                self.common.routines.insert(name.clone(), Routine { steps });
                self.interrupts.push((name, at));
            }
        } else if let Some(name) = called(own).next() {
            let name = self.full_name(here.file, &name);
            let is_other = with_others && !has(TECHNOLOGY, &name);
            if is_other || self.local.contains(&name) {
                self.interrupts.push((name, at));
            }
        }
    }

    /// Whether a line calls a routine that may change what is passed to it, or writes a variable from now on.
    pub(super) fn calls_another(&self, file: usize, line: Cursor<'_>) -> bool {
        let is_trigger = line.peek_name().is_some_and(|word| word == "TRIGGER");
        let line = behind_do(line).filter(|_| !is_trigger).unwrap_or(line);
        let is_given = |name: &str| self.local.contains(&self.full_name(file, name));
        let writes = |name: &str| !is_harmless(name) || has(WRITING, name) || is_given(name);
        match line.peek_name().as_deref() {
            None | Some("EXT" | "EXTFCT" | "INTERRUPT" | "GLOBAL" | "DECL") => false,
            Some("ANIN") => true,
            Some(_) => called(line).any(|name| name != "BAS" && writes(&name)),
        }
    }

    fn full_name(&self, file: usize, name: &str) -> String {
        let own = format!("{}/{name}", self.module(file));
        let is_own = self.local.contains(&own);
        self.common.full_name(own, name, is_own)
    }

    fn calls(&mut self, here: &Here<'_>, line: Cursor<'_>, steps: &mut Vec<Step>) {
        let at = self.common.at(here);
        // What is passed to a routine that writes it is set there.
        for name in SETTINGS {
            if line.has_name(&[name]) && self.calls_another(here.file, line) {
                self.assigned(here, name, true, line, steps);
            }
        }
        let names = crate::reading::called(line).filter(|name| !has(NO_CALLS, name));
        for name in names.collect::<Vec<_>>() {
            let routine = self.full_name(here.file, &name);
            if is_keyword(&name) && !self.local.contains(&routine) {
                continue;
            }
            steps.push(Step::Call { routine, at: at.clone() });
            // TouchSense corrects what follows, but for the call that prepares it.
            if (name == "H70" && !prepares(line)) || has(SENSOR_ON, &name) {
                self.any_sensor = true;
                let what = SENSOR;
                steps.push(Step::Set(Slot::Displacement, unknown(Refusal::Displaced { what })));
            } else if has(SENSOR_OFF, &name) {
                steps.push(Step::Set(Slot::Displacement, known(Setting::On(false))));
            }
        }
    }
}

/// `H70 (1, CD0)`.
fn prepares(line: Cursor<'_>) -> bool {
    let mut rest = line;
    rest.take_name();
    let first = rest.take_sign(b'(').then(|| rest.take_part(b',')).flatten();
    let number = first.and_then(|own| super::frames::whole(own.value().number()?.value));
    number == Some(1)
}

/// The statement that a line declares for an interrupt or a trigger.
pub(super) fn behind_do(line: Cursor<'_>) -> Option<Cursor<'_>> {
    let word = line.peek_name()?;
    if !matches!(word.as_str(), "GLOBAL" | "INTERRUPT" | "TRIGGER") {
        return None;
    }
    let is_do =
        |token: &Token| token.kind == Kind::Name && line.text(token).eq_ignore_ascii_case(b"DO");
    let place = line.tokens.iter().position(is_do)?;
    Some(Cursor { tokens: &line.tokens[place + 1..], ..line })
}

/// What follows a label in its line; `None` where no label begins it.
fn behind_label(line: Cursor<'_>) -> Option<Cursor<'_>> {
    let mut rest = line;
    let word = rest.take_name()?;
    (rest.take_sign(b':') && word != "DEFAULT").then_some(rest)
}

/// Names of the routines that a line calls.
fn called(line: Cursor<'_>) -> impl Iterator<Item = String> {
    let names = crate::reading::called(line);
    names.filter(|name| !has(NO_CALLS, name) && !is_keyword(name))
}

fn tools(inline: &Known) -> Tools {
    match inline.as_deref() {
        Ok(Setting::Inline(frames)) if frames[2].is_err() => Tools::Fixed,
        Ok(_) => Tools::OnArm,
        Err(_) => Tools::Open,
    }
}

fn block(word: &str) -> Option<Step> {
    Some(match word {
        "IF" => Step::If,
        "ELSE" => Step::Else { is_last: true },
        "ENDIF" => Step::EndIf,
        "LOOP" | "FOR" | "WHILE" | "REPEAT" => Step::Loop,
        "ENDLOOP" | "ENDFOR" | "ENDWHILE" | "UNTIL" => Step::EndLoop,
        "SWITCH" => Step::Switch,
        "CASE" => Step::Case { is_default: false },
        "DEFAULT" => Step::Case { is_default: true },
        "ENDSWITCH" => Step::EndSwitch,
        _ => return None,
    })
}
