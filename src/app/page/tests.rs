//! The page of a small run, with names that would break a page that does not escape them.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use roxmltree::{Document, ParsingOptions};

use super::content::{Content, Session, Statements};
use super::html;
use super::shell::STYLE;
use crate::compensation::Conditions;
use crate::figures::Counted;
use crate::fit::Identifiability;
use crate::grid::{Interpolation, Judgement, Source, Tolerance, Verdict};
use crate::io::export::acceptance::AcceptanceRows;
use crate::io::tables::accuracy::{AccuracyRow, BeforeAfter, FigureKind, FigureName};
use crate::io::tables::calibrations::{ArmColumns, CalibrationRow, FitColumns, LossName};
use crate::io::tables::clocks::ClockRow;
use crate::io::tables::error_frame::{ErrorFrameColumns, ErrorFrameName};
use crate::io::tables::grid_steps::StepRow;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::parameters::{BelongsTo, ParameterQuantity, ParameterRow};
use crate::io::tables::rejects::{RejectKind, RejectRow, Stage};
use crate::io::tables::runs::{Ending, RunRow};
use crate::io::tables::semivariograms::{self, SemivariogramRow};
use crate::io::tables::stations::{PairingVerdict, Unpaired};
use crate::io::tables::validity::ValidFor;
use crate::io::tables::words::{Role, TableVerdict, Unit};
use crate::join::Unmeasured;
use crate::kinematics::Convention;
use crate::manifest::{Input, RunKey, StageCount, Work, Written};
use crate::report::compared::{Compared, ErrorPair, Pairs};
use crate::report::frame::StatedFrame;
use crate::report::iso_9283::Characteristic;
use crate::report::next::{Next, Stated};
use crate::report::verdict::{Applied, Judge, Judging, ProductVerdict, Remark, RunVerdict};
use crate::report::{Accuracy, Angles, BaseRefit, Model, Moment, Point, Split, Subject, chart};
use crate::similarity::{Alikeness, Bin, Quantity, Semivariogram, Shape, Space, VariogramModel};

/// Markup, quotes of both kinds, an entity, a comment's end, a line's end, a terminal's escape, and a mark that changes the
/// direction of text: `gpj.exe` would read `exe.jpg`.
pub(super) const HOSTILE: &str = "</title><script>alert('1')</script>\"><img src=x onerror=\"a\">&lt;-->\n\u{1b}[2J\u{202e}gpj.exe";

fn figure(
    model: Model,
    name: FigureName,
    of: &str,
    value: f64,
    quantity: FigureKind,
) -> AccuracyRow {
    AccuracyRow {
        subject: Subject {
            split: Split::Blocks,
            of_session: of.to_owned(),
            model,
            angles: Angles::Commanded,
            base_refit: BaseRefit::None,
        },
        role: Role::HeldOut,
        evidence: Moment::After,
        moment: BeforeAfter::After,
        point: Point::Tool,
        quantity,
        name,
        session_started: None,
        pose: None,
        value: Some(value),
        unit: Unit::Mm,
        expanded_uncertainty: None,
        coverage_factor: None,
        n: 80,
        visits: Some(240),
        base_stations: None,
        target_found: None,
        blocks: Some(8),
        n_needed: Some(59),
        share: None,
        confidence: None,
        tolerance: None,
        verdict: Some(TableVerdict::Met),
        reason: Some(of.to_owned()),
        table_id: None,
    }
}

fn step(step_mm: f64, chosen: bool, name: &str) -> StepRow {
    StepRow {
        source: Source::Model,
        interpolation: Interpolation::Trilinear,
        idw_power: None,
        model: Some(Model::Full),
        angles: Angles::Commanded,
        judgement: Judgement::Table,
        split: Split::Blocks,
        of_session: name.to_owned(),
        orientation: Some(0),
        configuration: None,
        step_mm,
        pitch_mm: Some([step_mm; 3]),
        nodes: Some(1200),
        nodes_refused: Some(0),
        cells: 900,
        cells_singular: 0,
        cells_mixed: 0,
        cells_unreachable: 0,
        phases: None,
        held_out: 80,
        visits: 240,
        errors: 80,
        held_out_refused: 0,
        held_out_outside: 0,
        held_out_unlike: 0,
        stations_covered: Some(240),
        stations_covered_share: Some(0.96),
        like_covered_share: Some(1.0),
        box_covered_share: Some(0.875),
        interpolation_shown_share: Some(0.25),
        blocks: Some(8),
        mean_mm: Some(0.101_25),
        rms_mm: None,
        p95_mm: Some(0.15),
        p99_mm: None,
        max_mm: Some(0.3),
        mean_plus_3sd_mm: None,
        bound_mm: Some(0.204_75),
        bound_of_session_mm: None,
        model_bound_mm: Some(0.2),
        bound_share: 0.95,
        bound_confidence: 0.95,
        bound_rank: Some(78),
        held_out_needed: 59,
        expanded_uncertainty_mm: Some(0.03),
        tolerance_mm: Some(0.5),
        verdict: if chosen { TableVerdict::Met } else { TableVerdict::NotShown },
        reason: Some(name.to_owned()),
        chosen,
        choice_within: chosen.then(|| format!("near the model {name}")),
        choice_fewest_nodes: None,
        excess_mm: None,
        excess_se_mm: None,
    }
}

fn variograms() -> Vec<SemivariogramRow> {
    let found = Semivariogram {
        space: Space::Joint,
        quantity: Quantity::Norm,
        bins: [1.0, 2.0].map(bin).into(),
        models: vec![VariogramModel {
            shape: Shape::Spherical,
            nugget: 0.01,
            sill: 0.3,
            range: 2.0,
            misfit: 0.0,
        }],
        alikeness: Alikeness::Rising,
    };
    semivariograms::rows(&[(Model::Full, vec![found])], Some(0.001))
}

fn bin(separation: f64) -> Bin {
    Bin {
        from: separation - 0.5,
        to: separation + 0.5,
        separation,
        pairs: 30,
        gamma: 0.1 * separation,
    }
}

fn joint_errors(name: &str) -> Vec<JointErrorRow> {
    let at = |degree: i32| JointErrorRow {
        joint: 1,
        joint_name: name.into(),
        joint_unit: None,
        angle_rad: f64::from(degree).to_radians(),
        error_rad: 1e-4 * f64::from(degree).sin(),
        sd_rad: 5e-5,
        curve_rad: 1e-4 * f64::from(degree).sin(),
        gear_lines_rad: 0.0,
        measured: (10..50).contains(&degree),
    };
    (0..60).map(at).collect()
}

fn session(name: &str) -> Session {
    Session {
        name: name.to_owned(),
        trained: true,
        clock: ClockRow {
            origin_ns: 0,
            offset_ns: 2e9,
            offset_se_ns: 1e6,
            drift_ppm: -12.0,
            drift_se_ppm: 0.5,
            matched_edges: 160,
            edge_rms_ns: 2e6,
            method: name.to_owned(),
        },
        dwells: vec![
            (PairingVerdict::Paired, None, 80),
            (PairingVerdict::Unmeasured, Some(Unpaired::Unmeasured(Unmeasured::NoReadings)), 2),
        ],
        rejects: vec![RejectRow {
            reject: 0,
            stage: Stage::Ingest,
            kind: RejectKind::Messages,
            number: 1,
            code: None,
            reason: name.to_owned(),
            file: None,
            topic: None,
            byte_start: None,
            byte_end: None,
            clock: None,
            start_ns: None,
            end_ns: None,
            station: None,
            line: None,
            column: None,
        }],
    }
}

fn parameter(name: &str) -> ParameterRow {
    ParameterRow {
        model: Model::Full,
        parameter_index: 0,
        parameter: name.to_owned(),
        belongs_to: BelongsTo::Link,
        of_session: Some(name.to_owned()),
        joint: Some(1),
        quantity: ParameterQuantity::Theta,
        unit: Unit::Rad,
        nominal: 0.0,
        offset: 1e-4,
        identified: 1e-4,
        standard_error: Some(1e-5),
        prior_sd: None,
        identifiability: Identifiability::Weak,
        confounded_with: vec![name.to_owned()],
        most_correlated_with: None,
        correlation: None,
    }
}

fn calibration(name: &str) -> CalibrationRow {
    CalibrationRow {
        model_kind: Model::Geometric,
        parts: Vec::new(),
        parts_dropped: Vec::new(),
        parts_tried: vec![name.to_owned()],
        parts_gain_nat: vec![-2.0],
        angles: Angles::Reported,
        stations: 80,
        stations_downweighted: 1,
        parameters: 36,
        fit: FitColumns {
            rank: Some(27),
            condition: Some(20_000.0),
            variance_factor: Some(40.0),
            misfit_mm: Some(0.2),
            converged: Some(true),
            convergence: name.to_owned(),
            iterations: Some(7),
            ..FitColumns::default()
        },
        loss: LossName::Squares,
        tracker_from_base: None,
        tracker_from_base_turn: None,
        flange_from_target: None,
        flange_from_target_turn: None,
        verdict: TableVerdict::Met,
        reason: None,
        model: String::new(),
        of_arm: of_arm(name),
    }
}

fn of_arm(name: &str) -> ArmColumns {
    ArmColumns {
        arm_model: name.to_owned(),
        convention: Convention::StandardDh,
        parallel_joints: Vec::new(),
        sessions: vec![name.to_owned()],
        observations: 240,
        camera_size: Some(1.31),
        camera_size_se: Some(0.04),
        prior_length_mm: None,
        prior_angle_rad: None,
        flange_from_tool: Isometry3::identity(),
        error_frame_target: [0.0; 3],
        configurations: Vec::new(),
        model_version: 3,
        valid_for: ValidFor {
            joint_names: vec![name.to_owned()],
            joint_units: None,
            command_from_base: Isometry3::identity(),
            error_frame: ErrorFrameColumns {
                error_frame: ErrorFrameName::Fitted,
                error_frame_base: Isometry3::identity(),
                error_frame_sd_mm: None,
                error_frame_sd_deg: None,
                error_frame_lever_sd_mm: None,
            },
            largest_error_mm: Some(2.0),
            joint_lower_rad: vec![-1.0],
            joint_upper_rad: vec![1.0],
            tool_is_target: Some(false),
            conditions: Conditions { tool: Some(name.to_owned()), ..Conditions::default() },
            temperature_min_c: None,
            temperature_max_c: None,
        },
    }
}

/// A table with one judge, whose texts are `name`.
fn verdict(name: &str, verdict: Verdict) -> RunVerdict {
    let figure = Accuracy {
        subject: Subject {
            split: Split::Session,
            of_session: name.to_owned(),
            model: Model::Table,
            angles: Angles::Commanded,
            base_refit: BaseRefit::First,
        },
        point: Point::Tool,
        moment: Moment::After,
        driven_by: None,
        figures: None,
        bound: Some(0.25),
        counted: Counted::once(100),
        finders: None,
        blocks: None,
        coverage: None,
        expanded_uncertainty_mm: 0.05,
        verdict: verdict.clone(),
    };
    let judge = Judge {
        stations: Judging::Session(name.to_owned()),
        verdict,
        words: name.to_owned(),
        remark: Some(Remark::OtherArm(name.to_owned())),
        harms: false,
        figure: Some(figure),
        covered: None,
    };
    RunVerdict::of(ProductVerdict::of(vec![judge]), Vec::new(), Model::Full)
}

fn compared(name: &str) -> Compared {
    let pair = |station: u32| {
        let t = f64::from(station);
        ErrorPair {
            station: station as usize,
            at: [100.0 * t.sin(), 80.0 * t.cos(), 5.0 * t].into(),
            before: [0.5, 0.5 * t.sin(), 0.0].into(),
            after: [0.05, 0.0, 0.0].into(),
        }
    };
    Compared {
        is_measured: false,
        before: name.to_owned(),
        after: name.to_owned(),
        frame: name.to_owned(),
        stations: name.to_owned(),
        errors: (0..80).map(pair).collect(),
    }
}

/// A run in which every text that comes from logs or settings is `name`.
fn content(name: &str) -> Content {
    let text = || name.to_owned();
    Content {
        key: RunKey::new(name, name, "00ff"),
        tolerance: Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 },
        verdict: verdict(name, Verdict::Meets),
        frame: StatedFrame {
            is_surveyed: false,
            tracker_from_base: nalgebra::Isometry3::identity(),
            sd_mm: Some(0.1),
            sd_deg: Some(0.01),
            lever_sd_mm: None,
            open_mm: None,
        },
        next: Next {
            by: Applied::Table,
            stated: Stated::Joints,
            first: "",
            sets_base: true,
            instead: None,
        },
        over_time: Some("a%20b.html".to_owned()),
        command: Some(format!("posegrid compensate lake/{name}")),
        bounds: Some([[-100.0, -80.0, 0.0], [100.0, 80.0, 400.0]]),
        choice: text(),
        said: Statements {
            warnings: vec![text()],
            notes: vec![text()],
            measured: Some(text()),
            instruments: vec![("Arm", text())],
            pairs: Pairs { predicted: Some(compared(name)), ..Pairs::default() },
            table_state: Some(text()),
            ..Statements::default()
        },
        steps: vec![step(100.0, true, name), step(200.0, false, name)],
        tip: Vec::new(),
        figures: vec![
            figure(Model::BaseTarget, FigureName::Mean, name, 0.512_375, FigureKind::PositionError),
            figure(Model::Full, FigureName::Bound, name, 0.204_75, FigureKind::PositionError),
            figure(
                Model::Full,
                FigureName::Iso(Characteristic::ApP),
                name,
                0.083_125,
                FigureKind::Iso9283,
            ),
        ],
        semivariograms: variograms(),
        joint_errors: joint_errors(name),
        parameters: vec![parameter(name)],
        calibrations: vec![calibration(name)],
        sessions: vec![session(name)],
        counts: vec![StageCount {
            stage: "join",
            of: "readings",
            read: 10,
            kept: 8,
            rejected: BTreeMap::from([(text(), 2)]),
        }],
        work: work(name),
        written: vec![written(name)],
    }
}

fn acceptance_rows(name: &str) -> AcceptanceRows {
    let Content { key, figures, work, written, .. } = content(name);
    let texts = || vec![name.to_owned()];
    let ending = Ending {
        statement: Some(name.to_owned()),
        warnings: Some(texts()),
        bound_mm: Some(0.204_75),
        ..Ending::default()
    };
    AcceptanceRows {
        key,
        run: RunRow {
            pipeline: name.to_owned(),
            made: (&work).into(),
            sessions: texts(),
            test_sessions: texts(),
            inputs: work.inputs[..].into(),
            counts: String::new(),
            files: written[..].into(),
            ending,
            row_digest: None,
        },
        accuracy: figures,
        arm: of_arm(name),
    }
}

#[test]
fn names_of_any_kind_and_length_give_an_acceptance_report_that_is_the_same_again() {
    for name in [HOSTILE, "", &"臂 ".repeat(5000)] {
        let pdf = super::acceptance::pdf(&acceptance_rows(name)).expect("a PDF");
        assert_eq!(pdf, super::acceptance::pdf(&acceptance_rows(name)).expect("a PDF"));
    }
}

pub(super) fn work(name: &str) -> Work {
    let text = || name.to_owned();
    Work {
        robot: text(),
        session: text(),
        pipeline: text(),
        sessions: Vec::new(),
        test_sessions: Vec::new(),
        inputs: vec![Input { name: text(), bytes: 12_345, digest: "af13".to_owned() }],
        settings: text(),
    }
}

pub(super) fn written(name: &str) -> Written {
    let text = || name.to_owned();
    Written { table: text(), session: text(), rows: 80, digest: "b2c4".to_owned() }
}

/// Parses the page as XML; it is well-formed because every element is closed and every value escaped.
pub(super) fn parsed(page: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(page, options).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_section_is_there_once_in_order() {
    let page = html(&content("mon"));
    let document = parsed(&page);
    let sections = document.descendants().filter(|node| node.has_tag_name("section"));
    let ids: Vec<_> = sections.filter_map(|section| section.attribute("id")).collect();
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
    assert_eq!(page, html(&content("mon")), "the same content gives the same bytes");
}

/// A hostile name is text and nothing else: the page has the elements of one with a plain name.
pub(super) fn assert_text_alone(page: &str, plain: &str) {
    let elements = |page: &str| -> BTreeMap<String, usize> {
        let mut count = BTreeMap::new();
        for node in parsed(page).descendants().filter(roxmltree::Node::is_element) {
            *count.entry(node.tag_name().name().to_owned()).or_default() += 1;
        }
        count
    };
    assert_eq!(elements(page), elements(plain), "a name made an element of its own");
    assert!(!page.contains(['\u{202e}', '\u{1b}']), "what a reader does not see is written out");
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
    assert!(shown.starts_with("</title><script>alert('1')</script>\"><img src=x"), "{shown}");
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
        verdict: verdict("9 held-out stations; 59 are needed", Verdict::NotShown(String::new())),
        said: Statements {
            pairs: Pairs::default(),
            measured: None,
            instruments: Vec::new(),
            ..whole.said
        },
        bounds: None,
        steps: Vec::new(),
        figures: Vec::new(),
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
        for rule in [chart::STYLE, STYLE].iter().flat_map(|style| style.split("@media")) {
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
    assert_eq!(dark.len(), light.len(), "every colour has one for dark paper");
    [light.clone(), over(dark), over(of(|rule| rule.starts_with(" print")))]
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
        if part <= 0.040_45 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
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
    assert!(contrast(light["paper"], dark["paper"]) > 10.0, "the modes are distinguished");
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
