//! The results from the logs: clocks, pairing, and everything that was left out, by reason.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::content::{Content, Session};
use super::words;
use crate::figures::expanded;
use crate::io::rows::Word as _;
use crate::io::tables::stations::PairingVerdict;
use crate::units::NS_PER_S;

pub(super) fn clocks_section(content: &Content) -> Option<Markup> {
    if content.sessions.is_empty() {
        return None;
    }
    let head = html! { th { "Session" } th { "Stations" } th { "Measured" } th.word { "Not measured" } th { "Tracker's clock ahead, s" } th { "Runs faster, ppm" } th { "Edges" } th { "rms, ms" } };
    let body = html! { @for session in &content.sessions { (clock_row(session)) } };
    Some(html! {
        p { "The tracker's clock against the controller's, at the first stamp of the controller's log, ± two standard errors." }
        (super::table(&head, &body))
        @for session in &content.sessions { p.note { (session.name) ": " (session.clock.method) "." } }
    })
}

fn clock_row(session: &Session) -> Markup {
    let clock = &session.clock;
    let all: usize = session.dwells.iter().map(|(_, _, count)| count).sum();
    let paired = session.dwells.iter().filter(|own| own.0 == PairingVerdict::Paired);
    let paired: usize = paired.map(|(_, _, count)| count).sum();
    html! {
        tr {
            th.word scope="row" { (session.name) small { @if session.trained { "trained" } @else { "only judged" } } }
            td { (all) }
            td { (paired) }
            td.word { (unmeasured(session)) }
            td { (words::fixed(clock.offset_ns / NS_PER_S, 4)) " ± " (words::fixed(expanded(clock.offset_se_ns) / NS_PER_S, 4)) }
            td { (words::fixed(clock.drift_ppm, 2)) " ± " (words::fixed(expanded(clock.drift_se_ppm), 2)) }
            td { (clock.matched_edges) }
            td { (words::fixed(clock.edge_rms_ns / 1e6, 2)) }
        }
    }
}

/// The reasons why stations have no measurement, with the number of stations for each.
fn unmeasured(session: &Session) -> String {
    let reasons = session.dwells.iter().filter_map(|(_, reason, count)| {
        let reason = (*reason)?;
        Some(format!("{count} {}", words::plain(reason.word())))
    });
    let reasons: Vec<String> = reasons.collect();
    if reasons.is_empty() { "none".to_owned() } else { reasons.join(", ") }
}

/// Most reasons that are listed; logs can give any number.
const MOST: usize = 40;

pub(super) fn rejects_section(content: &Content) -> Markup {
    let reasons = reasons(content);
    let hidden = reasons.len().saturating_sub(MOST);
    let head = html! { th { "Session" } th.word { "Stage" } th.word { "Reason" } th.word { "What" } th { "How many" } };
    let body = html! {
        @for (reason, number) in reasons.iter().take(MOST) {
            tr {
                td.word { (reason.0) } td.word { (reason.1) }
                td.word { (words::plain(reason.3)) }
                td.word { (reason.2) }
                td { (words::whole(*number)) }
            }
        }
    };
    html! {
        p { "Every item that a stage read is either kept or rejected." }
        (counts(content))
        h3 { "By reason" }
        @if reasons.is_empty() { p { "Nothing was rejected." } } @else { (super::table(&head, &body)) }
        @if hidden > 0 { p.note { (hidden) " more reasons are in " code { "rejects" } "." } }
    }
}

/// Session, stage, kind of item and reason.
type Reason<'c> = (&'c str, &'c str, &'c str, &'c str);

fn reasons(content: &Content) -> BTreeMap<Reason<'_>, u64> {
    let mut reasons: BTreeMap<Reason<'_>, u64> = BTreeMap::new();
    for session in &content.sessions {
        for reject in &session.rejects {
            let (stage, kind) = (reject.stage.word(), reject.kind.word());
            let reason = (session.name.as_str(), stage, kind, reject.reason.as_str());
            *reasons.entry(reason).or_default() += reject.number;
        }
    }
    reasons
}

fn counts(content: &Content) -> Markup {
    let head = html! { th { "Stage" } th.word { "What" } th { "Came in" } th { "Kept" } th.word { "Rejected" } };
    let body = html! {
        @for count in &content.counts {
            tr {
                th.word scope="row" { (count.stage) }
                td.word { (count.of) }
                td { (words::whole(count.read)) }
                td { (words::whole(count.kept)) }
                td.word {
                    @if count.rejected.is_empty() { "none" }
                    @for (place, (reason, number)) in count.rejected.iter().enumerate() {
                        @if place > 0 { ", " } (words::whole(*number)) " " (words::plain(reason))
                    }
                }
            }
        }
    };
    super::table(&head, &body)
}
