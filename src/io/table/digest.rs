//! The content of a table → its digest, which each file carries in its metadata as `posegrid.content_digest`.
//!
//! It is of what a reader sees, whichever pages, row groups and encodings hold it: names, types and values of columns, and
//! the entries of the metadata that are posegrid's. So a damaged value is told by the file alone, years later and without
//! its lake. Whoever changes a value can change the digest too: against that stand the digests of files in `runs`.
//!
//! Texts go in behind their length in bytes; numbers, lengths and counts as 64 bits, lowest byte first; all digests are
//! BLAKE3. The digest of a table is of, one behind the other:
//! 1. the text `posegrid table 1`;
//! 2. the number of entries `posegrid.*` but for the digest's own, and each in the order of their keys: key, value;
//! 3. the number of columns, and of each: its name, its type as the schema names it, one byte 1 if it may be null and 0
//!    if not, and the digests of its presence, lengths and values;
//! 4. the number of rows.
//!
//! Presence, lengths and values are sequences over all rows, in which equal neighbours are counted: each run of equal ones
//! goes in as a text and the length of the run.
//! - Presence: one byte for each row, 1 for a value and 0 for null.
//! - Lengths: of each list that is there, how many elements it has, as 64 bits; nothing of a column without lists.
//! - Values: of each value or element that is there, one byte 1 or 0 of a truth value, or the text. Numbers are not
//!   counted: each goes in as its 64 bits.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, RecordBatch};
use arrow::buffer::Buffer;
use arrow::datatypes::{ArrowNativeType, Float64Type, Int64Type};
use blake3::Hasher;
use rayon::prelude::*;

use super::{Table, same};
use crate::io::schema::{ColumnSchema, ColumnType, TableSchema};

/// The entry of a file's metadata that has the digest.
pub(super) const ENTRY: &str = "posegrid.content_digest";

/// What the keys of our own entries begin with.
const OWN: &str = "posegrid.";

/// What the digest begins with; another way to digest will begin with another number.
const FORM: &str = "posegrid table 1";

/// The digest of a table that comes in parts.
pub(super) struct ContentDigest {
    columns: Vec<ColumnDigest>,
    rows: u64,
}

/// The digest of the table with these entries in its file's metadata, hexadecimal.
pub(super) fn of_file(table: &Table, entries: &[(String, String)]) -> String {
    let mut digest = ContentDigest::new(table.schema, table.version, &[]);
    digest.add(&[&table.batch]);
    digest.finish(entries)
}

/// The digest of a table's columns but for some, hexadecimal; of the metadata only the table's name and version.
pub(super) fn of_columns(table: &Table, except: &[&str]) -> String {
    let mut digest = ContentDigest::new(table.schema, table.version, except);
    digest.add(&[&table.batch]);
    let entry = |name: &str, value: String| (format!("{OWN}{name}"), value);
    digest.finish(&[
        entry("table", table.schema.table.clone()),
        entry("schema_version", table.version.to_string()),
    ])
}

impl ContentDigest {
    /// Of a table as that version of it has it, but for some columns.
    pub(super) fn new(schema: &TableSchema, version: u32, except: &[&str]) -> Self {
        let columns = schema.columns.iter().enumerate();
        let own =
            columns.filter(|(_, own)| own.is_in(version) && !except.contains(&own.name.as_str()));
        Self {
            columns: own
                .map(|(place, own)| ColumnDigest::new(place, own))
                .collect(),
            rows: 0,
        }
    }

    /// Adds rows behind those before; column beside column, on all threads.
    pub(super) fn add(&mut self, parts: &[&RecordBatch]) {
        let add = |column: &mut ColumnDigest| {
            for part in parts {
                column.add(part.column(column.place));
            }
        };
        self.columns.par_iter_mut().for_each(add);
        self.rows += parts.iter().map(|part| part.num_rows() as u64).sum::<u64>();
    }

    /// The same of a single part, on this thread alone.
    pub(super) fn add_here(&mut self, part: &RecordBatch) {
        for column in &mut self.columns {
            column.add(part.column(column.place));
        }
        self.rows += part.num_rows() as u64;
    }

    /// How many rows were added.
    pub(super) const fn rows(&self) -> u64 {
        self.rows
    }

    /// The digest of all rows and the metadata, hexadecimal.
    pub(super) fn finish(self, entries: &[(String, String)]) -> String {
        let mut own: Vec<_> = entries
            .iter()
            .filter(|(key, _)| key.starts_with(OWN) && key != ENTRY)
            .collect();
        own.sort();
        let mut whole = Hasher::new();
        text(&mut whole, FORM.as_bytes());
        number(&mut whole, own.len() as u64);
        for (key, value) in own {
            text(&mut whole, key.as_bytes());
            text(&mut whole, value.as_bytes());
        }
        number(&mut whole, self.columns.len() as u64);
        for column in self.columns {
            column.finish(&mut whole);
        }
        number(&mut whole, self.rows);
        whole.finalize().to_hex().to_string()
    }
}

/// The digest of one column.
struct ColumnDigest {
    place: usize,
    name: String,
    kind: ColumnType,
    nullable: bool,
    presence: Runs,
    lengths: Runs,
    values: Values,
    /// The array that came last, where it has one text in all rows: where it comes again it need not be looked at.
    latest: Option<ArrayRef>,
}

/// The values of a column that are there.
enum Values {
    Numbers(Box<Hasher>),
    Counted(Runs),
}

impl ColumnDigest {
    fn new(place: usize, column: &ColumnSchema) -> Self {
        Self {
            place,
            name: column.name.clone(),
            kind: column.kind,
            nullable: column.nullable,
            presence: Runs::default(),
            lengths: Runs::default(),
            values: if column.kind.is_number() {
                Values::Numbers(Box::default())
            } else {
                Values::Counted(Runs::default())
            },
            latest: None,
        }
    }

    fn add(&mut self, array: &ArrayRef) {
        self.add_presence(array);
        if array.null_count() == array.len() {
            return;
        }
        let spans = present(array);
        let Some(lists) = array.as_list_opt::<i32>() else {
            for (start, end) in spans {
                self.add_values(array, start, end);
            }
            return;
        };
        let bounds = lists.value_offsets();
        for (start, end) in spans {
            for row in bounds[start..=end].windows(2) {
                let length = (row[1] - row[0]).as_usize() as u64;
                self.lengths.add(&length.to_le_bytes(), 1);
            }
            let (first, last) = (bounds[start].as_usize(), bounds[end].as_usize());
            self.add_values(lists.values(), first, last);
        }
    }

    fn add_presence(&mut self, array: &ArrayRef) {
        match array.nulls().filter(|nulls| nulls.null_count() > 0) {
            None => self.presence.add(&[1], array.len() as u64),
            Some(nulls) if nulls.null_count() == array.len() => {
                self.presence.add(&[0], array.len() as u64);
            }
            Some(nulls) => nulls
                .iter()
                .for_each(|there| self.presence.add(&[u8::from(there)], 1)),
        }
    }

    /// Values that are all there, from one place up to another.
    fn add_values(&mut self, array: &ArrayRef, start: usize, end: usize) {
        match (&mut self.values, self.kind) {
            (Values::Numbers(hasher), ColumnType::Float64 | ColumnType::ListFloat64) => {
                let numbers = array.as_primitive::<Float64Type>();
                let bytes = |number: f64| number.to_le_bytes();
                add_numbers(
                    hasher,
                    &numbers.values()[start..end],
                    numbers.values().inner(),
                    start,
                    bytes,
                );
            }
            (Values::Numbers(hasher), _) => {
                let numbers = array.as_primitive::<Int64Type>();
                let bytes = |number: i64| number.to_le_bytes();
                add_numbers(
                    hasher,
                    &numbers.values()[start..end],
                    numbers.values().inner(),
                    start,
                    bytes,
                );
            }
            (Values::Counted(runs), ColumnType::Bool) => {
                let truths = array.as_boolean();
                (start..end).for_each(|row| runs.add(&[u8::from(truths.value(row))], 1));
            }
            (Values::Counted(runs), _) => {
                let known = self.latest.as_ref();
                let known = known
                    .is_some_and(|known| std::ptr::addr_eq(Arc::as_ptr(known), Arc::as_ptr(array)));
                let texts = array.as_string::<i32>();
                let is_whole = (start, end) == (0, array.len()) && start < end;
                if is_whole && (known || same::text(texts).is_some()) {
                    runs.add(texts.value(0).as_bytes(), texts.len() as u64);
                    self.latest = Some(Arc::clone(array));
                } else {
                    (start..end).for_each(|row| runs.add(texts.value(row).as_bytes(), 1));
                }
            }
        }
    }

    fn finish(self, whole: &mut Hasher) {
        text(whole, self.name.as_bytes());
        text(whole, self.kind.name().as_bytes());
        whole.update(&[u8::from(self.nullable)]);
        whole.update(self.presence.finish().as_bytes());
        whole.update(self.lengths.finish().as_bytes());
        let values = match self.values {
            Values::Numbers(hasher) => hasher.finalize(),
            Values::Counted(runs) => runs.finish(),
        };
        whole.update(values.as_bytes());
    }
}

/// Where values are there, from one row up to another, in order.
fn present(array: &ArrayRef) -> Vec<(usize, usize)> {
    match array.nulls().filter(|nulls| nulls.null_count() > 0) {
        None => vec![(0, array.len())],
        Some(nulls) => nulls.valid_slices().collect(),
    }
}

/// Numbers as 64 bits each, lowest byte first; in memory they stand so on nearly every processor.
fn add_numbers<N: Copy>(
    hasher: &mut Hasher,
    numbers: &[N],
    buffer: &Buffer,
    start: usize,
    bytes: impl Fn(N) -> [u8; 8],
) {
    if cfg!(target_endian = "little") {
        hasher.update(&buffer.as_slice()[8 * start..8 * (start + numbers.len())]);
    } else {
        for &number in numbers {
            hasher.update(&bytes(number));
        }
    }
}

/// A sequence in which equal neighbours are counted.
#[derive(Default)]
struct Runs {
    hasher: Hasher,
    value: Vec<u8>,
    count: u64,
}

impl Runs {
    /// So many equal ones more.
    fn add(&mut self, value: &[u8], count: u64) {
        if self.value != value {
            self.end();
            value.clone_into(&mut self.value);
        }
        self.count += count;
    }

    fn end(&mut self) {
        if self.count > 0 {
            text(&mut self.hasher, &self.value);
            number(&mut self.hasher, self.count);
            self.count = 0;
        }
    }

    fn finish(mut self) -> blake3::Hash {
        self.end();
        self.hasher.finalize()
    }
}

fn text(hasher: &mut Hasher, text: &[u8]) {
    number(hasher, text.len() as u64);
    hasher.update(text);
}

fn number(hasher: &mut Hasher, number: u64) {
    hasher.update(&number.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::schema;
    use crate::io::table::Columns;
    use crate::manifest::RunKey;

    /// Rows with nulls, texts that repeat, truth values, and lists that are absent, empty and of several lengths.
    fn parameters(rows: usize, change: impl Fn(usize, &str) -> bool) -> Table {
        let number =
            |row: usize, name: &str| row as f64 / 7.0 + f64::from(u8::from(change(row, name)));
        let names: Vec<String> = (0..rows)
            .map(|row| {
                if change(row, "parameter") {
                    format!("p{row}x")
                } else {
                    format!("p{row}")
                }
            })
            .collect();
        let confounded = (0..rows).map(|row| -> Vec<String> {
            let count = row % 3 + usize::from(change(row, "confounded"));
            (0..count).map(|other| format!("{other}")).collect()
        });
        Columns::new(schema::find("parameters").unwrap(), rows)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .same("model", "geometric")
            .column("parameter_index", 0..rows)
            .column("parameter", names.iter().map(String::as_str))
            .same("belongs_to", "link")
            .column(
                "of_session",
                (0..rows).map(|row| (row % 2 == 0 || change(row, "of_session")).then_some("grid")),
            )
            .column("joint", (0..rows).map(|row| (row % 5 > 0).then_some(row)))
            .same("quantity", "theta")
            .same("unit", "rad")
            .same("nominal", 0.0)
            .column("identified", (0..rows).map(|row| number(row, "identified")))
            .column("offset", (0..rows).map(|row| number(row, "offset")))
            .column(
                "standard_error",
                (0..rows).map(|row| (row % 4 > 0).then(|| number(row, "standard_error"))),
            )
            .absent(["prior_sd", "most_correlated_with", "correlation"])
            .same("identifiability", "told_apart")
            .column("confused_with", confounded)
            .finish()
            .unwrap()
    }

    fn in_parts(table: &Table, parts: usize) -> String {
        let mut digest = ContentDigest::new(table.schema, table.version, &[]);
        let rows = table.rows().div_ceil(parts);
        let firsts = (0..table.rows()).step_by(rows);
        let slices = firsts.map(|first| table.batch.slice(first, rows.min(table.rows() - first)));
        let slices: Vec<RecordBatch> = slices.collect();
        let (one, others) = slices.split_first().unwrap();
        digest.add_here(one);
        digest.add(&others.iter().collect::<Vec<_>>());
        digest.finish(&[])
    }

    #[test]
    fn parts_and_threads_leave_no_trace() {
        let table = parameters(61, |_, _| false);
        let whole = of_file(&table, &[]);
        for parts in [1, 2, 3, 7, 61] {
            assert_eq!(in_parts(&table, parts), whole, "{parts} parts");
        }
    }

    #[test]
    fn every_value_length_null_and_entry_counts() {
        let digest = |own: &str| of_file(&parameters(9, |row, name| row == 4 && name == own), &[]);
        let mut seen = vec![digest("nothing")];
        for changed in [
            "parameter",
            "confounded",
            "of_session",
            "identified",
            "offset",
            "standard_error",
        ] {
            let own = digest(changed);
            // What row 4 has in of_session is there already.
            assert_eq!(
                seen.contains(&own),
                changed == "of_session" || changed == "standard_error",
                "{changed}"
            );
            seen.push(own);
        }
        let odd = of_file(
            &parameters(9, |row, name| row == 5 && name == "of_session"),
            &[],
        );
        assert!(!seen.contains(&odd), "a null less");
        let table = parameters(9, |_, _| false);
        let entry = |key: &str, value: &str| [(key.to_owned(), value.to_owned())];
        let told = of_file(&table, &entry("posegrid.units", "{}"));
        assert_ne!(told, seen[0]);
        assert_ne!(told, of_file(&table, &entry("posegrid.units", "[]")));
        // Entries of other programs, and the digest itself, do not count.
        assert_eq!(of_file(&table, &entry("pandas", "{}")), seen[0]);
        assert_eq!(of_file(&table, &entry(ENTRY, "00")), seen[0]);
        assert_ne!(of_columns(&table, &["offset"]), of_columns(&table, &[]));
    }

    #[test]
    fn neighbours_that_look_alike_in_a_row_are_told_apart() {
        let runs = |values: &[&str]| {
            let mut runs = Runs::default();
            values
                .iter()
                .for_each(|value| runs.add(value.as_bytes(), 1));
            runs.finish()
        };
        assert_ne!(runs(&["ab", "c"]), runs(&["a", "bc"]));
        assert_ne!(runs(&["a", "a"]), runs(&["a"]));
        assert_ne!(runs(&[""]), runs(&[]));
        let mut counted = Runs::default();
        counted.add(b"a", 1);
        counted.add(b"a", 2);
        assert_eq!(counted.finish(), runs(&["a", "a", "a"]));
    }
}
