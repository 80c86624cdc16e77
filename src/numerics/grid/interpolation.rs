//! Interpolation inside a cell from its eight vertices, as weights, so that covariances follow.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The interpolation of a value inside a cell from its vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Inverse distance weights `w_i ∝ d_i^{−p}`, the seed paper's family; the power is a setting.
    Idw,
    /// Reproduces linear fields; its error falls with the square of the step.
    Trilinear,
}

/// Distance to a vertex, mm, below which a point is taken to be at it.
const EXACT_HIT_MM: f64 = 1e-9;

impl Interpolation {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idw => "idw",
            Self::Trilinear => "trilinear",
        }
    }

    /// Weights of the eight vertices (bit k of the number set: high along axis k) at `fraction` of a cell of `step` mm.
    pub fn weights(self, fraction: &Vector3<f64>, step: &[f64; 3], power: f64) -> [f64; 8] {
        match self {
            Self::Idw => idw(fraction, step, power),
            Self::Trilinear => std::array::from_fn(|vertex| {
                let of = |f: f64, is_high: bool| if is_high { f } else { 1.0 - f };
                (0..3).map(|axis| of(fraction[axis], is_high(vertex, axis))).product()
            }),
        }
    }
}

const fn is_high(vertex: usize, axis: usize) -> bool {
    vertex >> axis & 1 == 1
}

/// The place of a vertex in the unit cell.
pub(super) fn corner(vertex: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| if is_high(vertex, axis) { 1.0 } else { 0.0 })
}

/// Weights `w_i ∝ d_i^{−p}` of the distances that sum to one; the first below [`EXACT_HIT_MM`] has all the weight.
fn idw(fraction: &Vector3<f64>, step: &[f64; 3], power: f64) -> [f64; 8] {
    let away = |vertex| (fraction - corner(vertex)).component_mul(&Vector3::from(*step)).norm();
    let distances: [f64; 8] = std::array::from_fn(away);
    if let Some(hit) = distances.iter().position(|own| *own < EXACT_HIT_MM) {
        return std::array::from_fn(|vertex| if vertex == hit { 1.0 } else { 0.0 });
    }
    // Relative to the nearest, so that no power overflows.
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let shares = distances.map(|own| (nearest / own).powf(power));
    let total: f64 = shares.iter().sum();
    shares.map(|own| own / total)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: [f64; 3] = [100.0, 50.0, 200.0];

    fn value(weights: [f64; 8], field: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let corner = |vertex, axis| {
            if is_high(vertex, axis) { STEP[axis] } else { 0.0 }
        };
        (0..8).map(|v| weights[v] * field(corner(v, 0), corner(v, 1), corner(v, 2))).sum()
    }

    #[test]
    fn trilinear_reproduces_a_linear_field() {
        let field = |x: f64, y: f64, z: f64| 0.3 + 0.01 * x - 0.02 * y + 0.005 * z;
        let fraction = Vector3::new(0.2, 0.7, 0.9);
        let found = value(Interpolation::Trilinear.weights(&fraction, &STEP, 0.0), field);
        assert!((found - field(20.0, 35.0, 180.0)).abs() < 1e-12);
    }

    #[test]
    fn idw_returns_a_vertex_it_hits_and_averages_in_the_middle() {
        let hit = Interpolation::Idw.weights(&Vector3::new(1.0, 0.0, 1.0), &STEP, 2.0);
        assert!((hit[5] - 1.0).abs() < 1e-15); // bits 0 and 2
        let middle = Interpolation::Idw.weights(&Vector3::repeat(0.5), &STEP, 2.0);
        assert!(middle.iter().all(|&w| (w - 0.125).abs() < 1e-15));
    }

    #[test]
    fn weights_sum_to_one() {
        for interpolation in [Interpolation::Idw, Interpolation::Trilinear] {
            let weights = interpolation.weights(&Vector3::new(0.01, 0.4, 0.99), &STEP, 3.0);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
