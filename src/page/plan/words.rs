//! Words of the tables → words on a plan's page, and cells that several sections share.

use maud::{Markup, html};

use super::content::Figure;
use crate::page::words::{self, fixed, optional, percent};

/// How the measured poses are chosen.
pub(super) fn design(word: &str) -> String {
    match word {
        "d_optimal" => "D-optimal".to_owned(),
        other => words::plain(other),
    }
}

/// Where node values come from and how those inside a cell follow, in a few words.
pub(super) fn family(figure: &Figure) -> String {
    let source = words::plain(&figure.source);
    match &figure.interpolation {
        Some(interpolation) => format!("{source}, {interpolation}"),
        None => source,
    }
}

/// The same for a sentence.
pub(super) fn origin(figure: &Figure) -> String {
    let source = match figure.source.as_str() {
        "measured" => "as measured".to_owned(),
        "model" => "from the model".to_owned(),
        other => words::plain(other),
    };
    match &figure.interpolation {
        Some(interpolation) => format!("node values {source}, {interpolation} inside a cell"),
        None => format!("node values {source}"),
    }
}

/// What a visit is for.
pub(super) fn purpose(word: &str) -> String {
    match word {
        "drift_check" => "again, for drift".to_owned(),
        other => words::plain(other),
    }
}

/// Headings of [`robots`].
pub(super) fn robots_head() -> Markup {
    html! { th { "Robots that meet it" } th { "At least" } }
}

/// How many robots meet the tolerance, and which share that shows at least; nothing where none could be judged.
pub(super) fn robots(figure: &Figure) -> Markup {
    html! {
        @if figure.judged == 0 {
            td { "–" } td { "–" }
        } @else {
            td {
                (figure.meet) "\u{a0}of\u{a0}" (figure.robots)
                @if figure.no_fit > 0 { small { (figure.no_fit) " not fitted" } }
            }
            td { data value=(figure.share_at_least) { (fixed(100.0 * figure.share_at_least, 1)) } "\u{a0}%" }
        }
    }
}

/// Headings of [`errors`].
pub(super) fn errors_head() -> Markup {
    html! { th { "Mean" } th { "p95" } th { "Bound" } }
}

/// Mean and 95th percentile, means over robots, and the bound over robots, mm.
pub(super) fn errors(figure: &Figure) -> Markup {
    html! {
        @for value in [figure.mean_mm, figure.p95_mm, figure.bound_mm] { td { (optional(value, 3)) } }
    }
}

/// `95 % of robots (95 % confidence)`.
pub(super) fn asked(share: f64, confidence: f64) -> String {
    format!(
        "{} % of robots, {} % confidence",
        percent(share),
        percent(confidence)
    )
}
