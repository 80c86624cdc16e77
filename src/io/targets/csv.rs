//! Targets in CSV: a first line that names the columns, a line a target, nothing where a value is absent.

use std::path::Path;

use ::csv::{ReaderBuilder, StringRecord, Trim};

use super::{Place, Row, RowProblem, Rows, TargetsError};

const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const TARGET: &str = "target";
const TEXTS: [&str; 3] = ["configuration", "tool", "table_id"];

/// Reads the rows with their lines.
pub(super) fn rows(path: &Path) -> Result<Rows, TargetsError> {
    let failed = |source| TargetsError::Csv {
        path: path.to_owned(),
        source,
    };
    let mut reader = ReaderBuilder::new()
        .trim(Trim::All)
        .from_path(path)
        .map_err(failed)?;
    let header = Header::new(path, reader.headers().map_err(failed)?)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(failed)?;
        let place = Place::Line(record.position().map_or(0, ::csv::Position::line));
        let row = header.row(&record);
        rows.push((place, row.map_err(|problem| problem.at(path, place))?));
    }
    Ok((rows, header.unused()))
}

/// The columns that the first line names.
struct Header {
    columns: Vec<String>,
}

impl Header {
    fn new(path: &Path, names: &StringRecord) -> Result<Self, TargetsError> {
        let columns: Vec<String> = names.iter().map(str::to_owned).collect();
        let twice = (1..columns.len()).find(|&place| columns[..place].contains(&columns[place]));
        if let Some(place) = twice {
            return Err(TargetsError::SameColumn {
                path: path.to_owned(),
                column: columns[place].clone(),
            });
        }
        let header = Self { columns };
        let missing: Vec<_> = [TARGET]
            .into_iter()
            .chain(POSITION)
            .filter(|column| header.place(column).is_none())
            .collect();
        if missing.is_empty() {
            return Ok(header);
        }
        Err(TargetsError::MissingColumns {
            path: path.to_owned(),
            missing,
            found: header.columns,
        })
    }

    fn place(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|name| name == column)
    }

    fn unused(self) -> Vec<String> {
        let used = |name: &str| {
            name == TARGET
                || POSITION.contains(&name)
                || QUATERNION.contains(&name)
                || TEXTS.contains(&name)
        };
        self.columns
            .into_iter()
            .filter(|name| !used(name))
            .collect()
    }

    fn row(&self, record: &StringRecord) -> Result<Row, RowProblem> {
        let cells = Cells {
            header: self,
            record,
        };
        let [x, y, z] = POSITION.map(|column| {
            let number = cells.number(column)?;
            there(column, number)
        });
        let [qx, qy, qz, qw] = QUATERNION.map(|column| cells.number(column));
        let [configuration, tool, table_id] = TEXTS.map(|column| cells.text(column));
        Ok(Row {
            target: there(TARGET, cells.text(TARGET))?,
            position: [x?, y?, z?],
            quaternion: [qx?, qy?, qz?, qw?],
            configuration,
            tool,
            table_id,
        })
    }
}

/// One line under its header.
#[derive(Clone, Copy)]
struct Cells<'a> {
    header: &'a Header,
    record: &'a StringRecord,
}

impl Cells<'_> {
    fn text(self, column: &str) -> Option<String> {
        let text = self.record.get(self.header.place(column)?)?;
        (!text.is_empty()).then(|| text.to_owned())
    }

    fn number(self, column: &'static str) -> Result<Option<f64>, RowProblem> {
        let Some(text) = self.text(column) else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(RowProblem::NoNumber { column, text }),
        }
    }
}

fn there<T>(column: &'static str, value: Option<T>) -> Result<T, RowProblem> {
    value.ok_or(RowProblem::NoValue { column })
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::super::{Targets, read};
    use super::*;

    fn targets(text: &str) -> Result<Targets, String> {
        let mut file = tempfile::Builder::new().suffix(".csv").tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        read(file.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name_and_rows_keep_their_order() {
        // A byte order mark and CRLF, as spreadsheets write them; a column of the caller's own.
        let text = "\u{feff}z_mm, x_mm,y_mm,target,qx,qy,qz,qw,note\r\n\
                    450.25,751.1234567,-20,\"B, left\",0,0,0.70710678,0.70710678,first\r\n450,752,-20,A,,,,,\r\n";
        let found = targets(text).unwrap();
        let [first, second] = found.targets.as_slice() else {
            panic!("{found:?}");
        };
        assert_eq!(first.name, "B, left");
        assert_eq!(
            first.position.point(),
            &nalgebra::Point3::new(751.123_456_7, -20.0, 450.25)
        );
        let quarter =
            nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        assert!(first.orientation.unwrap().angle_to(&quarter) < 1e-7);
        assert_eq!((second.name.as_str(), second.orientation), ("A", None));
        assert_eq!(found.unused, ["note"]);
    }

    #[test]
    fn what_is_wrong_is_told_by_line_and_column() {
        let head = "target,x_mm,y_mm,z_mm,qx,qy,qz,qw,table_id\n";
        let good = "A,1,2,3,,,,,\n";
        let cases = [
            (
                "B,1.0e400,2,3,,,,,\n",
                "line 3: column \"x_mm\" holds \"1.0e400\", which is no finite number",
            ),
            (
                "B,1,2 mm,3,,,,,\n",
                "line 3: column \"y_mm\" holds \"2 mm\"",
            ),
            ("B,1,2,,,,,,\n", "line 3: column \"z_mm\" is empty"),
            (",1,2,3,,,,,\n", "line 3: column \"target\" is empty"),
            (
                "A,1,2,3,,,,,\n",
                "line 3: target \"A\" stands in line 2 already",
            ),
            (
                "B,1,2,3,0,0,,1,\n",
                "line 3: an orientation is four numbers",
            ),
            ("B,1,2,3,0,0,1,1,\n", "line 3: qx qy qz qw have norm 1.414"),
            (
                "B,1,2,3,,,,,t-1\n",
                "target \"B\" is corrected already, with table \"t-1\"",
            ),
            ("B,1,2\n", "line: 3"),
        ];
        for (line, expected) in cases {
            let error = targets(&format!("{head}{good}{line}")).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_file_that_is_none_of_targets_is_told_so() {
        let cases = [
            (
                "target;x_mm;y_mm;z_mm\nA;1;2;3\n",
                "missing columns target, x_mm, y_mm, z_mm; its first line names [\"target;x_mm",
            ),
            (
                "target,x_mm,x_mm,y_mm,z_mm\n",
                "column \"x_mm\" stands twice",
            ),
            ("target,x_mm,y_mm,z_mm\n", "holds no target"),
            ("", "missing columns target"),
        ];
        for (text, expected) in cases {
            let error = targets(text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
        let error = read(Path::new("targets.txt")).unwrap_err().to_string();
        assert_eq!(error, "targets.txt: files of targets are .csv or .parquet");
        let error = read(Path::new("/nowhere/targets.csv"))
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("cannot read /nowhere/targets.csv as CSV"),
            "{error}"
        );
    }
}
