//! Readings of instruments of one length in the tracker's log → a length of each at the stations where it read one.
//!
//! A draw wire or a laser distance reads one number while the arm moves and while it stands. The arm's dwells decide, not those of the
//! number: it may stay the same while the arm goes round an anchor.
//!
//! 1. Readings between `settle_s` after the arm's arrival and its departure are of the station; zeros of a distance are missing.
//! 2. Outliers from the median of a dwell are left out, as with the readings of a target ([`super::average`]): none within what the
//!    instrument states.
//! 3. The uncertainty of a mean is the instrument's own, and the scatter of the mean.
//!
//! The clocks are found before, from targets alone. Motion that references show is not taken out: lengths are read in the base's frame.

use std::ops::Range;

use nalgebra::Vector3;

use super::average::{kept, mean_and_scatter, robust_sigma};
use super::disposition::{Disposition, Dispositions, Why};
use super::pair::nearest;
use super::readings::{Seen, pieces};
use super::{
    JoinError, JoinInput, JoinReject, JoinSettings, Joined, MeanLength, Pairing, Reading,
    ReadingCounts, SourceId, Station, TargetId, Value,
};
use crate::figures::median;
use crate::ingest::{LengthRead, LengthSource, Poses, is_length};
use crate::units::{ClockModel, NS_PER_S, Stamp, Tracker, round_ns};

#[derive(Debug)]
pub struct LengthReadings {
    pub name: String,
    pub reads: LengthRead,
    pub sd_mm: f64,
    pub least_mm: Option<f64>,
    pub target: TargetId,
    /// The readings, in order of tracker time: each length is the x of a position, mm.
    pub readings: Box<dyn Poses<Tracker>>,
}

impl LengthReadings {
    /// The readings of an instrument, of one of the targets with these names.
    pub fn of(
        source: &LengthSource<'_>,
        targets: &[String],
        readings: Box<dyn Poses<Tracker>>,
    ) -> Self {
        Self {
            name: source.name.to_owned(),
            reads: source.reads,
            sd_mm: source.sd_mm,
            least_mm: source.least_mm(),
            target: TargetId(source.target_among(targets).unwrap_or(0)),
            readings,
        }
    }

    fn is_reading(&self, mm: f64) -> bool {
        is_length(self.least_mm, mm)
    }
}

/// The session with the lengths at its stations, as sources behind that of places.
pub(super) fn added(
    mut joined: Joined,
    input: &JoinInput,
    settings: &JoinSettings,
) -> Result<Joined, JoinError> {
    let dwelling = Dwelling::new(&joined, settings);
    for (place, own) in input.lengths.iter().enumerate() {
        let (means, counts, rejects) = dwelling.lengths(own)?;
        for (number, mut reading) in means {
            let Some(station) = joined.stations.get_mut(number) else { continue };
            let middle = reading.first.plus_ns(reading.last.since_ns(reading.first) / 2);
            reading.source = SourceId(place + 1);
            reading.temperature_c = nearest(&input.temperatures, middle);
            station.pairing = Pairing::Paired;
            station.readings.push(reading);
        }
        joined.counts += counts;
        joined.rejects.extend(rejects);
    }
    Ok(joined)
}

/// The dwells of the arm by the tracker's clock: arrival, the end of settling, and departure.
struct Dwelling<'a> {
    windows: Vec<[Stamp<Tracker>; 3]>,
    settings: &'a JoinSettings,
}

/// A mean by the number of its station.
type Means = Vec<(usize, Reading)>;

impl<'a> Dwelling<'a> {
    fn new(joined: &Joined, settings: &'a JoinSettings) -> Self {
        let settle_ns = round_ns(joined.found.settle_s * NS_PER_S);
        let clock: &ClockModel = &joined.clock.model;
        let window = |station: &Station| {
            let arrival = clock.to_tracker(station.start);
            [arrival, arrival.plus_ns(settle_ns), clock.to_tracker(station.end)]
        };
        Self { windows: joined.stations.iter().map(window).collect(), settings }
    }

    /// The means of an instrument, how many of its readings are what, and those left out.
    fn lengths(
        &self,
        own: &LengthReadings,
    ) -> Result<(Means, ReadingCounts, Vec<JoinReject>), JoinError> {
        let mut dispositions = Dispositions::new(own.readings.count());
        let missing = missing(own)?;
        let usual_mm = self.usual_mm(own)?;
        let mut means = Vec::new();
        for number in 0..self.windows.len() {
            let (settling, settled) = self.dwell(number, own)?;
            dispositions.set(settling, Disposition::Settling);
            let mean = self.mean(own, &settled, usual_mm, &mut dispositions);
            means.extend(mean.map(|mean| (number, mean)));
        }
        for rows in missing {
            dispositions.set(rows, Disposition::Missing);
        }
        let mut rejects = dispositions.rejects(|row| Ok(own.readings.stamp(row)?))?;
        for reject in &mut rejects {
            reject.reason = format!("length {:?}: {}", own.name, reject.reason);
        }
        Ok((means, dispositions.counts(), rejects))
    }

    /// The rows of a dwell before its settling time, and the readings behind it.
    fn dwell(
        &self,
        number: usize,
        own: &LengthReadings,
    ) -> Result<(Range<usize>, Settled), JoinError> {
        let [arrival, settled, departure] = self.windows[number];
        let before = |moment: Stamp<Tracker>| own.readings.count_while(&|stamp| stamp < moment);
        let (first, from) = (before(arrival)?, before(settled)?);
        let to = own.readings.count_while(&|stamp| stamp <= departure)?;
        let rows = from..to.max(from);
        let readings = own.readings.read(rows.clone())?;
        let seen = Seen { rows: rows.clone(), readings };
        let measured = rows.clone().filter(|&row| own.is_reading(seen.position(row)[0]));
        Ok((
            first..from.min(to).max(first),
            Settled {
                rows: measured.clone().collect(),
                stamps: measured.clone().map(|row| seen.stamp(row)).collect(),
                lengths: measured.map(|row| seen.position(row)).collect(),
            },
        ))
    }

    /// The session's usual standard deviation of a reading, mm: few readings of one dwell can agree by chance. It is the stated one at
    /// least, as those of an instrument with a coarse step agree where they do not differ by a whole one.
    fn usual_mm(&self, own: &LengthReadings) -> Result<f64, JoinError> {
        let mut scatters = Vec::with_capacity(self.windows.len());
        for number in 0..self.windows.len() {
            let (_, settled) = self.dwell(number, own)?;
            if settled.rows.len() >= self.settings.min_readings {
                let mut lengths: Vec<f64> = settled.lengths.iter().map(|own| own[0]).collect();
                scatters.push(robust_sigma(&mut lengths));
            }
        }
        Ok(median(&scatters).unwrap_or(0.0).max(own.sd_mm))
    }

    fn mean(
        &self,
        own: &LengthReadings,
        settled: &Settled,
        usual_mm: f64,
        dispositions: &mut Dispositions,
    ) -> Option<Reading> {
        let keep = kept(&settled.lengths, self.settings.mad_factor, [usual_mm; 3]);
        let used: Vec<usize> = (0..keep.len()).filter(|&place| keep[place]).collect();
        let enough = used.len() >= self.settings.min_readings.max(2);
        let disposition = |keep: bool| match (keep, enough) {
            (false, _) => Disposition::Outlier,
            (true, false) => Disposition::Unpaired(Why::TooFew),
            (true, true) => Disposition::Kept,
        };
        let each = settled.rows.iter().zip(&keep);
        dispositions.set_each(each.map(|(row, keep)| (*row, disposition(*keep))));
        let (&first, &last) = (used.first()?, used.last()?);
        enough.then(|| {
            let lengths = used.iter().map(|&place| Vector3::from(settled.lengths[place]));
            let (mean, scatter) = mean_and_scatter(&lengths.collect::<Vec<_>>());
            let length = MeanLength {
                mm: mean.x,
                sd_mm: own.sd_mm.hypot(scatter.x / (used.len() as f64).sqrt()),
            };
            Reading {
                source: SourceId::ONLY,
                target: own.target,
                value: match own.reads {
                    LengthRead::Distance => Value::Distance(length),
                    LengthRead::Height => Value::Height(length),
                },
                kept: used.len(),
                taken: settled.rows.len(),
                first: settled.stamps[first],
                last: settled.stamps[last],
                temperature_c: None,
            }
        })
    }
}

struct Settled {
    rows: Vec<usize>,
    stamps: Vec<Stamp<Tracker>>,
    lengths: Vec<[f64; 3]>,
}

/// Runs of rows that are no readings; the readings have to be in order of time.
fn missing(own: &LengthReadings) -> Result<Vec<Range<usize>>, JoinError> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for seen in pieces(&*own.readings) {
        let seen = seen?;
        for row in seen.rows.clone().filter(|&row| !own.is_reading(seen.position(row)[0])) {
            match runs.last_mut() {
                Some(run) if run.end == row => run.end += 1,
                _ => runs.push(row..row + 1),
            }
        }
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::super::scene;
    use super::*;
    use crate::ingest::TargetReadings;

    /// Readings every 0.1 s from the start of the first station to the end of the last: `length` of the station whose dwell they are in,
    /// if any, and of their number.
    fn readings(
        joined: &Joined,
        length: impl Fn(Option<usize>, usize) -> f64,
    ) -> Box<dyn Poses<Tracker>> {
        let (clock, stations) = (&joined.clock.model, &joined.stations);
        let mut all = TargetReadings::default();
        let mut at = stations[0].start;
        while at <= stations[stations.len() - 1].end {
            let begun = stations.partition_point(|own| own.start <= at) - 1;
            let dwell = (at <= stations[begun].end).then_some(begun);
            let mm = length(dwell, all.stamps.len());
            all.stamps.push(clock.to_tracker(at));
            all.positions.push([mm, 0.0, 0.0]);
            at = at.plus_ns(100_000_000);
        }
        Box::new(all)
    }

    /// A session of twelve stations, each of a second.
    fn joined() -> Joined {
        let scene = scene::Scene::random(12, 5);
        scene.joined(&scene.record(&scene::ur10()))
    }

    fn wire(readings: Box<dyn Poses<Tracker>>) -> LengthReadings {
        LengthReadings {
            name: "wire".to_owned(),
            reads: LengthRead::Distance,
            sd_mm: 0.03,
            least_mm: Some(0.0),
            target: TargetId::ONLY,
            readings,
        }
    }

    #[test]
    fn every_dwell_has_the_mean_of_its_readings_and_every_reading_a_class() {
        let settings = JoinSettings::default();
        let joined = joined();
        let dwelling = Dwelling::new(&joined, &settings);
        // The wire stands at 1000 mm and two more a station, with noise of 0.02 mm; station 3 is lost, and station 5 has one
        // reading that is 40 mm off.
        let lone = std::cell::Cell::new(None);
        let of = |dwell: Option<usize>, number: usize| match dwell {
            None => 777.0,
            Some(3) => 0.0,
            Some(5)
                if lone.get().is_none_or(|own| own == number) && is_settled(&joined, number) =>
            {
                lone.set(Some(number));
                1050.0
            }
            Some(dwell) => {
                let off = if number.is_multiple_of(2) { 0.02 } else { -0.02 };
                2.0_f64.mul_add(dwell as f64, 1000.0 + off)
            }
        };
        let own = wire(readings(&joined, of));
        let (means, counts, rejects) = dwelling.lengths(&own).expect("in memory");
        let numbers: Vec<usize> = means.iter().map(|(number, _)| *number).collect();
        let all: Vec<usize> = (0..joined.stations.len()).filter(|own| *own != 3).collect();
        assert_eq!(numbers, all);
        for (number, mean) in &means {
            let Value::Distance(length) = mean.value else {
                panic!("a distance");
            };
            let wanted_mm = 2.0_f64.mul_add(*number as f64, 1000.0);
            assert!((length.mm - wanted_mm).abs() < 0.021, "{number}: {length:?}");
            assert!(length.sd_mm > 0.03 && length.sd_mm < 0.04, "{length:?}");
        }
        let total = counts.kept
            + counts.settling
            + counts.outlier
            + counts.moving
            + counts.unpaired
            + counts.missing;
        assert_eq!(total, own.readings.count() as u64);
        assert_eq!(counts.outlier, 1);
        assert!(counts.missing > 0 && counts.moving > 0);
        let kept: usize = means.iter().map(|(_, mean)| mean.kept).sum();
        assert_eq!(counts.kept, kept as u64);
        let rejected: u64 = rejects.iter().map(|own| own.readings).sum();
        assert_eq!(rejected + counts.kept, total);
        assert!(rejects.iter().all(|own| own.reason.starts_with("length \"wire\": ")));
    }

    /// Whether the reading of this number is two seconds behind the arrival at station 5.
    fn is_settled(joined: &Joined, number: usize) -> bool {
        let first = joined.stations[0].start;
        let at = first.plus_ns(100_000_000 * i64::try_from(number).expect("few"));
        at.since_ns(joined.stations[5].start) > 600_000_000
    }

    #[test]
    fn readings_out_of_order_are_an_error() {
        let settings = JoinSettings::default();
        let joined = joined();
        let samples = TargetReadings {
            stamps: vec![Stamp::from_ns(5), Stamp::from_ns(4)],
            positions: vec![[1.0, 0.0, 0.0]; 2],
            ..TargetReadings::default()
        };
        let found = Dwelling::new(&joined, &settings).lengths(&wire(Box::new(samples)));
        assert!(matches!(found, Err(JoinError::OutOfOrder { row: 1, .. })));
    }
}
