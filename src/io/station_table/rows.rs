mod references;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Point3, Quaternion, Rotation3, UnitQuaternion};

use super::columns::{Columns, Length, Measured, Sum, Value as Cellular};
use super::{StationTable, name};
use crate::geometry::{PoseCovariance, symmetric};
use crate::ingest::covariances::{self, CovarianceCounts};
use crate::ingest::{
    AngleUnit, CELSIUS, LengthColumns, LengthRead, LengthUnit, LoggedCovariance,
    OrientationColumns, OrientationForm, ReadingColumns, StationsSettings, TableTime, is_length,
};
use crate::join::tabled::{ApartRow, RejectCode, Row, RowItem, RowReading, RowReject, Rows};
use crate::join::{Command, MeanLength, MeanOrientation, MeanPoint, SourceId, TargetId, Value};
use crate::measured_table::{Cell, LeftOutFor, MeasuredTable, RowLeftOut};
use crate::units::round_ns;

/// A quaternion or matrix further from a rotation than this is none.
const ROTATION: f64 = 0.01;

/// An angle of an orientation beyond this, rad, is in degrees.
const MOST_RAD: f64 = 4.0 * std::f64::consts::PI;

/// Numbers of this size, of any quantity in any unit, would only overflow the fits; logs have the same limit.
const WILDEST: f64 = 1e9;

/// No time since 1970 in ns is as large: that of the year 2262.
const LATEST_NS: f64 = 9.2e18;

/// Most rows and readings of a table that are left out: each takes some hundred bytes, and more are no table of stations.
pub(super) const MOST_REJECTS: usize = 100_000;

struct Reader<'a> {
    table: &'a MeasuredTable,
    columns: &'a Columns,
    settings: &'a StationsSettings,
    slides: &'a [bool],
    file: String,
    apart: Vec<ApartRow>,
    covariances: CovarianceCounts,
    rejects: Vec<RowReject>,
}

#[derive(Default)]
struct Long {
    rows: Vec<Row>,
    places: BTreeMap<String, usize>,
    /// Places and targets that have a reading.
    seen: BTreeSet<(usize, TargetId)>,
    lengths: BTreeSet<(usize, usize)>,
}

type Result<T, E = Fault> = std::result::Result<T, E>;

/// Why a value is not used: the column at fault, and the reason.
struct Fault {
    column: Option<usize>,
    reason: String,
    /// Whether there is no value, rather than a wrong one.
    is_missing: bool,
}

/// The rows of `own`, and the rejects of everything else in them.
pub(super) fn rows(
    table: &MeasuredTable,
    columns: &Columns,
    settings: &StationsSettings,
    own: &[usize],
    slides: &[bool],
    file: String,
) -> StationTable {
    let mut reader = Reader {
        table,
        columns,
        settings,
        slides,
        file,
        apart: Vec::new(),
        covariances: CovarianceCounts::NONE,
        rejects: Vec::new(),
    };
    let broken = broken(table, settings);
    for row in &broken {
        reader.reject(RowItem::Row, row.line, Fault::of(row.reason.to_string()));
    }
    let rows = match columns.target {
        None => reader.wide(own),
        Some(target) => reader.long(own, target),
    };
    StationTable {
        covariances: reader.covariances,
        rows: Rows {
            file: reader.file,
            rows,
            apart: reader.apart,
            references: settings.references.iter().map(|own| (own.name.clone(), own.on)).collect(),
            rejects: reader.rejects,
        },
        read: (own.len() + broken.len()) as u64,
    }
}

/// Rows with too few or too many cells, by line; where rows name their sessions, these name none. Repeated headers and
/// comments are no rows at all.
fn broken(table: &MeasuredTable, settings: &StationsSettings) -> Vec<RowLeftOut> {
    let left_out = table.left_out.iter().filter(|_| settings.session.is_none());
    let is_row =
        |row: &&RowLeftOut| matches!(row.reason, LeftOutFor::Cells { .. } | LeftOutFor::NoObject);
    left_out.filter(is_row).copied().collect()
}

impl Reader<'_> {
    fn wide(&mut self, own: &[usize]) -> Vec<Row> {
        let mut named: BTreeMap<String, u64> = BTreeMap::new();
        let mut rows = Vec::with_capacity(own.len());
        for &row in own {
            let references = self.references(row);
            let made = self.once(row, &mut named).and_then(|()| self.station(row));
            match made {
                Err(fault) if fault.is_missing && !references.is_empty() => {
                    self.add_apart(row, references);
                }
                Err(fault) => self.reject(RowItem::Row, self.table.line(row), fault),
                Ok(mut station) => {
                    station.references = references;
                    self.add_readings(&mut station, row);
                    rows.push(station);
                }
            }
        }
        rows
    }

    /// Rows that are a reading each; those with one name are a station, in the order in which the names first stand.
    fn long(&mut self, own: &[usize], target_column: usize) -> Vec<Row> {
        let mut long = Long::default();
        let columns = self.columns;
        for &row in own {
            if let Some(reference) = self.named_reference(row, target_column) {
                self.add_reference(reference, row, &mut long);
                continue;
            }
            let named = name(self.table.cell(row, target_column));
            let mut all = self.settings.lengths.iter();
            if let Some(instrument) = all.position(|own| named.as_ref() == Some(&own.name)) {
                self.add_named_length(instrument, row, &mut long);
                continue;
            }
            match self.placed(row, target_column, &mut long) {
                Err(fault) => self.reject(RowItem::Row, self.table.line(row), fault),
                Ok((place, target)) => {
                    if let [measured, ..] = &columns.measured[..] {
                        let (read, station) =
                            (self.reading(row, 0, measured), &mut long.rows[place]);
                        self.add_reading(station, row, (SourceId::ONLY, target), read);
                    }
                }
            }
        }
        for row in &mut long.rows {
            let readings = &mut row.readings;
            readings.sort_by_key(|reading| (reading.source, reading.target));
        }
        long.rows
    }

    /// Adds the reading of an instrument of one length in a row of a long table to its station.
    fn add_named_length(&mut self, instrument: usize, row: usize, long: &mut Long) {
        let columns = self.columns;
        match self.station_of(row, long) {
            Err(fault) => self.reject(RowItem::Row, self.table.line(row), fault),
            Ok(place) if long.lengths.insert((place, instrument)) => {
                let station = &mut long.rows[place];
                self.add_length(station, row, instrument, &columns.lengths[instrument]);
            }
            Ok(place) => {
                let line = long.rows[place].line;
                let reason =
                    format!("the station of line {line} has a reading of this instrument already");
                self.reject(RowItem::Row, self.table.line(row), Fault::of(reason));
            }
        }
    }

    /// The station and the target of a row of a long table; a station that no earlier row names is new.
    fn placed(
        &self,
        row: usize,
        target_column: usize,
        long: &mut Long,
    ) -> Result<(usize, TargetId)> {
        let target = self.target(row, target_column)?;
        let place = self.station_of(row, long)?;
        if long.seen.insert((place, target)) {
            return Ok((place, target));
        }
        let line = long.rows[place].line;
        Err(Fault::of(format!("the station of line {line} has a reading of this target already")))
    }

    /// The station of a row of a long table; one that no earlier row names is new.
    fn station_of(&self, row: usize, long: &mut Long) -> Result<usize> {
        let column = self.columns.station;
        let station = column.and_then(|column| name(self.table.cell(row, column)));
        let station = station.ok_or_else(|| Fault {
            is_missing: true,
            ..Fault::in_column(column, "it names no station")
        })?;
        if let Some(&place) = long.places.get(&station) {
            self.same_joints(row, &long.rows[place])?;
            return Ok(place);
        }
        long.rows.push(self.station(row)?);
        long.places.insert(station, long.rows.len() - 1);
        Ok(long.rows.len() - 1)
    }

    fn target(&self, row: usize, column: usize) -> Result<TargetId> {
        let named = name(self.table.cell(row, column))
            .ok_or_else(|| Fault::in_column(Some(column), "it names no target"))?;
        let place = self.settings.targets.iter().position(|target| *target == named);
        place.map(TargetId).ok_or_else(|| {
            let problem = format!("its target {named:?} is none of [stations] targets");
            Fault::in_column(Some(column), &problem)
        })
    }

    fn same_joints(&self, row: usize, station: &Row) -> Result<()> {
        let joints = self.joints(row)?;
        let mut pairs = joints.iter().zip(&station.joints);
        if pairs.all(|(own, other)| (own - other).abs() <= 1e-9) {
            return Ok(());
        }
        Err(Fault::of(format!(
            "its joint angles are not those of line {}, which is of the same station",
            station.line
        )))
    }

    fn once(&self, row: usize, named: &mut BTreeMap<String, u64>) -> Result<()> {
        let column = self.columns.station;
        let Some(own) = column.and_then(|column| name(self.table.cell(row, column))) else {
            return Ok(());
        };
        let line = self.table.line(row);
        if let Some(earlier) = named.get(&own) {
            let reason = format!("line {earlier} is of the same station");
            return Err(Fault::in_column(column, &reason));
        }
        named.insert(own, line);
        Ok(())
    }

    fn station(&self, row: usize) -> Result<Row> {
        let temperature = self.columns.temperature.as_ref().map(|own| self.value(own, row));
        let temperature_c = temperature.and_then(Result::ok);
        if let Some(other) = temperature_c.filter(|own| !CELSIUS.contains(own)) {
            return Err(Fault::of(format!(
                "its temperature, {other}, is none in °C of a place where arms are measured (−40 to 60); write it in °C"
            )));
        }
        Ok(Row {
            line: self.table.line(row),
            joints: self.joints(row)?,
            command: self.command(row)?,
            time_ns: self.time_ns(row)?,
            temperature_c,
            readings: Vec::new(),
            references: Vec::new(),
        })
    }

    /// Joint angles in rad, positions of joints that slide in mm.
    fn joints(&self, row: usize) -> Result<Vec<f64>> {
        let lengths = self.settings.length_unit.map_or(1.0, LengthUnit::to_mm);
        let joints = self.columns.joints.iter().enumerate();
        let joint = |(place, sum): (usize, &Sum)| {
            let slides = self.slides.get(place).copied().unwrap_or(false);
            let factor = if slides { lengths } else { self.settings.joint_unit.to_rad() };
            Ok(factor * self.value(sum, row)?)
        };
        joints.map(joint).collect()
    }

    /// The commanded pose; `None` where the row has none.
    fn command(&self, row: usize) -> Result<Option<Command>> {
        let (Some(columns), Some(settings)) = (&self.columns.commanded, &self.settings.commanded)
        else {
            return Ok(None);
        };
        let Some(position) = if_there(self.place(&columns.position, row, settings.unit))? else {
            return Ok(None);
        };
        let orientation = match (&columns.orientation, &settings.orientation) {
            (Some(sums), Some(form)) => {
                let values = self.values(sums, row);
                if_there(values.and_then(|values| rotation(&values, &form.form)))?
            }
            _ => None,
        };
        Ok(Some(Command { position, orientation }))
    }

    /// When the row was measured, ns; `None` where the table does not state it.
    fn time_ns(&self, row: usize) -> Result<Option<i64>> {
        let (Some(column), Some(time)) = (self.columns.time, &self.settings.time) else {
            return Ok(None);
        };
        let factor = match time.unit {
            TableTime::S => 1e9,
            TableTime::Ms => 1e6,
            TableTime::Us => 1e3,
            TableTime::Ns => 1.0,
            date => {
                let text = name(self.table.cell(row, column)).unwrap_or_default();
                return date_ns(&text, date).map(Some).ok_or_else(|| {
                    let words =
                        format!("{text:?} is no date and time as `unit` of [stations.time] says");
                    Fault::in_column(Some(column), &words)
                });
            }
        };
        match self.table.cell(row, column) {
            Cell::Number(number) if (factor * number).abs() < LATEST_NS => {
                Ok(Some(round_ns(factor * number)))
            }
            Cell::Number(number) if number.is_finite() => {
                Err(Fault::in_column(Some(column), &format!("{number:e} is no time since 1970")))
            }
            Cell::Number(_) | Cell::Blank => Err(Fault::in_column(Some(column), "it has no time")),
            Cell::Text(text) => {
                Err(Fault::in_column(Some(column), &format!("{text:?} is no number")))
            }
        }
    }

    fn add_readings(&mut self, station: &mut Row, row: usize) {
        for (place, measured) in self.columns.measured.iter().enumerate() {
            let read = self.reading(row, place, measured);
            self.add_reading(station, row, (SourceId::ONLY, TargetId(place)), read);
        }
        for (place, length) in self.columns.lengths.iter().enumerate() {
            self.add_length(station, row, place, length);
        }
    }

    fn add_length(&mut self, station: &mut Row, row: usize, place: usize, columns: &Length) {
        let own = &self.settings.lengths[place];
        let target = TargetId(self.settings.target_of(own).unwrap_or(0));
        let source = SourceId(self.settings.first_length() + place);
        let read = self.length(row, own, columns).map(|value| (value, 1));
        self.add_reading(station, row, (source, target), read);
    }

    /// Adds a reading and its number of samples to a station, or why there is none to the rejects.
    fn add_reading(
        &mut self,
        station: &mut Row,
        row: usize,
        (source, target): (SourceId, TargetId),
        read: Result<(Value, usize)>,
    ) {
        let line = self.table.line(row);
        match read {
            Ok((value, samples)) => {
                station.readings.push(RowReading { source, target, line, value, samples });
            }
            Err(fault) => self.reject(RowItem::Reading, line, fault),
        }
    }

    fn length(&self, row: usize, own: &LengthColumns, columns: &Length) -> Result<Value> {
        let to_mm = own.unit.to_mm();
        let mm = to_mm * self.value(&columns.reading, row)?;
        let stated = columns.sd.as_ref().map(|sum| self.value(sum, row));
        let stated = stated.map(if_there).transpose()?.flatten();
        let sd_mm = stated.map_or(own.sd_mm, |sd| to_mm * sd);
        if sd_mm <= 0.0 {
            return Err(Fault::of(format!(
                "a standard deviation of {sd_mm} mm of {:?}: it is above zero",
                own.name
            )));
        }
        let length = MeanLength { mm, sd_mm };
        let source = own.source();
        if !is_length(source.least_mm(), mm) {
            let least_mm = source.least_mm().unwrap_or(0.0);
            return Err(Fault::of(format!(
                "{:?} reads a distance of {mm} mm, which is not above {least_mm} mm: a distance that is read less than it is (of a \
                 sphere that is touched, minus its radius) needs its offset in [[stations.lengths]]",
                own.name
            )));
        }
        Ok(match own.reads {
            LengthRead::Distance => Value::Distance(length),
            LengthRead::Height => Value::Height(length),
        })
    }

    fn reading(&mut self, row: usize, place: usize, columns: &Measured) -> Result<(Value, usize)> {
        let settings = &self.settings.measured[place];
        let position = self.place(&columns.pose.position, row, settings.unit)?;
        let (to_mm, samples) = (settings.unit.to_mm(), self.samples(columns, row)?);
        let sd = columns.sd.iter().map(|sum| self.deviation(sum, row));
        let sd = sd.collect::<Result<Vec<f64>>>()?;
        let turn = match (&columns.pose.orientation, &settings.orientation) {
            (Some(sums), Some(form)) => {
                if_there(self.turn(sums, &columns.orientation_sd, row, form))?
            }
            _ => None,
        };
        let stated = self.stated(columns, row, settings, turn.is_some())?;
        let turn = turn.map(|turn| MeanOrientation { stated_covariance: stated.turn, ..turn });
        let point = MeanPoint {
            position,
            scatter_mm: <[f64; 3]>::try_from(&sd[..])
                .map_or([0.0; 3], |sd| sd.map(|sd| to_mm * sd)),
            stated_covariance: stated.position,
            motion_covariance: None,
        };
        Ok((Value::of(point, turn), samples))
    }

    /// The covariance that a row states of its reading, mm and rad.
    fn stated(
        &mut self,
        columns: &Measured,
        row: usize,
        settings: &ReadingColumns,
        has_turn: bool,
    ) -> Result<PoseCovariance> {
        let entries = self.entries(&columns.covariance, row)?;
        let logged = logged(&entries);
        let counts = &mut self.covariances;
        let mut stated =
            logged.map_or_else(PoseCovariance::default, |logged| logged.judged(has_turn, counts));
        let own = self.entries(&columns.orientation_covariance, row)?;
        if let (Ok(own), true) = (<[f64; 6]>::try_from(own), has_turn) {
            stated.turn = covariances::judged_turn(&symmetric(own), &mut self.covariances);
        }
        let turn = settings.orientation.as_ref();
        let to_rad = turn.map_or(1.0, |turn| to_rad(&turn.form));
        Ok(stated.scaled(settings.unit.to_mm(), to_rad))
    }

    /// The entries of a covariance; zeros, which say that it is not known, where all cells are blank.
    fn entries(&self, sums: &[Sum], row: usize) -> Result<Vec<f64>> {
        let found = sums.iter().map(|sum| if_there(self.value(sum, row)));
        let found = found.collect::<Result<Vec<Option<f64>>>>()?;
        if found.iter().all(Option::is_none) {
            return Ok(vec![0.0; sums.len()]);
        }
        self.values(sums, row)
    }

    fn samples(&self, columns: &Measured, row: usize) -> Result<usize> {
        let Some(sum) = &columns.samples else { return Ok(1) };
        let number = self.value(sum, row)?;
        let whole = number >= 1.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number from 1 to 2³²"
        )]
        whole
            .then_some(number as usize)
            .ok_or_else(|| Fault::of(format!("{number} samples are no number of samples")))
    }

    /// A standard deviation; zero where the cell is blank: the instrument's own uncertainty remains.
    fn deviation(&self, sum: &Sum, row: usize) -> Result<f64> {
        let sd = if_there(self.value(sum, row))?.unwrap_or(0.0);
        (sd >= 0.0).then_some(sd).ok_or_else(|| Fault::of(format!("a standard deviation of {sd}")))
    }

    /// A position, mm. Three zeros are what some instruments write for a missing reflector.
    fn place(&self, sums: &[Sum], row: usize, unit: LengthUnit) -> Result<Point3<f64>> {
        let values = self.values(sums, row)?;
        if values.iter().all(|value| *value == 0.0) {
            return Err(Fault::missing(
                None,
                "missing: a position of zeros, which instruments write where they measured nothing",
            ));
        }
        Ok(Point3::from_slice(&values) * unit.to_mm())
    }

    fn turn(
        &self,
        sums: &[Sum],
        deviations: &[Sum],
        row: usize,
        columns: &OrientationColumns,
    ) -> Result<MeanOrientation> {
        let to_rad = to_rad(&columns.form);
        let squares = deviations.iter().map(|sum| Ok(self.deviation(sum, row)?.powi(2)));
        let squares = squares.collect::<Result<Vec<f64>>>()?;
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        let orientation = rotation(&self.values(sums, row)?, &columns.form)?;
        let scatter_rad = to_rad * mean.sqrt();
        Ok(MeanOrientation { orientation, scatter_rad, stated_covariance: None })
    }

    fn values(&self, sums: &[Sum], row: usize) -> Result<Vec<f64>> {
        sums.iter().map(|sum| self.value(sum, row)).collect()
    }

    fn value(&self, sum: &Sum, row: usize) -> Result<f64> {
        match sum.value(self.table, row, &self.settings.missing) {
            Cellular::Number(number) if number.abs() < WILDEST => Ok(number),
            Cellular::Number(number) => Err(Fault::of(format!(
                "{number:e} is beyond the reach of any arm or instrument: a cell that was damaged or mistyped"
            ))),
            Cellular::Missing(column) => {
                let words = match self.table.cell(row, column) {
                    Cell::Number(number) if number.is_finite() => {
                        format!("missing: {number}, which [stations] missing lists")
                    }
                    Cell::Number(_) => "missing: not a finite number".to_owned(),
                    Cell::Blank | Cell::Text(_) => "missing: the cell is blank".to_owned(),
                };
                Err(Fault::missing(Some(column), &words))
            }
            Cellular::Text(column, text) => {
                let text: String = text.chars().take(40).collect();
                Err(Fault::in_column(Some(column), &format!("{text:?} is no number")))
            }
        }
    }

    /// Notes what is left out; of more than [`MOST_REJECTS`] the table is refused.
    fn reject(&mut self, kind: RowItem, line: u64, fault: Fault) {
        if self.rejects.len() > MOST_REJECTS {
            return;
        }
        let column = fault.column.map(|column| self.table.columns()[column].clone());
        self.rejects.push(RowReject {
            kind,
            file: self.file.clone(),
            line,
            column,
            station: None,
            code: if fault.is_missing { RejectCode::Missing } else { RejectCode::Unusable },
            reason: fault.reason,
        });
    }
}

impl Fault {
    fn of(reason: String) -> Self {
        Self { column: None, reason, is_missing: false }
    }

    fn in_column(column: Option<usize>, reason: &str) -> Self {
        Self { column, ..Self::of(reason.to_owned()) }
    }

    fn missing(column: Option<usize>, reason: &str) -> Self {
        Self { is_missing: true, ..Self::in_column(column, reason) }
    }
}

/// Radians in the unit of an orientation's angles; those of a quaternion or matrix are in rad.
const fn to_rad(form: &OrientationForm) -> f64 {
    match form {
        OrientationForm::Angles(_, _, unit) | OrientationForm::Vector(_, unit) => unit.to_rad(),
        OrientationForm::Quaternion(_) | OrientationForm::Matrix(_) => AngleUnit::Rad.to_rad(),
    }
}

/// The covariance of six, 21 or 36 entries; `None` of none.
fn logged(entries: &[f64]) -> Option<LoggedCovariance> {
    match entries.len() {
        6 => {
            let own = symmetric(entries.try_into().ok()?);
            Some(LoggedCovariance::Position(std::array::from_fn(|place| {
                own[(place / 3, place % 3)]
            })))
        }
        21 => Some(LoggedCovariance::Pose(std::array::from_fn(|place| {
            let (a, b) = (place / 6, place % 6);
            let (row, column) = (a.min(b), a.max(b));
            // Entries before a row on and above the diagonal: 6 + 5 + ….
            entries[row * (11 - row) / 2 + column]
        }))),
        _ => Some(LoggedCovariance::Pose(entries.try_into().ok()?)),
    }
}

/// A value, or `None` where there is none.
fn if_there<T>(value: Result<T>) -> Result<Option<T>> {
    match value {
        Ok(value) => Ok(Some(value)),
        Err(fault) if fault.is_missing => Ok(None),
        Err(fault) => Err(fault),
    }
}

fn rotation(values: &[f64], form: &OrientationForm) -> Result<UnitQuaternion<f64>> {
    match (form, values) {
        (OrientationForm::Quaternion(_), &[x, y, z, w]) => {
            let quaternion = Quaternion::new(w, x, y, z);
            let norm = quaternion.norm();
            let near = (norm - 1.0).abs() <= ROTATION;
            near.then(|| UnitQuaternion::from_quaternion(quaternion)).ok_or_else(|| {
                Fault::of(format!("a quaternion of norm {norm:.3}, and a rotation has norm 1"))
            })
        }
        (OrientationForm::Angles(_, _, unit) | OrientationForm::Vector(_, unit), &[a, b, c]) => {
            let largest = [a, b, c].into_iter().fold(0.0_f64, |most, angle| most.max(angle.abs()));
            let is_angle = *unit != AngleUnit::Rad || largest <= MOST_RAD;
            let words = || {
                format!(
                    "an angle of {largest:.1} rad, more than two turns; is the orientation's unit \"deg\"?"
                )
            };
            is_angle.then(|| form.rotation([a, b, c])).flatten().ok_or_else(|| Fault::of(words()))
        }
        (OrientationForm::Matrix(_), values) if values.len() == 9 => {
            let turn = rotation_of_matrix(values);
            turn.ok_or_else(|| Fault::of("a matrix that is no rotation: its rows are not of length 1 and at right angles".to_owned()))
        }
        _ => Err(Fault::of("an orientation with a wrong number of values".to_owned())),
    }
}

/// The rotation of nine numbers, row by row; `None` where they are not within a hundredth of one.
pub(crate) fn rotation_of_matrix(values: &[f64]) -> Option<UnitQuaternion<f64>> {
    let matrix = Matrix3::from_row_slice(values);
    let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    let turns = off <= ROTATION && matrix.determinant() > 0.0;
    turns.then(|| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix)))
}

/// Nanoseconds since 1970, UTC, of a date and time in one of the forms of dates; without an offset it is in UTC.
pub(crate) fn date_ns(text: &str, form: TableTime) -> Option<i64> {
    let with_offset = chrono::DateTime::parse_from_rfc3339(&text.replacen(' ', "T", 1)).ok();
    let with_offset = with_offset.filter(|_| form == TableTime::Iso8601);
    let plain = || {
        // A year of two digits stands before one of four, which it would be the first two digits of: all of the text has to fit.
        let dates: &[&str] = match form {
            TableTime::MonthDay => &["%m/%d/%y", "%m/%d/%Y"],
            TableTime::DayMonth => &["%d.%m.%y", "%d.%m.%Y"],
            _ => &["%Y-%m-%d"],
        };
        let times = ["%H:%M:%S%.f", "%H:%M", "%I:%M:%S%.f %p", "%I:%M %p"];
        let text = text.replacen('T', " ", usize::from(form == TableTime::Iso8601));
        let mut found = dates
            .iter()
            .flat_map(|date| times.map(|time| format!("{date} {time}")))
            .filter_map(|form| chrono::NaiveDateTime::parse_from_str(&text, &form).ok());
        found.next()?.and_utc().timestamp_nanos_opt()
    };
    with_offset.map_or_else(plain, |time| time.timestamp_nanos_opt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_with_and_without_an_offset() {
        let noon = 1_604_923_200_000_000_000;
        for text in [
            "2020-11-09T12:00:00Z",
            "2020-11-09 12:00:00",
            "2020-11-09T13:00:00+01:00",
            "2020-11-09 12:00",
            "2020-11-09T12:00:00.000",
        ] {
            assert_eq!(date_ns(text, TableTime::Iso8601), Some(noon), "{text}");
            assert_eq!(date_ns(text, TableTime::DayMonth), None, "{text}");
        }
        for text in ["11/09/20 12:00:00", "11/9/2020 12:00", "11/09/2020 12:00:00 PM"] {
            assert_eq!(date_ns(text, TableTime::MonthDay), Some(noon), "{text}");
        }
        for text in ["09.11.20 12:00:00", "9.11.2020 12:00"] {
            assert_eq!(date_ns(text, TableTime::DayMonth), Some(noon), "{text}");
        }
        assert_eq!(date_ns("13/09/20 12:00", TableTime::MonthDay), None);
        assert_eq!(date_ns("2,02011E+13", TableTime::Iso8601), None);
    }
}
