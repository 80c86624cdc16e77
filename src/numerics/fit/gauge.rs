//! Instruments that read one length of a target: a distance from an anchor, or a height above a plane.
//!
//! A ball bar, a draw wire, a laser distance meter and a probe that touches a reference sphere read the distance of the target
//! from an anchor with an offset; a probe that touches a face, or a distance meter that looks at a wall, reads the height above a
//! plane. The anchor's place and the plane are stated in the base's frame: no reading shows how such an instrument is turned, so it
//! has no frame of its own ([`crate::method::identification`]).

use nalgebra::{Point3, Unit, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use crate::kinematics::{Axis, GaugePart};

/// Nearer to its anchor than this a target has no direction from it, mm.
const AT_ANCHOR_MM: f64 = 1e-6;

/// What a source reads of the targets in its frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Sees {
    Places,
    /// One length; the source's frame is the base's.
    Length(Gauge),
    /// Nothing in this session; its frame counts as the base's.
    Nothing,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Gauge {
    Distance(Anchor),
    Height(Plane),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Anchor {
    pub place: Point3<f64>,
    /// The reading at no distance, mm: what is added to the distance. Minus the radius where a sphere is touched.
    pub offset_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Its normal in the base's frame, towards positive heights.
    pub normal: UnitVector3<f64>,
    /// Its distance from the base's origin along the normal, mm.
    pub height_mm: f64,
    across: [Vector3<f64>; 2],
}

impl Sees {
    /// The instrument of one length; `None` of another.
    pub const fn gauge(&self) -> Option<&Gauge> {
        match self {
            Self::Length(gauge) => Some(gauge),
            Self::Places | Self::Nothing => None,
        }
    }
}

impl Anchor {
    /// The vector from the anchor to `target`, its length (mm) and its direction; no direction at the anchor itself.
    fn to(&self, target: &Point3<f64>) -> (f64, Vector3<f64>) {
        let away = target - self.place;
        let length_mm = away.norm();
        let along = if length_mm > AT_ANCHOR_MM { away / length_mm } else { Vector3::zeros() };
        (length_mm, along)
    }
}

impl Plane {
    /// A plane by its normal and its distance from the base's origin along it, mm.
    pub fn new(normal: UnitVector3<f64>, height_mm: f64) -> Self {
        let least = Axis::ALL.map(Axis::unit);
        let least = least
            .into_iter()
            .min_by(|a, b| a.dot(&normal).abs().total_cmp(&b.dot(&normal).abs()))
            .unwrap_or_else(Vector3::x_axis);
        let first = Unit::new_normalize(least.into_inner() - *normal * least.dot(&normal));
        let second = normal.cross(&first);
        Self { normal, height_mm, across: [*first, second] }
    }

    /// The plane with its normal tilted (rad) and raised (mm); the changes per tilt are those there.
    fn moved(&self, tilts: [f64; 2], height_mm: f64) -> Self {
        let tilted = *self.normal + self.across[0] * tilts[0] + self.across[1] * tilts[1];
        let (normal, length) = Unit::new_and_get(tilted);
        let across = self.across.map(|own| (own - *normal * normal.dot(&own)) / length);
        Self { normal, height_mm: self.height_mm + height_mm, across }
    }
}

impl Gauge {
    pub fn reading_mm(&self, target: &Point3<f64>) -> f64 {
        match self {
            Self::Distance(anchor) => anchor.to(target).0 + anchor.offset_mm,
            Self::Height(plane) => plane.normal.dot(&target.coords) - plane.height_mm,
        }
    }

    /// The change of the reading with the target's place in the base's frame: a unit vector.
    pub fn direction(&self, target: &Point3<f64>) -> Vector3<f64> {
        match self {
            Self::Distance(anchor) => anchor.to(target).1,
            Self::Height(plane) => *plane.normal,
        }
    }

    pub const fn parts(&self) -> &'static [GaugePart] {
        match self {
            Self::Distance(_) => &GaugePart::ANCHOR,
            Self::Height(_) => &GaugePart::PLANE,
        }
    }

    /// The change of the reading on a target per mm or rad of a part; zero of another instrument's part.
    pub fn by_part(&self, part: GaugePart, target: &Point3<f64>) -> f64 {
        match (self, part) {
            (Self::Distance(anchor), GaugePart::Place(axis)) => {
                -anchor.to(target).1.dot(&axis.unit())
            }
            (Self::Distance(_), GaugePart::Offset) => 1.0,
            (Self::Height(plane), GaugePart::Tilt) => plane.across[0].dot(&target.coords),
            (Self::Height(plane), GaugePart::OtherTilt) => plane.across[1].dot(&target.coords),
            (Self::Height(_), GaugePart::Height) => -1.0,
            (Self::Distance(_) | Self::Height(_), _) => 0.0,
        }
    }

    /// The instrument with these offsets of its parts, mm and rad.
    #[must_use]
    pub fn moved(&self, offset: impl Fn(GaugePart) -> f64) -> Self {
        match self {
            Self::Distance(anchor) => {
                let [x, y, z] = Axis::ALL.map(|axis| offset(GaugePart::Place(axis)));
                Self::Distance(Anchor {
                    place: anchor.place + Vector3::new(x, y, z),
                    offset_mm: anchor.offset_mm + offset(GaugePart::Offset),
                })
            }
            Self::Height(plane) => {
                let tilts = [offset(GaugePart::Tilt), offset(GaugePart::OtherTilt)];
                Self::Height(plane.moved(tilts, offset(GaugePart::Height)))
            }
        }
    }

    /// The instrument as one that further offsets start from.
    #[must_use]
    pub fn as_start(&self) -> Self {
        match self {
            Self::Distance(_) => *self,
            Self::Height(plane) => Self::Height(Plane::new(plane.normal, plane.height_mm)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gauges() -> [Gauge; 2] {
        let anchor = Anchor { place: Point3::new(900.0, -300.0, 150.0), offset_mm: 12.0 };
        let normal = Unit::new_normalize(Vector3::new(0.3, -0.5, 0.8));
        [Gauge::Distance(anchor), Gauge::Height(Plane::new(normal, 250.0))]
    }

    #[test]
    fn readings_are_a_distance_with_its_offset_and_a_height() {
        let [distance, height] = gauges();
        // 400 mm along x from the anchor.
        let target = Point3::new(1300.0, -300.0, 150.0);
        assert!((distance.reading_mm(&target) - 412.0).abs() < 1e-12);
        let Gauge::Height(plane) = &height else {
            panic!("a plane");
        };
        let target = Point3::from(*plane.normal * 270.0) + plane.across[0] * 40.0;
        assert!((height.reading_mm(&target) - 20.0).abs() < 1e-12);
    }

    #[test]
    fn the_changes_of_a_reading_are_the_numerical_ones() {
        let target = Point3::new(410.0, 720.0, 530.0);
        let step = 1e-5;
        for gauge in gauges() {
            // Away from the start, so that a tilted normal is no longer across its axes.
            let away = |part: GaugePart| if part.is_angle() { 0.2 } else { 5.0 };
            let here = gauge.moved(away);
            for &part in gauge.parts() {
                let at = |by: f64| {
                    let moved = gauge.moved(|own| away(own) + if own == part { by } else { 0.0 });
                    moved.reading_mm(&target)
                };
                let numerical = (at(step) - at(-step)) / (2.0 * step);
                let analytic = here.by_part(part, &target);
                assert!(
                    (numerical - analytic).abs() < 1e-4,
                    "{part:?}: {numerical} for {analytic}"
                );
            }
            for axis in Axis::ALL {
                let along = axis.unit().into_inner() * step;
                let change =
                    here.reading_mm(&(target + along)) - here.reading_mm(&(target - along));
                let analytic = here.direction(&target).dot(&axis.unit());
                assert!((change / (2.0 * step) - analytic).abs() < 1e-6);
            }
            let anew = here.as_start().reading_mm(&target) - here.reading_mm(&target);
            assert!(anew.abs() < 1e-9, "{anew}");
        }
    }
}
