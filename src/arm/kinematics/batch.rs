//! Forward kinematics of many poses at once: the chain of [`HeldChain`](super::HeldChain), block by block; `axes[j][i]`
//! is the variable of axis j at pose i.
//!
//! 1. What is constant between two joints becomes one transform; each joint is turned so that it acts about or along z.
//! 2. Between two turning joints that transform's rotation is `Rot(z,φ) Rot(x,α) Rot(z,ψ)`: φ and ψ join the two angles
//!    (Denavit and Hartenberg 1955).
//! 3. From the end back to the root, the end's point and two of its axes are carried through joint after joint; the
//!    third axis is their cross product.
//!
//! Sums are in a fixed order and free of fused multiply-adds: a pose gives the same bytes at any place in the columns.

mod columns;
mod dh;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::chain::Chain;
use super::sin_cos::sin_cos;

pub use super::sin_cos::{BLOCK, Block};
pub use columns::{BatchColumns, Column, Variables};
use dh::{Joint, Link};

#[derive(Debug, Clone)]
pub struct BatchChain {
    joints: Vec<(Link, Joint)>,
    end: Isometry3<f64>,
    axes: usize,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Poses {
    /// `position[row][i]`, mm.
    pub position: [Vec<f64>; 3],
    /// `rotation[column][row][i]`: the end's x, y and z axes.
    pub rotation: [[Vec<f64>; 3]; 3],
}

/// Up to three vectors of the end on their way to the root: its origin, x axis and y axis.
type Vectors<const N: usize> = [[Block; 3]; N];

impl BatchChain {
    /// `chain` with `offsets` added to its free parameters, one each.
    pub fn new(chain: &Chain, offsets: &[f64]) -> Self {
        let (joints, end) = dh::links(chain, offsets);
        Self { joints, end, axes: chain.joint_count() }
    }

    /// Positions of the end in the root frame, `[row][i]`, mm; `axes` has a column of one length per axis variable.
    pub fn positions<C: AsRef<[f64]>>(&self, axes: &[C]) -> [Vec<f64>; 3] {
        let count = self.pose_count(axes);
        let mut positions = [(); 3].map(|()| vec![0.0; count]);
        for first in (0..count).step_by(BLOCK) {
            let [origin] = self.block::<1, _>(axes, first);
            write(&mut positions, first, &origin);
        }
        positions
    }

    /// Poses of the end in the root frame; `axes` as in [`Self::positions`].
    pub fn poses<C: AsRef<[f64]>>(&self, axes: &[C]) -> Poses {
        let count = self.pose_count(axes);
        let mut poses = Poses::default();
        for column in poses.rotation.iter_mut().flatten().chain(&mut poses.position) {
            column.resize(count, 0.0);
        }
        for first in (0..count).step_by(BLOCK) {
            let [origin, x, y] = self.block::<3, _>(axes, first);
            write(&mut poses.position, first, &origin);
            write(&mut poses.rotation[0], first, &x);
            write(&mut poses.rotation[1], first, &y);
            write(&mut poses.rotation[2], first, &cross(&x, &y));
        }
        poses
    }

    /// The number of poses in `axes`, after a check that there are enough columns and that they are of one length.
    fn pose_count<C: AsRef<[f64]>>(&self, axes: &[C]) -> usize {
        assert!(axes.len() >= self.axes, "one column for each axis variable");
        let count = axes.first().map_or(0, |column| column.as_ref().len());
        assert!(axes.iter().all(|column| column.as_ref().len() == count), "columns of one length");
        count
    }

    fn block<const N: usize, C: AsRef<[f64]>>(&self, axes: &[C], first: usize) -> Vectors<N> {
        let mut vectors = self.at_end();
        for (link, joint) in self.joints.iter().rev() {
            joint.pass(&read(axes[joint.axis].as_ref(), first), &mut vectors);
            link.pass(&mut vectors);
        }
        vectors
    }

    fn at_end<const N: usize>(&self) -> Vectors<N> {
        let rotation = self.end.rotation.to_rotation_matrix();
        let vector = |place: usize| -> Vector3<f64> {
            match place {
                0 => self.end.translation.vector,
                axis => rotation.matrix().column(axis - 1).into_owned(),
            }
        };
        std::array::from_fn(|place| std::array::from_fn(|row| [vector(place)[row]; BLOCK]))
    }
}

impl Poses {
    pub fn count(&self) -> usize {
        self.position[0].len()
    }

    /// The pose of row `i`, mm.
    pub fn isometry(&self, i: usize) -> Isometry3<f64> {
        let rotation = Matrix3::from_fn(|row, column| self.rotation[column][row][i]);
        Isometry3::from_parts(
            Translation3::from(Vector3::from_fn(|row, _| self.position[row][i])),
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
        )
    }
}

impl Joint {
    fn pass<const N: usize>(&self, variable: &Block, vectors: &mut Vectors<N>) {
        let amount: Block = std::array::from_fn(|i| self.sign * variable[i] + self.shift);
        if self.slides {
            for (z, amount) in vectors[0][2].iter_mut().zip(&amount) {
                *z += amount;
            }
            return;
        }
        let (mut sin, mut cos) = ([0.0; BLOCK], [0.0; BLOCK]);
        sin_cos(&amount, &mut sin, &mut cos);
        for [x, y, _] in vectors {
            for i in 0..BLOCK {
                let (a, b) = (x[i], y[i]);
                x[i] = cos[i] * a - sin[i] * b;
                y[i] = sin[i] * a + cos[i] * b;
            }
        }
    }
}

impl Link {
    /// Transforms vectors from the frame after the link to the frame before it; only the first, a point, is shifted.
    fn pass<const N: usize>(&self, vectors: &mut Vectors<N>) {
        for (place, vector) in vectors.iter_mut().enumerate() {
            let shift = if place == 0 { self.origin() } else { [0.0; 3] };
            match self {
                Self::AboutX { sin, cos, .. } => turn_about_x(vector, *sin, *cos, shift),
                Self::Any { rotation, .. } => turn(vector, rotation, shift),
            }
        }
    }
}

fn turn_about_x([x, y, z]: &mut [Block; 3], sin: f64, cos: f64, shift: [f64; 3]) {
    for i in 0..BLOCK {
        let (b, c) = (y[i], z[i]);
        x[i] += shift[0];
        y[i] = (cos * b - sin * c) + shift[1];
        z[i] = (sin * b + cos * c) + shift[2];
    }
}

fn turn([x, y, z]: &mut [Block; 3], r: &[[f64; 3]; 3], shift: [f64; 3]) {
    for i in 0..BLOCK {
        let (a, b, c) = (x[i], y[i], z[i]);
        x[i] = (r[0][0] * a + r[0][1] * b) + r[0][2] * c + shift[0];
        y[i] = (r[1][0] * a + r[1][1] * b) + r[1][2] * c + shift[1];
        z[i] = (r[2][0] * a + r[2][1] * b) + r[2][2] * c + shift[2];
    }
}

fn cross([a, b, c]: &[Block; 3], [d, e, f]: &[Block; 3]) -> [Block; 3] {
    [
        std::array::from_fn(|i| b[i] * f[i] - c[i] * e[i]),
        std::array::from_fn(|i| c[i] * d[i] - a[i] * f[i]),
        std::array::from_fn(|i| a[i] * e[i] - b[i] * d[i]),
    ]
}

/// The block of `column` that begins at `first`; zeros after the column's end.
fn read(column: &[f64], first: usize) -> Block {
    let rest = &column[first..];
    let filled = || std::array::from_fn(|place| rest.get(place).copied().unwrap_or(0.0));
    rest.first_chunk().copied().unwrap_or_else(filled)
}

fn write(columns: &mut [Vec<f64>; 3], first: usize, block: &[Block; 3]) {
    for (column, block) in columns.iter_mut().zip(block) {
        let rest = &mut column[first..];
        let count = rest.len().min(BLOCK);
        rest[..count].copy_from_slice(&block[..count]);
    }
}

#[cfg(test)]
mod tests;
