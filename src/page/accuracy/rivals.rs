//! Rivals beside the model that corrects: who leaves less, by how much, and whether that is more than chance.

use maud::{Markup, html};

use super::stations;
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::page::words;
use crate::report::rivals::Outcome;
use crate::report::{BaseRefit, Moment, Subject};

/// What every rival leaves beside the model that corrects; nothing for a run without rivals.
pub(super) fn section(figures: &[AccuracyRow]) -> Markup {
    let named = |name: FigureName| figures.iter().filter(move |own| own.name == name);
    let rows: Vec<&AccuracyRow> = named(FigureName::MeanDifference).collect();
    if rows.is_empty() {
        return html! {};
    }
    let head = html! {
        th { "Rival" } th.word { "Judged on" } th { "n" } th { "Mean" } th { "Minus the model that corrects" } th.word { "Outcome" }
    };
    let body = html! { @for own in rows { (row(figures, own)) } };
    html! {
        h3 { "Rivals" }
        p {
            "The models that papers use, on the same stations as the model that corrects: mean error and mean difference of errors, mm, ± two "
            "standard errors, stations of one block counted together. A rival wins or loses where the difference is more than that. Nothing "
            "is made of a rival unless it wins and " code { "[grid] rivals" } " asks for it."
        }
        @for own in named(FigureName::MeanDifferenceAfterChoice).filter(|own| own.base_refit != BaseRefit::All) {
            p { (told(own)) }
        }
        (crate::page::table(&head, &body))
    }
}

fn row(figures: &[AccuracyRow], difference: &AccuracyRow) -> Markup {
    let subject = difference.subject();
    let is_mean = |own: &&AccuracyRow| own.name == FigureName::Mean && own.subject() == subject;
    let mean = figures.iter().find(is_mean).and_then(|own| own.value);
    html! {
        tr {
            th.word scope="row" { (words::subject(&subject)) }
            td.word { (stations(&subject, Moment::After)) }
            td { (difference.n) @if let Some(blocks) = difference.blocks { small { (blocks) " blocks" } } }
            td { (words::optional(mean, 3)) }
            td { (words::optional(difference.value, 4)) " ± " (words::optional(difference.expanded_uncertainty, 4)) }
            td.word { @match outcome(difference) { Some(Outcome::Wins) => "wins", Some(Outcome::Loses) => "loses", Some(Outcome::Open) | None => "open" } }
        }
    }
}

fn outcome(difference: &AccuracyRow) -> Option<Outcome> {
    Some(Outcome::of(difference.value?, difference.expanded_uncertainty?))
}

/// The best rival on stations that did not choose it, in a sentence.
fn told(difference: &AccuracyRow) -> String {
    let subject: Subject = difference.subject();
    let by = difference.value.unwrap_or_default();
    let outcome = match outcome(difference) {
        Some(Outcome::Wins) => "it wins",
        Some(Outcome::Loses) => "it loses",
        Some(Outcome::Open) | None => "that is within what chance leaves open",
    };
    format!(
        "The best rival, {}, on stations that did not choose it ({}, {} stations): {} mm {} than the model that corrects, ± {} mm; {outcome}.",
        words::subject(&subject),
        words::judged(&subject),
        difference.n,
        words::fixed(by.abs(), 4),
        if by < 0.0 { "less" } else { "more" },
        words::fixed(difference.expanded_uncertainty.unwrap_or_default(), 4),
    )
}
