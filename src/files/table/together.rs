//! Tables of many runs → one table, and the part of it that some runs have.

use std::sync::Arc;

use arrow_array::BooleanArray;
use arrow_select::concat::concat_batches;
use arrow_select::filter::filter_record_batch;

use super::{Table, TableError, check};
use crate::manifest::RunKey;
use crate::schema::{KEY_COLUMNS, TableSchema};

/// Rows are in the order of robot, session and run; an error when two tables have rows of one name.
pub fn together(schema: &'static TableSchema, tables: &[Table]) -> Result<Table, TableError> {
    let arrow = |source| TableError::of(schema, source);
    let batches = tables.iter().map(Table::batch);
    let batch = concat_batches(&Arc::new(schema.arrow()), batches).map_err(arrow)?;
    let arrays = batch.columns().iter().cloned().map(Some).collect();
    let (table, _) = check::table(schema, None, batch.num_rows(), arrays, None)?;
    Ok(table)
}

impl Table {
    pub fn of_rows(&self, is_kept: impl Fn(usize, &RunKey) -> bool) -> Result<Self, TableError> {
        let keys = self.keys().into_iter().enumerate();
        let kept: BooleanArray = keys.map(|(row, key)| Some(is_kept(row, &key))).collect();
        let batch = filter_record_batch(&self.batch, &kept);
        let batch = batch.map_err(|source| TableError::of(self.schema, source))?;
        Ok(Self { batch, ..self.clone() })
    }

    pub fn keys(&self) -> Vec<RunKey> {
        let [robots, sessions, runs] = KEY_COLUMNS.map(|name| self.text(name));
        let key = |row| RunKey::new(robots.value(row), sessions.value(row), runs.value(row));
        (0..self.rows()).map(key).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema;
    use crate::table::{Columns, open, write};

    /// A joint's curve of two angles.
    fn curve(robot: &str, run: &str) -> Table {
        let table = Columns::new(schema::find("joint_errors").unwrap(), 2)
            .key(&RunKey::new(robot, "mon", run))
            .same("joint", 1_u64)
            .same("joint_name", "a1")
            .same("joint_unit", "rad")
            .column("angle_rad", [0.0, 0.5])
            .same("error_rad", 1e-4)
            .same("curve_rad", 1e-4)
            .same("sd_rad", 1e-5)
            .same("gear_lines_rad", 0.0)
            .same("measured", true);
        table.finish().unwrap()
    }

    #[test]
    fn rows_of_several_runs_are_one_table_that_is_read_back() {
        let schema = schema::find("joint_errors").unwrap();
        let all = [curve("b", "00"), curve("a", "02"), curve("a", "01")];
        let table = together(schema, &all).unwrap();
        let runs: Vec<_> = table.keys().into_iter().map(|key| key.run).collect();
        assert_eq!(runs, ["01", "01", "02", "02", "00", "00"]);
        assert_eq!(table.key(), None);
        let mut file = tempfile::tempfile().unwrap();
        write(&table, &mut file).unwrap();
        let opened = open(file, "here".as_ref(), schema).unwrap();
        assert_eq!(opened.believed("here".as_ref()).unwrap(), table);
        let own = table.of_rows(|_, key| key.run == "02").unwrap();
        assert_eq!(own.rows(), 2);
        // A run is there once.
        assert!(together(schema, &[table, own]).is_err());
    }
}
