//! The content of a table → its digest, which each file carries in its metadata as `posegrid.content_digest`: names,
//! types and values of columns, and posegrid's entries of the metadata, in whichever pages and encodings. Whoever
//! changes a value can change the digest too: the digests of files in `runs` protect against that.
//!
//! Texts are hashed after their length in bytes; numbers, lengths and counts as 64 bits, lowest byte first; all digests
//! are BLAKE3. The digest of a table covers, one after another:
//!
//! 1. the text `posegrid table 1`;
//! 2. the number of entries `posegrid.*` except the digest's own, and each in the order of their keys: key, value;
//! 3. the number of columns, and of each: its name, its type as the schema names it, one byte 1 if it may be null and 0
//!    if not, and the digests of its presence, lengths and values;
//! 4. the number of rows.
//!
//! Presence (one byte for each row), lengths (of each list that is present) and values (texts, or one byte of a truth
//! value) are sequences in which each run of equal neighbours is hashed as a text and the length of the run. Numbers
//! are not counted: each is hashed as its 64 bits.

mod column;
#[cfg(test)]
mod tests;

use arrow_array::RecordBatch;
use blake3::Hasher;
use rayon::prelude::*;

use super::Table;
use crate::schema::TableSchema;
use column::ColumnDigest;

pub(super) const ENTRY: &str = "posegrid.content_digest";

const OWN: &str = "posegrid.";

/// The first text of the digest; another way to digest will have another number.
const FORM: &str = "posegrid table 1";

pub(super) struct ContentDigest {
    columns: Vec<ColumnDigest>,
    rows: u64,
}

pub(super) fn of_file(table: &Table, entries: &[(String, String)]) -> String {
    let mut digest = ContentDigest::new(table.schema, table.version, &[]);
    digest.add(&[&table.batch]);
    digest.finish(entries)
}

/// The digest of a table's columns except some, hexadecimal; of the metadata only the table's name and version.
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
    /// A digest, still without rows, of a table in that version of its schema, except some columns.
    pub(super) fn new(schema: &TableSchema, version: u32, except: &[&str]) -> Self {
        let columns = schema.columns.iter().enumerate();
        let own =
            columns.filter(|(_, own)| own.is_in(version) && !except.contains(&own.name.as_str()));
        Self { columns: own.map(|(place, own)| ColumnDigest::new(place, own)).collect(), rows: 0 }
    }

    /// Adds rows after those before; column by column, on all threads.
    pub(super) fn add(&mut self, parts: &[&RecordBatch]) {
        let add = |column: &mut ColumnDigest| {
            for part in parts {
                column.add(part.column(column.place));
            }
        };
        self.columns.par_iter_mut().for_each(add);
        self.rows += parts.iter().map(|part| part.num_rows() as u64).sum::<u64>();
    }

    /// Adds the rows of a single part, on this thread alone.
    pub(super) fn add_here(&mut self, part: &RecordBatch) {
        for column in &mut self.columns {
            column.add(part.column(column.place));
        }
        self.rows += part.num_rows() as u64;
    }

    pub(super) const fn rows(&self) -> u64 {
        self.rows
    }

    /// The digest of all rows and the metadata, hexadecimal.
    pub(super) fn finish(self, entries: &[(String, String)]) -> String {
        let mut own: Vec<_> =
            entries.iter().filter(|(key, _)| key.starts_with(OWN) && key != ENTRY).collect();
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

fn text(hasher: &mut Hasher, text: &[u8]) {
    number(hasher, text.len() as u64);
    hasher.update(text);
}

fn number(hasher: &mut Hasher, number: u64) {
    hasher.update(&number.to_le_bytes());
}
