//! The end's motion per unit of every free parameter, a block of poses at a time: the columns of the Jacobian. A free
//! element's axis is a column of the frame there; carried to the end it is the parameter's column.

use super::super::sin_cos::{BLOCK, Block, sin_cos};
use super::read;
use crate::geometry::rpy;
use crate::kinematics::{Axis, Chain, Element, Motion};

#[derive(Debug, Clone)]
pub struct BatchColumns {
    steps: Vec<Step>,
    unknowns: Vec<usize>,
}

/// Axis variables of many poses, `[j][i]` that of axis j at pose i, with sines and cosines, which a fit's steps reuse.
#[derive(Debug, Clone)]
pub struct Variables {
    values: Vec<Vec<f64>>,
    sines: Vec<Vec<f64>>,
    cosines: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Velocity of the end's origin, mm per unit, by row.
    pub linear: [Block; 3],
    /// Angular velocity, rad per unit, by row; undefined for a length.
    angular: [Block; 3],
    turns: bool,
}

#[derive(Debug, Clone)]
enum Step {
    Unknown(Motion),
    /// A shift along an own axis, mm.
    Shift(Axis, f64),
    /// A constant turn about an own axis: sine and cosine.
    Turn(Axis, f64, f64),
    /// A joint along or about an own axis, by `factor · variable`.
    Joint(Motion, usize, f64),
}

#[derive(Debug, Clone)]
struct Walk {
    axes: [[Block; 3]; 3],
    origin: [Block; 3],
}

impl BatchColumns {
    /// `chain` with `offsets` added to its free parameters; `unknowns` holds the unknown of each, `None` where fixed.
    pub fn new(chain: &Chain, offsets: &[f64], unknowns: &[Option<usize>]) -> Self {
        let mut steps = Vec::new();
        let mut parameter = 0;
        for element in chain.elements() {
            match element {
                Element::Fixed(transform) => {
                    let [x, y, z] = transform.translation.vector.into();
                    let [roll, pitch, yaw] = rpy(&transform.rotation);
                    let shifts = [(Axis::X, x), (Axis::Y, y), (Axis::Z, z)];
                    let turns = [(Axis::Z, yaw), (Axis::Y, pitch), (Axis::X, roll)];
                    steps.extend(shifts.map(|(axis, by)| Step::of(Motion::Translation(axis), by)));
                    steps.extend(turns.map(|(axis, by)| Step::of(Motion::Rotation(axis), by)));
                }
                Element::Free { motion, nominal, .. } => {
                    if unknowns[parameter].is_some() {
                        steps.push(Step::Unknown(*motion));
                    }
                    steps.push(Step::of(*motion, nominal + offsets[parameter]));
                    parameter += 1;
                }
                Element::Joint { motion, joint, sign } => {
                    steps.push(Step::Joint(*motion, *joint, *sign));
                }
            }
        }
        steps.retain(Step::moves);
        Self { steps, unknowns: unknowns[..parameter].iter().flatten().copied().collect() }
    }

    pub fn unknowns(&self) -> &[usize] {
        &self.unknowns
    }

    /// The end's axes, its origin and one column for each of [`Self::unknowns`], for the poses from `first` on;
    /// `columns` is reused.
    pub fn block(
        &self,
        variables: &Variables,
        first: usize,
        columns: &mut Vec<Column>,
    ) -> ([[Block; 3]; 3], [Block; 3]) {
        columns.resize(self.unknowns.len(), Column::EMPTY);
        let mut met = columns.iter_mut();
        let mut walk = Walk::root();
        for step in &self.steps {
            match step {
                Step::Unknown(motion) => {
                    walk.meet(*motion, met.next().expect("a column for each unknown"));
                }
                Step::Shift(axis, by) => walk.shift(*axis, &[*by; BLOCK]),
                Step::Turn(axis, sin, cos) => walk.turn(*axis, &[*sin; BLOCK], &[*cos; BLOCK]),
                Step::Joint(motion, joint, factor) => match motion {
                    Motion::Translation(axis) => {
                        walk.shift(*axis, &variables.times(*factor, *joint, first));
                    }
                    Motion::Rotation(axis) => {
                        let (sin, cos) = variables.turned(*factor, *joint, first);
                        walk.turn(*axis, &sin, &cos);
                    }
                },
            }
        }
        for column in columns {
            column.carry_to(&walk.origin);
        }
        (walk.axes, walk.origin)
    }
}

impl Variables {
    /// These axis variables, rad; mm where a joint slides.
    pub fn of(values: Vec<Vec<f64>>) -> Self {
        let turned = |column: &Vec<f64>| {
            let (mut sines, mut cosines) = (Vec::new(), Vec::new());
            for first in (0..column.len()).step_by(BLOCK) {
                let (mut sin, mut cos) = ([0.0; BLOCK], [0.0; BLOCK]);
                sin_cos(&read(column, first), &mut sin, &mut cos);
                let count = (column.len() - first).min(BLOCK);
                sines.extend_from_slice(&sin[..count]);
                cosines.extend_from_slice(&cos[..count]);
            }
            (sines, cosines)
        };
        let (sines, cosines) = values.iter().map(turned).unzip();
        Self { values, sines, cosines }
    }

    pub fn values(&self) -> &[Vec<f64>] {
        &self.values
    }

    /// An axis variable times a factor, for the poses from `first` on.
    fn times(&self, factor: f64, axis: usize, first: usize) -> Block {
        read(&self.values[axis], first).map(|own| factor * own)
    }

    #[expect(clippy::float_cmp, reason = "factors of one are stated as such")]
    fn turned(&self, factor: f64, axis: usize, first: usize) -> (Block, Block) {
        // Nearly all joints turn by their variable; one that follows another has a factor of its own.
        if factor.abs() == 1.0 {
            let sin = read(&self.sines[axis], first).map(|own| factor * own);
            return (sin, read(&self.cosines[axis], first));
        }
        let (mut sin, mut cos) = ([0.0; BLOCK], [0.0; BLOCK]);
        sin_cos(&self.times(factor, axis, first), &mut sin, &mut cos);
        (sin, cos)
    }
}

impl Step {
    fn of(motion: Motion, by: f64) -> Self {
        match motion {
            Motion::Translation(axis) => Self::Shift(axis, by),
            Motion::Rotation(axis) => {
                let (sin, cos) = by.sin_cos();
                Self::Turn(axis, sin, cos)
            }
        }
    }

    fn moves(&self) -> bool {
        match self {
            Self::Shift(_, by) => *by != 0.0,
            Self::Turn(_, sin, cos) => (*sin, *cos) != (0.0, 1.0),
            Self::Unknown(_) | Self::Joint(..) => true,
        }
    }
}

impl Column {
    const EMPTY: Self =
        Self { linear: [[0.0; BLOCK]; 3], angular: [[0.0; BLOCK]; 3], turns: false };

    /// Motion of the end's orientation, rad per unit, by row; `None` for a length, which turns nothing.
    pub fn angular(&self) -> Option<&[Block; 3]> {
        self.turns.then_some(&self.angular)
    }

    /// Carries an axis from its own place (kept in `linear`) to the end: the cross product of axis and way there.
    fn carry_to(&mut self, end: &[Block; 3]) {
        if !self.turns {
            return;
        }
        let ([a, b, c], [x, y, z]) = (&self.angular, &mut self.linear);
        for i in 0..BLOCK {
            let (u, v, w) = (end[0][i] - x[i], end[1][i] - y[i], end[2][i] - z[i]);
            x[i] = b[i] * w - c[i] * v;
            y[i] = c[i] * u - a[i] * w;
            z[i] = a[i] * v - b[i] * u;
        }
    }
}

impl Walk {
    fn root() -> Self {
        let unit =
            |axis: usize| std::array::from_fn(|row| [f64::from(u8::from(row == axis)); BLOCK]);
        Self { axes: std::array::from_fn(unit), origin: [[0.0; BLOCK]; 3] }
    }

    /// Begins an unknown's column: a length's is its axis; an angle's axis and place are kept until the end is known.
    fn meet(&self, motion: Motion, column: &mut Column) {
        match motion {
            Motion::Translation(axis) => {
                column.linear = self.axes[place(axis)];
                column.turns = false;
            }
            Motion::Rotation(axis) => {
                column.linear = self.origin;
                column.angular = self.axes[place(axis)];
                column.turns = true;
            }
        }
    }

    fn shift(&mut self, axis: Axis, by: &Block) {
        for (origin, along) in self.origin.iter_mut().zip(&self.axes[place(axis)]) {
            for i in 0..BLOCK {
                origin[i] += along[i] * by[i];
            }
        }
    }

    /// Turns the frame about an own axis: only the two other axes turn.
    fn turn(&mut self, axis: Axis, sin: &Block, cos: &Block) {
        let [x, y, z] = &mut self.axes;
        let (first, second) = match axis {
            Axis::X => (y, z),
            Axis::Y => (z, x),
            Axis::Z => (x, y),
        };
        for (first, second) in first.iter_mut().zip(second) {
            for i in 0..BLOCK {
                let (a, b) = (first[i], second[i]);
                first[i] = cos[i] * a + sin[i] * b;
                second[i] = cos[i] * b - sin[i] * a;
            }
        }
    }
}

const fn place(axis: Axis) -> usize {
    match axis {
        Axis::X => 0,
        Axis::Y => 1,
        Axis::Z => 2,
    }
}
