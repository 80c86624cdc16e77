//! What a session leaves for the next one.

use nalgebra::{DVector, Vector3};

use super::column::Column;
use super::places::Places;
use super::{Carried, Entered, Sizes};
use crate::fit::full::columns::day_of;
use crate::fit::full::components::{Part, Size};
use crate::fit::full::layout::Block;
use crate::fit::full::regression::Sums;
use crate::fit::full::rows::Around;
use crate::fit::full::settings::FullSettings;
use crate::fit::full::train::Settled;
use crate::fit::full::whitening::sums;
use crate::fit::problem::{Problem, Unknown};

/// The sums of all sessions on a session's columns, and behind them on the zeros that joints had before, on changes since the session
/// before and on that session's own changes.
struct Total {
    sums: Sums,
    /// Columns of the model, and their prior variances.
    own: DVector<f64>,
    /// Zeros.
    joints: usize,
    /// Prior variance of each change.
    changes: Vec<f64>,
    /// Prior variance of each change of the session before alone.
    last: Vec<f64>,
}

/// What coefficients of one size showed of it: their squares over their prior variances, and how many were determined.
#[derive(Clone, Copy)]
struct Shown {
    squares: f64,
    counted: f64,
}

impl Total {
    /// The columns behind those of the model and the zeros, with their prior variances.
    fn behind(&self) -> impl Iterator<Item = (usize, f64)> {
        let first = self.own.len() + self.joints;
        (first..).zip(self.changes.iter().chain(&self.last).copied())
    }

    /// What the changes showed, and those of the session before alone; no zero changed but by what is a change.
    fn shown(&self) -> Option<[Shown; 2]> {
        let (size, behind) = (self.own.len(), self.behind());
        let (behind, variances): (Vec<usize>, Vec<f64>) = behind.unzip();
        let places: Vec<usize> = (0..size).chain(behind).collect();
        let all = self.own.iter().copied().chain(variances);
        let all = DVector::from_iterator(places.len(), all);
        let posterior = self.sums.selected(&places).posterior(&all)?;
        let determined = posterior.determined();
        let shown = |first: usize, count: usize| {
            let own = (first..first + count).filter(|&place| all[place] > 0.0);
            let none = Shown { squares: 0.0, counted: 0.0 };
            own.fold(none, |sum, place| Shown {
                squares: sum.squares + posterior.whitened[place].powi(2),
                counted: sum.counted + determined[place],
            })
        };
        let changes = self.changes.len();
        Some([shown(size, changes), shown(size + changes, self.last.len())])
    }
}

impl Settled {
    /// What the sessions so far and this one said, all parts still in the model; `None` unless sessions are learnt one on top of the
    /// other, or where rounding made a matrix indefinite.
    pub(in crate::fit::full) fn carried(
        &self,
        problem: &Problem<'_>,
        settings: &FullSettings,
        up: Option<Vector3<f64>>,
    ) -> Option<Carried> {
        let state = &self.state;
        if !state.carries {
            return None;
        }
        let around = Around::new(problem, state, up);
        let places = Places::of(&around, &self.prior_mean);
        let before = state.before.as_deref();
        let total = self.total(&around, &places)?;
        let sizes = self.sizes(&total, settings)?;
        let made_with =
            before.map_or_else(|| sizes.of_one_session(), |own| own.then.made_with.clone());
        let size = total.own.len();
        let kept = self.kept(problem.unknowns());
        let gone = (0..size).filter(|&column| kept[column].is_none());
        let gone = gone.map(|column| (column, total.own[column]));
        let (gone, of_gone): (Vec<usize>, Vec<f64>) = gone.chain(total.behind()).unzip();
        let mut sums = total.sums.without(&gone, &of_gone)?;
        // As it is read back.
        sums.information.fill_upper_triangle_with_lower_triangle();
        let zeros = (0..total.joints).map(|joint| (Column::Constant(joint), 0.0, 0.0));
        let columns = kept.iter().enumerate().filter_map(|(column, kept)| {
            let at = places.at.get(column).copied().unwrap_or(0.0);
            Some(((*kept)?, at, total.own[column]))
        });
        let columns: Vec<(Column, f64, f64)> = columns.chain(zeros).collect();
        let number = |of: fn(&(Column, f64, f64)) -> f64| {
            DVector::from_iterator(columns.len(), columns.iter().map(of))
        };
        Some(Carried {
            at: number(|own| own.1),
            variances: number(|own| own.2),
            columns: columns.iter().map(|own| own.0).collect(),
            sums,
            sizes,
            made_with,
            slide_periods_mm: state.layout.slide_periods_mm().to_vec(),
            span: state.span,
            day: day_of(problem.observations()).or_else(|| before.and_then(|own| own.then.day)),
            sessions: before.map_or(0, |own| own.then.sessions) + 1,
        })
    }

    /// The sums of all sessions.
    fn total(&self, around: &Around<'_>, places: &Places<'_>) -> Option<Total> {
        let own = self.state.components.variances();
        let before = self.state.before.as_deref();
        let (changes, last) = before.map(Entered::variances_behind).unwrap_or_default();
        let zeros = places.constants();
        let (size, joints) = (own.len(), zeros.len());
        let all = size + joints + changes.len() + last.len();
        // The zero that a joint had in this session will be one that it had before.
        let columns: Vec<usize> = (0..size).chain(zeros).collect();
        let first: Vec<usize> = (0..size + joints).collect();
        let mut total = sums(around, &self.prior_mean).selected(&columns).placed(&first, all);
        if let Some(before) = before {
            total.add(&places.laid(&before.then, Some(before), all)?, 1.0);
        }
        Some(Total { sums: total, own, joints, changes, last })
    }

    /// The columns that are carried over: what all sessions share, and the changes of curves of this one; gear lines without evidence are
    /// left behind.
    fn kept(&self, unknowns: &[Unknown]) -> Vec<Option<Column>> {
        let mut kept = vec![None; self.state.layout.size()];
        for (block, columns) in self.state.layout.blocks() {
            let own: Vec<usize> = columns.clone().collect();
            let column = |place: usize| match block {
                Block::Unknowns => {
                    let unknown = unknowns[place];
                    unknown.session().is_none().then_some(Column::Unknown(unknown))
                }
                Block::SessionCurve { joint, .. } => Some(Column::Last { joint, place }),
                block => block.session().is_none().then_some(Column::Of { block, place }),
            };
            let is_left = matches!(block, Block::Line { .. })
                && self.posterior.gain_of(&own).is_none_or(|gain| gain <= 0.0);
            for (place, own) in columns.enumerate().filter(|_| !is_left) {
                kept[own] = column(place);
            }
        }
        kept
    }

    /// The size of each part, with what the sessions showed of parts that each has of its own.
    fn sizes(&self, total: &Total, settings: &FullSettings) -> Option<Sizes> {
        let components = &self.state.components;
        let squares = self.posterior.whitened.map(|u| u * u);
        let determined = self.posterior.determined();
        let mut sizes = components.sizes(&squares, &determined, &total.own);
        let expected = settings.session_curve_sd_rad.powi(2);
        let mut ageing = Size::expected(expected);
        if let Some(before) = self.state.before.as_deref() {
            let then = |part| before.then.sizes.of(part);
            let [changes, last] = total.shown()?;
            ageing = then(Part::Ageing)?;
            if !total.changes.is_empty() {
                ageing = ageing.after(expected, changes.squares, changes.counted);
            }
            let of_curves = sizes.iter_mut().find(|(part, _)| *part == Part::SessionCurve);
            if let (Some((_, own)), Some(then)) = (of_curves, then(Part::SessionCurve)) {
                *own = then.after(expected, last.squares, last.counted);
            }
        }
        sizes.push((Part::Ageing, ageing));
        let held = self.state.held.as_deref();
        for (part, size) in &mut sizes {
            *size = held.and_then(|held| held.of(*part)).unwrap_or(*size);
        }
        Some(Sizes(sizes))
    }
}
