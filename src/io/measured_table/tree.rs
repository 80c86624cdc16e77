//! Nested values of JSON and YAML → rows: each record is flattened, so that its values get names such as `pose.x` and
//! `joints[0]`.

mod turned;

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::rc::Rc;

use super::fill::{Filling, Written};
use super::head::Head;
use super::number::Numbers;
use super::{
    Counted, Form, LONGEST_NAME, LeftOutFor, MOST_CELLS, MOST_COLUMNS, MeasuredTable,
    MeasuredTableErrorKind,
};

/// Most levels of nested values.
pub(super) const MOST_LEVELS: usize = 64;
/// Most values of a file, aliases counted as often as they stand for one.
pub(super) const MOST_NODES: usize = 1 << 24;

/// A value of JSON or YAML.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Node {
    Blank,
    Number(f64),
    /// Aliases share it.
    Text(Rc<str>),
    List(Vec<Node>),
    Map(Map),
}

/// An object, or a mapping.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Map {
    /// The line that it begins in, from 1.
    pub(super) line: u64,
    pub(super) members: Vec<(Rc<str>, Node)>,
}

/// Texts of keys, each kept once.
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

/// The table in a document.
pub(super) fn table(
    document: &Document,
    form: &Form,
) -> Result<MeasuredTable, MeasuredTableErrorKind> {
    let [(line, root)] = document.roots.as_slice() else {
        return rows(document, form, Vec::new());
    };
    let (made, remark) = if let Some(named) = turned::lists(root) {
        (named, "its records are lists")
    } else if let Some(turned) = turned::columns(root)? {
        (turned, "its columns are one after the other")
    } else {
        return rows(document, form, Vec::new());
    };
    let document = Document {
        roots: vec![(*line, made)],
        counted: Counted::Record,
    };
    rows(&document, form, vec![remark.to_owned()])
}

fn rows(
    document: &Document,
    form: &Form,
    mut remarks: Vec<String>,
) -> Result<MeasuredTable, MeasuredTableErrorKind> {
    let (records, counted) = match document.roots.as_slice() {
        [(_, root)] => (
            records(root, document.counted, &mut remarks)?,
            document.counted,
        ),
        roots => (documents(roots), Counted::Line),
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

fn documents(roots: &[(u64, Node)]) -> Vec<Record<'_>> {
    let records = roots.iter().map(|(line, node)| Record {
        line: *line,
        key: None,
        node,
    });
    records.collect()
}

/// The records under the value at the top.
fn records<'d>(
    root: &'d Node,
    counted: Counted,
    remarks: &mut Vec<String>,
) -> Result<Vec<Record<'d>>, MeasuredTableErrorKind> {
    let place = |number: usize, node: &Node| match node {
        Node::Map(map) if counted == Counted::Line => map.line,
        _ => number as u64 + 1,
    };
    let map = match root {
        Node::List(list) => {
            let records = list.iter().enumerate().map(|(number, node)| Record {
                line: place(number, node),
                key: None,
                node,
            });
            return Ok(records.collect());
        }
        Node::Map(map) => map,
        _ => return Err(MeasuredTableErrorKind::NoRecords),
    };
    if map
        .members
        .iter()
        .all(|(_, node)| matches!(node, Node::Map(_)))
    {
        let members = map.members.iter().enumerate();
        let records = members.map(|(number, (key, node))| Record {
            line: place(number, node),
            key: Some(&**key),
            node,
        });
        return Ok(records.collect());
    }
    match tables(map).as_slice() {
        [] => Ok(vec![Record {
            line: place(0, root),
            key: None,
            node: root,
        }]),
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

/// Members that are lists of objects.
fn tables(map: &Map) -> Vec<(&str, &Node)> {
    let is_table = |node: &Node| match node {
        Node::List(list) => list.iter().any(|node| matches!(node, Node::Map(_))),
        _ => false,
    };
    let members = map.members.iter().filter(|(_, node)| is_table(node));
    members.map(|(key, node)| (&**key, node)).collect()
}

/// Values of all records, each with its column.
#[derive(Default)]
struct Flat<'d> {
    names: Vec<String>,
    places: HashMap<String, usize>,
    /// Columns and values, record by record.
    values: Vec<(usize, Value<'d>)>,
    /// The end of each record among the values; `None` for one that is no object.
    ends: Vec<Option<usize>>,
    /// The record that each column was given a value in last, from 1.
    given: Vec<usize>,
}

/// A value that holds no others.
#[derive(Debug, Clone, Copy)]
enum Value<'d> {
    Blank,
    Number(f64),
    Text(&'d str),
}

impl<'d> Flat<'d> {
    fn record(
        &mut self,
        record: &Record<'d>,
        counted: Counted,
    ) -> Result<(), MeasuredTableErrorKind> {
        if !matches!(record.node, Node::Map(_)) {
            self.ends.push(None);
            return Ok(());
        }
        let mut path = String::new();
        let key = record
            .key
            .map_or(Ok(()), |key| self.value("key", Value::Text(key)));
        let flat = key.and_then(|()| self.flatten(&mut path, record.node));
        self.ends.push(Some(self.values.len()));
        flat.map_err(|problem| match problem {
            Flattened::Twice(key) => MeasuredTableErrorKind::KeyTwice {
                counted: counted.word(),
                line: record.line,
                key,
            },
            Flattened::Name => MeasuredTableErrorKind::LongName {
                counted: counted.word(),
                line: record.line,
            },
            Flattened::Columns => MeasuredTableErrorKind::TooManyColumns {
                found: MOST_COLUMNS + 1,
            },
        })
    }

    fn flatten(&mut self, path: &mut String, node: &'d Node) -> Result<(), Flattened> {
        let stem = path.len();
        match node {
            Node::Blank => return self.value(path, Value::Blank),
            Node::Number(number) => return self.value(path, Value::Number(*number)),
            Node::Text(text) => return self.value(path, Value::Text(text)),
            Node::List(list) => {
                for (index, node) in list.iter().enumerate() {
                    let _ = write!(path, "[{index}]");
                    self.flatten(path, node)?;
                    path.truncate(stem);
                }
            }
            Node::Map(map) => {
                for (key, node) in &map.members {
                    if stem > 0 {
                        path.push('.');
                    }
                    path.push_str(key);
                    self.flatten(path, node)?;
                    path.truncate(stem);
                }
            }
        }
        Ok(())
    }

    fn value(&mut self, path: &str, value: Value<'d>) -> Result<(), Flattened> {
        if path.len() > LONGEST_NAME {
            return Err(Flattened::Name);
        }
        let place = match self.places.get(path) {
            Some(&place) => place,
            None if self.names.len() == MOST_COLUMNS => return Err(Flattened::Columns),
            None => {
                self.places.insert(path.to_owned(), self.names.len());
                self.names.push(path.to_owned());
                self.given.push(0);
                self.names.len() - 1
            }
        };
        let record = self.ends.len() + 1;
        if self.given[place] == record {
            return Err(Flattened::Twice(path.to_owned()));
        }
        self.given[place] = record;
        self.values.push((place, value));
        Ok(())
    }

    fn table(
        self,
        records: &[Record<'_>],
        form: &Form,
        counted: Counted,
        remarks: Vec<String>,
    ) -> Result<MeasuredTable, MeasuredTableErrorKind> {
        let head = Head::of(
            self.names
                .iter()
                .map(|name| name.trim().to_owned())
                .collect(),
        );
        let mut filling = Filling::new(&head, Numbers::with(form.decimal.unwrap_or('.')));
        let mut row = vec![Value::Blank; self.names.len()];
        let mut start = 0;
        for (record, end) in records.iter().zip(self.ends) {
            let Some(end) = end else {
                filling.leave_out(record.line, LeftOutFor::NoObject);
                continue;
            };
            let own = &self.values[start..end];
            start = end;
            for &(place, value) in own {
                row[place] = value;
            }
            filling.record(record.line, &row)?;
            for &(place, _) in own {
                row[place] = Value::Blank;
            }
        }
        filling.table(counted, remarks)
    }
}

/// Why a record cannot be flattened.
enum Flattened {
    /// A name is given two values.
    Twice(String),
    /// There are too many columns.
    Columns,
    /// A name is too long.
    Name,
}

impl Written for Value<'_> {
    fn is_blank(&self) -> bool {
        matches!(self, Self::Blank | Self::Text(""))
    }

    fn number(&self, numbers: &Numbers) -> Option<f64> {
        match self {
            Self::Blank => None,
            Self::Number(number) => Some(*number),
            Self::Text(text) => numbers.parse(text.trim().as_bytes()),
        }
    }

    fn text(&self) -> Cow<'_, str> {
        match self {
            Self::Blank => Cow::Borrowed(""),
            Self::Number(number) => Cow::Owned(number.to_string()),
            Self::Text(text) => Cow::Borrowed(text.trim()),
        }
    }
}

#[cfg(test)]
mod tests;
