//! A base that moves while a session is measured, found from the errors at its stations.
//!
//! The base of a driven session is found from its first stations. If it moves at some station, later errors contain its
//! rigid motion: of all stations at which it may have moved, the one is chosen for which a separate base of the later
//! stations leaves the smallest errors. This also removes most of a slow drift.

use nalgebra::{Point3, Vector3};

use super::super::{Residual, ResidualSet};
use crate::geometry::align;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseMotion {
    /// The first station after the motion.
    pub from_station: usize,
    pub mm: f64,
    pub rad: f64,
}

/// Fewest stations that a base is found from: fewer would fit their noise.
const LEAST_STATIONS: usize = 20;

/// The errors of the stations that judge, without the motion of the base that explains most of them; and that motion.
/// `None` where too few stations judge, or where they do not span space.
pub fn base_motion(after: &ResidualSet) -> Option<(ResidualSet, BaseMotion)> {
    let judged: Vec<&Residual> = after.residuals.iter().filter(|r| !r.used_for_refit).collect();
    let last = judged.len().checked_sub(LEAST_STATIONS)?;
    let moved = (0..=last).filter_map(|place| moved_at(&judged, place));
    let (_, settled, motion) = moved.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((ResidualSet { subject: after.subject.clone(), residuals: settled }, motion))
}

/// The sum of squares that remains where the base moved at `place`, the errors then, and the motion.
fn moved_at(judged: &[&Residual], place: usize) -> Option<(f64, Vec<Residual>, BaseMotion)> {
    let (before, later) = judged.split_at(place);
    let wanted: Vec<_> = later.iter().map(|r| r.predicted()).collect();
    let attained: Vec<_> = later.iter().map(|r| r.attained).collect();
    let base = align(&wanted, &attained, &vec![1.0; later.len()])?;
    let settled = later.iter().map(|r| Residual {
        attained: base * r.attained,
        residual: base * r.attained - r.predicted(),
        ..(*r).clone()
    });
    let settled: Vec<Residual> = before.iter().map(|r| (*r).clone()).chain(settled).collect();
    let sum = attained.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords);
    let middle = Point3::from(sum / attained.len() as f64);
    let motion = BaseMotion {
        from_station: later.first()?.station,
        mm: (base * middle - middle).norm(),
        rad: base.rotation.angle(),
    };
    Some((settled.iter().map(|r| r.residual.norm_squared()).sum(), settled, motion))
}
