//! Lists of one length of numbers of which hardly two are equal, such as the angles of an arm → the pages of a column.
//! Such columns hold by far the most bytes of all tables. The crate's writer examines each number: by it, the path from
//! a log to its tables costs 7 % more CPU seconds (`cargo bench --bench ingest`). It is used for lists of other kinds,
//! and numbers that repeat.
//!
//! A page consists, by the format's `DATA_PAGE`, of repetition levels, definition levels and values; levels are runs of
//! repeats and packed bits, after their length in four bytes.

use std::collections::HashSet;
use std::ops::Range;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, ArrayRef};
use arrow_buffer::ArrowNativeType;
use bytes::Bytes;
use parquet::basic::{Compression, Encoding, EncodingMask, PageType};
use parquet::column::page::{CompressedPage, Page, PageWriter};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, OffsetIndexBuilder, PageEncodingStats};
use parquet::file::properties::{EnabledStatistics, WriterPropertiesPtr};
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::ColumnDescPtr;

use super::column::EncodedColumn;
use super::properties::REPEATED_FLOATS;

const NUMBER: usize = size_of::<f64>();
/// Approximate number of bytes of the numbers of a page.
const PAGE: usize = 768 << 10;
/// The number of lists of a page is a multiple of this, so that levels fill whole bytes.
const EIGHT: usize = 8;
/// More bytes than a page's header takes.
const HEADER: usize = 64;

struct Lists<'a> {
    length: usize,
    rows: usize,
    bytes: &'a [u8],
}

/// Encodes lists of one length whose numbers do not repeat; `None` for any other column.
pub(super) fn encode(
    column: &ColumnDescPtr,
    properties: &WriterPropertiesPtr,
    array: &ArrayRef,
) -> Option<Result<EncodedColumn, ParquetError>> {
    let plain = properties.compression(column.path()) == Compression::UNCOMPRESSED
        && properties.statistics_enabled(column.path()) == EnabledStatistics::None
        && cfg!(target_endian = "little");
    let lists = Lists::of(array).filter(|_| plain)?;
    Some(lists.encode(column))
}

impl<'a> Lists<'a> {
    fn of(array: &'a ArrayRef) -> Option<Self> {
        let lists = array.as_list_opt::<i32>()?;
        let numbers = lists.values().as_primitive_opt::<Float64Type>()?;
        let bounds = lists.value_offsets();
        let (first, end) = (bounds[0].as_usize(), bounds[lists.len()].as_usize());
        let length = (end - first).checked_div(lists.len())?;
        let alike = bounds.windows(2).all(|pair| (pair[1] - pair[0]).as_usize() == length);
        if length == 0 || !alike || lists.null_count() + numbers.null_count() > 0 {
            return None;
        }
        let values = &numbers.values()[first..end];
        if !differ(values) {
            return None;
        }
        let bytes = &numbers.values().inner()[first * NUMBER..end * NUMBER];
        Some(Self { length, rows: lists.len(), bytes })
    }

    fn pages(&self) -> impl Iterator<Item = Range<usize>> {
        let rows = (PAGE / NUMBER / self.length / EIGHT).max(1) * EIGHT;
        let firsts = (0..self.rows).step_by(rows);
        firsts.map(move |first| first..(first + rows).min(self.rows))
    }

    fn encode(&self, column: &ColumnDescPtr) -> Result<EncodedColumn, ParquetError> {
        let pages = self.pages().count();
        let room = self.bytes.len() + self.bytes.len() / 32 + pages * HEADER;
        let mut sink = TrackedWrite::new(Vec::with_capacity(room));
        let mut writer = SerializedPageWriter::new(&mut sink);
        let (mut places, mut data_at, mut written) = (OffsetIndexBuilder::new(), None, 0);
        for rows in self.pages() {
            let page = writer.write_page(self.page(column, &rows)?)?;
            places.append_row_count(whole(rows.len())?);
            places.append_offset_and_size(whole(page.offset)?, whole(page.compressed_size)?);
            data_at.get_or_insert(page.offset);
            written += page.compressed_size;
        }
        writer.close()?;
        let stats = PageEncodingStats {
            page_type: PageType::DATA_PAGE,
            encoding: Encoding::PLAIN,
            count: whole(pages)?,
        };
        let encodings = [Encoding::PLAIN, Encoding::RLE];
        let metadata = ColumnChunkMetaData::builder(column.clone())
            .set_compression(Compression::UNCOMPRESSED)
            .set_encodings_mask(EncodingMask::new_from_encodings(encodings.iter()))
            .set_page_encoding_stats(vec![stats])
            .set_total_compressed_size(whole(written)?)
            .set_total_uncompressed_size(whole(written)?)
            .set_num_values(whole(self.rows * self.length)?)
            .set_data_page_offset(whole(data_at.unwrap_or(0))?)
            .build()?;
        let close = ColumnCloseResult {
            bytes_written: written as u64,
            rows_written: self.rows as u64,
            metadata,
            bloom_filter: None,
            column_index: None,
            offset_index: Some(places.build()),
        };
        Ok(EncodedColumn { bytes: sink.into_inner()?.into(), close })
    }

    fn page(
        &self,
        column: &ColumnDescPtr,
        rows: &Range<usize>,
    ) -> Result<CompressedPage, ParquetError> {
        let values = rows.len() * self.length;
        let (repetition, definition) =
            (self.repetition_levels(values), definition_levels(values, column.max_def_level()));
        let row = self.length * NUMBER;
        let numbers = &self.bytes[rows.start * row..rows.end * row];
        let parts = [&repetition[..], &definition, numbers];
        let page = Page::DataPage {
            buf: Bytes::from(parts.concat()),
            num_values: whole(values)?,
            encoding: Encoding::PLAIN,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        };
        let size = page.buffer().len();
        Ok(CompressedPage::new(page, size))
    }

    /// 0 for the first number of a list, 1 for the others: a run of packed bits, the lowest one first.
    fn repetition_levels(&self, values: usize) -> Vec<u8> {
        let groups = values.div_ceil(EIGHT);
        let group = |group: usize| {
            let goes_on = |bit: usize| !(group * EIGHT + bit).is_multiple_of(self.length);
            let bit = |bit: usize| u8::from(goes_on(bit)) << bit;
            (0..EIGHT).map(bit).sum::<u8>()
        };
        let mut run = varint((groups as u64) << 1 | 1);
        // The bits repeat after this number of groups.
        let period: Vec<u8> = (0..self.length.min(groups)).map(group).collect();
        run.extend(period.iter().cycle().take(groups));
        behind_its_length(run)
    }
}

/// The level of a number that is present, for each: a run of repeats.
fn definition_levels(values: usize, there: i16) -> Vec<u8> {
    let mut run = varint((values as u64) << 1);
    run.extend(u8::try_from(there));
    behind_its_length(run)
}

/// Whether a dictionary of the numbers would be of no use, judged by those of the first page.
fn differ(values: &[f64]) -> bool {
    let mut seen = HashSet::new();
    let first = &values[..values.len().min(PAGE / NUMBER)];
    first.iter().any(|value| {
        seen.insert(value.to_bits());
        seen.len() > REPEATED_FLOATS / NUMBER
    })
}

/// Seven bits a byte, the lowest first; all but the last have the eighth set.
fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    loop {
        let [low, ..] = number.to_le_bytes();
        number >>= 7;
        if number == 0 {
            bytes.push(low & 0x7f);
            return bytes;
        }
        bytes.push(low | 0x80);
    }
}

fn behind_its_length(run: Vec<u8>) -> Vec<u8> {
    let [a, b, c, d, ..] = run.len().to_le_bytes();
    let mut found = vec![a, b, c, d];
    found.extend(run);
    found
}

fn whole<N, T: TryFrom<N>>(number: N) -> Result<T, ParquetError> {
    T::try_from(number).map_err(|_| ParquetError::General("a column is too large".to_owned()))
}
