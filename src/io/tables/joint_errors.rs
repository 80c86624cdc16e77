//! `joint_errors`: the error curve of each joint with its standard deviation, on a grid of whole degrees, or of 10 mm for one that slides.

use std::sync::Arc;

use super::PublishContext;
use super::validity::learnt_from;
use super::words::Unit;
use crate::fit::full::FullModel;
use crate::fit::full::curves::JointError;
use crate::judgement::Outcome;
use crate::rows::row;

/// Distance beyond the measured angles at which the curve ends, degrees: there the deviation grows back to the prior's.
const BEYOND_DEG: f64 = 15.0;
/// Distance beyond the measured positions of a joint that slides at which its curve ends, mm.
const BEYOND_MM: f64 = 100.0;
/// Step of the positions of a joint that slides, mm.
const EVERY_MM: f64 = 10.0;
/// The most points of a curve: a range wider than sixteen turns or a hundred metres is an error in the data.
const MOST: usize = 10_000;

row! {
    pub struct JointErrorRow of "joint_errors" {
        joint: usize,
        joint_name: Arc<str>,
        joint_unit: Option<Unit>,
        angle_rad: f64,
        error_rad: f64,
        sd_rad: f64,
        curve_rad: f64,
        gear_lines_rad: f64,
        measured: bool,
    }
}

/// The rows of all joints; none without a full error model.
pub fn rows(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Vec<JointErrorRow> {
    let full = outcome.full.iter();
    full.flat_map(|full| of_model(full, outcome, context)).collect()
}

fn of_model(
    full: &FullModel,
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
) -> Vec<JointErrorRow> {
    let axes: Vec<Vec<f64>> = learnt_from(outcome).map(|s| context.arm.axes(&s.joints)).collect();
    let curves = full.joint_curves();
    let of_joint = |joint: usize| {
        let angles = axes.iter().map(|axes| axes[joint]);
        let (low, high) = angles
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q), high.max(q)));
        let own = &context.arm.joints()[joint];
        let (name, slides): (Arc<str>, bool) = (own.name.as_str().into(), own.slides);
        let row = move |error: JointError| JointErrorRow {
            joint: joint + 1,
            joint_name: Arc::clone(&name),
            joint_unit: Some(if slides { Unit::Mm } else { Unit::Rad }),
            angle_rad: error.angle,
            error_rad: error.error(),
            sd_rad: error.sd,
            curve_rad: error.curve,
            gear_lines_rad: error.gear_lines,
            measured: (low..=high).contains(&error.angle),
        };
        curves.errors(joint, &points(slides, low, high)).into_iter().map(row)
    };
    (0..context.arm.joints().len()).flat_map(of_joint).collect()
}

/// Where the curve of a joint is given, from `low` to `high` and beyond: whole degrees, in rad, or multiples of [`EVERY_MM`]; none
/// where nothing was measured.
fn points(slides: bool, low: f64, high: f64) -> Vec<f64> {
    let [first, last] = if slides {
        [(low - BEYOND_MM) / EVERY_MM, (high + BEYOND_MM) / EVERY_MM]
    } else {
        [low.to_degrees() - BEYOND_DEG, high.to_degrees() + BEYOND_DEG]
    };
    std::iter::successors(Some(first.floor()), |place| Some(place + 1.0))
        .take_while(|place| *place <= last.ceil())
        .take(MOST)
        .map(|place| if slides { place * EVERY_MM } else { place.to_radians() })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_reach_beyond_what_was_measured() {
        // 9.5° to 10.5°: −6 (9.5 − 15 = −5.5, rounded outward) to 26.
        let found = points(false, 9.5_f64.to_radians(), 10.5_f64.to_radians());
        assert_eq!(found.len(), 33);
        assert!((found[0].to_degrees() + 6.0).abs() < 1e-9);
        assert!(points(false, f64::INFINITY, f64::NEG_INFINITY).is_empty());
    }
}
