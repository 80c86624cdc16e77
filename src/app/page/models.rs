//! The fit of the models: convergence, rank, evidence for each part, and the conditions that the results are valid for.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::figures::expanded;
use crate::fit::CONDITION_LIMIT;
use crate::io::tables::calibrations::CalibrationRow;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let first = content.calibrations.first()?;
    let head = html! { th { "Model" } th { "Stations" } th { "Weighted down" } th { "Parameters" } th { "Rank" } th { "Condition" } th { "s²" } th { "Misfit per axis, mm" } th.word { "Ended because" } };
    let body = html! { @for calibration in &content.calibrations { (row(calibration)) } };
    let is_ill = |own: &&CalibrationRow| own.fit.condition.is_some_and(|c| c > CONDITION_LIMIT);
    let ill: Vec<&CalibrationRow> = content.calibrations.iter().filter(is_ill).collect();
    let parts = content.calibrations.iter().find(|calibration| !calibration.parts_tried.is_empty());
    Some(html! {
        p { "Identified from " (first.of_arm.sessions.join(", ")) @if first.of_arm.sessions.len() > 1 { ", pooled: one arm, each session with its own base and target" } "." }
        (super::table(&head, &body))
        p.note { "An s² far above 1 shows that the model, not the noise, is the limit. Converged is not accurate: accuracy is what held-out stations show." }
        @if let (Some(size), Some(se)) = (first.of_arm.camera_size, first.of_arm.camera_size_se) {
            p {
                "The camera's noise is " (words::number(size, 2)) " ± " (words::number(expanded(se), 2))
                " times what is stated for it, by likelihood (± two standard errors); every model counts it so."
            }
        }
        @for calibration in ill {
            p.warning {
                "The condition of the model " q { (calibration.model_kind.about().name) } " is " (words::optional(calibration.fit.condition, 0))
                ", above " (CONDITION_LIMIT) ": some of its parameters are hardly determined by these poses, though its predictions near them are."
            }
        }
        @if let Some(calibration) = parts { h3 { "Parts of the full error model" } (part_rows(calibration)) }
        @if !content.said.notes.is_empty() { h3 { "Notes" } ul { @for note in &content.said.notes { li { (note) } } } }
        h3 { "Valid for" }
        dl.list { @for (name, value) in valid_for(first) { div { dt { (name) } dd { (value) } } } }
    })
}

fn row(calibration: &CalibrationRow) -> Markup {
    html! {
        tr {
            th.word scope="row" { (calibration.model_kind.about().name) }
            td { (calibration.stations) }
            td { (calibration.stations_downweighted) }
            td { (calibration.parameters) }
            td { @match calibration.fit.rank { Some(rank) => (rank), None => "–" } }
            td { (words::optional(calibration.fit.condition, 0)) }
            td { (words::optional(calibration.fit.variance_factor, 2)) }
            td { (words::optional(calibration.fit.misfit_mm, 3)) }
            td.word { (calibration.fit.convergence) @if let Some(made) = calibration.fit.iterations { small { (made) " iterations" } } }
        }
    }
}

fn part_rows(calibration: &CalibrationRow) -> Markup {
    let head = html! { th { "Part" } th { "Evidence, nats" } th.word { "Kept" } };
    let body = html! {
        @for (name, gain) in calibration.parts_tried.iter().zip(&calibration.parts_gain_nat) {
            tr {
                th.word scope="row" { (words::plain(name)) }
                td { (words::number(*gain, 1)) }
                td.word { @if *gain > 0.0 { "yes" } @else { "no" } }
            }
        }
    };
    super::table(&head, &body)
}

/// The conditions that a model is valid for: name and value.
fn valid_for(row: &CalibrationRow) -> [(&'static str, String); 9] {
    let valid_for = &row.of_arm.valid_for;
    let slides = |joint: usize| {
        let units = valid_for.joint_units.as_ref();
        units.is_some_and(|units| units.get(joint).is_some_and(|unit| unit == "mm"))
    };
    // A minus sign is wider than a hyphen.
    let range = |(joint, [low, high]): (usize, [f64; 2])| {
        let range = if slides(joint) {
            format!("{low:.1} mm to {high:.1} mm")
        } else {
            format!("{:.1}° to {:.1}°", low.to_degrees(), high.to_degrees())
        };
        range.replace('-', "\u{2212}")
    };
    let joints = valid_for.joint_ranges().into_iter().enumerate().map(range);
    let joints =
        valid_for.joint_names.iter().zip(joints).map(|(name, range)| format!("{name} {range}"));
    let met = valid_for.temperature_min_c.zip(valid_for.temperature_max_c);
    let temperature =
        met.map(|(low, high)| format!("{low:.1} to {high:.1} °C, as met while measuring"));
    let conditions = &valid_for.conditions;
    let option = conditions.absolute_accuracy_option;
    let stated = [
        ("Arm", Some(row.of_arm.arm_model.clone())),
        ("Tool", conditions.tool.clone()),
        ("Payload", conditions.payload_kg.map(|kg| format!("{kg} kg"))),
        ("Mounting", conditions.mounting.clone()),
        ("Base", conditions.base.clone()),
        ("Controller", conditions.controller_model.clone()),
        ("Absolute accuracy option", option.map(|on| if on { "on" } else { "off" }.to_owned())),
        ("Temperature", temperature),
        ("Joint angles", Some(joints.collect::<Vec<_>>().join(", "))),
    ];
    stated.map(|(name, value)| (name, value.unwrap_or_else(|| "not stated".to_owned())))
}
