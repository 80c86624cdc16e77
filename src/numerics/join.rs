//! Join: two logs with a clock each → stations, each a dwell of the arm with the tracker's measurement of it.
//!
//! Input is the content of the logs ([`JoinInput`]) and the nominal [`Arm`]; output is [`Joined`]. The method is in
//! [`crate::method::join`].
//!
//! 1. [`readings`], [`observe`], [`stationary`], [`dwell`]: dwells of the arm on its joints, dwells of the target on its
//!    positions.
//! 2. [`pattern`]: the clock relations under which the two patterns of moves agree.
//! 3. [`decide`]: the relation under which the nominal arm ([`placement`]) agrees with the measured positions of the target.
//! 4. [`clock`]: offset and drift on the matched edges; `clock_steps`: steps of a clock; `frozen`: readings that repeat the last one
//!    while the arm moves are left out, and steps 1 to 4 are done again.
//! 5. [`settle`]: the settling time of the target. [`pair`], [`average`]: a verdict for each dwell, means after settling;
//!    [`disposition`]: one for each reading.
//! 6. [`reading`]: what a station holds of each instrument. [`command`]: the commanded pose in force during each dwell.
//! 7. `others`: readings of further targets, where a log has several.
//! 8. `logged_references`: readings of references on floor or base, whose motion is taken out of the stations' readings; bumps that are
//!    larger than the gate before step 1. [`moved`]: moves that no reference tells.
//! 9. [`mod@began`]: the date of the session.
//!
//! A table of stations needs none of this but the geometry: [`tabled`] makes its rows stations.

pub mod average;
pub mod began;
#[cfg(test)]
mod bump_tests;
pub mod clock;
mod clock_steps;
pub mod command;
mod courses;
pub mod decide;
pub mod disposition;
pub mod dwell;
mod error;
#[cfg(test)]
mod fault_tests;
mod frozen;
mod logged_lengths;
mod logged_references;
pub mod moved;
pub mod observe;
mod others;
pub mod pair;
pub mod pattern;
pub mod placement;
pub mod reading;
pub mod readings;
pub mod references;
#[cfg(test)]
mod scene;
mod settings;
pub mod settle;
pub mod stationary;
pub mod supposed;
pub mod tabled;

use std::ops::{AddAssign, Range};

use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use self::decide::Decision;
use self::disposition::{Disposition, Dispositions, Why};
use self::dwell::{ArmDwell, TargetDwell};
use self::logged_references::bumps::Targets;
use self::moved::{Elsewhere, Knock};
use self::observe::Observation;
use self::others::Other;
use self::pattern::Relation;
use self::readings::Readings;
use self::stationary::Stationary;
use crate::ingest::{Poses, StandsOn, TemperatureSamples};
use crate::kinematics::Arm;
use crate::units::{ClockModel, Controller, NS_PER_S, Stamp, Tracker};

pub use began::{Began, began};
pub use clock_steps::ClockStep;
pub(crate) use courses::undo;
pub use disposition::REPEATED;
pub use error::JoinError;
pub use logged_lengths::LengthReadings;
pub use reading::{
    ByKind, MeanLength, MeanOrientation, MeanPoint, Reading, ReadingKind, SeveralSources, SourceId,
    TargetId, Value, one_source,
};
pub use settings::JoinSettings;

/// The session's stations, its clocks, and all readings that did not become part of a station.
#[derive(Debug, Clone)]
pub struct Joined {
    pub stations: Vec<Station>,
    pub clock: ClockEstimate,
    pub rejects: Vec<JoinReject>,
    pub row_rejects: Vec<RowReject>,
    /// The courses of references that were followed; empty where there were none.
    pub references: Vec<tabled::ReferenceCourse>,
    /// How often each stated reference was read; empty where none is stated.
    pub read_references: Vec<tabled::ReadReference>,
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
        let stations = self.stations.iter();
        let paired = stations.filter(|station| station.pairing == Pairing::Paired);
        paired.count()
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
        let Some(station) = stations.find(|own| own.number == number) else {
            return;
        };
        let (wrong, kept): (Vec<Reading>, Vec<Reading>) =
            station.readings.drain(..).partition(is_wrong);
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

/// One dwell of the arm.
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl AddAssign for ReadingCounts {
    fn add_assign(&mut self, more: Self) {
        self.kept += more.kept;
        self.settling += more.settling;
        self.outlier += more.outlier;
        self.moving += more.moving;
        self.unpaired += more.unpaired;
        self.missing += more.missing;
    }
}

/// A tracker dwell or a run of readings that belongs to no station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JoinReject {
    pub start: Stamp<Tracker>,
    pub end: Stamp<Tracker>,
    pub readings: u64,
    /// Whether they are readings of a reference, not of a target.
    pub is_of_reference: bool,
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
    const fn of(kind: RowItem, line: u64, station: Option<usize>, reason: String) -> Self {
        Self { kind, file: String::new(), line, column: None, station, reason }
    }
}

#[derive(Debug)]
pub struct ReferenceReadings {
    pub name: String,
    pub on: StandsOn,
    pub readings: Box<dyn Poses<Tracker>>,
}

/// The content of a session's logs, in the logs' own clocks.
#[derive(Debug)]
pub struct JoinInput {
    pub joints: Stationary,
    /// The commanded poses, in order of controller time; empty where they were not logged.
    pub commands: Box<dyn Poses<Controller>>,
    /// The readings of the measured target, in order of tracker time.
    pub readings: Box<dyn Poses<Tracker>>,
    /// Those of each further target, in the order of their [`TargetId`]; empty where there is one.
    pub others: Vec<Box<dyn Poses<Tracker>>>,
    /// Those of references on floor or base; empty where there are none.
    pub references: Vec<ReferenceReadings>,
    /// Those of instruments of one length; empty where there are none.
    pub lengths: Vec<LengthReadings>,
    pub temperatures: TemperatureSamples,
}

/// Joins the two logs of a session.
///
/// Every dwell of the arm becomes a station with a verdict, every reading gets a disposition: `counts` sums to the number of
/// readings, and `rejects` names all that were not kept.
pub fn join(input: &JoinInput, arm: &Arm, settings: &JoinSettings) -> Result<Joined, JoinError> {
    join_without(input, arm, settings, &[])
}

/// The join without some readings of the main target, which repeat others.
fn join_without(
    input: &JoinInput,
    arm: &Arm,
    settings: &JoinSettings,
    repeated: &[Range<usize>],
) -> Result<Joined, JoinError> {
    observe::check_joints(&input.joints, arm)?;
    observe::check_temperatures(&input.temperatures)?;
    let targets = Targets::of(input, settings)?;
    let main = frozen::Without { own: &*targets.main, rows: repeated };
    let readings = Readings::find(&main, settings)?;
    let mut seen = observe::observe(&readings, &input.joints, arm, settings)?;
    let occasions: Vec<_> = seen.arm.iter().map(occasion).collect();
    let (decision, steps) = clock_steps::decided(&mut seen, settings.geometry_gate_mm)?;
    let origin = Stamp::from_ns(input.joints.span_ns.0);
    let (mut clock, relation, by_edges) = estimate_clock(&seen, &decision, origin);
    clock.steps = steps;
    let again = frozen::repeated(&readings, &seen, relation, &decision.placement)?;
    if repeated.is_empty() && !again.is_empty() {
        return join_without(input, arm, settings, &again);
    }
    let others = Other::all(&targets.others, settings)?;
    if !others.is_empty() && !by_edges {
        clock.model = others::centred(clock.model, &seen.arm, &seen.target, &others);
    }
    let gate_mm = pair::gate_mm(decision.median_mm, settings);
    let elsewhere = Moves::of(&seen, &decision, gate_mm);
    let evidence = pair::Evidence {
        readings: &readings,
        temperatures: &input.temperatures,
        target: &seen.target,
        clock: clock.model,
        placement: decision.placement,
        gate_mm,
        moved: &elsewhere.spans,
        same_mm: SAME_REACH * seen.stationary_mm,
        usual_mm: seen.usual_scatter_mm(),
        settle_s: match settings.settle_s {
            Some(settle_s) => settle_s,
            None => settle::settling_s(&seen, &readings, &decision.support, relation)?,
        },
        settings,
    };
    let mut dispositions = first_dispositions(&readings, &seen.target);
    let mut stations = stations(
        command::in_force(&*input.commands, &occasions)?,
        &seen.arm,
        &evidence,
        &mut dispositions,
    )?;
    for rows in readings.missing() {
        dispositions.set(rows, Disposition::Missing);
    }
    for rows in repeated {
        dispositions.set(rows.clone(), Disposition::Repeated);
    }
    let (mut counts, mut rejects) =
        (dispositions.counts(), dispositions.rejects(|row| readings.stamp(row))?);
    let found = others::MainJoin {
        arm: &seen.arm,
        temperatures: &input.temperatures,
        clock: clock.model,
        moved: &elsewhere.spans,
        settle_s: evidence.settle_s,
        settings,
    };
    for other in &others {
        let (own, left_out) = other.add(&found, &mut stations)?;
        counts += own;
        rejects.extend(left_out);
    }
    let joined = Joined {
        stations,
        clock,
        rejects,
        row_rejects: Vec::new(),
        references: Vec::new(),
        read_references: Vec::new(),
        elsewhere: elsewhere.found,
        knocks: Vec::new(),
        counts,
        found: Thresholds {
            stationary_rad: seen.stationary_rad,
            stationary_mm: seen.stationary_mm,
            settle_s: evidence.settle_s,
        },
    };
    let followed =
        logged_references::followed(targets.restored(joined), &input.references, settings)?;
    let mut joined = logged_lengths::added(followed, input, settings)?;
    // Stations keep the stamps of their log, whichever clock stepped.
    for (station, own) in joined.stations.iter_mut().zip(&occasions) {
        (station.start, station.end) = (own.start, own.end);
    }
    Ok(joined)
}

/// The stretches of a session at which the instrument or the base stood elsewhere, and their first and last moments.
struct Moves {
    found: Vec<Elsewhere>,
    spans: Vec<(Stamp<Tracker>, Stamp<Tracker>)>,
}

impl Moves {
    fn of(seen: &Observation, decision: &Decision, gate_mm: f64) -> Self {
        let pairs = pattern::overlaps(seen.dwells(), decision.relation);
        let readings = pairs.iter().map(|&pair| decide::reading(seen.dwells(), pair));
        let readings: Vec<_> = readings.collect();
        let stretches = moved::stretches(&readings, &decision.placement, gate_mm);
        let ends = |own: &moved::Stretch| [own.first, own.last].map(|place| pairs[place]);
        let found = stretches.iter().map(|own| {
            let stations = ends(own).map(|pair| pair.arm);
            own.elsewhere(&readings, &decision.placement, stations)
        });
        let spans = stretches.iter().map(|own| {
            let [first, last] = ends(own).map(|pair| &seen.target[pair.target]);
            (first.start, last.end)
        });
        Self { found: found.collect(), spans: spans.collect() }
    }
}

/// The least number of pairs that distinguish a right shift from a wrong one: base and target alone are nine unknowns.
pub const MIN_PAIRS: usize = 6;

/// Target dwells closer together than this many stationary thresholds are at one place.
const SAME_REACH: f64 = 2.0;

/// Refines the clock on the supporting pairs: the published estimate, the relation in seconds since the first stamps, and whether it is
/// by the edges of dwells.
fn estimate_clock(
    seen: &Observation,
    decision: &Decision,
    origin: Stamp<Controller>,
) -> (ClockEstimate, Relation, bool) {
    let refined = clock::refine(seen.dwells(), &decision.support, seen.sampling_s);
    let relation = refined.relation;
    let apart_ns = seen.first_measured.ns().saturating_sub(origin.ns());
    let estimate = ClockEstimate {
        model: ClockModel {
            origin,
            offset_ns: relation.offset_s.mul_add(NS_PER_S, apart_ns as f64),
            drift: relation.drift,
        },
        offset_se_ns: refined.offset_se_s * NS_PER_S,
        drift_se: refined.drift_se,
        matched_edges: refined.matched,
        edge_rms_ns: refined.rms_s * NS_PER_S,
        method: method(decision, refined.by_edges),
        steps: Vec::new(),
    };
    (estimate, relation, refined.by_edges)
}

fn method(decision: &Decision, by_edges: bool) -> String {
    format!(
        "{} shifts tried by the pattern of moves; geometry chose the one with {} pairs at a median of {:.2} mm from \
         the nominal arm (next best {} pairs); refined on {}",
        decision.tried,
        decision.support.len(),
        decision.median_mm,
        decision.rival_support,
        if by_edges { "the edges of dwells" } else { "the middles of dwells" },
    )
}

/// The dispositions before pairing: moving, or stationary without a station.
fn first_dispositions(readings: &Readings<'_>, dwells: &[TargetDwell]) -> Dispositions {
    let mut dispositions = Dispositions::new(readings.count());
    for dwell in dwells {
        let rows = dwell.stretch.first..dwell.stretch.last + 1;
        dispositions.set(rows, Disposition::Unpaired(Why::NoArmDwell));
    }
    dispositions
}

/// A dwell by the controller's own clock, which stamps commands too.
const fn occasion(dwell: &ArmDwell) -> command::Occasion {
    command::Occasion { start: dwell.start, end: dwell.end, flange: dwell.flange }
}

fn stations(
    commands: Vec<Option<Command>>,
    dwells: &[ArmDwell],
    evidence: &pair::Evidence,
    dispositions: &mut Dispositions,
) -> Result<Vec<Station>, JoinError> {
    let station = |(number, (dwell, command)): (usize, (&ArmDwell, Option<Command>))| {
        let (pairing, reading) = evidence.verdict(dwell, dispositions)?;
        Ok(Station {
            number,
            start: dwell.start,
            end: dwell.end,
            joints: dwell.joints.clone(),
            joint_samples: dwell.samples,
            command,
            readings: reading.into_iter().collect(),
            pairing,
        })
    };
    dwells.iter().zip(commands).enumerate().map(station).collect()
}
