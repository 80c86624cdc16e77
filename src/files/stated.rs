//! What a Parquet file states about itself is bounded before it is decoded: levels of its schema, and bytes of its values.
//!
//! A page of some bytes can stand for gigabytes: nulls, a dictionary whose one long text every row repeats, texts that share the
//! beginning of the text before. The headers of its pages, in Thrift's compact form, say how many values there are.

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use arrow_select::concat::concat_batches;
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReader;
use parquet::basic::Type;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArrayType, DataType};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, FileReader as _, SerializedFileReader};

/// Most levels of a schema: readers call themselves once or more for each.
const MOST_LEVELS: usize = 64;
/// The longest header of a page, bytes; one without statistics has some twenty.
const LONGEST_HEADER: usize = 1 << 24;
/// Bytes of texts that are decoded at once while their sum is found.
const AT_ONCE: u64 = 64 << 20;
/// Bytes of a number in memory, with its levels.
const NUMBER: u64 = 12;

/// Checks that the schema of a file has not too many levels. Damage is left to the reader to tell.
pub fn check_levels(file: &impl ChunkReader) -> Result<()> {
    let levels = || {
        let end = file.get_bytes(file.len().checked_sub(8)?, 8).ok()?;
        let footer = u64::from(u32::from_le_bytes(end.get(..4)?.try_into().ok()?));
        let start = file.len().checked_sub(8 + footer)?;
        Some(levels(&file.get_bytes(start, usize::try_from(footer).ok()?).ok()?))
    };
    match levels() {
        Some(levels) if levels > MOST_LEVELS => Err(ParquetError::General(format!(
            "its columns are nested in more than {MOST_LEVELS} levels; write them flat"
        ))),
        _ => Ok(()),
    }
}

/// The deepest level of the schema in a footer, as far as it is of interest.
fn levels(footer: &[u8]) -> usize {
    let mut deepest = 0;
    Thrift(footer).fields(|field, kind, thrift| {
        if field != 2 {
            return thrift.skip(kind, MOST_LEVELS);
        }
        // Children of each open element that are still to come.
        let mut open: Vec<u64> = Vec::new();
        let (count, _) = thrift.list()?;
        for _ in 0..count {
            let mut children = 0;
            thrift.fields(|field, kind, thrift| match field {
                5 => thrift.number().map(|number| children = number),
                _ => thrift.skip(kind, MOST_LEVELS),
            })?;
            if let Some(rest) = open.last_mut() {
                *rest = rest.saturating_sub(1);
            }
            open.push(children);
            deepest = deepest.max(open.len());
            while open.last() == Some(&0) {
                open.pop();
            }
            if deepest > MOST_LEVELS {
                return None;
            }
        }
        Some(())
    });
    deepest
}

/// Bytes that the values of a file take in memory, or more than `bound` where they may take more; `again` is the same file.
pub fn decoded_bytes<R: ChunkReader + 'static>(file: &R, again: R, bound: u64) -> Result<u64> {
    let reader = SerializedFileReader::new(again)?;
    let mut sum = 0_u64;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        for (place, chunk) in group.metadata().columns().iter().enumerate() {
            let may = MayTake::of(file, chunk)?;
            if may.page > bound {
                return Ok(may.page);
            }
            let mut bytes = may.bytes;
            if may.unfolds() && chunk.column_descr().max_rep_level() == 0 {
                let rest = bound.saturating_sub(sum);
                if let ColumnReader::ByteArrayColumnReader(texts) =
                    group.get_column_reader(place)?
                {
                    bytes = bytes_of(texts, may.longest, rest)?;
                }
            }
            sum = sum.saturating_add(bytes);
            if sum > bound {
                return Ok(sum);
            }
        }
    }
    Ok(sum)
}

/// The rows of a file in one batch; `None` where they take more than `bound` bytes in memory. A few bytes of a file can stand for many
/// rows: their size is summed as they are read.
pub fn batch_within(
    schema: &SchemaRef,
    rows: ParquetRecordBatchReader,
    bound: u64,
) -> std::result::Result<Option<RecordBatch>, ArrowError> {
    let (mut batches, mut bytes) = (Vec::new(), 0_u64);
    for batch in rows {
        let batch = batch?;
        bytes = bytes.saturating_add(batch.get_array_memory_size() as u64);
        if bytes > bound {
            return Ok(None);
        }
        batches.push(batch);
    }
    concat_batches(schema, &batches).map(Some)
}

/// Bytes of all texts of a column, counted until they are more than `bound`; one takes `longest` at most.
fn bytes_of(mut texts: ColumnReaderImpl<ByteArrayType>, longest: u64, bound: u64) -> Result<u64> {
    let at_once = usize::try_from(AT_ONCE / longest.max(1)).unwrap_or(1).clamp(1, 1024);
    let mut sum = 0_u64;
    let mut levels = Vec::new();
    let mut values: Vec<<ByteArrayType as DataType>::T> = Vec::new();
    while sum <= bound {
        levels.clear();
        values.clear();
        let (records, ..) = texts.read_records(at_once, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            break;
        }
        let bytes = values.iter().map(|text| text.len() as u64).sum::<u64>();
        sum = sum.saturating_add(bytes + NUMBER * records as u64);
    }
    Ok(sum)
}

/// What the values of a column chunk may take, by the headers of its pages.
#[derive(Debug, Default)]
struct MayTake {
    /// Bytes of its pages.
    stored: u64,
    /// The largest page, bytes.
    page: u64,
    /// Bytes of its values at most.
    bytes: u64,
    /// The longest that one value may be, bytes.
    longest: u64,
}

impl MayTake {
    fn of(file: &impl ChunkReader, chunk: &ColumnChunkMetaData) -> Result<Self> {
        let (start, length) = chunk.byte_range();
        let (mut at, end) = (start, start.saturating_add(length).min(file.len()));
        let mut may = Self::default();
        let (mut dictionary, mut values) = (0, 0_i64);
        while at < end && values < chunk.num_values() {
            let (page, header) = Page::read(file, at, end)?;
            at = at.saturating_add(header).saturating_add(page.compressed);
            let text = match (chunk.column_type(), page.encoding) {
                (Type::FIXED_LEN_BYTE_ARRAY, _) => {
                    u64::try_from(chunk.column_descr().type_length()).unwrap_or(0)
                }
                (Type::BYTE_ARRAY, PLAIN | DELTA_LENGTH) => page.size / page.values.max(1),
                (Type::BYTE_ARRAY, DICTIONARY | OLD_DICTIONARY) => dictionary,
                (Type::BYTE_ARRAY, _) => page.size,
                _ => 0,
            };
            may.stored = may.stored.saturating_add(page.size);
            may.page = may.page.max(page.size);
            may.longest = may.longest.max(page.size).max(text);
            if page.is_dictionary {
                dictionary = dictionary.max(page.size);
            } else {
                may.stored = may.stored.saturating_add(NUMBER.saturating_mul(page.values));
                may.bytes = may.bytes.saturating_add(page.values.saturating_mul(text + NUMBER));
                values = values.saturating_add_unsigned(page.values);
            }
        }
        Ok(may)
    }

    /// Whether the values may be much more than their pages.
    fn unfolds(&self) -> bool {
        self.bytes > self.stored.saturating_mul(4)
    }
}

const PLAIN: i64 = 0;
const OLD_DICTIONARY: i64 = 2;
const DELTA_LENGTH: i64 = 6;
const DICTIONARY: i64 = 8;

#[derive(Debug, Default)]
struct Page {
    /// Bytes after decompression.
    size: u64,
    /// Bytes in the file.
    compressed: u64,
    values: u64,
    encoding: i64,
    is_dictionary: bool,
}

impl Page {
    /// The page whose header stands at a place of the file, and the bytes of the header.
    fn read(file: &impl ChunkReader, at: u64, end: u64) -> Result<(Self, u64)> {
        let rest = usize::try_from(end - at).unwrap_or(usize::MAX);
        for length in [1 << 12, LONGEST_HEADER] {
            let bytes: Bytes = file.get_bytes(at, rest.min(length))?;
            let mut thrift = Thrift(&bytes);
            if let Some(page) = Self::parse(&mut thrift) {
                return Ok((page, (bytes.len() - thrift.0.len()) as u64));
            }
        }
        Err(ParquetError::General(format!("byte {at}: the header of a page is damaged")))
    }

    fn parse(thrift: &mut Thrift<'_>) -> Option<Self> {
        let mut page = Self::default();
        thrift.fields(|field, kind, thrift| {
            match field {
                2 => page.size = thrift.number()?,
                3 => page.compressed = thrift.number()?,
                5 | 7 | 8 => {
                    page.is_dictionary = field == 7;
                    let encoding = if field == 8 { 4 } else { 2 };
                    thrift.fields(|field, kind, thrift| {
                        match field {
                            1 => page.values = thrift.number()?,
                            own if own == encoding => {
                                page.encoding = i64::try_from(thrift.number()?).ok()?;
                            }
                            _ => thrift.skip(kind, MOST_LEVELS)?,
                        }
                        Some(())
                    })?;
                }
                _ => thrift.skip(kind, MOST_LEVELS)?,
            }
            Some(())
        })?;
        Some(page)
    }
}

/// The rest of a text in Thrift's compact form; `None` wherever it ends too soon or is damaged.
struct Thrift<'b>(&'b [u8]);

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// A number that is not negative: of a signed one the zigzag is undone.
    fn number(&mut self) -> Option<u64> {
        let zigzag = self.varint()?;
        zigzag.is_multiple_of(2).then_some(zigzag / 2)
    }

    /// Number and kind of the elements of a list.
    fn list(&mut self) -> Option<(u64, u8)> {
        let head = self.byte()?;
        let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
        Some((count, head & 15))
    }

    /// Gives the number and the kind of each field of a struct; the value stands next, and `take` takes it.
    fn fields(&mut self, mut take: impl FnMut(i64, u8, &mut Self) -> Option<()>) -> Option<()> {
        let mut field = 0_i64;
        loop {
            let head = self.byte()?;
            let kind = head % 16;
            if kind == 0 {
                return Some(());
            }
            field = match i64::from(head >> 4) {
                0 => i64::try_from(self.number()?).ok()?,
                more => field + more,
            };
            take(field, kind, self)?;
        }
    }

    /// Passes over a value of a kind that has so many levels at most.
    fn skip(&mut self, kind: u8, levels: usize) -> Option<()> {
        let levels = levels.checked_sub(1)?;
        match kind {
            1 | 2 => Some(()),
            3 => self.byte().map(|_| ()),
            4..=6 => self.varint().map(|_| ()),
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            9 | 10 => {
                let (count, kind) = self.list()?;
                // A truth value in a list has a byte of its own.
                let kind = if kind <= 2 { 3 } else { kind };
                (0..count).try_for_each(|_| self.skip(kind, levels))
            }
            12 => self.fields(|_, kind, thrift| thrift.skip(kind, levels)),
            _ => None,
        }
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, RecordBatch, StringArray, StructArray};
    use arrow_schema::Field;
    use parquet::arrow::ArrowWriter;

    use super::*;

    fn written(column: ArrayRef) -> Bytes {
        let batch = RecordBatch::try_from_iter([("a", column)]).unwrap();
        let mut writer = ArrowWriter::try_new(Vec::new(), batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.into_inner().unwrap().into()
    }

    #[test]
    fn a_long_text_that_every_row_repeats_is_counted_before_it_is_decoded() {
        let long = "x".repeat(500_000);
        let texts: StringArray = (0..400).map(|_| Some(long.as_str())).collect();
        let file = written(Arc::new(texts));
        assert!(file.len() < 1_000_000, "{}", file.len());
        assert!(decoded_bytes(&file, file.clone(), 100_000_000).unwrap() > 100_000_000);
        let exact = decoded_bytes(&file, file.clone(), 300_000_000).unwrap();
        assert_eq!(exact, 400 * (500_000 + NUMBER), "the texts are counted, not estimated");
    }

    #[test]
    fn one_long_text_among_many_short_ones_is_not_taken_for_many() {
        let long = "x".repeat(500_000);
        let texts: StringArray =
            (0..10_000).map(|row| Some(if row == 7 { long.as_str() } else { "ok" })).collect();
        let file = written(Arc::new(texts));
        let found = decoded_bytes(&file, file.clone(), 10_000_000).unwrap();
        assert_eq!(found, 500_000 + 2 * 9_999 + 10_000 * NUMBER);
    }

    #[test]
    fn a_schema_of_many_levels_is_refused() {
        let nested = |levels: usize| {
            let mut column: ArrayRef = Arc::new(StringArray::from(vec!["a"]));
            for _ in 0..levels {
                let field = Field::new("s", column.data_type().clone(), true);
                column = Arc::new(StructArray::from(vec![(Arc::new(field), column)]));
            }
            check_levels(&written(column))
        };
        assert!(nested(10).is_ok());
        let refused = nested(100).unwrap_err().to_string();
        assert!(refused.contains("nested in more than 64 levels"), "{refused}");
        assert!(check_levels(&Bytes::from_static(b"PAR1\xff\xff\xff\x7fPAR1")).is_ok());
    }
}
