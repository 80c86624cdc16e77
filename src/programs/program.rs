//! Programs as they are read: positions, and the base, tool and arm configuration at each motion that uses one.

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::Isometry3;

use crate::flow::{Known, Setting, Slot, State, known, unknown};
use crate::frame::Chain;
use crate::refusal::{Place, Refusal};
use crate::value::{Letters, Number};

/// A file as it lies on the controller.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    pub name: String,
    pub bytes: Vec<u8>,
}

impl File {
    /// Its name without folders.
    pub fn base_name(&self) -> &str {
        self.name.rsplit(['/', '\\']).next().unwrap_or(&self.name)
    }

    /// Whether it is a list of KUKA's system, whose variables all programs of the controller share: `$config.dat`.
    pub fn is_of_system(&self) -> bool {
        self.base_name().starts_with('$')
    }

    /// Whether it is a data list of KUKA.
    pub fn is_list(&self) -> bool {
        self.ending() == "dat"
    }

    /// The ending of its name in small letters, without the point; empty where it has none.
    pub fn ending(&self) -> String {
        let ending = self.base_name().rsplit_once('.').map(|(_, ending)| ending);
        ending.unwrap_or_default().to_ascii_lowercase()
    }

    pub fn at(&self, line: u32) -> Place {
        Place { file: self.name.clone(), line }
    }
}

/// Numbers of an orientation.
#[derive(Debug, Clone, PartialEq)]
pub enum Turn {
    /// A, B, C, degrees: `Rz(A) Ry(B) Rx(C)`.
    Abc([Number; 3]),
    /// Real part first.
    Quaternion([Number; 4]),
    /// The axis times the angle, rad.
    Vector([Number; 3]),
}

/// Numbers that state an arm configuration.
#[derive(Debug, Clone, PartialEq)]
pub enum Stated {
    /// S and T of KUKA.
    Status { status: Number, turn: Option<Number> },
    /// cf1, cf4, cf6 and cfx of ABB.
    Quadrants([Number; 4]),
    /// `CONFIG` of FANUC, with the turns of joints 1, 4 and 6.
    Config { letters: Letters, turns: [Number; 3] },
    /// Joint angles near which a controller of Universal Robots reaches the pose, degrees.
    Near(Vec<f64>),
}

#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all positions are poses")]
pub enum Shape {
    Pose {
        /// mm.
        xyz: [Number; 3],
        turn: Turn,
        stated: Option<Stated>,
    },
    /// Degrees; mm of a joint that slides.
    Joints(Vec<Number>),
}

/// A motion that moves to a position.
#[derive(Debug, Clone, PartialEq)]
pub struct Use {
    pub file: usize,
    pub line: u32,
    /// The instruction: `LIN`, `MOVEJ`.
    pub word: String,
    pub base: Known,
    pub tool: Known,
    /// The position whose statement of an arm configuration the motion has; its own where it reads that.
    pub branch: Known,
    /// Whether it moves to a point beside the position.
    pub is_beside: bool,
    /// Whether the arm holds the part, whose frame `tool` is then, and `base` that of a tool that stands in the cell.
    pub holds_part: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    pub file: usize,
    pub line: u32,
    /// As the program has it, in capitals; the instruction for one that has none.
    pub name: String,
    /// Its numbers; otherwise why they are not rewritten.
    pub shape: Result<Shape, Refusal>,
    /// An external axis that is not at 0, with its value.
    pub external: Option<(String, String)>,
    /// What forbids to correct it under any frame.
    pub obstacle: Option<Refusal>,
    pub uses: Vec<Use>,
    /// Bytes of the value, for reports and comparisons.
    pub span: Range<usize>,
    /// Decimals that its dialect takes at least: of mm, and of degrees.
    pub decimals: [usize; 2],
}

/// A position of a motion that is no literal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Computed {
    pub file: usize,
    pub line: u32,
    pub word: String,
    pub text: String,
}

/// How a motion leads to its last position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Each joint in its share of the way.
    Joints,
    Straight,
    /// The circle through the first of its positions.
    Circle,
    /// A spline, a part of a circle, a search: it may end beside its position.
    Other,
}

/// A motion with where it begins and ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Path {
    pub file: usize,
    pub line: u32,
    pub word: String,
    pub way: Way,
    /// Whether the arm leaves for the next position before it has reached the end.
    pub is_blended: bool,
    /// The position of the arm before it; `None` where that is not known.
    pub from: Option<usize>,
    /// Its own positions, the end last; `None` where one is computed, or the motion leads beside it.
    pub through: Option<Vec<usize>>,
    /// Where further points may be written; otherwise why none may.
    pub split: Result<Split, &'static str>,
}

/// A motion before which further ones may be written: it is alone in its line and starts nothing but itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// The begin of its line.
    pub line_start: usize,
    /// From its word on, without the sign that ends it.
    pub statement: Range<usize>,
    /// Its positions, of a circle the helper first.
    pub targets: Vec<Range<usize>>,
}

impl Split {
    /// Its statement with other positions.
    pub(crate) fn with(&self, bytes: &[u8], targets: &[String]) -> String {
        let mut text = String::new();
        let mut from = self.statement.start;
        for (target, other) in self.targets.iter().zip(targets) {
            text += &String::from_utf8_lossy(&bytes[from..target.start]);
            text += other;
            from = target.end;
        }
        text + &String::from_utf8_lossy(&bytes[from..self.statement.end])
    }
}

/// A further point before the end of a motion; of a circle each second one is a helper.
#[derive(Debug, Clone, PartialEq)]
pub struct Further {
    /// Its numbers: the tool in the frame of the motion's position, mm.
    pub frame_from_tool: Isometry3<f64>,
    /// Joint angles there, degrees.
    pub joints: Vec<f64>,
}

/// The texts of further points before a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    pub(crate) file: usize,
    pub(crate) split: Split,
    /// The positions of each line.
    pub(crate) points: Vec<Vec<String>>,
}

/// Files with everything that was read of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Programs {
    pub files: Vec<File>,
    /// Positions that a motion uses.
    pub positions: Vec<Position>,
    pub computed: Vec<Computed>,
    /// The motions, in the order in which routines were followed.
    pub paths: Vec<Path>,
    /// The line of each file's mark; `None` for one that is not corrected.
    pub marks: Vec<Option<u32>>,
    /// The frame of the arm's base in the world, one for each file.
    pub roots: Vec<Chain>,
}

/// Target of a motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Target {
    /// Indices among the positions: of an array whose element is worked out, all.
    Literal {
        positions: Vec<usize>,
        is_beside: bool,
    },
    Computed(String),
}

/// A motion before what earlier statements have set is known.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    pub(crate) file: usize,
    pub(crate) line: u32,
    pub(crate) word: String,
    pub(crate) targets: Vec<Target>,
    /// Settings of this motion alone.
    pub(crate) own: Vec<(Slot, Known)>,
    /// Whether the controller stops where others are set.
    pub(crate) is_held: bool,
    pub(crate) reads: Reads,
    pub(crate) way: Way,
    pub(crate) is_blended: bool,
    pub(crate) split: Result<Split, &'static str>,
    /// What forbids to correct its positions.
    pub(crate) obstacle: Option<Arc<Refusal>>,
    /// [`Use::holds_part`].
    pub(crate) holds_part: bool,
}

/// When a motion reads the arm configuration that its position states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reads {
    Always,
    /// Goes on in the arm configuration that it begins in.
    Never,
    /// Where a setting is on.
    With(Slot),
}

impl Motion {
    /// The last position that it moves to.
    fn end(&self) -> Option<usize> {
        match self.targets.last()? {
            Target::Literal { positions, .. } if positions.len() == 1 => positions.first().copied(),
            _ => None,
        }
    }

    /// The positions that it moves through; `None` where one is no literal.
    fn through(&self) -> Option<Vec<usize>> {
        let only = |target: &Target| match target {
            Target::Literal { positions, is_beside: false } if positions.len() == 1 => {
                positions.first().copied()
            }
            _ => None,
        };
        self.targets.iter().map(only).collect()
    }

    /// The arm configuration that it states where it reads its position's.
    fn branch(&self) -> Known {
        match self.end().filter(|_| self.obstacle.is_none()) {
            Some(end) => known(Setting::Position(end)),
            None => unknown(Refusal::Other(format!(
                "where {} in line {} ends is not known, and with it the arm configuration; state one by a motion to a \
                 constant position",
                self.word, self.line
            ))),
        }
    }

    /// The position that states the arm configuration in which the motion reaches one of its own.
    fn branch_at(&self, position: usize, is_end: bool, state: &State) -> Known {
        let reads = match self.reads {
            Reads::Always => true,
            Reads::Never => false,
            // The arm passes a helper point in the configuration in which it begins.
            Reads::With(_) if !is_end => false,
            Reads::With(slot) => match state.get(slot) {
                Ok(on) => **on == Setting::On(true),
                Err(why) => return Err(why.clone()),
            },
        };
        if reads { known(Setting::Position(position)) } else { state.get(Slot::Branch).clone() }
    }

    fn obstacle(&self, state: &State) -> Option<Arc<Refusal>> {
        let slot_forbids = |slot| state.get(slot).as_ref().err().cloned();
        let own = self.obstacle.clone().or_else(|| slot_forbids(Slot::Mode));
        let own = own.or_else(|| slot_forbids(Slot::Displacement));
        own.or_else(|| slot_forbids(Slot::Turn).filter(|_| self.way != Way::Joints))
    }
}

/// Motions with the positions that they use.
pub(crate) struct Recorder<'r> {
    pub(crate) motions: &'r [Motion],
    pub(crate) positions: &'r mut [Position],
    pub(crate) paths: &'r mut Vec<Path>,
    /// What holds at the calls of a routine so far.
    pub(crate) entries: HashMap<String, State>,
}

/// Frames that a position states, held against those that are set, where these are known.
fn held(set: &Known, stated: &Known) -> Known {
    match set {
        // The controller moves only where what is set is what the position states.
        Err(_) => stated.clone(),
        Ok(own) if stated.as_ref().is_ok_and(|stated| stated == own) => stated.clone(),
        Ok(own) => {
            let named = |known: &Setting| match known {
                Setting::Frames(chain) => chain.to_string(),
                _ => String::new(),
            };
            let stated = stated.as_ref().map(|own| named(own)).unwrap_or_default();
            unknown(Refusal::Other(format!(
                "it stands under {stated}, and {} is set before the motion, where the controller stops; set that of the position",
                named(own)
            )))
        }
    }
}

/// Frames with the displacement behind them that positions stand in, where there is one.
fn displaced(base: Known, by: &Known) -> Known {
    match (base.as_deref(), by.as_deref()) {
        (Ok(Setting::Frames(own)), Ok(Setting::Frames(by))) => {
            let frames = own.0.iter().chain(&by.0).cloned();
            known(Setting::Frames(Chain(frames.collect())))
        }
        _ => base,
    }
}

impl Recorder<'_> {
    /// The arm configuration that a motion states: letters and S mean the same at every position.
    fn stated(&self, motion: &Motion) -> Known {
        let last = motion.targets.last().filter(|_| motion.obstacle.is_none());
        let Some(Target::Literal { positions, .. }) = last else { return motion.branch() };
        let mut all = positions.iter().map(|own| self.positions[*own].configuration());
        let first = all.next().flatten().filter(|first| all.all(|own| own.as_ref() == Some(first)));
        first.map_or_else(|| motion.branch(), known)
    }
}

impl crate::flow::Motions for Recorder<'_> {
    fn branch(&self, motion: usize, state: Option<&State>) -> Option<Known> {
        let motion = &self.motions[motion];
        match (motion.reads, state) {
            (Reads::Never, _) => None,
            (Reads::Always, _) | (_, None) => Some(self.stated(motion)),
            (Reads::With(slot), Some(state)) => match state.get(slot) {
                Ok(on) => (**on == Setting::On(true)).then(|| self.stated(motion)),
                Err(why) => Some(Err(why.clone())),
            },
        }
    }

    fn end(&self, motion: usize) -> Known {
        let motion = &self.motions[motion];
        let through = motion.through().filter(|_| motion.way != Way::Other);
        match through.as_deref() {
            Some([.., end]) => known(Setting::Position(*end)),
            _ => unknown(Refusal::Other(format!("line {} ends beside a position", motion.line))),
        }
    }

    fn calls(&mut self, routine: &str, state: &State) {
        match self.entries.get_mut(routine) {
            Some(entry) => entry.join(state),
            None => {
                self.entries.insert(routine.to_owned(), state.clone());
            }
        }
    }

    fn happens(&mut self, index: usize, state: &State) {
        let motion = &self.motions[index];
        let from = state.get(Slot::Place).as_ref().ok();
        self.paths.push(Path {
            file: motion.file,
            line: motion.line,
            word: motion.word.clone(),
            way: motion.way,
            is_blended: motion.is_blended,
            from: from.and_then(|place| place.position()),
            through: motion.through(),
            split: motion.split.clone(),
        });
        let mut state = state.clone();
        for (slot, to) in &motion.own {
            let to = if motion.is_held { held(state.get(*slot), to) } else { to.clone() };
            state.set(*slot, to);
        }
        let refused = motion.obstacle(&state);
        let frame = |slot| match &refused {
            Some(why) => Err(why.clone()),
            None => state.get(slot).clone(),
        };
        let (mut base, mut tool) = (frame(Slot::Base), frame(Slot::Tool));
        // It stands behind the frame that the numbers are in, be that of the part on the arm.
        let of_part = if motion.holds_part { &mut tool } else { &mut base };
        *of_part = displaced(of_part.clone(), state.get(Slot::Displacement));
        for (place, target) in motion.targets.iter().enumerate() {
            let is_end = place + 1 == motion.targets.len();
            let Target::Literal { positions, is_beside } = target else { continue };
            for &position in positions {
                self.positions[position].uses.push(Use {
                    file: motion.file,
                    line: motion.line,
                    word: motion.word.clone(),
                    base: base.clone(),
                    tool: tool.clone(),
                    branch: motion.branch_at(position, is_end, &state),
                    is_beside: *is_beside,
                    holds_part: motion.holds_part,
                });
            }
        }
    }
}

impl Position {
    /// The arm configuration that it states wherever it stands.
    fn configuration(&self) -> Option<Setting> {
        match &self.shape {
            Ok(Shape::Pose { stated: Some(Stated::Config { letters, .. }), .. }) => {
                Some(Setting::Config(*letters))
            }
            Ok(Shape::Pose { stated: Some(Stated::Status { status, .. }), .. }) => {
                // Bit 4 says how the point was taught.
                status.byte().map(|status| Setting::Status(status & !16))
            }
            _ => None,
        }
    }
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}
