//! The session: the places of the poses, the order of their visits, and the expected error of a session that ends early.

use maud::{Markup, html};

use super::content::Content;
use crate::io::tables::sampling_plan::{VisitPurpose, VisitRow};
use crate::page::words::{self, fixed, whole};
use crate::report::chart::{Axis, Chart, Marks, Series};

/// Most visits that are listed; the table has all.
const MOST_LISTED: usize = 500;
/// Most places of one purpose that are drawn: more would hide each other.
const MOST_DRAWN: usize = 400;
/// Projections of the work space: name, across, upwards.
const VIEWS: [(&str, usize, usize); 3] =
    [("From above", 0, 1), ("From the front", 0, 2), ("From the side", 1, 2)];
const AXES: [&str; 3] = ["x", "y", "z"];

pub(super) fn section(content: &Content) -> Option<Markup> {
    let visits = &content.visits;
    if visits.is_empty() {
        return None;
    }
    Some(html! {
        p {
            (whole(visits.len() as u64)) " visits in an order of short joint travel. On poses to " em { "identify" } " the model is fitted; those to "
            em { "verify" } " take no part in it and test the promise; ringed poses are visited " em { "again" } ", for the drift of the base."
        }
        div.pair {
            @for view in VIEWS { figure { (view_of(visits, view)) figcaption { (view.0) ", frame of commands; each axis has a scale of its own." } } }
            figure { (early_end(visits)) figcaption {
                "Error that the model expects once this number of poses is measured, in the order they were chosen: a session that has to end "
                "early keeps the first by " code { "chosen_as" } "."
            } }
        }
        (counts(content))
        details {
            summary { "Every visit in order" }
            (rows(content))
            @if visits.len() > MOST_LISTED {
                p.note { "The first " (MOST_LISTED) " of " (whole(visits.len() as u64)) "; all of them are in " code { "sampling_plan" } "." }
            }
        }
    })
}

fn view_of(visits: &[VisitRow], (name, across, up): (&str, usize, usize)) -> Markup {
    let places = |purpose: VisitPurpose| {
        let own: Vec<&VisitRow> = visits.iter().filter(|visit| visit.purpose == purpose).collect();
        let every = own.len().div_ceil(MOST_DRAWN).max(1);
        let at = |visit: &&VisitRow| [visit.position[across], visit.position[up]];
        own.iter().step_by(every).map(at).collect::<Vec<_>>()
    };
    Chart {
        title: format!("Planned poses, {}", name.to_lowercase()),
        description: "Places of the target at every planned pose, by what the visit is for."
            .to_owned(),
        x: Axis::new(AXES[across], "mm"),
        y: Axis::new(AXES[up], "mm"),
        series: vec![
            Series::points("verify", places(VisitPurpose::Verify)).looking(1),
            Series::points("identify", places(VisitPurpose::Identify)).looking(0),
            Series::new("again, for drift", vec![Marks::Rings(places(VisitPurpose::DriftCheck))])
                .looking(2),
        ],
        limits: Vec::new(),
    }
    .svg()
}

/// The root of the remaining variance, against the number of measured poses.
fn early_end(visits: &[VisitRow]) -> Markup {
    let point = |visit: &VisitRow| {
        let measured = visit.chosen_as? + 1;
        Some([measured as f64, visit.variance_left_mm2?.sqrt()])
    };
    // A visit for drift repeats a chosen pose, which counts once.
    let own = visits.iter().filter(|visit| visit.repeats.is_none());
    let mut points: Vec<[f64; 2]> = own.filter_map(point).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Chart {
        title: "Expected error against poses measured".to_owned(),
        description: "Root of the predicted variance that is left over the region, falling with each chosen pose.".to_owned(),
        x: Axis::new("poses measured, in the order chosen", ""),
        y: Axis::new("expected error, rms over the region", "mm").logarithmic(),
        series: vec![Series::line_and_points("", points).looking(0)],
        limits: Vec::new(),
    }
    .svg()
}

fn counts(content: &Content) -> Markup {
    html! {
        @for count in &content.counts {
            p.note {
                (whole(count.read)) " " (count.of) " were drawn and " (whole(count.kept)) " suit the constraints"
                @for (reason, rejected) in &count.rejected { "; " (whole(*rejected)) " " (words::plain(reason)) }
                "."
            }
        }
    }
}

/// Whether a joint (from 0) slides, so that its values are in mm.
fn slides(content: &Content, joint: usize) -> bool {
    let units = content.visits.first().and_then(|visit| visit.joint_units.as_ref());
    units.is_some_and(|units| units.get(joint).is_some_and(|unit| unit == "mm"))
}

fn rows(content: &Content) -> Markup {
    let joints = content.visits.iter().take(1).flat_map(|first| first.joint_names.iter());
    let head = html! {
        th { "Target" } th.word { "Purpose" }
        @for (place, joint) in joints.enumerate() { th { (joint) @if slides(content, place) { ", mm" } @else { ", °" } } }
        @for axis in AXES { th { (axis) ", mm" } } th { "Chosen as" }
    };
    let body = html! {
        @for visit in content.visits.iter().take(MOST_LISTED) {
            tr {
                th scope="row" { (visit.target) }
                td.word { (words::purpose(visit.purpose)) @if let Some(first) = repeated(content, visit) { ", of " (first) } }
                @for (place, value) in visit.joints_rad.iter().enumerate() {
                    td { (fixed(if slides(content, place) { *value } else { value.to_degrees() }, 3)) }
                }
                @for place in visit.position { td { (fixed(place, 1)) } }
                td { @match visit.chosen_as { Some(place) => (place), None => "–" } }
            }
        }
    };
    super::table(&head, &body)
}

fn repeated<'c>(content: &'c Content, visit: &VisitRow) -> Option<&'c str> {
    let first = content.visits.iter().find(|own| Some(own.pose) == visit.repeats)?;
    Some(&first.target)
}
