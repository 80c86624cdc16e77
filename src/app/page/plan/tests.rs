//! The page of a small plan, with names that would break a page that does not escape them.

use std::collections::BTreeMap;

use super::content::Content;
use super::html;
use crate::grid::Interpolation;
use crate::io::tables::plan_figures::{CorrectedBy, FigureRow, FigureStudy};
use crate::io::tables::sampling_plan::{VisitPurpose, VisitRow};
use crate::manifest::StageCount;
use crate::page::tests::{HOSTILE, assert_text_alone, parsed, work, written};
use crate::plan::Kind;

fn figure(study: FigureStudy, design: Kind) -> FigureRow {
    FigureRow {
        study,
        design,
        source: CorrectedBy::IdentifiedArm,
        interpolation: None,
        step_mm: None,
        poses: 25,
        not_reached: 0,
        robots: 60,
        no_fit: 1,
        judged: 60,
        refused: 0,
        outside: 0,
        mean_mm: Some(0.092_75),
        p95_mm: Some(0.151_625),
        p99_mm: Some(0.2),
        max_mm: Some(0.21),
        expected_mean_mm: None,
        expected_share_mm: None,
        mean_bound_mm: Some(0.1),
        bound_mm: Some(0.227_875),
        meet: 60,
        share_at_least: 0.9513,
        share_asked: 0.95,
        confidence: 0.9,
        tolerance_mm: 0.5,
        chosen: false,
    }
}

fn on_grid(step_mm: f64) -> FigureRow {
    FigureRow {
        source: CorrectedBy::Model,
        interpolation: Some(Interpolation::Trilinear),
        step_mm: Some(step_mm),
        ..figure(FigureStudy::Step, Kind::UniformGrid)
    }
}

fn figures() -> Vec<FigureRow> {
    let chosen = FigureRow { chosen: true, ..on_grid(500.0) };
    let unjudged = FigureRow {
        mean_mm: None,
        p95_mm: None,
        bound_mm: None,
        meet: 0,
        judged: 0,
        share_at_least: 0.0,
        ..on_grid(1000.0)
    };
    let greedy = FigureRow {
        expected_mean_mm: Some(0.175_25),
        chosen: true,
        ..figure(FigureStudy::Design, Kind::GreedyVariance)
    };
    vec![
        chosen,
        unjudged,
        on_grid(250.0),
        greedy,
        figure(FigureStudy::Design, Kind::Random),
        figure(FigureStudy::Promise, Kind::GreedyVariance),
    ]
}

/// A visit of an arm whose two joints have this name.
fn visit(pose: usize, purpose: VisitPurpose, joint: &str) -> VisitRow {
    let t = pose as f64;
    let chosen = (purpose == VisitPurpose::Identify).then_some(pose);
    VisitRow {
        pose,
        target: format!("p{pose}"),
        purpose,
        repeats: (purpose == VisitPurpose::DriftCheck).then_some(0),
        joint_names: [joint, joint].map(str::to_owned).into(),
        joint_units: None,
        joints_rad: vec![0.1 * t, -0.5],
        position: [1000.0 + 10.0 * t, -5.0 * t, 700.0],
        orientation: [0.0, 0.0, 0.0, 1.0],
        configuration: None,
        design: Some(Kind::GreedyVariance),
        chosen_as: chosen,
        variance_left_mm2: chosen.map(|_| 4.0 / (1.0 + t)),
        step_mm: Some(500.0),
        promised_mean_mm: Some(0.136_375),
        promised_bound_mm: Some(0.254_125),
        promised_share: 0.95,
        promised_confidence: 0.9,
        robots_simulated: 60,
        robots_meet: 60,
        tolerance_mm: 0.5,
        bound_share: 0.99,
        bound_confidence: 0.95,
    }
}

/// A plan in which every text that comes from files is `name`.
fn content(name: &str) -> Content {
    let text = || name.to_owned();
    let purposes = [
        VisitPurpose::Identify,
        VisitPurpose::Identify,
        VisitPurpose::Verify,
        VisitPurpose::DriftCheck,
    ];
    Content {
        robot: text(),
        plan: "00ff".to_owned(),
        figures: figures(),
        visits: (0..).zip(purposes).map(|(pose, purpose)| visit(pose, purpose, name)).collect(),
        counts: vec![StageCount {
            stage: "plan",
            of: "candidate poses",
            read: 1003,
            kept: 1000,
            rejected: BTreeMap::from([(text(), 3)]),
        }],
        work: work(name),
        written: vec![written(name)],
    }
}

#[test]
fn every_section_is_there_once_in_order() {
    let page = html(&content("kr210"));
    let document = parsed(&page);
    let sections = document.descendants().filter(|node| node.has_tag_name("section"));
    let ids: Vec<_> = sections.filter_map(|section| section.attribute("id")).collect();
    assert_eq!(ids, ["grid", "designs", "session", "provenance", "reading"]);
    // Step; mean and bound of designs; three views and what an early end leaves.
    assert_eq!(page.matches("<svg").count(), 1 + 2 + 4);
    assert_eq!(page, html(&content("kr210")), "the same content gives the same bytes");
}

#[test]
fn the_promise_stands_first_in_words_with_its_share_and_confidence() {
    let page = html(&content("kr210"));
    let document = parsed(&page);
    let header = document.descendants().find(|node| node.has_tag_name("header")).expect("a head");
    let words: String = header
        .descendants()
        .filter(roxmltree::Node::is_text)
        .filter_map(|node| node.text())
        .collect();
    for part in [
        "The plan meets the tolerance",
        "the mean error stays below 0.136 mm, and 99 % of positions come within 0.254 mm (with 95 % confidence): for 95 % of robots, \
         with 90 % confidence.",
        "60 of 60 simulated robots",
        "at least 95.1 %",
        "Poses to identify2",
        "1 again, for drift",
        "Poses to verify1",
    ] {
        assert!(words.contains(part), "{part} is not in {words}");
    }
}

#[test]
fn figures_carry_the_values_of_the_tables() {
    let page = html(&content("kr210"));
    let document = parsed(&page);
    let figures = document.descendants().filter(|node| node.has_tag_name("data"));
    let values: BTreeMap<&str, &str> =
        figures.filter_map(|node| Some((node.attribute("value")?, node.text()?))).collect();
    // Promised mean and bound; mean, 95th percentile and bound of rows; what the model expects; the share, in percent.
    for (value, shown) in [
        ("0.136375", "0.136"),
        ("0.254125", "0.254"),
        ("0.09275", "0.093"),
        ("0.151625", "0.152"),
        ("0.227875", "0.228"),
        ("0.17525", "0.175"),
        ("0.9513", "95.1"),
    ] {
        assert_eq!(values.get(value), Some(&shown), "{value}");
    }
    // The second visit: 0.1 rad and -0.5 rad in degrees.
    assert!(page.contains(", of p0"));
    assert!(page.contains("<td>5.730</td><td>\u{2212}28.648</td>"));
}

#[test]
fn what_could_not_be_judged_is_stated() {
    let page = html(&content("kr210"));
    assert!(page.contains("No pose could be judged at 1000 mm."));
    assert!(page.contains("<small>1 not fitted</small>"));
}

#[test]
fn hostile_names_are_text_and_nothing_else() {
    assert_text_alone(&html(&content(HOSTILE)), &html(&content("kr210")));
}

#[test]
fn a_plan_that_falls_short_and_one_of_too_few_robots_say_so() {
    let mut short = content("kr210");
    for row in &mut short.figures {
        row.share_at_least = 0.7;
    }
    let page = html(&short);
    assert!(
        page.contains("The plan does not meet the tolerance")
            && page.contains("but 95 % are asked for")
    );
    for row in &mut short.visits {
        (row.promised_mean_mm, row.promised_bound_mm) = (None, None);
    }
    let page = html(&short);
    parsed(&page);
    assert!(
        page.contains("The plan is not shown to meet the tolerance")
            && page.contains("60 simulated robots are too few")
    );
}

#[test]
fn a_plan_of_nothing_still_has_a_page() {
    let bare =
        Content { figures: Vec::new(), visits: Vec::new(), counts: Vec::new(), ..content("kr210") };
    let page = html(&bare);
    parsed(&page);
    assert!(page.contains("The plan is not shown to meet the tolerance"));
}

#[test]
fn the_page_of_a_long_session_can_be_mailed() {
    // As many as a plan may have: 2000 poses to identify, 2000 to verify, one of the first again after each.
    let purposes = [VisitPurpose::Identify, VisitPurpose::Verify, VisitPurpose::DriftCheck];
    let visits = (0..6000).map(|pose| visit(pose, purposes[pose % 3], "joint_a1"));
    let long = Content { visits: visits.collect(), ..content("kr210") };
    let page = html(&long);
    assert!(page.len() < 500_000, "{} bytes", page.len());
    assert!(page.contains("The first 500 of 6\u{202f}000"));
}
