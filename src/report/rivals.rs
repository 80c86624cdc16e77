//! Rivals held against the model that corrects: the mean difference of their errors on the same stations.
//!
//! Inputs are the residual sets of a run; output is a [`Beside`] for each set of a rival. Stations of one block of the work space count
//! together, since neighbours share their errors. Of several rivals the best by chance looks better than it is, so one is chosen
//! ([`Beside::after_choice`]) on some blocks and held against the model on others: on held-out blocks, half of the folds choose, and on a
//! session that took no part, the held-out blocks of those that trained.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::{BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::figures::{Figures, LEAST_BLOCKS, clustered_mean, expanded};
use crate::fit::Blocks;

/// A rival's errors minus those of the model that corrects, on the same stations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Mean of the differences of error norms, mm; negative where the rival leaves less.
    pub mean_mm: f64,
    /// Twice its standard error, mm.
    pub expanded_mm: f64,
    /// Number of stations.
    pub stations: usize,
    /// Number of their blocks.
    pub blocks: usize,
}

/// The outcome of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The rival leaves less by more than two standard errors.
    Wins,
    /// It leaves more by more than two standard errors.
    Loses,
    /// The difference is within two standard errors.
    Open,
}

/// A rival held against the model that corrects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside {
    /// The difference on all stations that judge.
    pub all: Difference,
    /// The difference on blocks that took no part in choosing the rival; `None` of a rival that was not chosen, and where too few blocks are left.
    pub after_choice: Option<Difference>,
}

impl Outcome {
    /// By a mean difference and twice its standard error, mm.
    pub fn of(mean_mm: f64, expanded_mm: f64) -> Self {
        if mean_mm < -expanded_mm {
            Self::Wins
        } else if mean_mm > expanded_mm {
            Self::Loses
        } else {
            Self::Open
        }
    }
}

/// Every rival of `sets` beside the model `best`.
pub fn beside(sets: &[ResidualSet], best: Model, blocks: &Blocks) -> BTreeMap<Subject, Beside> {
    let rivals = sets.iter().filter(|set| is_compared(set));
    let of = |set: &ResidualSet| {
        let other = counterpart(sets, &set.subject, best)?;
        let all = difference(set, other, blocks, |_| true)?;
        let is_chosen = chosen(sets, &set.subject) == Some(set.subject.model);
        let after_choice = match set.subject.split {
            Split::Blocks => difference(set, other, blocks, |own| !chooses(own)),
            Split::None | Split::Session => Some(all),
        };
        let after_choice = after_choice.filter(|_| is_chosen);
        Some((set.subject.clone(), Beside { all, after_choice }))
    };
    rivals.filter_map(of).collect()
}

/// The rival that wins on the held-out blocks of a session that did not choose it; `None` where none does.
pub fn winner(beside: &BTreeMap<Subject, Beside>, session: &str) -> Option<Model> {
    let is_own = |subject: &Subject| {
        (subject.split, subject.base_refit) == (Split::Blocks, BaseRefit::None)
            && subject.of_session == session
    };
    let wins = |own: &Difference| Outcome::of(own.mean_mm, own.expanded_mm) == Outcome::Wins;
    let mut own = beside.iter().filter(|(subject, _)| is_own(subject));
    let found = own.find(|(_, own)| own.after_choice.as_ref().is_some_and(wins));
    found.map(|(subject, _)| subject.model)
}

fn is_compared(set: &ResidualSet) -> bool {
    set.subject.model.is_rival() && set.subject.split != Split::None
}

/// The residuals of `best` on the stations of a rival's subject.
fn counterpart<'s>(
    sets: &'s [ResidualSet],
    subject: &Subject,
    best: Model,
) -> Option<&'s ResidualSet> {
    let wanted = Subject { model: best, angles: *best.about().angles.first()?, ..subject.clone() };
    sets.iter().find(|set| set.subject == wanted)
}

/// The differences at the stations that `takes` part; `None` where the sets are not of the same stations, or of too few blocks.
fn difference(
    rival: &ResidualSet,
    other: &ResidualSet,
    blocks: &Blocks,
    takes: impl Fn(&Residual) -> bool,
) -> Option<Difference> {
    let (rival, other): (Vec<_>, Vec<_>) = (rival.judged().collect(), other.judged().collect());
    let are_same =
        |(a, b): (&&Residual, &&Residual)| (a.station, a.target) == (b.station, b.target);
    if rival.len() != other.len() || !rival.iter().zip(&other).all(are_same) {
        return None;
    }
    let measured: Vec<Point3<f64>> = other.iter().map(|own| own.attained).collect();
    let cells = blocks.cells(&measured).into_iter();
    let cells = cells.map(|cell| cell.map(f64::to_bits));
    let own = rival.iter().zip(&other).zip(cells);
    let own = own.filter(|((own, _), _)| takes(own));
    let (differences, cells): (Vec<f64>, Vec<_>) =
        own.map(|((a, b), cell)| (a.residual.norm() - b.residual.norm(), cell)).unzip();
    let mut distinct = cells.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let (mean_mm, standard_error_mm) = clustered_mean(&differences, &cells)?;
    (distinct.len() >= LEAST_BLOCKS).then_some(Difference {
        mean_mm,
        expanded_mm: expanded(standard_error_mm),
        stations: differences.len(),
        blocks: distinct.len(),
    })
}

/// Whether a station of held-out blocks takes part in choosing a rival: folds alternate like the fields of a chess board.
const fn chooses(own: &Residual) -> bool {
    matches!(own.fold, Some(fold) if fold.count_ones() % 2 == 0)
}

/// The rival that leaves least on the stations that choose for a subject: of its session's held-out blocks those that choose, and
/// for a session that took no part all held-out blocks.
fn chosen(sets: &[ResidualSet], subject: &Subject) -> Option<Model> {
    let of_blocks = |own: &&ResidualSet| {
        let (split, base) = (own.subject.split, own.subject.base_refit);
        (split, base) == (Split::Blocks, BaseRefit::None)
            && (subject.split == Split::Session || own.subject.of_session == subject.of_session)
    };
    let mut errors: BTreeMap<Model, Vec<f64>> = BTreeMap::new();
    for set in sets.iter().filter(|set| is_compared(set)).filter(of_blocks) {
        let takes = |own: &&Residual| subject.split == Split::Session || chooses(own);
        let norms = set.judged().filter(takes).map(|own| own.residual.norm());
        errors.entry(set.subject.model).or_default().extend(norms);
    }
    let means = errors.iter();
    let means = means.filter_map(|(model, errors)| Some((*model, Figures::of(errors)?.mean)));
    let least = means.min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(model, _)| model)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::report::Angles;

    const BLOCKS: Blocks = Blocks { size_mm: Some([2.0; 3]), origin_mm: Some([0.0; 3]) };

    /// Stations in a cube of 4 × 4 × 4 blocks, eight in each, with these errors along x, mm.
    fn set(split: Split, model: Model, error: impl Fn(usize) -> f64) -> ResidualSet {
        let positions: Vec<Point3<f64>> = (0..512)
            .map(|place| {
                Point3::new(
                    f64::from(place % 8) + 0.5,
                    f64::from(place / 8 % 8) + 0.5,
                    f64::from(place / 64) + 0.5,
                )
            })
            .collect();
        let folds = BLOCKS.folds(&positions);
        let residual = |(place, position): (usize, &Point3<f64>)| Residual {
            station: place,
            target: None,
            pose: place,
            fold: (split == Split::Blocks).then_some(folds[place]),
            used_for_refit: false,
            attained: *position,
            residual: Vector3::x() * error(place),
            covariance: None,
            weight: None,
            turn: None,
        };
        ResidualSet {
            subject: Subject {
                split,
                of_session: if split == Split::Session { "tue" } else { "mon" }.to_owned(),
                model,
                angles: model.about().angles.first().copied().unwrap_or(Angles::Reported),
                base_refit: BaseRefit::None,
            },
            residuals: positions.iter().enumerate().map(residual).collect(),
        }
    }

    #[test]
    fn a_rival_that_is_better_wherever_it_is_asked_wins_where_it_was_not_chosen() {
        let noise = |place: usize| 0.02 * ((place * 37 % 101) as f64 / 101.0 - 0.5);
        let sets = |split| {
            [
                set(split, Model::Full, |_| 0.5),
                set(split, Model::KrigingJoints, |place| 0.4 + noise(place)),
                set(split, Model::IdwJoints, |place| 0.5 + noise(place)),
                set(split, Model::IdwSpace, |place| 0.6 + noise(place)),
            ]
        };
        let sets = [sets(Split::Blocks), sets(Split::Session)].concat();
        let found = beside(&sets, Model::Full, &BLOCKS);
        assert_eq!(found.len(), 6);
        assert_eq!(winner(&found, "mon"), Some(Model::KrigingJoints));
        assert_eq!(winner(&found, "tue"), None, "it has no held-out blocks");
        for (subject, own) in &found {
            let outcome = Outcome::of(own.all.mean_mm, own.all.expanded_mm);
            let (wanted, mean_mm) = match subject.model {
                Model::KrigingJoints => (Outcome::Wins, -0.1),
                Model::IdwSpace => (Outcome::Loses, 0.1),
                _ => (Outcome::Open, 0.0),
            };
            assert_eq!(outcome, wanted, "{subject:?}: {own:?}");
            assert!((own.all.mean_mm - mean_mm).abs() < 1e-3, "{own:?}");
            assert_eq!((own.all.stations, own.all.blocks), (512, 64));
            let is_kriging = subject.model == Model::KrigingJoints;
            assert_eq!(own.after_choice.is_some(), is_kriging, "{subject:?}");
            let after = own.after_choice.map(|own| (own.stations, own.blocks));
            let wanted = if subject.split == Split::Blocks { (256, 32) } else { (512, 64) };
            assert!(after.is_none_or(|own| own == wanted), "{after:?}");
        }
    }

    #[test]
    fn a_rival_that_is_better_only_where_it_was_chosen_does_not_win() {
        let folds = |place: usize| {
            let of = |index: usize| usize::from(index / 2 % 2 == 1);
            of(place % 8) + 2 * of(place / 8 % 8) + 4 * of(place / 64)
        };
        let error = |place: usize| {
            if folds(place).count_ones() % 2 == 0 { 0.1 } else { 0.6 }
        };
        let sets = [
            set(Split::Blocks, Model::Full, |_| 0.5),
            set(Split::Blocks, Model::KrigingJoints, error),
        ];
        let found = beside(&sets, Model::Full, &BLOCKS);
        assert_eq!(winner(&found, "mon"), None);
        let own = found.values().next().expect("a rival");
        assert!((own.all.mean_mm + 0.15).abs() < 1e-12, "{own:?}");
        let after = own.after_choice.expect("it is the only one");
        assert!((after.mean_mm - 0.1).abs() < 1e-12, "{after:?}");
        assert_eq!(Outcome::of(after.mean_mm, after.expanded_mm), Outcome::Loses);
    }

    #[test]
    fn other_stations_and_few_blocks_show_nothing() {
        let mut short = set(Split::Blocks, Model::KrigingJoints, |_| 0.4);
        short.residuals.pop();
        let full = set(Split::Blocks, Model::Full, |_| 0.5);
        let sets = [full.clone(), short];
        assert!(beside(&sets, Model::Full, &BLOCKS).is_empty());
        let few = Blocks { size_mm: Some([4.0, 8.0, 8.0]), origin_mm: None };
        let sets = [full, set(Split::Blocks, Model::KrigingJoints, |_| 0.4)];
        assert!(beside(&sets, Model::Full, &few).is_empty());
    }
}
