//! Error vectors in the work space: three projections of each set, all sets and projections on one scale.
//!
//! Work space and arrows have a scale each, both drawn as bars and stated in the text: errors are tenths of a millimetre in
//! a space of metres. The arm's base, the axes of its frame and the table's box are drawn with them, and arrows have a colour by how
//! large their error is beside the tolerance. From above, z points out of the paper; from the front, the longer of the base frame's x
//! and y is across; from the side, the other.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::{px, scale};

/// An error at a place, base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    pub at: [f64; 3],
    pub error: [f64; 3],
}

/// The errors of one state of the arm: before or after compensation.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    pub name: String,
    pub description: String,
    pub arrows: Vec<Arrow>,
}

/// What errors are drawn in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scene {
    /// Least and largest coordinates of the table's box, base frame, mm; `None` without a table.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// The tolerance, mm: colours are by multiples of it.
    pub tolerance_mm: f64,
}

/// Most arrows of a panel: more would hide each other.
const MOST: usize = 400;
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Width of a panel, and the largest width and height of the work space in it, px.
const WIDTH: f64 = 520.0;
const PLOT: [f64; 2] = [424.0, 330.0];
/// Largest length of nineteen in twenty of the longest set's arrows, px; arrows may reach this far out of the work space.
const LONG: f64 = 48.0;
/// Space above and below the work space, for the name and the bars.
const NAME: f64 = 18.0;
const BARS: f64 = 44.0;
const AXIS: f64 = 26.0;
/// The colours' limits, as multiples of the tolerance; errors above the last have a colour too.
const LIMITS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
const AXES: [&str; 3] = ["x", "y", "z"];

/// Draws `sets` in panels, those of one projection next to each other; `None` without any arrow.
pub fn vectors(sets: &[Vectors], scene: &Scene) -> Option<Markup> {
    let paper = Paper::of(sets, scene)?;
    let fewer = sets.iter().filter(|set| set.arrows.len() > MOST);
    Some(html! {
        (colours(scene.tolerance_mm))
        div.panels {
            @for view in paper.views() {
                @for set in sets { (paper.panel(&view, set)) }
            }
        }
        p.note {
            "Each arrow is the error at its station, drawn " (paper.magnification)
            " times as long as the work space around it, the same in every panel. The arm's base is drawn with the axes of its frame"
            @if scene.bounds.is_some() { ", the table's box in dashes" } ". "
            @for set in fewer { (set.name) ": " (drawn(set).count()) " of " (set.arrows.len()) " stations are drawn. " }
        }
    })
}

/// The arrows that are drawn: all, or about [`MOST`] of them, spread evenly over their order by multiples of the golden
/// ratio. Every second or third station would leave out whole rows of a grid.
fn drawn(set: &Vectors) -> impl Iterator<Item = &Arrow> {
    let share = MOST as f64 / set.arrows.len() as f64;
    let is_drawn = move |place: usize| (place as f64 * GOLDEN).fract() < share;
    let numbered = set.arrows.iter().enumerate();
    numbered.filter(move |(place, _)| is_drawn(*place)).map(|(_, arrow)| arrow)
}

fn colours(tolerance_mm: f64) -> Markup {
    let width = WIDTH / (LIMITS.len() + 1) as f64;
    let label = |place: usize| match LIMITS.get(place) {
        Some(limit) => format!("≤ {} mm", limit * tolerance_mm),
        None => "more".to_owned(),
    };
    html! {
        svg.colours role="img" viewBox={ "0 0 " (px(WIDTH)) " 60" } {
            title { "Colours of the arrows" }
            desc { "By the size of the error, in multiples of the tolerance of " (tolerance_mm) " mm." }
            @for place in 0..=LIMITS.len() {
                @let x = place as f64 * width;
                path class={ "swatch e" (place) } d={ "M" (px(x)) " 4h" (px(width - 6.0)) "v14h-" (px(width - 6.0)) "z" } {}
                text class="tick" x=(px(x)) y="36" { (label(place)) }
            }
        }
    }
}

/// The colour of an error: its place among the limits.
fn colour(error: &[f64; 3], tolerance_mm: f64) -> usize {
    let norm = error.iter().map(|e| e * e).sum::<f64>().sqrt();
    LIMITS.iter().filter(|limit| norm > *limit * tolerance_mm).count()
}

struct Paper<'s> {
    scene: &'s Scene,
    middle: [f64; 3],
    extent: [f64; 3],
    /// Pixels for one mm of work space.
    space: f64,
    magnification: f64,
    /// Lengths of the bars: of work space and of error, mm.
    space_bar_mm: f64,
    error_bar_mm: f64,
}

/// A projection: the axes that are across and upwards, and whether the one across points to the left.
struct View {
    name: &'static str,
    across: usize,
    up: usize,
    turned: bool,
}

impl View {
    const fn sign(&self) -> f64 {
        if self.turned { -1.0 } else { 1.0 }
    }
}

impl<'s> Paper<'s> {
    fn of(sets: &[Vectors], scene: &'s Scene) -> Option<Self> {
        sets.iter().flat_map(|set| &set.arrows).next()?;
        let base = [0.0; 3];
        let places = || {
            let arrows = sets.iter().flat_map(|set| &set.arrows);
            arrows.map(|arrow| arrow.at).chain(scene.bounds.into_iter().flatten()).chain([base])
        };
        let low = |k: usize| places().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        let high = |k: usize| places().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
        let extent: [f64; 3] = std::array::from_fn(|k| (high(k) - low(k)).max(1.0));
        let across = extent[0].max(extent[1]);
        let up = extent[2].max(extent[0].min(extent[1]));
        let space = (PLOT[0] / across).min(PLOT[1] / up);
        let longest = sets.iter().map(|set| typical_mm(&set.arrows)).fold(1e-6, f64::max);
        Some(Self {
            scene,
            middle: std::array::from_fn(|k| 0.5 * (low(k) + high(k))),
            extent,
            space,
            magnification: scale::nice_below(LONG / (longest * space)),
            space_bar_mm: scale::nice_below(across / 3.0),
            error_bar_mm: scale::nice_below(longest),
        })
    }

    /// The projections. From above with y across, x is up and y points to the left, so that z points out of the paper.
    fn views(&self) -> [View; 3] {
        let is_wide = self.extent[0] > self.extent[1];
        let (long, short) = if is_wide { (0, 1) } else { (1, 0) };
        let view = |name, across, up, turned| View { name, across, up, turned };
        [
            view("from above", long, short, !is_wide),
            view("from the front", long, 2, false),
            view("from the side", short, 2, false),
        ]
    }

    /// Height of the work space in a view, with room for arrows around it.
    fn room(&self, view: &View) -> f64 {
        self.space * self.extent[view.up] + 2.0 * LONG
    }

    fn panel(&self, view: &View, set: &Vectors) -> Markup {
        let name = format!("{}, {}", set.name, view.name);
        let mut stations = String::new();
        let mut arrows = [const { String::new() }; LIMITS.len() + 1];
        for arrow in drawn(set) {
            let [x, y] = self.at(view, arrow.at);
            write!(stations, "M{} {}h0", px(x), px(y)).expect("a string");
            arrows[colour(&arrow.error, self.scene.tolerance_mm)] += &self.arrow(view, arrow);
        }
        let arrows = arrows.iter().enumerate().filter(|(_, path)| !path.is_empty());
        html! {
            svg role="img" viewBox={ "0 0 " (px(WIDTH)) " " (px(NAME + self.room(view) + BARS)) } {
                title { (name) }
                desc { (set.description) " Across " (AXES[view.across]) @if view.turned { " to the left" } ", upwards " (AXES[view.up]) " of the base frame." }
                text class="name" x="0" y="12" { (name) }
                (self.base(view))
                (self.bounds(view))
                path class="station" d=(stations) {}
                @for (place, path) in arrows { path class={ "arrow e" (place) } d=(path) {} }
                (self.bars(view))
            }
        }
    }

    fn base(&self, view: &View) -> Markup {
        let [x, y] = self.at(view, [0.0; 3]);
        let side = view.sign();
        let anchor = if view.turned { "end" } else { "start" };
        let (left, bottom, across, up) = (px(x), px(y), px(side * AXIS), px(AXIS));
        let (back, on) = (px(side * -4.0), px(side * 4.0));
        let axis = format!(
            "M{left} {bottom}h{across}m{back} -3l{on} 3l{back} 3M{left} {bottom}v-{up}m-3 4l3-4l3 4"
        );
        html! {
            path class="base" d={ "M" (px(x - 7.0)) " " (px(y + 4.0)) "h14l-3.5-8h-7z" } {}
            path class="frame" d=(axis) {}
            text class="tick" text-anchor=(anchor) x=(px(x + side * (AXIS + 4.0))) y=(px(y + 4.0)) { (AXES[view.across]) }
            text class="tick" text-anchor="middle" x=(px(x)) y=(px(y - AXIS - 4.0)) { (AXES[view.up]) }
            text class="tick" text-anchor="middle" x=(px(x)) y=(px(y + 18.0)) { "base" }
        }
    }

    fn bounds(&self, view: &View) -> Markup {
        let Some([low, high]) = self.scene.bounds else { return html! {} };
        let ([x, y], [to_x, to_y]) = (self.at(view, low), self.at(view, high));
        html! { path class="box" d={ "M" (px(x)) " " (px(y)) "H" (px(to_x)) "V" (px(to_y)) "H" (px(x)) "z" } {} }
    }

    fn at(&self, view: &View, place: [f64; 3]) -> [f64; 2] {
        let away = |k: usize| self.space * (place[k] - self.middle[k]);
        [
            0.5 * WIDTH + view.sign() * away(view.across),
            NAME + 0.5 * self.room(view) - away(view.up),
        ]
    }

    fn arrow(&self, view: &View, arrow: &Arrow) -> String {
        let [x, y] = self.at(view, arrow.at);
        let scale = self.space * self.magnification;
        let shaft = [view.sign() * scale * arrow.error[view.across], -scale * arrow.error[view.up]];
        let length = shaft[0].hypot(shaft[1]);
        let mut path = format!("M{} {}l{} {}", px(x), px(y), px(shaft[0]), px(shaft[1]));
        if length > 5.0 {
            // A head of a quarter of the shaft, four and a half pixels at most, as wide as it is long.
            let head = (0.25 * length).min(4.5) / length;
            let back = shaft.map(|part| -head * part);
            let side = [-0.45 * back[1], 0.45 * back[0]];
            let (tip_x, tip_y) = (px(x + shaft[0]), px(y + shaft[1]));
            let (left_x, left_y) = (px(back[0] + side[0]), px(back[1] + side[1]));
            let (right_x, right_y) = (px(back[0] - side[0]), px(back[1] - side[1]));
            write!(path, "m{left_x} {left_y}L{tip_x} {tip_y}l{right_x} {right_y}")
                .expect("a string");
        }
        path
    }

    fn bars(&self, view: &View) -> Markup {
        let top = NAME + self.room(view);
        let (first, second) = (top + 12.0, top + 32.0);
        let space = self.space * self.space_bar_mm;
        let error = self.space * self.magnification * self.error_bar_mm;
        html! {
            path class="axis" d={ "M2 " (px(first - 3.0)) "v6m0-3h" (px(space)) "m0-3v6" } {}
            text class="tick" x=(px(10.0 + space)) y=(px(first + 4.0)) { (self.space_bar_mm) " mm of work space" }
            path class="frame" d={ "M2 " (px(second)) "h" (px(error)) "m-4.5-2l4.5 2l-4.5 2" } {}
            text class="tick" x=(px(10.0 + error)) y=(px(second + 4.0)) { (self.error_bar_mm) " mm of error" }
        }
    }
}

/// The value that nineteen in twenty errors do not exceed, mm.
fn typical_mm(arrows: &[Arrow]) -> f64 {
    let norm = |arrow: &Arrow| arrow.error.iter().map(|e| e * e).sum::<f64>().sqrt();
    let mut norms: Vec<f64> = arrows.iter().map(norm).collect();
    norms.sort_by(f64::total_cmp);
    norms.get(norms.len().saturating_sub(1) * 19 / 20).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, error_mm: f64, count: u32) -> Vectors {
        let arrow = |i: u32| Arrow {
            at: [f64::from(i), 976.0 * f64::from(i % 2), 300.0],
            error: [0.0, error_mm, 0.0],
        };
        Vectors {
            name: name.to_owned(),
            description: "errors".to_owned(),
            arrows: (0..count).map(arrow).collect(),
        }
    }

    const SCENE: Scene =
        Scene { bounds: Some([[0.0, 0.0, 200.0], [10.0, 976.0, 300.0]]), tolerance_mm: 0.4 };

    #[test]
    fn all_panels_share_one_scale_and_say_it() {
        let sets = [set("Before", 0.5, 10), set("After", 0.05, 10)];
        let drawn = vectors(&sets, &SCENE).expect("arrows").into_string();
        // Six panels, and the colours.
        assert_eq!(drawn.matches("<svg").count(), 7);
        // 976 mm across 424 px: 0.434 px a mm; 0.5 mm at 48 px would be 221 times, so 200 times: 43.4 px, and 4.3 px after. Seen from
        // above y points to the left. 0.5 mm is within two tolerances, 0.05 mm within a quarter of one.
        for part in [
            "drawn 200 times as long",
            "l43.4 0",
            "l-43.4 0",
            "l4.3 0",
            "arrow e3",
            "arrow e0",
            "≤ 0.1 mm",
            "0.5 mm of error",
            "200 mm of work space",
            "class=\"box\"",
            ">base<",
        ] {
            assert!(drawn.contains(part), "{part} is not in {drawn}");
        }
    }

    #[test]
    fn many_arrows_are_thinned_out_and_that_is_stated() {
        let many = set("Before", 0.5, 900);
        let drawn = vectors(std::slice::from_ref(&many), &SCENE).expect("arrows").into_string();
        // 400 / 900 of 900, to within one: multiples of the golden ratio fill the unit interval evenly.
        assert!(drawn.contains("Before: 400 of 900 stations are drawn"), "{drawn}");
        assert_eq!(drawn.matches("h0").count(), 3 * 400);
        // As many of a grid's odd stations as of its even ones are drawn: no row is missing.
        let odd = super::drawn(&many).filter(|arrow| arrow.at[1] > 0.0).count();
        assert!((195..=205).contains(&odd), "{odd}");
        assert!(vectors(&[set("Before", 0.5, 0)], &SCENE).is_none());
    }
}
