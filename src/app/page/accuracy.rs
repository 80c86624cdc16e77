mod sessions;
mod tip;

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::io::rows::Word as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureKind, FigureName};
use crate::report::{BaseRefit, Model, Moment, Split, Subject};

/// The figures of error norms that a row of the table has, mm.
const COLUMNS: [(FigureName, &str); 6] = [
    (FigureName::Mean, "Mean"),
    (FigureName::Rms, "rms"),
    (FigureName::P95, "p95"),
    (FigureName::P99, "p99"),
    (FigureName::Max, "Max"),
    (FigureName::Bound, "Bound"),
];

pub(super) fn section(content: &Content) -> Option<Markup> {
    let subjects = subjects(&content.figures);
    let (listed, training): (Vec<Subject>, Vec<Subject>) =
        subjects.into_iter().partition(is_listed);
    if listed.is_empty() && training.is_empty() {
        return None;
    }
    Some(html! {
        p {
            "Error norms in mm on stations that took no part. Before is given twice: against the raw command where command and "
            "measured target are one point, and with base and target fitted, which is the fair comparison. After is predicted, unless a "
            "table drove the session: then it was measured."
        }
        @if content.sessions.iter().filter(|own| own.trained).count() > 1 {
            (sessions::rows(content))
            details { summary { "Every model, judged in every way" } (rows(&content.figures, &listed)) }
        } @else {
            (rows(&content.figures, &listed))
        }
        @if !training.is_empty() {
            details {
                summary { "On training stations, or with a base refitted on all: for comparing models only" }
                (rows(&content.figures, &training))
            }
        }
        (tip::figures(&content.tip))
    })
}

/// Whether the subject is judged on stations that took no part, or is the raw command.
pub(super) fn is_listed(subject: &Subject) -> bool {
    subject.model == Model::RawCommand
        || (subject.split != Split::None && subject.base_refit != BaseRefit::All)
}

/// The subjects of the figures, each once, before ahead of after.
pub(super) fn subjects(figures: &[AccuracyRow]) -> Vec<Subject> {
    let own = figures.iter().filter(|figure| figure.quantity == FigureKind::PositionError);
    let mut subjects: Vec<Subject> = own.map(|figure| figure.subject.clone()).collect();
    // Models in their own order, the rest in that of the page.
    subjects.sort_by_key(|own| {
        let (split, base, angles) = (own.split.word(), own.base_refit.word(), own.angles.word());
        (split, own.of_session.clone(), base, own.model, angles)
    });
    subjects.dedup();
    subjects.sort_by_key(|subject| subject.model != Model::RawCommand);
    subjects
}

fn rows(figures: &[AccuracyRow], subjects: &[Subject]) -> Markup {
    let head = html! {
        th { "Corrected by" } th.word { "Judged on" } th { "n, poses" }
        @for (_, heading) in COLUMNS { th { (heading) } }
        th { "In 95 % ellipsoid" } th.word { "Verdict" }
    };
    super::table(&head, &html! { @for subject in subjects { (row(figures, subject)) } })
}

/// The stations that judged; a table that did not drive them is compared with another session, as models are.
pub(super) fn stations(subject: &Subject, moment: Moment) -> String {
    if (subject.model, moment) == (Model::Table, Moment::After) {
        words::judged(subject)
    } else {
        words::stations(subject)
    }
}

fn row(figures: &[AccuracyRow], subject: &Subject) -> Markup {
    let own = || figures.iter().filter(|figure| figure.subject == *subject);
    let figure = |name: FigureName| own().find(|figure| figure.name == name);
    let value = |name: FigureName| figure(name).and_then(|figure| figure.value);
    let bound = figure(FigureName::Bound);
    let moment = bound.map_or(Moment::After, |bound| bound.evidence);
    html! {
        tr {
            th.word scope="row" { (subject.model.name_at(subject.angles)) small { (words::evidence(moment)) } }
            td.word { (stations(subject, moment)) }
            td { (bound.map_or(0, |bound| bound.n)) @if let Some(visits) = bound.and_then(|b| b.visits.filter(|&v| v > b.n)) { small { (visits) " visits" } } @if let Some(blocks) = bound.and_then(|b| b.blocks) { small { (blocks) " blocks" } } }
            @for (name, _) in COLUMNS { td { (words::optional(value(name), 3)) } }
            td { @match value(FigureName::ShareInEllipsoid) { Some(share) => { data value=(share) { (words::fixed(100.0 * share, 1)) } " %" }, None => "–" } }
            td.word { @if subject.split == Split::None { "–" } @else { (bound.and_then(|b| b.verdict).map_or("–", words::verdict)) } }
        }
    }
}
