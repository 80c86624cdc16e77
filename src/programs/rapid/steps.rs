//! Routines of a module → steps.

use super::Reading;
use super::data::{declaration, is_end};
use super::statement::{Statement, assignment, header};
use crate::flow::{Known, Routine, Setting, Slot, Step, known, unknown};
use crate::lex::Kind;
use crate::reading::{Here, called, has};
use crate::refusal::Refusal;
use crate::value::Cursor;

/// Ends the present motion where the arm is.
pub(super) const CLEARS: &str = "CLEARPATH";

/// Words that begin a statement which is no call.
const WORDS: &str = "BACKWARD CASE CONNECT DEFAULT ELSE ELSEIF ENDFOR ENDFUNC ENDIF ENDMODULE ENDPROC ENDRECORD ENDTEST \
    ENDTRAP ENDWHILE ERROR EXIT FOR FUNC GOTO IF MODULE PROC RAISE RECORD RETRY RETURN TEST TRYNEXT WHILE";

pub(super) fn is_word(word: &str) -> bool {
    has(WORDS, word) || matches!(word, "UNDO" | "TRAP" | "ALIAS")
}

/// Instructions of the controller that set nothing followed here and change no position, tool or work object.
const HARMLESS: &str = "ACCSET ACTEVENTBUFFER ACTUNIT ALIASIO ALIASIORESET BITCLEAR BITSET BOOKERRNO BREAK CANCELLOAD CHECKPROGREF CIRPATHMODE CLEARIOBUFF \
    CLEARPATH CLEARRAWBYTES CLKRESET CLKSTART CLKSTOP CLOSE CLOSEDIR CONFJ CONFL COPYFILE COPYRAWBYTES CORNERPATHWARNING CORRCLEAR CORRCON \
    CORRDISCON CORRWRITE DEACTEVENTBUFFER DEACTUNIT EGMRESET EOFFSOFF EOFFSON EOFFSSET ERASEMODULE ERRLOG ERRRAISE ERRWRITE EXITCYCLE \
    GRIPLOAD ICAP IDELETE IDISABLE IENABLE IERROR INVERTDO IOBUSSTART IODISABLE IOENABLE IPATHPOS IPERS IRMQMESSAGE ISIGNALAI ISIGNALAO \
    ISIGNALDI ISIGNALDO ISIGNALGI ISIGNALGO ISLEEP ITIMER IVARVALUE IWATCH LOAD MAKEDIR MECHUNITLOAD MOTIONPROCESSMODESET MOTIONSUP OPEN \
    OPENDIR PACKDNHEADER PACKRAWBYTES PATHACCLIM PATHLENGTHRESET PATHLENGTHSTART PATHLENGTHSTOP PATHRECSTART PATHRECSTOP PATHRESOL \
    PDISPOFF PDISPON PDISPSET PROCERRRECOVERY PULSEDO RAISETOUSER REMOVEALLCYCLICBOOL REMOVECYCLICBOOL REMOVEDIR REMOVEFILE RENAMEFILE \
    RESET RESETPPMOVED RESETRETRYCOUNT RESTOPATH REWIND RMQEMPTYQUEUE RMQFINDSLOT RMQSENDMESSAGE RMQSENDWAIT SAVE SCWRITE SET SETAO SETDO \
    SETGO SETSYSDATA SETUPCYCLICBOOL SINGAREA SKIPWARN SOCKETACCEPT SOCKETBIND SOCKETCLOSE SOCKETCONNECT SOCKETCREATE SOCKETLISTEN \
    SOCKETSEND SOFTACT SOFTDEACT SPEEDLIMAXIS SPEEDLIMCHECKPOINT SPEEDREFRESH SPYSTART SPYSTOP STARTLOAD STARTMOVE STARTMOVERETRY STCALIB \
    STCLOSE STINDGUN STINDGUNRESET STOP STOPEN STOPMOVE STOPMOVERESET STOREPATH STTUNE STTUNERESET SYNCMOVEOFF SYNCMOVEON SYNCMOVERESUME \
    SYNCMOVESUSPEND SYSTEMSTOPACTION TESTSIGNDEFINE TESTSIGNRESET TEXTTABINSTALL TPERASE TPSHOW TPWRITE TRIGGCHECKIO TRIGGDATACOPY \
    TRIGGDATARESET TRIGGEQUIP TRIGGINT TRIGGIO TRIGGRAMPAO TRIGGSPEED TRIGGSTOPPROC TUNERESET TUNESERVO UIMSGBOX UISHOW UNLOAD VELSET \
    WAITAI WAITAO WAITDI WAITDO WAITGI WAITGO WAITLOAD WAITROB WAITSYNCTASK WAITTIME WAITUNTIL WORLDACCLIM WRITE WRITEANYBIN WRITEBIN \
    WRITECFGDATA WRITERAWBYTES WRITESTRBIN WRITEVAR WRITEVARARR WZBOXDEF WZCYLDEF WZDISABLE WZDOSET WZENABLE WZFREE WZHOMEJOINTDEF \
    WZLIMJOINTDEF WZLIMSUP WZSPHDEF";

/// Those that set nothing followed here either, and write variables which are passed to them.
const WRITING: &str = "ADD CLEAR DECR INCR STRTOVAL TESTANDSET GETDATAVAL GETTRAPDATA READANYBIN READBLOCK READCFGDATA READERRDATA READRAWBYTES READVARARR SOCKETRECEIVE SOCKETRECEIVEFROM TPREADDNUM \
    TPREADFK TPREADNUM UIMSGWRITE UNPACKRAWBYTES WAITTESTANDSET";

/// Functions of the controller, which change nothing that is followed here, and operators before a bracket.
const FUNCTIONS: &str = "ABS ACOS AINPUT AND AOUTPUT ARGNAME ASIN ATAN ATAN2 BITAND BITCHECK BITLSH BITNEG BITOR BITRSH BITXOR BYTETOSTR CALCJOINTT CALCROBT \
    CALCROTAXFRAMEZ CALCROTAXISFRAME CDATE CJOINTT CLKREAD CORRREAD COS COSDNUM CPOS CROBT CROSSPROD CSPEEDOVERRIDE CTIME CTOOL CWOBJ \
    DECTOHEX DEFACCFRAME DEFDFRAME DEFFRAME DIM DINPUT DISTANCE DIV DNUMTONUM DNUMTOSTR DO DOTPROD DOUTPUT EULERZYX EVENTTYPE EXECHANDLER \
    EXECLEVEL EXP FILESIZE FILETIME FILETIMEDNUM FROM FSSIZE GETAXISDISTANCE GETAXISMOVETIME GETMAXNUMBEROFCYCLICBOOL GETMECUNITNAME \
    GETMODALPAYLOADMODE GETMOTORTORQUE GETNEXTCYCLICBOOL GETNEXTMECHUNIT GETNEXTSYM GETNUMBEROFCYCLICBOOL GETSERVICEINFO GETSIGNALORIGIN \
    GETSYSINFO GETTASKNAME GETTIME GETTSPSTATUS GETUASSTATUS GINPUT GINPUTDNUM GOUTPUT GOUTPUTDNUM HEXTODEC INDINPOS INDSPEED IOBUSSTATE \
    IOUNITSTATE ISBRAKECHECKACTIVE ISCYCLICBOOL ISFILE ISLEADTHROUGH ISMECHUNITACTIVE ISPERS ISSTOPMOVEACT ISSTOPSTATEEVENT ISSYNCMOVEON \
    ISSYSID ISVAR MAX MAXEXTLINEARSPEED MAXEXTREORIENTSPEED MAXROBREORIENTSPEED MAXROBSPEED MIN MIRPOS MOD MODEXIST MODTIME MODTIMEDNUM \
    MOTIONPLANNERNO NONMOTIONMODE NORIENT NOT NUMTODNUM NUMTOSTR OFFS OPMODE OR ORIENTZYX OROBT PARIDPOSVALID PARIDROBVALID PATHLENGTHGET \
    PATHLEVEL PATHRECVALIDBWD PATHRECVALIDFWD PFRESTART POSEINV POSEMULT POSEVECT POW POWDNUM PPMOVEDINMANMODE PRESENT PROGMEMFREE QUAD \
    QUADDNUM RAWBYTESLEN READBIN READDIR READMOTOR READNUM READSTR READSTRBIN READVAR RELTOOL REMAININGRETRIES RMQGETSLOTNAME ROBNAME \
    ROBOS ROUND ROUNDDNUM RUNMODE SIN SINDNUM SOCKETGETSTATUS SOCKETPEEK SQRT SQRTDNUM STCALCFORCE STCALCTORQUE STEP STISCALIB STISCLOSED \
    STISINDGUN STISOPEN STRDIGCALC STRDIGCMP STRFIND STRFORMAT STRLEN STRMAP STRMATCH STRMEMB STRORDER STRPART STRTOBYTE STRTOVAL TAN \
    TANDNUM TASKISACTIVE TASKISEXECUTING TASKRUNMEC TASKRUNROB TASKSINSYNC TESTANDSET TESTDI TESTSIGNREAD TEXTGET TEXTTABFREETOUSE \
    TEXTTABGET THEN TO TRIGGDATAVALID TRUNC TRUNCDNUM TYPE UIALPHAENTRY UICLIENTEXIST UIDNUMENTRY UIDNUMTUNE UILISTVIEW UIMESSAGEBOX \
    UINUMENTRY UINUMTUNE VALIDIO VALTOSTR VECTMAGN XOR";

pub(super) fn is_function(name: &str) -> bool {
    has(FUNCTIONS, name) || is_word(name) || is_harmless(name)
}

/// Whether a routine of this name changes nothing that is followed here.
pub(super) fn is_harmless(name: &str) -> bool {
    has(HARMLESS, name) || is_writing(name)
}

/// Whether a statement changes variables whose names are worked out.
pub(super) fn writes_by_name(statement: Cursor<'_>) -> bool {
    let word = statement.peek_name();
    word.is_some_and(|word| matches!(word.as_str(), "SETDATAVAL" | "SETALLDATAVAL"))
}

pub(super) fn is_writing(name: &str) -> bool {
    has(WRITING, name)
}

impl Reading<'_> {
    pub(super) fn steps(&mut self, file: usize, statements: &[Statement<'_>]) {
        let mut scopes = Vec::new();
        let mut inside = String::new();
        for statement in statements {
            if let Some(header) = header(statement) {
                scopes = self.scopes(file, Some(&header.name));
                inside.clone_from(&scopes[0]);
                self.common.routines.insert(inside.clone(), Routine::default());
            } else if is_end(statement) {
                inside.clear();
            } else if inside.is_empty() {
                self.outside(file, statement);
            } else if declaration(statement).is_none() {
                let mut steps = Vec::new();
                let here = Here { file, line: statement.line, scopes: &scopes };
                self.step(&here, statement, &mut steps);
                if let Some(routine) = self.common.routines.get_mut(&inside) {
                    routine.steps.extend(steps);
                }
            }
        }
    }

    fn outside(&mut self, file: usize, statement: &Statement<'_>) {
        if !statement.all.peek_name().is_some_and(|word| self.is_motion(&word)) {
            return;
        }
        let scopes = self.scopes(file, None);
        let here = Here { file, line: statement.line, scopes: &scopes };
        let (from, mut steps) = (self.common.motions.len(), Vec::new());
        self.step(&here, statement, &mut steps);
        self.common.outside(&here, from, steps);
    }

    fn step(&mut self, here: &Here<'_>, statement: &Statement<'_>, steps: &mut Vec<Step>) {
        self.within(here, statement, steps);
        if statement.all.has_name(&["RETURN", "RAISE"]) {
            let with_value = !ends_in(statement.all, b"RETURN");
            steps.push(Step::Return { with_value });
        }
    }

    fn within(&mut self, here: &Here<'_>, statement: &Statement<'_>, steps: &mut Vec<Step>) {
        let all = statement.all;
        let Some(word) = all.peek_name() else {
            return self.late_call(here, all, steps);
        };
        if all.has_name(&["GOTO"]) {
            steps.push(Step::Jump);
        }
        if all.has_name(&["TRYNEXT"]) {
            steps.push(Step::GoesOn);
        }
        if matches!(word.as_str(), "IF" | "ELSEIF") {
            return self.condition(here, statement, &word, steps);
        }
        let is_label = all.tokens.len() == 2 && all.tokens[1].is(b':') && word != "DEFAULT";
        if is_label {
            return steps.push(Step::Label);
        }
        if matches!(word.as_str(), "ERROR" | "UNDO" | "BACKWARD") {
            return steps.push(Step::Handler);
        }
        if let Some(block) = block(&word) {
            self.common.reads(here, all);
            // A condition is worked out before its block, and of a loop again in it.
            if block == Step::Loop {
                steps.push(block);
                self.functions(here, all, steps);
                return steps.push(Step::Tested);
            }
            self.functions(here, all, steps);
            return steps.push(block);
        }
        self.functions(here, all, steps);
        if word == "CONNECT" {
            self.connected(here, all);
        }
        if is_word(&word) {
            return self.common.reads(here, all);
        }
        if let Some((_, value)) = assignment(all) {
            return self.common.reads(here, value);
        }
        self.call(here, all, steps);
    }

    /// `CONNECT i1 WITH t1`: a trap that is in no file runs at any time.
    fn connected(&mut self, here: &Here<'_>, all: Cursor<'_>) {
        let mut names = all.tokens.iter().filter(|token| token.kind == Kind::Name);
        let Some(trap) = names.next_back() else { return };
        let full = self.full_name(here.file, &crate::lex::capitals(all.text(trap)));
        if !self.given.contains_key(&full) {
            self.traps.push((full, self.common.at(here)));
        }
    }

    /// A call whose name is worked out: `%name%`.
    fn late_call(&mut self, here: &Here<'_>, all: Cursor<'_>, steps: &mut Vec<Step>) {
        let at = self.common.at(here);
        self.any_late_call = true;
        steps.push(Step::Call { routine: "%…%".to_owned(), at });
        let mut passed = all;
        passed.take_sign(b'%');
        passed.take_part(b'%');
        self.passed(here, "%…%", passed);
        self.common.reads(here, all);
    }

    /// `IF … THEN` opens a block; `IF … instruction` has its instruction in itself.
    fn condition(
        &mut self,
        here: &Here<'_>,
        statement: &Statement<'_>,
        word: &str,
        steps: &mut Vec<Step>,
    ) {
        let all = statement.all;
        if ends_in(all, b"THEN") {
            self.common.reads(here, all);
            if word == "IF" {
                self.functions(here, all, steps);
                return steps.push(Step::If);
            }
            steps.push(Step::Else { is_last: false });
            self.functions(here, all, steps);
            return steps.push(Step::Tested);
        }
        let mut inner = without_condition(all);
        let condition =
            Cursor { tokens: &all.tokens[..all.tokens.len() - inner.tokens.len()], ..all };
        self.common.reads(here, condition);
        self.functions(here, condition, steps);
        steps.push(Step::If);
        // No IF may be the instruction of another: nothing is known where one is.
        while inner.peek_name().is_some_and(|word| word == "IF") {
            let (word, at) = ("an IF in an IF".to_owned(), self.common.at(here));
            steps.push(Step::Set(Slot::Displacement, unknown(Refusal::Instruction { word, at })));
            inner = instruction(inner).unwrap_or(Cursor { tokens: &[], ..inner });
        }
        self.functions(here, inner, steps);
        if inner.first().is_some_and(|token| token.is(b'%')) {
            self.late_call(here, inner, steps);
        } else if let Some((_, value)) = assignment(inner) {
            self.common.reads(here, value);
        } else if !inner.peek_name().is_some_and(|word| is_word(&word)) {
            self.is_in_if = true;
            self.call(here, inner, steps);
            self.is_in_if = false;
        }
        steps.push(Step::EndIf);
    }

    /// Functions of the files that a statement calls, and those that are in none, which may move to what is passed to them.
    fn functions(&mut self, here: &Here<'_>, all: Cursor<'_>, steps: &mut Vec<Step>) {
        for name in called(all).collect::<Vec<_>>() {
            let routine = self.full_name(here.file, &name);
            let is_given = self.given.contains_key(&routine);
            if !is_given && is_function(&name) {
                continue;
            }
            // The word of a statement is no function.
            let mut behind = Cursor { tokens: all.tokens.get(1..).unwrap_or_default(), ..all };
            while let Some(token) = behind.take().filter(|_| !is_given) {
                let is_it = crate::lex::capitals(all.text(token)) == name;
                if is_it && behind.take_sign(b'(') {
                    self.passed(here, &name, behind.take_part(b')').unwrap_or(behind));
                }
            }
            steps.push(Step::Call { routine, at: self.common.at(here) });
        }
    }

    /// An instruction of the controller, a motion, or a call.
    fn call(&mut self, here: &Here<'_>, all: Cursor<'_>, steps: &mut Vec<Step>) {
        let mut rest = all;
        let Some(word) = rest.take_name() else {
            return;
        };
        if self.is_motion(&word) {
            return self.motion(here, &word, rest, steps);
        }
        let is_own = self.named.contains(&word);
        if let Some((slot, to)) = self.setting(here, &word, rest).filter(|_| !is_own) {
            steps.push(Step::Set(slot, to));
        }
        self.any_late_call |= word == "CALLBYVAR";
        self.any_exit_cycle |= word == "EXITCYCLE";
        let routine = self.full_name(here.file, &word);
        if self.given.contains_key(&routine) || !is_harmless(&word) || word == CLEARS {
            let at = self.common.at(here);
            // What a given one moves to is counted in it.
            if !self.given.contains_key(&routine) {
                self.passed(here, &word, rest);
            }
            steps.push(Step::Call { routine, at });
        }
        self.common.reads(here, rest);
    }

    /// What an instruction of the controller sets.
    fn setting(&mut self, here: &Here<'_>, word: &str, rest: Cursor<'_>) -> Option<(Slot, Known)> {
        let is_off = rest.tokens.iter().any(|token| rest.text(token).eq_ignore_ascii_case(b"OFF"));
        let displaced = |what| unknown(Refusal::Displaced { what });
        Some(match word {
            "PDISPON" | "PDISPSET" => {
                self.any_displaced[0] = true;
                // Where PDispOn begins is where the arm happens to be.
                let is_set = word == "PDISPSET";
                let to = if is_set { self.pose_data(here, rest) } else { displaced("PDisp") };
                (Slot::Displacement, to)
            }
            "PDISPOFF" => (Slot::Displacement, known(Setting::On(false))),
            // They move external axes alone.
            "EOFFSON" | "EOFFSSET" if self.cell.external_axes.is_none() => {
                self.any_displaced[1] = true;
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
        let is_own = self.given.contains_key(&own);
        let named = format!("{}:{name}", self.task(file));
        let found = self.common.full_name(own, &named, is_own);
        if found == named { name.to_owned() } else { found }
    }
}

/// A statement, of a compact IF its instruction.
pub(super) fn without_condition(all: Cursor<'_>) -> Cursor<'_> {
    let is_if = all.peek_name().is_some_and(|word| word == "IF");
    if is_if { instruction(all).unwrap_or(all) } else { all }
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
        let token = &all.tokens[place];
        let is_begin = token.is(b'%') || (token.kind == Kind::Name && !is_operator(place));
        is_begin && ends_value(place - 1)
    })?;
    Some(Cursor { tokens: &all.tokens[place..], ..all })
}

fn ends_in(statement: Cursor<'_>, word: &[u8]) -> bool {
    statement.tokens.last().is_some_and(|token| {
        token.kind == Kind::Name && statement.text(token).eq_ignore_ascii_case(word)
    })
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
