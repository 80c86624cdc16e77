//! Tables → the bytes of row groups.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::DataType;
use parquet::arrow::ArrowSchemaConverter;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterPropertiesPtr;
use parquet::schema::types::{SchemaDescriptor, TypePtr};

use super::ROW_GROUP_ROWS;
use super::column::{EncodedColumn, encode};
use super::properties::properties;
use crate::schema::TableSchema;
use crate::table::digest::ContentDigest;
use crate::table::{Table, same};

pub struct Encoder {
    schema: SchemaDescriptor,
    properties: WriterPropertiesPtr,
    of: &'static TableSchema,
    /// Columns with one value in all rows, or of nulls, are the same bytes in every row group with as many rows.
    uniform: Mutex<BTreeMap<Uniform, Arc<EncodedColumn>>>,
    /// The last array of each such column: if it comes again it need not be examined.
    latest: Mutex<Vec<Option<Known>>>,
}

type Known = (ArrayRef, Arc<EncodedColumn>);

#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Uniform {
    column: usize,
    rows: usize,
    says: Says,
}

#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Nothing,
    Text(String),
}

pub struct RowGroups(Vec<Vec<Arc<EncodedColumn>>>);

impl RowGroups {
    pub fn rows(&self) -> u64 {
        let first_columns = self.columns().filter_map(<[_]>::first);
        first_columns.map(|column| column.close.rows_written).sum()
    }

    pub(super) fn columns(&self) -> impl Iterator<Item = &[Arc<EncodedColumn>]> {
        self.0.iter().map(Vec::as_slice)
    }
}

impl Encoder {
    pub fn of(table: &Table) -> Result<Self, ParquetError> {
        Ok(Self {
            schema: ArrowSchemaConverter::new().convert(&table.batch.schema())?,
            properties: Arc::new(properties(table)),
            of: table.schema,
            uniform: Mutex::default(),
            latest: Mutex::new(vec![None; table.batch.num_columns()]),
        })
    }

    pub(super) fn schema(&self) -> TypePtr {
        self.schema.root_schema_ptr()
    }

    pub(super) fn properties(&self) -> WriterPropertiesPtr {
        Arc::clone(&self.properties)
    }

    pub(super) fn digest(&self) -> ContentDigest {
        ContentDigest::new(self.of, self.of.version, &[])
    }

    pub(super) fn metadata(&self) -> Vec<(String, String)> {
        let entries = self.properties.key_value_metadata().into_iter().flatten();
        entries.filter_map(|entry| Some((entry.key.clone(), entry.value.clone()?))).collect()
    }

    /// The row groups of a table: the same bytes on any thread, whatever was encoded before.
    pub fn encode(&self, part: &Table) -> Result<RowGroups, ParquetError> {
        let rows = part.rows();
        if (1..=ROW_GROUP_ROWS).contains(&rows) {
            return Ok(RowGroups(vec![self.row_group(&part.batch)?]));
        }
        let firsts = (0..rows).step_by(ROW_GROUP_ROWS);
        let group = |first| part.batch.slice(first, ROW_GROUP_ROWS.min(rows - first));
        firsts.map(|first| self.row_group(&group(first))).collect::<Result<_, _>>().map(RowGroups)
    }

    fn row_group(&self, rows: &RecordBatch) -> Result<Vec<Arc<EncodedColumn>>, ParquetError> {
        let columns = rows.columns().iter().enumerate();
        columns.map(|(place, array)| self.column(place, array)).collect()
    }

    fn column(&self, place: usize, array: &ArrayRef) -> Result<Arc<EncodedColumn>, ParquetError> {
        if let Some(column) = self.again(place, array) {
            return Ok(column);
        }
        let Some(says) = says(array) else { return self.fresh(place, array) };
        let column = self.saying(place, array, says)?;
        locked(&self.latest)[place] = Some((Arc::clone(array), Arc::clone(&column)));
        Ok(column)
    }

    /// The encoded column of the same array, if it was the last one.
    fn again(&self, place: usize, array: &ArrayRef) -> Option<Arc<EncodedColumn>> {
        let latest = locked(&self.latest);
        let (known, column) = latest[place].as_ref()?;
        std::ptr::addr_eq(Arc::as_ptr(known), Arc::as_ptr(array)).then(|| Arc::clone(column))
    }

    fn saying(
        &self,
        place: usize,
        array: &ArrayRef,
        says: Says,
    ) -> Result<Arc<EncodedColumn>, ParquetError> {
        let uniform = Uniform { column: place, rows: array.len(), says };
        if let Some(column) = locked(&self.uniform).get(&uniform) {
            return Ok(Arc::clone(column));
        }
        let column = self.fresh(place, array)?;
        locked(&self.uniform).insert(uniform, Arc::clone(&column));
        Ok(column)
    }

    fn fresh(&self, place: usize, array: &ArrayRef) -> Result<Arc<EncodedColumn>, ParquetError> {
        let column = self.schema.column(place);
        Ok(Arc::new(encode(column, self.properties(), array)?))
    }
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn says(array: &ArrayRef) -> Option<Says> {
    if array.null_count() == array.len() {
        return Some(Says::Nothing);
    }
    let text = (*array.data_type() == DataType::Utf8).then(|| array.as_string())?;
    same::text(text).map(|text| Says::Text(text.to_owned()))
}
