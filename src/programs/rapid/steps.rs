//! Routines of a module → steps.

use super::Reading;
use super::data::{declaration, is_end};
use super::statement::{Statement, assignment, header};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::Kind;
use crate::names::Scope;
use crate::refusal::Refusal;
use crate::value::Cursor;

/// Words that begin a statement which is no call.
const WORDS: [&str; 30] = [
    "BACKWARD",
    "CASE",
    "CONNECT",
    "DEFAULT",
    "ELSE",
    "ELSEIF",
    "ENDFOR",
    "ENDFUNC",
    "ENDIF",
    "ENDMODULE",
    "ENDPROC",
    "ENDRECORD",
    "ENDTEST",
    "ENDTRAP",
    "ENDWHILE",
    "ERROR",
    "EXIT",
    "FOR",
    "FUNC",
    "GOTO",
    "IF",
    "MODULE",
    "PROC",
    "RAISE",
    "RECORD",
    "RETRY",
    "RETURN",
    "TEST",
    "TRYNEXT",
    "WHILE",
];

pub(super) fn is_word(word: &str) -> bool {
    WORDS.contains(&word) || matches!(word, "UNDO" | "TRAP" | "ALIAS")
}

/// Instructions of the controller that set nothing followed here and change no position, tool or work object.
const HARMLESS: [&str; 79] = [
    "ACCSET",
    "ADD",
    "BREAK",
    "CLEAR",
    "CLKRESET",
    "CLKSTART",
    "CLKSTOP",
    "CLOSE",
    "CONFJ",
    "CONFL",
    "DECR",
    "EOFFSOFF",
    "EOFFSON",
    "EOFFSSET",
    "ERRLOG",
    "ERRWRITE",
    "EXITCYCLE",
    "GRIPLOAD",
    "IDELETE",
    "IDISABLE",
    "IENABLE",
    "INCR",
    "INVERTDO",
    "ISIGNALAI",
    "ISIGNALDI",
    "ISIGNALDO",
    "ISLEEP",
    "ITIMER",
    "IWATCH",
    "MOTIONSUP",
    "OPEN",
    "PDISPOFF",
    "PDISPON",
    "PDISPSET",
    "PULSEDO",
    "RESET",
    "RESETRETRYCOUNT",
    "RESTOPATH",
    "SET",
    "SETAO",
    "SETDO",
    "SETGO",
    "SINGAREA",
    "SOCKETCLOSE",
    "SOCKETCONNECT",
    "SOCKETCREATE",
    "SOCKETSEND",
    "SOFTACT",
    "SOFTDEACT",
    "SPEEDREFRESH",
    "STARTMOVE",
    "STOP",
    "STOPMOVE",
    "STOREPATH",
    "SYNCMOVEOFF",
    "SYNCMOVEON",
    "SYNCMOVERESUME",
    "SYNCMOVESUSPEND",
    "SYSTEMSTOPACTION",
    "TESTSIGNDEFINE",
    "TPERASE",
    "TPSHOW",
    "TPWRITE",
    "UIMSGBOX",
    "VELSET",
    "WAITAI",
    "WAITDI",
    "WAITDO",
    "WAITGI",
    "WAITROB",
    "WAITSYNCTASK",
    "WAITTIME",
    "WAITUNTIL",
    "WORLDACCLIM",
    "WRITE",
    "WRITESTRBIN",
    "WZDOSET",
    "WZENABLE",
    "WZDISABLE",
];

/// Whether a routine of this name changes nothing that is followed here.
pub(super) fn is_harmless(name: &str) -> bool {
    HARMLESS.contains(&name)
}

impl Reading<'_> {
    pub(super) fn steps(&mut self, file: usize, statements: &[Statement<'_>]) {
        let module = self.module(file);
        let mut inside: Option<(Routine, Vec<Scope>)> = None;
        for statement in statements {
            if let Some(header) = header(statement) {
                self.keep(inside.take());
                let scopes = self.scopes(file, Some(&header.name));
                let name = format!("{module}/{}", header.name);
                inside = Some((Routine { name, steps: Vec::new() }, scopes));
            } else if is_end(statement) {
                self.keep(inside.take());
            } else if declaration(statement).is_none()
                && let Some((routine, scopes)) = &mut inside
            {
                self.step(file, scopes, statement, &mut routine.steps);
            }
        }
        self.keep(inside);
    }

    fn keep(&mut self, routine: Option<(Routine, Vec<Scope>)>) {
        if let Some((routine, _)) = routine {
            self.routines.insert(routine.name.clone(), routine);
        }
    }

    fn step(
        &mut self,
        file: usize,
        scopes: &[Scope],
        statement: &Statement<'_>,
        steps: &mut Vec<Step>,
    ) {
        let all = statement.all;
        let Some(word) = all.peek_name() else {
            // A call whose name is worked out: `%name%`.
            let at = self.files[file].at(statement.line);
            steps.push(Step::Call { routine: "%…%".to_owned(), at });
            return self.reads(scopes, all, file, statement.line);
        };
        if matches!(word.as_str(), "IF" | "ELSEIF") {
            return self.condition(file, scopes, statement, &word, steps);
        }
        let is_label = all.tokens.len() == 2 && all.tokens[1].is(b':') && word != "DEFAULT";
        if is_label || matches!(word.as_str(), "ERROR" | "UNDO" | "BACKWARD") {
            return steps.push(Step::Label);
        }
        if let Some(block) = block(&word) {
            self.reads(scopes, all, file, statement.line);
            return steps.push(block);
        }
        if is_word(&word) {
            return self.reads(scopes, all, file, statement.line);
        }
        if let Some((_, value)) = assignment(all) {
            return self.reads(scopes, value, file, statement.line);
        }
        self.call(file, scopes, statement.line, all, steps);
    }

    /// `IF … THEN` opens a block; `IF … instruction` has its instruction in itself.
    fn condition(
        &mut self,
        file: usize,
        scopes: &[Scope],
        statement: &Statement<'_>,
        word: &str,
        steps: &mut Vec<Step>,
    ) {
        let all = statement.all;
        let is_then = all.tokens.last().is_some_and(|token| {
            token.kind == Kind::Name && all.text(token).eq_ignore_ascii_case(b"THEN")
        });
        if is_then {
            self.reads(scopes, all, file, statement.line);
            steps.push(if word == "IF" { Step::If } else { Step::Else { is_last: false } });
            return;
        }
        let Some(inner) = instruction(all) else {
            return self.reads(scopes, all, file, statement.line);
        };
        let line = statement.line;
        let condition =
            Cursor { tokens: &all.tokens[..all.tokens.len() - inner.tokens.len()], ..all };
        self.reads(scopes, condition, file, line);
        steps.push(Step::If);
        if let Some((_, value)) = assignment(inner) {
            self.reads(scopes, value, file, line);
        } else if !inner.peek_name().is_some_and(|word| is_word(&word)) {
            self.call(file, scopes, line, inner, steps);
        }
        steps.push(Step::EndIf);
    }

    /// An instruction of the controller, a motion, or a call.
    fn call(
        &mut self,
        file: usize,
        scopes: &[Scope],
        line: u32,
        all: Cursor<'_>,
        steps: &mut Vec<Step>,
    ) {
        let mut rest = all;
        let Some(word) = rest.take_name() else {
            return;
        };
        if self.is_motion(&word) {
            return self.motion(file, scopes, line, &word, rest, steps);
        }
        if let Some((slot, to)) = self.setting(&word, rest) {
            steps.push(Step::Set(slot, to));
        } else if !is_harmless(&word) {
            let routine = self.full_name(file, &word);
            let at = self.files[file].at(line);
            self.passed(file, scopes, line, &word, rest);
            steps.push(Step::Call { routine, at });
        }
        self.reads(scopes, rest, file, line);
    }

    /// What an instruction of the controller sets.
    fn setting(&mut self, word: &str, rest: Cursor<'_>) -> Option<(Slot, Known)> {
        let is_off = rest.tokens.iter().any(|token| rest.text(token).eq_ignore_ascii_case(b"OFF"));
        let displaced = |what| unknown(Refusal::Displaced { what });
        Some(match word {
            "PDISPON" | "PDISPSET" => {
                self.any_displacement = true;
                (Slot::Displacement, displaced("PDisp"))
            }
            "PDISPOFF" => (Slot::Displacement, known(Setting::On(false))),
            "EOFFSON" | "EOFFSSET" => {
                self.any_offset = true;
                (Slot::Mode, displaced("EOffs"))
            }
            "EOFFSOFF" => (Slot::Mode, known(Setting::On(false))),
            "CONFJ" | "CONFL" => {
                let which = usize::from(word == "CONFL");
                self.any_conf_off[which] |= is_off;
                let slot = if which == 0 { Slot::ConfJ } else { Slot::ConfL };
                (slot, known(Setting::On(!is_off)))
            }
            _ => return None,
        })
    }

    pub(super) fn full_name(&self, file: usize, name: &str) -> String {
        let own = format!("{}/{name}", self.module(file));
        if self.given.contains_key(&own) {
            return own;
        }
        match self.global.get(name).map(Vec::as_slice) {
            Some([only]) => only.clone(),
            _ => name.to_owned(),
        }
    }

    /// Positions that a statement reads.
    pub(super) fn reads(&mut self, scopes: &[Scope], all: Cursor<'_>, file: usize, line: u32) {
        let at = self.files[file].at(line);
        for token in all.tokens.iter().filter(|token| token.kind == Kind::Name) {
            let name = crate::lex::capitals(all.text(token));
            if let Some(variable) = self.names.find_mut(scopes, &name) {
                variable.read.get_or_insert_with(|| at.clone());
            }
        }
    }
}

/// The instruction of a compact IF: it begins at a name that follows a complete condition, one that a sign or an operator
/// does not precede.
fn instruction(all: Cursor<'_>) -> Option<Cursor<'_>> {
    let ends_value = |place: usize| {
        let token = &all.tokens[place];
        match token.kind {
            Kind::Number | Kind::Text => true,
            Kind::Sign(sign) => matches!(sign, b')' | b']' | b'}'),
            Kind::Name => {
                let word = crate::lex::capitals(all.text(token));
                !matches!(word.as_str(), "IF" | "AND" | "OR" | "XOR" | "NOT" | "DIV" | "MOD")
            }
            _ => false,
        }
    };
    let is_operator = |place: usize| {
        let word = crate::lex::capitals(all.text(&all.tokens[place]));
        matches!(word.as_str(), "AND" | "OR" | "XOR" | "DIV" | "MOD")
    };
    let place = (2..all.tokens.len()).find(|&place| {
        all.tokens[place].kind == Kind::Name && ends_value(place - 1) && !is_operator(place)
    })?;
    Some(Cursor { tokens: &all.tokens[place..], ..all })
}

fn block(word: &str) -> Option<Step> {
    Some(match word {
        "ELSE" => Step::Else { is_last: true },
        "ENDIF" => Step::EndIf,
        "WHILE" | "FOR" => Step::Loop,
        "ENDWHILE" | "ENDFOR" => Step::EndLoop,
        "TEST" => Step::Switch,
        "CASE" => Step::Case { is_default: false },
        "DEFAULT" => Step::Case { is_default: true },
        "ENDTEST" => Step::EndSwitch,
        _ => return None,
    })
}
