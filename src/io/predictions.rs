//! Predictions of other programs, and what these need for them: CSV files of a benchmark.
//!
//! A file of predictions has the columns `station,x,y,z`: station numbers as in `test.csv`, positions in mm in the frame that training
//! positions are in. Six more, `cxx,cxy,cxz,cyy,cyz,czz`, state the covariance of measured minus predicted position, mm²; `session` names
//! the session where several test. Any other column, and any value that is no finite number, is an error with its line.

use std::io;
use std::path::{Path, PathBuf};

use csv::StringRecord;
use nalgebra::{Matrix3, Point3};
use thiserror::Error;

use super::input::{self, Bound};
use crate::geometry::symmetric;

/// Columns of a position, mm.
const POSITION: [&str; 3] = ["x", "y", "z"];
/// Columns of a covariance, mm²: the upper triangle by rows.
const COVARIANCE: [&str; 6] = ["cxx", "cxy", "cxz", "cyy", "cyz", "czz"];

/// A predicted position.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedStation {
    /// Its line in the file, from 1.
    pub line: u64,
    /// The session; `None` where the file has no column of it.
    pub session: Option<String>,
    /// The station's number.
    pub station: usize,
    /// The position, mm.
    pub position: Point3<f64>,
    /// Covariance of measured minus predicted position, mm²; `None` where the file states none.
    pub covariance: Option<Matrix3<f64>>,
}

/// Why a file of predictions cannot be used.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct PredictionsError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, with its line, and what to do.
    pub fault: String,
}

/// Reads a file of predictions.
pub fn read(path: &Path) -> Result<Vec<PredictedStation>, PredictionsError> {
    let wrong = |fault: String| PredictionsError { path: path.to_owned(), fault };
    let bytes = input::bytes(path, Bound::TARGETS).map_err(|error| wrong(error.to_string()))?;
    rows(&bytes).map_err(wrong)
}

fn rows(bytes: &[u8]) -> Result<Vec<PredictedStation>, String> {
    // Spreadsheets begin a file with a mark.
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut reader = csv::Reader::from_reader(bytes);
    let names = reader.headers().map_err(|error| error.to_string())?;
    let header = Header::of(names)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let row = header.row(&record, line);
        rows.push(row.map_err(|fault| format!("line {line}: {fault}"))?);
    }
    Ok(rows)
}

/// The places of the columns.
struct Header {
    session: Option<usize>,
    station: usize,
    position: [usize; 3],
    covariance: Option<[usize; 6]>,
}

impl Header {
    fn of(names: &StringRecord) -> Result<Self, String> {
        let names: Vec<&str> = names.iter().map(str::trim).collect();
        let place = |name: &str| names.iter().position(|own| *own == name);
        let is_known = |name: &&&str| {
            POSITION.contains(name)
                || COVARIANCE.contains(name)
                || ["session", "station"].contains(name)
        };
        if let Some(other) = names.iter().find(|name| !is_known(name)) {
            return Err(format!(
                "unknown column {other:?}; the columns are station,x,y,z in mm, then cxx,cxy,cxz,cyy,cyz,czz in mm² where a covariance is \
                 stated, and session where several test"
            ));
        }
        let needed = |name: &str| {
            place(name).ok_or_else(|| format!("no column {name}; its first line is station,x,y,z"))
        };
        let given: Vec<usize> = COVARIANCE.iter().filter_map(|name| place(name)).collect();
        let covariance = match given.len() {
            0 => None,
            6 => given.try_into().ok(),
            _ => {
                return Err(format!("a covariance has six columns: {}", COVARIANCE.join(",")));
            }
        };
        let [x, y, z] = POSITION.map(needed);
        Ok(Self {
            session: place("session"),
            station: needed("station")?,
            position: [x?, y?, z?],
            covariance,
        })
    }

    fn row(&self, record: &StringRecord, line: u64) -> Result<PredictedStation, String> {
        let text = |place: usize| record.get(place).unwrap_or_default().trim();
        let number = |place: usize, name: &str| {
            let number = text(place).parse::<f64>().ok().filter(|own| own.is_finite());
            number.ok_or_else(|| format!("{name} is {:?}, which is no finite number", text(place)))
        };
        let station = text(self.station);
        let station = station.parse();
        let station = station.map_err(|_| {
            format!("station is {:?}; a number from 0 is needed", text(self.station))
        })?;
        let mut position = [0.0; 3];
        for (value, (place, name)) in
            position.iter_mut().zip(self.position.into_iter().zip(POSITION))
        {
            *value = number(place, name)?;
        }
        let covariance = self.covariance.map(|places| {
            let mut own = [0.0; 6];
            for (value, (place, name)) in own.iter_mut().zip(places.into_iter().zip(COVARIANCE)) {
                *value = number(place, name)?;
            }
            positive(own)
        });
        Ok(PredictedStation {
            line,
            session: self.session.map(|place| text(place).to_owned()),
            station,
            position: Point3::from(position),
            covariance: covariance.transpose()?,
        })
    }
}

/// The covariance of its upper triangle; an error where it is not positive definite.
fn positive(upper: [f64; 6]) -> Result<Matrix3<f64>, String> {
    let covariance = symmetric(upper);
    let is_positive = covariance.cholesky().is_some();
    is_positive
        .then_some(covariance)
        .ok_or_else(|| "its covariance is not positive definite".to_owned())
}

/// A station for other programs.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenStation {
    /// The session.
    pub session: String,
    /// The station's number.
    pub station: usize,
    /// Angles of the joints as the robot file takes them, rad; mm of a joint that slides.
    pub joints: Vec<f64>,
    /// The measured position, mm; `None` of a station that tests.
    pub measured: Option<Point3<f64>>,
}

/// The CSV file of stations: session, station, joints `q1`, `q2`, …, and measured `x,y,z`, empty of those that test.
pub fn csv_of(stations: &[GivenStation]) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let joints = stations.first().map_or(0, |own| own.joints.len());
    let joints = (1..=joints).map(|joint| format!("q{joint}"));
    let named = ["session", "station"].map(str::to_owned).into_iter();
    let position = POSITION.map(str::to_owned);
    writer.write_record(named.chain(joints).chain(position))?;
    for own in stations {
        let named = [own.session.clone(), own.station.to_string()].into_iter();
        let joints = own.joints.iter().map(f64::to_string);
        let measured =
            (0..3).map(|axis| own.measured.map_or(String::new(), |at| at[axis].to_string()));
        writer.write_record(named.chain(joints).chain(measured))?;
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn predictions_are_read_and_each_fault_is_named_with_its_line() {
        let good = rows(
            "\u{feff}station,x,y,z,cxx,cxy,cxz,cyy,cyz,czz\n3,1.5,2,-3e2,1,0,0,1,0,4\n".as_bytes(),
        )
        .unwrap();
        assert_eq!((good[0].station, good[0].position.z), (3, -300.0));
        assert_eq!(good[0].covariance, Some(Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 4.0))));
        let fault = |text: &str| rows(text.as_bytes()).unwrap_err();
        assert_eq!(
            fault("station,x,y,z\n1,1,NaN,2\n"),
            "line 2: y is \"NaN\", which is no finite number"
        );
        assert!(
            fault("station,x,y,z\n1,1,2,3\n-4,1,1,1\n").starts_with("line 3: station is \"-4\"")
        );
        assert!(fault("station,x_mm,y,z\n").contains("unknown column \"x_mm\""));
        assert!(fault("station,x,y\n").contains("no column z"));
        assert!(fault("station,x,y,z,cxx\n").contains("six columns"));
        assert!(
            fault("station,x,y,z,cxx,cxy,cxz,cyy,cyz,czz\n1,1,1,1,1,2,0,1,0,1\n")
                .contains("positive definite")
        );
    }
}
