//! The model of a training's rounds: without harmonics that add next to nothing.
//!
//! The prior variance of a curve's harmonics falls with their order, and a round's work grows with the cube of its columns. The highest
//! harmonics that together add less than half a percent of a station's noise variance are determined by no station: they move neither
//! sizes nor residuals. They leave all rounds but the last, whose posterior has them all.

use super::layout::Block;
use super::rows::{Around, State, covariances};
use super::whitening::noise_factor;

/// The share of a station's noise variance that may leave.
const NEGLIGIBLE: f64 = 0.005;
/// Stations that show how far joints move the target, evenly chosen.
const SHOWN: usize = 64;

impl State {
    /// This state without the harmonics that add next to nothing at its sizes and its noise.
    pub(super) fn narrowed(&self, around: &Around<'_>) -> Self {
        let seen = seen_variances(around);
        let variances = self.components.variances();
        let layout = self.layout.resized(|block, columns| {
            let Block::Curve(joint) = block else { return columns.len() };
            let negligible = NEGLIGIBLE / (seen.len() as f64 * seen[joint]);
            let mut left = 0.0;
            let leaves = |pair: &&[f64]| {
                left += pair[0];
                left < negligible
            };
            let of_pairs = variances.as_slice()[columns.clone()].chunks_exact(2);
            columns.len() - 2 * of_pairs.rev().take_while(leaves).count()
        });
        let components = self.components.narrowed(&self.layout, &layout);
        Self { layout, components, ..self.clone() }
    }
}

/// Noise variances of a station, of one row, that a unit variance of each joint's error adds on the mean: 1/rad², 1/mm² where it slides.
fn seen_variances(around: &Around<'_>) -> Vec<f64> {
    let every = around.count().div_ceil(SHOWN).max(1);
    let stations: Vec<usize> = (0..around.count()).step_by(every).collect();
    let rows = around.rows(&stations);
    let mut sums = vec![0.0; around.state.repeatability.joints.len()];
    for (row, noise) in rows.iter().zip(covariances(around.state, &rows, &stations)) {
        let motions = noise_factor(&noise).solve_lower_triangular(&row.noise.joints);
        let motions = motions.expect("a factor has no zero pivot");
        for (sum, own) in sums.iter_mut().zip(motions.column_iter()) {
            *sum += own.norm_squared();
        }
    }
    let count: usize = rows.iter().map(|row| row.value.len()).sum();
    sums.into_iter().map(|sum| sum / count.max(1) as f64).collect()
}

#[cfg(test)]
mod tests {
    use crate::fit::full::components::Components;
    use crate::fit::full::layout::{Block, Layout};
    use crate::fit::full::settings::FullSettings;

    #[test]
    fn a_shorter_curve_keeps_its_first_harmonics_and_what_stands_behind_it() {
        let mut layout = Layout::new(1);
        layout.push(Block::Unknowns, 2);
        layout.push(Block::Curve(0), 8);
        layout.push(Block::Curve(1), 0);
        let settings = FullSettings::default();
        let mut wide = Components::new(&layout, &[1.0, 2.0], &settings, 100.0);
        layout.push(Block::Line { joint: 0, cycles: 30.0 }, 2);
        wide.add_lines(&layout, &settings);
        wide.all.iter_mut().zip(2..).for_each(|(own, place)| own.size *= f64::from(place));
        let narrow = layout.resized(|block, own| match block {
            Block::Curve(_) => own.len() / 2,
            _ => own.len(),
        });
        let mut found = Components::new(&narrow, &[1.0, 2.0], &settings, 100.0);
        found.take_sizes(&wide);
        assert_eq!(wide.narrowed(&layout, &narrow), found);
        let all = wide.variances();
        let kept = [&all.as_slice()[..6], &all.as_slice()[10..]].concat();
        assert_eq!(found.variances().as_slice(), kept);
    }
}
