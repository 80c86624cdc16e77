use std::mem;
use std::sync::Arc;

use arrow_array::{Array, ArrayRef, Int64Array, new_null_array};

use super::{Cell, Table, TableError, Value, cell, check};
use crate::manifest::RunKey;
use crate::schema::{ColumnType, KEY_COLUMNS, TableSchema};

/// Collects the columns of a table; [`Self::finish`] reports the first error.
///
/// ```
/// # use posegrid_base::manifest::RunKey;
/// # use posegrid_files::{schema, table::Columns};
/// # let key = RunKey::new("ur10", "2020-11-09", "00ff");
/// let curve = [(-0.5, 1.0e-4), (0.5, -1.2e-4)];
/// let table = Columns::new(schema::find("joint_errors")?, curve.len())
///     .key(&key)
///     .same("joint", 1_u64)
///     .same("joint_name", "shoulder_pan_joint")
///     .same("joint_unit", "rad")
///     .column("angle_rad", curve.map(|(angle, _)| angle))
///     .group(["error_rad", "curve_rad"], curve.map(|(_, error)| [error; 2]))
///     .same("sd_rad", 2.0e-5)
///     .same("gear_lines_rad", 0.0)
///     .same("measured", true)
///     .finish()?;
/// assert_eq!(table.rows(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
#[must_use]
pub struct Columns {
    schema: &'static TableSchema,
    rows: usize,
    key: Option<RunKey>,
    arrays: Vec<Option<ArrayRef>>,
    /// The table whose columns replace those that are not given.
    like: Option<Table>,
    error: Option<TableError>,
}

/// Makes the array of a column of so many rows.
type Make<'m> = &'m mut dyn FnMut(usize) -> Result<ArrayRef, (usize, String)>;

impl Columns {
    pub fn new(schema: &'static TableSchema, rows: usize) -> Self {
        Self {
            schema,
            rows,
            key: None,
            arrays: vec![None; schema.columns.len()],
            like: None,
            error: None,
        }
    }

    /// Columns that are not given are those of `table`, and not checked again.
    pub fn like(table: &Table) -> Self {
        Self {
            key: table.key().cloned(),
            like: Some(table.clone()),
            ..Self::new(table.schema(), table.rows())
        }
    }

    pub fn key(mut self, key: &RunKey) -> Self {
        self.key = Some(key.clone());
        let parts = [&key.robot, &key.session, &key.run];
        KEY_COLUMNS
            .into_iter()
            .zip(parts)
            .fold(self, |columns, (name, part)| columns.same(name, part))
    }

    pub fn column<C: Cell>(self, name: &str, values: impl IntoIterator<Item = C>) -> Self {
        let mut values = values.into_iter().map(Cell::value);
        self.put(name, C::Value::KIND, &mut |_| C::Value::array(&mut values))
    }

    pub fn whole_numbers(self, name: &str, mut values: Vec<i64>) -> Self {
        let mut array = || Arc::new(Int64Array::from(mem::take(&mut values)));
        self.put(name, ColumnType::Int64, &mut |_| Ok(array()))
    }

    pub fn same<C: Cell<Value: Clone>>(self, name: &str, value: C) -> Self {
        let value = value.value();
        self.put(name, C::Value::KIND, &mut |rows| C::Value::same(value.clone(), rows))
    }

    /// Lists of one length, their values one after another, as many for each row.
    pub fn lists_alike(self, name: &str, values: &[f64]) -> Self {
        self.put(name, ColumnType::ListFloat64, &mut |rows| Ok(cell::lists_alike(values, rows)))
    }

    /// Columns that belong together: the components of a point, a quaternion, a covariance. A row has all or none.
    pub fn group<const N: usize, V: Into<Option<[f64; N]>>>(
        self,
        names: [&str; N],
        values: impl IntoIterator<Item = V>,
    ) -> Self {
        let rows: Vec<Option<[f64; N]>> = values.into_iter().map(Into::into).collect();
        names.iter().enumerate().fold(self, |columns, (component, name)| {
            columns.column(name, rows.iter().map(|row| row.map(|row| row[component])))
        })
    }

    /// Every column that may be null and was not given is null in every row.
    pub fn rest_absent(mut self) -> Self {
        for (place, column) in self.schema.columns.iter().enumerate() {
            if column.nullable && self.arrays[place].is_none() {
                self.fill(place);
            }
        }
        self
    }

    pub fn finish(self) -> Result<Table, TableError> {
        Ok(self.finish_in_order()?.0)
    }

    /// The table with each row's place in the order given, `None` where the order is the same.
    pub fn finish_in_order(self) -> Result<(Table, Option<Vec<usize>>), TableError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        check::table(self.schema, self.key, self.rows, self.arrays, self.like.as_ref())
    }

    fn put(mut self, name: &str, kind: ColumnType, make: Make<'_>) -> Self {
        if self.error.is_none() {
            self.error = self.try_put(name, kind, make).err();
        }
        self
    }

    fn try_put(&mut self, name: &str, kind: ColumnType, make: Make<'_>) -> Result<(), TableError> {
        let place = self.place(name)?;
        let column = &self.schema.columns[place];
        if kind != column.kind {
            let expected = column.kind.name();
            let problem = format_args!("found {}, the schema states {expected}", kind.name());
            return Err(TableError::column(self.schema, name, problem));
        }
        let too_large = |(row, value): (usize, String)| {
            let problem = format_args!("{value} is larger than a signed 64-bit number");
            TableError::at(self.schema, format_args!(", column {name:?}, row {row}"), problem)
        };
        let array = make(self.rows).map_err(too_large)?;
        self.arrays[place] = Some(array);
        Ok(())
    }

    fn place(&self, name: &str) -> Result<usize, TableError> {
        let Some((place, _)) = self.schema.column(name) else {
            return Err(TableError::unknown_column(self.schema, name));
        };
        if self.arrays[place].is_some() {
            let twice = format_args!("column {name:?} is given twice");
            return Err(TableError::of(self.schema, twice));
        }
        Ok(place)
    }

    fn fill(&mut self, place: usize) {
        let kind = self.schema.columns[place].kind.arrow();
        let alike = |array: &&ArrayRef| {
            *array.data_type() == kind
                && array.len() == self.rows
                && array.null_count() == self.rows
        };
        // All columns of nulls can share one array.
        let shared = self.arrays.iter().flatten().find(alike).cloned();
        self.arrays[place] = Some(shared.unwrap_or_else(|| new_null_array(&kind, self.rows)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema;

    /// Two parameters, without the columns that a test gives itself.
    fn parameters() -> Columns {
        Columns::new(schema::find("parameters").unwrap(), 2)
            .key(&RunKey::new("ur10", "grid", "00ff"))
            .column("model", ["geometric", "base_target"])
            .column("parameter_index", [0_u64, 5])
            .column("parameter", ["theta_1", "base_rz"])
            .column("belongs_to", ["link", "base"])
            .column("of_session", [None, Some("grid")])
            .column("joint", [Some(1_i64), None])
            .column("quantity", ["theta", "rz"])
            .column("unit", ["rad", "rad"])
            .same("nominal", 0.0)
            .same("identified", 1e-4)
            .same("standard_error", Some(1e-5))
            .rest_absent()
            .same("identifiability", "identifiable")
    }

    fn refusal(columns: Columns) -> String {
        columns.finish().unwrap_err().to_string()
    }

    #[test]
    fn columns_go_where_the_schema_has_them_and_rows_into_its_order() {
        let table = parameters()
            .column("confounded_with", [vec!["base_rz".to_owned()], vec![]])
            .column("offset", [1e-4, 2e-4])
            .finish()
            .unwrap();
        // base_target comes before geometric among the schema's words, though not in the alphabet of the rows given.
        assert_eq!(table.text("model").value(0), "base_target");
        assert_eq!(table.f64("offset").values(), &[2e-4, 1e-4]);
        assert!(table.i64("joint").is_null(0) && table.i64("joint").value(1) == 1);
        assert_eq!(table.list("confounded_with").value_length(1), 1);
        assert_eq!(table.batch().column(0).as_ref(), table.text("robot") as &dyn Array);
        assert_eq!(table.key().map(|key| key.run.as_str()), Some("00ff"));
    }

    #[test]
    fn what_breaks_the_contract_is_refused_by_column_and_row() {
        let none: Vec<Vec<String>> = vec![vec![]; 2];
        let whole = || parameters().column("confounded_with", &none);
        assert_eq!(
            refusal(whole()),
            "table parameters: missing columns offset; a column without values still has to be there, all null"
        );
        let cases = [
            (whole().column("ofset", [0.0; 2]), "there is no column \"ofset\""),
            (whole().same("nominal", 0.0), "column \"nominal\" is given twice"),
            (whole().column("offset", [0.0; 3]), "\"offset\": 3 values for 2 rows"),
            (
                whole().column("offset", [1_u64, 2]),
                "\"offset\": found int64, the schema states float64",
            ),
            (whole().column("offset", [Some(0.0), None]), "\"offset\", row 1: null"),
            (
                whole().column("offset", [0.0, f64::NAN]),
                "\"offset\", row 1: NaN is not a finite number",
            ),
            (
                whole().column("offset", [f64::INFINITY, 0.0]),
                "\"offset\", row 0: inf is not a finite",
            ),
        ];
        for (columns, expected) in cases {
            let error = refusal(columns);
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_table_like_another_has_its_other_columns_and_checks_those_given() {
        let whole = |offsets: [f64; 2]| {
            let columns =
                parameters().column("confounded_with", [vec!["base_rz".to_owned()], vec![]]);
            columns.column("offset", offsets).finish().unwrap()
        };
        let first = whole([1e-4, 2e-4]);
        // The first one's rows were sorted: those given now are in that order already.
        let second = Columns::like(&first).column("offset", [4e-4, 3e-4]).finish();
        assert_eq!(second.unwrap(), whole([3e-4, 4e-4]));
        let error = refusal(Columns::like(&first).column("offset", [0.0, f64::NAN]));
        assert!(error.contains("\"offset\", row 1: NaN"), "{error}");
        let error = refusal(Columns::like(&first).column("offset", [0.0]));
        assert!(error.contains("\"offset\": 1 values for 2 rows"), "{error}");
    }

    #[test]
    fn words_counts_and_repeated_rows_are_checked() {
        let clocks = |method: &str, edges: u64, rows: usize| {
            Columns::new(schema::find("clocks").unwrap(), rows)
                .key(&RunKey::new("ur10", "grid", "00ff"))
                .same("origin_ns", 0_i64)
                .group(
                    ["offset_ns", "offset_se_ns", "drift_ppm", "drift_se_ppm"],
                    vec![[1.0; 4]; rows],
                )
                .same("matched_edges", edges)
                .same("edge_rms_ns", 1.0)
                .same("method", method)
        };
        assert!(clocks("", 0, 1).finish().is_ok());
        assert!(clocks("", 0, 0).finish().is_ok(), "a table may be empty");
        assert!(refusal(clocks("", u64::MAX, 1)).contains("18446744073709551615 is larger than"));
        assert!(refusal(clocks("", 0, 2)).contains("rows 0 and 1: the same file"));
        let wrong = Columns::new(schema::find("rejects").unwrap(), 1)
            .same("stage", "Join")
            .same("reject", 0_u64)
            .same("number", 1_u64);
        let wrong = wrong
            .key(&RunKey::new("r", "s", "0"))
            .same("kind", "dwell")
            .same("reason", "moved")
            .rest_absent();
        assert!(refusal(wrong).contains("\"Join\" is none of the words allowed: ingest, join"));
    }
}
