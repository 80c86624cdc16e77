use nalgebra::Point3;

use super::*;
use crate::geometry::isometry_from_rpy;
use crate::join::{MeanLength, MeanPoint};
use crate::kinematics::RobotFile;

fn arm() -> Arm {
    let file: RobotFile =
        toml::from_str(include_str!("../../../../pipelines/robots/ur10.toml")).unwrap();
    file.arm().unwrap()
}

/// Forty rows of the nominal arm, its target 90 mm before the flange.
fn rows(arm: &Arm) -> Vec<Row> {
    let tracker_from_base = isometry_from_rpy([2000.0, -500.0, 300.0], [0.1, -0.2, 2.0]);
    let row = |k: u64| {
        let t = k as f64;
        let joints: Vec<f64> = (0..6).map(|j| (0.9 * t + f64::from(j)).sin()).collect();
        let place =
            tracker_from_base * (arm.flange(&joints).isometry() * Point3::new(0.0, 10.0, 90.0));
        Row {
            line: k + 2,
            joints,
            command: None,
            time_ns: None,
            temperature_c: Some(20.0),
            readings: vec![reading(place, k + 2)],
            references: Vec::new(),
        }
    };
    (0..40).map(row).collect()
}

fn reading(position: Point3<f64>, line: u64) -> RowReading {
    let point = MeanPoint {
        position,
        scatter_mm: [0.0; 3],
        stated_covariance: None,
        motion_covariance: None,
    };
    RowReading {
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        line,
        value: Value::Point(point),
        samples: 1,
    }
}

fn joined(arm: &Arm, rows: Vec<Row>) -> Joined {
    let rows = Rows {
        file: "measured.csv".to_owned(),
        rows,
        apart: Vec::new(),
        references: Vec::new(),
        rejects: Vec::new(),
    };
    tabled(rows, arm, &JoinSettings::default())
}

#[test]
fn every_row_is_a_station_or_is_left_out_with_its_line() {
    let arm = arm();
    let mut rows = rows(&arm);
    // A wrong reflector, a row whose reading was missing, and a row twice.
    rows[7].readings[0] = reading(Point3::new(0.0, 0.0, 5000.0), 9);
    rows[11].readings.clear();
    let copy = Row { line: 42, ..rows[3].clone() };
    rows.push(copy);
    let joined = joined(&arm, rows);
    assert_eq!(joined.stations.len(), 40);
    assert_eq!((joined.counts.kept, joined.counts.unpaired, joined.counts.missing), (38, 1, 1));
    assert_eq!(joined.stations[7].pairing, Pairing::Unmeasured(Unmeasured::WrongTarget));
    assert_eq!(joined.stations[11].pairing, Pairing::Unmeasured(Unmeasured::NoReadings));
    let told: Vec<(u64, Option<usize>, &str)> =
        joined.row_rejects.iter().map(|own| (own.line, own.station, own.reason.as_str())).collect();
    assert_eq!((told[0].0, told[0].1), (9, Some(7)));
    assert!(told[0].2.contains("mm from the nominal arm"), "{}", told[0].2);
    assert_eq!((told[1].0, told[1].1), (42, None));
    assert!(told[1].2.contains("a copy of line 5"), "{}", told[1].2);
}

#[test]
fn rows_with_times_are_in_their_order_and_others_in_the_tables() {
    let arm = arm();
    let mut rows = rows(&arm);
    assert_eq!(joined(&arm, rows.clone()).stations[5].start.ns(), 5_000_000_000);
    for (place, row) in rows.iter_mut().enumerate() {
        row.time_ns =
            Some(1_600_000_000_000_000_000 - 60_000_000_000 * i64::try_from(place).unwrap());
    }
    let timed = joined(&arm, rows.clone());
    assert_eq!(timed.stations[0].joints, rows[39].joints);
    assert_eq!(timed.clock.model.origin.ns(), rows[39].time_ns.unwrap());
    // One row without a time, and the order of the table holds.
    rows[4].time_ns = None;
    assert_eq!(joined(&arm, rows.clone()).stations[0].joints, rows[0].joints);
}

#[test]
fn few_readings_of_a_target_are_not_judged_by_their_place() {
    let arm = arm();
    let mut rows = rows(&arm);
    rows.truncate(4);
    rows[1].readings[0] = reading(Point3::new(0.0, 0.0, 5000.0), 3);
    assert_eq!(joined(&arm, rows).counts.kept, 4);
}

#[test]
fn a_bump_of_the_instrument_takes_no_lengths_out() {
    let arm = arm();
    let length = Value::Distance(MeanLength { mm: 812.5, sd_mm: 0.01 });
    let mut rows = rows(&arm);
    for row in &mut rows {
        row.readings.push(RowReading { source: SourceId(1), value: length, ..row.readings[0] });
    }
    let left_out = BTreeMap::from([(5, "the instrument was bumped".to_owned())]);
    let rejects = take_out(&mut rows, &left_out);
    assert_eq!(rejects.len(), 1);
    assert_eq!((rejects[0].station, rejects[0].line), (Some(5), rows[5].line));
    assert_eq!(rows[5].readings.len(), 1);
    assert_eq!(rows[5].readings[0].value, length);
}
