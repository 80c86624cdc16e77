//! Identified parameters with their intervals, and what could not be told apart from what.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::fit::Identifiability;
use crate::io::tables::parameters::{BelongsTo, ParameterRow};
use crate::io::tables::words::Unit;
use crate::report::Model;
use crate::report::chart::{Axis, Chart, Marks, Series};

/// Standard errors that a 95 % interval of a Gaussian reaches.
const REACH: f64 = 1.96;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let of = |model: Model| -> Vec<&ParameterRow> {
        content
            .parameters
            .iter()
            .filter(|p| p.model == model)
            .collect()
    };
    let model = [Model::Full, Model::Geometric, Model::BaseTarget]
        .into_iter()
        .find(|model| !of(*model).is_empty())?;
    let own = of(model);
    let (told, untold): (Vec<&ParameterRow>, Vec<&ParameterRow>) =
        own.iter().partition(|p| is_told_apart(p));
    Some(html! {
        p {
            "Parameters of the " (words::model(model)) ": what was identified beside the nominal arm, with 95 % intervals. "
            (told.len()) " of " (own.len()) " could be told apart. Every model's are in " code { "parameters" } "."
        }
        div.pair {
            @for (unit, shown, scale) in [(Unit::Mm, "mm", 1.0), (Unit::Rad, "mrad", 1e3)] {
                @let links = own.iter().copied().filter(|p| p.belongs_to == BelongsTo::Link && p.unit == unit).collect::<Vec<_>>();
                @if !links.is_empty() { figure { (chart(&links, shown, scale)) figcaption { "Links of the arm, " (if unit == Unit::Mm { "lengths" } else { "angles" }) "." } } }
            }
        }
        @if !untold.is_empty() { h3 { "Not told apart" } (untold_rows(&untold)) }
        details { summary { "All " (own.len()) " parameters" } (rows(&own)) }
    })
}

fn is_told_apart(parameter: &ParameterRow) -> bool {
    parameter.identifiability == Identifiability::ToldApart
}

/// The symbol of a link's parameter: θ₁ for `theta_1`.
fn symbol(parameter: &ParameterRow) -> String {
    let (quantity, joint) = parameter
        .parameter
        .split_once('_')
        .unwrap_or((&parameter.parameter, ""));
    let letter = match quantity {
        "theta" => "θ",
        "alpha" => "α",
        "beta" => "β",
        other => other,
    };
    let below = |digit: char| {
        digit
            .to_digit(10)
            .and_then(|value| char::from_u32(0x2080 + value))
    };
    let joint: String = joint
        .chars()
        .map(|digit| below(digit).unwrap_or(digit))
        .collect();
    format!("{letter}{joint}")
}

fn chart(parameters: &[&ParameterRow], unit: &str, scale: f64) -> Markup {
    let of = |told: bool| -> Vec<(f64, &ParameterRow)> {
        let numbered = parameters
            .iter()
            .enumerate()
            .map(|(place, p)| (place as f64 + 1.0, *p));
        numbered.filter(|(_, p)| is_told_apart(p) == told).collect()
    };
    let series = |name: &str, told: bool| {
        let own = of(told);
        let points = own.iter().map(|(x, p)| [*x, scale * p.offset]).collect();
        let span = |(x, p): &(f64, &ParameterRow)| {
            let half = REACH * p.standard_error?;
            Some([*x, scale * (p.offset - half), scale * (p.offset + half)])
        };
        Series::new(
            name,
            vec![
                Marks::Whiskers(own.iter().filter_map(span).collect()),
                Marks::Points(points),
            ],
        )
    };
    let (first, last) = (0.4, parameters.len() as f64 + 0.6);
    Chart {
        title: format!("Offsets of the arm's parameters, {unit}"),
        description: "Identified minus nominal of each parameter, with its 95 % interval."
            .to_owned(),
        x: Axis::of_names("parameter", parameters.iter().map(|p| symbol(p)).collect()),
        y: Axis::new("identified minus nominal", unit).including(&[0.0]),
        series: vec![
            Series::line("", vec![[first, 0.0], [last, 0.0]]).looking(4),
            series("told apart", true).looking(0),
            series("not told apart", false).looking(1),
        ],
        limits: Vec::new(),
    }
    .svg()
}

fn untold_rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th.word { "Why" } th.word { "Cannot be told from" } };
    let body = html! {
        @for parameter in parameters {
            tr {
                th.word scope="row" { (named(parameter)) }
                td.word { (words::identifiability(parameter.identifiability)) }
                td.word { @if parameter.confused_with.is_empty() { "no single other one" } @else { (parameter.confused_with.join(", ")) } }
            }
        }
    };
    super::table(&head, &body)
}

fn rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th.word { "Unit" } th { "Nominal" } th { "Offset" } th { "95 % interval" } th.word { "Told apart" } };
    let body = html! { @for parameter in parameters { (row(parameter)) } };
    super::table(&head, &body)
}

fn row(parameter: &ParameterRow) -> Markup {
    let (unit, scale) = match parameter.unit {
        Unit::Rad => ("mrad", 1e3),
        Unit::Mm => ("mm", 1.0),
        Unit::One => ("", 1.0),
    };
    let shown = |value: f64| html! { data value=(value) { (words::fixed(scale * value, 3)) } };
    html! {
        tr {
            th.word scope="row" { (named(parameter)) }
            td.word { (unit) }
            td { (shown(parameter.nominal)) }
            td { (shown(parameter.offset)) }
            td { @match parameter.standard_error {
                Some(error) => { (words::fixed(scale * (parameter.offset - REACH * error), 3)) " … " (words::fixed(scale * (parameter.offset + REACH * error), 3)) },
                None => "–",
            } }
            td.word { (words::identifiability(parameter.identifiability)) }
        }
    }
}

fn named(parameter: &ParameterRow) -> String {
    match &parameter.of_session {
        Some(session) => format!("{} of {session}", parameter.parameter),
        None => parameter.parameter.clone(),
    }
}
