//! A chain at given parameter offsets, for many poses: everything constant between two joints is one transform, so that
//! a pose costs a turn per joint and a few products.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::axes::{Axes, AxisJoint};
use super::chain::{Chain, Element};
use super::motion::{Axis, Motion};
use super::twist::{Twist, UnitMotion};

/// Origin (mm) and direction of a joint in the root frame.
type Line = (Point3<f64>, Vector3<f64>);

#[derive(Debug, Clone)]
pub struct HeldChain {
    segments: Vec<Segment>,
    joints: usize,
}

#[derive(Debug, Clone)]
struct Segment {
    /// Free elements: the unknown that moves each, and its unit motion in the frame where the segment begins.
    free: Vec<(usize, UnitMotion)>,
    rotation: Matrix3<f64>,
    origin: Vector3<f64>,
    /// The joint that ends the segment; `None` at the chain's end.
    joint: Option<(Motion, usize, f64)>,
}

/// A point of the chain's end at one pose and its motion, in the root frame.
#[derive(Debug, Clone)]
pub struct ChainView {
    /// The point with the end's orientation, mm.
    pub end: Isometry3<f64>,
    /// The point's motion per unit of each unknown that moves it: the unknown's index and the twist.
    pub unknowns: Vec<(usize, Twist)>,
    pub joints: Vec<Twist>,
    pub axes: Axes,
}

impl HeldChain {
    /// [`Self::new`] without unknowns.
    pub fn fixed(chain: &Chain, offsets: &[f64]) -> Self {
        Self::new(chain, offsets, &vec![None; offsets.len()])
    }

    /// `chain` with `offsets` added to its free parameters; `unknowns` holds the unknown of each, `None` where fixed.
    pub fn new(chain: &Chain, offsets: &[f64], unknowns: &[Option<usize>]) -> Self {
        let mut segments = Vec::with_capacity(chain.joint_count() + 1);
        let (mut free, mut end, mut parameter) = (Vec::new(), Isometry3::identity(), 0);
        for element in chain.elements() {
            match element {
                Element::Fixed(transform) => end *= transform,
                Element::Free { motion, nominal, .. } => {
                    let unknown = unknowns[parameter];
                    free.extend(unknown.map(|unknown| (unknown, UnitMotion::of(*motion, &end))));
                    end *= motion.by(nominal + offsets[parameter]);
                    parameter += 1;
                }
                Element::Joint { motion, joint, sign } => {
                    let joint = Some((*motion, *joint, *sign));
                    segments.push(Segment::new(std::mem::take(&mut free), &end, joint));
                    end = Isometry3::identity();
                }
            }
        }
        segments.push(Segment::new(free, &end, None));
        Self { segments, joints: chain.joint_count() }
    }

    /// The end in the root frame at the axis variables `q` (rad or mm).
    pub fn end(&self, q: &[f64]) -> Isometry3<f64> {
        let mut frame = Frame::root();
        for segment in &self.segments {
            frame.pass(segment);
            if let Some((motion, joint, sign)) = segment.joint {
                frame.turn(motion, sign * q[joint]);
            }
        }
        frame.isometry()
    }

    /// [`Self::end`] and its motion per unit of each axis variable.
    pub fn end_and_joints(&self, q: &[f64]) -> (Isometry3<f64>, Vec<Twist>) {
        let (frame, axes) = self.walk(q, |_, _| {});
        (frame.isometry(), self.joint_twists(&axes, &frame.origin))
    }

    /// By how much all links between joints fall short of an end, mm; at most 0 for one the chain may have, or where a joint slides.
    pub(super) fn beyond_links(&self, end: &Isometry3<f64>) -> f64 {
        let slides = |own: &Segment| matches!(own.joint, Some((Motion::Translation(_), ..)));
        let [base, first, others @ .., last] = self.segments.as_slice() else { return 0.0 };
        let Some((motion, ..)) = base.joint.filter(|_| !self.segments.iter().any(slides)) else {
            return 0.0;
        };
        // What lies along the first axis does not turn about it.
        let along = motion.axis() * motion.axis().dot(&first.origin);
        let centre = base.origin + base.rotation * along;
        let last_joint = end * Point3::from(-last.rotation.tr_mul(&last.origin));
        let links_mm: f64 = others.iter().map(|own| own.origin.norm()).sum();
        (last_joint.coords - centre).norm() - (first.origin - along).norm() - links_mm
    }

    pub fn view(&self, q: &[f64]) -> ChainView {
        self.view_of(q, &Vector3::zeros())
    }

    pub fn view_of(&self, q: &[f64], lever: &Vector3<f64>) -> ChainView {
        let mut unknowns = Vec::with_capacity(self.segments.iter().map(|s| s.free.len()).sum());
        let (mut frame, axes) = self.walk(q, |segment, frame| {
            let in_root = |(unknown, motion): &(usize, UnitMotion)| (*unknown, frame.unit(motion));
            unknowns.extend(segment.free.iter().map(in_root));
        });
        frame.origin += frame.rotation * lever;
        let end = frame.origin;
        ChainView {
            end: frame.isometry(),
            unknowns: unknowns
                .into_iter()
                .map(|(unknown, motion)| (unknown, motion.carried_to(&end)))
                .collect(),
            joints: self.joint_twists(&axes, &end),
            axes: self.axes(&axes),
        }
    }

    /// The end's frame, and origin and direction of each joint; `at` is called with the frame before each segment.
    fn walk(&self, q: &[f64], mut at: impl FnMut(&Segment, &Frame)) -> (Frame, Vec<Line>) {
        let mut frame = Frame::root();
        let mut axes = Vec::with_capacity(self.segments.len());
        for segment in &self.segments {
            at(segment, &frame);
            frame.pass(segment);
            if let Some((motion, joint, sign)) = segment.joint {
                axes.push((Point3::from(frame.origin), frame.rotation * motion.axis()));
                frame.turn(motion, sign * q[joint]);
            }
        }
        (frame, axes)
    }

    fn axes(&self, axes: &[Line]) -> Axes {
        let joints = self.segments.iter().filter_map(|segment| segment.joint);
        let joint = |((motion, variable, factor), (origin, axis)): (_, &(_, _))| AxisJoint {
            variable,
            slides: matches!(motion, Motion::Translation(_)),
            factor,
            origin: *origin,
            axis: *axis,
        };
        Axes::of(joints.zip(axes).map(joint).collect(), self.joints)
    }

    fn joint_twists(&self, axes: &[Line], end: &Vector3<f64>) -> Vec<Twist> {
        let mut twists = vec![Twist::zero(); self.joints];
        let joints = self.segments.iter().filter_map(|segment| segment.joint);
        for ((motion, joint, sign), (origin, axis)) in joints.zip(axes) {
            let unit = UnitMotion::along(motion, *axis, origin.coords);
            twists[joint].add(&unit.carried_to(end), sign);
        }
        twists
    }
}

impl Segment {
    fn new(
        free: Vec<(usize, UnitMotion)>,
        transform: &Isometry3<f64>,
        joint: Option<(Motion, usize, f64)>,
    ) -> Self {
        Self {
            free,
            rotation: *transform.rotation.to_rotation_matrix().matrix(),
            origin: transform.translation.vector,
            joint,
        }
    }
}

struct Frame {
    rotation: Matrix3<f64>,
    origin: Vector3<f64>,
}

impl Frame {
    fn root() -> Self {
        Self { rotation: Matrix3::identity(), origin: Vector3::zeros() }
    }

    fn pass(&mut self, segment: &Segment) {
        self.origin += self.rotation * segment.origin;
        self.rotation *= segment.rotation;
    }

    /// Moves along or turns about one of its own axes: only the two other axes turn.
    fn turn(&mut self, motion: Motion, amount: f64) {
        let (first, second) = match motion {
            Motion::Translation(_) => {
                self.origin += self.rotation * motion.axis() * amount;
                return;
            }
            Motion::Rotation(Axis::X) => (1, 2),
            Motion::Rotation(Axis::Y) => (2, 0),
            Motion::Rotation(Axis::Z) => (0, 1),
        };
        let (sin, cos) = amount.sin_cos();
        for row in 0..3 {
            let (a, b) = (self.rotation[(row, first)], self.rotation[(row, second)]);
            self.rotation[(row, first)] = cos * a + sin * b;
            self.rotation[(row, second)] = cos * b - sin * a;
        }
    }

    /// A motion given in this frame, expressed in the root frame.
    fn unit(&self, motion: &UnitMotion) -> UnitMotion {
        match motion {
            UnitMotion::Translation(direction) => {
                UnitMotion::Translation(self.rotation * direction)
            }
            UnitMotion::Rotation { axis, through } => UnitMotion::Rotation {
                axis: self.rotation * axis,
                through: self.rotation * through + self.origin,
            },
        }
    }

    fn isometry(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.origin),
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::parameter::{LinkQuantity, Parameter};

    #[test]
    fn a_held_chain_equals_its_chain() {
        let free = |motion, nominal, link| Element::Free {
            motion,
            nominal,
            parameter: Parameter::Link { joint: link, quantity: LinkQuantity::A },
        };
        let joint = |motion, joint, sign| Element::Joint { motion, joint, sign };
        let chain = Chain::new(vec![
            Element::Fixed(Motion::Rotation(Axis::X).by(0.3)),
            free(Motion::Translation(Axis::Z), 120.0, 0),
            joint(Motion::Rotation(Axis::Z), 0, -1.0),
            free(Motion::Rotation(Axis::Y), 0.7, 1),
            free(Motion::Translation(Axis::X), 300.0, 2),
            joint(Motion::Translation(Axis::Y), 1, 1.0),
            joint(Motion::Rotation(Axis::X), 2, 1.0),
            // The same axis variable a second time: a coupled joint.
            joint(Motion::Rotation(Axis::Y), 0, 0.5),
            free(Motion::Rotation(Axis::Z), -0.4, 3),
            free(Motion::Translation(Axis::Z), 80.0, 4),
        ]);
        let (q, offsets) = ([0.8, 25.0, -1.3], [0.5, 1e-3, -0.2, 2e-3, 0.1]);
        // The third parameter is fixed.
        let unknowns = [Some(7), Some(3), None, Some(0), Some(5)];
        let lever = Vector3::new(30.0, -20.0, 10.0);
        let view = HeldChain::new(&chain, &offsets, &unknowns).view_of(&q, &lever);
        let beside = vec![Element::Fixed(Isometry3::translation(30.0, -20.0, 10.0))];
        let whole = chain.extended(Vec::new(), beside).differential(&q, &offsets);
        assert!((view.end.to_homogeneous() - whole.end.to_homogeneous()).norm() < 1e-11);
        let of_chain = |place: usize| whole.parameters[place];
        let expected = [(7, of_chain(0)), (3, of_chain(1)), (0, of_chain(3)), (5, of_chain(4))];
        let apart =
            |a: &Twist, b: &Twist| (a.linear - b.linear).norm() + (a.angular - b.angular).norm();
        for ((unknown, twist), (of, whole)) in view.unknowns.iter().zip(&expected) {
            assert_eq!(unknown, of);
            assert!(apart(twist, whole) < 1e-10);
        }
        assert_eq!(view.unknowns.len(), 4);
        for (twist, whole) in view.joints.iter().zip(&whole.joints) {
            assert!(apart(twist, whole) < 1e-10);
        }
        for (own, whole) in view.axes.first.iter().zip(chain.joint_axes(&q, &offsets)) {
            assert!((own.0 - whole.0).norm() + (own.1 - whole.1).norm() < 1e-11);
        }
    }
}
