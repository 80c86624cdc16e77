//! Other influences on a grid: the place of its nodes, the turn of the tool, mixed configurations, near singularities.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::cells;
use super::content::Content;
use crate::grid::Interpolation;
use crate::io::table::Word as _;
use crate::io::tables::plan_figures::{CorrectedBy, FigureRow, FigureStudy};
use crate::page::words::{self, fixed, optional, whole};
use crate::report::chart::{Axis, Chart, Series};

/// A study, its heading, the axis of what is varied, and what that means.
struct Study {
    varied: FigureStudy,
    heading: &'static str,
    axis: (&'static str, &'static str),
    says: &'static str,
}

const STUDIES: [Study; 4] = [
    Study {
        varied: FigureStudy::GridShift,
        heading: "Place of the grid",
        axis: ("grid moved along each axis", "steps"),
        says: "One step with its nodes at different places, judged inside all these grids.",
    },
    Study {
        varied: FigureStudy::OrientationMismatch,
        heading: "Turned tool",
        axis: ("tool turned away from the table's orientation", "°"),
        says: "Nodes at the table's orientation, fresh poses turned away from it.",
    },
    Study {
        varied: FigureStudy::MixedConfiguration,
        heading: "Mixed configuration",
        axis: ("share of nodes measured with the wrist flipped", ""),
        says: "Some nodes measured in another configuration than the poses they correct.",
    },
    Study {
        varied: FigureStudy::SingularityDistance,
        heading: "Near singularities",
        axis: ("least singularity factor, lower edge", ""),
        says: "Fresh poses by their distance to a singularity: 0 is in one.",
    },
];
/// Sources of node values and their looks for mean and 95th percentile.
const SOURCES: [(CorrectedBy, [usize; 2]); 2] =
    [(CorrectedBy::Measured, [1, 3]), (CorrectedBy::Model, [0, 2])];
/// The interpolation that is drawn.
const DRAWN: Interpolation = Interpolation::Trilinear;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let of = |study: &'static Study| {
        let rows = content.of_study(study.varied);
        (!rows.is_empty()).then_some((study, rows))
    };
    let studies: Vec<(&Study, Vec<&FigureRow>)> = STUDIES.iter().filter_map(of).collect();
    let first = studies.first()?.1.first()?;
    Some(html! {
        p {
            "All at one step, " (first.step_mm.unwrap_or(0.0)) " mm, on " (first.robots) " simulated robots, "
            "with " (DRAWN.word()) " interpolation drawn. Each chart has a scale of its own."
        }
        div.pair {
            @for (study, rows) in &studies {
                figure { h3 { (study.heading) } (chart(study, rows)) figcaption { (study.says) (missing(rows)) } }
            }
        }
        @for (study, rows) in &studies {
            details { summary { (study.heading) ": every source and interpolation" } (all_rows(study, rows)) }
        }
    })
}

fn chart(study: &Study, rows: &[&FigureRow]) -> Markup {
    let points = |source: CorrectedBy, value: fn(&FigureRow) -> Option<f64>| {
        let own = rows.iter().filter(|row| row.source == source && is_drawn(row));
        let mut points: Vec<[f64; 2]> =
            own.filter_map(|row| Some([row.value?, value(row)?])).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    let series = SOURCES.into_iter().flat_map(|(source, [mean, p95])| {
        let name = source.word();
        [
            Series::line_and_points(&format!("{name}, p95"), points(source, |row| row.p95_mm))
                .looking(p95),
            Series::line_and_points(&format!("{name}, mean"), points(source, |row| row.mean_mm))
                .looking(mean),
        ]
    });
    let (quantity, unit) = study.axis;
    let values: Vec<f64> = rows.iter().filter_map(|row| row.value).collect();
    Chart {
        title: study.heading.to_owned(),
        description: study.says.to_owned(),
        x: Axis::new(quantity, unit).including(&values),
        y: Axis::new("error norm left", "mm").including(&[0.0]),
        series: series.collect(),
        limits: Vec::new(),
    }
    .svg()
}

fn is_drawn(row: &FigureRow) -> bool {
    row.interpolation == Some(DRAWN)
}

/// A sentence on the values that have no figure, and on those with too few poses for a bound.
fn missing(rows: &[&FigureRow]) -> String {
    let drawn = || rows.iter().filter(|row| is_drawn(row));
    let is_absent = |row: &FigureRow| row.refused == 0 && row.outside == 0;
    let unjudged = || drawn().filter(|row| row.mean_mm.is_none());
    let absent = values(unjudged().filter(|row| is_absent(row)));
    let none = values(unjudged().filter(|row| !is_absent(row)));
    let few = values(drawn().filter(|row| row.mean_mm.is_some() && row.judged == 0));
    let say = |words: &str, values: String| {
        if values.is_empty() { values } else { format!(" {words} {values}.") }
    };
    say("The region has no poses, so nothing was judged, at", absent)
        + &say("No pose could be judged at", none)
        + &say("Too few fresh poses for a bound, so read with care, at", few)
}

/// The values of rows, each once, from the smallest.
fn values<'r>(rows: impl Iterator<Item = &'r &'r FigureRow>) -> String {
    // Values are small and not negative, and such floats are in the order of their bits.
    let values: BTreeSet<u64> = rows.filter_map(|row| Some(row.value?.to_bits())).collect();
    let words = values.into_iter().map(|bits| number(f64::from_bits(bits)));
    words.collect::<Vec<_>>().join(", ")
}

/// A value without the last digits of a conversion from radians.
fn number(value: f64) -> String {
    let text = fixed(value, 3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn all_rows(study: &Study, rows: &[&FigureRow]) -> Markup {
    let (quantity, unit) = study.axis;
    let head = html! {
        th { "Value: " (quantity) @if !unit.is_empty() { ", " (unit) } } th.word { "Node values" } th { "Poses" } th { "Not reached" }
        th { "Mean" } th { "p95" } th { "Judged" } (cells::robots_head()) th { "Poses refused" } th { "Outside" }
    };
    let body = html! {
        @for row in rows {
            tr {
                th scope="row" { (row.value.map_or_else(|| "–".to_owned(), number)) }
                td.word { (words::family(row)) }
                td { (whole(row.poses as u64)) }
                td { (row.not_reached) }
                @for value in [row.mean_mm, row.p95_mm] { td { (optional(value, 3)) } }
                td { (row.judged) }
                (cells::robots(row))
                td { (whole(row.refused as u64)) }
                td { (whole(row.outside as u64)) }
            }
        }
    };
    html! {
        (super::table(&head, &body))
        p.note { "Judged: robots with enough fresh poses for a bound; where there are none, it is not shown whether robots meet the tolerance." }
    }
}
