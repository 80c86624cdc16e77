//! The figures for the tool tip, or the setting that gives them, or the reason why there are none.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::{is_listed, rows, subjects};
use crate::io::tables::accuracy::AccuracyRow;
use crate::report::Subject;

pub(super) fn figures(figures: &[AccuracyRow]) -> Markup {
    if figures.is_empty() {
        return html! {
            p.note {
                "The tip of a tool sees errors of the orientation too, by its lever arm. Figures for it are given where the pipeline file states "
                "where it is: " code { "[report] tool_tip" } "."
            }
        };
    }
    let listed: Vec<Subject> = subjects(figures).into_iter().filter(is_listed).collect();
    html! {
        h3 { "At the tool tip" }
        p {
            "These errors at the tip that " code { "[report] tool_tip" } " states, computed by lever arm with the measured orientation. A model's "
            "rows are the remaining errors where the tip is the point that is corrected. A table corrects the controller's tool point and leaves "
            "orientations as commanded, so its rows have all of the orientation's error."
        }
        (rows(figures, &listed))
        @for reason in reasons(figures) { p.note { "Not shown: " (reason) "." } }
    }
}

/// Why figures that no station gave are not shown.
fn reasons(figures: &[AccuracyRow]) -> BTreeSet<&str> {
    let none = figures.iter().filter(|figure| figure.n == 0);
    none.filter_map(|figure| figure.reason.as_deref()).collect()
}
