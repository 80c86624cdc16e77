//! The head of the page: the verdict as text for an operator, and the figures that it rests on.

use maud::{Markup, html};

use super::content::Content;
use super::shell::address;
use super::words;
use crate::grid::Verdict;
use crate::io::lake::{FLEET, OVER_TIME};
use crate::io::rows::Word as _;
use crate::io::tables::grid_steps::StepRow;
use crate::report::compared::Compared;
use crate::report::verdict::{self, Applied, Judge};

pub(super) fn header(content: &Content) -> Markup {
    let verdict = content.verdict.verdict();
    let headline = words::headline((&verdict).into());
    let covered = content.verdict.table.covered();
    let is_table = content.verdict.applied == Applied::Table;
    let few = covered.filter(|own| is_table && 2 * own.stations < own.measured);
    let chosen = content.steps.iter().find(|step| step.chosen);
    html! {
        header {
            p.which { (content.key.robot) " · " (content.key.session) @if let Some(measured) = &content.said.measured { " · " (measured) } }
            @if let Some(page) = &content.over_time {
                p.note {
                    "Other nights: " a href={ "../../../" (OVER_TIME) "/" (address(page)) } { (content.key.robot) " over time" } ", "
                    a href={ "../../../" (OVER_TIME) "/" (FLEET) } { "all robots" }
                }
            }
            h1 {
                (words::mark((&verdict).into())) " " (headline) " by the " (content.verdict.applied.words())
                @if let Some(own) = few { ", which answers for " (own.stations) " of " (own.measured) " measured stations alone" }
            }
            p.lead { (sentence(content, &verdict)) }
            (warnings(&content.said.all_warnings()))
            (remarks(content.verdict.judges()))
            p class=[(!content.frame.is_surveyed).then_some("warning")] { (capital(&content.frame.words())) "." }
            (to_do(content))
            (facts(content, chosen))
            @if let Some(three) = &content.said.pairs.table_and_arm { p { (capital(&three.words())) "." } }
            @if !content.said.instruments.is_empty() {
                dl.list { @for (what, words) in &content.said.instruments { div { dt { (what) } dd { (words) } } } }
            }
            details {
                summary { "The verdict in full" }
                p { "Tolerance " (content.tolerance.mm) " mm: " strong { (words::message(&content.verdict.statement())) } "." }
                (judges(content.verdict.judges()))
                p { "Beside it: " (content.verdict.other_statement()) "." }
                p { "The step: " (content.choice) "." }
                p {
                    "What is left after a correction is predicted, from stations that took no part; it is measured only once a session is "
                    "driven by it."
                }
            }
        }
    }
}

fn warnings(all: &[String]) -> Markup {
    html! {
        @for (first, others) in words::alike(all) {
            div.warning {
                p { (words::message(first)) }
                @if !others.is_empty() {
                    details {
                        summary { (others.len()) " more like it" }
                        ul { @for own in others { li { (words::message(own)) } } }
                    }
                }
            }
        }
    }
}

/// What to do with the result, with the command to type.
fn to_do(content: &Content) -> Markup {
    html! {
        h2 { "What to do now" }
        @for (after, step) in content.next.steps().iter().rev().enumerate().rev() {
            p { (words::message(&capital(step))) @if after == 0 && content.command.is_some() { ":" } @else { "." } }
        }
        @if let Some(command) = &content.command { pre { (command) } }
        @if content.next.sets_base { (typed(content)) }
    }
}

fn typed(content: &Content) -> Markup {
    html! {
        @for (place, (what, forms)) in content.frame.to_set().into_iter().enumerate() {
            details open=[(place == 0).then_some("open")] {
                summary { (capital(what)) }
                dl.list { @for (form, typed) in forms { div { dt { (form) } dd { code { (typed) } } } } }
            }
        }
    }
}

pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// Who judges, where a test session does.
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
    }
}

/// What has to be known of those who judge: a session that the model does not fit.
fn remarks(judges: &[Judge]) -> Markup {
    html! {
        @for remark in judges.iter().filter_map(|judge| Some((&judge.stations, judge.remark.as_ref()?))) {
            p.warning { (remark.0.words()) ": " (remark.1.words()) }
        }
    }
}

/// The verdict in a sentence, by the figure that decides.
fn sentence(content: &Content, verdict: &Verdict) -> Markup {
    let tolerance = &content.tolerance;
    let headline = content.verdict.headline();
    let bound = headline.figure().and_then(|own| Some((own.bound?, own.expanded_uncertainty_mm)));
    let stations = headline.decides().map(|judge| judge.stations.words());
    match (verdict, bound) {
        (Verdict::NotShown(reason), _) => html! {
            "Whether " (words::percent(tolerance.share)) " % of positions come within " (tolerance.mm)
            " mm is not known: " (reason) "."
        },
        (verdict, Some((bound, uncertainty))) => html! {
            "Corrected by the " (content.verdict.applied.words()) ", at least " (words::percent(tolerance.share))
            " % of positions come within " strong { (words::fixed(bound, 3)) " mm" } " (with "
            (words::percent(tolerance.confidence)) " % confidence" @if let Some(stations) = &stations { ", by " (stations) } "). "
            "With the measurement's own uncertainty of " (words::fixed(uncertainty, 3)) " mm that is "
            (words::fixed(bound + uncertainty, 3)) " mm, "
            @if *verdict == Verdict::Meets { "within" } @else { "more than" }
            " the tolerance of " (tolerance.mm) " mm."
        },
        (Verdict::Meets | Verdict::DoesNotMeet, None) => html! { (content.choice) "." },
    }
}

/// The figures that the verdict rests on, and the chosen step.
fn facts(content: &Content, chosen: Option<&StepRow>) -> Markup {
    let tolerance = &content.tolerance;
    let bound = format!("Bound on {} % of errors", words::percent(tolerance.share));
    html! {
        dl.facts {
            @if let Some(figure) = content.verdict.headline().figure() {
                (fact(&bound, &mm(figure.bound), &html! { (words::percent(tolerance.confidence)) " % confidence" }))
                (fact("Tolerance", &html! { (tolerance.mm) " mm" }, &html! {
                    "guarded by U = " (words::fixed(figure.expanded_uncertainty_mm, 3)) " mm"
                }))
                @if let Some([before, after]) = content.said.pairs.predicted.as_ref().and_then(Compared::figures) {
                    (fact("Mean error", &mm(Some(after.mean)), &html! {
                        "before: " (words::fixed(before.mean, 3)) " mm at the same stations"
                    }))
                }
                (fact("Judged on", &html! { (words::whole(figure.counted.poses as u64)) }, &html! {
                    "held-out poses"
                    @if figure.counted.visits > figure.counted.poses { " in " (words::whole(figure.counted.visits as u64)) " visits" }
                    @if let Some(blocks) = figure.blocks { " in " (blocks) " blocks" }
                }))
            }
            @if let Some(step) = chosen {
                (fact("Step of the table", &html! { (step.step_mm) " mm" }, &html! {
                    (words::whole(step.nodes.unwrap_or(0) as u64)) " nodes, " (step.source.word()) ", " (words::inside(step.interpolation))
                }))
            }
            @if let Some(covered) = content.verdict.table.covered() {
                (fact("The table answers for", &html! { (covered.stations) " of " (covered.measured) }, &html! {
                    "measured stations; " (covered.like) " are of its orientation and configuration; " (words::fixed(100.0 * covered.of_box, 1))
                    " % of the box"
                }))
            }
        }
    }
}

pub(super) fn fact(name: &str, value: &Markup, beside: &Markup) -> Markup {
    html! { div { dt { (name) } dd { (value) small { (beside) } } } }
}

pub(super) fn mm(value: Option<f64>) -> Markup {
    html! { @match value { Some(value) => { (words::number(value, 3)) " mm" }, None => "not shown" } }
}
