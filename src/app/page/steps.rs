//! Error against step: the errors that each step leaves on held-out stations, its bound, and the chosen step.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::grid::{Judgement, Source};
use crate::io::rows::Word as _;
use crate::io::tables::grid_steps::StepRow;
use crate::io::tables::words::TableVerdict;
use crate::report::Split;
use crate::report::chart::{Axis, Chart, Marks, Series};

pub(super) fn section(content: &Content) -> Option<Markup> {
    if content.steps.is_empty() {
        return None;
    }
    let Some(chosen) = content.steps.iter().find(|step| step.chosen) else {
        return Some(no_table(content));
    };
    let is_table = |step: &&StepRow| step.judgement == Judgement::Table;
    let by_blocks = |step: &&StepRow| step.split == Split::Blocks;
    let (blocks, sessions): (Vec<&StepRow>, Vec<&StepRow>) =
        content.steps.iter().partition(by_blocks);
    let (tables, cells): (Vec<&StepRow>, Vec<&StepRow>) = blocks.into_iter().partition(is_table);
    let own: Vec<&StepRow> = tables.iter().copied().filter(|step| is_alike(step, chosen)).collect();
    Some(html! {
        p {
            "Each step's table is judged on stations that took no part in it, at their own places and at a random place of a cell each: the "
            "larger bound counts, for stations on nodes show no interpolation. Nodes of the model cost nothing and cover the whole box: of them "
            "the largest step is taken whose bound is hardly above that of the model itself. Measured nodes cost a measurement each: of them the "
            "largest step that holds, which is that bound and measurement uncertainty together are within the tolerance, for it and all smaller "
            "ones. The chosen one has the verdict of the table, which a test session can make worse. Visits of one pose count once, with the worst."
        }
        (choices(content))
        div.pair.wide {
            figure { (chart(content, chosen)) figcaption { (caption(content, chosen)) } }
            div {
                (own_rows(&own))
                p.note { "Covers: share of the stations of its orientation and configuration / share of the box. Interpolation shown: 0 where the "
                    "stations lie on nodes, 100 where they lie anywhere in the cells; the mean is of these places, the bound the larger one." }
                @for reason in reasons(&own) { p.note { "Not shown, nodes " (reason) "." } }
            }
        }
        @if !sessions.is_empty() {
            p { "The chosen table compared with test sessions, at those of their poses that it covers:" }
            (session_rows(&sessions))
        }
        details {
            summary { "Every source of node values and every interpolation" }
            (all_rows(&tables))
            @for reason in reasons(&tables) { p.note { "Not shown, nodes " (reason) "." } }
        }
        @if !cells.is_empty() {
            details {
                summary { "Local cells: a grid cell of its own around each held-out station" }
                p.note { "The stations that the table is for, each at a random place of a cell: it shows what interpolation adds where they lie on "
                    "nodes of the table. Where these are too few for a bound, all stations, each at its own orientation, to choose a step." }
                (all_rows(&cells))
            }
        }
    })
}

/// All steps with the reasons why none gives a table.
fn no_table(content: &Content) -> Markup {
    let steps: Vec<&StepRow> = content.steps.iter().collect();
    html! {
        p { "No step gives a table: targets are corrected by the identified arm alone." }
        (all_rows(&steps))
        @for reason in reasons(&steps) { p.note { "Not shown, nodes " (reason) "." } }
    }
}

fn choices(content: &Content) -> Markup {
    let why = |of: fn(&StepRow) -> Option<&String>| content.steps.iter().find_map(of);
    html! {
        ul {
            @if let Some(words) = why(|step| step.choice_within.as_ref()) {
                li { "Nearest to the model (rule " code { "within" } "): " (words) "." }
            }
            @if let Some(words) = why(|step| step.choice_fewest_nodes.as_ref()) {
                li { "Fewest nodes (rule " code { "fewest-nodes" } "): " (words) "." }
            }
        }
    }
}

/// The pitches of a step where they are not the step itself.
fn pitches(step: &StepRow) -> Markup {
    let differs = |mm: &f64| (mm - step.step_mm).abs() > 1e-6 * step.step_mm;
    html! {
        @if let Some(pitch) = step.pitch_mm.filter(|pitch| pitch.iter().any(differs)) {
            small { (pitch.map(|mm| words::fixed(mm, 1)).join(" × ")) }
        }
    }
}

/// The share of the stations like it that a table covers, and that of the box.
fn covers(step: &StepRow) -> Markup {
    html! { (percent(step.like_covered_share, 1)) " / " (percent(step.box_covered_share, 1)) }
}

fn percent(share: Option<f64>, digits: usize) -> Markup {
    words::optional(share.map(|share| 100.0 * share), digits)
}

fn is_alike(step: &StepRow, other: &StepRow) -> bool {
    (step.source, step.interpolation) == (other.source, other.interpolation)
}

/// The chosen table judged by test sessions.
fn session_rows(steps: &[&StepRow]) -> Markup {
    let head = html! { th.word { "Test session" } th.word { "Verdict" } th { "Judged on" } th { "Mean" } th { "p95" } th { "Max" } th { "Bound" } };
    let body = html! {
        @for step in steps {
            tr {
                th.word scope="row" { (step.of_session) }
                td.word { (words::verdict(step.verdict)) }
                td { (judged_on(step)) }
                (norms([step.mean_mm, step.p95_mm, step.max_mm, step.bound_mm]))
            }
        }
    };
    super::table(&head, &body)
}

/// Cells of error norms, mm.
fn norms<const N: usize>(mm: [Option<f64>; N]) -> Markup {
    html! { @for own in mm { td { (words::optional(own, 3)) } } }
}

/// The number of poses that judged, and of their visits where these are more.
fn judged_on(step: &StepRow) -> Markup {
    html! { (step.held_out) @if step.visits > step.held_out { small { (step.visits) " visits" } } }
}

fn own_rows(steps: &[&StepRow]) -> Markup {
    let head = html! { th { "Step, mm" } th.word { "Verdict" } th { "Bound" } th { "Mean" } th { "Nodes" } th { "Covers, %" } th { "Judged on" } th { "Interpolation shown, %" } };
    let body = html! {
        @for step in steps {
            tr.chosen[step.chosen] {
                th scope="row" { (step.step_mm) (pitches(step)) @if step.chosen { small { "chosen" } } }
                td.word { (words::verdict(step.verdict)) }
                (norms([step.bound_mm, step.mean_mm]))
                td { (words::whole(step.nodes.unwrap_or(0) as u64)) }
                td { (covers(step)) }
                td { (judged_on(step)) }
                td { (percent(step.interpolation_shown_share, 0)) }
            }
        }
    };
    super::table(&head, &body)
}

fn all_rows(steps: &[&StepRow]) -> Markup {
    let head = html! {
        th { "Step, mm" } th.word { "Verdict" } th.word { "Node values" } th.word { "Inside a cell" } th { "Nodes" } th { "Covers, % of stations / box" }
        th { "Judged on" } th { "Mean" } th { "p95" } th { "Max" } th { "Bound" } th { "Model's own" }
    };
    let body = html! {
        @for step in steps {
            tr.chosen[step.chosen] {
                th scope="row" { (step.step_mm) (pitches(step)) }
                td.word { @if step.judgement == Judgement::Table { (words::verdict(step.verdict)) } @else { "–" } }
                td.word { (step.source.word()) }
                td.word { (words::inside(step.interpolation)) }
                td { (words::whole(step.nodes.unwrap_or(0) as u64)) }
                td { (covers(step)) }
                td { (judged_on(step)) }
                (norms([step.mean_mm, step.p95_mm, step.max_mm, step.bound_mm, step.model_bound_mm]))
            }
        }
    };
    super::table(&head, &body)
}

/// The reasons why steps are not shown, each once.
fn reasons(steps: &[&StepRow]) -> Vec<String> {
    let not_shown = steps.iter().filter(|step| step.verdict == TableVerdict::NotShown);
    let reason = |step: &&StepRow| {
        let reason = step.reason.as_deref()?;
        // The number of poses of each step is in the table already.
        let needed = reason.split_once(" held out; ").map(|(_, needed)| needed);
        let reason = needed.map_or_else(
            || reason.to_owned(),
            |needed| format!("too few held-out poses; {needed}"),
        );
        Some(format!("{}: {reason}", step.source.word()))
    };
    let mut reasons: Vec<String> = not_shown.filter_map(reason).collect();
    reasons.sort();
    reasons.dedup();
    reasons
}

/// Whether any step of the published kind has figures; if none, local cells are drawn.
fn judgement(content: &Content) -> Judgement {
    let shown = |step: &StepRow| {
        (step.judgement, step.split) == (Judgement::Table, Split::Blocks) && step.mean_mm.is_some()
    };
    if content.steps.iter().any(shown) { Judgement::Table } else { Judgement::LocalCell }
}

fn chart(content: &Content, chosen: &StepRow) -> Markup {
    let of_blocks = content.steps.iter().filter(|step| step.split == Split::Blocks);
    let drawn = of_blocks.filter(|step| step.judgement == judgement(content));
    let (own, others): (Vec<&StepRow>, Vec<_>) = drawn.partition(|step| is_alike(step, chosen));
    let is_chosen = |step: &StepRow| (step.step_mm - chosen.step_mm).abs() < 1e-9;
    let at = points(&own, |step| step.bound_mm.or(step.mean_mm).filter(|_| is_chosen(step)));
    let mut series = own_series(&own, chosen.expanded_uncertainty_mm.unwrap_or(0.0));
    series.extend(other_bounds(&others));
    series.push(Series::new("chosen", vec![Marks::Rings(at)]));
    Chart {
        title: "Error against step".to_owned(),
        description: caption(content, chosen),
        x: Axis::new("step", "mm").including(&[0.0]),
        y: Axis::new("error norm left on held-out stations", "mm").including(&[0.0]),
        series,
        limits: vec![words::tolerance(content.tolerance.mm)],
    }
    .svg()
}

fn points(steps: &[&StepRow], value: impl Fn(&StepRow) -> Option<f64>) -> Vec<[f64; 2]> {
    let point = |step: &&StepRow| Some([step.step_mm, value(step)?]);
    let mut points: Vec<[f64; 2]> = steps.iter().filter_map(point).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    points
}

/// Bound with the uncertainty above it, 95th percentile, and the bound of the model.
fn own_series(steps: &[&StepRow], uncertainty_mm: f64) -> Vec<Series> {
    let bounds = points(steps, |step| step.bound_mm);
    let guarded = bounds.iter().map(|[x, bound]| [*x, *bound, bound + uncertainty_mm]).collect();
    let of_model = points(steps, |step| step.model_bound_mm);
    let marks = vec![Marks::Whiskers(guarded), Marks::Line(bounds.clone()), Marks::Points(bounds)];
    vec![
        Series::new("bound, with U above it", marks),
        Series::line_and_points("95th percentile", points(steps, |step| step.p95_mm)),
        Series::line_and_points("bound of the model itself", of_model),
    ]
}

/// Bounds of each source and interpolation that was not chosen.
fn other_bounds(steps: &[&StepRow]) -> Vec<Series> {
    let mut families: BTreeMap<String, Vec<&StepRow>> = BTreeMap::new();
    for step in steps {
        let name = format!("bound, {}, {}", step.source.word(), words::inside(step.interpolation));
        families.entry(name).or_default().push(step);
    }
    let bounds = |(place, (name, steps)): (usize, (String, Vec<&StepRow>))| {
        Series::line_and_points(&name, points(&steps, |step| step.bound_mm)).looking(3 + place)
    };
    families.into_iter().enumerate().map(bounds).collect()
}

fn caption(content: &Content, chosen: &StepRow) -> String {
    let of = if judgement(content) == Judgement::Table {
        "Judged by the tables themselves"
    } else {
        "Judged by local cells, as no table has a station to be judged on"
    };
    let source = if chosen.source == Source::Model { "the model" } else { "measured stations" };
    let (inside, step) = (words::inside(chosen.interpolation), chosen.step_mm);
    format!(
        "{of}. Node values from {source}, {inside} inside a cell; the chosen step is {step} mm."
    )
}
