//! One link quantity with another value, by Gauss–Newton: base, target and that quantity on the readings, and the quantity
//! alone on the commands, whose frames are stated.

use nalgebra::{Point3, SMatrix, SVector, Vector3};

use crate::figures::median;
use crate::join::placement::{Placement, ReadingAtFlange};
use crate::kinematics::Parameter;
use crate::setup::agreement::Seen;
use crate::setup::evidence::{Evidence, point};
use crate::setup::hypotheses::Hypothesis;
use crate::setup::hypotheses::links::{joint_name, key, table, to_write};
use crate::setup::set_up::SetUp;

/// Smaller changes are errors of the arm, which the fit finds, and no mistake in its file: mm and rad.
const LEAST_MM: f64 = 3.0;
const LEAST_RAD: f64 = 0.005;
const ROUNDS: usize = 10;
/// Steps of the numerical derivative, mm and rad.
const STEP_MM: f64 = 0.5;
const STEP_RAD: f64 = 1e-4;
/// Standard deviations of the unknowns before a reading is seen: base, mm and rad; target, mm; target that is stated, mm.
const BASE_MM: f64 = 1e5;
const BASE_RAD: f64 = 10.0;
const TARGET_MM: f64 = 300.0;
const STATED_MM: f64 = 1.0;

/// Base (3 lengths, 3 angles) and target (3), as a [`Placement`] has them; the quantity comes behind them.
const PLACED: usize = 9;
const UNKNOWNS: usize = PLACED + 1;
type Normal = (SMatrix<f64, UNKNOWNS, UNKNOWNS>, SVector<f64, UNKNOWNS>);

/// Each link quantity in turn; `placement` is where base and target are as stated.
pub(super) fn links(stated: &SetUp, evidence: &Evidence, placement: &Placement) -> Vec<Hypothesis> {
    let parameters = stated.arm.chain().parameters();
    let moved = |(place, parameter): (usize, &Parameter)| {
        if !matches!(parameter, Parameter::Link { .. }) {
            return None;
        }
        let mut offsets = vec![0.0; parameters.len()];
        offsets[place] = value(stated, evidence, placement, parameters.len(), place, *parameter)?;
        let least = if parameter.is_angle() { LEAST_RAD } else { LEAST_MM };
        let value = Some(offsets[place]).filter(|value| value.abs() >= least)?;
        hypothesis(stated, *parameter, &offsets, value)
    };
    parameters.iter().enumerate().filter_map(moved).collect()
}

fn hypothesis(
    stated: &SetUp,
    parameter: Parameter,
    offsets: &[f64],
    value: f64,
) -> Option<Hypothesis> {
    let Parameter::Link { joint, quantity } = parameter else { return None };
    let joint = joint_name(&stated.arm, joint);
    let change = if quantity.is_angle() {
        format!("{:+.2}°", value.to_degrees())
    } else {
        format!("{value:+.1} mm")
    };
    let mistake = format!("{} of {joint} in the robot file is off by {change}", key(quantity));
    let edit =
        format!("robot file, {}: {}", table(&joint), to_write(&stated.arm, parameter, value));
    Some(Hypothesis::of_size(mistake, edit, stated.with_offsets(offsets)))
}

struct Search<'a> {
    stated: &'a SetUp,
    evidence: &'a Evidence,
    parameters: usize,
    place: usize,
    step: f64,
    target: Option<Vector3<f64>>,
}

/// The value of the quantity's offset that the logs agree with best; `None` where they do not determine it.
fn value(
    stated: &SetUp,
    evidence: &Evidence,
    placement: &Placement,
    parameters: usize,
    place: usize,
    parameter: Parameter,
) -> Option<f64> {
    let step = if parameter.is_angle() { STEP_RAD } else { STEP_MM };
    let target = stated.stated_target();
    let search = Search { stated, evidence, parameters, place, step, target };
    let (mut placement, mut value) = (*placement, 0.0);
    for _ in 0..ROUNDS {
        let (normal, right) = search.normal(&placement, value);
        let change = normal.cholesky()?.solve(&right);
        placement = placement.moved(&change.fixed_rows::<PLACED>(0).into_owned());
        value += change[PLACED];
    }
    value.is_finite().then_some(value)
}

impl Search<'_> {
    fn set_up(&self, value: f64) -> SetUp {
        let mut offsets = vec![0.0; self.parameters];
        offsets[self.place] = value;
        self.stated.with_offsets(&offsets)
    }

    /// The normal equations at a placement and a value of the quantity.
    fn normal(&self, placement: &Placement, value: f64) -> Normal {
        let set_up = self.set_up(value);
        let here = Seen::unplaced(&set_up, self.evidence);
        let ahead = self.set_up(value + self.step).flanges(self.evidence);
        let slope = |place: usize, at: &Point3<f64>| {
            (ahead[place] * at - here.flanges[place] * at) / self.step
        };
        let mut rows: Vec<(SMatrix<f64, 3, UNKNOWNS>, Vector3<f64>)> = Vec::new();
        let target = point(&placement.target_mm);
        for (place, (flange, measured)) in here.flanges.iter().zip(&here.measured).enumerate() {
            let change = placement.tracker_from_base.rotation * slope(place, &target);
            let (known, residual) =
                placement.row(&ReadingAtFlange { flange: *flange, attained: *measured });
            let mut jacobian = SMatrix::<f64, 3, UNKNOWNS>::zeros();
            jacobian.fixed_columns_mut::<PLACED>(0).copy_from(&known);
            jacobian.set_column(PLACED, &change);
            rows.push((jacobian, residual));
        }
        if let Some(tool) = set_up.flange_from_tool {
            let tool = point(&tool.translation.vector);
            let commanded = here.commanded(&set_up, self.evidence);
            for ((flange, at), (place, _)) in
                commanded.iter().zip(self.evidence.commands(set_up.rows[3]))
            {
                let mut jacobian = SMatrix::<f64, 3, UNKNOWNS>::zeros();
                jacobian.set_column(PLACED, &slope(place, &tool));
                rows.push((jacobian, at - flange * tool));
            }
        }
        self.summed(placement, &rows)
    }

    /// The weighted sum of the rows and of the unknowns' priors.
    fn summed(
        &self,
        placement: &Placement,
        rows: &[(SMatrix<f64, 3, UNKNOWNS>, Vector3<f64>)],
    ) -> Normal {
        let norms: Vec<f64> = rows.iter().map(|(_, residual)| residual.norm()).collect();
        let scale = median(&norms).unwrap_or(1.0).max(0.01);
        let (mut normal, mut right): Normal = (SMatrix::zeros(), SVector::zeros());
        for (jacobian, residual) in rows {
            let weight = 1.0 / (1.0 + residual.norm_squared() / (4.0 * scale * scale));
            normal += jacobian.transpose() * jacobian * weight;
            right += jacobian.transpose() * residual * weight;
        }
        let (mean, sd_mm) =
            self.target.map_or((Vector3::zeros(), TARGET_MM), |target| (target, STATED_MM));
        for axis in 0..3 {
            normal[(axis, axis)] += (scale / BASE_MM).powi(2);
            normal[(3 + axis, 3 + axis)] += (scale / BASE_RAD).powi(2);
            let pull = (scale / sd_mm).powi(2);
            normal[(6 + axis, 6 + axis)] += pull;
            right[6 + axis] += pull * (mean[axis] - placement.target_mm[axis]);
        }
        normal[(PLACED, PLACED)] += f64::MIN_POSITIVE.max(1e-9 * normal.diagonal().max());
        (normal, right)
    }
}
