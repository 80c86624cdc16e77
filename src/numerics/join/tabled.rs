//! Rows of a table of stations → stations: somebody else has joined them, so there is one clock and no dwell to find.
//!
//! Every row becomes a station or is left out with its reason, and so is every reading:
//!
//! 1. rows are in order of time where every one has a time, otherwise in the table's order, a second apart;
//! 2. a row that repeats another to the last digit is a copy;
//! 3. the motion of references on floor or base is taken out (`join::courses`);
//! 4. readings far from every place that the nominal arm can have had are of another reflector, as with logs
//!    ([`super::placement`]).

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Isometry3, Vector3};

use super::moved::{Elsewhere, stretches};
use super::pair::placed;
use super::placement::{Placement, ReadingAtFlange};
use super::{
    ClockEstimate, Command, JoinSettings, Joined, Pairing, Reading, ReadingCounts, SourceId,
    Station, TargetId, Thresholds, Unmeasured, Value,
};
use crate::ingest::StandsOn;
use crate::kinematics::Arm;
use crate::units::{ClockModel, NS_PER_S, Stamp, round_ns};

pub use super::courses::{LookAt, ReadReference, ReferenceCourse, RowReference, can_be_read};
use super::courses::{Origin, Stop, courses, read as read_references, taken_out, undo};
pub use super::{RejectCode, RowItem, RowReject};

/// A row of a table: a station with the readings of its targets.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub line: u64,
    pub joints: Vec<f64>,
    pub command: Option<Command>,
    pub time_ns: Option<i64>,
    pub temperature_c: Option<f64>,
    pub readings: Vec<RowReading>,
    pub references: Vec<RowReference>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ApartRow {
    pub line: u64,
    pub time_ns: Option<i64>,
    pub references: Vec<RowReference>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowReading {
    pub source: SourceId,
    pub target: TargetId,
    /// Its line in the file, from 1; of a long table its own.
    pub line: u64,
    pub value: Value,
    pub samples: usize,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    pub file: String,
    pub rows: Vec<Row>,
    /// Rows with readings of references alone, in the table's order.
    pub apart: Vec<ApartRow>,
    /// Name of each reference, and what it stands on.
    pub references: Vec<(String, StandsOn)>,
    pub rejects: Vec<RowReject>,
}

impl Rows {
    /// These rows with the poses of a camera on the flange, which measures a target in the cell: each reading becomes the camera's pose in
    /// the target's frame, so that the target's frame is the instrument's and the camera is what sits at the flange. Readings without an
    /// orientation are left out.
    #[must_use]
    pub fn of_camera_on_flange(mut self) -> Self {
        for row in &mut self.rows {
            for reading in std::mem::take(&mut row.readings) {
                match reading.value.inverted() {
                    Some(value) => row.readings.push(RowReading { value, ..reading }),
                    None => self.rejects.push(RowReject::of(
                        RowItem::Reading,
                        reading.line,
                        None,
                        RejectCode::Unusable,
                        "a position without an orientation: of a camera on the flange it says nothing".to_owned(),
                    )),
                }
            }
        }
        self
    }
}

/// The stations of a table. `counts` has each reading of a target once; those that the reader left out are missing.
pub fn tabled(rows: Rows, arm: &Arm, settings: &JoinSettings) -> Joined {
    let Rows { file, mut rows, apart, references, mut rejects } = rows;
    let timed = !rows.is_empty() && rows.iter().all(|row| row.time_ns.is_some());
    if timed {
        rows.sort_by_key(|row| row.time_ns);
    }
    let (mut rows, copies) = without_copies(rows);
    let left_out = |is_unusable: bool| {
        let of_readings = rejects.iter().filter(|own| own.kind == RowItem::Reading);
        of_readings.filter(|own| (own.code == RejectCode::Unusable) == is_unusable).count() as u64
    };
    let (mut missing, unusable) = (left_out(false), left_out(true));
    missing += copies.iter().map(|(_, readings)| *readings as u64).sum::<u64>();
    rejects.extend(copies.into_iter().map(|(reject, _)| reject));
    let followed = follow(&mut rows, &apart, &references, timed);
    rejects.extend(followed.rejects);
    let unmoved = take_out(&mut rows, &followed.left_out);
    let unpaired = unmoved.len() as u64;
    rejects.extend(unmoved);
    let gates = Gates::new(&rows, arm, settings);
    let judged = rows.iter().enumerate().map(|(number, row)| {
        gates.judged(number, row, timed, followed.left_out.contains_key(&number))
    });
    let (stations, far): (Vec<Station>, Vec<Vec<RowReject>>) = judged.unzip();
    let far = far.concat();
    let by_line: BTreeMap<u64, usize> =
        rows.iter().zip(&stations).map(|(row, station)| (row.line, station.number)).collect();
    for reject in rejects.iter_mut().filter(|own| own.kind == RowItem::Reading) {
        reject.station = reject.station.or_else(|| by_line.get(&reject.line).copied());
    }
    let kept = stations.iter().map(|station| station.measured().len() as u64).sum();
    let unpaired = unpaired + far.len() as u64;
    rejects.extend(far);
    for reject in &mut rejects {
        reject.file.clone_from(&file);
    }
    rejects.sort_by_key(|own| own.line);
    Joined {
        clock: one_clock(stations.first().map(|station| station.start), timed),
        stations,
        rejects: Vec::new(),
        row_rejects: rejects,
        references: followed.courses,
        read_references: followed.read,
        elsewhere: gates.elsewhere,
        knocks: Vec::new(),
        counts: ReadingCounts { kept, unpaired, missing, unusable, ..ReadingCounts::default() },
        found: Thresholds { stationary_rad: 0.0, stationary_mm: 0.0, settle_s: 0.0 },
    }
}

/// Takes the readings of places in rows whose motion is not known out of them, as rejects. Lengths stay: they are read in the base's
/// frame, from what does not move in it.
fn take_out(rows: &mut [Row], left_out: &BTreeMap<usize, String>) -> Vec<RowReject> {
    let mut rejects = Vec::new();
    for (place, reason) in left_out {
        let (lengths, places): (Vec<RowReading>, Vec<RowReading>) =
            rows[*place].readings.drain(..).partition(|reading| reading.value.kind().is_length());
        rows[*place].readings = lengths;
        rejects.extend(places.into_iter().map(|reading| {
            let code = RejectCode::MOVED;
            RowReject::of(RowItem::Reading, reading.line, Some(*place), code, reason.clone())
        }));
    }
    rejects
}

/// The rows without those that repeat an earlier one to the last digit; for each of them its reject and number of readings.
fn without_copies(rows: Vec<Row>) -> (Vec<Row>, Vec<(RowReject, usize)>) {
    let mut first: HashMap<Vec<u64>, u64> = HashMap::with_capacity(rows.len());
    let (mut kept, mut copies) = (Vec::with_capacity(rows.len()), Vec::new());
    for row in rows {
        let line = *first.entry(digits(&row)).or_insert(row.line);
        if line == row.line || row.readings.is_empty() {
            kept.push(row);
            continue;
        }
        let reason = format!(
            "a copy of line {line}: joints, readings and time are the same to the last digit"
        );
        let reject = RowReject::of(RowItem::Row, row.line, None, RejectCode::Repeated, reason);
        copies.push((reject, row.readings.len()));
    }
    (kept, copies)
}

/// Everything that is measured in a row, as bits.
fn digits(row: &Row) -> Vec<u64> {
    let time = row.time_ns.map_or(0, i64::cast_unsigned);
    let readings = row.readings.iter().flat_map(|reading| {
        let point = reading.value.point().map_or([0.0; 3], |point| point.position.coords.into());
        let length = reading.value.length().map_or(0.0, |length| length.mm);
        [reading.target.0 as u64, length.to_bits()].into_iter().chain(point.map(f64::to_bits))
    });
    let angles = row.joints.iter().map(|angle| angle.to_bits());
    [time].into_iter().chain(angles).chain(readings).collect()
}

fn one_clock(origin: Option<Stamp<crate::units::Controller>>, timed: bool) -> ClockEstimate {
    let method = if timed {
        "one table, so one clock: nothing had to be joined"
    } else {
        "one table without times: stations are in its order and count as a second apart"
    };
    let origin = origin.unwrap_or(Stamp::from_ns(0));
    ClockEstimate {
        model: ClockModel { origin, offset_ns: 0.0, drift: 0.0 },
        offset_se_ns: 0.0,
        drift_se: 0.0,
        matched_edges: 0,
        edge_rms_ns: 0.0,
        method: method.to_owned(),
        steps: Vec::new(),
    }
}

/// For each target how far from the nominal arm its readings may be.
struct Gates<'a> {
    arm: &'a Arm,
    /// Placement of the target and distance allowed, mm; `None` where too few readings place it.
    targets: BTreeMap<TargetId, Option<(Placement, f64)>>,
    /// Stretches at which the instrument or the base stood elsewhere, by the first target that shows any.
    elsewhere: Vec<Elsewhere>,
}

impl<'a> Gates<'a> {
    fn new(rows: &[Row], arm: &'a Arm, settings: &JoinSettings) -> Self {
        let mut readings: BTreeMap<TargetId, Vec<ReadingAtFlange>> = BTreeMap::new();
        let mut places: BTreeMap<TargetId, Vec<usize>> = BTreeMap::new();
        for (number, row) in rows.iter().enumerate() {
            let flange = *arm.flange(&row.joints).isometry();
            for reading in &row.readings {
                if let Some(attained) = place(reading) {
                    let own = readings.entry(reading.target).or_default();
                    own.push(ReadingAtFlange { flange, attained });
                    places.entry(reading.target).or_default().push(number);
                }
            }
        }
        let targets = readings.iter().map(|(target, own)| (*target, placed(own, settings)));
        let targets: BTreeMap<_, _> = targets.collect();
        let mut elsewhere = readings.iter().filter_map(|(target, own)| {
            let (placement, gate_mm) = targets[target].as_ref()?;
            let found = stretches(own, placement, *gate_mm);
            let stations = |place: usize| places[target][place];
            let found = found.iter().map(|stretch| {
                stretch.elsewhere(own, placement, [stretch.first, stretch.last].map(stations))
            });
            Some(found.collect::<Vec<_>>())
        });
        Self { arm, elsewhere: elsewhere.find(|own| !own.is_empty()).unwrap_or_default(), targets }
    }

    /// A row's station, and its readings that are too far from the nominal arm.
    fn judged(
        &self,
        number: usize,
        row: &Row,
        timed: bool,
        moved: bool,
    ) -> (Station, Vec<RowReject>) {
        let flange = *self.arm.flange(&row.joints).isometry();
        let at = stamp(number, row, timed);
        let (mut readings, mut far) = (Vec::new(), Vec::new());
        let mut elsewhere = self.elsewhere.iter();
        let elsewhere = elsewhere.find(|own| (own.stations[0]..=own.stations[1]).contains(&number));
        for reading in &row.readings {
            match self.too_far(&flange, reading) {
                None => readings.push(read(reading, row, at)),
                Some(away_mm) => {
                    let away = format!("{away_mm:.0} mm from the nominal arm's position");
                    let (code, why) = match elsewhere {
                        None => (
                            RejectCode::WRONG_TARGET,
                            format!("{away}: another reflector or a wrong number"),
                        ),
                        Some(own) => (
                            RejectCode::MOVED,
                            format!("instrument_moved: {away}: {}", own.words()),
                        ),
                    };
                    let (kind, station) = (RowItem::Reading, Some(number));
                    far.push(RowReject::of(kind, reading.line, station, code, why));
                }
            }
        }
        let pairing = match (&readings[..], &far[..]) {
            ([_, ..], _) => Pairing::Paired,
            ([], _) if moved || elsewhere.is_some() => {
                Pairing::Unmeasured(Unmeasured::InstrumentMoved)
            }
            ([], []) => Pairing::Unmeasured(Unmeasured::NoReadings),
            ([], [_, ..]) => Pairing::Unmeasured(Unmeasured::WrongTarget),
        };
        let station = Station {
            number,
            start: Stamp::from_ns(at),
            end: Stamp::from_ns(at),
            joints: row.joints.clone(),
            joint_samples: 1,
            command: row.command.clone(),
            readings,
            pairing,
        };
        (station, far)
    }

    /// Distance of a reading from the nominal arm where that is too far, mm; `None` where it may be of its target.
    fn too_far(&self, flange: &Isometry3<f64>, reading: &RowReading) -> Option<f64> {
        let (placement, gate_mm) = self.targets.get(&reading.target)?.as_ref()?;
        let away_mm =
            placement.distance_mm(&ReadingAtFlange { flange: *flange, attained: place(reading)? });
        (away_mm > *gate_mm).then_some(away_mm)
    }
}

fn stamp(number: usize, row: &Row, timed: bool) -> i64 {
    let by_order = round_ns(NS_PER_S * number as f64);
    row.time_ns.filter(|_| timed).unwrap_or(by_order)
}

fn place(reading: &RowReading) -> Option<Vector3<f64>> {
    reading.value.point().map(|point| point.position.coords)
}

fn read(reading: &RowReading, row: &Row, at: i64) -> Reading {
    Reading {
        source: reading.source,
        target: reading.target,
        value: reading.value,
        kept: reading.samples,
        taken: reading.samples,
        first: Stamp::from_ns(at),
        last: Stamp::from_ns(at),
        temperature_c: row.temperature_c,
    }
}

#[derive(Debug, Default)]
struct RowReferences {
    courses: Vec<ReferenceCourse>,
    read: Vec<ReadReference>,
    /// Readings of references that were left out.
    rejects: Vec<RowReject>,
    /// Why a row's readings stay out, by its place.
    left_out: BTreeMap<usize, String>,
}

/// Follows the references of `rows` and `apart`, and takes their motion out of the readings of `rows`.
fn follow(
    rows: &mut [Row],
    apart: &[ApartRow],
    references: &[(String, StandsOn)],
    timed: bool,
) -> RowReferences {
    if references.is_empty() {
        return RowReferences::default();
    }
    let stops = stops(rows, apart, timed);
    let origin = Origin { is_timed: timed, is_logged: false };
    let (mut courses, rejects) = courses(&stops, references, origin);
    let read = read_references(&stops, references);
    let mut left_out = BTreeMap::new();
    for (place, motion) in taken_out(&mut courses, |place| !rows[place].readings.is_empty()) {
        match motion {
            Ok(motion) => {
                rows[place].readings.iter_mut().for_each(|own| undo(&mut own.value, &motion));
            }
            Err(reason) => {
                left_out.insert(place, reason);
            }
        }
    }
    RowReferences { courses, read, rejects, left_out }
}

/// Everything in order of time, or of lines where there are no times; looks then count as a second apart.
fn stops<'a>(rows: &'a [Row], apart: &'a [ApartRow], timed: bool) -> Vec<Stop<'a>> {
    let between = apart.iter().map(|own| (None, own.line, own.time_ns, &own.references));
    let stations = rows.iter().enumerate();
    let stations = stations.map(|(row, own)| (Some(row), own.line, own.time_ns, &own.references));
    let stops = stations.chain(between).map(|(row, line, time_ns, references)| {
        let at_ns = time_ns.unwrap_or(0);
        Stop { row, line, at_ns, references }
    });
    let mut stops: Vec<Stop<'a>> = stops.collect();
    if timed {
        stops.sort_by_key(|stop| (stop.at_ns, stop.line));
    } else {
        stops.sort_by_key(|stop| stop.line);
        for (stop, at_ns) in stops.iter_mut().zip((0..).step_by(1_000_000_000)) {
            stop.at_ns = at_ns;
        }
    }
    stops
}

#[cfg(test)]
mod tests;
