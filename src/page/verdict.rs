//! The head of the page: the verdict as text for an operator, and the figures that it rests on.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::grid::Verdict;
use crate::io::table::Word as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::io::tables::grid_steps::StepRow;
use crate::report::verdict::{self, Judge};
use crate::report::{Model, Moment, Split};

pub(super) fn header(content: &Content) -> Markup {
    let (class, headline) = headline(&content.verdict);
    let chosen = content.steps.iter().find(|step| step.chosen);
    html! {
        header {
            p.which { (content.robot) " · " (content.session) }
            h1 { span class={ "mark " (class) } aria-hidden="true" { (sign(&content.verdict)) } " " (headline) }
            p.lead { (sentence(content, chosen)) }
            (judges(&content.judges))
            @for warning in &content.warnings { p.warning { "Too much rejected: " (warning) } }
            @if let Some(step) = chosen { (facts(content, step)) }
            p.note {
                "Chosen: " (content.choice) ". The error left after the table is predicted, from stations that took no part; "
                "it is measured only in a session that this table drives."
            }
        }
    }
}

/// The judges, where a test session is one of them, with remarks on each.
fn judges(judges: &[Judge]) -> Markup {
    html! {
        @if judges.len() > 1 {
            p { "The verdict is the worst of:" }
            ul {
                @for judge in judges {
                    li { (judge.stations.words()) ": " strong { (verdict::word(&judge.verdict)) } ". " (judge.words) }
                }
            }
        }
        @for remark in judges.iter().filter_map(|judge| Some((&judge.stations, judge.remark.as_ref()?))) {
            p.warning { (remark.0.words()) ": " (remark.1) }
        }
    }
}

const fn headline(verdict: &Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::Meets => ("met", "Tolerance met"),
        Verdict::DoesNotMeet => ("not-met", "Tolerance not met"),
        Verdict::NotShown(_) => ("not-shown", "Not shown to meet the tolerance"),
    }
}

/// The sign distinguishes the verdicts without colour too.
const fn sign(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Meets => "✓",
        Verdict::DoesNotMeet => "✗",
        Verdict::NotShown(_) => "?",
    }
}

fn sentence(content: &Content, chosen: Option<&StepRow>) -> Markup {
    let tolerance = &content.tolerance;
    let bound = chosen.and_then(|step| step.bound_mm.zip(step.expanded_uncertainty_mm));
    let step = chosen.map(|step| step.step_mm);
    match (&content.verdict, bound, step) {
        (Verdict::DoesNotMeet, _, _) if decided_by_a_session(content) => html! {
            "Held-out blocks meet it, but another session does not show that " (words::percent(tolerance.share))
            " % of positions come within " (tolerance.mm) " mm: the correction does not hold there."
        },
        (Verdict::NotShown(reason), _, _) => html! {
            "Whether " (words::percent(tolerance.share)) " % of positions come within " (tolerance.mm)
            " mm is not known: " (reason) "."
        },
        (verdict, Some((bound, uncertainty)), Some(step)) => html! {
            "Corrected by the table of " (step) " mm steps, at least " (words::percent(tolerance.share))
            " % of positions come within " strong { (words::fixed(bound, 3)) " mm" } " (with "
            (words::percent(tolerance.confidence)) " % confidence). With the measurement's own uncertainty of "
            (words::fixed(uncertainty, 3)) " mm that is " (words::fixed(bound + uncertainty, 3)) " mm, "
            @if *verdict == Verdict::Meets { "within" } @else { "more than" }
            " the tolerance of " (tolerance.mm) " mm."
        },
        _ => html! { (content.choice) "." },
    }
}

/// Whether a test session makes the verdict worse than that of held-out blocks, which come first.
fn decided_by_a_session(content: &Content) -> bool {
    let blocks = content.judges.first();
    blocks.is_some_and(|blocks| blocks.verdict == Verdict::Meets)
}

/// The figures that the verdict rests on.
fn facts(content: &Content, step: &StepRow) -> Markup {
    let tolerance = &content.tolerance;
    let (nodes, judged) = (step.nodes.unwrap_or(0) as u64, step.held_out as u64);
    let bound = format!("Bound on {} % of errors", words::percent(tolerance.share));
    html! {
        dl.facts {
            (fact("Step of the table", &html! { (step.step_mm) " mm" }, &html! { (words::whole(nodes)) " nodes, " (step.source.word()) ", " (step.interpolation.word()) }))
            (fact(&bound, &mm(step.bound_mm), &html! { (words::percent(tolerance.confidence)) " % confidence" }))
            (fact("Tolerance", &html! { (tolerance.mm) " mm" }, &html! {
                @if let Some(u) = step.expanded_uncertainty_mm { "guarded by U = " (words::fixed(u, 3)) " mm" }
            }))
            (fact("Mean error", &mm(step.mean_mm), &html! {
                @if let Some((mean, n)) = before(content) { "before: " (words::fixed(mean, 3)) " mm on " (n) " stations" }
            }))
            (fact("Answers for", &html! { (percent(step.like_covered_share)) }, &html! {
                "of the measured stations of its orientation and configuration, " (percent(step.stations_covered_share)) " of all, "
                (percent(step.box_covered_share)) " of the box"
            }))
            (fact("Judged on", &html! { (words::whole(judged)) }, &html! {
                "held-out poses" @if step.visits > step.held_out { " in " (words::whole(step.visits as u64)) " visits" } @if let Some(blocks) = step.blocks { " in " (blocks) " blocks" }
            }))
        }
    }
}

pub(super) fn fact(name: &str, value: &Markup, beside: &Markup) -> Markup {
    html! { div { dt { (name) } dd { (value) small { (beside) } } } }
}

/// A share in percent.
fn percent(share: Option<f64>) -> Markup {
    html! { @match share { Some(share) => { (words::number(100.0 * share, 1)) " %" }, None => "–" } }
}

pub(super) fn mm(value: Option<f64>) -> Markup {
    html! { @match value { Some(value) => { (words::number(value, 3)) " mm" }, None => "not shown" } }
}

/// The mean error before, base and target fitted, on all held-out stations of the table's session, and their number.
fn before(content: &Content) -> Option<(f64, usize)> {
    let figures = || content.figures.iter();
    let of_table = (Model::Table, Split::Blocks, Moment::After);
    let table = figures().find(|f| (f.model, f.split, f.evidence) == of_table)?;
    let alike = |own: &AccuracyRow| own.split == table.split && own.of_session == table.of_session;
    let is_mean =
        |own: &AccuracyRow| (own.model, own.name) == (Model::BaseTarget, FigureName::Mean);
    let before = figures().find(|f| is_mean(f) && alike(f))?;
    Some((before.value?, before.n))
}
