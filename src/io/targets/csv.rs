//! Targets in CSV: a first line that names the columns, one line per target, an empty cell where a value is absent.
//!
//! Commas, semicolons, tabs or bars separate cells: what parts `target` from the other names. Above that line may stand a title,
//! comments or `sep=;`. Where no number has a decimal point, and commas do not separate, a comma is the decimal mark.

use std::io;
use std::path::Path;

use ::csv::{ReaderBuilder, StringRecord, Trim};

use super::angles::AngleColumns;
use super::{Place, Row, RowProblem, Rows, TargetsError, TargetsErrorKind, bytes, formula, names};
use crate::compensation::TargetJoints;
use crate::ingest::AngleUnit;
use crate::input::Bound;
use crate::measured_table::decode;

const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const TARGET: &str = "target";
const TEXTS: [&str; 2] = ["configuration", "tool"];

pub(super) fn rows(path: &Path, bound: Bound) -> Result<Rows, TargetsError> {
    let failed = |source| TargetsErrorKind::Csv(source).at(path);
    let bytes = bytes(path, bound)?;
    let decoded = decode(&bytes)
        .map_err(|fault| TargetsErrorKind::Read(io::Error::other(fault.to_string())).at(path))?;
    let text: &str = &decoded.text;
    let (above, text) = header(text);
    let separator = separator(text);
    let mut reader = ReaderBuilder::new();
    let mut reader = reader.trim(Trim::All).delimiter(separator).from_reader(text.as_bytes());
    let mut header = Header::new(path, reader.headers().map_err(failed)?)?;
    let records = reader.records().collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let has_point = |cell: &str| cell.contains('.') && cell.parse::<f64>().is_ok();
    header.decimal_comma = separator != b',' && !records.iter().flatten().any(has_point);
    let mut rows = Vec::with_capacity(records.len());
    for record in records {
        let line = record.position().map_or(0, ::csv::Position::line);
        let place = Place::Line(line + above);
        let row = header.row(&record);
        rows.push((place, row.map_err(|problem| problem.at(path, place))?));
    }
    let units = header.angles.as_ref();
    let units = units.map_or_else(|| AngleUnit::Rad.into(), |own| own.units.clone());
    Ok(Rows { placed: rows, unused: header.unused(), units })
}

/// Most lines above the names of the columns.
const MOST_ABOVE: usize = 30;

/// The number of lines above the first that names `target`, and the text from that one on; all of it where none does.
fn header(text: &str) -> (u64, &str) {
    let mut rest = text;
    for above in 0..MOST_ABOVE as u64 {
        if b",;\t|".iter().any(|sign| names_target(rest, *sign)) {
            return (above, rest);
        }
        let Some((_, behind)) = rest.split_once('\n') else { break };
        rest = behind;
    }
    (0, text)
}

fn names_target(text: &str, sign: u8) -> bool {
    let first = text.lines().next().unwrap_or_default();
    first.split(char::from(sign)).any(|cell| cell.trim().trim_matches('"') == TARGET)
}

/// The sign that parts the name `target` from others in the first line; a comma where none does.
fn separator(text: &str) -> u8 {
    let comma = names_target(text, b',');
    b";\t|".iter().copied().find(|sign| !comma && names_target(text, *sign)).unwrap_or(b',')
}

struct Header {
    columns: Vec<String>,
    decimal_comma: bool,
    angles: Option<AngleColumns>,
}

impl Header {
    fn new(path: &Path, names: &StringRecord) -> Result<Self, TargetsError> {
        let columns: Vec<String> = names.iter().map(str::to_owned).collect();
        names::check(columns.iter().map(String::as_str))
            .map_err(|problem| TargetsErrorKind::Row(problem.into()).at(path))?;
        let angles = AngleColumns::of(&columns)
            .map_err(|problem| TargetsErrorKind::Angles(problem).at(path))?;
        let header = Self { columns, decimal_comma: false, angles };
        let missing = header.missing();
        if missing.is_empty() {
            return Ok(header);
        }
        let found = header.columns;
        Err(TargetsErrorKind::MissingColumns { missing, found }.at(path))
    }

    /// Columns that every file of targets has: a name, and a position or joint angles.
    fn missing(&self) -> Vec<String> {
        let has_position = POSITION.iter().any(|column| self.place(column).is_some());
        let position = POSITION.iter().filter(|_| has_position || self.angles.is_none());
        let needed = [TARGET].into_iter().chain(position.copied());
        needed.filter(|column| self.place(column).is_none()).map(str::to_owned).collect()
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
                || names::is_mark(name)
        };
        let angles = self.angles.map_or_else(Vec::new, |angles| angles.places);
        let named = self.columns.into_iter().enumerate();
        named
            .filter(|(place, name)| !used(name) && !angles.contains(place))
            .map(|(_, name)| name)
            .collect()
    }

    fn row(&self, record: &StringRecord) -> Result<Row, RowProblem> {
        let cells = Cells { header: self, record };
        let [x, y, z] = POSITION.map(|column| cells.number(column));
        let [qx, qy, qz, qw] = QUATERNION.map(|column| cells.number(column));
        let [configuration, tool] = TEXTS.map(|column| cells.text(column));
        Ok(Row {
            target: cells.text(TARGET).ok_or(RowProblem::NoValue { column: TARGET })?,
            position: [x?, y?, z?],
            joints: cells.joints()?,
            quaternion: [qx?, qy?, qz?, qw?],
            configuration,
            tool,
            table_id: cells.mark(),
        })
    }
}

#[derive(Clone, Copy)]
struct Cells<'a> {
    header: &'a Header,
    record: &'a StringRecord,
}

impl Cells<'_> {
    fn text(self, column: &str) -> Option<String> {
        self.text_at(self.header.place(column)?)
    }

    fn text_at(self, place: usize) -> Option<String> {
        let text = self.record.get(place)?;
        (!text.is_empty()).then(|| formula::unmarked(text).to_owned())
    }

    /// The value that marks the line as a command; `None` for a target.
    fn mark(self) -> Option<String> {
        let columns = self.header.columns.iter().enumerate();
        let mut marks = columns.filter(|(_, name)| names::is_mark(name));
        marks.find_map(|(place, _)| self.text_at(place))
    }

    fn number(self, column: &str) -> Result<Option<f64>, RowProblem> {
        let place = self.header.place(column);
        place.map_or(Ok(None), |place| self.number_at(place))
    }

    fn number_at(self, place: usize) -> Result<Option<f64>, RowProblem> {
        let Some(text) = self.text_at(place) else { return Ok(None) };
        let is_comma = self.header.decimal_comma && !text.contains('.');
        let number =
            if is_comma { text.replacen(',', ".", 1).parse() } else { text.parse::<f64>() };
        match number {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(RowProblem::NoNumber { column: self.header.columns[place].clone(), text }),
        }
    }

    fn joints(self) -> Result<Option<TargetJoints>, RowProblem> {
        let angles = self.header.angles.as_ref();
        angles
            .map_or(Ok(None), |own| own.joints(&self.header.columns, |place| self.number_at(place)))
    }
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
        // A byte order mark and CRLF, as spreadsheets write them, and a column of the user's own.
        let text = "\u{feff}z_mm, x_mm,y_mm,target,qx,qy,qz,qw,note\r\n\
                    450.25,751.1234567,-20,\"B, left\",0,0,0.70710678,0.70710678,first\r\n450,752,-20,A,,,,,\r\n";
        let found = targets(text).unwrap();
        let [first, second] = found.targets.as_slice() else {
            panic!("{found:?}");
        };
        assert_eq!(first.name, "B, left");
        assert_eq!(
            first.position.unwrap().point(),
            &nalgebra::Point3::new(751.123_456_7, -20.0, 450.25)
        );
        let quarter =
            nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        assert!(first.orientation.unwrap().angle_to(&quarter) < 1e-7);
        assert_eq!((second.name.as_str(), second.orientation), ("A", None));
        assert_eq!(found.unused, ["note"]);
    }

    #[test]
    fn what_spreadsheets_write_is_read_as_tables_of_stations_are() {
        let wanted = targets("target,x_mm,y_mm,z_mm\nA,1575.5,-33,991\n").unwrap();
        for text in [
            "target;x_mm;y_mm;z_mm\nA;1575,5;-33,0;991,0\n",
            "target;x_mm;y_mm;z_mm\r\nA;1575.5;-33;991\r\n",
            "target\tx_mm\ty_mm\tz_mm\nA\t1575.5\t-33\t991\n",
            "sep=;\ntarget;x_mm;y_mm;z_mm\nA;1575,5;-33;991\n",
            "sep=;\r\ntarget;x_mm;y_mm;z_mm\r\nA;1575,5;-33;991\r\n",
        ] {
            assert_eq!(targets(text).unwrap(), wanted, "{text:?}");
        }
        for (cell, line) in [("1.575,5", 3), ("1,575", 3)] {
            let text = format!("SEP=;\ntarget;x_mm;y_mm;z_mm\nA;{cell};1.5;2\n");
            let told = targets(&text).unwrap_err();
            assert!(told.contains(&format!("line {line}: column \"x_mm\" holds")), "{told}");
        }
    }

    #[test]
    fn joint_angles_come_in_either_unit_with_or_without_a_position() {
        let found = targets("target,q2_deg,q1_deg\nA,180,-90\n").unwrap();
        let joints = found.targets[0].joints.as_ref().unwrap();
        assert_eq!(joints.angles, [-90_f64, 180.0].map(f64::to_radians));
        assert_eq!(found.targets[0].position, None);
        assert_eq!(
            (found.units.angle(), found.unused.len()),
            (AngleUnit::Deg, 0),
            "columns of angles are used"
        );
        let found =
            targets("target,x_mm,y_mm,z_mm,q1_rad\nA,1,2,3,0.5\nB,1,2,3,\nC,,,,1\n").unwrap();
        let [a, b, c] = found.targets.as_slice() else {
            panic!("{found:?}");
        };
        assert!(a.position.is_some() && a.joints.as_ref().unwrap().angles == [0.5]);
        assert_eq!((&b.joints, c.position), (&None, None));
        let error = targets("target,q1_rad,q2_rad\nA,1,\n").unwrap_err();
        assert!(error.contains("line 2: q2_rad is empty"), "{error}");
        let error = targets("target,q1_rad,q2_deg\nA,1,2\n").unwrap_err();
        assert!(error.contains("give all in one unit"), "{error}");
        let error = targets("target,x_mm,q1_rad\nA,1,2\n").unwrap_err();
        assert!(error.contains("missing columns y_mm, z_mm"), "{error}");
    }

    #[test]
    fn what_is_wrong_is_reported_by_line_and_column() {
        let head = "target,x_mm,y_mm,z_mm,qx,qy,qz,qw,table_id\n";
        let good = "A,1,2,3,,,,,\n";
        let cases = [
            (
                "B,1.0e400,2,3,,,,,\n",
                "line 3: column \"x_mm\" holds \"1.0e400\", which is no finite number",
            ),
            ("B,1,2 mm,3,,,,,\n", "line 3: column \"y_mm\" holds \"2 mm\""),
            ("B,1,2,,,,,,\n", "line 3: a position is three numbers"),
            ("B,,,,,,,,\n", "line 3: target \"B\" has neither a position"),
            (",1,2,3,,,,,\n", "line 3: column \"target\" is empty"),
            ("A,1,2,3,,,,,\n", "line 3: target \"A\" is in line 2 already"),
            ("B,1,2,3,0,0,,1,\n", "line 3: an orientation is four numbers"),
            ("B,1,2,3,0,0,1,1,\n", "line 3: qx qy qz qw have norm 1.414"),
            ("B,1,2,3,,,,,t-1\n", "target \"B\" is corrected already, with table \"t-1\""),
            ("B,1,2\n", "line: 3"),
        ];
        for (line, expected) in cases {
            let error = targets(&format!("{head}{good}{line}")).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn lines_above_the_names_are_passed_over_and_counted() {
        let text = "Panel 7, left\n# measured on Monday\n\ntarget;x_mm;y_mm;z_mm\nA;1;2;x\n";
        let error = targets(text).unwrap_err();
        assert!(error.contains("line 5: column \"z_mm\" holds \"x\""), "{error}");
    }

    #[test]
    fn a_file_that_is_none_of_targets_is_reported_so() {
        let cases = [
            (
                "name;x_mm;y_mm;z_mm\nA;1;2;3\n",
                "missing columns target, x_mm, y_mm, z_mm; its first line names [\"name;x_mm",
            ),
            ("target,x_mm,x_mm,y_mm,z_mm\n", "\"x_mm\" is given twice"),
            ("target,x_mm,y_mm,z_mm\n", "holds no target"),
            ("", "missing columns target"),
        ];
        for (text, expected) in cases {
            let error = targets(text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
        let error = read(Path::new("targets.txt")).unwrap_err().to_string();
        assert_eq!(error, "targets.txt: files of targets are .csv, .parquet or .json");
        let error = read(Path::new("/nowhere/targets.csv")).unwrap_err().to_string();
        assert!(
            error.starts_with("/nowhere/targets.csv: it cannot be read: No such file"),
            "{error}"
        );
    }

    #[test]
    fn a_mark_is_known_in_any_letters_and_other_names_are_reported() {
        for head in ["Table_ID", "TABLE_ID ", "corrected_by", "Corrected_By"] {
            let text = format!("target,x_mm,y_mm,z_mm,{head}\nA,1,2,3,t-1\n");
            let error = targets(&text).unwrap_err();
            assert!(error.contains("line 2: target \"A\" is corrected already"), "{error}");
            let text = format!("target,x_mm,y_mm,z_mm,{head}\nA,1,2,3,\n");
            assert_eq!(targets(&text).unwrap().unused.len(), 0);
        }
        for (head, expected) in [
            ("target,X_mm,y_mm,z_mm", "\"x_mm\" is; write it so"),
            ("target,x_mm,y_mm,z_mm,X_MM", "\"X_MM\" is no name that is known here"),
            ("target,x_mm,y_mm,z_mm,id,ID", "\"id\" and \"ID\" differ"),
        ] {
            let error = targets(&format!("{head}\n")).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_name_that_a_spreadsheet_would_run_comes_back_as_it_was() {
        let found = targets("target,x_mm,y_mm,z_mm,tool\n'=1+1,-1.5,+2,3,'-drill\n'A',1,2,3,\n");
        let found = found.unwrap().targets;
        assert_eq!((found[0].name.as_str(), found[1].name.as_str()), ("=1+1", "'A'"));
        assert_eq!(found[0].tool.as_deref(), Some("-drill"));
        assert_eq!(found[0].position.unwrap().coords().x.to_string(), "-1.5");
    }
}
