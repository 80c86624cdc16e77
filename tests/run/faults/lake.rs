//! A lake as a reader finds it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use arrow::array::Array as _;
use arrow::array::StringArray;
use posegrid::files::schema;
use posegrid::files::table::{self, Table};
use posegrid::io::lake::Lake;

use crate::cell::published;

/// Asserts that nothing in the lake is half there; gives the number of its runs.
pub fn check(root: &Path, what: &str) -> usize {
    for path in published(root).keys().filter(|path| is_published(path)) {
        whole(root, path, what);
    }
    let rows = Lake::new(root).runs().expect("a lake");
    for (path, row) in &rows {
        let row =
            row.as_ref().unwrap_or_else(|error| panic!("{what}: {}: {error}", path.display()));
        has_its_files(root, &row.table, what);
    }
    rows.len()
}

/// Whether a reader would take the file for a table: temporaries are hidden by their dot.
fn is_published(path: &str) -> bool {
    let name = path.rsplit('/').next().unwrap_or(path);
    !name.starts_with('.') && name.ends_with(".parquet")
}

fn whole(root: &Path, path: &str, what: &str) {
    let table = path.split('/').next().expect("a table's folder");
    let schema = schema::find(table).unwrap_or_else(|error| panic!("{what}: {path}: {error}"));
    let read = table::read(&root.join(path), schema);
    assert!(read.is_ok(), "{what}: {path}: {:?}", read.err());
}

/// Asserts that every file that a row of `runs` names is there, with the digest that it states.
fn has_its_files(root: &Path, row: &Table, what: &str) {
    let key = row.key().expect("one run");
    let (names, digests) = (list(row, "table_names"), list(row, "table_digests"));
    assert!(names.len() > 10 && names.len() == digests.len(), "{what}: {names:?}");
    for (name, digest) in names.iter().zip(&digests) {
        let (table, session) = name.split_once('/').expect("TABLE/SESSION");
        let ending = if table == "report" { "html" } else { "parquet" };
        let path = format!("{table}/{}/{session}/{}.{ending}", key.robot, key.run);
        let bytes =
            fs::read(root.join(&path)).unwrap_or_else(|error| panic!("{what}: {path}: {error}"));
        assert_eq!(blake3::hash(&bytes).to_hex().as_str(), digest, "{what}: {path}");
    }
}

fn list(row: &Table, column: &str) -> Vec<String> {
    let values = row.list(column).value(0);
    let values = values.as_any().downcast_ref::<StringArray>().expect("texts");
    values.iter().flatten().map(str::to_owned).collect()
}

/// Files under temporary names.
pub fn temporaries(root: &Path) -> BTreeSet<String> {
    let files = published(root).into_keys();
    files.filter(|path| path.contains(".tmp-")).collect()
}
