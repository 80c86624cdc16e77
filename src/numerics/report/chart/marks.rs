//! Marks: the ways to draw numbers in a frame.

use maud::{Markup, html};

use super::frame::Frame;
use super::{LOOKS, px};

#[derive(Debug, Clone, PartialEq)]
pub enum Marks {
    Line(Vec<[f64; 2]>),
    Points(Vec<[f64; 2]>),
    /// A ring around each x, y, to show a choice.
    Rings(Vec<[f64; 2]>),
    /// A line that keeps its y until the next x.
    Steps(Vec<[f64; 2]>),
    /// The area between low and high: x, low, high.
    Band(Vec<[f64; 3]>),
    /// An interval at each x: x, low, high.
    Whiskers(Vec<[f64; 3]>),
}

/// From this number of points on markers would hide each other, and dots are drawn.
const CROWD: usize = 120;
impl Marks {
    pub(super) fn corners(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Line(points)
            | Self::Points(points)
            | Self::Rings(points)
            | Self::Steps(points) => points.clone(),
            Self::Band(spans) | Self::Whiskers(spans) => {
                spans.iter().flat_map(|&[x, low, high]| [[x, low], [x, high]]).collect()
            }
        }
    }

    pub(super) fn retain(&mut self, fits: &impl Fn([f64; 2]) -> bool) -> usize {
        match self {
            Self::Line(points)
            | Self::Points(points)
            | Self::Rings(points)
            | Self::Steps(points) => points.extract_if(.., |point| !fits(*point)).count(),
            Self::Band(spans) | Self::Whiskers(spans) => {
                let fits = |&[x, low, high]: &[f64; 3]| fits([x, low]) && fits([x, high]);
                spans.extract_if(.., |span| !fits(span)).count()
            }
        }
    }

    pub(super) fn drawn(&self, frame: &Frame, look: usize) -> Markup {
        let (class, path) = match self {
            // A single point makes no line and no area.
            Self::Line(points) | Self::Steps(points) if points.len() == 1 => {
                ("points", marker(frame.at(points[0]), look))
            }
            Self::Band(spans) if spans.len() == 1 => ("line whisker", whisker(frame, spans[0])),
            Self::Line(points) => ("line", frame.polyline(points.iter().copied())),
            Self::Points(points) if points.len() >= CROWD => {
                // A tenth of a pixel: a line without length has no square ends on paper.
                let dot = |point: &[f64; 2]| {
                    let [x, y] = frame.at(*point);
                    format!("M{} {}h.1", px(x), px(y))
                };
                ("dots", points.iter().map(dot).collect())
            }
            Self::Points(points) => {
                ("points", points.iter().map(|point| marker(frame.at(*point), look)).collect())
            }
            Self::Rings(points) => {
                ("ring", points.iter().map(|point| circle(frame.at(*point), 7.5)).collect())
            }
            Self::Steps(points) => ("line", steps(frame, points)),
            Self::Band(spans) => ("band", band(frame, spans)),
            Self::Whiskers(spans) => {
                ("line whisker", spans.iter().map(|span| whisker(frame, *span)).collect())
            }
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
    format!("M{} {}m-{r} 0a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0-{d} 0z", px(x), px(y))
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
