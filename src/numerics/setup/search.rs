//! The search: which single change of the set-up explains what the logs state.

mod pairs;

use std::fmt;

use super::agreement::{Agreement, Relation, Seen};
use super::evidence::Evidence;
use super::hypotheses::{self, Alternatives, Hypothesis, Sort};
use super::set_up::SetUp;
use super::shifts;
use pairs::pairs;

impl Sort {
    /// The share that the worst disagreement has to fall to.
    const fn explained(self) -> f64 {
        match self {
            Self::Kind | Self::Size => 1.0 / 3.0,
            Self::Arm => 1.0 / 2.0,
        }
    }

    /// The least fall of the cost.
    const fn least_gain(self) -> f64 {
        match self {
            Self::Kind | Self::Size => 2.0,
            Self::Arm => 1.0,
        }
    }

    /// Added to the cost where the logs had a say in the change.
    const fn freedom(self) -> f64 {
        match self {
            Self::Kind | Self::Arm => 0.0,
            Self::Size => 2.0,
        }
    }
}

/// Costs closer than this are not separated by the logs.
const TIE: f64 = 0.25;
/// What is named leaves at most this many times what the best mistake of kind leaves, beyond what is usual.
const TIMES_BEST: f64 = 2.0;
/// What one mistake may leave, in units of what is usual, before two at once are looked for.
const LITTLE: f64 = 3.0;
const MOST_NAMED: usize = 6;
/// A disagreement beyond this is grave even where it is a matter of size, mm and rad: tables made with it would be of another cell.
const GRAVE_MM: f64 = 20.0;
const GRAVE_RAD: f64 = 0.2;

/// A disagreement between logs and files, and what explains it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The name of the target whose readings it is of; `None` of the main one.
    pub target: Option<String>,
    pub relation: Relation,
    /// Its disagreement as stated: mm, for orientations rad.
    pub stated: f64,
    /// Its disagreement with the first mistake mended; `None` where no usual mistake explains it.
    pub mended: Option<f64>,
    /// The mistakes that explain it, each with what to edit; the logs cannot separate several.
    pub mistakes: Vec<Mistake>,
    /// Whether nothing may be published.
    pub is_grave: bool,
    /// The relation that is left worst with the first mistake mended, where that is more than is usual.
    pub left: Option<(Relation, f64)>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    pub what: String,
    pub edit: String,
    /// Whether it is two mistakes at once.
    pub is_pair: bool,
}

/// The disagreement of a session with its set-up; `None` where they agree. `gate_mm` is how far a dwell of the right target may
/// lie from the nominal arm: beyond it a disagreement that nothing explains is grave too.
pub fn check(
    stated: &SetUp,
    evidence: &Evidence,
    alternatives: &Alternatives,
    gate_mm: f64,
) -> Option<Finding> {
    if evidence.stations.is_empty() {
        return None;
    }
    let agreement = Agreement::of_stated(stated, evidence);
    let (relation, worst) = agreement.worst();
    if agreement.beyond(relation, worst) <= 1.0 {
        return None;
    }
    let gate_mm = gate_mm / agreement.weight(relation);
    Search::of(stated, agreement, evidence, alternatives)
        .named()
        .or_else(|| unexplained(relation, worst, gate_mm))
}

/// A disagreement that no usual mistake explains, where it is more than a sound arm's; where it is too large to go on, a grave one.
fn unexplained(relation: Relation, stated: f64, gate_mm: f64) -> Option<Finding> {
    let gate = match relation {
        own if own.is_of_turns() => GRAVE_RAD,
        // No reading takes part in it.
        Relation::Commands => gate_mm.min(GRAVE_MM),
        _ => gate_mm,
    };
    (stated > relation.most_left().min(gate)).then(|| Finding {
        target: None,
        relation,
        stated,
        mended: None,
        mistakes: Vec::new(),
        is_grave: stated > gate,
        left: None,
    })
}

/// A set-up with one or two mistakes mended, and how the logs agree with it.
#[derive(Debug, Clone)]
struct Explanation {
    hypothesis: Hypothesis,
    agreement: Agreement,
    cost: f64,
}

impl Explanation {
    /// Whether it explains the worst disagreement of `stated`, and leaves no relation beyond its gate.
    fn explains(&self, stated: &Agreement) -> bool {
        let (relation, _) = stated.worst_beside(&self.agreement);
        let sort = self.hypothesis.sort;
        self.agreement.is_less(relation, stated, sort.explained())
            && stated.cost() - self.agreement.cost() >= sort.least_gain()
            && self.agreement.iter().all(|(relation, left)| {
                self.agreement.weight(relation) * left <= relation.most_left()
            })
    }

    /// What it leaves of the worst relation, in units of what is usual.
    fn left(&self) -> f64 {
        let (relation, left) = self.agreement.worst();
        self.agreement.beyond(relation, left)
    }
}

/// The hypotheses about one set-up on the logs of one session.
pub(super) struct Search<'a> {
    stated: &'a SetUp,
    agreement: Agreement,
    evidence: &'a Evidence,
    alternatives: &'a Alternatives,
    seen: Seen,
}

impl<'a> Search<'a> {
    pub(super) fn of(
        stated: &'a SetUp,
        agreement: Agreement,
        evidence: &'a Evidence,
        alternatives: &'a Alternatives,
    ) -> Self {
        Self { stated, agreement, evidence, alternatives, seen: Seen::of(stated, evidence) }
    }

    /// Every mistake of kind, and every frame moved.
    fn of_kind(&self) -> Vec<Hypothesis> {
        let mut all = hypotheses::all(self.stated, self.alternatives);
        // Where nothing is commanded, joints a row off are readings a row off.
        let is_commanded = self.evidence.commands(0).next().is_some();
        all.retain(|own| is_commanded || own.set_up.rows[0] == self.stated.rows[0]);
        all.extend(shifts::frames(self.stated, self.evidence, &self.seen));
        all
    }

    fn all(&self) -> Vec<Hypothesis> {
        let mut all = self.of_kind();
        if !self.alternatives.is_ready(self.stated) {
            all.extend(shifts::links(self.stated, self.evidence, &self.seen));
        }
        all.extend(hypotheses::ready_file(self.stated, &self.alternatives.arms));
        all
    }

    fn explanation(&self, hypothesis: Hypothesis) -> Explanation {
        let set_up = &hypothesis.set_up;
        let agreement = if set_up.joins_otherwise(self.stated) {
            Agreement::of(set_up, self.evidence)
        } else {
            Agreement::by(&self.seen, set_up, self.evidence)
        };
        Explanation { cost: agreement.cost() + hypothesis.sort.freedom(), agreement, hypothesis }
    }

    /// The mistakes that explain the disagreement best; `None` where none does.
    pub(super) fn named(&self) -> Option<Finding> {
        let tried: Vec<Explanation> =
            self.all().into_iter().map(|hypothesis| self.explanation(hypothesis)).collect();
        let single = self.tied(tried.iter().collect());
        let is_whole = single.first().is_some_and(|first| first.left() <= LITTLE);
        let pairs =
            if is_whole { Vec::new() } else { pairs(self.evidence, &tried, self.alternatives) };
        let pairs = self.tied(pairs.iter().collect());
        let gain =
            |pair: &Explanation| single.first().is_none_or(|own| own.cost - pair.cost >= 2.0);
        let is_pair = pairs.first().is_some_and(|pair| gain(pair));
        self.finding(if is_pair { &pairs } else { &single })
    }

    /// Those that explain the disagreement and that the logs cannot separate from the best of them, in the order of hypotheses.
    fn tied<'e>(&self, mut tried: Vec<&'e Explanation>) -> Vec<&'e Explanation> {
        tried.retain(|own| own.explains(&self.agreement));
        let of_kind = tried.iter().filter(|own| own.hypothesis.sort == Sort::Kind);
        let share = of_kind.map(|own| own.left()).min_by(f64::total_cmp);
        let most = share.map_or(f64::INFINITY, |share| (TIMES_BEST * share).max(1.0));
        tried.retain(|own| own.hypothesis.sort == Sort::Size || own.left() <= most);
        let least = tried.iter().map(|own| own.cost).min_by(f64::total_cmp);
        tried.retain(|own| least.is_some_and(|least| own.cost <= least + TIE));
        // Pairs come in the order of their costs: what edits a robot file goes last.
        tried.sort_by_key(|own| own.hypothesis.edit.contains("robot file"));
        tried
    }

    fn finding(&self, tied: &[&Explanation]) -> Option<Finding> {
        let first = tied.first()?;
        let (relation, worst) = self.agreement.worst_beside(&first.agreement);
        let is_large = worst > if relation.is_of_turns() { GRAVE_RAD } else { GRAVE_MM };
        let mistake = |own: &Hypothesis| Mistake {
            what: own.mistake.clone(),
            edit: own.edit.clone(),
            is_pair: own.is_pair,
        };
        Some(Finding {
            target: None,
            relation,
            stated: worst,
            mended: first.agreement.get(relation),
            mistakes: tied.iter().map(|tied| mistake(&tied.hypothesis)).collect(),
            is_grave: first.hypothesis.sort != Sort::Size || is_large,
            left: Some(first.agreement.worst()).filter(|(relation, left)| *left > relation.usual()),
        })
    }
}

fn size(relation: Relation, value: f64) -> String {
    if relation.is_of_turns() {
        format!("{:.2}°", value.to_degrees())
    } else {
        format!("{value:.1} mm")
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(target) = &self.target {
            write!(f, "of {target:?} alone: ")?;
        }
        f.write_str(self.relation.in_words())?;
        if self.stated.is_finite() {
            write!(f, " disagree by {} in the median", size(self.relation, self.stated))?;
        } else {
            f.write_str(" cannot be brought together")?;
        }
        let (Some(first), Some(mended)) = (self.mistakes.first(), self.mended) else {
            return write!(
                f,
                ", and no usual mistake explains it (units, order and signs of joints, frames, robot file): check these keys \
                 against the cell, and whether joints and readings are of the same stations"
            );
        };
        let changes = if first.is_pair { "two changes" } else { "one change" };
        write!(f, "; with {changes} by {}: {}", size(self.relation, mended), first.what)?;
        let others = &self.mistakes[1..];
        if others.is_empty() {
            write!(f, "; write {}", first.edit)?;
        } else {
            let named: Vec<&str> =
                others.iter().take(MOST_NAMED).map(|other| other.what.as_str()).collect();
            write!(f, "; the logs cannot separate this from: {}", named.join("; or "))?;
            if others.len() > MOST_NAMED {
                write!(f, "; or {} others", others.len() - MOST_NAMED)?;
            }
            f.write_str("; so look at the cell before one of them is changed")?;
        }
        match self.left {
            Some((relation, left)) => write!(
                f,
                "; {} are left between {}: something else is wrong too, or the arm is far from its nominal one",
                size(relation, left),
                relation.in_words()
            ),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::geometry::isometry_from_rpy;
    use crate::kinematics::RobotFile;
    use crate::setup::{Dwelt, SetUp};

    #[test]
    fn a_target_far_from_the_flange_of_a_positioner_is_no_mistake() {
        let file: RobotFile =
            toml::from_str(include_str!("../../../tests/robots/positioner.toml")).unwrap();
        let stated = SetUp::of_arm(file.arm().unwrap());
        let camera_from_base = isometry_from_rpy([3.8, -592.3, -585.6], [-1.6, 0.0, 0.0]);
        let dwelt = |k: i32| {
            let reported = vec![0.52 * (0.9 * f64::from(k)).sin(), 0.07 * f64::from(k)];
            let target = stated.flange(&reported) * Point3::new(177.0, -636.0, 509.0);
            Dwelt {
                measured: (camera_from_base * target).coords,
                reported,
                orientation: None,
                command: None,
            }
        };
        let sound = Evidence::spread((0..90).map(dwelt).collect());
        assert_eq!(check(&stated, &sound, &Alternatives::default(), 30.0), None);
        // Readings that do not follow the axes are one.
        let mut other = sound;
        for (place, station) in other.stations.iter_mut().enumerate() {
            station.measured += Vector3::x() * 120.0 * (place % 7) as f64;
        }
        assert!(check(&stated, &other, &Alternatives::default(), 30.0).is_some());
    }

    #[test]
    fn what_cannot_be_compared_is_not_a_number() {
        let finding = unexplained(Relation::Arm, f64::INFINITY, 30.0).expect("grave");
        assert!(!finding.to_string().contains("inf"), "{finding}");
        assert!(unexplained(Relation::Turns, 0.1, 30.0).is_none());
        let large = unexplained(Relation::Commands, 15.0, 30.0).expect("more than a sound arm's");
        assert!(!large.is_grave, "{large}");
    }
}
