//! The identified geometry from the controller's own base to its own flange. A fit moves both along directions that are
//! not identifiable; the chain is carried to the error reference frame ([`posegrid_numerics::method::compensation`]),
//! so this arm's tool point is where the geometry's compensation puts it.

use std::path::Path;

use nalgebra::{Isometry3, Translation3};

use super::{ExportError, ExportErrorKind};
use crate::calibrations_table::{self, PublishedArm};
use crate::compensation::IdentifiedArm;
use crate::fit::IdentifiedGeometry;
use crate::fit::conversion::Errors;
use crate::kinematics::{Axis, Chain, Motion, Parameter};

pub struct InControllerBase {
    pub published: PublishedArm,
    /// The offsets of its parameters from the nominal arm, base and target in the error reference frame.
    pub errors: Errors,
}

impl InControllerBase {
    pub fn read(path: &Path) -> Result<Self, ExportError> {
        let (published, errors) = calibrations_table::read_geometry_errors(path)?;
        let refused = |problem| ExportErrorKind::NoUrdf(problem).at(path);
        let (base, _, flange) = carried(&published.arm).map_err(refused)?;
        let errors = with_frames(errors, &base, &flange);
        Ok(Self { published, errors })
    }

    /// The errors of the flange: those of the target's orientation on it are none of the arm's.
    pub(super) fn flange_errors(&self) -> Errors {
        let is_flange = |place: &usize| {
            let parameter = self.errors.parameters[*place];
            !matches!(parameter, Parameter::Target(Motion::Rotation(_)))
        };
        let kept: Vec<usize> = (0..self.errors.parameters.len()).filter(is_flange).collect();
        let places = kept.iter();
        Errors {
            parameters: places.map(|&place| self.errors.parameters[place]).collect(),
            offsets: self.errors.offsets.select_rows(&kept),
            covariance: self.errors.covariance.select_rows(&kept).select_columns(&kept),
        }
    }
}

/// The base of the identified chain in the controller's base, the chain, and the controller's flange at its end.
pub(super) fn carried(
    arm: &IdentifiedArm,
) -> Result<(Isometry3<f64>, &Chain, Isometry3<f64>), &'static str> {
    let Some(own) = arm.model.is::<IdentifiedGeometry>() else {
        return Err("has more than a geometry");
    };
    let frames = own.frames[arm.model.session].main();
    let frames = frames.map_err(|_| "was seen by several instruments")?;
    let base_from_root =
        arm.frames.tracker_from_base.isometry().inverse() * frames.tracker_from_base.isometry();
    let target = frames.flange_from_target.isometry().translation.vector
        - arm.frames.flange_from_target.isometry().translation.vector;
    Ok((base_from_root, &own.chain, Translation3::from(target).into()))
}

/// The errors with base and target as the error reference frame has them: the fit's own are counted from its own
/// frames.
fn with_frames(mut errors: Errors, base: &Isometry3<f64>, flange: &Isometry3<f64>) -> Errors {
    let turns = moving_xyz(base);
    for axis in Axis::ALL {
        let place = axis as usize;
        errors.set(Parameter::Base(Motion::Translation(axis)), base.translation.vector[place]);
        errors.set(Parameter::Base(Motion::Rotation(axis)), turns[place]);
        errors.set(Parameter::Target(Motion::Translation(axis)), flange.translation.vector[place]);
    }
    errors
}

/// Angles of `Rot(x,a) Rot(y,b) Rot(z,c)`, small ones.
fn moving_xyz(isometry: &Isometry3<f64>) -> [f64; 3] {
    let r = isometry.rotation.to_rotation_matrix();
    [
        (-r[(1, 2)]).atan2(r[(2, 2)]),
        r[(0, 2)].clamp(-1.0, 1.0).asin(),
        (-r[(0, 1)]).atan2(r[(0, 0)]),
    ]
}
