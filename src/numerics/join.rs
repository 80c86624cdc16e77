//! Join: two logs with a clock each → stations, each a dwell of the arm with the tracker's measurement of it.
//!
//! Input is the logs' content ([`JoinInput`]) and the nominal [`Arm`]; output is [`Joined`] ([`crate::method::join`]).
//!
//! 1. [`readings`], [`observe`], [`stationary`], [`dwell`]: dwells of the arm on joints, of the target on positions.
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
mod joined;
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

use std::ops::Range;

use self::decide::Decision;
use self::disposition::{Disposition, Dispositions, Why};
use self::dwell::{ArmDwell, TargetDwell};
use self::logged_references::bumps::Targets;
use self::moved::Elsewhere;
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
pub use joined::{
    ClockEstimate, Command, JoinReject, Joined, Pairing, ReadingCounts, RejectCode, RowItem,
    RowReject, Station, Thresholds, Unmeasured,
};
pub use logged_lengths::LengthReadings;
pub use reading::{
    ByKind, MeanLength, MeanOrientation, MeanPoint, Reading, ReadingKind, SeveralSources, SourceId,
    TargetId, Value, one_source,
};
pub use settings::JoinSettings;

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
    // Dwells by the controller's own clock, which stamps commands too.
    let occasion = |dwell: &ArmDwell| command::Occasion {
        start: dwell.start,
        end: dwell.end,
        flange: dwell.flange,
    };
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
    let settling_s = || settle::settling_s(&seen, &readings, &decision.support, relation);
    let settle_s = settings.settle_s.map_or_else(settling_s, Ok)?;
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
        usual_mm: observe::usual_scatter_mm(&seen.target),
        settle_s,
        settings,
    };
    let commands = command::in_force(&*input.commands, &occasions)?;
    let paired = Paired::of(commands, &seen.arm, &evidence, repeated, &others)?;
    let joined = paired.joined(clock, elsewhere.found, seen.thresholds(settle_s));
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
            own.elsewhere(&readings, &decision.placement, ends(own).map(|pair| pair.arm))
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

/// Refines the clock on the supporting pairs: published estimate, relation in s since the first stamps, and whether by edges of dwells.
fn estimate_clock(
    seen: &Observation,
    decision: &Decision,
    origin: Stamp<Controller>,
) -> (ClockEstimate, Relation, bool) {
    let refined = clock::refine(seen.dwells(), &decision.support, seen.sampling_s);
    let relation = refined.relation;
    let apart_ns = seen.first_measured.ns().saturating_sub(origin.ns());
    let offset_ns = relation.offset_s.mul_add(NS_PER_S, apart_ns as f64);
    let estimate = ClockEstimate {
        model: ClockModel { origin, offset_ns, drift: relation.drift },
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

/// The stations with the readings of all targets, how many readings became what, and those that belong to no station.
struct Paired {
    stations: Vec<Station>,
    counts: ReadingCounts,
    rejects: Vec<JoinReject>,
}

impl Paired {
    fn of(
        commands: Vec<Option<Command>>,
        arm: &[ArmDwell],
        evidence: &pair::Evidence<'_>,
        repeated: &[Range<usize>],
        others: &[Other<'_>],
    ) -> Result<Self, JoinError> {
        let readings = evidence.readings;
        let mut dispositions = first_dispositions(readings, evidence.target);
        let mut stations = stations(commands, arm, evidence, &mut dispositions)?;
        readings.missing().for_each(|rows| dispositions.set(rows, Disposition::Missing));
        repeated.iter().cloned().for_each(|rows| dispositions.set(rows, Disposition::Repeated));
        let mut counts = dispositions.counts();
        let mut rejects = dispositions.rejects(|row| readings.stamp(row))?;
        for other in others {
            let (own, left_out) = other.add(arm, evidence, &mut stations)?;
            counts += own;
            rejects.extend(left_out);
        }
        Ok(Self { stations, counts, rejects })
    }

    /// The join before references and lengths.
    fn joined(self, clock: ClockEstimate, elsewhere: Vec<Elsewhere>, found: Thresholds) -> Joined {
        let Self { stations, counts, rejects } = self;
        Joined {
            stations,
            clock,
            rejects,
            row_rejects: Vec::new(),
            references: Vec::new(),
            read_references: Vec::new(),
            elsewhere,
            knocks: Vec::new(),
            counts,
            found,
        }
    }
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
