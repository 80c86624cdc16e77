//! How well a model is determined, and what it is valid for: a row of `calibrations`.

use super::row::Row;
use crate::report::page::content::Calibration;

pub(super) fn calibration(row: &Row<'_>) -> Calibration {
    Calibration {
        model: row.text("model_kind"),
        sessions: row.texts("sessions"),
        stations: row.whole("stations"),
        downweighted: row.whole("stations_downweighted"),
        parameters: row.whole("parameters"),
        rank: row.optional_whole("rank"),
        condition: row.optional_number("condition"),
        variance_factor: row.optional_number("variance_factor"),
        misfit_mm: row.optional_number("misfit_mm"),
        iterations: row.optional_whole("iterations"),
        convergence: row.text("convergence"),
        parts: row
            .texts("parts_tried")
            .into_iter()
            .zip(row.numbers("parts_gain_nat"))
            .collect(),
        valid_for: valid_for(row),
    }
}

fn valid_for(row: &Row<'_>) -> Vec<(String, String)> {
    let degrees = |column| row.numbers(column).into_iter().map(f64::to_degrees);
    // A minus is wider than a hyphen.
    let range =
        |(low, high): (f64, f64)| format!("{low:.1}° to {high:.1}°").replace('-', "\u{2212}");
    let joints = degrees("joint_lower_rad")
        .zip(degrees("joint_upper_rad"))
        .map(range);
    let joints = row
        .texts("joint_names")
        .into_iter()
        .zip(joints)
        .map(|(name, range)| format!("{name} {range}"));
    let (low, high) = (
        row.optional_number("temperature_min_c"),
        row.optional_number("temperature_max_c"),
    );
    let temperature = low
        .zip(high)
        .map(|(low, high)| format!("{low:.1} to {high:.1} °C, as met while measuring"));
    let option = row.optional_flag("absolute_accuracy_option");
    let stated = [
        ("Arm", Some(row.text("arm_model"))),
        ("Tool", row.optional_text("tool")),
        (
            "Payload",
            row.optional_number("payload_kg")
                .map(|kg| format!("{kg} kg")),
        ),
        ("Mounting", row.optional_text("mounting")),
        ("Base", row.optional_text("base")),
        ("Controller", row.optional_text("controller_model")),
        (
            "Absolute accuracy option",
            option.map(|on| if on { "on" } else { "off" }.to_owned()),
        ),
        ("Temperature", temperature),
        ("Joint angles", Some(joints.collect::<Vec<_>>().join(", "))),
    ];
    stated
        .map(|(name, value)| {
            (
                name.to_owned(),
                value.unwrap_or_else(|| "not stated".to_owned()),
            )
        })
        .into()
}
