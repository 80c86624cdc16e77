//! Instruments that read one length of the measured target: their readings at stations and as samples of a log.
//!
//! Anchors and planes stand still before the tracker, in the base's frame at the session's start. The error of a
//! station is that of its reading in a table; the samples of a log scatter about it.

use nalgebra::{Point3, UnitVector3};

use super::random::{Ingredient, Stream};
use super::truth::TrueStation;
use super::{LENGTH_RESOLUTION_MM, Simulated, rounded};
use crate::ingest::{LengthRead, LengthSamples};
use crate::join::{MeanLength, Pairing, Reading, SourceId, Station, TargetId, Value};
use crate::units::{NS_PER_S, Stamp, round_ns};

/// Standard deviation of a sample about the error of its station, as a share of the instrument's.
const SAMPLE_SHARE: f64 = 0.2;

/// An instrument that reads one length of the measured target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthInstrument {
    pub truth: LengthTruth,
    pub sd_mm: f64,
}

/// What an instrument of one length reads, and where it is in the base's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LengthTruth {
    Distance { anchor: Point3<f64>, offset_mm: f64 },
    Height { normal: UnitVector3<f64>, height_mm: f64 },
}

impl LengthTruth {
    pub const fn reads(&self) -> LengthRead {
        match self {
            Self::Distance { .. } => LengthRead::Distance,
            Self::Height { .. } => LengthRead::Height,
        }
    }

    /// The reading without noise on a target at a place in the base's frame, mm.
    fn reading_mm(&self, place: &Point3<f64>) -> f64 {
        match self {
            Self::Distance { anchor, offset_mm } => (place - anchor).norm() + offset_mm,
            Self::Height { normal, height_mm } => normal.dot(&place.coords) - height_mm,
        }
    }
}

impl LengthInstrument {
    /// The reading of a target at `place` with a standard normal number, at the beginning of a station.
    fn reading(
        &self,
        source: SourceId,
        place: &Point3<f64>,
        normal: f64,
        station: &Station,
    ) -> Reading {
        let mm = self.truth.reading_mm(place) + self.sd_mm * normal;
        let length = MeanLength { mm, sd_mm: self.sd_mm };
        let at = Stamp::from_ns(station.start.ns());
        Reading {
            source,
            target: TargetId::ONLY,
            value: match self.truth.reads() {
                LengthRead::Distance => Value::Distance(length),
                LengthRead::Height => Value::Height(length),
            },
            kept: 1,
            taken: 1,
            first: at,
            last: at,
            temperature_c: None,
        }
    }
}

impl Simulated {
    /// Adds readings of instruments of one length on the target, as sources behind the tracker. Each is lost as often as a station.
    pub fn add_lengths(&self, stations: &mut [Station], instruments: &[LengthInstrument]) {
        let drawn = self.drawn_lengths(instruments);
        for ((station, truth), drawn) in stations.iter_mut().zip(&self.truth.stations).zip(drawn) {
            for (number, (instrument, normal)) in instruments.iter().zip(drawn).enumerate() {
                if let Some(normal) = normal {
                    let source = SourceId(number + 1);
                    let reading = instrument.reading(source, &place(truth), normal, station);
                    station.readings.push(reading);
                    station.pairing = Pairing::Paired;
                }
            }
        }
    }

    /// For each station and instrument the standard normal number of its error; `None` where the reading is lost.
    fn drawn_lengths(&self, instruments: &[LengthInstrument]) -> Vec<Vec<Option<f64>>> {
        let settings = &self.truth.settings;
        let mut noise = Stream::new(settings.seed, Ingredient::Lengths);
        let mut one = || {
            let (normal, drawn) = (noise.normal3().x, noise.uniform());
            (drawn >= settings.tracker.lost_share).then_some(normal)
        };
        self.truth.stations.iter().map(|_| instruments.iter().map(|_| one()).collect()).collect()
    }

    /// Readings of instruments of one length as they are logged beside the tracker's, at its rate and by its clock: from the first dwell
    /// to the last, with nothing at stations whose reading is lost. Between dwells the length goes evenly from one to the next.
    pub fn length_samples(&self, instruments: &[LengthInstrument]) -> Vec<LengthSamples> {
        let drawn = self.drawn_lengths(instruments);
        let mut noise = Stream::new(self.truth.settings.seed, Ingredient::LengthSamples);
        let all = instruments.iter().enumerate().map(|(number, own)| {
            let drawn: Vec<Option<f64>> = drawn.iter().map(|station| station[number]).collect();
            self.samples_of(own, &drawn, &mut noise)
        });
        all.collect()
    }

    fn samples_of(
        &self,
        own: &LengthInstrument,
        drawn: &[Option<f64>],
        noise: &mut Stream,
    ) -> LengthSamples {
        let (clock, stations) = (self.truth.clock_model(), &self.truth.stations);
        let interval_s = self.truth.settings.motion.reading_rate_hz.recip();
        let interval_ns = round_ns(interval_s * NS_PER_S).max(1);
        let mut samples = LengthSamples::default();
        let (Some(first), Some(last)) = (stations.first(), stations.last()) else { return samples };
        let mut at = first.start;
        while at <= last.end {
            if let Some(mm) = self.length_at(own, drawn, at) {
                let noisy = noise.normal3().x.mul_add(SAMPLE_SHARE * own.sd_mm, mm);
                samples.stamps.push(clock.to_tracker(at));
                samples.lengths_mm.push(rounded(noisy, LENGTH_RESOLUTION_MM));
            }
            at = at.plus_ns(interval_ns);
        }
        samples
    }

    /// The length at a moment with the error of its station, mm; `None` in a dwell whose reading is lost.
    fn length_at(
        &self,
        own: &LengthInstrument,
        drawn: &[Option<f64>],
        at: Stamp<crate::units::Controller>,
    ) -> Option<f64> {
        let stations = &self.truth.stations;
        let begun = stations.partition_point(|station| station.start <= at);
        let number = begun.checked_sub(1)?;
        let station = stations.get(number)?;
        let here = own.truth.reading_mm(&place(station));
        if at <= station.end {
            return Some(drawn[number]?.mul_add(own.sd_mm, here));
        }
        let next = stations.get(begun)?;
        let way = at.since_ns(station.end) as f64 / next.start.since_ns(station.end).max(1) as f64;
        Some((own.truth.reading_mm(&place(next)) - here).mul_add(way, here))
    }
}

/// The measured target in the base's frame at a station, mm.
fn place(truth: &TrueStation) -> Point3<f64> {
    Point3::from(truth.base_from_target.translation.vector)
}
