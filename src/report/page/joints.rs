//! Joint curves: the error of each joint over its angle, with its band.

use maud::{Markup, html};

use super::content::{Content, JointError};
use crate::report::chart::{Axis, Chart, Marks, Series};

/// Points that a curve has at most: a curve of whole degrees is drawn by every second or third.
const MOST: usize = 180;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let rows = &content.joint_errors;
    let first = rows.first()?;
    let reach = rows
        .iter()
        .filter(|row| row.measured)
        .map(|row| mrad(row.curve_rad.abs() + 2.0 * row.sd_rad));
    let reach = reach.fold(0.0, f64::max);
    Some(html! {
        p {
            "What each joint deviates by at its angle, beside its constant offset. The band is two standard deviations up and "
            "down; dashed is beyond the angles that stations visited, where only the prior speaks. Gear lines, too fine to be "
            "drawn here, are in " code { "joint_errors" } " and within the band's width. All joints on one scale."
        }
        div.pair {
            @for curve in rows.chunk_by(|a, b| a.joint == b.joint) {
                figure { (chart(curve, reach)) figcaption { "Joint " (curve.first().unwrap_or(first).joint) ", " (curve.first().unwrap_or(first).name) } }
            }
        }
    })
}

fn chart(rows: &[JointError], reach: f64) -> Markup {
    let every = rows.len().div_ceil(MOST).max(1);
    let thinned = || rows.iter().step_by(every);
    let point = |row: &JointError| [row.angle_rad.to_degrees(), mrad(row.curve_rad)];
    // What is beyond the measured range may reach far: its band is cut where the scale of all joints ends.
    let span = |row: &JointError| {
        let [x, y] = point(row);
        let half = 2.0 * mrad(row.sd_rad);
        [
            x,
            (y - half).clamp(-reach, reach),
            (y + half).clamp(-reach, reach),
        ]
    };
    let line = |measured: bool| -> Vec<[f64; 2]> {
        let own = thinned().filter(|row| row.measured == measured);
        own.map(point)
            .map(|[x, y]| [x, y.clamp(-reach, reach)])
            .collect()
    };
    let beyond = line(false);
    let middle = thinned()
        .find(|row| row.measured)
        .map_or(0.0, |row| row.angle_rad.to_degrees());
    let (below, above): (Vec<_>, Vec<_>) = beyond.into_iter().partition(|[x, _]| *x < middle);
    Chart {
        title: rows.first().map_or_else(String::new, |row| {
            format!("Error of joint {}, {}", row.joint, row.name)
        }),
        description:
            "Deviation of the joint over its angle, with a band of two standard deviations."
                .to_owned(),
        x: Axis::new("joint angle", "°"),
        y: Axis::new("deviation", "mrad").including(&[-reach, reach]),
        series: vec![
            Series::new(
                "",
                vec![
                    Marks::Band(thinned().map(span).collect()),
                    Marks::Line(line(true)),
                ],
            )
            .looking(0),
            Series::new("", vec![Marks::Line(below), Marks::Line(above)]).looking(4),
        ],
        limits: Vec::new(),
    }
    .svg()
}

fn mrad(rad: f64) -> f64 {
    1e3 * rad
}
