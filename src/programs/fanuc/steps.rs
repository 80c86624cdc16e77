//! Statements of a listing → steps.

use super::Reading;
use super::listing::{Listing, Statement};
use super::motion::motion;
use super::position::{number, whole};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::{Kind, Token, capitals};
use crate::reading::{Here, has, shown};
use crate::refusal::Refusal;
use crate::value::Cursor;

/// First words of statements that set no frame and move nothing, alone or before a sign. Anything else may be the name of a macro, which is a
/// program: `GO TO HOME POS`.
const HARMLESS: &str = "ABORT AO AR ARC COL DI DIAG_REC DO END ERROR_PROG F GI GO JMP JOINT_MAX_SPEED LBL LINEAR_MAX_SPEED LOCK M MAINT_PROG MESSAGE \
    OFFSET OVERRIDE P PAUSE PAYLOAD PL PR PULSE R RESUME_PROG RETURN_PATH_DSBL RI RO RSR SKIP SO SOFTFLOAT SR TC_ONLINE TIMER TOOL_OFFSET \
    TORQ_LIMIT UALM UI UNLOCK UO VISION VR WAIT WEAVE WI WO";
/// The second words of those that have one; behind WAIT stands a signal, which a sign follows.
const FOLLOWED: [(&str, &str); 11] = [
    ("ARC", "START END"),
    ("COL", "DETECT GUARD"),
    ("JMP", "LBL"),
    ("LOCK", "PREG VREG"),
    ("OFFSET", "CONDITION"),
    ("SKIP", "CONDITION"),
    ("SOFTFLOAT", "END FOLLOW"),
    ("TOOL_OFFSET", "CONDITION"),
    ("UNLOCK", "PREG VREG"),
    (
        "VISION",
        "RUN_FIND GET_OFFSET GET_PASSFAIL GET_NFOUND GET_READING SET_REFERENCE CAMERA_CALIB OVERRIDE",
    ),
    ("WEAVE", "CIRCLE END FIGURE L SINE SINE2"),
];
/// Second words of what moves positions.
const DISPLACED: &str = "AVC END OFFSET START TAST";
/// First words of what moves positions at run time, up to its end.
const DISPLACES: &str = "MP SEARCH SENSOR TOUCH TRACK";

fn is_harmless(word: &str, rest: Cursor<'_>) -> bool {
    let third = rest.tokens.get(1);
    let is_valued = third.is_some_and(|own| matches!(own.kind, Kind::Sign(_)));
    let is_named = third.is_some_and(|own| own.kind == Kind::Name);
    let follows = |next: &str| FOLLOWED.iter().any(|own| own.0 == word && has(own.1, next));
    has(HARMLESS, word)
        && match (rest.first().map(|own| own.kind), rest.peek_name()) {
            (_, Some(next)) if word == "WAIT" => is_valued || next.starts_with('$'),
            (_, Some(next)) if matches!(word, "ARC" | "WEAVE") => follows(&next) && !is_named,
            (_, Some(next)) => follows(&next),
            (Some(Kind::Number), _) => matches!(word, "TORQ_LIMIT" | "WAIT"),
            _ => true,
        }
}

/// Names of the frames that a statement writes: `UFRAME[1]`, and `UFRAME` where any may be meant.
pub(super) fn written_frames(statement: Cursor<'_>) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = statement;
    while let Some(token) = rest.take() {
        if token.kind != Kind::Name {
            continue;
        }
        let name = capitals(rest.text(token));
        let is_frame = matches!(name.as_str(), "UFRAME" | "UTOOL");
        if ["$MNUFRAME", "$MNUTOOL", "$UFRAME", "$UTOOL"].iter().any(|own| name.starts_with(own)) {
            found.extend(["UFRAME".to_owned(), "UTOOL".to_owned()]);
        } else if is_frame && rest.take_sign(b'[') {
            let inside = rest.take_part(b']').unwrap_or(rest);
            if rest.first().is_some_and(|token| token.is(b'=')) {
                let number = number(inside);
                found.push(number.map_or(name.clone(), |number| format!("{name}[{number}]")));
            }
        }
    }
    found
}

/// What stands before the first comma outside brackets, and behind it: of `IF R[1]=1,JMP LBL[1]` the jump.
fn at_comma(statement: Cursor<'_>) -> Option<(Cursor<'_>, Cursor<'_>)> {
    let mut rest = statement;
    let before = rest.take_part(b',')?;
    (before.tokens.len() < statement.tokens.len()).then_some((before, rest))
}

impl Reading<'_> {
    pub(super) fn steps(&mut self, listing: &Listing<'_>) {
        let mut steps = Vec::new();
        for statement in listing.statements() {
            if statement.all.has_name(&["LBL", "JMP"]) {
                steps.push(Step::Jump);
            }
            let is_alone = statement.all.tokens.len() == 1;
            if is_alone && statement.all.has_name(&["END"]) {
                steps.push(Step::Return { with_value: false });
            }
            self.step(listing, &statement, &mut steps);
        }
        self.common.routines.insert(self.full_name(listing), Routine { steps });
    }

    fn step(&mut self, listing: &Listing<'_>, statement: &Statement<'_>, steps: &mut Vec<Step>) {
        let here = Here { file: listing.file, line: statement.line, scopes: &[] };
        let all = statement.all;
        if let Some((word, rest)) = motion(all) {
            return self.motion(&here, &word, rest, listing.tracks, steps);
        }
        // `IF R[1]=1,JMP LBL[1]`, and `=2,CALL X` that goes on with a SELECT.
        let is_case = matches!(all.peek_name().as_deref(), Some("IF" | "ELSE" | "SELECT") | None);
        if let Some((condition, inner)) = at_comma(all).filter(|_| is_case) {
            steps.push(Step::If);
            if let Some((word, rest)) = motion(inner) {
                self.uses(&here, condition);
                self.motion(&here, &word, rest, listing.tracks, steps);
            } else {
                self.uses(&here, all);
                self.plain(&here, inner, steps);
            }
            return steps.push(Step::EndIf);
        }
        self.uses(&here, all);
        let word = all.peek_name().unwrap_or_default();
        let is_alone = all.tokens.len() == 1;
        let ends_with = |word: &str| {
            all.tokens
                .last()
                .is_some_and(|last: &Token| all.text(last).eq_ignore_ascii_case(word.as_bytes()))
        };
        match word.as_str() {
            "IF" if ends_with("THEN") => steps.push(Step::If),
            "ELSEIF" => steps.push(Step::Else { is_last: false }),
            "ELSE" if is_alone => steps.push(Step::Else { is_last: true }),
            "ENDIF" => steps.push(Step::EndIf),
            "FOR" => steps.push(Step::Loop),
            "ENDFOR" => steps.push(Step::EndLoop),
            "LBL" => steps.push(Step::Label),
            _ => self.plain(&here, all, steps),
        }
    }

    /// A statement that is no motion and no block.
    fn plain(&mut self, here: &Here<'_>, all: Cursor<'_>, steps: &mut Vec<Step>) {
        let mut rest = all;
        let Some(word) = rest.take_name() else { return };
        match word.as_str() {
            "UFRAME_NUM" => self.set(here, Slot::Base, rest, steps),
            "UTOOL_NUM" => self.set(here, Slot::Tool, rest, steps),
            "UFRAME" | "UTOOL" => {}
            "CALL" => {
                let routine = self.called(rest);
                steps.push(Step::Call { routine, at: self.common.at(here) });
            }
            own if own.starts_with("$MNUFRAME") || own.starts_with("$MNUTOOL") => {
                for slot in [Slot::Base, Slot::Tool] {
                    steps.push(Step::Set(slot, self.worked_out(here, own)));
                }
            }
            own if own.starts_with('$') || is_harmless(own, rest) => {}
            own if has(DISPLACES, own)
                && rest.peek_name().is_none_or(|next| has(DISPLACED, &next)) =>
            {
                self.any_displacement = true;
                let what = "Touch Offset, Track, Search";
                let to = if rest.has_name(&["END"]) {
                    known(Setting::On(false))
                } else {
                    unknown(Refusal::Displaced { what })
                };
                steps.push(Step::Set(Slot::Displacement, to));
            }
            _ => {
                let routine = capitals(shown(all).as_bytes());
                steps.push(Step::Call { routine, at: self.common.at(here) });
            }
        }
    }

    /// The program behind a CALL; of two programs of one name none is known.
    fn called(&self, mut rest: Cursor<'_>) -> String {
        self.common.full_name(String::new(), &rest.take_name().unwrap_or_default(), false)
    }

    /// What a motion calls beside it (`TB .10sec,CALL X`) may set frames for those behind it; it has no arm to lead.
    pub(super) fn beside(&self, here: &Here<'_>, motion: Cursor<'_>, steps: &mut Vec<Step>) {
        let mut rest = motion;
        while let Some(token) = rest.take() {
            if token.kind == Kind::Name && rest.text(token).eq_ignore_ascii_case(b"CALL") {
                let (routine, at) = (self.called(rest), self.common.at(here));
                let mut files = self.common.global.values().flatten();
                let given =
                    files.any(|own| *own == routine) || self.common.routines.contains_key(&routine);
                for slot in [Slot::Base, Slot::Tool].into_iter().filter(|_| !given) {
                    let (what, routine, at) = (slot.name(), routine.clone(), at.clone());
                    steps.push(Step::Set(slot, unknown(Refusal::Call { what, routine, at })));
                }
                steps.extend(given.then_some(Step::Call { routine, at }));
            }
        }
    }

    fn worked_out(&self, here: &Here<'_>, what: &str) -> Known {
        unknown(Refusal::AtRunTime { what: what.to_owned(), at: self.common.at(here) })
    }

    /// `UFRAME_NUM=1`, and of several groups `UFRAME_NUM[GP1]=1`.
    fn set(&self, here: &Here<'_>, slot: Slot, rest: Cursor<'_>, steps: &mut Vec<Step>) {
        let mut rest = rest;
        if rest.take_sign(b'[') {
            let groups = rest.take_part(b']').unwrap_or(rest);
            if !groups.has_name(&["GP1"]) {
                return;
            }
        }
        let number = rest.take_sign(b'=').then(|| rest.take_number()).flatten();
        let number = number.filter(|_| rest.is_empty()).and_then(|number| whole(&number));
        let word = if slot == Slot::Base { "UFRAME_NUM" } else { "UTOOL_NUM" };
        let to =
            number.map_or_else(|| self.worked_out(here, word), |number| self.frame(slot, number));
        steps.push(Step::Set(slot, to));
    }

    /// Marks the positions that a statement other than a motion reads, or writes where it begins with one.
    fn uses(&mut self, here: &Here<'_>, statement: Cursor<'_>) {
        let at = self.common.at(here);
        let mut rest = statement;
        let mut is_first = true;
        while let Some(token) = rest.take() {
            let is_position =
                token.kind == Kind::Name && rest.text(token).eq_ignore_ascii_case(b"P");
            if is_position && rest.take_sign(b'[') {
                let inside = rest.take_part(b']').unwrap_or(rest);
                let why = if is_first {
                    Refusal::AtRunTime { what: shown(statement), at: at.clone() }
                } else {
                    Refusal::Read { at: at.clone() }
                };
                match number(inside).map(|own| self.positions.get_mut(&(here.file, own))) {
                    Some(Some(listed)) => {
                        listed.obstacle.get_or_insert(why);
                    }
                    Some(None) => {}
                    None => {
                        self.any_used.entry(here.file).or_insert(why);
                    }
                }
            }
            is_first = false;
        }
    }
}
