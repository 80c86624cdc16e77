//! The search: which single change of the set-up explains what the logs state.

use std::fmt;

use super::agreement::{Agreement, Relation};
use super::evidence::Evidence;
use super::hypotheses::{self, Alternatives, Hypothesis, Sort};
use super::set_up::SetUp;
use super::shifts::shifts;

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
/// A mistake explains everything where no relation is left beyond this many times what is usual.
const WHOLE: f64 = 10.0;
const MOST_NAMED: usize = 4;
/// A disagreement beyond this is grave even where it is a matter of size, mm: tables made with it would be of another cell.
const GRAVE_MM: f64 = 20.0;

/// A disagreement between logs and files, and what explains it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    pub relation: Relation,
    /// Its disagreement as stated: mm, for orientations rad.
    pub stated: f64,
    /// Its disagreement with the first mistake mended; `None` where no usual mistake explains it.
    pub mended: Option<f64>,
    /// The mistakes that explain it, each with what to edit; the logs cannot separate several.
    pub mistakes: Vec<Mistake>,
    /// Whether nothing may be published.
    pub is_grave: bool,
    /// Whether every relation agrees with the first mistake mended.
    pub explains_all: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    pub what: String,
    pub edit: String,
}

impl From<&Hypothesis> for Mistake {
    fn from(hypothesis: &Hypothesis) -> Self {
        Self { what: hypothesis.mistake.clone(), edit: hypothesis.edit.clone() }
    }
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
    if worst <= relation.usual() {
        return None;
    }
    named(&agreement, evidence, &all(stated, evidence, alternatives))
        .or_else(|| unexplained(relation, worst, gate_mm))
}

pub(super) fn all(
    stated: &SetUp,
    evidence: &Evidence,
    alternatives: &Alternatives,
) -> Vec<Hypothesis> {
    let mut all = hypotheses::all(stated, alternatives);
    all.extend(shifts(stated, evidence));
    all.extend(hypotheses::ready_file(stated, &alternatives.arms));
    all
}

/// A disagreement that no usual mistake explains, where it is too large to go on.
fn unexplained(relation: Relation, stated: f64, gate_mm: f64) -> Option<Finding> {
    let is_grave = relation != Relation::Turns && stated > gate_mm;
    is_grave.then(|| Finding {
        relation,
        stated,
        mended: None,
        mistakes: Vec::new(),
        is_grave,
        explains_all: false,
    })
}

/// A hypothesis under which the logs agree better.
struct Explanation<'h> {
    hypothesis: &'h Hypothesis,
    agreement: Agreement,
    cost: f64,
}

impl<'h> Explanation<'h> {
    /// `None` where the hypothesis does not explain the worst disagreement of `stated`.
    fn of(hypothesis: &'h Hypothesis, stated: &Agreement, evidence: &Evidence) -> Option<Self> {
        let (relation, worst) = stated.worst();
        let agreement = Agreement::of(&hypothesis.set_up, evidence);
        let mended = agreement.get(relation).unwrap_or(f64::INFINITY);
        let (sort, gain) = (hypothesis.sort, stated.cost() - agreement.cost());
        let explains = mended <= sort.explained() * worst && gain >= sort.least_gain();
        explains.then(|| Self { hypothesis, cost: agreement.cost() + sort.freedom(), agreement })
    }
}

/// The mistakes among `hypotheses` that explain the disagreement best; `None` where none does.
pub(super) fn named(
    stated: &Agreement,
    evidence: &Evidence,
    hypotheses: &[Hypothesis],
) -> Option<Finding> {
    let (relation, worst) = stated.worst();
    let explained = hypotheses.iter();
    let explained =
        explained.filter_map(|hypothesis| Explanation::of(hypothesis, stated, evidence));
    let explained: Vec<Explanation<'_>> = explained.collect();
    let costs = explained.iter().map(|explanation| explanation.cost);
    let least = costs.min_by(f64::total_cmp)?;
    // Of mistakes that the logs cannot separate, the simpler comes first: that is their order.
    let tied: Vec<&Explanation<'_>> =
        explained.iter().filter(|explanation| explanation.cost <= least + TIE).collect();
    let first = tied.first()?;
    let (still, left) = first.agreement.worst();
    let is_large = relation != Relation::Turns && worst > GRAVE_MM;
    Some(Finding {
        relation,
        stated: worst,
        mended: first.agreement.get(relation),
        mistakes: tied.iter().take(MOST_NAMED).map(|tied| Mistake::from(tied.hypothesis)).collect(),
        is_grave: first.hypothesis.sort != Sort::Size || is_large,
        explains_all: left <= WHOLE * still.usual(),
    })
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = |value: f64| match self.relation {
            Relation::Turns => format!("{:.2}°", value.to_degrees()),
            _ => format!("{value:.1} mm"),
        };
        write!(f, "{} disagree by {} in the median", self.relation.in_words(), size(self.stated))?;
        let (Some(first), Some(mended)) = (self.mistakes.first(), self.mended) else {
            return write!(
                f,
                ", and no usual mistake explains it (units, order and signs of joints, frames, robot file): check these keys \
                 against the cell"
            );
        };
        write!(f, "; with one change by {}: {}; write {}", size(mended), first.what, first.edit)?;
        for other in &self.mistakes[1..] {
            write!(f, "; the logs cannot separate this from: {} ({})", other.what, other.edit)?;
        }
        Ok(())
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
            Dwelt { measured: (camera_from_base * target).coords, reported, command: None }
        };
        let sound = Evidence::spread((0..90).map(dwelt).collect());
        assert_eq!(check(&stated, &sound, &Alternatives::default(), 30.0), None);
        // Readings that do not follow the axes are one.
        let mut other = sound;
        for (place, station) in other.stations.iter_mut().enumerate() {
            station.measured += Vector3::x() * 40.0 * (place % 7) as f64;
        }
        assert!(check(&stated, &other, &Alternatives::default(), 30.0).is_some());
    }
}
