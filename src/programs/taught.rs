//! Frames that were touched with an arm → where they really are.
//!
//! The controller makes a frame of the poses in which the nominal arm touched its points. The arm stood elsewhere, by its error at each
//! of them, so the frame of its numbers is not the one on the part. Inputs are the place of each touch as the controller had it and where
//! the arm really was, outputs the frame as it really is. Both come from the same joint angles: what a person touched beside the point, and
//! what was rounded in writing joints down, hardly changes their difference.
//! 1. The points as the controller had them have to give the frame that it has ([`SAME_MM`]): others are of another frame, tool or arm.
//! 2. Each is moved by what the arm was off there, and the frame is made again ([`base`], [`tool`]).

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

/// Points that are further from where a frame has them are of another frame, mm: joints in hundredths of a degree make half a millimetre.
pub const SAME_MM: f64 = 1.0;
/// Points nearer to each other than this make no axis, mm.
const NEAR_MM: f64 = 10.0;
/// Mean square by which flanges have to be turned between the poses of a tool, rad²: some 15° each way.
const TURNED: f64 = 0.05;

/// A frame of a program that the cell says was taught.
#[derive(Debug, Clone, PartialEq)]
pub struct TaughtFrame {
    pub name: String,
    /// Where the controller has it: a base in the arm's, a tool in the flange frame, mm.
    pub stated: Isometry3<f64>,
    pub kind: Taught,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Taught {
    Base {
        /// The arm's base in the world.
        world_from_base: Isometry3<f64>,
        is_rapid: bool,
    },
    Tool,
}

/// A touched point in the arm's base, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched {
    /// Where the controller had the tip.
    pub stated: Point3<f64>,
    /// Where it really was.
    pub actual: Point3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum TaughtError {
    #[error("{found} points are given; {needed}")]
    Count { found: usize, needed: &'static str },
    #[error(
        "the points do not give its numbers: they lie {off_mm:.2} mm from where it has them; are they of this frame, in the order in which \
         they were touched, and with this tool?"
    )]
    Other { off_mm: f64 },
    #[error(
        "the flange is hardly turned between its poses; survey the tool, or teach it with poses that differ by 30° and more"
    )]
    NotTurned,
}

/// A base of three points in the arm's base, mm: two on its x-axis, and one of its xy-plane on the side of y.
///
/// KUKA's origin is the first point. ABB's is where the y-axis through the third meets the x-axis; [`TaughtError::Other`] where neither
/// gives the numbers of the frame.
pub fn base(
    stated: &Isometry3<f64>,
    points: &[Touched],
    is_rapid: bool,
) -> Result<Isometry3<f64>, TaughtError> {
    let needed = "a base has three: two on its x-axis, and one of its xy-plane";
    let [first, second, third] = points else {
        return Err(TaughtError::Count { found: points.len(), needed });
    };
    let touched = [first, second, third];
    let [one, two, three] = touched.map(|own| stated.inverse() * own.stated);
    let is_foot = is_rapid && three.x.abs() <= SAME_MM;
    let origin = if is_foot { three.x } else { one.x };
    let off_axis = |own: Point3<f64>| own.y.hypot(own.z);
    let off = [origin.abs(), off_axis(one), off_axis(two), three.z.abs()];
    let short = [NEAR_MM - (two.x - one.x), NEAR_MM - three.y].map(|own| own.max(0.0));
    let off_mm = off.into_iter().chain(short).fold(0.0, f64::max);
    if off_mm > SAME_MM {
        return Err(TaughtError::Other { off_mm });
    }
    // Where the frame has them; only what it leaves open is as it was written down.
    let one = Point3::new(if is_foot { one.x } else { 0.0 }, 0.0, 0.0);
    let three = Point3::new(if is_foot { 0.0 } else { three.x }, three.y, 0.0);
    let on_frame = [one, Point3::new(two.x, 0.0, 0.0), three].map(|own| stated * own);
    let mut moved =
        on_frame.into_iter().zip(touched).map(|(at, own)| at + (own.actual - own.stated));
    let mut next = || moved.next().unwrap_or_default();
    let (one, two, three) = (next(), next(), next());
    let x = (two - one).normalize();
    let z = x.cross(&(three - one)).normalize();
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    let origin = if is_foot { one + x * x.dot(&(three - one)) } else { one };
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    Ok(Isometry3::from_parts(Translation3::from(origin), turn))
}

/// A tool in the flange frame, mm, whose tip stood at one point in poses of the flange: each as the controller had it, and as it really
/// was. The tool's orientation stays as the controller has it.
pub fn tool(
    stated: &Isometry3<f64>,
    flanges: &[[Isometry3<f64>; 2]],
) -> Result<Isometry3<f64>, TaughtError> {
    if flanges.len() < 4 {
        let needed = "a tool has four poses or more with its tip at one point";
        return Err(TaughtError::Count { found: flanges.len(), needed });
    }
    let tip = |which: usize| tip(&flanges.iter().map(|own| own[which]).collect::<Vec<_>>());
    let (by_controller, actual) = (tip(0)?, tip(1)?);
    let off_mm = (by_controller - stated.translation.vector).norm();
    // The numbers of the controller are rounded, and so are joints that turn the flange at the tip.
    if off_mm > 2.0 * SAME_MM {
        return Err(TaughtError::Other { off_mm });
    }
    let place = stated.translation.vector + (actual - by_controller);
    Ok(Isometry3::from_parts(Translation3::from(place), stated.rotation))
}

/// The point of the flange frame that stays nearest to one place in all poses: least squares of `R_i t + p_i − c` over t and c.
fn tip(flanges: &[Isometry3<f64>]) -> Result<Vector3<f64>, TaughtError> {
    let turns = flanges.iter().map(|own| own.rotation.to_rotation_matrix().into_inner());
    let turns: Vec<Matrix3<f64>> = turns.collect();
    let count = flanges.len() as f64;
    let mean_turn = turns.iter().sum::<Matrix3<f64>>() / count;
    let places = flanges.iter().map(|own| own.translation.vector);
    let mean_place = places.clone().sum::<Vector3<f64>>() / count;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (turn, place) in turns.iter().zip(places) {
        let apart = turn - mean_turn;
        normal += apart.transpose() * apart / count;
        right -= apart.transpose() * (place - mean_place) / count;
    }
    if normal.symmetric_eigenvalues().min() < TURNED {
        return Err(TaughtError::NotTurned);
    }
    normal.try_inverse().map(|inverse| inverse * right).ok_or(TaughtError::NotTurned)
}

#[cfg(test)]
mod tests;
