//! Declarations of modules and routines, and everything that may change what they declare.

use super::Reading;
use super::statement::{Header, Statement, assignment, header};
use crate::lex::{Kind, capitals};
use crate::names::{Variable, Written};
use crate::reading::{Here, called};
use crate::value::{Cursor, Value};

/// A declaration: `LOCAL PERS wobjdata wobj1 := […]`.
pub(super) struct Declaration<'t> {
    is_local: bool,
    kind: String,
    name: String,
    /// How many indices an element has.
    dimensions: usize,
    value: Option<Cursor<'t>>,
}

pub(super) fn declaration<'t>(statement: &Statement<'t>) -> Option<Declaration<'t>> {
    let mut all = statement.all;
    let mut is_local = false;
    while let Some(word) = all.peek_name().filter(|word| matches!(word.as_str(), "LOCAL" | "TASK"))
    {
        is_local |= word == "LOCAL";
        all.take();
    }
    if !matches!(all.take_name()?.as_str(), "CONST" | "PERS" | "VAR") {
        return None;
    }
    let kind = all.take_name()?;
    let name = all.take_name()?;
    let mut dimensions = 0;
    if all.take_sign(b'{') {
        let inside = all.take_part(b'}')?;
        dimensions = 1 + inside.tokens.iter().filter(|token| token.is(b',')).count();
    }
    let is_valued = all.take_sign(b':') && all.take_sign(b'=');
    Some(Declaration { is_local, kind, name, dimensions, value: is_valued.then_some(all) })
}

/// Values of elements with their indices.
fn elements(value: Value, dimensions: usize, index: &[usize], into: &mut Vec<(String, Value)>) {
    if dimensions == 0 {
        let indices: Vec<String> = index.iter().map(usize::to_string).collect();
        let name =
            if index.is_empty() { String::new() } else { format!("[{}]", indices.join(",")) };
        into.push((name, value));
        return;
    }
    let Value::List(values) = value else {
        return;
    };
    for (place, value) in values.into_iter().enumerate() {
        let own: Vec<usize> = index.iter().copied().chain([place + 1]).collect();
        elements(value, dimensions - 1, &own, into);
    }
}

impl Reading<'_> {
    pub(super) fn data(&mut self, file: usize, statements: &[Statement<'_>]) {
        let mut inside = None;
        for statement in statements {
            if let Some(header) = header(statement) {
                self.routine(file, statement.line, &header);
                inside = Some(header.name);
            } else if let Some(declaration) = declaration(statement) {
                self.declared(file, inside.as_deref(), statement, &declaration);
            } else if is_end(statement) {
                inside = None;
            }
        }
    }

    fn routine(&mut self, file: usize, line: u32, header: &Header<'_>) {
        let full = format!("{}/{}", self.module(file), header.name);
        if header.is_trap {
            self.traps.push((full.clone(), self.common.files[file].at(line)));
        }
        if !header.is_local {
            let name = format!("{}:{}", self.task(file), header.name);
            self.common.global.entry(name).or_default().push(full.clone());
        }
        if header.is_procedure {
            self.procedures.insert(full.clone());
            self.named.insert(header.name.clone());
        }
        let mut rest = header.parameters;
        let mut changes = false;
        for token in rest.tokens.iter().filter(|token| token.kind == Kind::Name) {
            let word = crate::lex::capitals(rest.text(token));
            changes |= matches!(word.as_str(), "INOUT" | "VAR" | "PERS");
        }
        while let Some(part) = rest.take_part(b',') {
            // The name stands before the end, or before the braces of an array: all names of it do no harm.
            for token in part.tokens.iter().filter(|token| token.kind == Kind::Name) {
                let name = crate::lex::capitals(part.text(token));
                self.common.names.declare(&full, &name, "").is_parameter = true;
            }
        }
        self.given.insert(full, changes);
    }

    fn declared(
        &mut self,
        file: usize,
        inside: Option<&str>,
        statement: &Statement<'_>,
        declaration: &Declaration<'_>,
    ) {
        let scopes = self.scopes(file, inside);
        let is_everywhere = inside.is_none() && !declaration.is_local;
        let scope = if is_everywhere { self.task(file) } else { scopes[0].clone() };
        let variable = self.common.names.declare(&scope, &declaration.name, &declaration.kind);
        let Some(declared) = declaration.value else {
            return;
        };
        let span = declared.span();
        let mut all = Vec::new();
        elements(declared.value(), declaration.dimensions, &[], &mut all);
        for (element, value) in all {
            let first = value.first_number().map(|number| number.span.start);
            let line = first.and_then(|first| declared.line_at(first)).unwrap_or(statement.line);
            let written = Written { file, line, value, span: span.clone() };
            variable.values.entry(element).or_default().push(written);
        }
    }

    /// Marks what statements may change.
    pub(super) fn touches(&mut self, file: usize, statements: &[Statement<'_>]) {
        let mut inside = None;
        for statement in statements {
            if let Some(header) = header(statement) {
                inside = Some(header.name);
                continue;
            }
            let scopes = self.scopes(file, inside.as_deref());
            let here = Here { file, line: statement.line, scopes: &scopes };
            let own = super::steps::without_condition(statement.all);
            if let Some(declaration) = declaration(statement) {
                if let Some(value) = declaration.value {
                    self.common.reads(&here, value);
                }
            } else if let Some((left, value)) = assignment(own) {
                if self.is_as_declared(&here, left, value) {
                    continue;
                }
                let name = Cursor { tokens: &left.tokens[..1], ..left };
                self.common.touches(&here, name);
                self.touch_shared(&here, name);
            } else if let Some(found) = self.found(own) {
                self.common.touches(&here, found);
                self.touch_shared(&here, found);
            } else if super::steps::writes_by_name(own) {
                let at = self.common.at(&here);
                self.common.names.touch_all(&at);
            } else if self.is_unknown(file, own) {
                self.common.touches(&here, own);
                self.touch_shared(&here, own);
            }
            let all = statement.all;
            if called(all).any(|name| super::steps::is_writing(&name)) {
                self.common.touches(&here, all);
                self.touch_shared(&here, all);
            }
            for arguments in self.passed_on(file, all) {
                self.common.touches(&here, arguments);
                self.touch_shared(&here, arguments);
            }
            // What a parameter is passed on to may change it.
            if self.changing(file, statement.all).next().is_some() {
                self.common.touches(&Here { scopes: &scopes[..1], ..here }, statement.all);
            }
        }
    }

    /// What a statement passes to functions in no file, which may change it.
    fn passed_on<'t>(&self, file: usize, statement: Cursor<'t>) -> Vec<Cursor<'t>> {
        let mut rest = statement;
        let mut all = Vec::new();
        while let Some(token) = rest.take() {
            let mut inside = rest;
            let is_call = token.kind == Kind::Name && inside.take_sign(b'(');
            if is_call && self.is_unseen(file, &capitals(statement.text(token))) {
                all.extend(inside.take_part(b')'));
            }
        }
        all
    }

    /// Whether a function is in no file, and none of the controller's.
    pub(super) fn is_unseen(&self, file: usize, name: &str) -> bool {
        let full = self.full_name(file, name);
        !self.given.contains_key(&full) && !super::steps::is_function(name)
    }

    /// Whether a tool, a work object or a displacement is set to what its declaration states, as off-line tools do it.
    fn is_as_declared(&self, here: &Here<'_>, left: Cursor<'_>, value: Cursor<'_>) -> bool {
        let [name] = left.tokens else { return false };
        let name = capitals(left.text(name));
        let names = &self.common.names;
        let is_frame =
            |own: &Variable| matches!(own.kind.as_str(), "POSE" | "TOOLDATA" | "WOBJDATA");
        names.find(here.scopes, &name).is_some_and(is_frame)
            && names
                .constant(here.scopes, &name, self.common.files, "")
                .is_ok_and(|own| own.value.is_same(&value.value()))
    }

    /// Marks what calls of given routines may change, wherever in a statement they stand.
    pub(super) fn calls(&mut self, file: usize, statements: &[Statement<'_>]) {
        let mut inside = None;
        for statement in statements {
            if let Some(header) = header(statement) {
                inside = Some(header.name);
                continue;
            }
            let all = statement.all;
            let names = &self.common.names;
            if self.changing(file, all).any(|full| names.changes_parameters(&full)) {
                let scopes = self.scopes(file, inside.as_deref());
                let here = Here { file, line: statement.line, scopes: &scopes };
                self.common.touches(&here, all);
                self.touch_shared(&here, all);
            }
        }
    }

    /// A PERS of several tasks is one: what one task changes is changed for all.
    fn touch_shared(&mut self, here: &Here<'_>, statement: Cursor<'_>) {
        let own = self.task(here.file);
        if own.is_empty() {
            return;
        }
        let others: Vec<String> = self.tasks.iter().filter(|task| **task != own).cloned().collect();
        for task in others {
            self.common.touches(&Here { scopes: &[task], ..*here }, statement);
        }
    }

    /// The routines among those given which a statement calls, and which may change what they take.
    fn changing(&self, file: usize, all: Cursor<'_>) -> impl Iterator<Item = String> {
        let begin = super::steps::without_condition(all).peek_name();
        let full =
            begin.into_iter().chain(called(all)).map(move |name| self.full_name(file, &name));
        full.filter(|full| self.given.get(full) == Some(&true))
    }

    /// Whether a statement calls a routine that is not given, and may change whatever it takes.
    fn is_unknown(&self, file: usize, statement: Cursor<'_>) -> bool {
        let Some(word) = statement.peek_name() else {
            return true;
        };
        let is_known = super::steps::is_word(&word)
            || self.is_motion(&word)
            || super::steps::is_harmless(&word) && !super::steps::is_writing(&word);
        !is_known && !self.given.contains_key(&self.full_name(file, &word))
    }
}

pub(super) fn is_end(statement: &Statement<'_>) -> bool {
    let word = statement.all.peek_name().unwrap_or_default();
    matches!(word.as_str(), "ENDPROC" | "ENDFUNC" | "ENDTRAP")
}
