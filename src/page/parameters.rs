//! Identified parameters with their intervals; those that are not identifiable with what they are confounded with.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::fit::Identifiability;
use crate::io::tables::parameters::{BelongsTo, ParameterRow};
use crate::io::tables::words::Unit;
use crate::report::Model;
use crate::report::chart::{Axis, Chart, Marks, Series};

/// Half-width of a 95 % interval of a Gaussian, in standard errors.
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
    let (identifiable, unidentifiable): (Vec<&ParameterRow>, Vec<&ParameterRow>) =
        own.iter().partition(|p| is_identifiable(p));
    Some(html! {
        p {
            "Parameters of the " (words::model(model)) ": identified offsets from the nominal arm, with 95 % intervals. "
            (identifiable.len()) " of " (own.len()) " are identifiable. Every model's are in " code { "parameters" } "."
        }
        div.pair {
            @for (unit, shown, scale) in [(Unit::Mm, "mm", 1.0), (Unit::Rad, "mrad", 1e3)] {
                @let links = own.iter().copied().filter(|p| p.belongs_to == BelongsTo::Link && p.unit == unit).collect::<Vec<_>>();
                @if !links.is_empty() { figure { (chart(&links, shown, scale)) figcaption { "Links of the arm, " (if unit == Unit::Mm { "lengths" } else { "angles" }) "." } } }
            }
        }
        @if !unidentifiable.is_empty() { h3 { "Not identifiable" } (unidentifiable_rows(&unidentifiable)) }
        details { summary { "All " (own.len()) " parameters" } (rows(&own)) }
    })
}

fn is_identifiable(parameter: &ParameterRow) -> bool {
    parameter.identifiability == Identifiability::Identifiable
}

/// The symbol of a link's parameter, such as θ₁ for `theta_1`.
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
    let of = |identifiable: bool| -> Vec<(f64, &ParameterRow)> {
        let numbered = parameters
            .iter()
            .enumerate()
            .map(|(place, p)| (place as f64 + 1.0, *p));
        numbered
            .filter(|(_, p)| is_identifiable(p) == identifiable)
            .collect()
    };
    let series = |name: &str, identifiable: bool| {
        let own = of(identifiable);
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
            series("identifiable", true).looking(0),
            series("not identifiable", false).looking(1),
        ],
        limits: Vec::new(),
    }
    .svg()
}

fn unidentifiable_rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th.word { "Why" } th.word { "Confounded with" } };
    let body = html! {
        @for parameter in parameters {
            tr {
                th.word scope="row" { (named(parameter)) }
                td.word { (words::identifiability(parameter.identifiability)) }
                td.word { @if parameter.confounded_with.is_empty() { "no single other one" } @else { (parameter.confounded_with.join(", ")) } }
            }
        }
    };
    super::table(&head, &body)
}

fn rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th.word { "Unit" } th { "Nominal" } th { "Offset" } th { "95 % interval" } th.word { "Identifiable" } };
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
