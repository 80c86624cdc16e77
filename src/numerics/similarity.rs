//! Similarity: how alike errors are at a separation, in joint space and in Cartesian space ([`crate::method::similarity`]).
//!
//! Inputs are error vectors with the joint angles and positions they belong to; output is one [`Semivariogram`] per
//! space and quantity. Steps:
//! 1. the empirical semivariogram `γ(h) = 1/(2N(h)) Σ (e_i − e_j)²` in bins up to half of the largest separation
//!    ([`empirical`]);
//! 2. spherical, exponential and Gaussian models of it ([`variogram`]), by least squares weighted with the pair counts;
//! 3. a verdict: a rising curve shows similarity, a flat one shows that there is nothing to interpolate.

pub mod empirical;
pub mod variogram;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::units::chord;

pub use empirical::Bin;
pub use variogram::{Shape, VariogramModel};

/// The `[similarity]` section of a pipeline file.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimilaritySettings {
    /// Bins up to half of the largest separation.
    pub bins: usize,
    /// Weight of each joint's chord `2 sin(Δq/2)` in the joint-space separation; of a joint that slides, of its distance, a mm of
    /// which counts as a mrad. Absent: 1 for every joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_weights: Option<Vec<f64>>,
    /// Whether each joint slides, as the arm says; empty where all turn.
    #[serde(skip)]
    pub slides: Vec<bool>,
}

impl Default for SimilaritySettings {
    fn default() -> Self {
        Self { bins: 15, joint_weights: None, slides: Vec::new() }
    }
}

/// One error with the joint angles and the position where it was observed.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorSample {
    pub joints: Vec<f64>,
    pub position: Point3<f64>,
    pub error: Vector3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// Weighted joint angles; separations are chords, rad.
    Joint,
    /// Cartesian; separations in mm.
    Cartesian,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Error along x of the base frame.
    X,
    Y,
    Z,
    /// The whole vector: `½ |e_i − e_j|²`.
    Norm,
}

impl Quantity {
    pub const ALL: [Self; 4] = [Self::X, Self::Y, Self::Z, Self::Norm];
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alikeness {
    /// Near errors are more alike than far ones: there is something to interpolate.
    Rising,
    /// The curve is flat: neighbours carry no information.
    Flat,
    TooFewPairs,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Semivariogram {
    pub space: Space,
    pub quantity: Quantity,
    /// Bins in order of separation; empty ones are left out.
    pub bins: Vec<Bin>,
    /// The fitted models, best first; empty with fewer than four bins.
    pub models: Vec<VariogramModel>,
    pub alikeness: Alikeness,
}

/// Semivariograms of `samples`, per axis and norm, in joint space and in Cartesian space.
pub fn semivariograms(
    samples: &[ErrorSample],
    settings: &SimilaritySettings,
) -> Vec<Semivariogram> {
    let joint_count = samples.first().map_or(0, |sample| sample.joints.len());
    let weights = settings.joint_weights.clone().unwrap_or_else(|| vec![1.0; joint_count]);
    let joint = |a: &ErrorSample, b: &ErrorSample| {
        joint_separation(&a.joints, &b.joints, &weights, &settings.slides)
    };
    let cartesian = |a: &ErrorSample, b: &ErrorSample| (a.position - b.position).norm();
    let mut found = in_space(Space::Joint, &empirical::bins(samples, joint, settings.bins));
    found.extend(in_space(Space::Cartesian, &empirical::bins(samples, cartesian, settings.bins)));
    found
}

/// `√Σ (w_j 2 sin(Δq_j/2))²`: the chord repeats after a full turn, as the error does. A joint that slides has its plain distance in m.
fn joint_separation(a: &[f64], b: &[f64], weights: &[f64], slides: &[bool]) -> f64 {
    let slides = slides.iter().copied().chain(std::iter::repeat(false));
    let chords = a
        .iter()
        .zip(b)
        .zip(weights)
        .zip(slides)
        .map(|(((a, b), weight), slides)| weight * chord(a - b, slides));
    chords.map(|chord| chord * chord).sum::<f64>().sqrt()
}

fn in_space(space: Space, sums: &[empirical::Sums]) -> Vec<Semivariogram> {
    let of_quantity = |(index, quantity): (usize, Quantity)| {
        let bins: Vec<Bin> = sums.iter().filter_map(|sums| sums.bin(index)).collect();
        let models = variogram::fit_all(&bins);
        let alikeness = variogram::alikeness(&bins, &models);
        Semivariogram { space, quantity, bins, models, alikeness }
    };
    Quantity::ALL.into_iter().enumerate().map(of_quantity).collect()
}
