//! Tables → Parquet files. The metadata states table, schema version, units, frames, robot, session, run and the digest
//! of all that and of the content ([`super::digest`]), but no time, host or path, so the same table gives the same
//! bytes. An [`Encoder`] makes row groups of [`ROW_GROUP_ROWS`] rows, on any number of threads; a [`PartsFile`] digests
//! and writes them in order.

mod column;
mod encoder;
mod lists;
mod properties;

use std::io::Write;

use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::writer::SerializedFileWriter;

use super::Table;
use super::digest::{self, ContentDigest};
pub use encoder::{Encoder, RowGroups};

/// Rows in a row group: a reader of one column of one group reads little, and a writer holds little.
pub const ROW_GROUP_ROWS: usize = 65_536;

pub fn write<W: Write + Send>(table: &Table, sink: W) -> Result<W, ParquetError> {
    let encoder = Encoder::of(table)?;
    let mut file = PartsFile::new(&encoder, sink)?;
    file.digest_here(table);
    file.append(&encoder.encode(table)?)?;
    file.finish()
}

/// Each part is digested, and its row groups appended, once each and both in the order of the rows.
pub struct PartsFile<W: Write> {
    file: SerializedFileWriter<W>,
    digest: ContentDigest,
    metadata: Vec<(String, String)>,
    appended: u64,
}

impl<W: Write + Send> PartsFile<W> {
    pub fn new(encoder: &Encoder, sink: W) -> Result<Self, ParquetError> {
        let (schema, properties) = (encoder.schema(), encoder.properties());
        let (digest, metadata) = (encoder.digest(), encoder.metadata());
        let file = SerializedFileWriter::new(sink, schema, properties)?;
        Ok(Self { digest, metadata, file, appended: 0 })
    }

    pub fn digest<'t>(&mut self, parts: impl IntoIterator<Item = &'t Table>) {
        let batches: Vec<_> = parts.into_iter().map(Table::batch).collect();
        self.digest.add(&batches);
    }

    /// Digests the content of a part on this thread alone.
    pub fn digest_here(&mut self, part: &Table) {
        self.digest.add_here(&part.batch);
    }

    pub fn append(&mut self, part: &RowGroups) -> Result<(), ParquetError> {
        for columns in part.columns() {
            let mut group = self.file.next_row_group()?;
            for column in columns {
                group.append_column(&column.bytes, column.close.clone())?;
            }
            group.close()?;
        }
        self.appended += part.rows();
        Ok(())
    }

    /// The digested rows have to be the appended ones.
    pub fn finish(mut self) -> Result<W, ParquetError> {
        let rows = (self.digest.rows(), self.appended);
        assert_eq!(rows.0, rows.1, "every row is digested and appended");
        let digest = self.digest.finish(&self.metadata);
        let entry = KeyValue::new(digest::ENTRY.to_owned(), digest);
        self.file.append_key_value_metadata(entry);
        self.file.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use parquet::file::metadata::RowGroupMetaData;
    use parquet::file::reader::{FileReader as _, SerializedFileReader};

    use super::*;
    use crate::manifest::RunKey;
    use crate::schema;
    use crate::table::{Columns, read};

    /// More rows than a row group has; lists that are absent, empty, of one and of several, and no two alike in a row.
    fn samples(rows: usize) -> Table {
        let angles = |row: usize| match row % 4 {
            0 => None,
            n => Some((1..n).map(|joint| (row * joint) as f64 / 7.0).collect::<Vec<_>>()),
        };
        let names = ["x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"];
        let poses = (0..rows).map(|row| (row % 3 > 0).then_some([row as f64; 7]));
        let columns = Columns::new(schema::find("logs").unwrap(), rows)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .same("source", "joints")
            .column("sample", 0..rows)
            .column("stamp_ns", (0..rows).map(|row| row * row))
            .column("joints_rad", (0..rows).map(angles))
            .group(names, poses);
        columns.rest_absent().finish().unwrap()
    }

    #[test]
    fn every_kind_of_absence_comes_back_from_several_row_groups() {
        let rows = ROW_GROUP_ROWS + 1000;
        let table = samples(rows);
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&write(&table, Vec::new()).unwrap()).unwrap();
        assert_eq!(read(file.path(), table.schema()).unwrap(), table);
        let reader = SerializedFileReader::new(file.reopen().unwrap()).unwrap();
        let groups = reader.metadata().row_groups().iter();
        let found: Vec<_> = groups.map(RowGroupMetaData::num_rows).collect();
        assert_eq!(found, [65_536, 1000]);
    }

    fn joints(rows: usize, joints: usize, angle: impl Fn(usize, usize) -> f64) -> Table {
        let places = (0..rows).flat_map(|row| (0..joints).map(move |joint| (row, joint)));
        let angles: Vec<f64> = places.map(|(row, joint)| angle(row, joint)).collect();
        let table = Columns::new(schema::find("logs").unwrap(), rows)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .same("source", "joints")
            .column("sample", 0..rows)
            .column("stamp_ns", 0..rows)
            .lists_alike("joints_rad", &angles);
        table.rest_absent().finish().unwrap()
    }

    #[test]
    fn lists_of_one_length_come_back_whether_their_numbers_repeat_or_not() {
        // One and several pages, whole and broken bytes of levels, several row groups.
        let sizes = [(600, 6), (4104, 1), (4999, 3), (17_000, 6), (66_000, 7), (16_391, 9)];
        for (rows, number) in sizes {
            for repeats in [rows * number, 100] {
                let angle = |row, joint| ((row * number + joint) % repeats) as f64 / 7.0;
                let table = joints(rows, number, angle);
                let mut file = tempfile::NamedTempFile::new().unwrap();
                file.write_all(&write(&table, Vec::new()).unwrap()).unwrap();
                assert_eq!(read(file.path(), table.schema()).unwrap(), table);
                let reader = SerializedFileReader::new(file.reopen().unwrap()).unwrap();
                let column = reader.metadata().row_group(0).columns();
                let column = column.iter().find(|c| c.column_path().string().contains("list"));
                let dictionary = column.unwrap().dictionary_page_offset();
                assert_eq!(dictionary.is_some(), repeats == 100 || rows == 600, "{rows}");
            }
        }
    }

    #[test]
    fn what_was_encoded_before_leaves_no_trace_in_the_bytes() {
        let (short, long) = (samples(10), samples(20));
        let encoder = Encoder::of(&short).unwrap();
        let bytes = |parts: [&RowGroups; 2]| {
            let mut file = PartsFile::new(&encoder, Vec::new()).unwrap();
            for (part, table) in parts.into_iter().zip([&short, &long]) {
                file.digest([table]);
                file.append(part).unwrap();
            }
            file.finish().unwrap()
        };
        let [first, second, again] =
            [&short, &long, &short].map(|part| encoder.encode(part).unwrap());
        assert_eq!(bytes([&first, &second]), bytes([&again, &second]));
        let fresh = Encoder::of(&short).unwrap().encode(&long).unwrap();
        assert_eq!(bytes([&first, &second]), bytes([&first, &fresh]));
    }
}
