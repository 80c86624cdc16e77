//! The join on the real recordings, against the measured values that their logs were made from.

use crate::common;
mod simple;

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
    Truth { name: "ur10-grid", stations: 615, unmeasured: &[], offset_s: 0.0, drift_ppm: 0.0 },
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

fn rows(session: &str) -> Vec<Row> {
    let path =
        common::recording(&format!("{session}/stations.csv")).expect("it stands beside the logs");
    let mut reader = csv::Reader::from_path(path).expect("stations.csv");
    let row = |record: csv::StringRecord| {
        let number = |column: usize| record[column].parse::<f64>().expect("a number");
        Row {
            joints: std::array::from_fn(|i| number(1 + i)),
            position_mm: std::array::from_fn(|i| number(7 + i)),
            command_mm: std::array::from_fn(|i| number(14 + i)),
        }
    };
    reader.records().map(|record| row(record.expect("a row"))).collect()
}

#[test]
fn every_station_of_the_real_recordings_is_paired_with_its_own_readings() {
    for truth in SESSIONS {
        let arm = common::arm("ur10");
        let Some(read) = common::session(truth.name, &arm) else {
            continue;
        };
        let begun = std::time::Instant::now();
        let joined = join(&read.input, &arm, &JoinSettings::default()).expect(truth.name);
        eprintln!("{}: {:?} {:?} {:?}", truth.name, begun.elapsed(), joined.found, joined.counts);
        check_clock(&truth, &joined);
        check_stations(&truth, &joined, &rows(truth.name));
        let counted = joined.counts.kept
            + joined.counts.settling
            + joined.counts.outlier
            + joined.counts.moving
            + joined.counts.unpaired
            + joined.counts.missing;
        assert_eq!(counted, read.input.readings.count() as u64);
        let rejected: u64 = joined.rejects.iter().map(|reject| reject.readings).sum();
        assert_eq!(rejected + joined.counts.kept, counted);
    }
}

#[test]
fn stations_clocks_and_rejects_are_those_of_a_simple_reader_to_the_last_bit() {
    for truth in SESSIONS {
        let arm = common::arm("ur10");
        let (Some(read), Some(logs)) =
            (common::session(truth.name, &arm), common::logs(truth.name))
        else {
            continue;
        };
        assert_eq!(read.rejects, []);
        let settings = JoinSettings::default();
        let simple = simple::input(&logs, &common::mapping(&arm), &settings.arm_rule());
        assert_eq!(read.input.joints, simple.joints);
        let kept = ["joints", "commands", "readings", "temperatures"]
            .map(|stream| read.counts[&format!("{stream}.kept")]);
        let counts = [
            simple.joints.samples,
            simple.commands.count(),
            simple.readings.count(),
            simple.temperatures.stamps.len(),
        ];
        assert_eq!(kept, counts.map(|count| count as u64));
        let found = join(&read.input, &arm, &settings).expect(truth.name);
        let expected = join(&simple, &arm, &settings).expect(truth.name);
        assert_eq!(found.stations.len(), truth.stations);
        assert!(found.stations == expected.stations, "{}", truth.name);
        assert!(found.rejects == expected.rejects, "{}", truth.name);
        assert_eq!(found.clock, expected.clock);
        assert_eq!(found.found, expected.found);
        assert_eq!(found.counts, expected.counts);
    }
}

fn check_clock(truth: &Truth, joined: &Joined) {
    let offset_s = joined.clock.model.offset_ns / NS_PER_S;
    let drift_ppm = joined.clock.model.drift * 1e6;
    eprintln!(
        "   offset off by {:.2} ms, drift by {:.3} ppm",
        (offset_s - truth.offset_s) * 1e3,
        drift_ppm - truth.drift_ppm
    );
    assert!((offset_s - truth.offset_s).abs() < 0.010, "{}: offset {offset_s} s", truth.name);
    assert!((drift_ppm - truth.drift_ppm).abs() < 3.0, "{}: drift {drift_ppm} ppm", truth.name);
}

fn check_stations(truth: &Truth, joined: &Joined, rows: &[Row]) {
    assert_eq!(joined.stations.len(), truth.stations, "{}", truth.name);
    let mut worst = (0.0_f64, 0.0_f64, 0);
    for (station, row) in joined.stations.iter().zip(rows) {
        for (angle, truth) in station.joints.iter().zip(row.joints) {
            assert!((angle - truth).abs() < 1e-6, "station {}", station.number);
        }
        let command = station.command.as_ref().expect("a command a station").position;
        assert!(
            (0..3).all(|i| (command[i] - row.command_mm[i]).abs() < 1e-3),
            "station {}",
            station.number
        );
        let Some(reading) = station.one_reading() else {
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
        let point = reading.value.point().expect("the tracker reads positions");
        let left_out = 1.0 / reading.kept as f64 - 1.0 / reading.taken as f64;
        for axis in 0..3 {
            let off = (point.position[axis] - row.position_mm[axis]).abs();
            let allowed = (3.0 * point.scatter_mm[axis] * left_out.sqrt()).max(0.01);
            worst = (
                worst.0.max(off),
                worst.1.max(off / allowed),
                worst.2 + usize::from(off > allowed),
            );
        }
    }
    eprintln!(
        "   worst mean {:.4} mm, {:.2} of what is allowed, {} beyond",
        worst.0, worst.1, worst.2
    );
    assert_eq!(worst.2, 0, "{}", truth.name);
}
