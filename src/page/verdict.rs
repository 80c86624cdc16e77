//! The head of the page: the verdict as text for an operator, and the figures that it rests on.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::grid::Verdict;
use crate::io::common::Corrects as _;
use crate::io::table::Word as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::error_frame::ErrorFrameName;
use crate::io::tables::grid_steps::StepRow;
use crate::report::verdict::{self, Judge};
use crate::report::{Accuracy, Model, Split};

pub(super) fn header(content: &Content) -> Markup {
    let verdict = content.verdict.verdict();
    let (class, headline) = headline(&verdict);
    let chosen = content.steps.iter().find(|step| step.chosen);
    html! {
        header {
            p.which { (content.robot) " · " (content.session) }
            h1 { span class={ "mark " (class) } aria-hidden="true" { (sign(&verdict)) } " " (headline) " by the " (content.verdict.applied().words()) }
            p.lead { (sentence(content, &verdict)) }
            p { "Tolerance " (content.tolerance.mm) " mm: " strong { (content.verdict.statement()) } "." }
            (frame(content))
            (judges(content.verdict.judges()))
            @for warning in &content.warnings { p.warning { (warning) } }
            (facts(content, chosen))
            p.note { "Beside it: " (content.verdict.other_statement()) "." }
            p.note {
                "Chosen: " (content.choice) ". What is left after a correction is predicted, from stations that took no part; "
                "it is measured only once a session driven by it is."
            }
        }
    }
}

/// The base frame that the results hold in; where it was fitted, what has to be typed.
fn frame(content: &Content) -> Markup {
    let Some(row) = content.calibrations.first() else {
        return html! {};
    };
    let stated = row.stated_frame();
    html! {
        p class=[(!stated.is_surveyed).then_some("warning")] { (capital(&stated.words())) "." }
        @if !stated.is_surveyed {
            details {
                summary { "The frame to set, as controllers take it" }
                @for (what, forms) in stated.to_set() {
                    p { (capital(what)) ":" }
                    dl { @for (form, typed) in forms { dt { (form) } dd { code { (typed) } } } }
                }
            }
        }
    }
}

/// A text with a capital letter at its beginning.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// Who judges, where a test session does, and what has to be known of it.
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

/// The verdict in a sentence, by the figure that decides.
fn sentence(content: &Content, verdict: &Verdict) -> Markup {
    let tolerance = &content.tolerance;
    let headline = content.verdict.headline();
    let bound = headline
        .figure()
        .and_then(|figure| Some((figure.bound?, figure.expanded_uncertainty_mm)));
    let stations = headline.decides().map(|judge| judge.stations.words());
    match (verdict, bound) {
        (Verdict::NotShown(reason), _) => html! {
            "Whether " (words::percent(tolerance.share)) " % of positions come within " (tolerance.mm)
            " mm is not known: " (reason) "."
        },
        (verdict, Some((bound, uncertainty))) => html! {
            "Corrected by the " (content.verdict.applied().words()) ", at least " (words::percent(tolerance.share))
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
                (fact("Mean error", &mm(figure.figures.map(|own| own.mean)), &html! {
                    @if let Some((mean, n)) = before(content, figure) { "before: " (words::fixed(mean, 3)) " mm on " (n) " stations" }
                }))
                (fact("Judged on", &html! { (words::whole(figure.counted.poses as u64)) }, &html! {
                    "held-out poses"
                    @if figure.counted.visits > figure.counted.poses { " in " (words::whole(figure.counted.visits as u64)) " visits" }
                    @if let Some(blocks) = figure.blocks { " in " (blocks) " blocks" }
                }))
            }
            @if let Some(step) = chosen {
                (fact("Step of the table", &html! { (step.step_mm) " mm" }, &html! {
                    (words::whole(step.nodes.unwrap_or(0) as u64)) " nodes, " (step.source.word()) ", " (step.interpolation.word())
                }))
                (fact("The table answers for", &html! { (percent(step.like_covered_share)) }, &html! {
                    "of the measured stations of its orientation and configuration, " (percent(step.stations_covered_share)) " of all, "
                    (percent(step.box_covered_share)) " of the box"
                }))
            }
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

/// The mean error before, on all stations of the session and split that `figure` is of, and how many they are: of the raw command where
/// held-out blocks judge in a surveyed base, so that before and after are of one frame; of base and target fitted otherwise.
fn before(content: &Content, figure: &Accuracy) -> Option<(f64, usize)> {
    let subject = &figure.subject;
    let is_surveyed = |row: &CalibrationRow| row.error_frame == ErrorFrameName::Surveyed;
    let is_surveyed = content.calibrations.first().is_some_and(is_surveyed);
    let (model, split) = if is_surveyed && subject.split == Split::Blocks {
        (Model::RawCommand, Split::None)
    } else {
        (Model::BaseTarget, subject.split)
    };
    let is_it = |own: &&AccuracyRow| {
        (own.model, own.name, own.split) == (model, FigureName::Mean, split)
            && own.base_refit == subject.base_refit
            && own.of_session == subject.of_session
    };
    let before = content.figures.iter().find(is_it)?;
    Some((before.value?, before.n))
}
