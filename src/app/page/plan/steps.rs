//! The uniform grid: the errors that each step leaves on simulated robots, and the largest step that holds.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::cells;
use super::content::Content;
use crate::io::tables::plan_figures::{FigureRow, FigureStudy};
use crate::page::words::{self, fixed, percent, whole};
use crate::report::chart::{Axis, Chart, Limit, Marks, Series};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let steps = content.of_study(FigureStudy::Step);
    let chosen = steps.iter().copied().find(|row| row.chosen);
    let shown = chosen.or_else(|| best(&steps))?;
    let own: Vec<&FigureRow> = steps.iter().copied().filter(|row| is_alike(row, shown)).collect();
    Some(html! {
        p { (sentence(chosen)) }
        p {
            "Each robot's grid is measured at the table's orientation, and positions between its nodes are corrected by it. Means and "
            "95th percentiles are means over robots; the bound is the value that the share of robots asked for stays below, with the confidence asked for."
        }
        div.pair {
            figure { (chart(content, &steps, &own, chosen)) figcaption { (caption(shown, &own)) } }
            div { (own_rows(&own)) }
        }
        details {
            summary { "Every source of node values and every interpolation" }
            (all_rows(&steps))
        }
    })
}

/// Where no step holds: the row that comes nearest.
fn best<'c>(steps: &[&'c FigureRow]) -> Option<&'c FigureRow> {
    let key = |row: &FigureRow| row.bound_mm.or(row.p95_mm).unwrap_or(f64::INFINITY);
    steps.iter().copied().min_by(|a, b| key(a).total_cmp(&key(b)))
}

fn is_alike(row: &FigureRow, other: &FigureRow) -> bool {
    (row.source, row.interpolation) == (other.source, other.interpolation)
}

fn sentence(chosen: Option<&FigureRow>) -> Markup {
    let Some(row) = chosen else { return html! { "No step holds for the asked share of robots." } };
    html! {
        "The largest step that holds, with all smaller ones, is " strong { (row.step_mm.unwrap_or(0.0)) " mm" } ": "
        (row.poses) " poses, " (words::origin(row)) ". " (row.meet) " of " (row.robots)
        " robots meet the tolerance: at least " (fixed(100.0 * row.share_at_least, 1)) " % of all, " (percent(row.share_asked)) " % are asked for."
    }
}

fn own_rows(steps: &[&FigureRow]) -> Markup {
    let head =
        html! { th { "Step, mm" } th { "Poses" } (cells::errors_head()) (cells::robots_head()) };
    let body = html! {
        @for row in in_order(steps) {
            tr.chosen[row.chosen] {
                th scope="row" { (row.step_mm.unwrap_or(0.0)) @if row.chosen { small { "largest" } } }
                td { (whole(row.poses as u64)) }
                (cells::errors(row))
                (cells::robots(row))
            }
        }
    };
    super::table(&head, &body)
}

fn all_rows(steps: &[&FigureRow]) -> Markup {
    let head = html! {
        th { "Step, mm" } th.word { "Node values" } th { "Poses" } th { "Nodes not reached" } (cells::errors_head())
        (cells::robots_head()) th { "Poses refused" } th { "Outside" }
    };
    let body = html! {
        @for row in in_order(steps) {
            tr.chosen[row.chosen] {
                th scope="row" { (row.step_mm.unwrap_or(0.0)) }
                td.word { (words::family(row)) }
                td { (whole(row.poses as u64)) }
                td { (row.not_reached) }
                (cells::errors(row))
                (cells::robots(row))
                td { (whole(row.refused as u64)) }
                td { (whole(row.outside as u64)) }
            }
        }
    };
    html! {
        (super::table(&head, &body))
        p.note {
            "Refused: fresh poses, all robots together, in a cell that cannot serve, as its corners are too far apart in joint angles; "
            "outside: beyond the grid's last nodes."
        }
    }
}

fn in_order<'c>(steps: &[&'c FigureRow]) -> Vec<&'c FigureRow> {
    let mut rows = steps.to_vec();
    rows.sort_by(|a, b| a.step_mm.unwrap_or(0.0).total_cmp(&b.step_mm.unwrap_or(0.0)));
    rows
}

fn chart(
    content: &Content,
    steps: &[&FigureRow],
    own: &[&FigureRow],
    chosen: Option<&FigureRow>,
) -> Markup {
    let mut series = vec![
        Series::line_and_points("bound over robots", points(own, |row| row.bound_mm)),
        Series::line_and_points("95th percentile", points(own, |row| row.p95_mm)),
        Series::line_and_points("mean", points(own, |row| row.mean_mm)),
    ];
    series.extend(other_bounds(steps, own));
    let ring = points(&Vec::from_iter(chosen), |row| row.bound_mm.or(row.mean_mm));
    series.push(Series::new("largest that holds", vec![Marks::Rings(ring)]));
    Chart {
        title: "Accuracy against step".to_owned(),
        description: "Error left by grids of several steps on simulated robots: mean, 95th percentile and bound over robots."
            .to_owned(),
        x: Axis::new("step", "mm").including(&[0.0]),
        y: Axis::new("error norm left on fresh poses", "mm").including(&[0.0]),
        series,
        limits: tolerance(content),
    }
    .svg()
}

pub(super) fn tolerance(content: &Content) -> Vec<Limit> {
    content.promise().map(|promise| words::tolerance(promise.tolerance_mm)).into_iter().collect()
}

fn points(steps: &[&FigureRow], value: impl Fn(&FigureRow) -> Option<f64>) -> Vec<[f64; 2]> {
    let point = |row: &&FigureRow| Some([row.step_mm?, value(row)?]);
    in_order(steps).iter().filter_map(point).collect()
}

/// Bounds of each source and interpolation that is not the drawn one.
fn other_bounds(steps: &[&FigureRow], own: &[&FigureRow]) -> Vec<Series> {
    let others = steps.iter().filter(|row| !own.iter().any(|drawn| is_alike(row, drawn)));
    let mut families: BTreeMap<String, Vec<&FigureRow>> = BTreeMap::new();
    for row in others {
        families.entry(words::family(row)).or_default().push(row);
    }
    let bounds = |(place, (family, rows)): (usize, (String, Vec<&FigureRow>))| {
        let name = format!("bound, {family}");
        Series::line_and_points(&name, points(&rows, |row| row.bound_mm)).looking(3 + place)
    };
    families.into_iter().enumerate().map(bounds).collect()
}

fn caption(shown: &FigureRow, own: &[&FigureRow]) -> String {
    let unjudged = own.iter().filter(|row| row.mean_mm.is_none());
    let steps: Vec<String> = unjudged.filter_map(|row| Some(row.step_mm?.to_string())).collect();
    let none = if steps.is_empty() {
        String::new()
    } else {
        format!(" No pose could be judged at {} mm.", steps.join(", "))
    };
    format!("On {} simulated robots; drawn are {}.{none}", shown.robots, words::origin(shown))
}
