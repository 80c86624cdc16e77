//! Mistakes about the frames: turned by right angles, inverted, mirrored, left out, or read by another convention.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::Hypothesis;
use crate::geometry::rpy;
use crate::setup::set_up::SetUp;
use crate::units::{MM_PER_M, to_step};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKey {
    Commands,
    Tool,
    Target,
    /// Tool and target, which are stated as one point.
    Both,
    Survey,
}

/// Points closer than this are stated as one, mm.
const ONE_POINT_MM: f64 = 0.1;

/// The numbers of a frame read by another convention than the stated one.
#[derive(Debug, Clone)]
pub struct OtherReading {
    pub frame: FrameKey,
    /// The other convention, in words: `euler_order = "moving-zyx"`.
    pub convention: String,
    /// The frame under it, mm.
    pub placed: Isometry3<f64>,
}

impl FrameKey {
    const ALL: [Self; 5] = [Self::Commands, Self::Tool, Self::Target, Self::Both, Self::Survey];

    pub const fn key(self) -> &'static str {
        match self {
            Self::Commands => "[commanded] base_from_command",
            Self::Tool => "[commanded] flange_from_tool",
            Self::Target => "[fit] target",
            Self::Both => "[commanded] flange_from_tool and [fit] target",
            Self::Survey => "[tracker] tracker_from_base",
        }
    }

    pub(in crate::setup) fn of(self, set_up: &SetUp) -> Option<Isometry3<f64>> {
        match self {
            Self::Commands => Some(set_up.base_from_command),
            Self::Tool => set_up.flange_from_tool,
            Self::Target => set_up.target.map(|target| Translation3::from(target).into()),
            Self::Both => {
                let [tool, target] = set_up.one_point()?;
                set_up.flange_from_tool.filter(|_| (tool - target).norm() < ONE_POINT_MM)
            }
            Self::Survey => set_up.tracker_from_base,
        }
    }

    pub(in crate::setup) fn put(self, set_up: &SetUp, placed: Isometry3<f64>) -> SetUp {
        let mut set_up = set_up.clone();
        match self {
            Self::Commands => set_up.base_from_command = placed,
            Self::Tool => set_up.flange_from_tool = Some(placed),
            Self::Target => set_up.target = Some(placed.translation.vector),
            Self::Both => {
                set_up.target = Some(placed.translation.vector);
                set_up.flange_from_tool = Some(placed);
            }
            Self::Survey => set_up.tracker_from_base = Some(placed),
        }
        set_up
    }

    /// What to write: the key with the frame's numbers.
    pub(in crate::setup) fn edit(self, placed: &Isometry3<f64>) -> String {
        if self == Self::Both {
            return [Self::Tool, Self::Target].map(|own| own.edit(placed)).join(" and ");
        }
        let [x, y, z] = placed.translation.vector.map(|x| to_step(x, 0.1)).into();
        if self == Self::Target {
            return format!("{} xyz_mm = [{x:.1}, {y:.1}, {z:.1}]", self.key());
        }
        let [roll, pitch, yaw] =
            rpy(&placed.rotation).map(|angle| to_step(angle.to_degrees(), 1e-3));
        let key = self.key();
        let frame = format!(
            "xyz_mm = [{x:.1}, {y:.1}, {z:.1}], euler_deg = [{roll:.3}, {pitch:.3}, {yaw:.3}], euler_order = \"fixed-xyz\""
        );
        if self == Self::Survey {
            return format!("{key} surveyed = {{ {frame}, with sd_mm and sd_deg as they stand }}");
        }
        format!("{key} = {{ {frame} }}")
    }
}

/// All mistakes about all stated frames; each resulting frame once.
pub(super) fn frames(stated: &SetUp, readings: &[OtherReading]) -> Vec<Hypothesis> {
    let mut all = Vec::new();
    for frame in FrameKey::ALL {
        let Some(placed) = frame.of(stated) else { continue };
        let mut known = vec![placed];
        for (mistake, other) in others(frame, &placed, readings) {
            if known.iter().any(|known| is_same(known, &other)) {
                continue;
            }
            let mistake = format!("{} {mistake}", frame.key());
            all.push(Hypothesis::new(mistake, frame.edit(&other), frame.put(stated, other)));
            known.push(other);
        }
    }
    all
}

/// Frames that a stated one may have been meant to be, with the mistake in words.
fn others(
    frame: FrameKey,
    placed: &Isometry3<f64>,
    readings: &[OtherReading],
) -> Vec<(String, Isometry3<f64>)> {
    let mut all = Vec::new();
    for other in readings.iter().filter(|other| other.frame == frame) {
        all.push((format!("is written in another convention, {}", other.convention), other.placed));
    }
    for (factor, unit) in [(MM_PER_M, "m"), (1.0 / MM_PER_M, "µm")] {
        let vector = placed.translation.vector * factor;
        all.push((format!("has its position in {unit}"), with_origin(placed, vector)));
    }
    if frame != FrameKey::Target {
        all.push(("is inverted".to_owned(), placed.inverse()));
    }
    all.extend(mirrored(placed));
    for (turn, words) in right_angles() {
        let origin = placed.translation.vector;
        let about = format!("by {words} about the axes of the frame that it is stated in");
        if frame != FrameKey::Target {
            all.push((format!("is turned by {words}"), placed * turn));
            all.push((format!("is turned {about}"), with_origin(&(turn * placed), origin)));
            all.push((format!("is turned with its origin {about}"), turn * placed));
        }
        all.push((format!("has its origin turned {about}"), with_origin(placed, turn * origin)));
    }
    all
}

fn with_origin(placed: &Isometry3<f64>, origin: Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(origin), placed.rotation)
}

/// The origin left out, or with other signs.
fn mirrored(placed: &Isometry3<f64>) -> Vec<(String, Isometry3<f64>)> {
    let origin = placed.translation.vector;
    let mirrored = |signs: u8| {
        let turned = |axis: usize| signs & (1 << axis) != 0;
        let axes: Vec<&str> =
            (0..3).filter(|&axis| turned(axis)).map(|axis| ["x", "y", "z"][axis]).collect();
        let vector =
            Vector3::from_fn(|axis, _| if turned(axis) { -origin[axis] } else { origin[axis] });
        (format!("has the wrong sign in {}", axes.join(", ")), with_origin(placed, vector))
    };
    let mut all: Vec<(String, Isometry3<f64>)> = (1..8).map(mirrored).collect();
    all.push((
        "states a place where there is none".to_owned(),
        with_origin(placed, Vector3::zeros()),
    ));
    all
}

/// The 23 rotations that carry axes onto axes, with their words: half and quarter turns about axes first.
fn right_angles() -> Vec<(UnitQuaternion<f64>, String)> {
    let quarter = |axis: usize, times: i32| {
        let axis = nalgebra::Unit::new_unchecked(Vector3::ith(axis, 1.0));
        UnitQuaternion::from_axis_angle(&axis, f64::from(times) * FRAC_PI_2)
    };
    let mut found: Vec<(UnitQuaternion<f64>, String)> = Vec::new();
    let mut add = |turn: UnitQuaternion<f64>, words: String| {
        let is_new =
            turn.angle() > 1e-6 && found.iter().all(|(known, _)| known.angle_to(&turn) > 1e-6);
        if is_new {
            found.push((turn, words));
        }
    };
    for times in [2, 1, -1] {
        for axis in [2, 0, 1] {
            add(quarter(axis, times), format!("{}° about {}", 90 * times, ["x", "y", "z"][axis]));
        }
    }
    for first in 0..3 {
        for second in (0..3).filter(|&second| second != first) {
            for (a, b) in [(1, 1), (1, -1), (1, 2), (-1, 1), (-1, -1), (2, 1)] {
                let name = |axis: usize, times: i32| {
                    format!("{}° about {}", 90 * times, ["x", "y", "z"][axis])
                };
                let words = format!("{}, then {}", name(first, a), name(second, b));
                add(quarter(first, a) * quarter(second, b), words);
            }
        }
    }
    found
}

/// Frames closer than this are one.
fn is_same(one: &Isometry3<f64>, other: &Isometry3<f64>) -> bool {
    (one.translation.vector - other.translation.vector).norm() < 1e-6
        && one.rotation.angle_to(&other.rotation) < 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_carried_onto_axes_in_24_ways() {
        assert_eq!(right_angles().len(), 23);
    }

    #[test]
    fn a_frame_to_write_is_the_frame_where_the_pitch_is_a_right_angle() {
        for off_rad in [0.0, 1e-9, -3e-8, 1e-7] {
            let turned = UnitQuaternion::from_euler_angles(0.7, FRAC_PI_2 - off_rad, -0.4);
            let edit =
                FrameKey::Survey.edit(&Isometry3::from_parts(Translation3::identity(), turned));
            let [.., angles, _] = edit.split(['[', ']']).collect::<Vec<_>>()[..] else {
                panic!("{edit}");
            };
            let angles: Vec<f64> =
                angles.split(", ").map(|angle| angle.parse().expect("a number")).collect();
            let [roll, pitch, yaw] = [0, 1, 2].map(|place: usize| angles[place].to_radians());
            // Each angle is written to a thousandth of a degree.
            let off = turned.angle_to(&UnitQuaternion::from_euler_angles(roll, pitch, yaw));
            assert!(off < 3e-5, "{edit} is {off} rad off");
        }
    }
}
