//! The last nights: bound and mean error of each beside the tolerance, and its page.

use maud::{Markup, html};

use super::content::{Content, Session};
use crate::page::shell::{address, table};
use crate::page::words::{mark, optional, tolerance, verdict};
use crate::report::chart::{Axis, Chart, Series};

const MOST: usize = 10;

type Numbered<'c> = (usize, &'c Session);

pub(super) fn section(content: &Content) -> Option<Markup> {
    let nights: Vec<Numbered<'_>> = (1..).zip(&content.sessions).collect();
    let nights = &nights[nights.len().saturating_sub(MOST)..];
    let head = html! {
        th { "No." } th.word { "Session" } th.word { "Began" } th.word { "Verdict" } th.n { "Bound" small { "mm" } }
        th.n { "Tolerance" small { "mm" } } th.n { "Before" small { "mean, mm" } } th.n { "After" small { "mean, mm" } }
    };
    (!nights.is_empty()).then(|| {
        html! {
            figure { (chart(nights).svg()) figcaption { "What the correction leaves of each night, by stations that took no part in it." } }
            (table(&head, &html! { @for night in nights.iter().rev() { (row(night)) } }))
        }
    })
}

fn row((number, own): &Numbered<'_>) -> Markup {
    html! {
        tr {
            td.n { (number) }
            th.word scope="row" { @if let Some(page) = &own.page { a href=(address(page)) { (own.name) } } @else { (own.name) } }
            td.word { @if let Some(time) = own.started { (time) } @else { "–" } }
            td.word { (mark(own.verdict)) (verdict(own.verdict)) }
            @for mm in [own.bound_mm, own.tolerance_mm, own.means_mm[0], own.means_mm[1]] { td.n { (optional(mm, 3)) } }
        }
    }
}

fn chart(nights: &[Numbered<'_>]) -> Chart {
    let line = |name: &str, of: fn(&Session) -> Option<f64>| {
        let points = nights.iter().filter_map(|(number, own)| Some([*number as f64, of(own)?]));
        Series::line_and_points(name, points.collect())
    };
    let tolerance_mm = nights.last().and_then(|(_, own)| own.tolerance_mm);
    Chart {
        title: "Bound and mean error of the last nights".to_owned(),
        description: "Bound on the errors and mean error after correction of each of the last nights, with the tolerance of the newest."
            .to_owned(),
        x: Axis::of_whole_numbers("session", "no."),
        y: Axis::new("position error", "mm").including(&[0.0]),
        series: vec![
            line("bound, after correction", |own| own.bound_mm),
            line("mean, after correction", |own| own.means_mm[1]),
        ],
        limits: tolerance_mm.map(tolerance).into_iter().collect(),
    }
}
