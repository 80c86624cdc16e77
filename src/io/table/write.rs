//! Tables → Parquet files.
//!
//! A file says in its metadata what it is: `posegrid.table`, `posegrid.schema_version`, `posegrid.units` and
//! `posegrid.frames` (JSON, column → unit or frame), and `posegrid.robot`, `.session` and `.run`. It holds no time, no
//! host and no path, so the same table gives the same bytes.
//!
//! 1. An [`Encoder`] turns the columns of up to [`ROW_GROUP_ROWS`] rows into the bytes of a row group ([`column`]);
//!    parts of a table may be encoded on any number of threads.
//! 2. A [`PartsFile`] puts the row groups one behind the other and the metadata behind all.

mod column;
mod encoder;
mod levels;
mod properties;

use std::io::Write;

use parquet::errors::ParquetError;
use parquet::file::writer::SerializedFileWriter;

use super::Table;
pub use encoder::{Encoder, RowGroups};

/// Rows in a row group: a reader that wants one column of one group reads little, and a writer holds little.
pub const ROW_GROUP_ROWS: usize = 131_072;

/// Writes a table as a Parquet file into `sink` and gives `sink` back.
pub fn write<W: Write + Send>(table: &Table, sink: W) -> Result<W, ParquetError> {
    let encoder = Encoder::of(table)?;
    let mut file = PartsFile::new(&encoder, sink)?;
    file.append(&encoder.encode(table)?)?;
    file.finish()
}

/// A Parquet file that is written part by part.
pub struct PartsFile<W: Write>(SerializedFileWriter<W>);

impl<W: Write + Send> PartsFile<W> {
    /// Begins the file.
    pub fn new(encoder: &Encoder, sink: W) -> Result<Self, ParquetError> {
        let (schema, properties) = (encoder.schema(), encoder.properties());
        Ok(Self(SerializedFileWriter::new(sink, schema, properties)?))
    }

    /// Puts a part behind those before it.
    pub fn append(&mut self, part: &RowGroups) -> Result<(), ParquetError> {
        for columns in part.columns() {
            let mut group = self.0.next_row_group()?;
            for column in columns {
                group.append_column(&column.bytes, column.close.clone())?;
            }
            group.close()?;
        }
        Ok(())
    }

    /// Ends the file and gives its sink back.
    pub fn finish(self) -> Result<W, ParquetError> {
        self.0.into_inner()
    }
}
