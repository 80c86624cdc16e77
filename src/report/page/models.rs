//! How the models came out: convergence, rank, what each part brought, what the results are valid for.

use maud::{Markup, html};

use super::content::{Calibration, Content};
use super::words;
use crate::fit::CONDITION_LIMIT;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let first = content.calibrations.first()?;
    let head = html! { th { "Model" } th { "Stations" } th { "Weighted down" } th { "Parameters" } th { "Rank" } th { "Condition" } th { "s²" } th { "Misfit per axis, mm" } th.word { "Ended because" } };
    let body = html! { @for calibration in &content.calibrations { (row(calibration)) } };
    let ill: Vec<&Calibration> = content
        .calibrations
        .iter()
        .filter(|c| c.condition.is_some_and(|found| found > CONDITION_LIMIT))
        .collect();
    let parts = content
        .calibrations
        .iter()
        .find(|calibration| !calibration.parts.is_empty());
    Some(html! {
        p { "Identified from " (first.sessions.join(", ")) @if first.sessions.len() > 1 { ", pooled: one arm, each session with its own base and target" } "." }
        (super::table(&head, &body))
        p.note { "An s² far above 1 says that the model, not the noise, is the limit. Converged is not accurate: accuracy is what held-out stations show." }
        @for calibration in ill {
            p.warning {
                "The condition of the model " q { (words::model(&calibration.model)) } " is " (words::optional(calibration.condition, 0))
                ", above " (CONDITION_LIMIT) ": some of its parameters are hardly determined by these poses, though its predictions near them are."
            }
        }
        @if let Some(calibration) = parts { h3 { "Parts of the whole model" } (part_rows(calibration)) }
        @if !content.notes.is_empty() { h3 { "Notes" } ul { @for note in &content.notes { li { (note) } } } }
        h3 { "Valid for" }
        dl.list { @for (name, value) in &first.valid_for { div { dt { (name) } dd { (value) } } } }
    })
}

fn row(calibration: &Calibration) -> Markup {
    html! {
        tr {
            th.word scope="row" { (words::model(&calibration.model)) }
            td { (calibration.stations) }
            td { (calibration.downweighted) }
            td { (calibration.parameters) }
            td { @match calibration.rank { Some(rank) => (rank), None => "–" } }
            td { (words::optional(calibration.condition, 0)) }
            td { (words::optional(calibration.variance_factor, 2)) }
            td { (words::optional(calibration.misfit_mm, 3)) }
            td.word { (calibration.convergence) @if let Some(made) = calibration.iterations { small { (made) " iterations" } } }
        }
    }
}

fn part_rows(calibration: &Calibration) -> Markup {
    let head = html! { th { "Part" } th { "Evidence, nats" } th.word { "Kept" } };
    let body = html! {
        @for (name, gain) in &calibration.parts {
            tr {
                th.word scope="row" { (words::plain(name)) }
                td { (words::number(*gain, 1)) }
                td.word { @if *gain > 0.0 { "yes" } @else { "no" } }
            }
        }
    };
    super::table(&head, &body)
}
