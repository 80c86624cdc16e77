//! The page of a small fleet.

use roxmltree::{Document, ParsingOptions};

use super::content::{Content, Newest, Robot};
use super::html;
use crate::io::tables::words::TableVerdict;
use crate::page::tests::HOSTILE;
use crate::units::WallTime;

const HOUR_US: i64 = 3_600_000_000;

fn robot(name: &str, hours: i64, verdict: TableVerdict, bound_mm: f64) -> Robot {
    Robot {
        name: name.to_owned(),
        page: "a%20b.html".to_owned(),
        sessions: 3,
        newest: Some(Newest {
            session: format!("{name} night"),
            started: Some(WallTime::of_us(1_767_304_800_000_000 - HOUR_US * hours)),
            usual_days: Some(1.0),
            verdict,
            bound_mm: Some(bound_mm),
            tolerance_mm: Some(0.5),
            before_mm: Some(1.25),
            after_mm: None,
            moved: (hours == 2).then(|| "base by 0.500 mm".to_owned()),
            out_of_control: Vec::new(),
        }),
        unreadable: 0,
    }
}

fn content(robots: Vec<Robot>) -> Content {
    Content { as_of: Some(WallTime::of_us(1_767_304_800_000_000)), is_stated: false, robots }
}

#[test]
fn the_verdict_stands_first_names_are_escaped_and_each_robot_has_its_link() {
    let page = html(&content(vec![
        robot(HOSTILE, 0, TableVerdict::Met, 0.25),
        robot("b", 2, TableVerdict::NotMet, 0.75),
        robot("c", 72, TableVerdict::NotShown, 0.4),
    ]));
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let parsed = Document::parse_with_options(&page, options).expect("well-formed");
    assert!(!page.contains("<script") && !page.contains("<img"));
    let links = parsed.descendants().filter(|node| node.attribute("href") == Some("a%2520b.html"));
    // All of them by verdict, one that moved, one that was not measured.
    assert_eq!(links.count(), 5);
    for expected in [
        "1 of 3 robots does not meet the tolerance",
        "2026-01-01 22:00:00",
        "base by 0.500 mm",
        ">3.0</data>",
        ">1.50</data>",
    ] {
        assert!(page.contains(expected), "{expected}:\n{page}");
    }
}

#[test]
fn a_fleet_without_a_date_or_a_session_says_so() {
    let mut robots =
        vec![robot("a", 0, TableVerdict::Met, 0.25), robot("b", 0, TableVerdict::Met, 0.25)];
    let all_met = html(&content(robots.clone()));
    assert!(
        all_met.contains("All robots meet the tolerance")
            && all_met.contains("Every robot was measured last night")
    );
    robots[0].newest.as_mut().expect("there").started = None;
    robots[1].newest = None;
    let page = html(&Content { as_of: None, ..content(robots) });
    for expected in [
        "No session has a date",
        "1 of 2 robots are shown to meet",
        "Without any session that could be used: b",
        "no date",
    ] {
        assert!(page.contains(expected), "{expected}:\n{page}");
    }
}
