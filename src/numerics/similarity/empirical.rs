//! The empirical semivariogram: all pairs, binned by separation.

use crate::units::whole;
use rayon::prelude::*;

use super::ErrorSample;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    pub from: f64,
    pub to: f64,
    pub separation: f64,
    pub pairs: u64,
    /// `1/(2N) Σ (e_i − e_j)²`, mm².
    pub gamma: f64,
}

/// Sums of one bin over its pairs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sums {
    from: f64,
    to: f64,
    pairs: u64,
    separations: f64,
    /// Squared differences along x, y, z and their sum.
    squares: [f64; 4],
}

impl Sums {
    /// The bin of one quantity (x, y, z, norm); `None` without pairs.
    pub fn bin(&self, quantity: usize) -> Option<Bin> {
        let pairs = self.pairs as f64;
        (self.pairs > 0).then(|| Bin {
            from: self.from,
            to: self.to,
            separation: self.separations / pairs,
            pairs: self.pairs,
            gamma: self.squares[quantity] / (2.0 * pairs),
        })
    }

    fn add(&mut self, separation: f64, a: &ErrorSample, b: &ErrorSample) {
        let difference = a.error - b.error;
        let [x, y, z] = [difference.x, difference.y, difference.z].map(|d| d * d);
        self.pairs += 1;
        self.separations += separation;
        for (sum, square) in self.squares.iter_mut().zip([x, y, z, x + y + z]) {
            *sum += square;
        }
    }

    fn merge(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.separations += other.separations;
        for (sum, square) in self.squares.iter_mut().zip(other.squares) {
            *sum += square;
        }
    }
}

/// Rows a worker sums at once; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 64;

/// All pairs of `samples` in `count` bins of equal width up to half of the largest separation.
pub fn bins(
    samples: &[ErrorSample],
    separation: impl Fn(&ErrorSample, &ErrorSample) -> f64 + Sync,
    count: usize,
) -> Vec<Sums> {
    let reach = largest(samples, &separation) / 2.0;
    if count == 0 || reach <= 0.0 {
        return Vec::new();
    }
    let width = reach / count as f64;
    let empty: Vec<Sums> = (0..count)
        .map(|bin| Sums {
            from: bin as f64 * width,
            to: (bin + 1) as f64 * width,
            ..Sums::default()
        })
        .collect();
    let rows: Vec<usize> = (0..samples.len()).collect();
    let part = |rows: &[usize]| {
        let mut sums = empty.clone();
        for &i in rows {
            for b in &samples[i + 1..] {
                let h = separation(&samples[i], b);
                if let Some(bin) = sums.get_mut(whole(h / width)) {
                    bin.add(h, &samples[i], b);
                }
            }
        }
        sums
    };
    let parts: Vec<_> = rows.par_chunks(CHUNK).map(part).collect();
    parts.iter().fold(empty.clone(), |mut total, part| {
        total.iter_mut().zip(part).for_each(|(total, part)| total.merge(part));
        total
    })
}

fn largest(
    samples: &[ErrorSample],
    separation: &(impl Fn(&ErrorSample, &ErrorSample) -> f64 + Sync),
) -> f64 {
    let row =
        |i: usize| samples[i + 1..].iter().map(|b| separation(&samples[i], b)).fold(0.0, f64::max);
    (0..samples.len()).into_par_iter().map(row).reduce(|| 0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;

    #[test]
    fn four_points_on_a_line_by_hand() {
        let sample = |x: f64, e: f64| ErrorSample {
            joints: vec![],
            position: Point3::new(x, 0.0, 0.0),
            error: Vector3::new(e, 0.0, 2.0 * e),
        };
        let samples = [sample(0.0, 0.0), sample(1.0, 1.0), sample(2.0, 0.0), sample(4.0, 3.0)];
        // Reach 2, two bins of width 1: [0, 1) empty; [1, 2) holds 0–1 and 1–2; 0–2 and 2–4 lie at the reach itself.
        let sums = bins(&samples, |a, b| (a.position - b.position).norm(), 2);
        assert!(sums[0].bin(0).is_none());
        let x = sums[1].bin(0).expect("two pairs");
        assert_eq!(x.pairs, 2);
        assert!((x.gamma - 0.5).abs() < 1e-15); // (1 + 1)/(2·2)
        assert!((sums[1].bin(3).expect("two pairs").gamma - 2.5).abs() < 1e-15); // ((1+4) + (1+4))/(2·2)
    }
}
