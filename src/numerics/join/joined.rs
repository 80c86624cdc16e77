//! What a join gives: stations with their verdicts and readings, the clocks, and all that was not kept.

use std::ops::AddAssign;

use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::clock_steps::ClockStep;
use super::moved::{Elsewhere, Knock};
use super::reading::Reading;
use super::tabled::{ReadReference, ReferenceCourse};
use crate::units::{ClockModel, Controller, Stamp, Tracker};

/// The session's stations, its clocks, and all readings that did not become part of a station.
#[derive(Debug, Clone)]
pub struct Joined {
    pub stations: Vec<Station>,
    pub clock: ClockEstimate,
    pub rejects: Vec<JoinReject>,
    pub row_rejects: Vec<RowReject>,
    /// The courses of references that were followed; empty where there were none.
    pub references: Vec<ReferenceCourse>,
    /// How often each stated reference was read; empty where none is stated.
    pub read_references: Vec<ReadReference>,
    /// Stretches at which the instrument or the base stood elsewhere, and no reference tells it.
    pub elsewhere: Vec<Elsewhere>,
    /// Motions of the instrument or the base at one time that no reference tells, taken out of the readings behind them.
    pub knocks: Vec<Knock>,
    pub counts: ReadingCounts,
    /// The thresholds that were given or found from the logs.
    pub found: Thresholds,
}

impl Joined {
    pub fn paired(&self) -> usize {
        self.stations.iter().filter(|station| station.pairing == Pairing::Paired).count()
    }

    /// Takes the readings of a station for which `is_wrong` is true out of it; they count as unpaired and are named as rejects. A station
    /// that is left without a reading has the verdict `otherwise`.
    pub fn take_out(
        &mut self,
        number: usize,
        otherwise: Unmeasured,
        reason: &str,
        is_wrong: impl Fn(&Reading) -> bool,
    ) {
        let mut stations = self.stations.iter_mut();
        let Some(station) = stations.find(|own| own.number == number) else { return };
        let (wrong, kept): (Vec<_>, Vec<_>) = station.readings.drain(..).partition(is_wrong);
        if kept.is_empty() && !wrong.is_empty() {
            station.pairing = Pairing::Unmeasured(otherwise);
        }
        station.readings = kept;
        for reading in wrong {
            let samples = reading.kept as u64;
            self.counts.kept = self.counts.kept.saturating_sub(samples);
            self.counts.unpaired += samples;
            self.rejects.push(JoinReject {
                start: reading.first,
                end: reading.last,
                readings: samples,
                is_of_reference: false,
                code: RejectCode::Unmeasured(otherwise),
                reason: reason.to_owned(),
            });
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Thresholds {
    pub stationary_rad: f64,
    pub stationary_mm: f64,
    pub settle_s: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Number within the session, from 0, in controller time.
    pub number: usize,
    pub start: Stamp<Controller>,
    /// Last stationary moment.
    pub end: Stamp<Controller>,
    pub joints: Vec<f64>,
    pub joint_samples: usize,
    /// The command in force during the dwell; absent without commands or where none fits.
    pub command: Option<Command>,
    /// The readings of the instruments, in the order of sources and targets; empty for a dwell that is not paired.
    pub readings: Vec<Reading>,
    pub pairing: Pairing,
}

impl Station {
    /// The readings of a paired dwell; empty for any other.
    pub fn measured(&self) -> &[Reading] {
        match self.pairing {
            Pairing::Paired => &self.readings,
            Pairing::Unmeasured(_) | Pairing::Ambiguous => &[],
        }
    }

    /// The reading of a place of a paired dwell with only one; `None` of any other dwell. Readings of one length do not count. Of a session with several targets the one that
    /// stands for all of a dwell's is derived first ([`crate::fit::flange`]).
    pub fn one_reading(&self) -> Option<&Reading> {
        let mut places = self.measured().iter();
        let mut places = places.by_ref().filter(|reading| !reading.value.kind().is_length());
        let one = places.next()?;
        places.next().is_none().then_some(one)
    }
}

/// A commanded pose of the controller's own tool point, in the frame of commands.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    pub position: Point3<f64>,
    pub orientation: Option<UnitQuaternion<f64>>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pairing {
    Paired,
    Unmeasured(Unmeasured),
    Ambiguous,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unmeasured {
    NoReadings,
    /// Readings fall into it, but too few are left after settling and outlier rejection.
    TooFewReadings,
    TargetMoved,
    /// The dwell lies outside the tracker's log.
    OutsideTrackerLog,
    /// Its readings are far from every place that the arm can have had: a wrong reflector, a lost beam or a wrong number.
    WrongTarget,
    /// The instrument or the base moved, and where it stood is not known.
    InstrumentMoved,
    /// Its reading is of the second solution of a planar target, whose normal is mirrored.
    FlippedView,
}

impl Unmeasured {
    pub const ALL: [Self; 7] = [
        Self::NoReadings,
        Self::TooFewReadings,
        Self::TargetMoved,
        Self::OutsideTrackerLog,
        Self::WrongTarget,
        Self::InstrumentMoved,
        Self::FlippedView,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::NoReadings => "no_readings",
            Self::TooFewReadings => "too_few_readings",
            Self::TargetMoved => "target_moved",
            Self::OutsideTrackerLog => "outside_tracker_log",
            Self::WrongTarget => "wrong_target",
            Self::InstrumentMoved => "instrument_moved",
            Self::FlippedView => "flipped_view",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClockEstimate {
    pub model: ClockModel,
    pub offset_se_ns: f64,
    pub drift_se: f64,
    /// Number of dwell edges that the refinement matched.
    pub matched_edges: usize,
    pub edge_rms_ns: f64,
    pub method: String,
    /// Steps of a clock that both logs together show, in order of time.
    #[serde(default)]
    pub steps: Vec<ClockStep>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadingCounts {
    /// Readings that are part of a station's mean.
    pub kept: u64,
    pub settling: u64,
    pub outlier: u64,
    pub moving: u64,
    pub unpaired: u64,
    /// Readings without a measurement: the zeros that some instruments write.
    pub missing: u64,
    /// Readings that are there and cannot be used: a text, a distance below zero.
    #[serde(default)]
    pub unusable: u64,
}

impl AddAssign for ReadingCounts {
    fn add_assign(&mut self, more: Self) {
        self.kept += more.kept;
        self.settling += more.settling;
        self.outlier += more.outlier;
        self.moving += more.moving;
        self.unpaired += more.unpaired;
        self.missing += more.missing;
        self.unusable += more.unusable;
    }
}

/// Why something was left out, in a word, as the schema of `rejects` describes each; the reason says it in full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RejectCode {
    Damaged,
    /// A log's own summary counts messages that are not in it.
    NotFound,
    NothingLost,
    Unusable,
    Missing,
    /// The one before it again, or a copy of another row.
    Repeated,
    Settling,
    Moving,
    /// Far from the others of its dwell, or from where other references put it.
    Outlier,
    NoArmDwell,
    /// A reference that was read once only.
    Alone,
    /// As of a dwell that is not paired.
    Unmeasured(Unmeasured),
    SeveralCandidates,
}

impl RejectCode {
    pub(super) const MOVED: Self = Self::Unmeasured(Unmeasured::InstrumentMoved);
    pub(super) const WRONG_TARGET: Self = Self::Unmeasured(Unmeasured::WrongTarget);
}

/// A tracker dwell or a run of readings that belongs to no station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JoinReject {
    pub start: Stamp<Tracker>,
    pub end: Stamp<Tracker>,
    pub readings: u64,
    /// Whether they are readings of a reference, not of a target.
    pub is_of_reference: bool,
    pub code: RejectCode,
    pub reason: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowReject {
    pub kind: RowItem,
    pub file: String,
    pub line: u64,
    /// The column at fault; `None` where it is none of them.
    pub column: Option<String>,
    /// Number of the station that the row became; `None` where it became none.
    pub station: Option<usize>,
    pub code: RejectCode,
    pub reason: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RowItem {
    Row,
    Reading,
    Reference,
}

impl RowReject {
    /// A whole item; the file is stated once for all of a table.
    pub(super) const fn of(
        kind: RowItem,
        line: u64,
        station: Option<usize>,
        code: RejectCode,
        reason: String,
    ) -> Self {
        Self { kind, file: String::new(), line, column: None, station, code, reason }
    }
}
