//! Slips of instruments that read one length: behind one an instrument counts as another, with an anchor and an offset of its own.
//!
//! The readings from the session's start to the first slip keep their instrument, and with it what the pipeline file states of its
//! offset. Those from each slip on are of an instrument named after it, at the stated place and with a free offset. A part with too few
//! readings for an anchor of its own is left out. Nothing is assumed of the slip's size, so all that the fit says of errors holds.

use std::ops::RangeInclusive;

use super::StageSettings;
use super::lengths::name;
use super::observed::observations_of;
use super::wrong_targets::{Left, take_out};
use crate::fit::slips::{self, Slip};
use crate::fit::{KnownGauge, Observation};
use crate::io::tables::outcome::JoinedSession;
use crate::join::{SourceId, Unmeasured};
use crate::kinematics::Arm;

/// Readings of a part at least: an anchor and an offset are four unknowns, and blocks that are held out take a part of them.
const LEAST: usize = 20;

/// The readings of one instrument in one session between two slips.
struct Part<'a> {
    session: usize,
    source: SourceId,
    /// The slip that it begins with; `None` of the first.
    slip: Option<&'a Slip>,
    stations: RangeInclusive<usize>,
    readings: usize,
}

/// Takes the readings behind slips to instruments of their own, or out; the settings with those instruments.
pub(super) fn taken_apart(
    arm: &Arm,
    training: &mut [JoinedSession],
    settings: &StageSettings,
) -> StageSettings {
    let mut settings = settings.clone();
    let seen = observations_of(arm, &*training, &settings);
    if seen.iter().all(|own| own.measured.length().is_none()) {
        return settings;
    }
    let slips = slips::check(arm, &seen, training.len(), &settings.fit);
    for part in parts(&slips, &seen) {
        let session = &mut training[part.session];
        let instrument = name(part.source, &settings);
        let follows = if part.readings < LEAST {
            leave_out(session, &part, &instrument);
            format!(
                "too few for an offset of their own: they are left out ({} readings)",
                part.readings
            )
        } else if part.slip.is_some() {
            let other = add_source(&part, &instrument, &mut settings);
            rename(session, &part, other);
            format!("they count as another instrument, {:?}", name(other, &settings))
        } else {
            continue;
        };
        let stations =
            format!("readings of stations {} to {}", part.stations.start(), part.stations.end());
        session.slips.push(match part.slip {
            Some(slip) => format!("{}; {stations}: {follows}", slip.words(&instrument)),
            None => format!("{instrument}, before its first slip; {stations}: {follows}"),
        });
    }
    settings
}

/// The parts of all instruments that slipped, in order of sessions, instruments and stations.
fn parts<'a>(slips: &'a [Slip], seen: &[Observation]) -> Vec<Part<'a>> {
    let mut parts = Vec::new();
    let of_one = |a: &Slip, b: &Slip| (a.session, a.source) == (b.session, b.source);
    for slips in slips.chunk_by(of_one) {
        let (session, source) = (slips[0].session, slips[0].source);
        let own = seen.iter();
        let own = own.filter(|own| (own.session, own.source) == (session, source));
        let stations: Vec<usize> = own.map(|own| own.station).collect();
        let starts = [None].into_iter().chain(slips.iter().map(Some));
        let ends = slips.iter().map(|slip| slip.after).chain([usize::MAX]);
        for (slip, end) in starts.zip(ends) {
            let start = slip.map_or(0, |slip| slip.before);
            let own = stations.iter().filter(|own| (start..=end).contains(*own));
            let last = own.clone().max().copied();
            parts.push(Part {
                session,
                source,
                slip,
                stations: start..=last.unwrap_or(start),
                readings: own.count(),
            });
        }
    }
    parts
}

/// Leaves the readings of a part out.
fn leave_out(session: &mut JoinedSession, part: &Part<'_>, instrument: &str) {
    for station in part.stations.clone() {
        let left = Left {
            station,
            reason: format!(
                "slipped: {instrument} slipped between two stations, and the {} readings of stations {} to {} are too few for an offset \
                 of their own",
                part.readings,
                part.stations.start(),
                part.stations.end()
            ),
            otherwise: Unmeasured::WrongTarget,
        };
        take_out(session, &left, |reading| reading.source == part.source);
    }
}

/// An instrument of its own for a part: what is stated of the instrument but its offset.
fn add_source(part: &Part<'_>, instrument: &str, settings: &mut StageSettings) -> SourceId {
    let sources = settings.noise.sources.len();
    let fit = &mut settings.fit;
    fit.source_names.resize(sources, "tracker".to_owned());
    fit.source_names.push(format!("{instrument}, from station {}", part.stations.start()));
    fit.gauges.resize(sources, KnownGauge::default());
    fit.gauges.push(KnownGauge { offset: None, ..fit.gauges[part.source.0] });
    let noise = &mut settings.noise.sources;
    noise.push(noise[part.source.0]);
    SourceId(sources)
}

/// Gives the readings of a part to another instrument.
fn rename(session: &mut JoinedSession, part: &Part<'_>, other: SourceId) {
    let stations = session.joined.stations.iter_mut();
    for station in stations.filter(|own| part.stations.contains(&own.number)) {
        let own = station.readings.iter_mut();
        for reading in own.filter(|own| own.source == part.source) {
            reading.source = other;
        }
        station.readings.sort_by_key(|own| (own.source, own.target));
    }
}
