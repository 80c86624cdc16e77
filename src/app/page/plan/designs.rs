//! Designs: accuracy against the number of poses, for grid, random and chosen poses.

use maud::{Markup, html};

use super::content::Content;
use super::{cells, steps};
use crate::io::tables::plan_figures::{FigureRow, FigureStudy};
use crate::page::words::{self, optional, percent, whole};
use crate::plan::Kind;
use crate::report::chart::{Axis, Chart, Limit, Marks, Series};

/// In the order of the legend; a design has the same look in every chart.
const DESIGNS: [Kind; 4] = [Kind::GreedyVariance, Kind::UniformGrid, Kind::Random, Kind::DOptimal];
/// The look of the error model's own expectation.
const EXPECTED: usize = 4;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let mut rows = content.of_study(FigureStudy::Design);
    let place = |row: &FigureRow| DESIGNS.iter().position(|design| *design == row.design);
    rows.sort_by_key(|row| (place(row), row.poses));
    let first = rows.first()?;
    Some(html! {
        p {
            "No grid is used here: the full error model is identified from the measured poses, and its predictions from commands "
            "alone correct fresh poses. " em { "Greedy variance" } " chooses each next pose where it lowers the model's own predicted variance over the box "
            "most; the model's own expectation was known before any robot was drawn. Figures are of " (first.robots) " simulated robots."
        }
        div.pair {
            figure { (means(&rows)) figcaption { "Mean error, mean over robots, with the model's own expectation." } }
            figure { (bounds(content, &rows)) figcaption { "Bound that the asked share of robots stays below, with the asked confidence." } }
        }
        (all_rows(content, &rows))
    })
}

fn points(
    rows: &[&FigureRow],
    design: Kind,
    value: impl Fn(&FigureRow) -> Option<f64>,
) -> Vec<[f64; 2]> {
    let own = rows.iter().filter(|row| row.design == design);
    own.filter_map(|row| Some([row.poses as f64, value(row)?])).collect()
}

fn series(rows: &[&FigureRow], value: impl Fn(&FigureRow) -> Option<f64> + Copy) -> Vec<Series> {
    let of = |(look, design): (usize, Kind)| {
        Series::line_and_points(&words::design(design), points(rows, design, value)).looking(look)
    };
    DESIGNS.into_iter().enumerate().map(of).collect()
}

/// A ring around the number of poses that the session has.
fn ring(rows: &[&FigureRow], value: impl Fn(&FigureRow) -> Option<f64>) -> Series {
    let chosen = rows.iter().filter(|row| row.chosen);
    let at = chosen.filter_map(|row| Some([row.poses as f64, value(row)?]));
    Series::new("the session's", vec![Marks::Rings(at.collect())])
}

fn means(rows: &[&FigureRow]) -> Markup {
    let mut all = series(rows, |row| row.mean_mm);
    for design in DESIGNS {
        let name = format!("expected, {}", words::design(design));
        let points = points(rows, design, |row| row.expected_mean_mm);
        all.push(Series::line_and_points(&name, points).looking(EXPECTED));
    }
    all.push(ring(rows, |row| row.mean_mm));
    let y = Axis::new("mean error left on fresh poses", "mm").logarithmic();
    chart("Mean error against the number of poses", y, all, Vec::new())
}

fn bounds(content: &Content, rows: &[&FigureRow]) -> Markup {
    let mut all = series(rows, |row| row.bound_mm);
    all.push(ring(rows, |row| row.bound_mm));
    let y = Axis::new("bound over robots", "mm").including(&[0.0]);
    chart("Bound against the number of poses", y, all, steps::tolerance(content))
}

fn chart(title: &str, y: Axis, series: Vec<Series>, limits: Vec<Limit>) -> Markup {
    Chart {
        title: title.to_owned(),
        description: "One line for each way to choose poses, on simulated robots identified by the full error model.".to_owned(),
        x: Axis::new("poses measured", "").logarithmic(),
        y,
        series,
        limits,
    }
    .svg()
}

fn all_rows(content: &Content, rows: &[&FigureRow]) -> Markup {
    let share = content.promise().map_or(0.95, |promise| promise.bound_share);
    let head = html! {
        th.word { "Design" } th { "Poses" } th { "Mean" } th { "Mean expected" } th { "p95" }
        th { (percent(share)) " % expected" } th { "Bound" } (cells::robots_head())
    };
    let body = html! {
        @for row in rows {
            tr.chosen[row.chosen] {
                th.word scope="row" { (words::design(row.design)) @if row.chosen { small { "the session's" } } }
                td { (whole(row.poses as u64)) }
                @for value in [row.mean_mm, row.expected_mean_mm, row.p95_mm, row.expected_share_mm, row.bound_mm] {
                    td { (optional(value, 3)) }
                }
                (cells::robots(row))
            }
        }
    };
    html! {
        (super::table(&head, &body))
        p.note {
            "Expected: the error model's statement before measuring, from the sizes of errors that it allows any arm. If it is far above "
            "the robots' errors it is cautious, if below it promises too much; the plan's promise is based on the robots."
        }
    }
}
