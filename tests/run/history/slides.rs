//! An arm on a track, each session over another range of the track: a change of the track's error curve is found with its size, and
//! nothing where it did not change.

use nalgebra::UnitQuaternion;
use posegrid::fit::{self, Observation};
use posegrid::geometry::isometry_from_rpy;
use posegrid::history::estimate::Column;
use posegrid::history::hypotheses::{Finding, Hypothesis};
use posegrid::history::{Judged, SessionHistory};
use posegrid::kinematics::{Arm, RobotFile};
use posegrid::simulate::{
    ArmErrors, Commanded, Ingredient, Poses, SimulateSettings, Stream, visits,
};

use crate::common::NOISE;
use crate::history::simulated::{figures, full, told};

const STATIONS: usize = 120;
/// The track's travel, mm.
const TRAVEL_MM: f64 = 3000.0;
/// The first session whose track has changed.
const CHANGED: u64 = 3;
/// The largest change, mm.
const BY_MM: f64 = 0.15;

fn arm() -> Arm {
    let text = include_str!("../../robots/track.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

/// Lowest and highest position of the track in a session, mm: no two of eight sessions have one range.
fn range_mm(session: u64) -> [f64; 2] {
    let start = 90.0 * (session % 8) as f64;
    [start, TRAVEL_MM - 700.0 + start]
}

/// The change of the track's error at a position, mm: a wave of 2 m.
fn change_mm(position_mm: f64) -> f64 {
    BY_MM * (3.0 * std::f64::consts::PI * position_mm / TRAVEL_MM).sin()
}

/// Commanded joints of a session: the track over its range, the others around home.
fn poses(session: u64) -> Vec<Vec<f64>> {
    let mut poses = Stream::new(session, Ingredient::Poses);
    let [low, high] = range_mm(session);
    let home = [0.0, 20.0, -10.0, 25.0, 55.0, -15.0_f64];
    let pose = |_| {
        let mut joints = vec![poses.between(low, high)];
        let turning = home.map(|q| q.to_radians() + poses.between(-0.7, 0.7));
        joints.extend(turning);
        joints
    };
    (0..STATIONS).map(pose).collect()
}

/// Stations of a session of one arm (7), its track changed or not.
fn observations(arm: &Arm, session: u64, changed: bool) -> Vec<Observation> {
    let listed = || Poses::Listed { joints: Vec::new() };
    let home = vec![0.0; 7];
    let mut errors = ArmErrors::draw(arm, &SimulateSettings::realistic(7, home.clone(), listed()));
    if changed {
        // A simulated slide's curve is in m over a turn of twice its travel.
        errors.curves[0].sines[2] += 1e-3 * BY_MM;
    }
    let mut settings = SimulateSettings::realistic(1000 + session, home, listed());
    settings.cell.base_drift_mm = 0.0;
    let target = isometry_from_rpy(settings.cell.flange_from_target_mm, [0.0; 3]);
    assert_eq!(target.rotation, UnitQuaternion::identity());
    let commanded = poses(session).into_iter().map(|joints| Commanded {
        base_from_target: arm.chain().nominal(&arm.axes(&joints)) * target,
        joints,
    });
    let commanded: Vec<Commanded> = commanded.collect();
    let visits = visits(arm, &settings, &errors, &commanded);
    let stations: Vec<_> = visits.into_iter().map(|visit| visit.station).collect();
    fit::observations(0, &stations, arm, &NOISE)
}

/// Sessions one after another; the track changes before session [`CHANGED`] or never.
fn measured(sessions: u64, changes: bool) -> Vec<Judged> {
    let arm = arm();
    let mut history = SessionHistory::default();
    let judge = |session: u64| {
        let seen = observations(&arm, session, changes && session >= CHANGED);
        history.next(&figures(full(&arm, &seen)))
    };
    (0..sessions).map(judge).collect()
}

/// Position, found and true change of the curve, mm, each without its mean: a constant is the track's zero, or the base's place.
fn changes(judged: &Judged) -> Vec<(f64, f64, f64)> {
    let at = |column: &Column| match column {
        Column::SlideCurve { joint: 1, at_mm } => Some(*at_mm as f64),
        _ => None,
    };
    let own = judged.moved.iter();
    let own: Vec<(f64, f64)> =
        own.filter_map(|shift| Some((at(&shift.column)?, shift.value))).collect();
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let found = mean(own.iter().map(|(_, value)| *value).collect());
    let truth = mean(own.iter().map(|(place, _)| change_mm(*place)).collect());
    own.into_iter().map(|(place, value)| (place, value - found, change_mm(place) - truth)).collect()
}

#[test]
fn a_change_of_a_tracks_curve_is_found_with_its_size() {
    let judged = measured(5, true);
    told(&judged);
    for (session, own) in (0..).zip(&judged) {
        let parts = own.finding.parts();
        let expected: &[Hypothesis] =
            if session == CHANGED { &[Hypothesis::JointCurve(1)] } else { &[] };
        assert_eq!(parts, expected, "session {session}");
    }
    let changes = changes(&judged[usize::try_from(CHANGED).expect("small")]);
    for (place, found, truth) in &changes {
        println!("{place:>6.0} mm: {found:+.3} mm found, {truth:+.3} mm true");
    }
    let sizes = changes.iter().map(|(_, found, truth)| (found - truth).powi(2));
    let off = (sizes.sum::<f64>() / changes.len() as f64).sqrt();
    println!("off by {off:.4} mm rms over {} positions", changes.len());
    let [low, high] = range_mm(CHANGED);
    let of_both = changes.iter().all(|(place, ..)| (low..=high).contains(place));
    assert!(of_both, "positions that both measured, {low} to {high} mm");
    assert!(changes.len() >= 10 && off < 0.15 * BY_MM, "{off} mm");
    assert_eq!(judged[4].settles, Some(true), "it lasts");
}

#[test]
fn a_track_that_did_not_change_raises_no_alarm() {
    let judged = measured(5, false);
    told(&judged);
    for (session, own) in judged.iter().enumerate() {
        assert_eq!(own.finding, Finding::Nothing, "session {session}");
        let asks = own
            .asked
            .iter()
            .any(|asked| asked.hypothesis == Hypothesis::JointCurve(1) && asked.alone.freedom >= 8);
        assert_eq!(asks, session > 0, "the track's curve is tested in session {session}");
    }
}

#[test]
#[ignore = "minutes: alarms over many sessions"]
fn alarms_over_many_sessions_of_a_track() {
    let judged = measured(16, false);
    let of_track = |own: &&Judged| {
        own.asked.iter().any(|asked| {
            asked.hypothesis == Hypothesis::JointCurve(1) && asked.alone.p_value() < 0.1
        })
    };
    let below = judged.iter().filter(of_track).count();
    let alarms = judged.iter().filter(|own| own.finding != Finding::Nothing);
    let alarms = alarms.count();
    println!("15 comparisons of a track that did not change: {below} below 0.1, {alarms} alarms");
    assert!(alarms == 0 && below <= 5, "{below} below 0.1, {alarms} alarms");
}
