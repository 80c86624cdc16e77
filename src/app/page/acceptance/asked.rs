//! What ISO 9283:1998 asks of a test (its clauses 6 and 7), and what the session has of it: the first table of an acceptance report.

use super::Report;
use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::page::words;
use crate::report::Moment;
use crate::report::iso_9283::Characteristic;

const NOT_STATED: &str = "not stated";

/// A row a subject of the standard: its name, what the standard asks, and what the session has of it.
pub(super) fn rows(of: &Report<'_>) -> Vec<Vec<String>> {
    let conditions = &of.arm.valid_for.conditions;
    let stated = |what: &Option<String>| what.clone().unwrap_or_else(|| NOT_STATED.to_owned());
    let (arm, controller) = (&of.arm.arm_model, stated(&conditions.controller_model));
    let load = conditions.payload_kg.map_or_else(
        || NOT_STATED.to_owned(),
        |kg| format!("{kg} kg; rated load, centre of mass and inertia: not stated"),
    );
    let robot = format!("{arm}; controller: {controller}; serial number: not stated");
    let instrument = "uncertainty as below; type, serial number and calibration: not stated";
    let rows = [
        ("Robot", "maker, type, serial number, controller", robot),
        ("Instrument", "type, calibration, uncertainty", instrument.to_owned()),
        ("Load", "100 % of the rated load", load),
        ("Speed", "100 % of the largest; 50 % and 10 % besides", NOT_STATED.to_owned()),
        ("Warm-up", "as the maker says; drift from cold", NOT_STATED.to_owned()),
        ("Mounting", "as the maker recommends", stated(&conditions.mounting)),
        ("Temperature", "20 °C ± 2 °C, others with a reason", temperature(of)),
        ("Poses", "5, in a plane of a cube in the work space", poses(of)),
        ("Cycles per pose", "30", cycles(of)),
        ("Measured", "position and orientation", measured(of)),
        ("Uncertainty", "at most a quarter of the figure", uncertainty(of)),
        ("Drift", "8 h from cold", drift(of)),
        ("Other figures", "stabilization, overshoot, paths, compliance", "not done".to_owned()),
    ];
    rows.map(|(what, asked, here)| vec![what.to_owned(), asked.to_owned(), here]).into()
}

/// The text after whether it is as the standard asks.
fn held(is_as_asked: bool, text: &str) -> String {
    format!("{}: {text}", if is_as_asked { "as asked" } else { "not as asked" })
}

fn figures<'r>(of: &'r Report<'_>, own: Characteristic) -> impl Iterator<Item = &'r AccuracyRow> {
    of.iso_9283().filter(move |row| row.name == FigureName::Iso(own) && row.value.is_some())
}

fn temperature(of: &Report<'_>) -> String {
    let valid = &of.arm.valid_for;
    let met = valid.temperature_min_c.zip(valid.temperature_max_c);
    let Some((least, most)) = met else { return NOT_STATED.to_owned() };
    held(least >= 18.0 && most <= 22.0, &format!("{least} to {most} °C while measuring"))
}

fn poses(of: &Report<'_>) -> String {
    let ending = &of.run.ending;
    let [poses, visits] = [ending.held_out, ending.visits].map(Option::unwrap_or_default);
    held(false, &format!("the session's own; {poses} poses in {visits} visits judge"))
}

fn cycles(of: &Report<'_>) -> String {
    let visits = figures(of, Characteristic::RpL).map(|own| own.n).max();
    match visits {
        Some(visits) => held(visits >= 30, &format!("{visits} at most")),
        None => held(false, &format!("1; {}", of.no_visits())),
    }
}

fn measured(of: &Report<'_>) -> String {
    match figures(of, Characteristic::RpA).next() {
        Some(_) => held(true, "both"),
        None => held(false, "figures of positions alone"),
    }
}

/// U beside the smallest AP that was measured over all poses.
fn uncertainty(of: &Report<'_>) -> String {
    let Some(u_mm) = of.expanded_uncertainty_mm() else { return NOT_STATED.to_owned() };
    let u = format!("U = {} mm (k = 2) of one position", words::fixed(u_mm, 3));
    let measured = figures(of, Characteristic::ApP).filter(|own| own.evidence != Moment::After);
    let accuracies = measured.filter(|own| own.pose.is_none()).filter_map(|own| own.value);
    match accuracies.min_by(f64::total_cmp) {
        Some(ap) => held(4.0 * u_mm <= ap, &format!("{u}, AP_p from {} mm", words::fixed(ap, 3))),
        None => u,
    }
}

fn drift(of: &Report<'_>) -> String {
    match figures(of, Characteristic::DapP).next() {
        Some(_) => held(false, "over the session alone, dAP_p below"),
        None => "not done".to_owned(),
    }
}
