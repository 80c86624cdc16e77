//! The page of a small history.

use super::content::{Content, Curve, Parameter, Point, Series, Session};
use super::html;
use crate::io::tables::words::TableVerdict;

fn session(name: &str, moved: Option<&str>, lasting: Option<bool>) -> Session {
    Session {
        name: name.to_owned(),
        page: Some(format!("../report/ur10%20b/{name}/00ff.html")),
        started: None,
        verdict: TableVerdict::Met,
        bound_mm: Some(0.25),
        tolerance_mm: Some(0.5),
        means_mm: [Some(1.5), None],
        segment: 1,
        began: Vec::new(),
        against: usize::from(name != "mon"),
        means: None,
        moved: moved.map(str::to_owned),
        lasting,
        out_of_control: Vec::new(),
    }
}

fn content() -> Content {
    let point = |session: usize| Point {
        session,
        value: 0.1 * session as f64,
        sd: Some(0.01),
        average: Some(0.2),
    };
    let series = |name: &str, is_accuracy| Series {
        name: name.to_owned(),
        is_accuracy,
        points: (1..4).map(point).collect(),
    };
    Content {
        robot: "ur10 <b>".to_owned(),
        false_alarm: 1e-3,
        runs: 4,
        sessions: vec![
            session("mon", None, None),
            session("tue", Some("base by 0.200 mm"), Some(true)),
            session("wed", None, None),
        ],
        series: vec![series("after full mean", true), series("base_x", false)],
        curves: vec![Curve {
            slides: false,
            joint: 1,
            first: vec![[0.0, 1e-4, 1e-5], [0.5, 2e-4, 1e-5]],
            newest: vec![[0.0, 1e-4, 1e-5], [0.5, 2e-4, 1e-5]],
        }],
        parameters: vec![Parameter {
            name: "theta_3".to_owned(),
            unit: "rad",
            first: Some((1e-3, 1e-5)),
            newest: None,
        }],
        left_out: vec![("x".to_owned(), "replaced by another run".to_owned())],
    }
}

#[test]
fn the_verdict_stands_first_and_everything_is_escaped() {
    let page = html(&content());
    assert!(page.contains("Nothing moved"), "{page}");
    assert!(page.contains("ur10 &lt;b&gt;") && !page.contains("ur10 <b>"));
    assert!(page.contains("base by 0.200 mm") && page.contains("replaced by another run"));
    assert!(page.contains("href=\"../report/ur10%2520b/wed/00ff.html\""), "{page}");
    assert!(page.contains("tolerance 0.5 mm"), "{page}");
    assert!(!page.contains("<script") && !page.contains("http"), "no script and no network");
    let page = page.trim_start_matches("<!DOCTYPE html>");
    let tree = roxmltree::Document::parse(page).expect("well-formed");
    let charts = tree.descendants().filter(|node| node.has_tag_name("svg"));
    let titled =
        |svg: &roxmltree::Node<'_, '_>| svg.children().any(|node| node.has_tag_name("title"));
    assert!(charts.clone().count() >= 4 && charts.clone().all(|svg| titled(&svg)));
}

#[test]
fn an_empty_history_is_stated() {
    let empty = Content {
        sessions: Vec::new(),
        series: Vec::new(),
        curves: Vec::new(),
        parameters: Vec::new(),
        ..content()
    };
    assert!(html(&empty).contains("There is no session to report"));
}
