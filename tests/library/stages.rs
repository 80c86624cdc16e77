//! The stages after the join on real recordings.

use crate::common;

use std::f64::consts::{FRAC_PI_2, PI};

use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::{FitSettings, KnownTarget, Noise, TrackerUncertainty};
use posegrid::geometry::isometry_from_rpy;
use posegrid::grid::{GridSettings, Source, Tolerance, Verdict};
use posegrid::join::{JoinSettings, ReadingKind, join};
use posegrid::judgement::{JoinedSession, Outcome, StageSettings};
use posegrid::kinematics::Arm;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget};
use posegrid::report::verdict::{Applied, Judging};
use posegrid::report::{Angles, BaseRefit, Model, Split};

fn joined(name: &str, arm: &Arm) -> Option<JoinedSession> {
    let read = common::session(name, arm)?;
    let joined = join(&read.input, arm, &JoinSettings::default()).expect(name);
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
    };
    let commanded = commanded(&joined.stations, arm, &frames);
    Some(JoinedSession {
        sampling_plan: None,
        set_up: None,
        stated_sizes: Vec::new(),
        driven_by: None,
        name: name.to_owned(),
        log_rejects: read.rejects,
        counts: read.counts,
        joined,
        commanded,
    })
}

fn settings() -> StageSettings {
    StageSettings {
        fit: FitSettings {
            orientations: true,
            target: Some(KnownTarget { xyz_mm: [-0.2, 0.2, 92.8], sd_mm: 1.0 }),
            ..FitSettings::default()
        },
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        grid: GridSettings {
            steps_mm: vec![50.0, 75.0, 100.0, 150.0, 200.0, 300.0],
            ..GridSettings::default()
        },
        tolerance: Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 },
        locate: Locate { by: LocateBy::First, stations: Some(50), target: LocateTarget::Known },
        leave_sessions_out: true,
        ..common::stage_settings(Noise::of_one(
            posegrid::fit::Source {
                reads: ReadingKind::Pose,
                uncertainty: TrackerUncertainty {
                    range_um: 10.0,
                    range_um_per_m: 0.3,
                    transverse_um: 15.0,
                    transverse_um_per_m: 6.0,
                    divisor: 2.0,
                    orientation_rad: Some(130e-6),
                }
                .into(),
            },
            0.03,
        ))
    }
}

/// Mean held-out norm of one model on one judge; `None` where the recordings are absent.
fn mean(
    outcome: &Outcome<'_>,
    split: Split,
    model: Model,
    angles: Angles,
    base_refit: BaseRefit,
) -> f64 {
    let is_it = |a: &&posegrid::report::Accuracy| {
        let s = &a.subject;
        (s.split, s.model, s.angles, s.base_refit) == (split, model, angles, base_refit)
    };
    outcome.accuracy.iter().find(is_it).and_then(|a| a.figures).expect("a figure").mean
}

fn outcome<'a>(
    arm: &'a Arm,
    train: &[&str],
    test: &[&str],
    settings: &StageSettings,
) -> Option<Outcome<'a>> {
    let all =
        |names: &[&str]| names.iter().map(|name| joined(name, arm)).collect::<Option<Vec<_>>>();
    Some(crate::judged(arm, all(train)?, all(test)?, settings).expect("stages"))
}

#[test]
fn the_grid_session_has_steps_that_hold_and_some_that_do_not() {
    let arm = common::arm("ur10");
    let Some(outcome) = outcome(&arm, &["ur10-grid"], &[], &settings()) else {
        return;
    };
    let full = mean(&outcome, Split::Blocks, Model::Full, Angles::Weighted, BaseRefit::None);
    let geometric =
        mean(&outcome, Split::Blocks, Model::Geometric, Angles::Reported, BaseRefit::None);
    assert!(
        full < 0.07 && geometric > 0.4,
        "full error model {full:.4} mm, geometry {geometric:.4} mm"
    );
    let chosen = outcome.grids.chosen().expect("a table");
    assert_eq!(chosen.verdict, Verdict::Meets);
    assert!(chosen.held_out.counted().poses >= 59, "fewer than a bound needs");
    let fails = |row: &&posegrid::grid::Judged| {
        row.verdict == Verdict::DoesNotMeet && row.step_mm > chosen.step_mm
    };
    assert!(
        outcome.grids.judged.iter().any(|row| fails(&row)),
        "no larger step fails: the choice shows nothing"
    );
    // Every station of every judged row is accounted for.
    for row in outcome.grids.judged.iter().filter(|row| row.source == Source::Model) {
        let refused: usize = row.held_out.refused.values().sum();
        assert_eq!(
            row.held_out.counted().visits + refused + row.held_out.outside + row.held_out.unlike,
            615,
            "{row:?}"
        );
    }
}

#[test]
fn random_a_predicts_random_b_and_its_ellipsoids_hold() {
    let arm = common::arm("ur10");
    let Some(outcome) = outcome(&arm, &["ur10-random-a"], &["ur10-random-b"], &settings()) else {
        return;
    };
    let of = |model, angles, refit| mean(&outcome, Split::Session, model, angles, refit);
    let refitted = of(Model::Full, Angles::Weighted, BaseRefit::All);
    assert!(refitted <= 0.048, "base refitted on all: {refitted:.4} mm");
    assert!(of(Model::Full, Angles::Weighted, BaseRefit::First) < 0.06);
    assert!(of(Model::Full, Angles::Commanded, BaseRefit::All) < 0.06);
    assert!((of(Model::Geometric, Angles::Reported, BaseRefit::None) - 0.442).abs() < 0.01);
    for accuracy in &outcome.accuracy {
        let judges =
            accuracy.subject.split != Split::None && accuracy.subject.angles == Angles::Weighted;
        if let Some(coverage) = accuracy.coverage.filter(|_| judges) {
            assert!(coverage.inside >= 0.9, "{:?}: {coverage:?}", accuracy.subject);
        }
    }
    // Few stations are within 5° of the table's orientation: too few for any bound, and said so.
    assert!(matches!(outcome.grids.choice.verdict, Verdict::NotShown(_)));
    // What can be applied is the identified arm, which is met on held-out blocks and on the other session.
    let verdict = &outcome.verdict;
    assert_eq!(verdict.applied, Applied::IdentifiedArm);
    assert_eq!((verdict.verdict(), verdict.reason()), (Verdict::Meets, None));
    let [blocks, session] = verdict.judges() else { panic!("{verdict:?}") };
    assert_eq!(session.verdict, Verdict::Meets, "{}", session.line());
    assert_eq!(session.remark, None);
    assert_eq!(blocks.stations, Judging::Blocks("ur10-random-a".to_owned()));
    println!("{}", verdict.statement());
    let figure = verdict.headline().figure().expect("a figure");
    assert_eq!(figure.subject.of_session, "ur10-random-b");
    assert!(figure.bound.is_some_and(|bound| bound < 0.13), "{figure:?}");
    assert!(figure.counted.poses > 600, "{figure:?}");
    assert!(
        verdict
            .statement()
            .starts_with("met by the identified arm: held-out blocks of ur10-random-a: "),
        "{}",
        verdict.statement()
    );
    // The table is beside it, with its own.
    let table = verdict.table.verdict();
    assert!(
        matches!(&table, Verdict::NotShown(reason) if reason.contains("blocks of ur10-random-a: ") && reason.contains("59 poses are needed")),
        "{table:?}"
    );
    let geometric = verdict.of_model(Model::Geometric).expect("identified");
    assert_eq!(geometric.verdict(), Verdict::DoesNotMeet);
}
