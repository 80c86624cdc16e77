//! Identified parameters with their intervals; those that are not identifiable with what they are confounded with.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::figures::expanded;
use crate::fit::Identifiability;
use crate::io::tables::parameters::{BelongsTo, ParameterRow};
use crate::io::tables::words::Unit;
use crate::report::Model;
use crate::report::chart::{Axis, Chart, Marks, Series};
use crate::report::symbols::symbol;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let of = |model: Model| -> Vec<&ParameterRow> {
        content.parameters.iter().filter(|p| p.model == model).collect()
    };
    let model = [Model::Full, Model::Geometric, Model::BaseTarget]
        .into_iter()
        .find(|model| !of(*model).is_empty())?;
    let own = of(model);
    let (identifiable, unidentifiable): (Vec<&ParameterRow>, Vec<&ParameterRow>) =
        own.iter().partition(|p| p.identifiability == Identifiability::Identifiable);
    Some(html! {
        p {
            "Parameters of the " (model.about().name) ": identified offsets from the nominal arm, with 95 % intervals (± two standard errors). "
            (identifiable.len()) " of " (own.len()) " are identifiable. Every model's are in " code { "parameters" } ", where θ₁ is " code { "theta_1" } "."
        }
        div.pair {
            @for (unit, shown, scale) in [(Unit::Mm, "mm", 1.0), (Unit::Rad, "mrad", 1e3)] {
                @let links = identifiable.iter().copied().filter(|p| p.belongs_to == BelongsTo::Link && p.unit == unit).collect::<Vec<_>>();
                @let apart = unidentifiable.iter().filter(|p| p.belongs_to == BelongsTo::Link && p.unit == unit).count();
                @if !links.is_empty() {
                    figure {
                        (chart(&links, shown, scale))
                        figcaption {
                            "Links of the arm, " (if unit == Unit::Mm { "lengths" } else { "angles" }) "."
                            @if apart > 0 { " " (apart) " that are not identifiable stand below." }
                        }
                    }
                }
            }
        }
        @let links = unidentifiable.iter().copied().filter(|p| p.belongs_to == BelongsTo::Link).collect::<Vec<_>>();
        @let others = unidentifiable.len() - links.len();
        @if !links.is_empty() { h3 { "Not identifiable" } (unidentifiable_rows(&links)) }
        @if others > 0 { p.note { "Of bases and targets " (others) " are not identifiable either: what the links' parameters leave open is open in them too." } }
        details { summary { "All " (own.len()) " parameters" } (rows(&own)) }
    })
}

/// The chart of identifiable parameters: those that are not stand below it and do not set its scale.
fn chart(parameters: &[&ParameterRow], unit: &str, scale: f64) -> Markup {
    let numbered = || {
        let numbered = parameters.iter().enumerate();
        numbered.map(|(place, own)| (place as f64 + 1.0, *own))
    };
    let points = numbered().map(|(x, own)| [x, scale * own.offset]);
    let span = |(x, own): (f64, &ParameterRow)| {
        let half = expanded(own.standard_error?);
        Some([x, scale * (own.offset - half), scale * (own.offset + half)])
    };
    let whiskers = Marks::Whiskers(numbered().filter_map(span).collect());
    let found = vec![whiskers, Marks::Points(points.collect())];
    let (first, last) = (0.4, parameters.len() as f64 + 0.6);
    Chart {
        title: format!("Offsets of the arm's parameters, {unit}"),
        description:
            "Identified minus nominal of each identifiable parameter, with its 95 % interval."
                .to_owned(),
        x: Axis {
            names: parameters.iter().map(|own| symbol(&own.parameter)).collect(),
            ..Axis::new("parameter", "")
        },
        y: Axis::new("identified minus nominal", unit).including(&[0.0]),
        series: vec![
            Series::line("", vec![[first, 0.0], [last, 0.0]]).looking(4),
            Series::new("", found).looking(0),
        ],
        limits: Vec::new(),
    }
    .svg()
}

fn unidentifiable_rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th.word { "Unit" } th { "Offset" } th { "95 % interval" } th.word { "Why" } th.word { "Confounded with" } };
    let body = html! {
        @for parameter in parameters {
            tr {
                th.word scope="row" { (named(parameter)) }
                (values(parameter))
                td.word { (words::identifiability(parameter.identifiability)) }
                td.word { @if parameter.confounded_with.is_empty() { "no single other one" } @else { (symbols(&parameter.confounded_with)) } }
            }
        }
    };
    super::table(&head, &body)
}

fn rows(parameters: &[&ParameterRow]) -> Markup {
    let head = html! { th { "Parameter" } th { "Nominal" } th.word { "Unit" } th { "Offset" } th { "95 % interval" } th.word { "Identifiable" } };
    let body = html! { @for parameter in parameters { (row(parameter)) } };
    super::table(&head, &body)
}

fn row(parameter: &ParameterRow) -> Markup {
    let (_, scale) = unit(parameter);
    html! {
        tr {
            th.word scope="row" { (named(parameter)) }
            td { data value=(parameter.nominal) { (words::fixed(scale * parameter.nominal, 3)) } }
            (values(parameter))
            td.word { (words::identifiability(parameter.identifiability)) }
        }
    }
}

/// An offset below this share of its standard error is where its prior put it, and not found.
const HELD: f64 = 1e-4;

/// Whether the value is a convention: offsets are counted from it, or others have all of its motion and it keeps its nominal value.
fn is_by_convention(parameter: &ParameterRow) -> bool {
    match (parameter.identifiability, parameter.standard_error) {
        (Identifiability::ByConvention, _) | (_, None) => true,
        (Identifiability::StructurallyDependent, Some(error)) => {
            parameter.offset.abs() <= HELD * error
        }
        _ => false,
    }
}

/// Unit, offset and interval; a component that is fixed by convention says so.
fn values(parameter: &ParameterRow) -> Markup {
    let (unit, scale) = unit(parameter);
    let fixed = |value: f64| words::fixed(scale * value, 3);
    let error = parameter.standard_error;
    html! {
        td.word { (unit) }
        @match error.filter(|_| !is_by_convention(parameter)) {
            None => { td { "0" } td { "by convention" } },
            Some(error) => {
                td { data value=(parameter.offset) { (fixed(parameter.offset)) } }
                td { (fixed(parameter.offset - expanded(error))) " … " (fixed(parameter.offset + expanded(error))) }
            },
        }
    }
}

/// The unit of a parameter's values as shown, and what they are multiplied by.
const fn unit(parameter: &ParameterRow) -> (&'static str, f64) {
    match parameter.unit {
        Unit::Rad => ("mrad", 1e3),
        Unit::Mm => ("mm", 1.0),
        Unit::One => ("", 1.0),
    }
}

fn symbols(names: &[String]) -> String {
    let symbols: Vec<String> = names.iter().map(|name| symbol(name)).collect();
    symbols.join(", ")
}

fn named(parameter: &ParameterRow) -> String {
    let symbol = symbol(&parameter.parameter);
    match &parameter.of_session {
        Some(session) => format!("{symbol} of {session}"),
        None => symbol,
    }
}
