//! Series: numbers with a name and a look, and the ways to make them.

use maud::{Markup, html};

use super::LOOKS;
use super::frame::Frame;
use super::marks::Marks;

/// Numbers that belong together, drawn in one look and named in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; an empty one is left out of it.
    pub name: String,
    pub marks: Vec<Marks>,
    /// Number of the look, from 0; `None`: its place among the series.
    pub look: Option<usize>,
}

const MOST_STEPS: usize = 240;

impl Series {
    pub fn new(name: &str, marks: Vec<Marks>) -> Self {
        Self { name: name.to_owned(), marks, look: None }
    }

    pub fn line(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(name, vec![Marks::Line(points)])
    }

    pub fn points(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(name, vec![Marks::Points(points)])
    }

    pub fn line_and_points(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(name, vec![Marks::Line(points.clone()), Marks::Points(points)])
    }

    /// The empirical distribution of `values`: the share, in percent, of values that are not above a value.
    ///
    /// For many values evenly spaced ranks are drawn, always with the largest.
    pub fn distribution(name: &str, values: &[f64]) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let every = n.div_ceil(MOST_STEPS).max(1);
        let ranks = (1..=n).filter(|rank| (n - rank).is_multiple_of(every));
        let step = |rank: usize| [sorted[rank - 1], 100.0 * rank as f64 / n as f64];
        let start = sorted.first().map(|least| [*least, 0.0]);
        Self::new(name, vec![Marks::Steps(start.into_iter().chain(ranks.map(step)).collect())])
    }

    /// Gives the series a fixed look, so that one thing looks alike in several charts.
    #[must_use]
    pub const fn looking(mut self, look: usize) -> Self {
        self.look = Some(look);
        self
    }

    /// The class of its look in the style.
    pub(super) fn class(&self) -> String {
        format!("s{}", self.look.unwrap_or(0) % LOOKS)
    }

    /// Every corner of its marks, x and y.
    pub(super) fn corners(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.marks.iter().flat_map(Marks::corners)
    }

    /// Keeps the marks whose corners `fits` accepts; returns how many were left out.
    pub(super) fn retain(&mut self, fits: impl Fn([f64; 2]) -> bool) -> usize {
        self.marks.iter_mut().map(|marks| marks.retain(&fits)).sum()
    }

    pub(super) fn drawn(&self, frame: &Frame) -> Markup {
        html! {
            g class=(self.class()) {
                @for marks in &self.marks { (marks.drawn(frame, self.look.unwrap_or(0))) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_to_all_of_its_values() {
        let series = Series::distribution("error", &[0.3, 0.1, 0.2, 0.2]);
        let Marks::Steps(steps) = &series.marks[0] else { panic!("{series:?}") };
        assert_eq!(steps, &[[0.1, 0.0], [0.1, 25.0], [0.2, 50.0], [0.2, 75.0], [0.3, 100.0]]);
        let many: Vec<f64> = (0..1000).map(f64::from).collect();
        let series = Series::distribution("error", &many);
        let corners: Vec<_> = series.corners().collect();
        // Every fifth of a thousand, with the first and the last.
        assert_eq!((corners.len(), corners[200]), (201, [999.0, 100.0]));
    }
}
