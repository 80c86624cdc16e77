//! Joins the two logs of a session whose readings do not name their targets: those are found by geometry.

use super::assigned::stream::{self, ByTarget, LaneRows};
use super::assigned::{Stated, lanes};
use super::decide;
use super::disposition::Disposition;
use super::dwell::TargetDwell;
use super::logged_references::bumps::Targets;
use super::observe::{self, Observation};
use super::others::{self, Other};
use super::readings::Readings;
use super::{
    ClockEstimate, Found, JoinError, JoinInput, JoinReject, JoinSettings, Joined, Pairing,
    ReadingCounts, SAME_REACH, TargetId, estimate_clock, first_dispositions, settle, unmeasured,
    with_references_and_lengths,
};
use crate::ingest::Poses;
use crate::kinematics::Arm;
use crate::units::Stamp;

/// Joins the two logs of a session whose readings are of several targets and do not name them, one after another or at once: their
/// targets are found by geometry, with what is stated of them.
///
/// Counts, rejects and dispositions are those of [`join`](super::join()); the distances of each assignment and of its runner-up are in
/// [`Joined::assigned`].
pub fn join_unnamed(
    input: &JoinInput,
    arm: &Arm,
    settings: &JoinSettings,
    stated: &Stated,
) -> Result<Joined, JoinError> {
    settings.check()?;
    observe::check_joints(&input.joints, arm)?;
    observe::check_temperatures(&input.temperatures)?;
    let targets = Targets::of(input, settings)?;
    let lanes = lanes::of(&*targets.main, stated)?;
    let readings = lanes.iter().map(|lane| Readings::find(lane, settings));
    let readings: Vec<Readings<'_>> = readings.collect::<Result<_, _>>()?;
    let (seen, lane_of) = observe::observe_lanes(&readings, &input.joints, arm, settings)?;
    let seen = Unnamed { readings: &readings, seen, lane_of };
    let (clock, visits, settle_s) = seen.clock(input, stated, settings)?;
    let mut by_target =
        stream::by_target(&lanes, (&visits, &seen.dwells()), &clock.model, stated, settings)?;
    let mut stations = unmeasured(&*input.commands, &seen.seen.arm)?;
    for &number in &by_target.ambiguous {
        stations[number].pairing = Pairing::Ambiguous;
    }
    let assigned = std::mem::take(&mut by_target.assigned);
    let (mut counts, mut rejects) = seen.beside_targets(&by_target)?;
    let found = others::Found {
        arm: &seen.seen.arm,
        temperatures: &input.temperatures,
        clock: clock.model,
        moved: &[],
        settle_s,
        settings,
    };
    for (place, own) in by_target.targets.iter().enumerate() {
        if own.count() > 0 {
            let (own, left_out) =
                Other::of(TargetId(place), own, settings)?.add(&found, &mut stations)?;
            counts += own;
            rejects.extend(left_out);
        }
    }
    rejects.sort_by_key(|own| own.start);
    let joined = Joined {
        stations,
        clock,
        rejects,
        row_rejects: Vec::new(),
        assigned,
        references: Vec::new(),
        read_references: Vec::new(),
        elsewhere: Vec::new(),
        counts,
        found: Found {
            stationary_rad: seen.seen.stationary_rad,
            stationary_mm: seen.seen.stationary_mm,
            settle_s,
        },
    };
    with_references_and_lengths(targets.restored(joined), input, settings)
}

/// Readings of several targets in lanes, and where they stood still.
struct Unnamed<'a> {
    readings: &'a [Readings<'a>],
    seen: Observation,
    /// The lane of each of the target's dwells.
    lane_of: Vec<usize>,
}

impl Unnamed<'_> {
    /// The dwells with their lanes, in order of time.
    fn dwells(&self) -> stream::LaneDwells<'_> {
        let mut counts = vec![0; self.readings.len()];
        let place = |&lane: &usize| {
            counts[lane] += 1;
            (lane, counts[lane] - 1)
        };
        stream::LaneDwells {
            dwells: &self.seen.target,
            places: self.lane_of.iter().map(place).collect(),
        }
    }

    /// Dwells of one lane.
    fn of_lane(&self, lane: usize) -> impl Iterator<Item = &TargetDwell> {
        let dwells = self.seen.target.iter().zip(&self.lane_of);
        let own = dwells.filter(move |(_, own)| **own == lane);
        own.map(|(dwell, _)| dwell)
    }

    /// The lane with the most dwells; of equal ones the first.
    fn fullest(&self) -> usize {
        let lanes = (0..self.readings.len()).rev();
        lanes.max_by_key(|lane| self.of_lane(*lane).count()).unwrap_or(0)
    }

    /// The clocks by the visits of the arm, the logs' dwells with visits as those of the target, and the settling time.
    fn clock(
        &self,
        input: &JoinInput,
        stated: &Stated,
        settings: &JoinSettings,
    ) -> Result<(ClockEstimate, Observation, f64), JoinError> {
        let seen = &self.seen;
        let visits = Observation {
            target: stream::visits(&seen.target, stated, SAME_REACH * seen.stationary_mm),
            ..seen.clone()
        };
        let decision = decide::decide(visits.dwells(), settings.geometry_gate_mm)?;
        let origin = Stamp::from_ns(input.joints.span_ns.0);
        let (mut clock, relation, by_edges) = estimate_clock(&visits, &decision, origin);
        if !by_edges {
            clock.model = others::centred(clock.model, &visits.arm, &visits.target, &[]);
        }
        let found = || {
            let lane = self.fullest();
            let own: Vec<&TargetDwell> = self.of_lane(lane).collect();
            let (firsts, pairs) = stream::firsts(&visits, &decision.support, &own);
            settle::settling_s(&firsts, &self.readings[lane], &pairs, relation)
        };
        let settle_s = settings.settle_s.map_or_else(found, Ok)?;
        Ok((clock, visits, settle_s))
    }

    /// Counts and rejects of the readings that are of no target: missing, moving, outside of the arm's dwells, or of none by geometry.
    fn beside_targets(
        &self,
        by_target: &ByTarget<'_>,
    ) -> Result<(ReadingCounts, Vec<JoinReject>), JoinError> {
        let (mut counts, mut rejects) = (ReadingCounts::default(), Vec::new());
        let left_out = by_target.left_out.iter().map(|(rows, _)| rows);
        let taken: Vec<&LaneRows> = by_target.assigned_rows.iter().chain(left_out).collect();
        for (lane, readings) in self.readings.iter().enumerate() {
            let mut dispositions = first_dispositions(readings, self.of_lane(lane));
            for rows in readings.missing() {
                dispositions.set(rows, Disposition::Missing);
            }
            for own in taken.iter().filter(|own| own.lane == lane) {
                dispositions.set(own.rows.clone(), Disposition::Kept);
            }
            rejects.extend(dispositions.rejects(|row| readings.stamp(row))?);
            counts += dispositions.counts();
        }
        let left_out = stream::rejects(&by_target.left_out, self.readings)?;
        counts.kept = 0;
        counts.unpaired += left_out.iter().map(|own| own.readings).sum::<u64>();
        rejects.extend(left_out);
        Ok((counts, rejects))
    }
}
