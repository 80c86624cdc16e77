//! Joint curves and parameters of the first and of the newest session.

use maud::{Markup, html};

use super::content::{Content, Curve, Parameter};
use crate::page::shell::table;
use crate::page::words::fixed;
use crate::report::chart::{Axis, Chart, Marks, Series};

pub(super) fn curves(content: &Content) -> Option<Markup> {
    let own: Vec<&Curve> = content.curves.iter().filter(|curve| !curve.newest.is_empty()).collect();
    (!own.is_empty()).then(|| {
        html! {
            p { "Error curve of each joint where stations measured it, with bands of two standard deviations; every session's curves are in " code { "history" } "." }
            div.pair { @for curve in own { (figure(curve)) } }
        }
    })
}

fn figure(curve: &Curve) -> Markup {
    let slides = curve.slides;
    let (per_place, per_error) = if slides { (1.0, 1.0) } else { (1.0_f64.to_degrees(), 1e3) };
    let drawn = |name: &str, points: &[[f64; 3]]| {
        let line = points.iter().map(|[angle, error, _]| [angle * per_place, per_error * error]);
        let band = points.iter().map(|[angle, error, sd]| {
            [angle * per_place, per_error * (error - 2.0 * sd), per_error * (error + 2.0 * sd)]
        });
        Series::new(name, vec![Marks::Band(band.collect()), Marks::Line(line.collect())])
    };
    let chart = Chart {
        title: format!("Error curve of joint {}", curve.joint),
        description: "Deviation of the joint over its angle in the first and the newest session."
            .to_owned(),
        x: if slides { Axis::new("joint position", "mm") } else { Axis::new("joint angle", "°") },
        y: Axis::new("deviation", if slides { "mm" } else { "mrad" }),
        series: vec![drawn("first", &curve.first), drawn("newest", &curve.newest)],
        limits: Vec::new(),
    };
    html! { figure { (chart.svg()) figcaption { "Joint " (curve.joint) } } }
}

pub(super) fn parameters(content: &Content) -> Option<Markup> {
    if content.parameters.is_empty() {
        return None;
    }
    let head = html! { th { "Parameter" } th.n { "First" } th.n { "Standard error" } th.n { "Newest" } th.n { "Standard error" } th.word { "Unit" } };
    let body = html! { @for parameter in &content.parameters { (row(parameter)) } };
    Some(html! {
        p {
            "As each session identified them. A wide standard error shows that the session hardly determined the parameter; differences are "
            "tested above, without the directions that neither session determines."
        }
        details { summary { (content.parameters.len()) " parameters" } (table(&head, &body)) }
    })
}

fn row(parameter: &Parameter) -> Markup {
    let (scale, unit) = if parameter.unit == "rad" { (1e3, "mrad") } else { (1.0, "mm") };
    let cells = |found: Option<(f64, f64)>| {
        let text =
            |value: Option<f64>| value.map_or("–".to_owned(), |value| fixed(scale * value, 4));
        html! { td.n { (text(found.map(|(value, _)| value))) } td.n { (text(found.map(|(_, sd)| sd))) } }
    };
    html! { tr { th scope="row" { (parameter.name) } (cells(parameter.first)) (cells(parameter.newest)) td.word { (unit) } } }
}
