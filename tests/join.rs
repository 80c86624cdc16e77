//! The join on the real recordings, against the measured values that their logs were made from.

mod common;

use posegrid::join::{JoinSettings, Joined, Pairing, join};
use posegrid::units::NS_PER_S;

/// What recordings/README.md says of a session.
struct Truth {
    name: &'static str,
    stations: usize,
    unmeasured: &'static [usize],
    offset_s: f64,
    drift_ppm: f64,
}

const SESSIONS: [Truth; 4] = [
    Truth {
        name: "ur10-grid",
        stations: 615,
        unmeasured: &[],
        offset_s: 0.0,
        drift_ppm: 0.0,
    },
    Truth {
        name: "ur10-random-a",
        stations: 700,
        unmeasured: &[],
        offset_s: 37.482,
        drift_ppm: 12.0,
    },
    Truth {
        name: "ur10-random-b",
        stations: 700,
        unmeasured: &[5, 6, 7, 40, 333],
        offset_s: -4.131,
        drift_ppm: -25.0,
    },
    Truth {
        name: "ur10-joint",
        stations: 1495,
        unmeasured: &[],
        offset_s: -0.2519,
        drift_ppm: 12.0,
    },
];

#[derive(Debug)]
struct Row {
    joints: [f64; 6],
    position_mm: [f64; 3],
    command_mm: [f64; 3],
}

fn rows(folder: &std::path::Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(folder.join("stations.csv")).expect("stations.csv");
    let row = |record: csv::StringRecord| {
        let number = |column: usize| record[column].parse::<f64>().expect("a number");
        Row {
            joints: std::array::from_fn(|i| number(1 + i)),
            position_mm: std::array::from_fn(|i| number(7 + i)),
            command_mm: std::array::from_fn(|i| number(14 + i)),
        }
    };
    reader
        .records()
        .map(|record| row(record.expect("a row")))
        .collect()
}

#[test]
fn every_station_of_the_real_recordings_is_paired_with_its_own_readings() {
    for truth in SESSIONS {
        let Some(folder) = common::folder(truth.name) else {
            continue;
        };
        let recording = common::recording(&folder);
        let joined = join(&recording, &common::ur10(), &JoinSettings::default()).expect(truth.name);
        check_clock(&truth, &joined);
        check_stations(&truth, &joined, &rows(&folder));
        let counted = joined.counts.kept
            + joined.counts.settling
            + joined.counts.outlier
            + joined.counts.moving
            + joined.counts.unpaired
            + joined.counts.missing;
        assert_eq!(counted, recording.readings.stamps.len() as u64);
        let rejected: u64 = joined.rejects.iter().map(|reject| reject.readings).sum();
        assert_eq!(rejected + joined.counts.kept, counted);
    }
}

fn check_clock(truth: &Truth, joined: &Joined) {
    let offset_s = joined.clock.model.offset_ns / NS_PER_S;
    let drift_ppm = joined.clock.model.drift * 1e6;
    assert!(
        (offset_s - truth.offset_s).abs() < 0.010,
        "{}: offset {offset_s} s",
        truth.name
    );
    assert!(
        (drift_ppm - truth.drift_ppm).abs() < 3.0,
        "{}: drift {drift_ppm} ppm",
        truth.name
    );
}

fn check_stations(truth: &Truth, joined: &Joined, rows: &[Row]) {
    assert_eq!(joined.stations.len(), truth.stations, "{}", truth.name);
    let mut beyond = 0;
    for (station, row) in joined.stations.iter().zip(rows) {
        for (angle, truth) in station.joints.iter().zip(row.joints) {
            assert!((angle - truth).abs() < 1e-6, "station {}", station.number);
        }
        let command = station
            .command
            .as_ref()
            .expect("a command a station")
            .position;
        assert!(
            (0..3).all(|i| (command[i] - row.command_mm[i]).abs() < 1e-3),
            "station {}",
            station.number
        );
        let Some(attained) = &station.attained else {
            assert!(
                truth.unmeasured.contains(&station.number),
                "{} {}",
                station.number,
                truth.name
            );
            assert!(matches!(station.pairing, Pairing::Unmeasured(_)));
            continue;
        };
        assert_eq!(station.pairing, Pairing::Paired);
        assert!(!truth.unmeasured.contains(&station.number));
        let left_out = 1.0 / attained.kept as f64 - 1.0 / attained.readings as f64;
        for axis in 0..3 {
            let off = (attained.position[axis] - row.position_mm[axis]).abs();
            let allowed = (3.0 * attained.scatter_mm[axis] * left_out.sqrt()).max(0.01);
            beyond += usize::from(off > allowed);
        }
    }
    assert_eq!(beyond, 0, "{}", truth.name);
}

/// A tracker that started late or stopped early: grids and joint sequences repeat themselves, and a shift by a row leaves
/// most stations within a millimetre. The whole of what was seen decides, or nothing does.
#[test]
fn part_of_a_tracker_log_finds_the_same_clock() {
    for truth in [&SESSIONS[0], &SESSIONS[1], &SESSIONS[3]] {
        let Some(folder) = common::folder(truth.name) else {
            continue;
        };
        let whole = common::recording(&folder);
        let tenths = whole.readings.stamps.len() / 10;
        for (first, end) in [(0, 8), (2, 10), (3, 5)] {
            let mut part = whole.clone();
            let range = first * tenths..end * tenths;
            part.readings.stamps = whole.readings.stamps[range.clone()].to_vec();
            part.readings.positions = whole.readings.positions[range].to_vec();
            part.readings.orientations = None;
            let joined = join(&part, &common::ur10(), &JoinSettings::default()).expect(truth.name);
            let offset_s = joined.clock.model.offset_ns / NS_PER_S;
            // Fewer edges, all sampled in step: a dwell's length is what must not be mistaken.
            assert!(
                (offset_s - truth.offset_s).abs() < 0.05,
                "{}: {offset_s} s",
                truth.name
            );
        }
    }
}
