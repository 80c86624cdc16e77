//! The page of a small run, with names that would break a careless one.

use std::collections::BTreeMap;

use roxmltree::{Document, ParsingOptions};

use super::content::{
    Calibration, Clock, Content, Count, Figure, JointError, Judge, Parameter, Provenance, Reject,
    Residual, Residuals, Session, Step, Subject, Variogram, VariogramEntry,
};
use super::html;
use super::shell::STYLE;
use crate::grid::{Tolerance, Verdict};
use crate::report::chart;

/// Markup, quotes of both kinds, an entity, a comment's end, a line's end, a terminal's escape, and a mark that turns the
/// direction of text: `gpj.exe` would read `exe.jpg`.
pub(super) const HOSTILE: &str = "</title><script>alert('1')</script>\"><img src=x onerror=\"a\">&lt;-->\n\u{1b}[2J\u{202e}gpj.exe";

fn subject(model: &str, name: &str) -> Subject {
    Subject {
        split: "blocks".to_owned(),
        of_session: name.to_owned(),
        base_refit: "none".to_owned(),
        model: model.to_owned(),
        angles: "commanded".to_owned(),
    }
}

fn figure(model: &str, name: &str, of: &str, value: f64, quantity: &str) -> Figure {
    Figure {
        subject: subject(model, of),
        evidence: "predicted".to_owned(),
        quantity: quantity.to_owned(),
        name: name.to_owned(),
        pose: None,
        value: Some(value),
        unit: "mm".to_owned(),
        n: 80,
        visits: Some(240),
        n_needed: Some(59),
        blocks: Some(8),
        verdict: Some("met".to_owned()),
        reason: Some(of.to_owned()),
    }
}

fn residuals(name: &str) -> Vec<Residuals> {
    let station = |i: u32, size: f64| {
        let t = f64::from(i);
        Residual {
            station: i64::from(i),
            at: [100.0 * t.sin(), 80.0 * t.cos(), 5.0 * t],
            error: [size, size * t.sin(), 0.0],
            used_for_refit: false,
        }
    };
    let of = |(model, size)| Residuals {
        subject: subject(model, name),
        stations: (0..80).map(|i| station(i, size)).collect(),
    };
    [("base_target", 0.5), ("full", 0.05)].map(of).into()
}

fn step(step_mm: f64, chosen: bool, name: &str) -> Step {
    Step {
        split: "blocks".to_owned(),
        of_session: name.to_owned(),
        source: "model".to_owned(),
        interpolation: "trilinear".to_owned(),
        judgement: "table".to_owned(),
        step_mm,
        nodes: Some(1200),
        held_out: 80,
        visits: 240,
        blocks: Some(8),
        mean_mm: Some(0.101_25),
        p95_mm: Some(0.15),
        max_mm: Some(0.3),
        bound_mm: Some(0.204_75),
        uncertainty_mm: Some(0.03),
        verdict: if chosen { "met" } else { "not_shown" }.to_owned(),
        reason: Some(name.to_owned()),
        chosen,
    }
}

fn variograms(name: &str) -> Vec<Variogram> {
    let row = |space: &str, entry| Variogram {
        space: space.to_owned(),
        errors: name.to_owned(),
        axis: "norm".to_owned(),
        entry,
        noise_mm2: Some(0.003),
        similarity: "similar".to_owned(),
    };
    let bin = |h: f64| VariogramEntry::Bin {
        separation: h,
        gamma_mm2: 0.1 * h,
    };
    let fitted = VariogramEntry::Fitted {
        shape: "spherical".to_owned(),
        nugget_mm2: 0.01,
        sill_mm2: 0.3,
        range: 2.0,
        best: true,
    };
    vec![
        row("joint", bin(1.0)),
        row("joint", bin(2.0)),
        row("joint", fitted),
    ]
}

fn joint_errors(name: &str) -> Vec<JointError> {
    let at = |degree: i32| JointError {
        joint: 1,
        name: name.to_owned(),
        angle_rad: f64::from(degree).to_radians(),
        curve_rad: 1e-4 * f64::from(degree).sin(),
        sd_rad: 5e-5,
        measured: (10..50).contains(&degree),
    };
    (0..60).map(at).collect()
}

fn session(name: &str) -> Session {
    Session {
        name: name.to_owned(),
        trained: true,
        clock: Clock {
            offset_ns: [2e9, 1e6],
            drift_ppm: [-12.0, 0.5],
            edges: 160,
            rms_ns: 2e6,
            method: name.to_owned(),
        },
        dwells: vec![
            ("paired".to_owned(), None, 80),
            ("unmeasured".to_owned(), Some("no_readings".to_owned()), 2),
        ],
        rejects: vec![Reject {
            stage: "ingest".to_owned(),
            kind: "messages".to_owned(),
            reason: name.to_owned(),
            number: None,
        }],
    }
}

fn parameter(name: &str) -> Parameter {
    Parameter {
        model: "full".to_owned(),
        name: name.to_owned(),
        belongs_to: "link".to_owned(),
        of_session: Some(name.to_owned()),
        unit: "rad".to_owned(),
        nominal: 0.0,
        offset: 1e-4,
        standard_error: Some(1e-5),
        identifiability: "weak".to_owned(),
        confused_with: vec![name.to_owned()],
    }
}

fn calibration(name: &str) -> Calibration {
    Calibration {
        model: "geometric".to_owned(),
        sessions: vec![name.to_owned()],
        stations: 80,
        downweighted: 1,
        parameters: 36,
        rank: Some(27),
        condition: Some(20_000.0),
        variance_factor: Some(40.0),
        misfit_mm: Some(0.2),
        iterations: Some(7),
        convergence: name.to_owned(),
        parts: vec![(name.to_owned(), -2.0)],
        valid_for: vec![("Tool".to_owned(), name.to_owned())],
    }
}

/// A run in which every text that comes from logs or settings is `name`.
fn content(name: &str) -> Content {
    let text = || name.to_owned();
    Content {
        robot: text(),
        session: text(),
        run: "00ff".to_owned(),
        tolerance: Tolerance {
            mm: 0.5,
            share: 0.95,
            confidence: 0.95,
        },
        verdict: Verdict::Meets,
        judges: vec![Judge {
            stations: text(),
            verdict: "met".to_owned(),
            words: text(),
            remark: Some(text()),
        }],
        choice: text(),
        warnings: vec![text()],
        notes: vec![text()],
        steps: vec![step(100.0, true, name), step(200.0, false, name)],
        tip: Vec::new(),
        table_state: Some(name.to_owned()),
        figures: vec![
            figure("base_target", "mean", name, 0.512_375, "position_error"),
            figure("full", "bound", name, 0.204_75, "position_error"),
            figure("full", "AP_p", name, 0.083_125, "iso_9283"),
        ],
        residuals: residuals(name),
        semivariograms: variograms(name),
        joint_errors: joint_errors(name),
        parameters: vec![parameter(name)],
        calibrations: vec![calibration(name)],
        sessions: vec![session(name)],
        counts: vec![Count {
            stage: "join".to_owned(),
            of: text(),
            read: 10,
            kept: 8,
            rejected: vec![(text(), 2)],
        }],
        provenance: Provenance {
            pipeline: text(),
            version: "0.1.0".to_owned(),
            inputs: vec![(text(), 12_345, "af13".to_owned())],
            tables: vec![(text(), 80, "b2c4".to_owned())],
            settings: text(),
        },
    }
}

/// Parses the page as XML, which every element closed and every value escaped makes it.
pub(super) fn parsed(page: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(page, options).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_section_is_there_once_in_order() {
    let page = html(&content("mon"));
    let document = parsed(&page);
    let sections = document
        .descendants()
        .filter(|node| node.has_tag_name("section"));
    let ids: Vec<_> = sections
        .filter_map(|section| section.attribute("id"))
        .collect();
    let expected = [
        "space",
        "steps",
        "accuracy",
        "iso-9283",
        "similarity",
        "joints",
        "parameters",
        "clocks",
        "rejects",
        "models",
        "provenance",
        "reading",
    ];
    assert_eq!(ids, expected);
    assert!(page.contains("Tolerance met") && page.contains("of positions come within"));
    assert_eq!(
        page,
        html(&content("mon")),
        "the same content gives the same bytes"
    );
}

/// A hostile name is text and nothing else: the page has the elements of one with a plain name.
pub(super) fn assert_text_alone(page: &str, plain: &str) {
    let elements = |page: &str| -> BTreeMap<String, usize> {
        let mut count = BTreeMap::new();
        for node in parsed(page)
            .descendants()
            .filter(roxmltree::Node::is_element)
        {
            *count.entry(node.tag_name().name().to_owned()).or_default() += 1;
        }
        count
    };
    assert_eq!(
        elements(page),
        elements(plain),
        "a name made an element of its own"
    );
    assert!(
        !page.contains(['\u{202e}', '\u{1b}']),
        "what a reader does not see is written out"
    );
    assert!(page.contains("\\u{202e}gpj.exe"));
}

#[test]
fn hostile_names_are_text_and_nothing_else() {
    let page = html(&content(HOSTILE));
    assert_text_alone(&page, &html(&content("mon")));
    let document = parsed(&page);
    let heading = document
        .descendants()
        .find(|node| node.attribute("class") == Some("which"))
        .expect("the head");
    let shown = heading.text().expect("a text");
    assert!(
        shown.starts_with("</title><script>alert('1')</script>\"><img src=x"),
        "{shown}"
    );
}

#[test]
fn figures_carry_the_values_of_the_tables() {
    let page = html(&content("mon"));
    let document = parsed(&page);
    let values: BTreeMap<&str, &str> = document
        .descendants()
        .filter(|node| node.has_tag_name("data"))
        .filter_map(|node| Some((node.attribute("value")?, node.text()?)))
        .collect();
    // 0.512375 is written with three digits, as is 0.083125 of ISO 9283.
    assert_eq!(values.get("0.512375"), Some(&"0.512"));
    assert_eq!(values.get("0.083125"), Some(&"0.083"));
    assert_eq!(values.get("0.20475"), Some(&"0.205"));
}

#[test]
fn a_run_with_nothing_but_a_verdict_still_has_a_page() {
    let whole = content("mon");
    let bare = Content {
        verdict: Verdict::NotShown("9 held-out stations; 59 are needed".to_owned()),
        steps: Vec::new(),
        figures: Vec::new(),
        residuals: Vec::new(),
        semivariograms: Vec::new(),
        joint_errors: Vec::new(),
        parameters: Vec::new(),
        calibrations: Vec::new(),
        sessions: Vec::new(),
        counts: Vec::new(),
        ..whole
    };
    let page = html(&bare);
    parsed(&page);
    assert!(
        page.contains("Not shown to meet the tolerance")
            && page.contains("9 held-out stations; 59 are needed")
    );
}

/// The colours of light, dark and print: those outside of any `@media`, with what the mode's own rule changes.
fn modes() -> [BTreeMap<String, [f64; 3]>; 3] {
    let of = |is_mode: fn(&str) -> bool| {
        let mut colours = BTreeMap::new();
        for rule in [chart::STYLE, STYLE]
            .iter()
            .flat_map(|style| style.split("@media"))
        {
            let parts = rule.split(['{', ';', '\n']).filter(|_| is_mode(rule));
            let variables =
                parts.filter_map(|part| part.trim().strip_prefix("--")?.split_once(": #"));
            colours.extend(variables.map(|(name, colour)| (name.to_owned(), rgb(colour))));
        }
        colours
    };
    let light = of(|rule| !rule.starts_with(" (") && !rule.starts_with(" print"));
    let over = |own: BTreeMap<String, [f64; 3]>| light.clone().into_iter().chain(own).collect();
    let dark = of(|rule| rule.starts_with(" (prefers-color-scheme: dark)"));
    assert_eq!(
        dark.len(),
        light.len(),
        "every colour has one for dark paper"
    );
    [
        light.clone(),
        over(dark),
        over(of(|rule| rule.starts_with(" print"))),
    ]
}

fn rgb(colour: &str) -> [f64; 3] {
    let part = |i: usize| {
        f64::from(u8::from_str_radix(&colour[2 * i..2 * i + 2], 16).expect("hexadecimal"))
    };
    [part(0), part(1), part(2)]
}

/// Contrast of two colours by WCAG 2: 1 for the same, 21 for black on white.
fn contrast(a: [f64; 3], b: [f64; 3]) -> f64 {
    let linear = |part: f64| {
        let part = part / 255.0;
        if part <= 0.040_45 {
            part / 12.92
        } else {
            ((part + 0.055) / 1.055).powf(2.4)
        }
    };
    let luminance =
        |[r, g, b]: [f64; 3]| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
    a.max(b) / a.min(b)
}

#[test]
fn texts_and_marks_stand_out_in_every_colour_mode() {
    assert!((contrast(rgb("000000"), rgb("ffffff")) - 21.0).abs() < 1e-9);
    let [light, dark, print] = modes();
    assert!(
        contrast(light["paper"], dark["paper"]) > 10.0,
        "the modes are told apart"
    );
    for (mode, colours) in [("light", light), ("dark", dark), ("print", print)] {
        for name in [
            "text",
            "muted",
            "limit",
            "met",
            "not-met",
            "not-shown",
            "c0",
            "c1",
            "c2",
            "c3",
            "c4",
            "c5",
        ] {
            for paper in ["paper", "wash"] {
                let found = contrast(colours[name], colours[paper]);
                assert!(found >= 4.5, "{mode}: {name} on {paper}: {found:.2}");
            }
        }
    }
}
