//! The head of the page: the plan's promise, and the poses that have to be measured for it.

use maud::{Markup, html};

use super::cells::asked;
use super::content::Content;
use crate::io::tables::plan_figures::{FigureRow, FigureStudy};
use crate::io::tables::sampling_plan::{VisitPurpose, VisitRow};
use crate::io::tables::words::TableVerdict;
use crate::page::verdict::{fact, mm};
use crate::page::words::{fixed, mark, percent, whole};

/// The verdict in the row of `runs`: with too few robots for a bound nothing is shown.
fn verdict(content: &Content) -> TableVerdict {
    let bound = content.promise().and_then(|own| own.promised_bound_mm);
    match (found(content), bound) {
        (Some(found), _) if found.holds() => TableVerdict::Met,
        (_, Some(_)) => TableVerdict::NotMet,
        (_, None) => TableVerdict::NotShown,
    }
}

fn found(content: &Content) -> Option<&FigureRow> {
    content.figures.iter().find(|row| row.study == FigureStudy::Promise)
}

pub(super) fn header(content: &Content) -> Markup {
    let verdict = verdict(content);
    let headline = match verdict {
        TableVerdict::Met => "meets the tolerance",
        TableVerdict::NotMet => "does not meet the tolerance",
        TableVerdict::NotShown => "is not shown to meet the tolerance",
    };
    html! {
        header {
            p.which { "Plan · " (content.robot) }
            h1 { (mark(verdict)) " The plan " (headline) }
            @if let Some(promise) = content.promise() {
                p.lead { (sentence(promise)) }
                p.lead { (shown(content, promise, verdict)) }
                (facts(content, promise))
            }
            p.note {
                "Promised, not measured: robots were drawn as the pipeline file expects them, measured as planned, fitted and "
                "compensated by the code that works on real sessions. A session that carries the plan's id is compared with this promise."
            }
        }
    }
}

fn sentence(promise: &VisitRow) -> Markup {
    let (Some(mean), Some(bound)) = (promise.promised_mean_mm, promise.promised_bound_mm) else {
        return html! {
            "Nothing is promised: " (promise.robots_simulated) " simulated robots are too few for "
            (asked(promise.promised_share, promise.promised_confidence)) ". Raise " code { "whole_model_robots" } "."
        };
    };
    html! {
        "Measured as planned and compensated by the identified arm, the mean error stays below " strong { (fixed(mean, 3)) " mm" }
        ", and " (percent(promise.bound_share)) " % of positions come within " strong { (fixed(bound, 3)) " mm" }
        " (with " (percent(promise.bound_confidence)) " % confidence): for " (percent(promise.promised_share)) " % of robots, with "
        (percent(promise.promised_confidence)) " % confidence."
    }
}

/// A sentence on how many simulated robots meet the tolerance.
fn shown(content: &Content, promise: &VisitRow, verdict: TableVerdict) -> Markup {
    let at_least = found(content).map(|row| row.share_at_least);
    html! {
        (promise.robots_meet) " of " (promise.robots_simulated) " simulated robots that took no part in choosing poses meet the tolerance of "
        (promise.tolerance_mm) " mm"
        @if let Some(share) = at_least {
            ": with " (percent(promise.promised_confidence)) " % confidence at least "
            data value=(share) { (fixed(100.0 * share, 1)) } " % of all such robots do, "
            @match verdict {
                TableVerdict::Met => "and ",
                TableVerdict::NotMet | TableVerdict::NotShown => "but ",
            }
            (percent(promise.promised_share)) " % are asked for"
        }
        "."
    }
}

fn facts(content: &Content, promise: &VisitRow) -> Markup {
    let count = |purpose: VisitPurpose| {
        content.visits.iter().filter(|visit| visit.purpose == purpose).count() as u64
    };
    let bound = format!("Promised bound on {} % of errors", percent(promise.bound_share));
    let over = asked(promise.promised_share, promise.promised_confidence);
    html! {
        dl.facts {
            (fact("Promised mean error", &mm(promise.promised_mean_mm), &html! { (over) }))
            (fact(&bound, &mm(promise.promised_bound_mm), &html! { (over) }))
            (fact("Tolerance", &html! { (promise.tolerance_mm) " mm" }, &html! {
                (promise.robots_meet) " of " (promise.robots_simulated) " robots meet it"
            }))
            (fact("Poses to identify", &html! { (whole(count(VisitPurpose::Identify))) }, &html! {
                (whole(count(VisitPurpose::DriftCheck))) " again, for drift"
            }))
            (fact("Poses to verify", &html! { (whole(count(VisitPurpose::Verify))) }, &html! { "they take no part in the fit" }))
        }
    }
}
