//! The head of the page: whether every robot meets its tolerance, and how many do not.

use maud::{Markup, html};

use super::content::{Content, Newest, how_many};
use crate::io::tables::words::TableVerdict;
use crate::page::verdict::fact;
use crate::page::words::{mark, whole};

pub(super) fn header(content: &Content) -> Markup {
    let (verdict, headline) = status(content);
    html! {
        header {
            p.which { "Fleet · " (how_many(content.robots.len())) }
            h1 { (mark(verdict)) " " (headline) }
            p.lead { (as_of(content)) }
            dl.facts { @for (name, count) in counts(content) { (fact(name, &html! { (whole(count as u64)) }, &html! {})) } }
        }
    }
}

fn as_of(content: &Content) -> Markup {
    html! {
        @match (content.as_of, content.is_stated) {
            (None, _) => "No session has a date.",
            (Some(time), false) => { "As of " strong { (time) } " UTC, the start of the newest session." },
            (Some(time), true) => { "As of " strong { (time) } " UTC, as was stated." },
        }
    }
}

fn count(content: &Content, is: impl Fn(&Newest) -> bool) -> usize {
    content.measured().filter(|(_, newest)| is(newest)).count()
}

fn counts(content: &Content) -> [(&'static str, usize); 6] {
    let of = |own: TableVerdict| count(content, |newest| newest.verdict == own);
    let is_measured = |newest: &Newest| content.is_last_night(newest);
    let changed = count(content, |newest| is_measured(newest) && newest.is_changed());
    let measured = count(content, is_measured);
    [
        ("Met", of(TableVerdict::Met)),
        ("Not met", of(TableVerdict::NotMet)),
        ("Not shown", of(TableVerdict::NotShown)),
        ("Measured last night", measured),
        ("Changed last night", changed),
        ("Not measured", content.robots.len() - measured),
    ]
}

fn status(content: &Content) -> (TableVerdict, String) {
    let all = content.robots.len();
    let [met, not_met, ..] = counts(content).map(|(_, count)| count);
    if not_met > 0 {
        let verb = if not_met == 1 { "does" } else { "do" };
        let headline = format!("{not_met} of {} {verb} not meet the tolerance", how_many(all));
        (TableVerdict::NotMet, headline)
    } else if met < all {
        let verb = if all == 1 { "is" } else { "are" };
        let headline = format!("{met} of {} {verb} shown to meet the tolerance", how_many(all));
        (TableVerdict::NotShown, headline)
    } else {
        let headline = if all == 1 { "The robot meets" } else { "All robots meet" };
        (TableVerdict::Met, format!("{headline} the tolerance"))
    }
}
