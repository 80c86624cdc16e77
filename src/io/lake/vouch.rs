//! Files of a lake compared with their digests in the rows of `runs`.

use std::fs;
use std::io::Seek as _;
use std::path::Path;

use super::error::folder_error;
use super::{Lake, LakeError, Result, encoded, rows_of};
use crate::input::{self, Bound};
use crate::manifest::{RunKey, digest};
use crate::rows::Field as _;
use crate::schema::{self, TableSchema};
use crate::table::{self, FileError, FileErrorKind, Opened, Seal, Table};

/// The evidence that a table is as its run wrote it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VouchedBy {
    /// The digest of its file in the run's row of `runs`.
    Row,
    /// The digest of its content, which the file itself carries; it is in no row.
    Itself,
    /// None: it was written before tables carried a digest, and it is outside its lake.
    Nothing,
}

impl Lake {
    /// Reads a table of a run unchecked, and states whether its content has the digest that its file carries.
    pub fn read_as_it_is(&self, table: &str, key: &RunKey) -> Result<Opened> {
        let schema = schema::find(table)?;
        let file = self.open(table, key)?;
        let place = self.place(table, key)?.named();
        Ok(table::open(file, &place, schema)?)
    }

    /// `None` where there is no row; an error where the row does not name the file. A run that learnt from several
    /// sessions has files in the folder of each, and its row in one of them.
    pub(super) fn written_digest(&self, table: &str, key: &RunKey) -> Result<Option<String>> {
        let Some(row) = self.row_of(rows_of(table), key)? else { return Ok(None) };
        let name = format!("{table}/{}", key.session);
        let texts = |column| Vec::<String>::all(&row, column).next().unwrap_or_default();
        let (names, digests) = (texts(&["table_names"]), texts(&["table_digests"]));
        let place = names.iter().position(|own| *own == name);
        match place.and_then(|place| digests.get(place)) {
            Some(digest) => Ok(Some(digest.clone())),
            None => {
                Err(LakeError::NotOfRun { place: self.place(table, key)?, run: key.run.clone() })
            }
        }
    }

    /// The row of the run, or of the session as joined, that has a file with this key.
    fn row_of(&self, rows: &str, key: &RunKey) -> Result<Option<Table>> {
        if self.has(rows, key)? {
            return Ok(Some(self.read(rows, key)?));
        }
        let folder = format!("{rows}/{}", encoded("robot", &key.robot)?);
        let name = format!("/{}.parquet", encoded("run", &key.run)?);
        let listed = self.store.list(&folder, 1..=1)?;
        let Some(found) = listed.iter().find(|file| file.key.ends_with(&name)) else {
            return Ok(None);
        };
        let place = self.store.place(&found.key).named();
        let file = self.store.open_listed(found)?;
        Ok(Some(table::read_open(file, &place, schema::find(rows)?)?))
    }

    /// Reads a table of a run, which has to have the digest in its row of `runs`, where there is one.
    pub(super) fn read_vouched(&self, table: &str, key: &RunKey) -> Result<(Table, VouchedBy)> {
        if table != rows_of(table)
            && let Some(written) = self.written_digest(table, key)?
        {
            return Ok((self.read_written(table, key, &written)?, VouchedBy::Row));
        }
        let opened = self.read_as_it_is(table, key)?;
        let is_sealed = opened.seal != Seal::Absent;
        let vouched = if is_sealed { VouchedBy::Itself } else { VouchedBy::Nothing };
        Ok((opened.believed(&self.place(table, key)?.named())?, vouched))
    }

    /// Reads a table of a run whose file has to have this digest.
    pub fn read_written(&self, table: &str, key: &RunKey, written: &str) -> Result<Table> {
        let place = self.place(table, key)?;
        let named = place.named();
        let wrong = folder_error("read", &named);
        let mut file = self.open(table, key)?;
        let (found, _) = digest(&file).map_err(&wrong)?;
        if found != written {
            return Err(LakeError::NotAsWritten { place, found, written: written.to_owned() });
        }
        file.rewind().map_err(&wrong)?;
        Ok(table::open(file, &named, schema::find(table)?)?.believed(&named)?)
    }
}

/// Reads a published table by its path, as the user gives it; a table without evidence is logged.
pub fn read_given(path: &Path, schema: &'static TableSchema) -> Result<Table, FileError> {
    let (table, vouched) = read_by_path(path, schema)?;
    if vouched == VouchedBy::Nothing {
        tracing::warn!(
            "{}: nothing shows that it is unchanged: tables carried no digest of their content then, and it is outside its \
             lake; name the file in its lake, or run its session again",
            path.display().to_string().escape_debug()
        );
    }
    Ok(table)
}

/// A table in its lake, next to a folder `runs`: its run's row has to name it with its digest. Elsewhere the digest
/// that the file carries has to be right; missing evidence is reported.
pub(super) fn read_by_path(
    path: &Path,
    schema: &'static TableSchema,
) -> Result<(Table, VouchedBy), FileError> {
    let file =
        input::open(path, Bound::TABLE).map_err(|source| FileErrorKind::Open(source).at(path))?;
    let opened = table::open_within(file, path, schema, Bound::TABLE.of_values())?;
    let Some(lake) = lake_of(path, schema) else {
        let is_sealed = opened.seal != Seal::Absent;
        let vouched = if is_sealed { VouchedBy::Itself } else { VouchedBy::Nothing };
        return Ok((opened.believed(path)?, vouched));
    };
    let problem = |problem: String| FileErrorKind::NotOfLake(problem).at(path);
    let root = lake.root();
    let table = opened.believed(path)?;
    let key = table.key().cloned();
    let key = key.ok_or_else(|| problem("it does not state its run".to_owned()))?;
    let own = lake.place(&schema.table, &key);
    let own = own.map_err(|error| problem(error.to_string()))?;
    let is_here = |own: &Path| {
        let ends = [own, path].map(fs::canonicalize);
        matches!(&ends, [Ok(own), Ok(here)] if own == here)
    };
    if !own.as_path().is_some_and(is_here) {
        return Err(problem(format!(
            "it states that it is of run {} of robot {:?} and session {:?}, whose file in the lake {} is another one",
            key.run,
            key.robot,
            key.session,
            root.display()
        )));
    }
    match lake.read_vouched(&schema.table, &key) {
        Ok((table, VouchedBy::Row)) => Ok((table, VouchedBy::Row)),
        Ok(_) => Err(problem(format!(
            "the lake {} has no row of run {} in runs: it was deleted, or the run was never committed",
            root.display(),
            key.run
        ))),
        Err(LakeError::File(error)) => Err(error),
        Err(error) => Err(problem(error.to_string())),
    }
}

/// The lake that holds a file of this table, a folder that has rows of `runs`; `None` where there is none.
fn lake_of(path: &Path, schema: &TableSchema) -> Option<Lake> {
    let whole = fs::canonicalize(path).ok()?;
    let folder = whole.ancestors().nth(3)?;
    if folder.file_name()? != schema.table.as_str() {
        return None;
    }
    let lake = Lake::new(folder.parent()?);
    let rows = lake.store.list("runs", 2..=2);
    rows.map_or(true, |rows| !rows.is_empty()).then_some(lake)
}
