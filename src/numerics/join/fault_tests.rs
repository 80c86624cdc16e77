//! Faults of recordings: one test each, on synthetic sessions with known truth.

use nalgebra::Point3;

use super::scene::{Scene, check_conservation, join_recorded, paired, ur10};
use super::*;
use crate::ingest::{JointSamples, Recording, TargetReadings};

#[test]
fn equal_dwells_pair_at_any_offset_and_drift() {
    // Hours, years, either sign, and the largest drift an oscillator has.
    for (offset_s, drift) in
        [(0.0, 0.0), (-4.131, -100e-6), (3.6e4, 100e-6), (-1.6e9, 25e-6), (4.0e8, -60e-6)]
    {
        let scene = Scene { offset_s, drift, ..Scene::random(60, 1) };
        let joined = scene.joined(&scene.record(&ur10()));
        assert_eq!((joined.stations.len(), paired(&joined)), (60, 60));
        // Edges are sampled in step: 20 ms and 50 ms intervals leave up to half of the larger one.
        scene.check_clock(&joined, 25.0, 30.0);
    }
}

#[test]
fn a_tracker_that_started_late_and_stopped_early_leaves_dwells_outside_its_log() {
    let scene = Scene::random(60, 2);
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    scene.keep_readings(&mut recording, |at_s| {
        at_s > starts_s[10] - 0.4 && at_s < starts_s[50] - 0.4
    });
    let joined = scene.joined(&recording);
    for (number, station) in joined.stations.iter().enumerate() {
        let expected = if (10..50).contains(&number) {
            Pairing::Paired
        } else {
            Pairing::Unmeasured(Unmeasured::OutsideTrackerLog)
        };
        assert_eq!(station.pairing, expected, "station {number}");
    }
}

#[test]
fn a_lost_beam_leaves_stations_without_readings() {
    let scene = Scene::random(80, 3);
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    let lost = |at_s: f64| (5..25).any(|k| (starts_s[k] - 0.4..starts_s[k] + 1.4).contains(&at_s));
    scene.keep_readings(&mut recording, |at_s| !lost(at_s));
    let joined = scene.joined(&recording);
    assert_eq!(paired(&joined), 60);
    assert_eq!(joined.stations[7].pairing, Pairing::Unmeasured(Unmeasured::NoReadings));
}

#[test]
fn zeros_are_missing_and_a_wrong_reflector_is_refused() {
    let scene = Scene::random(50, 4);
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    for (index, stamp) in recording.readings.stamps.iter().enumerate() {
        let at_s = scene.controller_s(stamp.ns());
        let position = &mut recording.readings.positions[index];
        if (starts_s[20] - 0.2..starts_s[20] + 1.2).contains(&at_s) {
            *position = [0.0; 3];
        }
        for wrong in [3, 30, 31, 32, 40] {
            if (starts_s[wrong]..=starts_s[wrong] + 1.0).contains(&at_s) {
                position[1] += 260.0;
            }
        }
    }
    let joined = scene.joined(&recording);
    assert_eq!(joined.counts.missing, 28); // 1.4 s at 20 Hz
    assert_eq!(joined.stations[20].pairing, Pairing::Unmeasured(Unmeasured::NoReadings));
    for wrong in [3, 30, 31, 32, 40] {
        assert_eq!(joined.stations[wrong].pairing, Pairing::Unmeasured(Unmeasured::WrongTarget));
    }
    assert_eq!(paired(&joined), 44);
    assert!(joined.rejects.iter().any(|reject| reject.reason.contains("another reflector")));
}

#[test]
fn readings_taken_only_while_stationary_pair_without_any_edge() {
    let scene = Scene::random(60, 5);
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    // Six readings in the middle of each dwell.
    scene.keep_readings(&mut recording, |at_s| {
        starts_s.iter().any(|start| (start + 0.4..start + 0.7).contains(&at_s))
    });
    let joined = scene.joined(&recording);
    assert!(paired(&joined) >= 59, "{}", paired(&joined)); // the first dwell is longer than the others
}

#[test]
fn other_rates_and_noise_change_nothing() {
    for (arm_hz, tracker_hz, noise_mm, noise_rad, quantum_rad, dwell_s) in [
        (10.0, 10.0, 0.005, 0.0, 0.0, 2.0),
        (500.0, 1000.0, 0.02, 1e-6, 0.0, 1.0),
        (125.0, 100.0, 0.2, 1e-5, 0.0, 1.0),
        (250.0, 2.0, 0.01, 0.0, 1.75e-5, 5.0),
        (50.0, 1.0, 0.02, 3e-5, 1.75e-4, 6.0),
    ] {
        let scene = Scene {
            arm_hz,
            tracker_hz,
            noise_mm,
            noise_rad,
            quantum_rad,
            dwell_s: vec![dwell_s; 30],
            ..Scene::random(30, 6)
        };
        let joined = scene.joined(&scene.record(&ur10()));
        assert_eq!(joined.stations.len(), 30, "{arm_hz} Hz");
        assert_eq!(paired(&joined), 30, "{arm_hz} and {tracker_hz} Hz, {noise_mm} mm");
    }
}

#[test]
fn dwells_of_many_lengths_and_a_far_target_pair() {
    let mut scene = Scene::random(50, 7);
    scene.dwell_s = (0..50).map(|k| 0.8 + f64::from((k * 7) % 5)).collect();
    scene.target_mm = [250.0, 150.0, 180.0];
    let joined = scene.joined(&scene.record(&ur10()));
    assert_eq!(paired(&joined), 50);
}

#[test]
fn extra_target_dwells_belong_to_no_station() {
    // The tracker ran on while the controller's log had ended.
    let scene = Scene::random(70, 8);
    let mut recording = scene.record(&ur10());
    let cut = recording.joints.stamps.len() * 4 / 7;
    recording.joints.stamps.truncate(cut);
    let kept: Vec<usize> = (0..cut).collect();
    recording.joints.angles = recording.joints.angles.picked(&kept);
    let joined = scene.joined(&recording);
    assert!((39..=41).contains(&joined.stations.len()));
    assert!(paired(&joined) >= 39);
    assert!(joined.counts.unpaired > 500); // 30 dwells of 20 readings
}

#[test]
fn single_bad_readings_and_a_creeping_joint_do_no_harm() {
    let scene = Scene { noise_rad: 2e-7, ..Scene::random(50, 9) };
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    for start_s in &starts_s {
        let spike_s = start_s + 0.6;
        let near =
            recording.readings.stamps.partition_point(|s| scene.controller_s(s.ns()) < spike_s);
        recording.readings.positions[near][2] += 0.7;
    }
    let JointSamples { stamps, angles } = &mut recording.joints;
    for (row, stamp) in stamps.iter().enumerate() {
        angles.row_mut(row)[1] += 1e-6 * (stamp.ns() - scene.origin_ns) as f64 / NS_PER_S; // a µrad/s
    }
    let joined = scene.joined(&recording);
    assert_eq!((paired(&joined), joined.counts.outlier), (50, 50));
}

#[test]
fn a_periodic_session_is_ambiguous() {
    // The same three poses over and over, and a tracker that saw only the middle: any multiple of three fits.
    let mut scene = Scene::random(60, 10);
    for k in 0..60 {
        scene.poses[k] = scene.poses[k % 6];
    }
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    scene.keep_readings(&mut recording, |at_s| {
        at_s > starts_s[18] - 0.4 && at_s < starts_s[42] - 0.4
    });
    let error =
        join_recorded(&recording, &ur10(), &JoinSettings::default()).expect_err("ambiguous");
    assert!(matches!(error, JoinError::AmbiguousShift { .. }), "{error}");
}

#[test]
fn logs_of_two_sessions_are_refused() {
    let mut recording = Scene::random(40, 11).record(&ur10());
    recording.readings = Scene::random(40, 12).record(&ur10()).readings;
    let error =
        join_recorded(&recording, &ur10(), &JoinSettings::default()).expect_err("strangers");
    assert!(matches!(error, JoinError::NoCommonPattern { .. }), "{error}");
}

#[test]
fn commands_are_found_whenever_they_are_stamped() {
    let scene = Scene::random(40, 13);
    let arm = ur10();
    // On sending (0.1 s before the move), during the move, on arrival, while measuring.
    for before_start_s in [0.9, 0.4, 0.0, -0.6] {
        let mut recording = scene.record(&arm);
        for (pose, start_s) in scene.poses.iter().zip(scene.starts_s()).skip(1) {
            let tool = *arm.flange(pose).isometry() * Point3::new(0.0, 0.0, 109.0);
            let at_ns =
                scene.origin_ns + crate::units::round_ns((start_s - before_start_s) * NS_PER_S);
            recording.commands.stamps.push(Stamp::from_ns(at_ns));
            recording.commands.positions.push(tool.coords.into());
        }
        // Station 20's own command is missing.
        recording.commands.stamps.remove(19);
        recording.commands.positions.remove(19);
        let joined = scene.joined(&recording);
        for station in &joined.stations {
            let tool =
                *arm.flange(&scene.poses[station.number]).isometry() * Point3::new(0.0, 0.0, 109.0);
            match &station.command {
                Some(command) => {
                    assert!((command.position - tool).norm() < 0.1, "{}", station.number);
                }
                None => assert!([0, 20].contains(&station.number), "{}", station.number),
            }
        }
    }
}

#[test]
fn bad_input_is_an_error_that_names_it() {
    let arm = ur10();
    let scene = Scene::random(20, 14);
    let good = scene.record(&arm);
    let fails = |recording: &Recording, settings: &JoinSettings, says: &str| {
        let error = join_recorded(recording, &arm, settings).expect_err(says).to_string();
        assert!(error.contains(says), "{error:?} does not say {says:?}");
    };
    let defaults = JoinSettings::default();
    fails(&Recording::default(), &defaults, "0 joint columns");
    let mut bad = good.clone();
    bad.joints.angles.row_mut(7)[3] = f64::NAN;
    fails(&bad, &defaults, "wrist_1_joint");
    let mut bad = good.clone();
    bad.readings.positions.iter_mut().for_each(|position| *position = [0.0; 3]);
    fails(&bad, &defaults, "tracker log: 0 dwells in 0 samples");
    for within_ns in [0, 1000] {
        let mut bad = good.clone();
        let coarse = |ns: i64| {
            ns.div_euclid(1_000_000_000) * 1_000_000_000
                + ns.rem_euclid(1_000_000_000) * within_ns / 1_000_000_000
        };
        bad.readings
            .stamps
            .iter_mut()
            .for_each(|stamp| *stamp = Stamp::from_ns(coarse(stamp.ns())));
        fails(&bad, &defaults, "write time = \"log\"");
    }
    let mut bad = good.clone();
    bad.readings.stamps.swap(3, 4);
    fails(&bad, &defaults, "decrease at row 4");
    let mut bad = good.clone();
    bad.readings.positions.iter_mut().flatten().for_each(|x| *x /= 1000.0);
    fails(&bad, &defaults, "positions in mm");
    let mut bad = good.clone();
    bad.readings.positions[30] = [f64::NAN, 0.0, 0.0];
    bad.readings.positions[31] = [f64::INFINITY, 1e300, 0.0];
    assert_eq!(scene.joined(&bad).counts.missing, 2);
    check_conservation(&good, &join_recorded(&good, &arm, &defaults).expect("good"));
}

#[test]
fn a_grid_that_lost_whole_layers_still_finds_its_shift() {
    // A serpentine grid repeats itself row by row and layer by layer: only the whole grid determines the shift.
    let arm = ur10();
    let mut scene = grid([6, 5, 4]);
    scene.offset_s = -77.7;
    let mut recording = scene.record(&arm);
    let starts_s = scene.starts_s();
    scene.keep_readings(&mut recording, |at_s| {
        at_s < starts_s[40] - 0.4 || at_s > starts_s[70] - 0.4
    });
    let joined = scene.joined(&recording);
    assert_eq!((joined.stations.len(), paired(&joined)), (120, 90));
}

#[test]
fn a_grid_of_which_only_inner_layers_were_seen_is_never_paired_wrongly() {
    let arm = ur10();
    let scene = grid([6, 5, 4]);
    let mut recording = scene.record(&arm);
    let starts_s = scene.starts_s();
    scene.keep_readings(&mut recording, |at_s| {
        at_s > starts_s[30] - 0.4 && at_s < starts_s[90] - 0.4
    });
    // Either the right shift (`joined` checks every mean) or a clear refusal.
    match join_recorded(&recording, &arm, &JoinSettings::default()) {
        Ok(_) => assert_eq!(paired(&scene.joined(&recording)), 60),
        Err(error) => assert!(matches!(error, JoinError::AmbiguousShift { .. }), "{error}"),
    }
}

/// A serpentine grid in joint space, 8° apart: moves of equal length over and over.
fn grid([nx, ny, nz]: [usize; 3]) -> Scene {
    let mut scene = Scene::random(nx * ny * nz, 21);
    for (station, pose) in scene.poses.iter_mut().enumerate() {
        let (layer, in_layer) = (station / (nx * ny), station % (nx * ny));
        let (row, along) = (in_layer / nx, in_layer % nx);
        let along = if row % 2 == 0 { along } else { nx - 1 - along };
        *pose = [
            -0.4 + 0.14 * along as f64,
            -1.8 + 0.14 * row as f64,
            1.2 + 0.14 * layer as f64,
            -1.0,
            0.9,
            0.2,
        ];
    }
    scene
}

#[test]
fn tiny_moves_and_repeated_stations_keep_their_own_means() {
    let mut scene = Scene::random(60, 22);
    for k in (3..60).step_by(5) {
        scene.poses[k] = scene.poses[k - 1];
        scene.poses[k][0] += 2e-3; // 1–2 mm at the target
    }
    scene.poses[40] = scene.poses[10]; // visited again
    let joined = scene.joined(&scene.record(&ur10()));
    assert_eq!((joined.stations.len(), paired(&joined)), (60, 60));
}

#[test]
fn a_station_commanded_twice_in_place_is_one_dwell() {
    let mut scene = Scene::random(40, 23);
    scene.poses[20] = scene.poses[19];
    let joined = scene.joined(&scene.record(&ur10()));
    assert_eq!((joined.stations.len(), paired(&joined)), (39, 39));
}

#[test]
fn joints_frozen_before_the_drives_are_on_and_dropped_messages_do_no_harm() {
    let scene = Scene { noise_rad: 1e-5, ..Scene::random(50, 24) };
    let mut recording = scene.record(&ur10());
    let frozen = recording.joints.angles.row(0).to_vec();
    for row in 0..60 {
        recording.joints.angles.row_mut(row).copy_from_slice(&frozen);
    }
    // Every seventh joint sample and every ninth reading never arrived.
    let joints = &mut recording.joints;
    let dropped = |index: usize| index > 100 && index.is_multiple_of(7);
    let kept = 0..joints.stamps.len();
    let kept: Vec<usize> = kept.filter(|&index| !dropped(index)).collect();
    joints.angles = joints.angles.picked(&kept);
    joints.stamps = kept.iter().map(|&index| joints.stamps[index]).collect();
    let mut reading = 0;
    scene.keep_readings(&mut recording, |_| true);
    let readings = &mut recording.readings;
    readings.stamps.retain(|_| {
        reading += 1;
        reading % 9 != 0
    });
    let mut reading = 0;
    readings.positions.retain(|_| {
        reading += 1;
        reading % 9 != 0
    });
    let joined = scene.joined(&recording);
    assert_eq!((joined.stations.len(), paired(&joined)), (50, 50));
}

/// The readings of a recording of the scene: when each was taken on the controller's clock, s, and its position, mm.
fn readings<'r>(
    scene: &'r Scene,
    recording: &'r mut Recording,
) -> impl Iterator<Item = (f64, &'r mut [f64; 3])> {
    let TargetReadings { stamps, positions, .. } = &mut recording.readings;
    let at_s = stamps.iter().map(|stamp| scene.controller_s(stamp.ns()));
    at_s.zip(positions)
}

#[test]
fn readings_of_a_vibrating_target_are_left_out_until_it_settles() {
    let scene = Scene { tracker_hz: 100.0, noise_mm: 0.005, ..Scene::random(40, 25) };
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    for (at_s, position) in readings(&scene, &mut recording) {
        let here = starts_s.partition_point(|&start| start <= at_s).saturating_sub(1);
        let age_s = at_s - starts_s[here];
        if here > 0 && age_s < 1.0 {
            // 0.2 mm at 12 Hz, with a decay time of 60 ms: down to the noise after 60 ms · ln(0.2/0.005) = 0.22 s.
            position[2] += 0.2 * (-age_s / 0.06).exp() * (75.0 * age_s).cos();
        }
    }
    let joined = scene.joined(&recording);
    assert_eq!(paired(&joined), 40);
    assert!((0.12..0.35).contains(&joined.found.settle_s), "{}", joined.found.settle_s);
}

#[test]
fn a_target_that_moves_while_the_arm_is_stationary_is_reported() {
    let scene = Scene { dwell_s: vec![2.0; 40], ..Scene::random(40, 26) };
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    for (at_s, position) in readings(&scene, &mut recording) {
        let age_s = at_s - starts_s[15];
        if (0.0..2.0).contains(&age_s) {
            position[0] += 40.0 * age_s; // sliding all the time
        }
        let age_s = at_s - starts_s[25];
        if (0.0..1.0).contains(&age_s) {
            position[0] += 9.0; // knocked once
        }
    }
    let joined = scene.joined(&recording);
    assert_eq!(joined.stations[15].pairing, Pairing::Unmeasured(Unmeasured::TargetMoved));
    assert_eq!(joined.stations[25].pairing, Pairing::Ambiguous);
    assert_eq!(paired(&joined), 38);
}

#[test]
fn few_stations_are_enough_and_fewer_are_refused() {
    let scene = Scene::random(8, 27);
    let joined = scene.joined(&scene.record(&ur10()));
    assert_eq!(paired(&joined), 8);
    let scene = Scene::random(5, 28);
    let error =
        join_recorded(&scene.record(&ur10()), &ur10(), &JoinSettings::default()).expect_err("5");
    assert!(matches!(error, JoinError::TooFewDwells { found: 5, needed: 6, .. }), "{error}");
}

#[test]
fn many_sessions_of_any_seed_pair_wholly() {
    for seed in 100..130_usize {
        let mut scene = Scene::random(40, seed as u64);
        scene.noise_mm = [0.005, 0.02, 0.1][seed % 3];
        scene.move_s = [0.5, 0.8, 1.7, 4.0][seed % 4];
        let joined = scene.joined(&scene.record(&ur10()));
        assert_eq!((joined.stations.len(), paired(&joined)), (40, 40), "seed {seed}");
    }
}

#[test]
fn a_bad_arm_a_far_target_lost_beams_and_wrong_reflectors_at_once() {
    for seed in 200..212_usize {
        let mut scene = Scene::random(80, seed as u64);
        scene.arm_error = 8.0; // 8 mrad a joint: up to 20 mm at the target
        scene.target_mm = [200.0, -250.0, 150.0];
        scene.noise_mm = 0.05;
        let mut recording = scene.record(&ur10());
        let starts_s = scene.starts_s();
        let station =
            |at_s: f64| starts_s.partition_point(|&start| start - 0.4 <= at_s).saturating_sub(1);
        for (at_s, position) in readings(&scene, &mut recording) {
            if (station(at_s) + seed) % 7 == 3 {
                position[0] -= 340.0;
            }
        }
        scene.keep_readings(&mut recording, |at_s| (station(at_s) + seed) % 5 != 1);
        let joined = scene.joined(&recording);
        let expected = (0..80).filter(|k| (k + seed) % 5 != 1 && (k + seed) % 7 != 3).count();
        assert_eq!((joined.stations.len(), paired(&joined)), (80, expected), "seed {seed}");
    }
}

#[test]
fn readings_that_repeat_the_last_one_while_the_arm_moves_are_lost() {
    let scene = Scene::random(50, 71);
    let mut recording = scene.record(&ur10());
    let starts_s = scene.starts_s();
    // The beam is lost in dwell 10 and back in dwell 12; the readings in the middle of dwell 30 are equal.
    for (from_s, until_s) in
        [(starts_s[10] + 0.5, starts_s[12] + 0.5), (starts_s[30] + 0.3, starts_s[30] + 0.7)]
    {
        let mut last = None;
        for (stamp, position) in
            recording.readings.stamps.iter().zip(&mut recording.readings.positions)
        {
            if (from_s..until_s).contains(&scene.controller_s(stamp.ns())) {
                *position = *last.get_or_insert(*position);
            }
        }
    }
    let joined = scene.joined(&recording);
    assert_eq!(joined.stations[11].pairing, Pairing::Unmeasured(Unmeasured::NoReadings));
    assert_eq!(paired(&joined), 49);
    let repeated = joined.rejects.iter().filter(|own| own.reason == REPEATED);
    // 3.6 s at 20 Hz without the first of them.
    let readings = repeated.map(|own| own.readings).sum::<u64>();
    assert!((70..=72).contains(&readings), "{readings}");
}

#[test]
fn a_clock_that_jumps_on_is_found_and_taken_out() {
    for (by_s, from) in [(1, 30), (20, 47), (-37, 30)] {
        let scene = Scene::random(60, 72);
        let mut recording = scene.record(&ur10());
        let from_s = scene.starts_s()[from] - 0.4;
        let by_ns = 1_000_000_000 * i64::from(by_s);
        // The tracker's clock, or the controller's.
        for stamp in recording.readings.stamps.iter_mut().filter(|_| by_s > 0) {
            let is_behind = scene.controller_s(stamp.ns()) > from_s;
            *stamp = stamp.plus_ns(if is_behind { by_ns } else { 0 });
        }
        for stamp in recording.joints.stamps.iter_mut().filter(|_| by_s < 0) {
            let is_behind = (stamp.ns() - scene.origin_ns) as f64 / 1e9 > from_s;
            *stamp = stamp.plus_ns(if is_behind { -by_ns } else { 0 });
        }
        let joined = join_recorded(&recording, &ur10(), &JoinSettings::default());
        let joined = joined.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(paired(&joined), 60, "{by_s} s");
        let own = recording.joints.stamps.iter().position(|own| *own == joined.stations[59].end);
        assert!(own.is_some(), "a station has the stamps of its log");
        let [step] = &joined.clock.steps[..] else { panic!("{:?}", joined.clock.steps) };
        assert_eq!(step.station, from);
        assert!((step.by_s - f64::from(by_s)).abs() < 0.03, "{step:?}");
    }
    let scene = Scene::random(60, 72);
    assert!(scene.joined(&scene.record(&ur10())).clock.steps.is_empty());
    // Shorter than the dwells: they are all paired.
    let mut recording = scene.record(&ur10());
    let from_s = scene.starts_s()[25] - 0.4;
    for stamp in &mut recording.readings.stamps {
        let is_behind = scene.controller_s(stamp.ns()) > from_s;
        *stamp = stamp.plus_ns(if is_behind { 400_000_000 } else { 0 });
    }
    let joined = scene.joined(&recording);
    let [step] = &joined.clock.steps[..] else { panic!("{:?}", joined.clock.steps) };
    assert!(step.station == 25 && (step.by_s - 0.4).abs() < 0.03, "{step:?}");
}

#[test]
fn a_step_of_a_clock_behind_a_knock_is_found() {
    let scene = Scene::random(120, 73);
    let mut recording = scene.record(&ur10());
    let [knock_s, step_s] = [40, 80].map(|station| scene.starts_s()[station] - 0.4);
    let TargetReadings { stamps, positions, .. } = &mut recording.readings;
    for (stamp, position) in stamps.iter_mut().zip(positions) {
        let at_s = scene.controller_s(stamp.ns());
        position[0] += if at_s > knock_s { 12.0 } else { 0.0 };
        *stamp = stamp.plus_ns(if at_s > step_s { 1_000_000_000 } else { 0 });
    }
    let joined = join_recorded(&recording, &ur10(), &JoinSettings::default());
    let joined = joined.unwrap_or_else(|error| panic!("{error}"));
    let [step] = &joined.clock.steps[..] else { panic!("{:?}", joined.clock.steps) };
    assert!(step.station == 80 && (step.by_s - 1.0).abs() < 0.03, "{step:?}");
    assert_eq!(paired(&joined), 120);
}
