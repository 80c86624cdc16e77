//! Figures for the tool tip against a simulated arm of which all is known.

use crate::common;

use nalgebra::{Isometry3, Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::full::FullSettings;
use posegrid::fit::{ErrorBase, SurveyedBase};
use posegrid::fit::{FitSettings, Noise};
use posegrid::geometry::isometry_from_rpy;
use posegrid::grid::Verdict;
use posegrid::join::ReadingKind;
use posegrid::judgement::{Outcome, StageSettings};
use posegrid::kinematics::Arm;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget};
use posegrid::report::{Accuracy, Angles, Model, Point, Split};
use posegrid::simulate::settings::TrackerErrors;
use posegrid::simulate::{Poses, SimulateSettings, Simulated, simulate};

const HOME_DEG: [f64; 6] = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0];
/// The controller's tool point, which is the 6-DoF target, and the tip 200 mm before it.
const TOOL_MM: [f64; 3] = [25.0, -40.0, 100.0];
const LEVER_MM: [f64; 3] = [0.0, 0.0, 200.0];

fn tool() -> Isometry3<f64> {
    isometry_from_rpy(TOOL_MM, [0.0; 3])
}

/// Random poses of an arm that is realistically wrong, seen by a tracker without noise.
fn session(arm: &Arm, count: usize, six_dof: bool) -> Simulated {
    let home: Vec<f64> = HOME_DEG.map(f64::to_radians).to_vec();
    let poses = Poses::Joints {
        count,
        lower: home.iter().map(|q| q - 0.5).collect(),
        upper: home.iter().map(|q| q + 0.5).collect(),
    };
    let mut settings = SimulateSettings::realistic(7, home, poses);
    settings.cell.six_dof = six_dof;
    settings.cell.target_sd_mm = 0.0;
    settings.tracker = TrackerErrors::none();
    simulate(arm, &settings).expect("in reach")
}

fn settings(simulated: &Simulated) -> StageSettings {
    let cell = &simulated.truth.settings.cell;
    let surveyed = isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    let mut noise: Noise = common::NOISE.clone();
    noise.sources[0].reads = ReadingKind::Pose;
    common::state_orientation(&mut noise, 30e-6);
    StageSettings {
        fit: FitSettings { orientations: true, ..FitSettings::default() },
        full: FullSettings {
            // Without orientations there is nothing that a full error model would show.
            enabled: cell.six_dof,
            harmonics: 8,
            ..FullSettings::default()
        },
        flange_from_tool: Some(tool()),
        base: Some(ErrorBase::Surveyed(SurveyedBase {
            tracker_from_base: surveyed,
            sd_mm: None,
            sd_rad: None,
        })),
        target_is_tool: Some(true),
        locate: Locate { by: LocateBy::First, stations: Some(50), target: LocateTarget::Known },
        tool_tip: Some(Vector3::from(TOOL_MM) + Vector3::from(LEVER_MM)),
        ..common::stage_settings(noise)
    }
}

fn outcome<'a>(arm: &'a Arm, simulated: &Simulated) -> Outcome<'a> {
    let monday = common::joined("monday", arm, &simulated.recording, tool());
    crate::judged(arm, vec![monday], vec![], &settings(simulated)).expect("a sound session")
}

fn of(figures: &[Accuracy], model: Model, angles: Angles, split: Split) -> &Accuracy {
    let is_it = |a: &&Accuracy| {
        (a.subject.model, a.subject.angles, a.subject.split) == (model, angles, split)
    };
    figures.iter().find(is_it).expect("a figure")
}

/// What the tip really missed its command by at each measured station, mm. What a 6-DoF target cannot show is how it sits on
/// the flange, so the median turn between attained and commanded is no error of the tip.
fn true_errors(simulated: &Simulated) -> Vec<f64> {
    let stations = || simulated.truth.stations.iter().filter(|s| s.measured);
    let turn = |axis: usize| {
        let turns = stations().map(|s| {
            (s.command.rotation.inverse() * s.base_from_target.rotation).scaled_axis()[axis]
        });
        let mut turns: Vec<f64> = turns.collect();
        turns.sort_by(f64::total_cmp);
        0.5 * (turns[(turns.len() - 1) / 2] + turns[turns.len() / 2])
    };
    let mounted =
        nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(turn(0), turn(1), turn(2)));
    let tip = Point3::from(Vector3::from(LEVER_MM));
    let error = |s: &posegrid::simulate::TrueStation| {
        let attained = s.base_from_target * mounted.inverse() * tip;
        (attained - s.command * tip).norm()
    };
    stations().map(error).collect()
}

#[test]
fn the_tip_s_figures_are_those_of_the_true_tip() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = session(&arm, 110, true);
    let outcome = outcome(&arm, &simulated);
    let raw = of(&outcome.at_tip, Model::RawCommand, Angles::Commanded, Split::None);
    let truth = Figures::of(&true_errors(&simulated)).expect("stations");
    let found = raw.figures.expect("stations");
    assert_eq!((raw.point, found.n), (Point::Tip, truth.n));
    // The truth is that of the middle of a dwell, the measurement its mean.
    assert!((found.mean - truth.mean).abs() < 1e-3, "{found:?} {truth:?}");
    assert!((found.max - truth.max).abs() < 1e-3, "{found:?} {truth:?}");
    // The tip is another point: its figure is not that of the target.
    let target = of(&outcome.accuracy, Model::RawCommand, Angles::Commanded, Split::None);
    assert!((target.figures.expect("stations").mean - found.mean).abs() > 0.01);

    // A model that knows how curves and gravity turn the flange leaves little at the tip too; its held-out stations say how much.
    let mean = |figures: &[Accuracy], model, angles| {
        let own = of(figures, model, angles, Split::Blocks).figures;
        own.expect("stations").mean
    };
    let before = mean(&outcome.at_tip, Model::BaseTarget, Angles::Reported);
    let after = mean(&outcome.at_tip, Model::Full, Angles::Weighted);
    let at_target = mean(&outcome.accuracy, Model::Full, Angles::Weighted);
    assert!(after < before / 4.0, "{before} → {after}");
    assert!(after < 2.0 * at_target, "target {at_target}, tip {after}");
    // A table leaves orientations as they are: its tip misses by more than the tip of a model that predicts it.
    let table = of(&outcome.at_tip, Model::Table, Angles::Commanded, Split::Blocks);
    let commanded = mean(&outcome.at_tip, Model::Full, Angles::Commanded);
    assert!(table.figures.expect("stations").mean > commanded);
    assert!(table.bound.expect("59 stations") >= table.figures.expect("stations").p95);
}

#[test]
fn without_orientations_nothing_is_shown_and_why() {
    let arm = common::arm("kr210-r2700-extra");
    let outcome = outcome(&arm, &session(&arm, 40, false));
    assert!(!outcome.at_tip.is_empty());
    for figure in &outcome.at_tip {
        assert_eq!((figure.figures, figure.bound), (None, None), "{figure:?}");
        assert!(
            matches!(&figure.verdict, Verdict::NotShown(why) if why.contains("no 6-DoF")),
            "{figure:?}"
        );
    }
}
