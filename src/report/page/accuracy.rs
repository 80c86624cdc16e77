//! Accuracy figures before and after.

mod tip;

use maud::{Markup, html};

use super::content::{Content, Figure, Subject};
use super::words;
use crate::report::Model;

/// The figures of error norms that a row of the table has, mm.
const COLUMNS: [(&str, &str); 6] = [
    ("mean", "Mean"),
    ("rms", "rms"),
    ("p95", "p95"),
    ("p99", "p99"),
    ("max", "Max"),
    ("bound", "Bound"),
];

pub(super) fn section(content: &Content) -> Option<Markup> {
    let subjects = subjects(&content.figures);
    let (telling, flattering): (Vec<&Subject>, Vec<&Subject>) =
        subjects.into_iter().partition(|subject| tells(subject));
    if telling.is_empty() && flattering.is_empty() {
        return None;
    }
    Some(html! {
        p {
            "Error norms in mm on stations that took no part. Before is given twice: against the raw command where command and "
            "measured target are one point, and with base and target fitted, which is the honest start. After is predicted, unless a "
            "table drove the session: then it was measured."
        }
        (rows(&content.figures, &telling))
        @if !flattering.is_empty() {
            details {
                summary { "On training stations, or with a base refitted on all: for comparing models only" }
                (rows(&content.figures, &flattering))
            }
        }
        (tip::figures(&content.tip))
    })
}

/// Figures on stations that took no part, and the command as it is.
fn tells(subject: &Subject) -> bool {
    subject.model == "raw_command" || (subject.split != "none" && subject.base_refit != "all")
}

/// What the figures are of, each once, before ahead of after.
fn subjects(figures: &[Figure]) -> Vec<&Subject> {
    let own = figures
        .iter()
        .filter(|figure| figure.quantity == "position_error");
    let mut subjects: Vec<&Subject> = own.map(|figure| &figure.subject).collect();
    let rank = |subject: &Subject| Model::of_word(&subject.model);
    subjects.sort_by(|a, b| {
        (&a.split, &a.of_session, &a.base_refit, rank(a), &a.angles).cmp(&(
            &b.split,
            &b.of_session,
            &b.base_refit,
            rank(b),
            &b.angles,
        ))
    });
    subjects.dedup();
    subjects.sort_by_key(|subject| subject.model != "raw_command");
    subjects
}

fn rows(figures: &[Figure], subjects: &[&Subject]) -> Markup {
    let head = html! {
        th { "What corrects" } th.word { "Judged on" } th { "n, poses" }
        @for (_, heading) in COLUMNS { th { (heading) } }
        th { "In 95 % ellipsoid" } th.word { "Verdict" }
    };
    let body = html! { @for subject in subjects { (row(figures, subject)) } };
    super::table(&head, &body)
}

/// The stations that judged; a table that did not drive them is held against another session as models are.
fn stations(subject: &Subject, moment: &str) -> String {
    if subject.model == "table" && moment == "after, predicted" {
        words::judged(subject)
    } else {
        words::stations(subject)
    }
}

fn row(figures: &[Figure], subject: &Subject) -> Markup {
    let figure = |name: &str| {
        figures
            .iter()
            .find(|figure| figure.subject == *subject && figure.name == name)
    };
    let value = |name: &str| figure(name).and_then(|figure| figure.value);
    let bound = figure("bound");
    let moment = match bound.map_or("", |bound| bound.evidence.as_str()) {
        "measured" => "before",
        "measured_after" => "after, measured",
        _ => "after, predicted",
    };
    html! {
        tr {
            th.word scope="row" { (words::subject(subject)) small { (moment) } }
            td.word { (stations(subject, moment)) }
            td { (bound.map_or(0, |bound| bound.n)) @if let Some(visits) = bound.and_then(|b| b.visits.filter(|&v| v > b.n)) { small { (visits) " visits" } } @if let Some(blocks) = bound.and_then(|b| b.blocks) { small { (blocks) " blocks" } } }
            @for (name, _) in COLUMNS { td { (words::optional(value(name), 3)) } }
            td { @match value("share_in_ellipsoid") { Some(share) => { data value=(share) { (words::fixed(100.0 * share, 1)) } " %" }, None => "–" } }
            td.word { @if subject.split == "none" { "–" } @else { (words::verdict(bound.and_then(|b| b.verdict.as_deref()).unwrap_or("–"))) } }
        }
    }
}
