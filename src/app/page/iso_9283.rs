use std::collections::BTreeMap;

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::io::rows::Word as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureKind, FigureName};
use crate::io::tables::words::Unit;
use crate::report::iso_9283::Characteristic::{
    self, ApA, ApB, ApC, ApP, ApX, ApY, ApZ, DapP, RpA, RpB, RpC, RpL, VapP,
};
use crate::report::{Moment, Subject};

/// Most poses that are shown one by one: the standard has five, and a page is for people.
const SHOWN: usize = 30;

/// The figures of a pose that have a column of their own.
const LENGTHS: [Characteristic; 7] = [ApP, ApX, ApY, ApZ, RpL, VapP, DapP];
const ANGLES: [Characteristic; 6] = [ApA, ApB, ApC, RpA, RpB, RpC];

pub(super) type Of = (Moment, Subject);

pub(super) fn section(content: &Content) -> Option<Markup> {
    let figures: Vec<&AccuracyRow> =
        content.figures.iter().filter(|figure| figure.quantity == FigureKind::Iso9283).collect();
    if figures.is_empty() {
        return None;
    }
    let has_value =
        |own: &Of| figures.iter().any(|figure| of(figure) == *own && figure.value.is_some());
    let (shown, none): (Vec<Of>, Vec<Of>) = subjects(&figures).into_iter().partition(has_value);
    Some(html! {
        p {
            "Figures of ISO 9283, of poses that were visited more than once: AP is how far the mean of the visits is from the command, "
            "RP how far visits are from each other. Where a pose has fewer visits than the standard asks for, the figure is not the "
            "standard's. Load, speed and positions of the poses are those of the session, not those that the standard asks for."
        }
        @for own in &shown { (of_subject(own, &figures)) }
        @for (reason, subjects) in empty(&figures, &none) {
            p.note { "Not shown of " (subjects.join("; of ")) ": " (reason) "." }
        }
    })
}

/// The subjects of figures in their order, each once.
pub(super) fn subjects(figures: &[&AccuracyRow]) -> Vec<Of> {
    let mut subjects: Vec<Of> = Vec::new();
    for own in figures.iter().map(|figure| of(figure)) {
        if !subjects.contains(&own) {
            subjects.push(own);
        }
    }
    subjects
}

/// Subjects without any figure by why they have none.
fn empty<'f>(figures: &[&'f AccuracyRow], subjects: &[Of]) -> BTreeMap<&'f str, Vec<String>> {
    let mut by_reason: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for own in subjects {
        let mut reasons = figures.iter().filter(|figure| of(figure) == *own);
        let reason = reasons.find_map(|figure| figure.reason.as_deref());
        let (model, stations) = (own.1.model.name_at(own.1.angles), words::stations(&own.1));
        let of = by_reason.entry(reason.unwrap_or("no pose was visited again")).or_default();
        of.push(format!("{model}, {stations}"));
    }
    by_reason
}

pub(super) fn of(figure: &AccuracyRow) -> Of {
    (figure.evidence, figure.subject.clone())
}

fn of_subject(own: &Of, figures: &[&AccuracyRow]) -> Markup {
    let own_figures = figures.iter().copied().filter(|figure| of(figure) == *own);
    let (of_poses, over_all): (Vec<&AccuracyRow>, Vec<&AccuracyRow>) =
        own_figures.partition(|figure| figure.pose.is_some());
    html! {
        h3 { (whose(own)) }
        (all_rows(&over_all))
        @if !of_poses.is_empty() { (one_by_one(&of_poses)) }
    }
}

fn all_rows(figures: &[&AccuracyRow]) -> Markup {
    let head = html! { th { "Figure" } th { "Value" } th { "n" } th { "n of the standard" } th.word { "Remark" } };
    let body = html! {
        @for figure in figures {
            tr {
                th.word scope="row" { (symbol(figure.name)) }
                td { @match figure.value { Some(value) => (shown(value, figure.unit)), None => "not shown" } }
                td { (figure.n) }
                td { @match figure.n_needed { Some(needed) => (needed), None => "–" } }
                td.word { (figure.reason.as_deref().unwrap_or("")) }
            }
        }
    };
    super::table(&head, &body)
}

fn is(figure: &AccuracyRow, own: Characteristic) -> bool {
    figure.name == FigureName::Iso(own)
}

/// A row for each of the poses visited most.
fn one_by_one(figures: &[&AccuracyRow]) -> Markup {
    let there = |own: &Characteristic| figures.iter().any(|figure| is(figure, *own));
    let names: Vec<Characteristic> = LENGTHS.into_iter().chain(ANGLES).filter(there).collect();
    let poses = poses(figures);
    let head = html! {
        th { "Pose" } th { "n" }
        @for name in &names { th { (symbol(FigureName::Iso(*name))) @if ANGLES.contains(name) { ", µrad" } @else { ", mm" } } }
    };
    let body = html! { @for (pose, n) in poses.iter().take(SHOWN) { (pose_row(*pose, *n, &names, figures)) } };
    html! {
        details {
            summary { "Pose by pose" }
            (super::table(&head, &body))
            @if poses.len() > SHOWN {
                p.note { "The " (SHOWN) " poses visited most; table accuracy has " (poses.len()) "." }
            }
        }
    }
}

/// The poses with their visits, those visited most first.
fn poses(figures: &[&AccuracyRow]) -> Vec<(usize, usize)> {
    let accuracy = figures.iter().filter(|figure| is(figure, ApP));
    let mut poses: Vec<(usize, usize)> =
        accuracy.filter_map(|figure| Some((figure.pose?, figure.n))).collect();
    poses.sort_by_key(|(pose, n)| (std::cmp::Reverse(*n), *pose));
    poses
}

fn pose_row(pose: usize, n: usize, names: &[Characteristic], figures: &[&AccuracyRow]) -> Markup {
    let value = |name: Characteristic| {
        let mut own = figures.iter().filter(|figure| figure.pose == Some(pose) && is(figure, name));
        own.next().and_then(|figure| figure.value)
    };
    html! {
        tr {
            th.word scope="row" { (pose) }
            td { (n) }
            @for name in names {
                td { @match value(*name) {
                    Some(value) if ANGLES.contains(name) => { data value=(value) { (words::fixed(1e6 * value, 0)) } },
                    value => (words::optional(value, 3)),
                } }
            }
        }
    }
}

/// The heading of figures: measured or predicted, the correction, and the stations.
pub(super) fn whose((evidence, subject): &Of) -> String {
    let evidence = match evidence {
        Moment::Before => "Measured",
        Moment::After => "Predicted",
        Moment::MeasuredAfter => "Measured after",
    };
    let model = subject.model.name_at(subject.angles);
    format!("{evidence}: {model}; {}", words::stations(subject))
}

/// A symbol of the standard; the part after the underscore is a subscript.
fn symbol(name: FigureName) -> Markup {
    let (symbol, index) = name.word().split_once('_').unwrap_or((name.word(), ""));
    html! { (symbol) @if !index.is_empty() { sub { (index) } } }
}

fn shown(value: f64, unit: Unit) -> Markup {
    let (digits, unit) = written(value, unit);
    html! { data value=(value) { (digits) } "\u{a0}" (unit) }
}

/// The digits of a figure and their unit; angles are in µrad.
pub(super) fn written(value: f64, unit: Unit) -> (String, &'static str) {
    match unit {
        Unit::Rad => (words::fixed(1e6 * value, 0), "µrad"),
        Unit::Mm | Unit::One => (words::fixed(value, 3), unit.word()),
    }
}
