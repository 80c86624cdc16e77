//! Series: what is drawn of numbers in a frame.

use maud::{Markup, html};

use super::frame::Frame;
use super::{LOOKS, px};

/// Numbers that belong together, drawn in one look and named in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend; none for an empty one.
    pub name: String,
    /// What is drawn, from back to front.
    pub marks: Vec<Marks>,
    /// Which look it has, from 0; its place among the series where not said.
    pub look: Option<usize>,
}

/// A way to draw numbers.
#[derive(Debug, Clone, PartialEq)]
pub enum Marks {
    /// A line through points x, y.
    Line(Vec<[f64; 2]>),
    /// A marker at each x, y.
    Points(Vec<[f64; 2]>),
    /// A ring around each x, y: what was chosen.
    Rings(Vec<[f64; 2]>),
    /// A line that keeps its y until the next x.
    Steps(Vec<[f64; 2]>),
    /// The area between low and high: x, low, high.
    Band(Vec<[f64; 3]>),
    /// An interval at each x: x, low, high.
    Whiskers(Vec<[f64; 3]>),
    /// Bars from the axis's zero.
    Bars(Vec<Bar>),
}

/// A bar of a histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Left edge.
    pub from: f64,
    /// Right edge.
    pub to: f64,
    /// How many values lie between.
    pub count: f64,
}

/// From so many points on markers would hide each other, and dots are drawn.
const CROWD: usize = 120;
/// Points that an empirical distribution is drawn by at most.
const MOST_STEPS: usize = 240;

impl Series {
    /// A series of `marks`.
    pub fn new(name: &str, marks: Vec<Marks>) -> Self {
        Self {
            name: name.to_owned(),
            marks,
            look: None,
        }
    }

    /// A line through points x, y.
    pub fn line(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(name, vec![Marks::Line(points)])
    }

    /// A scatter of points x, y.
    pub fn points(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(name, vec![Marks::Points(points)])
    }

    /// A line with a marker at each point.
    pub fn line_and_points(name: &str, points: Vec<[f64; 2]>) -> Self {
        Self::new(
            name,
            vec![Marks::Line(points.clone()), Marks::Points(points)],
        )
    }

    /// A line x, y within a band x, low, high.
    pub fn band(name: &str, line: Vec<[f64; 2]>, band: Vec<[f64; 3]>) -> Self {
        Self::new(name, vec![Marks::Band(band), Marks::Line(line)])
    }

    /// The empirical distribution of `values`: which share, in percent, is not above a value.
    ///
    /// Of many values evenly spaced ranks are drawn, the largest always.
    pub fn distribution(name: &str, values: &[f64]) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let every = n.div_ceil(MOST_STEPS).max(1);
        let ranks = (1..=n).filter(|rank| (n - rank).is_multiple_of(every));
        let step = |rank: usize| [sorted[rank - 1], 100.0 * rank as f64 / n as f64];
        let start = sorted.first().map(|least| [*least, 0.0]);
        Self::new(
            name,
            vec![Marks::Steps(
                start.into_iter().chain(ranks.map(step)).collect(),
            )],
        )
    }

    /// How many of `values` lie in each of `count` bins of equal width.
    pub fn histogram(name: &str, values: &[f64], count: usize) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = (
            finite().fold(f64::INFINITY, f64::min),
            finite().fold(f64::NEG_INFINITY, f64::max),
        );
        let width = if high > low {
            (high - low) / count.max(1) as f64
        } else {
            1.0
        };
        let edge = |place: usize| low + width * place as f64;
        let bar = |place: usize| {
            // The last bin holds its upper edge too.
            let inside =
                |v: &f64| *v >= edge(place) && (*v < edge(place + 1) || place + 1 == count);
            Bar {
                from: edge(place),
                to: edge(place + 1),
                count: finite().filter(inside).count() as f64,
            }
        };
        let bars = if low <= high {
            (0..count).map(bar).collect()
        } else {
            Vec::new()
        };
        Self::new(name, vec![Marks::Bars(bars)])
    }

    /// The same series in a look of its own, so that one thing looks alike in several charts.
    #[must_use]
    pub const fn looking(mut self, look: usize) -> Self {
        self.look = Some(look);
        self
    }

    /// The class that its look has in the style.
    pub(super) fn class(&self) -> String {
        format!("s{}", self.look.unwrap_or(0) % LOOKS)
    }

    /// Every corner of what is drawn, x and y.
    pub(super) fn corners(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.marks.iter().flat_map(Marks::corners)
    }

    /// Keeps what has only corners that `fits` says yes to; gives how many were left out.
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

impl Marks {
    fn corners(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Line(points)
            | Self::Points(points)
            | Self::Rings(points)
            | Self::Steps(points) => points.clone(),
            Self::Band(spans) | Self::Whiskers(spans) => spans
                .iter()
                .flat_map(|&[x, low, high]| [[x, low], [x, high]])
                .collect(),
            Self::Bars(bars) => bars
                .iter()
                .flat_map(|bar| [[bar.from, 0.0], [bar.to, bar.count]])
                .collect(),
        }
    }

    fn retain(&mut self, fits: &impl Fn([f64; 2]) -> bool) -> usize {
        let before = self.len();
        match self {
            Self::Line(points)
            | Self::Points(points)
            | Self::Rings(points)
            | Self::Steps(points) => points.retain(|point| fits(*point)),
            Self::Band(spans) | Self::Whiskers(spans) => {
                spans.retain(|&[x, low, high]| fits([x, low]) && fits([x, high]));
            }
            Self::Bars(bars) => {
                bars.retain(|bar| fits([bar.from, bar.count]) && fits([bar.to, bar.count]));
            }
        }
        before - self.len()
    }

    const fn len(&self) -> usize {
        match self {
            Self::Line(points)
            | Self::Points(points)
            | Self::Rings(points)
            | Self::Steps(points) => points.len(),
            Self::Band(spans) | Self::Whiskers(spans) => spans.len(),
            Self::Bars(bars) => bars.len(),
        }
    }

    fn drawn(&self, frame: &Frame, look: usize) -> Markup {
        let (class, path) = match self {
            Self::Line(points) => ("line", frame.polyline(points.iter().copied())),
            Self::Points(points) if points.len() >= CROWD => {
                let dot = |point: &[f64; 2]| {
                    let [x, y] = frame.at(*point);
                    format!("M{} {}h0", px(x), px(y))
                };
                ("dots", points.iter().map(dot).collect())
            }
            Self::Points(points) => (
                "points",
                points
                    .iter()
                    .map(|point| marker(frame.at(*point), look))
                    .collect(),
            ),
            Self::Rings(points) => (
                "ring",
                points
                    .iter()
                    .map(|point| circle(frame.at(*point), 7.5))
                    .collect(),
            ),
            Self::Steps(points) => ("line", steps(frame, points)),
            Self::Band(spans) => ("band", band(frame, spans)),
            Self::Whiskers(spans) => (
                "line whisker",
                spans.iter().map(|span| whisker(frame, *span)).collect(),
            ),
            Self::Bars(bars) => ("bar", bars.iter().map(|own| bar(frame, own)).collect()),
        };
        html! { path class=(class) d=(path) {} }
    }
}

/// The marker of a look: circle, square, triangle, diamond, cross, plus.
pub(super) fn marker([x, y]: [f64; 2], look: usize) -> String {
    let at = format!("M{} {}", px(x), px(y));
    match look % LOOKS {
        0 => circle([x, y], 3.2),
        1 => format!("{at}m-3-3h6v6h-6z"),
        2 => format!("{at}m0-4l3.8 6.8h-7.6z"),
        3 => format!("{at}m0-4.2l4.2 4.2l-4.2 4.2l-4.2-4.2z"),
        4 => format!(
            "{at}m-3.5-2.5l1-1l2.5 2.5l2.5-2.5l1 1l-2.5 2.5l2.5 2.5l-1 1l-2.5-2.5l-2.5 2.5l-1-1l2.5-2.5z"
        ),
        _ => format!("{at}m-4-1h3v-3h2v3h3v2h-3v3h-2v-3h-3z"),
    }
}

fn circle([x, y]: [f64; 2], r: f64) -> String {
    let (r, d) = (px(r), px(2.0 * r));
    format!(
        "M{} {}m-{r} 0a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0-{d} 0z",
        px(x),
        px(y)
    )
}

fn steps(frame: &Frame, points: &[[f64; 2]]) -> String {
    let at = |place: usize| frame.at(points[place]);
    let step = |place: usize| match place {
        0 => format!("M{} {}", px(at(0)[0]), px(at(0)[1])),
        _ => format!("H{}V{}", px(at(place)[0]), px(at(place)[1])),
    };
    (0..points.len()).map(step).collect()
}

fn band(frame: &Frame, spans: &[[f64; 3]]) -> String {
    let there = spans.iter().map(|&[x, low, _]| [x, low]);
    let back = spans.iter().rev().map(|&[x, _, high]| [x, high]);
    format!("{}z", frame.polyline(there.chain(back)))
}

fn whisker(frame: &Frame, [x, low, high]: [f64; 3]) -> String {
    let ([x, low], [_, high]) = (frame.at([x, low]), frame.at([x, high]));
    format!("M{} {}h6m-3 0V{}m-3 0h6", px(x - 3.0), px(low), px(high))
}

fn bar(frame: &Frame, bar: &Bar) -> String {
    let ([left, top], [right, bottom]) = (frame.at([bar.from, bar.count]), frame.at([bar.to, 0.0]));
    // A pixel between bars tells them apart.
    let right = (right - 1.0).max(left);
    format!(
        "M{} {}V{}H{}V{}z",
        px(left),
        px(bottom),
        px(top),
        px(right),
        px(bottom)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_to_all_of_its_values() {
        let series = Series::distribution("error", &[0.3, 0.1, 0.2, 0.2]);
        let Marks::Steps(steps) = &series.marks[0] else {
            panic!("{series:?}")
        };
        assert_eq!(
            steps,
            &[
                [0.1, 0.0],
                [0.1, 25.0],
                [0.2, 50.0],
                [0.2, 75.0],
                [0.3, 100.0]
            ]
        );
        let many: Vec<f64> = (0..1000).map(f64::from).collect();
        let series = Series::distribution("error", &many);
        let corners: Vec<_> = series.corners().collect();
        // Every fifth of a thousand, with the first and the last.
        assert_eq!((corners.len(), corners[200]), (201, [999.0, 100.0]));
    }

    #[test]
    fn a_histogram_counts_every_value_once() {
        let series = Series::histogram("error", &[0.0, 1.0, 2.0, 3.0, 4.0], 2);
        let Marks::Bars(bars) = &series.marks[0] else {
            panic!("{series:?}")
        };
        let counts: Vec<f64> = bars.iter().map(|bar| bar.count).collect();
        assert_eq!(counts, [2.0, 3.0]); // 0 and 1 below 2; 2, 3 and the upper edge 4
        assert!(Series::histogram("none", &[], 3).corners().next().is_none());
    }
}
