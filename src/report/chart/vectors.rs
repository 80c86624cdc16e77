//! Error vectors in the work space: three projections of each set, all sets and projections on one scale.
//!
//! Work space and arrows have a scale each, both drawn as bars and stated in the text: errors are tenths of a millimetre in
//! a space of metres. From above, the longer of the base frame's x and y is across; from the front, the same axis against
//! z; from the side, the other axis against z.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::{px, scale};

/// An error at a place, base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    /// The place.
    pub at: [f64; 3],
    /// The error there.
    pub error: [f64; 3],
}

/// The errors of one state of the arm: before or after compensation.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    /// Name of the state: `Before`.
    pub name: String,
    /// Description of the errors, in a sentence.
    pub description: String,
    /// The errors.
    pub arrows: Vec<Arrow>,
    /// Number of the look, from 0.
    pub look: usize,
}

/// Most arrows of a panel: more would hide each other.
const MOST: usize = 400;
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Width of a panel, and the largest width of the work space in it, px.
const WIDTH: f64 = 320.0;
const PLOT: [f64; 2] = [244.0, 200.0];
/// Largest length of nineteen in twenty of the longest set's arrows, px; arrows may reach this far out of the work space.
const LONG: f64 = 34.0;
/// Space above and below the work space, for the name and the bars.
const NAME: f64 = 16.0;
const BARS: f64 = 46.0;
const AXES: [&str; 3] = ["x", "y", "z"];

/// Draws `sets` in panels, those of one projection next to each other; `None` without any arrow.
pub fn vectors(sets: &[Vectors]) -> Option<Markup> {
    let paper = Paper::of(sets)?;
    let fewer = sets.iter().filter(|set| set.arrows.len() > MOST);
    Some(html! {
        div.panels {
            @for view in paper.views() {
                @for set in sets { (paper.panel(&view, set)) }
            }
        }
        p.note {
            "Each arrow is the error at its station, drawn " (paper.magnification)
            " times as long as the work space around it, the same in every panel. "
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
    numbered
        .filter(move |(place, _)| is_drawn(*place))
        .map(|(_, arrow)| arrow)
}

/// Scales of all panels.
struct Paper {
    middle: [f64; 3],
    extent: [f64; 3],
    /// Pixels for one mm of work space.
    space: f64,
    magnification: f64,
    /// Lengths of the bars: of work space and of error, mm.
    space_bar_mm: f64,
    error_bar_mm: f64,
}

/// A projection: the axes that are across and upwards.
struct View {
    name: &'static str,
    across: usize,
    up: usize,
}

impl Paper {
    fn of(sets: &[Vectors]) -> Option<Self> {
        let places = || {
            sets.iter()
                .flat_map(|set| set.arrows.iter().map(|arrow| arrow.at))
        };
        places().next()?;
        let low = |k: usize| places().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        let high = |k: usize| places().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
        let extent: [f64; 3] = std::array::from_fn(|k| (high(k) - low(k)).max(1.0));
        let across = extent[0].max(extent[1]);
        let up = extent[2].max(extent[0].min(extent[1]));
        let space = (PLOT[0] / across).min(PLOT[1] / up);
        let longest = sets
            .iter()
            .map(|set| typical_mm(&set.arrows))
            .fold(1e-6, f64::max);
        Some(Self {
            middle: std::array::from_fn(|k| 0.5 * (low(k) + high(k))),
            extent,
            space,
            magnification: scale::nice_below(LONG / (longest * space)),
            space_bar_mm: scale::nice_below(across / 3.0),
            error_bar_mm: scale::nice_below(longest),
        })
    }

    fn views(&self) -> [View; 3] {
        let (long, short) = if self.extent[0] > self.extent[1] {
            (0, 1)
        } else {
            (1, 0)
        };
        let view = |name, across, up| View { name, across, up };
        [
            view("from above", long, short),
            view("from the front", long, 2),
            view("from the side", short, 2),
        ]
    }

    /// Height of the work space in the tallest view, with room for arrows around it.
    fn room(&self) -> f64 {
        let up = self.extent[2].max(self.extent[0].min(self.extent[1]));
        self.space * up + 2.0 * LONG
    }

    fn panel(&self, view: &View, set: &Vectors) -> Markup {
        let name = format!("{}, {}", set.name, view.name);
        let (mut stations, mut arrows) = (String::new(), String::new());
        for arrow in drawn(set) {
            let [x, y] = self.at(view, arrow.at);
            write!(stations, "M{} {}h0", px(x), px(y)).expect("a string");
            arrows += &self.arrow(view, arrow);
        }
        html! {
            svg role="img" viewBox={ "0 0 " (px(WIDTH)) " " (px(NAME + self.room() + BARS)) } {
                title { (name) }
                desc { (set.description) " Across " (AXES[view.across]) ", upwards " (AXES[view.up]) " of the base frame." }
                text class="name" x="0" y="12" { (name) }
                path class="station" d=(stations) {}
                g class={ "s" (set.look) } { path class="arrow" d=(arrows) {} }
                (self.bars(view, set.look))
            }
        }
    }

    fn at(&self, view: &View, place: [f64; 3]) -> [f64; 2] {
        let away = |k: usize| self.space * (place[k] - self.middle[k]);
        [
            0.5 * WIDTH + away(view.across),
            NAME + 0.5 * self.room() - away(view.up),
        ]
    }

    fn arrow(&self, view: &View, arrow: &Arrow) -> String {
        let [x, y] = self.at(view, arrow.at);
        let scale = self.space * self.magnification;
        let shaft = [
            scale * arrow.error[view.across],
            -scale * arrow.error[view.up],
        ];
        let length = shaft[0].hypot(shaft[1]);
        let mut path = format!("M{} {}l{} {}", px(x), px(y), px(shaft[0]), px(shaft[1]));
        if length > 5.0 {
            // A head of a quarter of the shaft, four and a half pixels at most, as wide as it is long.
            let head = (0.25 * length).min(4.5) / length;
            let back = shaft.map(|part| -head * part);
            let side = [-0.45 * back[1], 0.45 * back[0]];
            let (tip_x, tip_y) = (px(x + shaft[0]), px(y + shaft[1]));
            let (left, right) = (
                [back[0] + side[0], back[1] + side[1]],
                [back[0] - side[0], back[1] - side[1]],
            );
            write!(
                path,
                "m{} {}L{tip_x} {tip_y}l{} {}",
                px(left[0]),
                px(left[1]),
                px(right[0]),
                px(right[1])
            )
            .expect("a string");
        }
        path
    }

    /// The axes of the view, and bars for a length of work space and of error.
    fn bars(&self, view: &View, look: usize) -> Markup {
        let top = NAME + self.room();
        let (first, second) = (top + 14.0, top + 34.0);
        let space = self.space * self.space_bar_mm;
        let error = self.space * self.magnification * self.error_bar_mm;
        html! {
            path class="axis" d={ "M5 " (px(top + 14.0)) "v24h24" } {}
            text class="tick" x="2" y=(px(top + 9.0)) { (AXES[view.up]) }
            text class="tick" x="34" y=(px(top + 42.0)) { (AXES[view.across]) }
            path class="axis" d={ "M64 " (px(first - 3.0)) "v6m0-3h" (px(space)) "m0-3v6" } {}
            text class="tick" x=(px(72.0 + space)) y=(px(first + 4.0)) { (self.space_bar_mm) " mm of work space" }
            g class={ "s" (look) } { path class="arrow" d={ "M64 " (px(second)) "h" (px(error)) "m-4.5-2l4.5 2l-4.5 2" } {} }
            text class="tick" x=(px(72.0 + error)) y=(px(second + 4.0)) { (self.error_bar_mm) " mm of error" }
        }
    }
}

/// The value that nineteen in twenty errors do not exceed, mm.
fn typical_mm(arrows: &[Arrow]) -> f64 {
    let norm = |arrow: &Arrow| arrow.error.iter().map(|e| e * e).sum::<f64>().sqrt();
    let mut norms: Vec<f64> = arrows.iter().map(norm).collect();
    norms.sort_by(f64::total_cmp);
    let place = norms.len().saturating_sub(1) * 19 / 20;
    norms.get(place).copied().unwrap_or(0.0)
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
            look: 0,
        }
    }

    #[test]
    fn all_panels_share_one_scale_and_say_it() {
        let sets = [set("Before", 0.5, 10), set("After", 0.05, 10)];
        let drawn = vectors(&sets).expect("arrows").into_string();
        assert_eq!(drawn.matches("<svg").count(), 6);
        // 976 mm across 244 px: 0.25 px a mm; 0.5 mm at 34 px would be 272 times, so 200 times: 25 px, and 2.5 px after.
        for part in [
            "drawn 200 times as long",
            "l25 0",
            "l2.5 0",
            "0.5 mm of error",
            "200 mm of work space",
        ] {
            assert!(drawn.contains(part), "{part} is not in {drawn}");
        }
    }

    #[test]
    fn many_arrows_are_thinned_out_and_that_is_stated() {
        let many = set("Before", 0.5, 900);
        let drawn = vectors(std::slice::from_ref(&many))
            .expect("arrows")
            .into_string();
        // 400 / 900 of 900, to within one: multiples of the golden ratio fill the unit interval evenly.
        assert!(
            drawn.contains("Before: 400 of 900 stations are drawn"),
            "{drawn}"
        );
        assert_eq!(drawn.matches("h0").count(), 3 * 400);
        // As many of a grid's odd stations as of its even ones are drawn: no row is missing.
        let odd = super::drawn(&many)
            .filter(|arrow| arrow.at[1] > 0.0)
            .count();
        assert!((195..=205).contains(&odd), "{odd}");
        assert!(vectors(&[set("Before", 0.5, 0)]).is_none());
    }
}
