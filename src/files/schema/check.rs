//! The rules for schema files.

use super::{ColumnSchema, ColumnType, KEY_COLUMNS, Role, SchemaError, TableSchema};

impl TableSchema {
    /// Checks every rule; the first broken one is the error.
    pub(super) fn check(&self) -> Result<(), SchemaError> {
        let broken = |place: &str, rule| {
            Err(SchemaError::Rule { table: self.table.clone(), place: place.to_owned(), rule })
        };
        if !is_plain(&self.table) {
            return broken("table", "a name is made of a-z, 0-9 and _");
        }
        if !self.changes_match_version() {
            return broken("changes", "one line a version, each beginning \"VERSION: \"");
        }
        if self.reads_from.is_some_and(|oldest| oldest == 0 || oldest >= self.version) {
            return broken("reads_from", "it is an older version than this one");
        }
        if let Some(name) = self.removed.iter().find(|name| self.column(name).is_some()) {
            return broken(name, "a removed column is none of the table's");
        }
        let is_key = |(column, key): (&ColumnSchema, &str)| column.name == key && !column.nullable;
        let keys = self.columns.iter().zip(KEY_COLUMNS).filter(|&pair| is_key(pair));
        if self.role == Role::Published && keys.count() != KEY_COLUMNS.len() {
            return broken("column", "the first columns are robot, session and run, never null");
        }
        for name in &self.order {
            if !self.column(name).is_some_and(|(_, c)| c.kind.is_scalar()) {
                return broken(name, "`order` names scalar columns of the table");
            }
        }
        for (index, column) in self.columns.iter().enumerate() {
            if let Some(rule) = self.broken_rule(index, column) {
                return broken(&column.name, rule);
            }
        }
        Ok(())
    }

    fn changes_match_version(&self) -> bool {
        let numbered = |(line, number): (&String, u32)| line.starts_with(&format!("{number}: "));
        self.changes.len() == self.version as usize && self.changes.iter().zip(1..).all(numbered)
    }

    /// Whether a column that older files lack is declared as never absent.
    fn is_never_absent(&self, column: &ColumnSchema) -> bool {
        let older = |since: u32| self.reads_from.is_some_and(|oldest| oldest < since);
        let fits = |since| older(since) && since <= self.version && column.nullable;
        column.since.is_some_and(|since| !fits(since))
    }

    fn broken_rule(&self, index: usize, column: &ColumnSchema) -> Option<&'static str> {
        let unit = column.unit.as_deref();
        let unit_column = unit.and_then(|unit| unit.strip_prefix("column "));
        Some(if !is_plain(&column.name) {
            "a name is made of a-z, 0-9 and _"
        } else if self.columns[..index].iter().any(|c| c.name == column.name) {
            "the name is given twice"
        } else if column.kind.is_number() != unit.is_some() {
            "a number has a unit (\"1\" without dimension), anything else has none"
        } else if unit_column.is_some_and(|name| self.column(name).is_none()) {
            "its unit names a column that does not exist"
        } else if column.values.is_some() && column.kind != ColumnType::String {
            "only a string has `values`"
        } else if self.is_never_absent(column) {
            "a column with `since` is newer than `reads_from` and may be null, as older files lack it"
        } else if column.description.is_empty() {
            "a description is missing"
        } else {
            return None;
        })
    }
}

fn is_plain(name: &str) -> bool {
    !name.is_empty()
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = r#"
        table = "small"
        version = 1
        role = "accepted"
        description = "A table."
        one_row_per = "thing"
        order = ["name"]
        changes = ["1: first version"]
        [[column]]
        name = "name"
        type = "string"
        values = ["a", "b"]
        description = "Its name."
        [[column]]
        name = "length_mm"
        type = "float64"
        unit = "mm"
        description = "Its length."
    "#;

    #[test]
    fn a_schema_that_breaks_a_rule_is_refused() {
        assert!(TableSchema::parse(SMALL).is_ok());
        let cases = [
            ("version = 1", "version = 2", "changes: one line a version"),
            ("role = \"accepted\"", "role = \"published\"", "robot, session and run"),
            ("order = [\"name\"]", "order = [\"age\"]", "age: `order` names scalar columns"),
            ("name = \"length_mm\"", "name = \"name\"", "name: the name is given twice"),
            ("name = \"length_mm\"", "name = \"Länge\"", "a-z, 0-9 and _"),
            ("unit = \"mm\"", "", "length_mm: a number has a unit"),
            ("unit = \"mm\"", "unit = \"column unit\"", "names a column that does not exist"),
            ("type = \"string\"", "type = \"bool\"", "only a string has `values`"),
            ("type = \"string\"", "type = \"float32\"", "unknown variant `float32`"),
            ("one_row_per", "one_row_for", "unknown field `one_row_for`"),
            ("\"Its length.\"", "\"\"", "a description is missing"),
            ("version = 1", "version = 1\nreads_from = 1", "reads_from: it is an older version"),
            ("unit = \"mm\"", "unit = \"mm\"\nsince = 1", "length_mm: a column with `since`"),
        ];
        for (text, replacement, expected) in cases {
            let error =
                TableSchema::parse(&SMALL.replace(text, replacement)).unwrap_err().to_string();
            assert!(error.contains(expected), "{replacement}: {error}");
        }
    }
}
