use std::collections::HashMap;
use std::fmt::Write as _;

use super::{Node, Record};
use crate::measured_table::fill::{self, Filling};
use crate::measured_table::head::Head;
use crate::measured_table::number::Numbers;
use crate::measured_table::{
    Cell, Counted, Form, LONGEST_NAME, LeftOutFor, MOST_COLUMNS, MeasuredTable,
    MeasuredTableErrorKind, Result,
};

#[derive(Default)]
pub(super) struct Flat<'d> {
    pub(super) names: Vec<String>,
    places: HashMap<String, usize>,
    values: Vec<(usize, Cell<'d>)>,
    /// The end of each record among the values; `None` for one that is no object.
    ends: Vec<Option<usize>>,
    /// The record that each column was given a value in last, from 1.
    given: Vec<usize>,
}

impl<'d> Flat<'d> {
    pub(super) fn record(&mut self, record: &Record<'d>, counted: Counted) -> Result<()> {
        if !matches!(record.node, Node::Map(_)) {
            self.ends.push(None);
            return Ok(());
        }
        let mut path = String::new();
        let key = record.key.map_or(Ok(()), |key| self.value("key", Cell::Text(key)));
        let flat = key.and_then(|()| self.flatten(&mut path, record.node));
        self.ends.push(Some(self.values.len()));
        flat.map_err(|problem| problem.at(counted.word(), record.line))
    }

    fn flatten(&mut self, path: &mut String, node: &'d Node) -> Result<(), Flattened> {
        let stem = path.len();
        match node {
            Node::Blank => return self.value(path, Cell::Blank),
            Node::Number(number) => return self.value(path, Cell::Number(*number)),
            Node::Text(text) => return self.value(path, Cell::Text(text)),
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

    fn value(&mut self, path: &str, value: Cell<'d>) -> Result<(), Flattened> {
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

    pub(super) fn table(
        self,
        records: &[Record<'_>],
        form: &Form,
        counted: Counted,
        remarks: Vec<String>,
    ) -> Result<MeasuredTable> {
        let head = Head::of(self.names.iter().map(|name| name.trim().to_owned()).collect());
        let texts = self.values.iter().filter_map(|(_, value)| match value {
            Cell::Text(text) => Some(*text),
            _ => None,
        });
        let fill = |numbers| self.fill(&head, records, numbers);
        fill::filled(form.decimal, texts, fill)?.table(counted, remarks)
    }

    fn fill<'h>(
        &self,
        head: &'h Head,
        records: &[Record<'_>],
        numbers: Numbers,
    ) -> Result<Filling<'h>> {
        let mut filling = Filling::new(head, numbers);
        let mut row = vec![Cell::Blank; self.names.len()];
        let mut start = 0;
        for (record, end) in records.iter().zip(&self.ends) {
            let Some(end) = *end else {
                filling.leave_out(record.line, LeftOutFor::NoObject)?;
                continue;
            };
            let own = &self.values[start..end];
            start = end;
            for &(place, value) in own {
                row[place] = value;
            }
            filling.record(record.line, &row)?;
            for &(place, _) in own {
                row[place] = Cell::Blank;
            }
        }
        Ok(filling)
    }
}

enum Flattened {
    Twice(String),
    Columns,
    Name,
}

impl Flattened {
    fn at(self, counted: &'static str, line: u64) -> MeasuredTableErrorKind {
        match self {
            Self::Twice(key) => MeasuredTableErrorKind::KeyTwice { counted, line, key },
            Self::Name => MeasuredTableErrorKind::LongName { counted, line },
            Self::Columns => MeasuredTableErrorKind::TooManyColumns { found: MOST_COLUMNS + 1 },
        }
    }
}
