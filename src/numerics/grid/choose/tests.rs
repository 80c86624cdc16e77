//! What each rule chooses among rows made by hand.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use super::*;
use crate::figures::{Figures, PoseErrors};
use crate::grid::judge::LeftAt;
use crate::grid::rows::combine;
use crate::grid::{Covered, HeldOut, Interpolation, Judgement, Lattice, Source};

fn covered(stations: usize, like: usize) -> Covered {
    Covered { stations, like, measured: like, of_box: stations as f64 / like as f64 }
}

fn by(rule: Rule) -> GridSettings {
    let mut settings: GridSettings = toml::from_str("steps_mm = [100]").expect("[grid]");
    settings.choose = rule;
    settings
}

/// The row that a rule publishes, and why.
fn chosen(judged: &[Judged], rule: Rule) -> (Option<usize>, Verdict, String) {
    let choice = choose(judged, &by(rule));
    (choice.row, choice.verdict, choice.words)
}

/// A table row of `n` held-out stations that all keep the same error.
fn row(step_mm: f64, left_mm: f64, uncorrected_mm: f64, n: usize) -> Judged {
    let tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };
    let norms = vec![left_mm; n];
    let mut by_pose = PoseErrors::default();
    (0..n).for_each(|pose| by_pose.add(pose, pose, 0, left_mm));
    let bound = by_pose.bound(tolerance.coverage());
    let left = LeftAt {
        station: 0,
        pose: 0,
        sample: 0,
        at: Point3::origin(),
        before: Vector3::x() * uncorrected_mm,
        error: Vector3::x() * left_mm,
    };
    Judged {
        step_mm,
        source: Source::Model,
        interpolation: Interpolation::Trilinear,
        judgement: Judgement::Table,
        of_test: None,
        lattice: Some(Lattice { origin: Point3::origin(), step: [step_mm; 3], counts: [2; 3] }),
        pitch_mm: Some([step_mm; 3]),
        nodes: 8,
        refused_nodes: BTreeMap::new(),
        cells: 1,
        refused_cells: BTreeMap::new(),
        covered: Some(covered(n, n)),
        interpolation_shown: None,
        decided_by: Judgement::Table,
        figures: Figures::of(&norms),
        bound,
        bound_of_session: bound,
        model_bound: bound.map(|_| 0.1),
        verdict: tolerance.verdict(bound, by_pose.counted(), 0.0),
        held_out: HeldOut {
            left: vec![left; n],
            direct: vec![0.1; n],
            norms,
            by_pose,
            blocks: BTreeSet::from([0]),
            ..HeldOut::default()
        },
        chosen: false,
    }
}

#[test]
fn the_largest_step_that_holds_without_a_gap_is_chosen() {
    // 300 mm holds by itself, but 200 mm below it does not.
    let judged = [row(100.0, 0.3, 1.0, 100), row(200.0, 0.6, 1.0, 100), row(300.0, 0.4, 1.0, 100)];
    let (row, verdict, words) = chosen(&judged, Rule::FewestNodes);
    assert_eq!((row, verdict), (Some(0), Verdict::Meets));
    assert!(words.contains("0.200 ± 0.000 mm more than the model"), "{words}");
}

#[test]
fn none_meets_it_and_no_help_are_answers_in_words() {
    let (_, verdict, words) = chosen(&[row(100.0, 0.9, 0.8, 100)], Rule::FewestNodes);
    assert_eq!(verdict, Verdict::DoesNotMeet);
    assert!(words.contains("no step meets the tolerance"), "{words}");
    assert!(words.contains("a grid does not help here"), "{words}");
}

#[test]
fn of_model_nodes_the_largest_step_near_the_model_is_chosen_and_both_choices_are_reported() {
    // The model's own bound is 0.100 mm: 0.105 is within the least margin, 0.106 is not.
    let judged =
        [row(100.0, 0.101, 1.0, 100), row(200.0, 0.1049, 1.0, 100), row(400.0, 0.106, 1.0, 100)];
    let choice = choose(&judged, &by(Rule::Within));
    assert_eq!((choice.row, &choice.verdict), (Some(1), &Verdict::Meets));
    assert!(
        choice.words.contains("bound of 0.105 mm is within 0.005 mm of the model's own, 0.100 mm"),
        "{}",
        choice.words
    );
    let fewest = choice.fewest_nodes.expect("a choice");
    assert_eq!(fewest.row, 2);
    assert!(fewest.words.contains("the largest step that holds"));
    assert_eq!(choice.within.expect("a choice").row, 1);
    assert_eq!(chosen(&judged, Rule::FewestNodes).0, Some(2));
    // A wider margin allows more.
    let wide = GridSettings { within: 0.1, ..by(Rule::Within) };
    assert_eq!(choose(&judged, &wide).row, Some(2));
}

#[test]
fn where_no_step_is_near_the_model_the_least_bound_is_chosen_and_that_is_stated() {
    let judged = [row(100.0, 0.3, 1.0, 100), row(200.0, 0.2, 1.0, 100)];
    let (row, verdict, words) = chosen(&judged, Rule::Within);
    assert_eq!((row, verdict), (Some(1), Verdict::Meets));
    assert!(
        words.contains("no step's bound is within 0.005 mm of the model's own, 0.100 mm"),
        "{words}"
    );
}

#[test]
fn without_a_bound_local_cells_choose() {
    // Twelve stations near the table's orientation, a hundred in cells of their own.
    let local = |step_mm: f64, left_mm: f64| Judged {
        judgement: Judgement::LocalCell,
        lattice: None,
        covered: None,
        ..row(step_mm, left_mm, 1.0, 100)
    };
    let judged = [
        row(100.0, 0.1, 1.0, 12),
        local(100.0, 0.101),
        row(200.0, 0.1, 1.0, 12),
        local(200.0, 0.102),
        row(400.0, 0.1, 1.0, 12),
        local(400.0, 0.3),
    ];
    let (row, verdict, words) = chosen(&judged, Rule::Within);
    assert_eq!(row, Some(2), "{words}");
    assert!(matches!(verdict, Verdict::NotShown(_)));
    assert!(words.contains("cells around each station"), "{words}");
    // The paper's rule takes the least error.
    assert_eq!(chosen(&judged, Rule::FewestNodes).0, Some(0));
}

#[test]
fn of_both_sources_the_smaller_bound_is_published() {
    let measured = |left_mm: f64| Judged {
        source: Source::Measured,
        model_bound: None,
        ..row(300.0, left_mm, 1.0, 100)
    };
    let (model, worse) = (row(100.0, 0.102, 1.0, 100), measured(0.2));
    let (row, _, words) = chosen(&[model.clone(), worse], Rule::Within);
    assert_eq!(row, Some(0));
    assert!(words.contains("300 mm, nodes measured, trilinear has a bound of 0.200 mm"), "{words}");
    let better = measured(0.05);
    assert_eq!(chosen(&[model, better], Rule::Within).0, Some(1));
}

#[test]
fn a_step_that_answers_for_too_few_stations_comes_after_one_that_answers_for_enough() {
    let mut small = row(100.0, 0.3, 1.0, 100);
    let mut large = row(200.0, 0.1, 1.0, 94);
    large.covered = Some(covered(94, 100));
    for rule in [Rule::Within, Rule::FewestNodes] {
        let judged = [small.clone(), large.clone()];
        assert_eq!(chosen(&judged, rule).0, Some(0));
    }
    // Where none covers enough, all may be chosen, and the text states so.
    small.covered = Some(covered(90, 100));
    for rule in [Rule::Within, Rule::FewestNodes] {
        let (row, _, words) = chosen(&[small.clone(), large.clone()], rule);
        assert_eq!(row, Some(1));
        assert!(words.contains("no step answers for 95 %"), "{words}");
        assert!(words.contains("94 of 100 measured stations"), "{words}");
    }
}

#[test]
fn interpolations_that_stations_on_nodes_do_not_tell_apart_are_reported_by_local_cells() {
    let idw = |row: Judged| Judged { interpolation: Interpolation::Idw, ..row };
    let local = |left_mm: f64| Judged {
        judgement: Judgement::LocalCell,
        lattice: None,
        ..row(100.0, left_mm, 1.0, 100)
    };
    let table = row(100.0, 0.1, 1.0, 100);
    let judged = [table.clone(), local(0.12), idw(table), idw(local(0.2))];
    assert_eq!(chosen(&judged, Rule::Within).0, Some(0));
}

#[test]
fn where_no_step_gives_a_table_the_reasons_are_reported() {
    let flat = Judged {
        lattice: None,
        nodes: 0,
        bound: None,
        verdict: Verdict::NotShown("the box is flat".to_owned()),
        ..row(100.0, 0.1, 1.0, 0)
    };
    let choice = choose(&[flat], &by(Rule::Within));
    assert_eq!((choice.row, choice.within, choice.fewest_nodes), (None, None, None));
    assert!(
        matches!(choice.verdict, Verdict::NotShown(reason) if reason.contains("100 mm, nodes model: the box is flat"))
    );
}

#[test]
fn too_few_stations_show_nothing() {
    let verdict = row(100.0, 0.1, 1.0, 58).verdict;
    assert!(
        matches!(verdict, Verdict::NotShown(reason) if reason.contains("58 poses held out; 59 poses are needed"))
    );
}

#[test]
fn a_table_has_the_larger_bound_of_its_nodes_and_of_local_cells_and_the_verdict_on_it() {
    let tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };
    let local = |left_mm: f64, n: usize| Judged {
        judgement: Judgement::LocalCell,
        lattice: None,
        ..row(100.0, left_mm, 1.0, n)
    };
    let combined = |left_mm: f64, n: usize| {
        let mut judged = vec![local(left_mm, n), row(100.0, 0.1, 1.0, 100)];
        combine(&mut judged, &tolerance, 0.05);
        judged.remove(1)
    };
    // Stations on nodes show 0.1 mm; where the table interpolates it leaves 0.46 mm, and 0.05 mm of U are too much for 0.5 mm.
    let table = combined(0.46, 100);
    assert_eq!((table.bound, table.decided_by), (Some(0.46), Judgement::LocalCell));
    assert_eq!(table.verdict, Verdict::DoesNotMeet);
    assert_eq!(combined(0.44, 100).verdict, Verdict::Meets);
    let table = combined(0.09, 100);
    assert_eq!((table.bound, table.decided_by), (Some(0.1), Judgement::Table));
    // What interpolation adds has to be shown.
    let table = combined(0.09, 58);
    assert_eq!(table.bound, None);
    assert!(matches!(table.verdict, Verdict::NotShown(reason) if reason.contains("58 poses")));
}

#[test]
fn a_tolerance_notices_changes_as_large_as_its_uncertainty() {
    // U, a tenth of the tolerance at least and a third at most.
    for (guard_mm, expected_mm) in [(0.02, 0.06), (0.1, 0.1), (0.4, 0.2)] {
        let found_mm = notices_mm(0.6, guard_mm);
        assert!((found_mm - expected_mm).abs() < 1e-12, "{found_mm}");
    }
}
