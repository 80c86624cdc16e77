//! The head of the page: whether base, target and joints of the newest session are where they were.

use maud::{Markup, html};

use super::content::{Content, Session};
use crate::io::tables::words::TableVerdict;
use crate::page::verdict::fact;
use crate::page::words::{mark, whole};

pub(super) fn header(content: &Content) -> Markup {
    let (verdict, headline) = status(content);
    html! {
        header {
            p.which { "History · " (content.robot) }
            h1 { (mark(verdict)) " " (headline) }
            @if let Some(last) = content.sessions.last() {
                p.lead { "Newest session: " strong { (last.name) } ". " (sentence(content)) }
            }
            dl.facts { @for (name, count) in counts(content) { (fact(name, &html! { (whole(count as u64)) }, &html! {})) } }
        }
    }
}

fn counts(content: &Content) -> [(&'static str, usize); 6] {
    let sessions = |is: fn(&Session) -> bool| content.sessions.iter().filter(|own| is(own)).count();
    [
        ("Sessions", content.sessions.len()),
        ("With a change", sessions(|own| own.moved.is_some())),
        ("Changes that last", sessions(|own| own.lasting == Some(true))),
        ("Out of control", sessions(|own| !own.out_of_control.is_empty())),
        ("Segments", content.sessions.last().map_or(0, |last| last.segment)),
        ("Runs left out", content.left_out.len()),
    ]
}

fn status(content: &Content) -> (TableVerdict, &'static str) {
    match content.sessions.last() {
        None => (TableVerdict::NotShown, "There is no session to report"),
        Some(last) if last.moved.is_some() => (TableVerdict::NotMet, "Something moved"),
        Some(last) if !last.out_of_control.is_empty() => (TableVerdict::NotMet, "Out of control"),
        Some(last) if last.against == 0 => {
            (TableVerdict::NotShown, "Nothing to compare the newest session with")
        }
        Some(_) => (TableVerdict::Met, "Nothing moved"),
    }
}

fn sentence(content: &Content) -> Markup {
    let Some(last) = content.sessions.last() else { return html! {} };
    html! {
        @match (&last.moved, last.against) {
            (_, 0) => "It begins a segment, so there is nothing to compare it with.",
            (Some(moved), against) => { "Compared with " (against) " before it: " (moved) "." },
            (None, against) => { "Compared with " (against) " before it, base, target and joints are where they were, as far as both determine it." },
        }
        @if let Some(means) = &last.means { " Errors " (means) "." }
        @if !last.out_of_control.is_empty() { " Out of control: " (last.out_of_control.join(", ")) "." }
    }
}
