use std::cmp::Reverse;

use maud::{Markup, html};

use super::content::{Content, Newest, Robot, how_many};
use crate::io::tables::words::TableVerdict;
use crate::page::history::figure_name;
use crate::page::shell::{address, table};
use crate::page::verdict::capital;
use crate::page::words::{mark, number, optional, verdict};

const WORST: usize = 10;
const MOST: usize = 50;

type Measured<'c> = (&'c Robot, &'c Newest);

pub(super) fn worst(content: &Content) -> Option<Markup> {
    let mut own: Vec<Measured<'_>> = content.measured().collect();
    own.retain(|(_, newest)| newest.ratio().is_some());
    if own.len() <= WORST {
        return None;
    }
    sort_by_ratio(&mut own);
    own.truncate(WORST);
    Some(html! {
        p { "The " (how_many(own.len())) " whose bound is the largest over their tolerance." }
        (figures(content, &own))
    })
}

pub(super) fn moved(content: &Content) -> Markup {
    let mut own: Vec<Measured<'_>> = content.measured().collect();
    own.retain(|(_, newest)| newest.is_changed());
    own.sort_by_key(|(_, newest)| Reverse(newest.started));
    let (last, earlier): (Vec<_>, Vec<_>) =
        own.into_iter().partition(|(_, newest)| content.is_last_night(newest));
    html! {
        @if last.is_empty() { p { "Nothing moved last night, and no figure left its control limits." } }
        @else { p { "Last night, of " (how_many(last.len())) ":" } (changes(&last)) }
        @if !earlier.is_empty() {
            h3 { "Before last night, in the robot's newest session" }
            (changes(&earlier))
        }
    }
}

fn changes(own: &[Measured<'_>]) -> Markup {
    let head = html! { th { "Robot" } th.word { "Session" } th.word { "Began" } th.word { "What moved" } th.word { "Out of control" } };
    let row = |(robot, newest): &Measured<'_>| {
        let out: Vec<String> = newest.out_of_control.iter().map(|name| figure_name(name)).collect();
        html! {
            tr {
                th scope="row" { (link(robot)) }
                td.word { (newest.session) }
                td.word { (began(newest)) }
                td.word { (newest.moved.as_deref().unwrap_or("–")) }
                td.word { @if out.is_empty() { "–" } @else { (out.join(", ")) } }
            }
        }
    };
    folded(&head, &own.iter().map(row).collect::<Vec<_>>())
}

pub(super) fn not_measured(content: &Content) -> Markup {
    let mut own: Vec<Measured<'_>> = content.measured().collect();
    own.retain(|(_, newest)| !content.is_last_night(newest));
    own.sort_by_key(|(_, newest)| newest.started);
    let without: Vec<&Robot> =
        content.robots.iter().filter(|robot| robot.newest.is_none()).collect();
    let head = html! { th { "Robot" } th.n { "Days ago" } th.n { "Usually every" } th.word { "Newest session" } th.word { "Began" } };
    let row = |(robot, newest): &Measured<'_>| {
        html! {
            tr {
                th scope="row" { (link(robot)) }
                td.n { (optional(content.days_since(newest), 1)) }
                td.n { @match newest.usual_days { Some(days) => { (number(days, 1)) " d" }, None => "–" } }
                td.word { (newest.session) }
                td.word { (began(newest)) }
            }
        }
    };
    html! {
        @if own.is_empty() && without.is_empty() { p { "Every robot was measured last night." } }
        @if !own.is_empty() {
            p { "Of " (how_many(own.len())) " the newest session began 24 hours or more before " (content.as_of_text()) ", or has no date." }
            (folded(&head, &own.iter().map(row).collect::<Vec<_>>()))
        }
        @if !without.is_empty() {
            p.note {
                "Without any session that could be used: "
                @for (place, robot) in without.iter().enumerate() { @if place > 0 { ", " } (robot.name) " (" (robot.unreadable) " runs not readable)" }
                "."
            }
        }
    }
}

pub(super) fn all(content: &Content) -> Markup {
    let of = |own: TableVerdict| {
        let mut of: Vec<Measured<'_>> = content.measured().collect();
        of.retain(|(_, newest)| newest.verdict == own);
        sort_by_ratio(&mut of);
        of
    };
    let verdicts = [TableVerdict::NotMet, TableVerdict::NotShown, TableVerdict::Met];
    let groups = verdicts.map(|own| (own, of(own)));
    html! {
        @for (own, robots) in groups.iter().filter(|(_, robots)| !robots.is_empty()) {
            h3 { (capital(verdict(*own))) ": " (robots.len()) }
            @if robots.len() > MOST { details { summary { (how_many(robots.len())) } (figures(content, robots)) } }
            @else { (figures(content, robots)) }
        }
    }
}

fn figures(content: &Content, own: &[Measured<'_>]) -> Markup {
    let head = html! {
        th { "Robot" } th.word { "Verdict" } th.n { "Bound" small { "mm" } } th.n { "Tolerance" small { "mm" } } th.n { "Ratio" }
        th.n { "Before" small { "mean, mm" } } th.n { "After" small { "mean, mm" } } th.n { "Days ago" } th.n { "Sessions" } th.word { "Newest session" }
    };
    let row = |(robot, newest): &Measured<'_>| {
        html! {
            tr {
                th scope="row" { (link(robot)) }
                td.word { (mark(newest.verdict)) (verdict(newest.verdict)) }
                td.n { (optional(newest.bound_mm, 3)) }
                td.n { (optional(newest.tolerance_mm, 3)) }
                td.n { (optional(newest.ratio(), 2)) }
                td.n { (optional(newest.before_mm, 3)) }
                td.n { (optional(newest.after_mm, 3)) }
                td.n { (optional(content.days_since(newest), 1)) }
                td.n { (robot.sessions) }
                td.word { (newest.session) }
            }
        }
    };
    let rows: Vec<Markup> = own.iter().map(row).collect();
    table(&head, &html! { @for row in &rows { (row) } })
}

fn folded(head: &Markup, rows: &[Markup]) -> Markup {
    let (first, rest) = rows.split_at(rows.len().min(MOST));
    html! {
        (table(head, &html! { @for row in first { (row) } }))
        @if !rest.is_empty() {
            details { summary { (rest.len()) " more" } (table(head, &html! { @for row in rest { (row) } })) }
        }
    }
}

/// The largest ratio first, then those without one.
fn sort_by_ratio(own: &mut [Measured<'_>]) {
    let ratio = |(_, newest): &Measured<'_>| newest.ratio().unwrap_or(f64::NEG_INFINITY);
    own.sort_by(|a, b| ratio(b).total_cmp(&ratio(a)));
}

fn link(robot: &Robot) -> Markup {
    html! { a href=(address(&robot.page)) { (robot.name) } }
}

fn began(newest: &Newest) -> String {
    newest.started.map_or_else(|| "no date".to_owned(), |time| time.to_string())
}
