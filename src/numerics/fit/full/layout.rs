//! The columns of the error model, block by block.

use std::f64::consts::TAU;
use std::ops::Range;

use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Block {
    /// Geometry, bases and targets: the unknowns of the identification problem.
    Unknowns,
    /// Deflection of joints under gravity, one coefficient per joint and later point mass.
    Gravity,
    /// Command–feedback weight, one per joint: the share of the way from reported to commanded angle.
    CommandWeight,
    /// Approach-direction offset, one per joint: it saturates at small settling errors.
    ApproachOffset,
    /// Difference of one session's command–feedback weight from the common one.
    SessionCommandWeight(usize),
    /// The command–feedback weight of a session whose commanded orientations are not those that were sent.
    OwnCommandWeight(usize),
    /// Slow translation of the base that every session repeats: warming up.
    WarmUp,
    Drift(usize),
    /// Scale of one session, its instrument's length unit relative to the arm's lengths: the target's shift away from the
    /// middle of the session's stations, as a share of its distance from there.
    Scale(usize),
    /// Error curve of one joint (from 0): pairs `cos, sin` of k q over [`Layout::curve_unit`].
    Curve(usize),
    /// Zero and error curve of a joint in sessions before so many of its repairs, in place of its curve: a constant, then pairs.
    Earlier {
        joint: usize,
        to_come: usize,
    },
    SessionCurve {
        session: usize,
        joint: usize,
    },
    Ageing {
        joint: usize,
        step: usize,
    },
    Line {
        joint: usize,
        cycles: f64,
    },
}

impl Block {
    /// Whether the block is a joint's smooth error curve, of all sessions or of some.
    pub(super) const fn is_curve(self) -> bool {
        matches!(
            self,
            Self::Curve(_) | Self::Earlier { .. } | Self::SessionCurve { .. } | Self::Ageing { .. }
        )
    }

    /// Whether the block belongs to the arm in every session. Geometry, which shares its block with the frames, is not counted.
    pub(super) const fn is_of_arm(self) -> bool {
        matches!(
            self,
            Self::Gravity
                | Self::CommandWeight
                | Self::ApproachOffset
                | Self::Curve(_)
                | Self::Line { .. }
        )
    }

    /// The joint and the session that the block belongs to alone; none of the unknowns, which have either kind.
    pub(super) const fn belongs_to(self) -> (Option<usize>, Option<usize>) {
        match self {
            Self::Unknowns
            | Self::Gravity
            | Self::CommandWeight
            | Self::ApproachOffset
            | Self::WarmUp => (None, None),
            Self::SessionCommandWeight(session)
            | Self::OwnCommandWeight(session)
            | Self::Drift(session)
            | Self::Scale(session) => (None, Some(session)),
            Self::Curve(joint)
            | Self::Earlier { joint, .. }
            | Self::Ageing { joint, .. }
            | Self::Line { joint, .. } => (Some(joint), None),
            Self::SessionCurve { session, joint } => (Some(joint), Some(session)),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Layout {
    blocks: Vec<(Block, Range<usize>)>,
    size: usize,
    pub period_turns: u32,
    /// The period of each joint's curve, mm; `None` where it turns. Empty where all turn.
    pub slide_periods_mm: Vec<Option<f64>>,
    /// Age of each session, years before the latest of them. Empty where curves do not age, and in what was stored before they did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ages_years: Vec<f64>,
    /// Repairs of each joint that were still to come in each session. Empty where none was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repairs_to_come: Vec<Vec<usize>>,
}

impl Layout {
    /// An empty layout; joint curves repeat after `period_turns` turns.
    /// Panics when `period_turns` is 0.
    pub fn new(period_turns: u32) -> Self {
        assert!(period_turns > 0, "a curve repeats after a turn or more");
        Self {
            blocks: Vec::new(),
            size: 0,
            period_turns,
            slide_periods_mm: Vec::new(),
            ages_years: Vec::new(),
            repairs_to_come: Vec::new(),
        }
    }

    /// The share of the change of a joint over a step of years that a session came before. Of a session before a repair of the joint
    /// none since the last session with the gear of then: it shows nothing of the new one.
    pub fn ageing(&self, session: usize, joint: usize, step: usize) -> f64 {
        let begin = super::ageing::begin_years(step);
        let age = self.ages_years.get(session);
        let age = age.filter(|_| begin >= self.latest_alike_years(session, joint));
        age.map_or(0.0, |age| super::ageing::share(*age, step))
    }

    /// The age of the latest session with the gear of a joint that a session had, years; 0 of that of now.
    fn latest_alike_years(&self, session: usize, joint: usize) -> f64 {
        if self.is_now(Some(session), joint) {
            return 0.0;
        }
        let to_come = self.to_come(Some(session), joint);
        let ages = self.ages_years.iter().enumerate();
        let alike = ages.filter(|(other, _)| self.to_come(Some(*other), joint) == to_come);
        alike.map(|(_, age)| *age).fold(f64::INFINITY, f64::min)
    }

    /// The repairs of a joint that were still to come in a session; none of the arm as it is now.
    pub fn to_come(&self, session: Option<usize>, joint: usize) -> usize {
        let own = session.and_then(|session| self.repairs_to_come.get(session));
        own.and_then(|own| own.get(joint)).copied().unwrap_or(0)
    }

    /// Whether a joint had the gear of now in a session, not one before a repair.
    pub fn is_now(&self, session: Option<usize>, joint: usize) -> bool {
        self.to_come(session, joint) == 0
    }

    pub fn slide_period_mm(&self, joint: usize) -> Option<f64> {
        self.slide_periods_mm.get(joint).copied().flatten()
    }

    /// What an axis variable is divided by before its curve is taken on a circle of one turn: turns, or mm per rad where it slides.
    pub fn curve_unit(&self, joint: usize) -> f64 {
        let slides = self.slide_period_mm(joint);
        slides.map_or(f64::from(self.period_turns), |period_mm| period_mm / TAU)
    }

    /// Appends a block of `columns` columns; not a gear line of a joint that slides, which has no turns.
    pub fn push(&mut self, block: Block, columns: usize) {
        if matches!(block, Block::Line { joint, .. } if self.slide_period_mm(joint).is_some()) {
            return;
        }
        self.blocks.push((block, self.size..self.size + columns));
        self.size += columns;
    }

    /// This layout with blocks of other numbers of columns.
    pub(super) fn resized(&self, columns: impl Fn(Block, Range<usize>) -> usize) -> Self {
        let mut resized = Self { blocks: Vec::new(), size: 0, ..self.clone() };
        for (block, own) in self.blocks() {
            resized.push(block, columns(block, own));
        }
        resized
    }

    pub const fn size(&self) -> usize {
        self.size
    }

    pub fn blocks(&self) -> impl Iterator<Item = (Block, Range<usize>)> {
        self.blocks.iter().cloned()
    }

    pub fn columns(&self, block: Block) -> Option<Range<usize>> {
        self.blocks.iter().find(|(own, _)| *own == block).map(|(_, columns)| columns.clone())
    }

    pub fn lines(&self, joint: usize) -> Vec<f64> {
        let cycles = |(block, _): &(Block, Range<usize>)| match block {
            Block::Line { joint: own, cycles } if *own == joint => Some(*cycles),
            _ => None,
        };
        self.blocks.iter().filter_map(cycles).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slide_has_its_own_circle_and_no_gear_lines() {
        let mut layout = Layout::new(2);
        layout.slide_periods_mm = vec![Some(5000.0), None];
        assert!((layout.curve_unit(0) * TAU - 5000.0).abs() < 1e-9);
        assert!((layout.curve_unit(1) - 2.0).abs() < 1e-15);
        for joint in [0, 1] {
            layout.push(Block::Line { joint, cycles: 30.0 }, 2);
        }
        assert!(layout.lines(0).is_empty());
        assert_eq!(layout.lines(1), [30.0]);
        assert_eq!(layout.size(), 2);
    }

    #[test]
    fn a_gear_before_a_repair_ages_by_what_happened_before_its_own_latest_session() {
        let mut layout = Layout::new(1);
        layout.ages_years = vec![2.0, 1.0, 0.5, 0.0];
        layout.repairs_to_come = vec![vec![1, 0], vec![1, 0], vec![0, 0], vec![0, 0]];
        // The steps begin at 0, 0.1, 0.3, 0.7 and 1.5 years.
        let repaired: Vec<f64> = (0..5).map(|step| layout.ageing(0, 0, step)).collect();
        let wanted = (2.0 - 1.5) / 1.6;
        assert!((repaired[4] - wanted).abs() < 1e-12, "{repaired:?}");
        assert!(repaired[..4].iter().all(|share| *share == 0.0), "{repaired:?}");
        assert!((0..5).all(|step| layout.ageing(1, 0, step) == 0.0));
        // The other joint, and the new gear, as ever.
        assert!((layout.ageing(0, 1, 0) - 1.0).abs() < 1e-12);
        assert!((layout.ageing(2, 0, 2) - 0.5).abs() < 1e-12);
    }
}
