//! Joint curves: the error of each joint over its angle, with its band.

use maud::{Markup, html};

use super::content::Content;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::words::Unit;
use crate::report::chart::{Axis, Chart, Marks, Series};

/// Most points of a curve: of a curve in whole degrees every second or third is drawn.
const MOST: usize = 360;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let rows = &content.joint_errors;
    if rows.is_empty() {
        return None;
    }
    let reach = |of: bool| {
        let own = rows.iter().filter(|row| slides(row) == of);
        let reach = own.flat_map(|row| span(row)[1..].to_vec());
        reach.fold(0.0, |reach: f64, value| reach.max(value.abs()))
    };
    let reach = [reach(false), reach(true)];
    Some(html! {
        p {
            "Deviation of each joint at its angle, without its constant offset, all joints on one scale. The band is two "
            "standard deviations up and down, of the curve and the gear lines together; the gear lines are too fine to be drawn "
            "here and are in " code { "joint_errors" } ". Dashed: beyond the angles that stations visited."
        }
        div.pair { @for curve in rows.chunk_by(|a, b| a.joint == b.joint) { (figure(curve, reach)) } }
    })
}

/// A joint's curve; `reach` is that of all joints that turn (mrad), and of all that slide (mm).
fn figure(rows: &[JointErrorRow], reach: [f64; 2]) -> Markup {
    let name = rows
        .first()
        .map_or_else(String::new, |row| format!("Joint {}, {}", row.joint, row.joint_name));
    let slides = rows.first().is_some_and(slides);
    let reach = reach[usize::from(slides)];
    let every = rows.len().div_ceil(MOST).max(1);
    let drawn: Vec<&JointErrorRow> = rows.iter().step_by(every).collect();
    let is_first = |row: &&JointErrorRow| row.measured;
    let visited = drawn.iter().copied().find(is_first).map_or(0.0, |row| row.angle_rad);
    let line = |belongs: &dyn Fn(&JointErrorRow) -> bool| {
        let own = drawn.iter().filter(|row| belongs(row));
        Marks::Line(own.map(|row| point(row)).collect())
    };
    let band = Marks::Band(drawn.iter().map(|row| span(row)).collect());
    let beyond = vec![
        line(&|row| !row.measured && row.angle_rad < visited),
        line(&|row| !row.measured && row.angle_rad > visited),
    ];
    let chart = Chart {
        title: format!("Error curve: {name}"),
        description:
            "Deviation of the joint over its angle, with a band of two standard deviations."
                .to_owned(),
        x: if slides { Axis::new("joint position", "mm") } else { Axis::new("joint angle", "°") },
        y: Axis::new("deviation", if slides { "mm" } else { "mrad" }).including(&[-reach, reach]),
        series: vec![
            Series::new("", vec![band, line(&|row| row.measured)]).looking(0),
            Series::new("", beyond).looking(4),
        ],
        limits: Vec::new(),
    };
    html! { figure { (chart.svg()) figcaption { (name) } } }
}

/// Whether the joint slides, so that the row is in mm.
fn slides(row: &JointErrorRow) -> bool {
    row.joint_unit == Some(Unit::Mm)
}

/// A deviation in mrad; in mm of a joint that slides.
fn deviation(row: &JointErrorRow, value: f64) -> f64 {
    if slides(row) { value } else { 1e3 * value }
}

/// Angle in degrees and deviation in mrad; both in mm of a joint that slides.
fn point(row: &JointErrorRow) -> [f64; 2] {
    let place = if slides(row) { row.angle_rad } else { row.angle_rad.to_degrees() };
    [place, deviation(row, row.curve_rad)]
}

/// Angle, and two standard deviations down and up.
fn span(row: &JointErrorRow) -> [f64; 3] {
    let [x, y] = point(row);
    let half = 2.0 * deviation(row, row.sd_rad);
    [x, y - half, y + half]
}
