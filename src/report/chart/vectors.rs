//! Error vectors in the work space: three projections of each set, all sets and projections on one scale.
//!
//! Work space and arrows have a scale each, and both are drawn as bars and said in words: errors are tenths of a millimetre
//! in a space of metres. From above the longer of the base frame's x and y lies across, from the front the same against z,
//! from the side the other one.

use maud::{Markup, html};

use super::{px, scale};

/// An error at a place, base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    /// Where.
    pub at: [f64; 3],
    /// The error there.
    pub error: [f64; 3],
}

/// The errors of one state of the arm: before, or after.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    /// Its name: `Before`.
    pub name: String,
    /// What they are, in a sentence.
    pub description: String,
    /// The errors.
    pub arrows: Vec<Arrow>,
}

/// Arrows that a panel has at most: more hide each other.
const MOST: usize = 400;
/// Panel, and what is left of it for the work space, px.
const WIDTH: f64 = 320.0;
const PLOT: [f64; 2] = [250.0, 210.0];
const MIDDLE: [f64; 2] = [165.0, 142.0];
const HEIGHT: f64 = 292.0;
/// How long nineteen in twenty of the longest set's arrows are at most, px.
const LONG: f64 = 34.0;
const AXES: [&str; 3] = ["x", "y", "z"];

/// Draws `sets`, each in its look, in panels that stand below each other by projection; `None` without any arrow.
pub fn vectors(sets: &[Vectors]) -> Option<Markup> {
    let paper = Paper::of(sets)?;
    let thinned = |set: &Vectors| set.arrows.len().div_ceil(MOST);
    let fewer = sets.iter().filter(|set| thinned(set) > 1);
    Some(html! {
        div.panels {
            @for view in paper.views() {
                @for (look, set) in sets.iter().enumerate() { (paper.panel(&view, set, look)) }
            }
        }
        p.note {
            "Arrows point from where the arm should be to where it was, and are drawn " (paper.magnification)
            " times as long as the work space around them, the same in every panel. "
            @for set in fewer { (set.name) ": every " (ordinal(thinned(set))) " of " (set.arrows.len()) " stations is drawn. " }
        }
    })
}

/// Scales that all panels share.
struct Paper {
    middle: [f64; 3],
    extent: [f64; 3],
    /// px for one mm of work space.
    space: f64,
    magnification: f64,
    /// An error drawn as a bar, mm.
    bar_mm: f64,
    space_bar_mm: f64,
}

/// A projection: which axes lie across and upwards.
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
        let low: [f64; 3] =
            std::array::from_fn(|k| places().map(|p| p[k]).fold(f64::INFINITY, f64::min));
        let high: [f64; 3] =
            std::array::from_fn(|k| places().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max));
        let extent: [f64; 3] = std::array::from_fn(|k| (high[k] - low[k]).max(1.0));
        let across = extent[0].max(extent[1]);
        let up = extent[2].max(extent[0].min(extent[1]));
        let space = (PLOT[0] / across).min(PLOT[1] / up);
        let longest = sets
            .iter()
            .map(|set| typical_mm(&set.arrows))
            .fold(0.0, f64::max);
        // Round numbers below the one that would fill the room.
        let fitting = LONG / (longest.max(1e-6) * space);
        let magnification = scale::nice(fitting / 2.5);
        Some(Self {
            middle: std::array::from_fn(|k| 0.5 * (low[k] + high[k])),
            extent,
            space,
            magnification,
            bar_mm: scale::nice(longest.max(1e-6) / 2.5),
            space_bar_mm: scale::nice(across / 5.0),
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

    fn panel(&self, view: &View, set: &Vectors, look: usize) -> Markup {
        let name = format!("{}, {}", set.name, view.name);
        let every = set.arrows.len().div_ceil(MOST).max(1);
        let drawn = || set.arrows.iter().step_by(every);
        let stations: String = drawn()
            .map(|arrow| {
                let [x, y] = self.at(view, arrow.at);
                format!("M{} {}h0", px(x), px(y))
            })
            .collect();
        let arrows: String = drawn().map(|arrow| self.arrow(view, arrow)).collect();
        html! {
            svg role="img" viewBox={ "0 0 " (px(WIDTH)) " " (px(HEIGHT)) } {
                title { (name) }
                desc { (set.description) " Across " (AXES[view.across]) ", upwards " (AXES[view.up]) " of the base frame." }
                text class="name" x="4" y="15" { (name) }
                path class="station" d=(stations) {}
                g class={ "s" (look) } { path class="arrow" d=(arrows) {} }
                (self.bars(view, look))
            }
        }
    }

    fn at(&self, view: &View, place: [f64; 3]) -> [f64; 2] {
        let away = |k: usize| self.space * (place[k] - self.middle[k]);
        [MIDDLE[0] + away(view.across), MIDDLE[1] - away(view.up)]
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
        if length > 4.0 {
            // A head of a quarter of the shaft, five pixels at most, open by half its length.
            let head = (0.25 * length).min(5.0) / length;
            let (back, side) = (
                [-head * shaft[0], -head * shaft[1]],
                [-0.5 * head * shaft[1], 0.5 * head * shaft[0]],
            );
            path += &format!(
                "m{} {}L{} {}l{} {}",
                px(back[0] + side[0]),
                px(back[1] + side[1]),
                px(x + shaft[0]),
                px(y + shaft[1]),
                px(back[0] - side[0]),
                px(back[1] - side[1]),
            );
        }
        path
    }

    /// What a length of work space and of error is, and which axes one looks at.
    fn bars(&self, view: &View, look: usize) -> Markup {
        let y = HEIGHT - 12.0;
        let (space, error) = (
            self.space * self.space_bar_mm,
            self.space * self.magnification * self.bar_mm,
        );
        let second = WIDTH - 16.0 - error - 82.0;
        html! {
            path class="axis" d={ "M10 " (px(y - 42.0)) "v24h24" } {}
            text class="tick" x="6" y=(px(y - 46.0)) { (AXES[view.up]) }
            text class="tick" x="38" y=(px(y - 14.0)) { (AXES[view.across]) }
            path class="axis" d={ "M64 " (px(y - 4.0)) "v4h" (px(space)) "v-4" } {}
            text class="tick" x=(px(70.0 + space)) y=(px(y + 4.0)) { (self.space_bar_mm) " mm" }
            g class={ "s" (look) } { path class="arrow" d={ "M" (px(second)) " " (px(y)) "h" (px(error)) "m-5-2.5l5 2.5l-5 2.5" } {} }
            text class="tick" x=(px(second + error + 6.0)) y=(px(y + 4.0)) { (self.bar_mm) " mm error" }
        }
    }
}

/// What nineteen in twenty errors are below, mm.
fn typical_mm(arrows: &[Arrow]) -> f64 {
    let mut norms: Vec<f64> = arrows
        .iter()
        .map(|arrow| arrow.error.iter().map(|e| e * e).sum::<f64>().sqrt())
        .collect();
    norms.sort_by(f64::total_cmp);
    let place = norms.len().saturating_sub(1) * 19 / 20;
    norms.get(place).copied().unwrap_or(0.0)
}

fn ordinal(number: usize) -> String {
    match number {
        2 => "second".to_owned(),
        3 => "third".to_owned(),
        _ => format!("{number}th"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, error_mm: f64, count: u32) -> Vectors {
        let arrow = |i: u32| Arrow {
            at: [f64::from(i), 1000.0 * f64::from(i % 2), 300.0],
            error: [0.0, error_mm, 0.0],
        };
        Vectors {
            name: name.to_owned(),
            description: "errors".to_owned(),
            arrows: (0..count).map(arrow).collect(),
        }
    }

    #[test]
    fn all_panels_share_one_scale_and_say_it() {
        let drawn = vectors(&[set("Before", 0.5, 10), set("After", 0.05, 10)])
            .expect("arrows")
            .into_string();
        assert_eq!(drawn.matches("<svg").count(), 6);
        // 1000 mm across 250 px: 0.25 px a mm; 0.5 mm at 34 px would be 272 times, so 200 times: 25 px, and 2.5 px after.
        assert!(drawn.contains("drawn 200 times as long"), "{drawn}");
        assert!(drawn.contains("l25 0"), "{drawn}");
        assert!(drawn.contains("l2.5 0"), "{drawn}");
        assert!(drawn.contains("0.2 mm error"), "{drawn}");
    }

    #[test]
    fn many_arrows_are_thinned_out_and_that_is_said() {
        let drawn = vectors(&[set("Before", 0.5, 900)])
            .expect("arrows")
            .into_string();
        assert!(
            drawn.contains("Before: every third of 900 stations is drawn"),
            "{drawn}"
        );
        assert_eq!(drawn.matches("h0").count(), 3 * 300);
        assert!(vectors(&[set("Before", 0.5, 0)]).is_none());
    }
}
