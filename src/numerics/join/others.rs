//! Further targets of one tracker: their readings → a reading of each at the stations that the main target's join found.
//!
//! A tracker measures several reflectors in one dwell of the arm, one after another or at once; a camera sees several markers in one
//! image. The main target decides the clocks ([`super::join`]). Each further target is then paired dwell by dwell as the main one is
//! ([`super::pair`]), with a placement of its own, so that each has at most one reading a station, and all of its readings a disposition.
//!
//! Where the main target's dwells showed no edges, the clocks agree only in the middles of dwells, and a target that is measured first
//! in each dwell is in the middle of none: [`centred`] puts the readings of all targets together in the middle of the arm's dwells.

use super::disposition::Disposition;
use super::dwell::{ArmDwell, TargetDwell, target_dwells};
use super::observe::usual_scatter_mm;
use super::pair::{Evidence, placed};
use super::placement::ReadingAtFlange;
use super::readings::Readings;
use super::{
    JoinError, JoinReject, JoinSettings, Pairing, Reading, ReadingCounts, SAME_REACH, Station,
    TargetId, first_dispositions,
};
use crate::figures::median;
use crate::ingest::Poses;
use crate::units::{ClockModel, Tracker, round_ns};

pub(super) struct Other<'a> {
    target: TargetId,
    readings: Readings<'a>,
    dwells: Vec<TargetDwell>,
}

impl<'a> Other<'a> {
    /// The further targets that have readings.
    pub(super) fn all(
        others: &'a [Box<dyn Poses<Tracker> + 'a>],
        settings: &JoinSettings,
    ) -> Result<Vec<Self>, JoinError> {
        let read = others.iter().enumerate().filter(|(_, own)| own.count() > 0);
        read.map(|(place, own)| {
            let readings = Readings::find(&**own, settings)?;
            Ok(Self { target: TargetId(place + 1), dwells: target_dwells(&readings)?, readings })
        })
        .collect()
    }

    /// Adds this target's readings to the stations of `arm`, by the evidence of the main target; returns how many of them are what, and those left out.
    pub(super) fn add(
        &self,
        arm: &[ArmDwell],
        main: &Evidence<'_>,
        stations: &mut [Station],
    ) -> Result<(ReadingCounts, Vec<JoinReject>), JoinError> {
        let mut dispositions = first_dispositions(&self.readings, &self.dwells);
        if let Some(evidence) = self.evidence(arm, main) {
            for (dwell, station) in arm.iter().zip(stations) {
                let (_, reading) = evidence.verdict(dwell, &mut dispositions)?;
                if let Some(reading) = reading {
                    station.pairing = Pairing::Paired;
                    station.readings.push(Reading { target: self.target, ..reading });
                }
            }
        }
        for rows in self.readings.missing() {
            dispositions.set(rows, Disposition::Missing);
        }
        let mut rejects = dispositions.rejects(|row| self.readings.stamp(row))?;
        for reject in &mut rejects {
            reject.reason = format!("target {}: {}", self.target.0 + 1, reject.reason);
        }
        Ok((dispositions.counts(), rejects))
    }

    /// What verdicts on this target need; `None` where too few dwells place it.
    fn evidence<'e>(&'e self, arm: &[ArmDwell], main: &'e Evidence<'e>) -> Option<Evidence<'e>> {
        let pairs = self.dwells.iter().filter_map(|own| {
            let arm = nearest(arm, &main.clock, own)?;
            Some(ReadingAtFlange { flange: arm.flange, attained: own.position })
        });
        let pairs: Vec<ReadingAtFlange> = pairs.collect();
        let (placement, gate_mm) = placed(&pairs, main.settings)?;
        Some(Evidence {
            readings: &self.readings,
            target: &self.dwells,
            placement,
            gate_mm,
            same_mm: SAME_REACH * self.readings.stationary.threshold,
            usual_mm: usual_scatter_mm(&self.dwells),
            ..*main
        })
    }
}

/// The arm's dwell in which the middle of a target's dwell lies; `None` where the arm moved.
fn nearest<'a>(
    arm: &'a [ArmDwell],
    clock: &ClockModel,
    target: &TargetDwell,
) -> Option<&'a ArmDwell> {
    let middle = target.start.plus_ns(target.end.since_ns(target.start) / 2);
    let after = arm.partition_point(|dwell| clock.to_tracker(dwell.end) < middle);
    let dwell = arm.get(after)?;
    (clock.to_tracker(dwell.start) <= middle).then_some(dwell)
}

/// The clock under which the readings of all targets lie in the middle of the arm's dwells, from one under which `main`'s do. Each
/// dwell of a target counts for the dwell of the arm that is nearest to it.
pub(super) fn centred(
    clock: ClockModel,
    arm: &[ArmDwell],
    main: &[TargetDwell],
    others: &[Other<'_>],
) -> ClockModel {
    let all = main.iter().chain(others.iter().flat_map(|own| &own.dwells));
    let mut spans: Vec<Option<(i64, i64)>> = vec![None; arm.len()];
    let middle = |dwell: &ArmDwell| {
        let half = dwell.end.since_ns(dwell.start) / 2;
        clock.to_tracker(dwell.start.plus_ns(half)).ns()
    };
    let middles: Vec<i64> = arm.iter().map(middle).collect();
    for own in all {
        let at = i64::midpoint(own.start.ns(), own.end.ns());
        let after = middles.partition_point(|middle| *middle < at);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let near = near.filter(|place| *place < middles.len());
        let Some(place) = near.min_by_key(|place| (middles[*place] - at).abs()) else { continue };
        let (first, last) = spans[place].unwrap_or((own.start.ns(), own.end.ns()));
        spans[place] = Some((first.min(own.start.ns()), last.max(own.end.ns())));
    }
    let off = spans.iter().zip(&middles).filter_map(|(span, middle)| {
        let (first, last) = (*span)?;
        Some((i64::midpoint(first, last) - middle) as f64)
    });
    let off_ns = median(&off.collect::<Vec<f64>>()).unwrap_or(0.0);
    ClockModel { offset_ns: clock.offset_ns + round_ns(off_ns) as f64, ..clock }
}
