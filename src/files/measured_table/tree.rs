//! Nested values of JSON and YAML → rows with names such as `pose.x` and `joints[0]`.

mod flat;
mod turned;

use std::collections::HashMap;
use std::rc::Rc;

use super::{Counted, Form, MOST_CELLS, MeasuredTable, MeasuredTableErrorKind, Result};
use flat::Flat;

pub(super) const MOST_LEVELS: usize = 64;
/// Most values of a file, aliases counted as often as they stand for one.
pub(super) const MOST_NODES: usize = 1 << 24;

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Node {
    Blank,
    Number(f64),
    /// Aliases share it.
    Text(Rc<str>),
    List(Vec<Node>),
    Map(Map),
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Map {
    /// The line that it begins in, from 1.
    pub(super) line: u64,
    pub(super) members: Vec<(Rc<str>, Node)>,
}

#[derive(Debug, Default)]
pub(super) struct Keys(HashMap<Box<str>, Rc<str>>);

impl Keys {
    pub(super) fn one(&mut self, key: &str) -> Rc<str> {
        if let Some(known) = self.0.get(key) {
            return Rc::clone(known);
        }
        let own: Rc<str> = key.into();
        self.0.insert(key.into(), Rc::clone(&own));
        own
    }
}

/// The values at the top of a file, and how its records are counted.
pub(super) struct Document {
    /// One value; of JSON lines and of YAML in several documents one for each record, with its line.
    pub(super) roots: Vec<(u64, Node)>,
    pub(super) counted: Counted,
}

/// A record: its line or number, its key where it has one, its value.
struct Record<'d> {
    line: u64,
    key: Option<&'d str>,
    node: &'d Node,
}

impl<'d> Record<'d> {
    fn new(number: usize, key: Option<&'d str>, node: &'d Node, counted: Counted) -> Self {
        let line = match node {
            Node::Map(map) if counted == Counted::Line => map.line,
            _ => number as u64 + 1,
        };
        Self { line, key, node }
    }
}

pub(super) fn table(document: &Document, form: &Form) -> Result<MeasuredTable> {
    let [(line, root)] = document.roots.as_slice() else { return rows(document, form, Vec::new()) };
    let (made, remark) = if let Some(named) = turned::lists(root) {
        (named, "its records are lists")
    } else if let Some(turned) = turned::columns(root)? {
        (turned, "its columns are one after the other")
    } else {
        return rows(document, form, Vec::new());
    };
    let document = Document { roots: vec![(*line, made)], counted: Counted::Record };
    rows(&document, form, vec![remark.to_owned()])
}

fn rows(document: &Document, form: &Form, mut remarks: Vec<String>) -> Result<MeasuredTable> {
    let (records, counted) = match document.roots.as_slice() {
        [(_, root)] => (records(root, document.counted, &mut remarks)?, document.counted),
        roots => {
            let records = roots.iter().map(|(line, node)| Record { line: *line, key: None, node });
            (records.collect(), Counted::Line)
        }
    };
    let mut flat = Flat::default();
    for record in &records {
        flat.record(record, counted)?;
    }
    if flat.names.is_empty() {
        return Err(MeasuredTableErrorKind::Empty);
    }
    if flat.names.len().saturating_mul(records.len()) > MOST_CELLS {
        return Err(MeasuredTableErrorKind::TooManyCells);
    }
    flat.table(&records, form, counted, remarks)
}

/// The records under the value at the top.
fn records<'d>(
    root: &'d Node,
    counted: Counted,
    remarks: &mut Vec<String>,
) -> Result<Vec<Record<'d>>> {
    let map = match root {
        Node::List(list) => {
            let nodes = list.iter().enumerate();
            let records = nodes.map(|(number, node)| Record::new(number, None, node, counted));
            return Ok(records.collect());
        }
        Node::Map(map) => map,
        _ => return Err(MeasuredTableErrorKind::NoRecords),
    };
    let mut members = map.members.iter();
    if members.all(|(_, node)| matches!(node, Node::Map(_))) {
        let members = map.members.iter().enumerate();
        let record = |(number, (key, node)): (usize, &'d (Rc<str>, Node))| {
            Record::new(number, Some(&**key), node, counted)
        };
        return Ok(members.map(record).collect());
    }
    match tables(map).as_slice() {
        [] => Ok(vec![Record::new(0, None, root, counted)]),
        [(key, list)] => {
            remarks.push(format!("its records are those of {key:?}"));
            records(list, counted, remarks)
        }
        [(first, _), (second, _), ..] => Err(MeasuredTableErrorKind::SeveralTables {
            first: (*first).to_owned(),
            second: (*second).to_owned(),
        }),
    }
}

fn tables(map: &Map) -> Vec<(&str, &Node)> {
    let is_table = |node: &Node| match node {
        Node::List(list) => list.iter().any(|node| matches!(node, Node::Map(_))),
        _ => false,
    };
    let members = map.members.iter().filter(|(_, node)| is_table(node));
    members.map(|(key, node)| (&**key, node)).collect()
}

#[cfg(test)]
mod tests;
