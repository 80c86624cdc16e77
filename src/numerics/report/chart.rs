//! Charts: series of numbers → an inline SVG with axes, units, a legend and a description for readers who cannot see it.
//!
//! Input is a [`Chart`] or sets of error [`Vectors`]; output is markup for a page that carries [`STYLE`]. Colours come from
//! that style's variables, so a chart follows the reader's light or dark mode and prints in ink; series differ in dash and
//! marker too. Coordinates have one decimal and no clock or map order takes part: the same numbers give the same bytes.
//!
//! The SVG is written through maud, whose macros escape every value and check the nesting. Of the alternatives, plotters
//! has had no release for two years and its SVG has neither classes nor alternative text, and askama would need each nested
//! part marked as safe by hand.
//!
//! 1. [`scale`]: nice ranges and ticks, linear or logarithmic. 2. `frame`: axes, limits, legend. 3. `series` and their
//!    `marks`.
//! 4. [`vectors()`]: error vectors in three projections of the work space.

mod frame;
mod marks;
pub mod scale;
mod series;
mod vectors;

use maud::{Markup, html};

pub use marks::Marks;
pub use series::Series;
pub use vectors::{Arrow, Scene, Vectors, vectors};

use crate::figures::extremes;
use frame::Frame;
use scale::Scale;

/// The style that a page with charts needs: variables for both colour modes and for print, and the classes of marks.
pub const STYLE: &str = include_str!("chart/chart.css");

pub const WIDTH: f64 = 480.0;
pub const HEIGHT: f64 = 270.0;
/// Number of different looks (colour, dash and marker together) of series; further series repeat them.
pub const LOOKS: usize = 6;

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// The contents in a few words: the chart's name for readers who cannot see it.
    pub title: String,
    pub description: String,
    pub x: Axis,
    pub y: Axis,
    /// The series, in drawing order; the legend names them.
    pub series: Vec<Series>,
    /// Horizontal lines to compare values with, such as a tolerance.
    pub limits: Vec<Limit>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    pub quantity: String,
    /// Its unit; empty for a number without one.
    pub unit: String,
    /// Whether the axis is logarithmic; values that are not positive are then left out, and the chart states how many.
    pub log: bool,
    /// Values that the axis has to reach in addition to those of the series.
    pub include: Vec<f64>,
    /// Names of a horizontal axis that counts things, the first at 1; empty for an axis of numbers.
    pub names: Vec<String>,
    /// Whether a horizontal axis has whole numbers only.
    pub whole: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Name of the limit with its value: `tolerance 0.5 mm`.
    pub name: String,
    pub value: f64,
}

impl Axis {
    pub fn new(quantity: &str, unit: &str) -> Self {
        Self { quantity: quantity.to_owned(), unit: unit.to_owned(), ..Self::default() }
    }

    pub fn of_whole_numbers(quantity: &str, unit: &str) -> Self {
        Self { whole: true, ..Self::new(quantity, unit) }
    }

    #[must_use]
    pub const fn logarithmic(mut self) -> Self {
        self.log = true;
        self
    }

    /// Makes the axis reach `values` too.
    #[must_use]
    pub fn including(mut self, values: &[f64]) -> Self {
        self.include.extend(values);
        self
    }

    fn label(&self) -> String {
        if self.unit.is_empty() {
            return self.quantity.clone();
        }
        format!("{}, {}", self.quantity, self.unit)
    }

    fn included(&self) -> impl Iterator<Item = f64> + '_ {
        self.include.iter().copied().filter(|value| self.takes(*value))
    }

    fn takes(&self, value: f64) -> bool {
        value.is_finite() && (!self.log || value > 0.0)
    }
}

impl Chart {
    /// The chart as an inline `<svg>`; a sentence instead of it where there is nothing to draw.
    pub fn svg(&self) -> Markup {
        let (drawn, left_out) = self.drawable();
        let (Some(x), Some(y)) = (self.across(&drawn), self.upwards(&drawn)) else {
            return html! { p.none { "Nothing to draw: " (self.title) "." } };
        };
        let frame = Frame::new(self, &drawn, x, y);
        html! {
            svg role="img" viewBox={ "0 0 " (px(WIDTH)) " " (px(frame.height())) } {
                title { (self.title) }
                desc { (self.description) @if left_out > 0 { " " (left_out) " values are not positive and cannot be drawn on a logarithmic axis." } }
                (frame.axes(self))
                @for series in &drawn { (series.drawn(&frame)) }
                (frame.limits(&self.limits))
                (frame.legend(&drawn))
            }
            @if left_out > 0 { p.note { (left_out) " values are not positive and cannot be drawn on a logarithmic axis." } }
        }
    }

    /// The horizontal scale: it ends where the values do.
    fn across(&self, drawn: &[Series]) -> Option<Scale> {
        if !self.x.names.is_empty() {
            return Some(Scale::of_names(&self.x.names));
        }
        let corners = drawn.iter().flat_map(Series::corners).map(|[x, _]| x);
        let values: Vec<f64> = corners.chain(self.x.included()).collect();
        let (low, high) = extremes(values.iter().copied())?;
        let scale = Scale::over(values.into_iter(), self.x.log)?.ending_at(low, high);
        Some(if self.x.whole { scale.in_whole_numbers() } else { scale })
    }

    /// The vertical scale: it ends at ticks, with the limits in it.
    fn upwards(&self, drawn: &[Series]) -> Option<Scale> {
        let corners = drawn.iter().flat_map(Series::corners).map(|[_, y]| y);
        let limits = self.limits.iter().map(|limit| limit.value);
        let limits = limits.filter(|value| self.y.takes(*value));
        Scale::over(corners.chain(limits).chain(self.y.included()), self.y.log)
    }

    /// The series with the values that the axes can show, and the number of values that they cannot.
    fn drawable(&self) -> (Vec<Series>, usize) {
        let mut left_out = 0;
        let mut series = self.series.clone();
        for (place, own) in series.iter_mut().enumerate() {
            own.look.get_or_insert(place);
            left_out += own.retain(|[x, y]| self.x.takes(x) && self.y.takes(y));
        }
        series.retain(|own| own.corners().next().is_some());
        (series, left_out)
    }
}

/// A coordinate with one decimal at most; never `-0`.
fn px(value: f64) -> String {
    let rounded = (value * 10.0).round() / 10.0;
    // Adding zero turns minus zero into zero.
    (rounded + 0.0).to_string()
}

/// Approximate width of a text of thirteen pixels, px, in a wide typeface, `DejaVu Sans`: what fits fits in others.
fn text_width(text: &str) -> f64 {
    let width = |c: char| match c {
        ' ' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | 'i' | 'j' | 'l' | 'I' => 4.2,
        'f' | 'r' | 't' | '(' | ')' | '/' | '-' => 5.3,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 12.7,
        c if c.is_uppercase() => 9.2,
        _ => 8.3,
    };
    text.chars().map(width).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        Chart {
            title: "Error <against> step".to_owned(),
            description: "falls".to_owned(),
            x: Axis::new("step", "mm"),
            y: Axis::new("error", "mm").including(&[0.0]),
            series: vec![
                Series::line("bound", vec![[100.0, 0.2], [200.0, 0.4]]),
                Series::points("mean", vec![[100.0, 0.1], [200.0, 0.2]]),
            ],
            limits: vec![Limit { name: "tolerance 0.5 mm".to_owned(), value: 0.5 }],
        }
    }

    #[test]
    fn a_chart_has_words_units_ticks_a_legend_and_its_limit() {
        let svg = chart().svg().into_string();
        for part in [
            "role=\"img\"",
            "<title>Error &lt;against&gt; step</title>",
            "step, mm",
            "error, mm",
            ">0.5<",
            ">200<",
            "tolerance 0.5 mm",
            ">bound<",
            ">mean<",
        ] {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
        roxmltree::Document::parse(&svg).expect("well-formed");
        assert_eq!(svg, chart().svg().into_string());
    }

    #[test]
    fn what_a_logarithmic_axis_cannot_show_is_counted() {
        let mut chart = chart();
        chart.y.log = true; // though it is to include zero
        chart.series[0] =
            Series::line("bound", vec![[100.0, 0.0], [150.0, f64::NAN], [200.0, 0.4]]);
        let svg = chart.svg().into_string();
        assert!(svg.contains("2 values are not positive"), "{svg}");
        assert!(!svg.contains("NaN"), "{svg}");
    }

    #[test]
    fn one_point_alone_is_drawn() {
        let mut chart = chart();
        let (line, band) = (vec![[30.0, 0.1]], vec![[30.0, -0.2, 0.4]]);
        chart.series = vec![Series::new("first", vec![Marks::Band(band), Marks::Line(line)])];
        let svg = chart.svg().into_string();
        let (drawn, _) = svg.split_once("class=\"legend\"").expect("a legend");
        for class in ["class=\"points\"", "class=\"line whisker\""] {
            assert!(drawn.contains(class), "{class} is not in {drawn}");
        }
    }

    #[test]
    fn nothing_to_draw_is_stated() {
        let mut chart = chart();
        chart.series.clear();
        chart.y.include.clear();
        assert!(chart.svg().into_string().contains("Nothing to draw"));
    }

    #[test]
    fn coordinates_have_one_decimal_and_no_minus_zero() {
        assert_eq!([px(-0.04), px(12.04), px(12.06)], ["0", "12", "12.1"]);
    }
}
