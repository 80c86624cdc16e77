//! The page of a small plan, with names that would break a careless one.

use std::collections::BTreeMap;

use super::content::{Content, Figure, Promise, Visit};
use super::html;
use crate::page::content::{Count, Provenance};
use crate::page::tests::{HOSTILE, assert_text_alone, parsed};

fn figure(study: &str, design: &str) -> Figure {
    Figure {
        study: study.to_owned(),
        value: None,
        design: design.to_owned(),
        source: "identified_arm".to_owned(),
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
        expected_mean_mm: None,
        expected_share_mm: None,
        bound_mm: Some(0.227_875),
        meet: 60,
        share_at_least: 0.9513,
        share_asked: 0.95,
        chosen: false,
    }
}

fn on_grid(study: &str, value: Option<f64>, step_mm: f64) -> Figure {
    Figure {
        value,
        source: "model".to_owned(),
        interpolation: Some("trilinear".to_owned()),
        step_mm: Some(step_mm),
        ..figure(study, "uniform_grid")
    }
}

fn figures() -> Vec<Figure> {
    let chosen = Figure {
        chosen: true,
        ..on_grid("step", None, 500.0)
    };
    let unjudged = Figure {
        mean_mm: None,
        p95_mm: None,
        bound_mm: None,
        meet: 0,
        judged: 0,
        share_at_least: 0.0,
        ..on_grid("step", None, 1000.0)
    };
    let greedy = Figure {
        expected_mean_mm: Some(0.175_25),
        chosen: true,
        ..figure("design", "greedy_variance")
    };
    let few = Figure {
        judged: 0,
        bound_mm: None,
        ..on_grid("grid_shift", Some(0.25), 500.0)
    };
    vec![
        chosen,
        unjudged,
        on_grid("step", None, 250.0),
        few,
        on_grid("orientation_mismatch", Some(10.000_000_000_000_002), 500.0),
        on_grid("mixed_configuration", Some(0.2), 500.0),
        on_grid("singularity_distance", Some(0.5), 500.0),
        greedy,
        figure("design", "random"),
        figure("promise", "greedy_variance"),
    ]
}

fn visit(pose: i32, purpose: &str) -> Visit {
    let t = f64::from(pose);
    let chosen = (purpose == "identify").then_some(i64::from(pose));
    Visit {
        pose: i64::from(pose),
        target: format!("p{pose}"),
        purpose: purpose.to_owned(),
        repeats: (purpose == "drift_check").then_some(0),
        joints_rad: vec![0.1 * t, -0.5],
        at: [1000.0 + 10.0 * t, -5.0 * t, 700.0],
        chosen_as: chosen,
        variance_left_mm2: chosen.map(|_| 4.0 / (1.0 + t)),
    }
}

/// A plan in which every text that comes from files is `name`.
fn content(name: &str) -> Content {
    let text = || name.to_owned();
    let purposes = ["identify", "identify", "verify", "drift_check"];
    Content {
        robot: text(),
        plan: "00ff".to_owned(),
        promise: Some(Promise {
            mean_mm: Some(0.136_375),
            bound_mm: Some(0.254_125),
            share: 0.95,
            confidence: 0.9,
            robots: 60,
            meet: 60,
            tolerance_mm: 0.5,
            bound_share: 0.99,
            bound_confidence: 0.95,
        }),
        figures: figures(),
        visits: (0..)
            .zip(purposes)
            .map(|(pose, purpose)| visit(pose, purpose))
            .collect(),
        joints: vec![text(), text()],
        counts: vec![Count {
            stage: "plan".to_owned(),
            of: "candidate poses".to_owned(),
            read: 1003,
            kept: 1000,
            rejected: vec![(text(), 3)],
        }],
        provenance: Provenance {
            pipeline: text(),
            version: "0.1.0".to_owned(),
            inputs: vec![(text(), 959, "9302".to_owned())],
            tables: vec![(text(), 77, "d83f".to_owned())],
            settings: text(),
        },
    }
}

#[test]
fn every_section_is_there_once_in_order() {
    let page = html(&content("kr210"));
    let document = parsed(&page);
    let sections = document
        .descendants()
        .filter(|node| node.has_tag_name("section"));
    let ids: Vec<_> = sections
        .filter_map(|section| section.attribute("id"))
        .collect();
    assert_eq!(
        ids,
        [
            "grid",
            "designs",
            "influences",
            "session",
            "provenance",
            "reading"
        ]
    );
    // Step; mean and bound of designs; four influences; three views and what an early end leaves.
    assert_eq!(page.matches("<svg").count(), 1 + 2 + 4 + 4);
    assert_eq!(
        page,
        html(&content("kr210")),
        "the same content gives the same bytes"
    );
}

#[test]
fn the_promise_stands_first_in_words_with_its_share_and_confidence() {
    let page = html(&content("kr210"));
    let document = parsed(&page);
    let header = document
        .descendants()
        .find(|node| node.has_tag_name("header"))
        .expect("a head");
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
    let figures = document
        .descendants()
        .filter(|node| node.has_tag_name("data"));
    let values: BTreeMap<&str, &str> = figures
        .filter_map(|node| Some((node.attribute("value")?, node.text()?)))
        .collect();
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
    assert!(page.contains("Too few fresh poses for a bound, so read with care, at 0.25."));
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
    let promise = short.promise.as_mut().expect("a promise");
    (promise.mean_mm, promise.bound_mm) = (None, None);
    let page = html(&short);
    parsed(&page);
    assert!(
        page.contains("The plan is not shown to meet the tolerance")
            && page.contains("60 simulated robots are too few")
    );
}

#[test]
fn a_plan_of_nothing_still_has_a_page() {
    let bare = Content {
        promise: None,
        figures: Vec::new(),
        visits: Vec::new(),
        joints: Vec::new(),
        counts: Vec::new(),
        ..content("kr210")
    };
    let page = html(&bare);
    parsed(&page);
    assert!(page.contains("The plan is not shown to meet the tolerance"));
}

#[test]
fn the_page_of_a_long_session_can_be_mailed() {
    // As many as a plan may have: 2000 poses to identify, 2000 to verify, one of the first again after each.
    let purposes = ["identify", "verify", "drift_check"];
    let visits = (0..6000).map(|pose| visit(pose, purposes[pose.unsigned_abs() as usize % 3]));
    let long = Content {
        visits: visits.collect(),
        ..content("kr210")
    };
    let page = html(&long);
    assert!(page.len() < 500_000, "{} bytes", page.len());
    assert!(page.contains("The first 500 of 6\u{202f}000"));
}
