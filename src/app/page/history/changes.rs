//! Sessions in which something moved or left its control limits, newest first; and runs that took no part.

use maud::{Markup, html};

use super::content::{Content, Session};
use crate::page::shell::table;

const MOST: usize = 100;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let is_told = |session: &Session| {
        session.moved.is_some() || !session.out_of_control.is_empty() || session.against == 0
    };
    let told: Vec<(usize, &Session)> =
        content.sessions.iter().enumerate().filter(|(_, own)| is_told(own)).collect();
    if told.is_empty() {
        return None;
    }
    let head = html! {
        th { "No." } th.word { "Session" } th { "Compared with" }
        th.word { "What moved" } th.word { "Lasts" } th.word { "Out of control" }
    };
    let body = html! { @for (place, session) in told.iter().rev().take(MOST) { (row(place + 1, session)) } };
    Some(html! {
        p {
            "Sessions in which a part moved more than the covariances allow, and by as much as the tolerance notices, in which a moving average left its limits, or which begin "
            "a segment; newest first. " em { "Lasts" } " states whether the next session agrees."
        }
        (table(&head, &body))
        @if told.len() > MOST { p.note { (told.len() - MOST) " earlier ones are in the table " code { "drift" } "." } }
    })
}

fn row(number: usize, session: &Session) -> Markup {
    let lasts = match (&session.moved, session.lasting) {
        (None, _) => "–",
        (_, Some(true)) => "yes",
        (_, Some(false)) => "no",
        (_, None) => "not settled yet",
    };
    html! {
        tr {
            td.n { (number) }
            th.word scope="row" { (session.name) }
            td.n { (session.against) }
            td.word {
                @match (&session.moved, session.against) {
                    (Some(moved), _) => (moved),
                    (None, 0) => { "begins segment " (session.segment) @if !session.began.is_empty() { ": other " (session.began.join(", ")) } },
                    (None, _) => "–",
                }
            }
            td.word { (lasts) }
            td.word { @if session.out_of_control.is_empty() { "–" } @else { (session.out_of_control.join(", ")) } }
        }
    }
}

pub(super) fn left_out(content: &Content) -> Option<Markup> {
    if content.left_out.is_empty() {
        return None;
    }
    let head = html! { th { "Run" } th.word { "Why" } };
    let body = html! {
        @for (who, why) in content.left_out.iter().take(MOST) { tr { th scope="row" { (who) } td.word { (why) } } }
    };
    Some(html! {
        p { "Of " (content.runs) " runs " (content.sessions.len()) " are in this history; these " (content.left_out.len()) " are not." }
        (table(&head, &body))
        @if content.left_out.len() > MOST { p.note { (content.left_out.len() - MOST) " more." } }
    })
}
