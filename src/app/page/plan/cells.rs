//! Cells of a plan's tables that several sections use.

use maud::{Markup, html};

use crate::io::tables::plan_figures::FigureRow;
use crate::page::words::{fixed, optional, percent};

pub(super) fn robots_head() -> Markup {
    html! { th { "Robots that meet it" } th { "At least" } }
}

pub(super) fn robots(figure: &FigureRow) -> Markup {
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

pub(super) fn errors_head() -> Markup {
    html! { th { "Mean" } th { "p95" } th { "Bound" } }
}

/// Mean and 95th percentile, means over robots, and the bound over robots, mm.
pub(super) fn errors(figure: &FigureRow) -> Markup {
    html! {
        @for value in [figure.mean_mm, figure.p95_mm, figure.bound_mm] { td { (optional(value, 3)) } }
    }
}

/// `95 % of robots (95 % confidence)`.
pub(super) fn asked(share: f64, confidence: f64) -> String {
    format!("{} % of robots, {} % confidence", percent(share), percent(confidence))
}
