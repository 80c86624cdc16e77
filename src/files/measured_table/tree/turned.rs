//! Records that are written as columns or as lists → records with names.

use std::rc::Rc;

use super::{Map, Node};
use crate::measured_table::{MeasuredTableErrorKind, Result};

/// Records made of columns: an object of lists of one length, or of objects with the keys 0, 1, …; `None` for any other
/// value.
pub(super) fn columns(root: &Node) -> Result<Option<Node>> {
    let Node::Map(map) = root else { return Ok(None) };
    let columns = map.members.iter().map(|(key, node)| Some((key, values(node)?)));
    let columns: Option<Vec<Column>> = columns.collect();
    let Some(columns) = columns.filter(|columns| !columns.is_empty()) else { return Ok(None) };
    let length = same_length(&columns)?;
    let row = |row: usize| {
        let members = columns.iter().map(|(key, column)| (Rc::clone(key), column[row].clone()));
        let (line, members) = (0, members.collect());
        Node::Map(Map { line, members })
    };
    Ok(Some(Node::List((0..length).map(row).collect())))
}

type Column<'d> = (&'d Rc<str>, Vec<&'d Node>);

/// The values of a column; `None` for what is none.
fn values(node: &Node) -> Option<Vec<&Node>> {
    match node {
        Node::List(list) if !list.iter().any(|node| matches!(node, Node::Map(_))) => {
            Some(list.iter().collect())
        }
        Node::Map(inner) if is_counted(inner) => {
            Some(inner.members.iter().map(|(_, node)| node).collect())
        }
        _ => None,
    }
}

/// The length of all columns; an error where they differ.
fn same_length(columns: &[Column]) -> Result<usize> {
    let Some((first, column)) = columns.first() else { return Ok(0) };
    match columns.iter().find(|(_, own)| own.len() != column.len()) {
        None => Ok(column.len()),
        Some((other, own)) => Err(MeasuredTableErrorKind::ColumnLengths {
            first: first.to_string(),
            first_length: column.len(),
            other: other.to_string(),
            other_length: own.len(),
        }),
    }
}

fn is_counted(map: &Map) -> bool {
    let mut members = map.members.iter().enumerate();
    !map.members.is_empty() && members.all(|(number, (key, _))| **key == *number.to_string())
}

/// A list of lists, whose names stand in the first, or in `columns` as pandas writes them; otherwise numbers from 1.
/// `None` for any other value.
pub(super) fn lists(root: &Node) -> Option<Node> {
    let (header, rows) = match root {
        Node::List(rows) => match rows.split_first() {
            Some((Node::List(first), rest)) if first.iter().all(is_text) => (Some(first), rest),
            _ => (None, rows.as_slice()),
        },
        Node::Map(map) => {
            let member = |name: &str| map.members.iter().find(|(key, _)| &**key == name);
            let (Some((_, Node::List(names))), Some((_, Node::List(rows)))) =
                (member("columns"), member("data"))
            else {
                return None;
            };
            (Some(names), rows.as_slice())
        }
        _ => return None,
    };
    let are_lists = rows.iter().all(|row| matches!(row, Node::List(_)));
    let names: Vec<Rc<str>> = (0..width(rows)).map(|place| name(header, place)).collect();
    let record = |row: &Node| {
        let Node::List(row) = row else { return Node::Blank };
        let members = names.iter().cloned().zip(row.iter().cloned());
        let (line, members) = (0, members.collect());
        Node::Map(Map { line, members })
    };
    (are_lists && !names.is_empty()).then(|| Node::List(rows.iter().map(record).collect()))
}

fn is_text(node: &Node) -> bool {
    matches!(node, Node::Text(_))
}

fn width(rows: &[Node]) -> usize {
    let lengths = rows.iter().map(|row| match row {
        Node::List(list) => list.len(),
        _ => 0,
    });
    lengths.max().unwrap_or_default()
}

fn name(header: Option<&Vec<Node>>, place: usize) -> Rc<str> {
    match header.and_then(|names| names.get(place)) {
        Some(Node::Text(text)) => Rc::clone(text),
        _ => (place + 1).to_string().into(),
    }
}
