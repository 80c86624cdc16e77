//! Declarations and values of data lists, and assignments of routines.

use super::Reading;
use crate::lex::{Kind, Token};
use crate::names::{Written, parts};
use crate::reading::Here;
use crate::value::{Cursor, Value};

/// Words before a type.
const BEFORE_TYPE: [&str; 4] = ["DECL", "GLOBAL", "CONST", "PUBLIC"];

/// The lines of a file, each without its end.
pub(super) fn lines(tokens: &[Token]) -> impl Iterator<Item = &[Token]> {
    let lines = tokens.split(|token| token.kind == Kind::LineEnd);
    lines.filter(|line| !line.is_empty())
}

/// The name of the routine that a line begins, and its parameters.
pub(super) fn routine(line: Cursor<'_>) -> Option<(String, Cursor<'_>, bool)> {
    let mut line = line;
    let is_global = line.take_word("GLOBAL");
    let name = match line.take_name()?.as_str() {
        "DEF" => line.take_name()?,
        "DEFFCT" => {
            line.take_name()?;
            if line.take_sign(b'[') {
                line.take_part(b']');
            }
            line.take_name()?
        }
        _ => return None,
    };
    Some((name, line, is_global))
}

/// A line that declares variables or gives one a value.
pub(super) struct Statement<'t> {
    pub(super) kind: Option<String>,
    pub(super) is_global: bool,
    pub(super) names: Vec<String>,
    /// The component that the value is for: `.X`; empty for the variable itself.
    pub(super) part: bool,
    pub(super) value: Option<Cursor<'t>>,
}

/// Reads a declaration or an assignment; `None` for any other line.
pub(super) fn statement(line: Cursor<'_>) -> Option<Statement<'_>> {
    let mut line = line;
    let (mut is_global, mut is_declared) = (false, false);
    while let Some(word) = line.peek_name().filter(|word| BEFORE_TYPE.contains(&word.as_str())) {
        is_global |= word == "GLOBAL";
        is_declared = true;
        line.take();
    }
    let mut ahead = line;
    ahead.take_name()?;
    let kind = if ahead.peek_name().is_some() { line.take_name() } else { None };
    if kind.is_none() && is_declared {
        return None;
    }
    let mut names = Vec::new();
    loop {
        names.push(name(&mut line)?);
        let part = line.take_sign(b'.');
        if part {
            while line.first().is_some_and(|token| !token.is(b'=')) {
                line.take();
            }
        }
        match line.take().map(|token| token.kind) {
            None => {
                return kind.map(|kind| Statement {
                    kind: Some(kind),
                    is_global,
                    names,
                    part,
                    value: None,
                });
            }
            Some(Kind::Sign(b'=')) if !line.first().is_some_and(|token| token.is(b'=')) => {
                return Some(Statement { kind, is_global, names, part, value: Some(line) });
            }
            Some(Kind::Sign(b',')) if kind.is_some() && !part => {}
            _ => return None,
        }
    }
}

/// A name with its element; `[]`, `[1,]` and elements that are worked out become `[?]`.
fn name(line: &mut Cursor<'_>) -> Option<String> {
    let mut ahead = *line;
    if let Some(name) = ahead.element() {
        *line = ahead;
        return Some(name);
    }
    let name = line.take_name()?;
    if !line.take_sign(b'[') {
        return Some(name);
    }
    line.take_part(b']')?;
    Some(format!("{name}[?]"))
}

impl Reading<'_> {
    /// The declarations and values of a file.
    pub(super) fn data(&mut self, file: usize, tokens: &[Token]) {
        let own = &self.common.files[file];
        let is_list = own.is_list();
        let mut inside = None;
        for line in lines(tokens) {
            let cursor = Cursor::new(&own.bytes, line);
            if let Some((name, parameters, is_global)) = routine(cursor) {
                self.routine(file, &name, parameters, is_global || inside.is_none());
                inside = Some(name);
                continue;
            }
            let cursor = super::steps::behind_do(cursor).unwrap_or(cursor);
            if let Some(statement) = statement(cursor) {
                let name = cursor.peek_name().unwrap_or_default();
                if !super::steps::is_keyword(&name) {
                    self.valued(file, inside.as_deref(), is_list, line, &statement);
                }
            }
        }
    }

    /// Marks what calls may change: KRL passes by reference where a routine does not say otherwise.
    pub(super) fn touches(&mut self, file: usize, tokens: &[Token]) {
        let own = &self.common.files[file];
        let mut inside = None;
        for line in lines(tokens) {
            let cursor = Cursor::new(&own.bytes, line);
            if let Some((name, ..)) = routine(cursor) {
                inside = Some(name);
            } else if cursor.peek_name().is_some_and(|word| word == "IMPORT") {
                // A variable of another list, under a name of its own here.
                self.common.names.touch_all(&own.at(line[0].line));
            } else if self.calls_another(file, cursor) {
                let scopes = self.scopes(file, inside.as_deref());
                let here = Here { file, line: line[0].line, scopes: &scopes };
                self.common.touches(&here, cursor);
            }
        }
    }

    fn routine(&mut self, file: usize, name: &str, parameters: Cursor<'_>, is_global: bool) {
        let scope = format!("{}/{name}", self.module(file));
        self.local.insert(scope.clone());
        if is_global {
            self.common.global.entry(name.to_owned()).or_default().push(scope.clone());
        } else {
            self.private.insert(scope.clone());
        }
        let mut rest = parameters;
        rest.take_sign(b'(');
        while let Some(mut parameter) = rest.take_part(b',') {
            if let Some(name) = parameter.take_name() {
                self.common.names.declare(&scope, &name, "").is_parameter = true;
            }
        }
    }

    fn valued(
        &mut self,
        file: usize,
        inside: Option<&str>,
        is_list: bool,
        line: &[Token],
        statement: &Statement<'_>,
    ) {
        let at = self.common.files[file].at(line[0].line);
        let mut scopes = self.scopes(file, inside);
        if statement.is_global || self.common.files[file].is_of_system() {
            scopes = vec![String::new()];
        }
        for name in &statement.names {
            let (own, element) = parts(name);
            if let Some(kind) = &statement.kind {
                self.common.names.declare(&scopes[0], own, kind);
            } else if self.common.names.find(&scopes, own).is_none() {
                // What a routine assigns and no file declares may be another module's.
                let module = self.module(file);
                let scope = if is_list { &scopes[0] } else { &module };
                self.common.names.declare(scope, own, "").is_declared = is_list;
            }
            let Some(variable) = self.common.names.find_mut(&scopes, own) else {
                continue;
            };
            // A value is for the last of several names.
            let Some(value) = statement.value.filter(|_| statement.names.last() == Some(name))
            else {
                continue;
            };
            variable.is_declared |= is_list;
            let span = value.span();
            let value = value.value();
            let is_known = is_list || matches!(value, Value::Fields { .. });
            if element == "[?]" {
                variable.touch("", &at);
            } else if statement.part || !is_known {
                variable.touch(element, &at);
            } else {
                let written = Written { file, line: at.line, value, span };
                variable.values.entry(element.to_owned()).or_default().push(written);
            }
        }
    }
}
