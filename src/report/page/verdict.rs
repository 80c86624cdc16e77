//! The head of the page: the verdict in words that an operator reads, and the figures it rests on.

use maud::{Markup, html};

use super::content::{Content, Step};
use super::words;
use crate::grid::Verdict;

pub(super) fn header(content: &Content) -> Markup {
    let (class, headline) = headline(&content.verdict);
    let chosen = content.steps.iter().find(|step| step.chosen);
    html! {
        header {
            p.which { (content.robot) " · " (content.session) }
            h1 { span class={ "mark " (class) } aria-hidden="true" { (sign(&content.verdict)) } " " (headline) }
            p.lead { (sentence(content, chosen)) }
            @for warning in &content.warnings { p.warning { "Too much rejected: " (warning) } }
            @if let Some(step) = chosen { (facts(content, step)) }
            p.note {
                "Chosen: " (content.choice) ". What is left after the table is predicted, from stations that took no part; "
                "it is measured only once a session driven by this table is."
            }
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

/// Told apart without colour too.
const fn sign(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Meets => "✓",
        Verdict::DoesNotMeet => "✗",
        Verdict::NotShown(_) => "?",
    }
}

fn sentence(content: &Content, chosen: Option<&Step>) -> Markup {
    let tolerance = &content.tolerance;
    let bound = chosen.and_then(|step| step.bound_mm.zip(step.uncertainty_mm));
    let step = chosen.map(|step| words::fixed(step.step_mm, 0));
    match (&content.verdict, bound, step) {
        (Verdict::NotShown(reason), _, _) => html! {
            "Whether " (words::percent(tolerance.share)) " % of positions come within " (tolerance.mm)
            " mm cannot be said: " (reason) "."
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

fn facts(content: &Content, step: &Step) -> Markup {
    let source = if step.source == "model" {
        "model"
    } else {
        "measured"
    };
    let nodes = step.nodes.unwrap_or(0).unsigned_abs();
    let judged = step.held_out.unsigned_abs();
    html! {
        dl.facts {
            div { dt { "Step of the table" } dd { (words::number(step.step_mm, 0)) " mm" small { (words::whole(nodes)) " nodes, " (source) ", " (step.interpolation) } } }
            div { dt { "Bound on " (words::percent(content.tolerance.share)) " % of errors" } dd { @match step.bound_mm {
                Some(bound) => { (words::number(bound, 3)) " mm" small { (words::percent(content.tolerance.confidence)) " % confidence" } },
                None => { "not shown" small { "too few stations" } },
            } } }
            div { dt { "Tolerance" } dd { (content.tolerance.mm) " mm" @if let Some(u) = step.uncertainty_mm { small { "guarded by U = " (words::fixed(u, 3)) " mm" } } } }
            div { dt { "Mean error" } dd { (words::optional(step.mean_mm, 3)) @if step.mean_mm.is_some() { " mm" } small { @match before_mm(content) {
                Some(before) => { "before: " (words::fixed(before, 3)) " mm" }, None => "predicted",
            } } } }
            div { dt { "Judged on" } dd { (words::whole(judged)) small { "held-out stations" @if let Some(blocks) = step.blocks { " in " (blocks) " blocks" } } } }
        }
    }
}

/// The mean error before, base and target fitted, on the stations that the table was judged among.
fn before_mm(content: &Content) -> Option<f64> {
    let of_table = content
        .figures
        .iter()
        .find(|figure| figure.subject.model == "table")?;
    let alike = content.figures.iter().filter(|figure| {
        let own = &figure.subject;
        own.model == "base_target"
            && own.split == of_table.subject.split
            && own.of_session == of_table.subject.of_session
    });
    alike
        .filter(|figure| figure.name == "mean")
        .find_map(|figure| figure.value)
}
