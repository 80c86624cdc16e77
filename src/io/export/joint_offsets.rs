//! Offsets of the joints alone that come nearest to the identified geometry, as CSV: what mastering can hold of it.
//!
//! Inputs: the geometry of table `calibrations`. Output: a row per joint with the offset of its zero and the standard error, degrees
//! (mm for a joint that slides), after `#` lines with what is left. Steps:
//! 1. the tool point of the identified geometry and of the nominal arm at poses within the measured joint ranges;
//! 2. the offsets `δ` with which the nominal arm at `q + δ` comes nearest to the identified one at `q`, by least squares (Gauss and
//!    Newton); a joint that does not move the tool point has none;
//! 3. `δ = J⁺ J_x x` carries the covariance of the parameters `x`;
//! 4. the distances without and with the offsets, at other poses.

use std::io::Write;
use std::path::Path;

use nalgebra::{DMatrix, DVector, Isometry3};

use super::controller_base::InControllerBase;
use super::{ExportError, held_out};
use crate::fit::conversion::{Errors, measured, spread_joints};
use crate::kinematics::{Arm, Chain, Joint, Twist};

/// Poses that the offsets are found at, and as many others for what is left.
const POSES: usize = 100;
/// Singular values below this share of the largest are of joints that do not move the tool point.
const NO_EFFECT: f64 = 1e-9;
const ROUNDS: usize = 10;

/// Writes the joint offsets of a file of table `calibrations`.
pub fn write(path: &Path, mut sink: impl Write) -> Result<(), ExportError> {
    let own = InControllerBase::read(path)?;
    let found = Mastering::of(&own);
    for line in remarks(path, &own, &found) {
        writeln!(sink, "# {line}")?;
    }
    let mut csv = csv::Writer::from_writer(sink);
    csv.write_record(["joint", "joint_name", "unit", "offset", "standard_error"])?;
    let joints = own.published.arm.arm.joints();
    for (place, joint) in joints.iter().enumerate() {
        let [offset, sd] = [found.offsets[place], found.standard_errors[place]];
        csv.write_record(row(place + 1, joint, offset, sd))?;
    }
    Ok(csv.flush()?)
}

/// Joint offsets, rad or mm, and the distance of the tool point from the identified geometry's.
struct Mastering {
    offsets: DVector<f64>,
    standard_errors: DVector<f64>,
    /// Mean and largest distance of the nominal arm, mm.
    without: [f64; 2],
    /// Mean and largest distance with the offsets, mm.
    with: [f64; 2],
}

/// The identified and the nominal tool point of an arm.
struct Tools<'a> {
    arm: &'a Arm,
    chain: Chain,
    identified: DVector<f64>,
    nominal: DVector<f64>,
}

impl Mastering {
    fn of(own: &InControllerBase) -> Self {
        let arm = &own.published.arm;
        let errors = own.flange_errors();
        let tools = Tools::of(&arm.arm, &errors, arm.flange_from_tool.isometry());
        let poses = |first: usize| -> Vec<Vec<f64>> {
            let place = first..first + POSES;
            place
                .map(|place| within(&arm.arm, &arm.measured, place))
                .collect()
        };
        let (found_at, judged_at) = (poses(0), poses(POSES));
        let mut offsets = DVector::zeros(arm.arm.joints().len());
        for _ in 0..ROUNDS {
            offsets += tools.inverse(&found_at, &offsets) * tools.away(&found_at, &offsets);
        }
        let through = tools.inverse(&found_at, &offsets) * tools.of_parameters(&found_at, &errors);
        let covariance = &through * &errors.covariance * through.transpose();
        Self {
            without: distances(&tools.away(&judged_at, &(&offsets * 0.0))),
            with: distances(&tools.away(&judged_at, &offsets)),
            standard_errors: covariance
                .diagonal()
                .map(|variance| variance.max(0.0).sqrt()),
            offsets,
        }
    }
}

impl<'a> Tools<'a> {
    fn of(arm: &'a Arm, errors: &Errors, flange_from_tool: &Isometry3<f64>) -> Self {
        let chain = measured(arm.chain(), flange_from_tool);
        let parameters = chain.parameters();
        let offset = |parameter| {
            let place = errors.parameters.iter().position(|own| own == parameter);
            place.map_or(0.0, |place| errors.offsets[place])
        };
        Self {
            identified: DVector::from_iterator(parameters.len(), parameters.iter().map(offset)),
            nominal: DVector::zeros(parameters.len()),
            arm,
            chain,
        }
    }

    /// Identified minus nominal tool point with joint offsets, three rows a pose, mm.
    fn away(&self, poses: &[Vec<f64>], offsets: &DVector<f64>) -> DVector<f64> {
        let mut rows = DVector::zeros(3 * poses.len());
        for (place, q) in poses.iter().enumerate() {
            let one = self
                .chain
                .forward(&self.arm.axes(q), self.identified.as_slice());
            let moved = self.arm.axes(&moved(q, offsets));
            let other = self.chain.forward(&moved, self.nominal.as_slice());
            let off = one.translation.vector - other.translation.vector;
            rows.fixed_rows_mut::<3>(3 * place).copy_from(&off);
        }
        rows
    }

    /// The pseudo-inverse of the nominal tool point per joint offset.
    fn inverse(&self, poses: &[Vec<f64>], offsets: &DVector<f64>) -> DMatrix<f64> {
        let columns = poses.iter().map(|q| {
            let axes = self.arm.axes(&moved(q, offsets));
            let twists = self
                .chain
                .differential(&axes, self.nominal.as_slice())
                .joints;
            self.arm.joint_twists(&twists)
        });
        let svd = stacked(columns.collect(), offsets.len()).svd(true, true);
        let floor = NO_EFFECT * svd.singular_values.amax();
        svd.pseudo_inverse(floor)
            .expect("both sides were asked for")
    }

    /// The identified tool point per parameter, in the order of the errors.
    fn of_parameters(&self, poses: &[Vec<f64>], errors: &Errors) -> DMatrix<f64> {
        let twists = poses.iter().map(|q| {
            let axes = self.arm.axes(q);
            let all = self.chain.differential(&axes, self.identified.as_slice());
            let own = self.chain.parameters();
            let of = |wanted| {
                let place = own.iter().position(|parameter| parameter == wanted);
                place.map_or_else(Twist::zero, |place| all.parameters[place])
            };
            errors.parameters.iter().map(of).collect()
        });
        stacked(twists.collect(), errors.parameters.len())
    }
}

/// Motions of a point, three rows a pose and a column a twist.
fn stacked(poses: Vec<Vec<Twist>>, columns: usize) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(3 * poses.len(), columns);
    for (place, twists) in poses.into_iter().enumerate() {
        for (column, twist) in twists.iter().enumerate() {
            rows.fixed_view_mut::<3, 1>(3 * place, column)
                .copy_from(&twist.linear);
        }
    }
    rows
}

fn moved(q: &[f64], offsets: &DVector<f64>) -> Vec<f64> {
    q.iter()
        .zip(offsets.iter())
        .map(|(q, offset)| q + offset)
        .collect()
}

/// Joint positions spread over the measured ranges.
fn within(arm: &Arm, measured: &[[f64; 2]], place: usize) -> Vec<f64> {
    let all = spread_joints(arm, place).into_iter().zip(arm.joints());
    let shares = all.map(|(q, joint)| (q - joint.lower) / (joint.upper - joint.lower));
    let own = shares.zip(measured);
    own.map(|(share, [lower, upper])| lower + (upper - lower) * share)
        .collect()
}

/// Mean and largest length of vectors of three rows.
fn distances(away: &DVector<f64>) -> [f64; 2] {
    let lengths = (0..away.len())
        .step_by(3)
        .map(|row| away.rows(row, 3).norm());
    let (sum, largest) = lengths.fold((0.0, 0.0), |(sum, largest): (f64, f64), length| {
        (sum + length, largest.max(length))
    });
    [3.0 * sum / away.len() as f64, largest]
}

/// What the numbers are and what they leave, line by line.
fn remarks(path: &Path, own: &InControllerBase, found: &Mastering) -> [String; 6] {
    let key = &own.published.key;
    let ([mean, most], [mean_with, most_with]) = (found.without, found.with);
    [
        format!(
            "joint offsets of robot {:?}, session {:?}, by posegrid run {}",
            key.robot, key.session, key.run
        ),
        "where the controller reports q the arm stands as the nominal one does at q + offset, in the controller's counting: a joint \
         mastered to report q + offset there is right"
            .to_owned(),
        format!(
            "they do not carry the geometry: over the measured joint ranges its tool point is {mean:.3} mm off the nominal arm's (at most \
             {most:.3}), and {mean_with:.3} mm (at most {most_with:.3}) with these offsets"
        ),
        "a joint that does not move the tool point has offset 0; whoever enters offsets measures again before correcting anything".to_owned(),
        own.published.error_frame.words(),
        held_out::dropped(path),
    ]
}

/// A joint's offset in degrees, or mm.
fn row(number: usize, joint: &Joint, offset: f64, sd: f64) -> [String; 5] {
    let (unit, scale) = if joint.slides {
        ("mm", 1.0)
    } else {
        ("deg", 1.0_f64.to_degrees())
    };
    let number_of = |value: f64| format!("{:.9}", value * scale + 0.0);
    [
        number.to_string(),
        joint.name.clone(),
        unit.to_owned(),
        number_of(offset),
        number_of(sd),
    ]
}
