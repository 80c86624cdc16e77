//! The joints of a chain at one pose as gravity sees them. The generalised force of a variable is `z·((p − o) × down)`
//! of a joint that turns, `z·down` of one that slides, summed over its joints between the base and the weight.

use nalgebra::{Point3, Vector3};

use crate::units::MM_PER_M;

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axes {
    /// Origin (mm) and direction of the first joint of each axis variable.
    pub first: Vec<(Point3<f64>, Vector3<f64>)>,
    /// Every joint in the chain's order; empty where every variable has one joint, which turns, in their order.
    pub(super) joints: Vec<AxisJoint>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisJoint {
    pub(super) variable: usize,
    pub(super) slides: bool,
    /// Its motion per unit of the variable; in [`Axes`], per unit of the variable's first joint.
    pub(super) factor: f64,
    pub(super) origin: Point3<f64>,
    pub(super) axis: Vector3<f64>,
}

impl Axes {
    pub(super) fn of(mut joints: Vec<AxisJoint>, variables: usize) -> Self {
        let nowhere = (Point3::origin(), Vector3::z());
        let first = |variable: usize| joints.iter().find(|joint| joint.variable == variable);
        let firsts: Vec<_> = (0..variables).map(first).collect();
        let place = |first: Option<&AxisJoint>| first.map_or(nowhere, |own| (own.origin, own.axis));
        let places = firsts.iter().copied().map(place).collect();
        let signs: Vec<f64> = firsts.iter().map(|own| own.map_or(1.0, |own| own.factor)).collect();
        let is_plain =
            |(place, joint): (usize, &AxisJoint)| !joint.slides && joint.variable == place;
        if joints.iter().enumerate().all(is_plain) {
            joints.clear();
        }
        for joint in &mut joints {
            joint.factor /= signs[joint.variable];
        }
        Self { first: places, joints }
    }

    /// Generalised force of a unit weight at each later variable's first joint and, last, at `end` (mm): a lever in m
    /// where the joint of `variable` turns, a share of the weight where it slides.
    pub fn forces(
        &self,
        variable: usize,
        end: Point3<f64>,
        down: Vector3<f64>,
    ) -> impl Iterator<Item = f64> {
        let later = self.first.iter().enumerate().skip(variable + 1);
        let weights = later.map(|(place, (origin, _))| (Some(place), *origin)).chain([(None, end)]);
        weights.map(move |(place, weight)| self.force(variable, place, &weight, &down))
    }

    /// Generalised force of a weight moving with what is before the first joint of variable `place`, or with the end.
    fn force(
        &self,
        variable: usize,
        place: Option<usize>,
        weight: &Point3<f64>,
        down: &Vector3<f64>,
    ) -> f64 {
        if self.joints.is_empty() {
            let (origin, axis) = &self.first[variable];
            return axis.dot(&(weight - origin).cross(down)) / MM_PER_M;
        }
        let before = |joint: &&AxisJoint| Some(joint.variable) != place;
        let own = self.joints.iter().take_while(before).filter(|joint| joint.variable == variable);
        let sunk: f64 = own.map(|joint| joint.sinks(weight, down)).sum();
        let mut joints = self.joints.iter();
        let slides = joints.find(|joint| joint.variable == variable);
        if slides.is_some_and(|joint| joint.slides) { sunk } else { sunk / MM_PER_M }
    }
}

impl AxisJoint {
    /// Distance that a weight sinks per unit of the variable's first joint, mm per rad or mm per mm.
    fn sinks(&self, weight: &Point3<f64>, down: &Vector3<f64>) -> f64 {
        let moved = if self.slides { self.axis } else { self.axis.cross(&(weight - self.origin)) };
        self.factor * moved.dot(down)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use crate::kinematics::{Axis, Chain, Element, Motion};

    /// A lift, a shoulder, an elbow, and a joint that turns back with the shoulder by half.
    fn chain() -> Chain {
        let joint = |motion, joint, sign| Element::Joint { motion, joint, sign };
        let shift = |x, y, z| Element::Fixed(Isometry3::translation(x, y, z));
        Chain::new(vec![
            joint(Motion::Translation(Axis::Z), 0, 1.0),
            shift(0.0, 100.0, 300.0),
            joint(Motion::Rotation(Axis::Y), 1, -1.0),
            shift(400.0, 0.0, 50.0),
            joint(Motion::Rotation(Axis::Y), 1, 0.5),
            shift(200.0, 30.0, 0.0),
            joint(Motion::Rotation(Axis::X), 2, 1.0),
            shift(0.0, 150.0, 80.0),
        ])
    }

    #[test]
    fn a_force_is_the_work_of_a_weight_per_unit_of_the_variable() {
        let chain = chain();
        let q = [120.0, 0.7, -0.4];
        let up = Vector3::new(0.1, -0.2, 0.97).normalize();
        let end = |q: &[f64]| chain.forward(q, &[]).translation.vector;
        let origin = |q: &[f64]| chain.joint_axes(q, &[])[2].0.coords;
        let axes = chain.axes(&q, &[]);
        let sinks = |variable: usize, point: &dyn Fn(&[f64]) -> Vector3<f64>| {
            let at = |step: f64| {
                let mut moved = q;
                moved[variable] += step;
                point(&moved).dot(&-up)
            };
            (at(1e-4) - at(-1e-4)) / 2e-4
        };
        // Of the lift: weights at the shoulder, at the wrist and at the end, each a share of the weight.
        let lift: Vec<f64> = axes.forces(0, end(&q).into(), -up).collect();
        assert_eq!(lift.len(), 3);
        assert!((lift[1] - sinks(0, &origin)).abs() < 1e-9);
        assert!((lift[2] - sinks(0, &end)).abs() < 1e-9);
        // Of the shoulder, in the sense of its first joint, which counts the other way; levers in m.
        let shoulder: Vec<f64> = axes.forces(1, end(&q).into(), -up).collect();
        assert!((shoulder[0] + sinks(1, &origin) / 1000.0).abs() < 1e-9);
        assert!((shoulder[1] + sinks(1, &end) / 1000.0).abs() < 1e-9);
        let wrist: Vec<f64> = axes.forces(2, end(&q).into(), -up).collect();
        assert!((wrist[0] - sinks(2, &end) / 1000.0).abs() < 1e-9);
    }
}
