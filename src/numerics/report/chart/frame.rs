//! The frame of a chart: the positions of numbers on the paper, axes with ticks, limits, the legend.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::marks::{Marks, marker};
use super::scale::{Scale, Tick};
use super::{Axis, Chart, HEIGHT, Limit, Series, WIDTH, px, text_width};

/// Scales and their position on the paper.
#[derive(Debug)]
pub(super) struct Frame {
    x: Scale,
    y: Scale,
    left: f64,
    top: f64,
    legend: Vec<Placed>,
}

#[derive(Debug)]
struct Placed {
    series: usize,
    x: f64,
    y: f64,
}

const RIGHT: f64 = WIDTH - 14.0;
const BELOW: f64 = 42.0;
const LINE: f64 = 18.0;
/// Width of a sample of a series in the legend, with its gaps.
const SAMPLE: f64 = 34.0;

impl Frame {
    pub(super) fn new(chart: &Chart, drawn: &[Series], x: Scale, y: Scale) -> Self {
        let left = 14.0 + y.ticks.iter().map(|tick| text_width(&tick.label)).fold(0.0, f64::max);
        let legend = legend(drawn);
        let lines = legend.last().map_or(0.0, |last| last.y);
        let label = if chart.y.label().is_empty() { 8.0 } else { LINE + 12.0 };
        Self { x, y, left, top: lines + label, legend }
    }

    pub(super) fn height(&self) -> f64 {
        self.bottom() + BELOW
    }

    fn bottom(&self) -> f64 {
        self.top + HEIGHT - BELOW - LINE
    }

    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.across(x), self.down(y)]
    }

    fn across(&self, x: f64) -> f64 {
        self.left + self.x.share(x) * (RIGHT - self.left)
    }

    fn down(&self, y: f64) -> f64 {
        self.bottom() - self.y.share(y) * (self.bottom() - self.top)
    }

    pub(super) fn polyline(&self, points: impl Iterator<Item = [f64; 2]>) -> String {
        let step = |(place, point): (usize, [f64; 2])| {
            let [x, y] = self.at(point);
            let letter = if place == 0 { "M" } else { "L" };
            format!("{letter}{} {}", px(x), px(y))
        };
        points.enumerate().map(step).collect()
    }

    /// Axes with grid lines, tick labels, quantities and units.
    pub(super) fn axes(&self, chart: &Chart) -> Markup {
        let (bottom, top) = (self.bottom(), self.top);
        let rows = || self.y.ticks.iter().map(|tick| (self.down(tick.value), tick));
        let columns = || self.x.ticks.iter().map(|tick| (self.across(tick.value), tick));
        let (mut grid, mut ticks) = (String::new(), String::new());
        for (y, _) in rows() {
            write!(grid, "M{} {}H{}", px(self.left), px(y), px(RIGHT)).expect("a string");
        }
        for (x, _) in columns() {
            write!(ticks, "M{} {}v5", px(x), px(bottom)).expect("a string");
        }
        html! {
            path class="grid" d=(grid) {}
            path class="axis" d={ "M" (px(self.left)) " " (px(bottom)) "H" (px(RIGHT)) (ticks) } {}
            @for (y, tick) in rows() {
                text class="tick" text-anchor="end" x=(px(self.left - 7.0)) y=(px(y + 4.0)) { (signed(tick)) }
            }
            @for (x, tick) in columns() {
                text class="tick" text-anchor="middle" x=(px(x)) y=(px(bottom + 18.0)) { (signed(tick)) }
            }
            (quantity(&chart.y, 0.0, top - 11.0, "start"))
            (quantity(&chart.x, 0.5 * (self.left + RIGHT), bottom + 36.0, "middle"))
        }
    }

    pub(super) fn limits(&self, limits: &[Limit]) -> Markup {
        html! {
            @for limit in limits {
                @let y = self.down(limit.value);
                path class="limit" d={ "M" (px(self.left)) " " (px(y)) "H" (px(RIGHT)) } {}
                // Above the line, unless that is above the plot.
                @let name_y = if y < self.top + LINE { y + 14.0 } else { y - 5.0 };
                text class="limit-name" text-anchor="end" x=(px(RIGHT - 4.0)) y=(px(name_y)) { (limit.name) }
            }
        }
    }

    /// A sample of each named series with its name, in lines above the plot.
    pub(super) fn legend(&self, drawn: &[Series]) -> Markup {
        html! {
            @if !self.legend.is_empty() {
                g class="legend" {
                    @for Placed { series, x, y } in &self.legend {
                        g class=(drawn[*series].class()) { (sample(&drawn[*series], x - SAMPLE + 4.0, y - 4.0)) }
                        text class="name" x=(px(*x)) y=(px(*y)) { (drawn[*series].name) }
                    }
                }
            }
        }
    }
}

/// The label with a minus sign, which is wider than a hyphen.
fn signed(tick: &Tick) -> String {
    tick.label.replace('-', "\u{2212}")
}

fn quantity(axis: &Axis, x: f64, y: f64, anchor: &str) -> Markup {
    html! {
        text class="quantity" text-anchor=(anchor) x=(px(x)) y=(px(y)) { (axis.label()) }
    }
}

/// Entries from left to right; one that does not fit begins a new line.
fn legend(drawn: &[Series]) -> Vec<Placed> {
    let (mut x, mut y) = (0.0, LINE - 4.0);
    let mut placed = Vec::new();
    for (series, own) in drawn.iter().enumerate().filter(|(_, own)| !own.name.is_empty()) {
        let width = SAMPLE + text_width(&own.name) + 10.0;
        if x > 0.0 && x + width > WIDTH {
            (x, y) = (0.0, y + LINE);
        }
        placed.push(Placed { series, x: x + SAMPLE, y });
        x += width;
    }
    placed
}

fn sample(series: &Series, x: f64, y: f64) -> Markup {
    let line = format!("M{} {}h26", px(x), px(y));
    let area = format!("M{} {}h26v10h-26z", px(x), px(y - 5.0));
    let middle = [x + 13.0, y];
    html! {
        @for marks in &series.marks {
            @match marks {
                Marks::Line(_) | Marks::Steps(_) => path class="line" d=(line) {},
                Marks::Points(_) => path class="points" d=(marker(middle, series.look.unwrap_or(0))) {},
                Marks::Rings(_) => path class="ring" d={ "M" (px(middle[0] - 7.5)) " " (px(y)) "a7.5 7.5 0 1 0 15 0a7.5 7.5 0 1 0-15 0z" } {},
                Marks::Whiskers(_) => path class="line whisker" d={ "M" (px(middle[0])) " " (px(y - 6.0)) "v12" } {},
                Marks::Band(_) => path class="band" d=(area) {},
            }
        }
    }
}
