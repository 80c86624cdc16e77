//! Error vectors as arrows of a `foxglove.SceneUpdate`: one entity per station.

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::ARROW_SCALE;
use super::rows::{Of, Xyz, predicted_mm};
use crate::tables::residuals::ResidualRow;
use crate::units::MM_PER_M;

pub(super) const SCHEMA: &str = include_str!("scene_update.json");

/// Length of the head as a share of an arrow's length, and widths as shares of it, up to the width of a large arrow, m.
const HEAD: f64 = 0.3;
const SHAFT_WIDTH: f64 = 0.08;
const WIDEST_SHAFT_M: f64 = 0.006;

/// Before: the page's orange; after: its blue.
const BEFORE: Color = Color::of(0xb3, 0x47, 0x0b);
const AFTER: Color = Color::of(0x0b, 0x5f, 0xa5);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Time {
    sec: u64,
    nsec: u64,
}

impl Time {
    pub(super) const fn of(ns: u64) -> Self {
        Self { sec: ns / 1_000_000_000, nsec: ns % 1_000_000_000 }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct SceneUpdate {
    deletions: [(); 0],
    entities: Vec<Entity>,
}

impl SceneUpdate {
    pub(super) const fn of(entities: Vec<Entity>) -> Self {
        Self { deletions: [], entities }
    }
}

/// An entity with an id, with all kinds of shapes of the schema.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Entity {
    timestamp: Time,
    frame_id: &'static str,
    id: String,
    lifetime: Time,
    frame_locked: bool,
    metadata: [Entry; 3],
    arrows: [Shape; 1],
    cubes: [(); 0],
    spheres: [(); 0],
    cylinders: [(); 0],
    lines: [(); 0],
    triangles: [(); 0],
    texts: [(); 0],
    models: [(); 0],
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Entry {
    key: &'static str,
    value: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Shape {
    pose: Pose,
    shaft_length: f64,
    shaft_diameter: f64,
    head_length: f64,
    head_diameter: f64,
    color: Color,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Pose {
    position: Xyz,
    orientation: Orientation,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Orientation {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Color {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

impl Color {
    const fn of(red: u8, green: u8, blue: u8) -> Self {
        Self { r: red as f64 / 255.0, g: green as f64 / 255.0, b: blue as f64 / 255.0, a: 1.0 }
    }
}

pub(super) struct Arrow<'a> {
    pub(super) of: &'a Of,
    pub(super) row: &'a ResidualRow,
    pub(super) ns: u64,
}

impl Arrow<'_> {
    pub(super) fn entity(&self) -> Entity {
        let station = self.row.station.to_string();
        let entry = |key, value: String| Entry { key, value };
        Entity {
            timestamp: Time::of(self.ns),
            frame_id: "base",
            metadata: [
                entry("station", station.clone()),
                entry("error_mm", self.row.residual_mm.to_string()),
                entry("arrow_scale", ARROW_SCALE.to_string()),
            ],
            id: station,
            // Visible until it is replaced.
            lifetime: Time::of(0),
            frame_locked: true,
            arrows: [self.shape()],
            cubes: [],
            spheres: [],
            cylinders: [],
            lines: [],
            triangles: [],
            texts: [],
            models: [],
        }
    }

    fn shape(&self) -> Shape {
        let long_m = ARROW_SCALE * self.row.residual_mm / MM_PER_M;
        let shaft_diameter = (SHAFT_WIDTH * long_m).min(WIDEST_SHAFT_M);
        Shape {
            pose: Pose {
                position: predicted_mm(self.row).map(|x| x / MM_PER_M).into(),
                orientation: along(&Vector3::from(self.row.residual)),
            },
            shaft_length: (1.0 - HEAD) * long_m,
            shaft_diameter,
            head_length: HEAD * long_m,
            head_diameter: 2.0 * shaft_diameter,
            color: if self.of.is_before() { BEFORE } else { AFTER },
        }
    }
}

fn along(direction: &Vector3<f64>) -> Orientation {
    // For the direction opposite to x any half turn is right; a zero vector has no direction.
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let turn = if direction.norm() > 0.0 {
        UnitQuaternion::rotation_between(&Vector3::x(), direction).unwrap_or_else(half_turn)
    } else {
        UnitQuaternion::identity()
    };
    Orientation { x: turn.i, y: turn.j, z: turn.k, w: turn.w }
}

#[cfg(test)]
mod tests {
    use nalgebra::Quaternion;

    use super::*;

    #[test]
    fn arrows_point_along_the_error() {
        let directions = [[0.0, 2.0, 0.0], [-3.0, 0.0, 0.0], [1.0, -1.0, 0.5], [1e-9, 0.0, 0.0]];
        for direction in directions.map(Vector3::from) {
            let o = along(&direction);
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(o.w, o.x, o.y, o.z));
            let apart = (turn * Vector3::x() - direction.normalize()).norm();
            assert!(apart < 1e-12, "{direction}: {o:?}");
        }
        let none = along(&Vector3::zeros());
        assert!(none.w > 1.0 - 1e-15, "nothing points nowhere: {none:?}");
    }

    #[test]
    fn times_are_split_into_seconds_and_the_rest() {
        let time = Time::of(1_700_000_000_000_000_007);
        assert_eq!((time.sec, time.nsec), (1_700_000_000, 7));
    }
}
