//! The two rules that choose a step.
//!
//! Both choose among tables that cover enough of the stations like them; among all tables only where none does.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use super::Picked;
use crate::figures::expanded;
use crate::grid::covered::ENOUGH;
use crate::grid::{Interpolation, Judged, Judgement, Source, Verdict, local_cells_of};

/// A bound may exceed the model's own by this, mm, even where the share of it is less: no instrument shows the difference.
pub const WITHIN_MM: f64 = 0.005;

/// [`Rule::Within`](super::Rule): for model nodes the largest step whose bound is within this share of the model's own,
/// for measured nodes the largest that holds, and of both that with the smaller bound. `None` where no row has a table.
pub(super) fn within(judged: &[Judged], share: f64) -> Option<Picked> {
    let pool = Pool::of(judged);
    let model = pool.only(Source::Model).near_the_model(share);
    let measured = pool.only(Source::Measured).largest();
    let bound = |picked: &Picked| judged[picked.row].bound.unwrap_or(f64::INFINITY);
    let picked = match (model, measured) {
        (Some(model), Some(measured)) if bound(&measured) < bound(&model) => {
            beside(judged, measured, &model)
        }
        (Some(model), Some(measured)) => beside(judged, model, &measured),
        (model, measured) => model.or(measured)?,
    };
    Some(pool.with_cost(picked))
}

/// The choice of [`Rule::FewestNodes`](super::Rule): the largest step whose bound, and that of all smaller steps of its
/// source and interpolation, is within the tolerance. `None` where no row has a table.
pub(super) fn fewest_nodes(judged: &[Judged]) -> Option<Picked> {
    let pool = Pool::of(judged);
    Some(pool.with_cost(pool.largest()?))
}

/// Rows of tables that a rule may choose from.
struct Pool<'j> {
    judged: &'j [Judged],
    /// Indices among the judged rows.
    rows: Vec<usize>,
    /// Whether no table covers enough of the stations like it.
    is_short: bool,
}

impl<'j> Pool<'j> {
    /// All tables that cover enough stations; all tables where none does.
    fn of(judged: &'j [Judged]) -> Self {
        let is_table = |row: &Judged| {
            row.judgement == Judgement::Table && row.of_test.is_none() && row.lattice.is_some()
        };
        let has_value = |row: &Judged| row.nodes > row.refused_nodes.values().sum::<usize>();
        let tables =
            (0..judged.len()).filter(|&row| is_table(&judged[row]) && has_value(&judged[row]));
        let tables: Vec<usize> = tables.collect();
        // Of nodes that are not placed it is not known.
        let is_enough = |row: &usize| judged[*row].covered.is_none_or(|own| own.is_enough());
        let enough: Vec<usize> = tables.iter().copied().filter(is_enough).collect();
        let is_short = enough.is_empty();
        Self { judged, rows: if is_short { tables } else { enough }, is_short }
    }

    fn only(&self, source: Source) -> Self {
        let is_of = |row: &usize| self.judged[*row].source == source;
        Self { rows: self.rows.iter().copied().filter(is_of).collect(), ..*self }
    }

    /// The largest step whose bound is within `share` of the model's own; else the least bound; without bounds by local cells.
    fn near_the_model(&self, share: f64) -> Option<Picked> {
        let by_cells = || {
            let Picked { row, words } = self.near(share, |row| self.local(row))?;
            let words = format!(
                "no table has enough held-out stations for a bound; by cells around each station: {words}"
            );
            Some(Picked { row, words })
        };
        let of_table = |row: usize| Some(&self.judged[row]);
        self.near(share, of_table).or_else(by_cells).or_else(|| self.by_local_error())
    }

    /// The largest step whose bound is within `share` of the model's own, with the reason; the least bound where none is. Both
    /// bounds are those of the row that `of` gives for a table; `None` where none has bounds.
    fn near<'r>(&'r self, share: f64, of: impl Fn(usize) -> Option<&'r Judged>) -> Option<Picked> {
        let bounds = |row: usize| {
            let judged = of(row)?;
            Some((row, judged.bound?, judged.model_bound?))
        };
        let bounds: Vec<(usize, f64, f64)> =
            self.rows.iter().filter_map(|&row| bounds(row)).collect();
        let margin = |model: f64| (share * model).max(WITHIN_MM);
        let mut near = bounds.clone();
        near.retain(|(_, bound, model)| *bound <= model + margin(*model));
        // Of several equally near ones, one that meets the tolerance.
        let meets = |place: &(usize, f64, f64)| self.judged[place.0].verdict == Verdict::Meets;
        if near.iter().any(meets) {
            near.retain(meets);
        }
        if let Some(&(row, bound, model)) = near.iter().max_by(|a, b| self.by_size(a.0, b.0)) {
            let why = format!(
                "the largest step whose bound of {bound:.3} mm is within {:.3} mm of the model's own, {model:.3} mm",
                margin(model)
            );
            return Some(Picked { row, words: format!("{}: {why}", named(&self.judged[row])) });
        }
        let least = |a: &&(usize, f64, f64), b: &&(usize, f64, f64)| {
            a.1.total_cmp(&b.1).then_with(|| self.by_size(b.0, a.0))
        };
        let &(row, bound, model) = bounds.iter().min_by(least)?;
        let words = format!(
            "no step's bound is within {:.3} mm of the model's own, {model:.3} mm; {} has the least, {bound:.3} mm",
            margin(model),
            named(&self.judged[row])
        );
        Some(Picked { row, words })
    }

    /// The largest step that holds with all smaller ones; else the least bound; without bounds by local cells; else the smallest.
    fn largest(&self) -> Option<Picked> {
        if let Some(row) = self.largest_that_holds() {
            let words = "the largest step that holds, with all smaller ones";
            let words = format!("{}: {words}", named(&self.judged[row]));
            return Some(Picked { row, words });
        }
        let bound = |row: usize| self.judged[row].bound.map(|bound| (row, bound));
        let bounds = self.rows.iter().filter_map(|&row| bound(row));
        if let Some((row, bound)) = bounds.min_by(|a, b| a.1.total_cmp(&b.1)) {
            let nearest = named(&self.judged[row]);
            let words = if self.judged[row].verdict == Verdict::Meets {
                format!(
                    "no step holds with all smaller ones; {nearest} has the least bound, {bound:.3} mm"
                )
            } else {
                format!(
                    "no step meets the tolerance; {nearest} comes nearest with a bound of {bound:.3} mm"
                )
            };
            return Some(Picked { row, words });
        }
        self.by_local_error()
    }

    /// The largest holding step over all families (source × interpolation).
    fn largest_that_holds(&self) -> Option<usize> {
        let families = self.judged.iter().map(|row| (row.source, row.interpolation));
        let families: BTreeSet<(Source, Interpolation)> = families.collect();
        let best_of = |family: &(Source, Interpolation)| {
            let rows = tables_of(self.judged, *family);
            let holding =
                rows.into_iter().take_while(|&row| self.judged[row].verdict == Verdict::Meets);
            holding.filter(|row| self.rows.contains(row)).last()
        };
        families.iter().filter_map(best_of).max_by(|&a, &b| self.by_size(a, b))
    }

    /// The table whose local cells leave the least error; the smallest step where there are no local cells.
    fn by_local_error(&self) -> Option<Picked> {
        let p95 = |row: usize| Some((row, self.local(row)?.figures?.p95));
        let errors = self.rows.iter().filter_map(|&row| p95(row));
        if let Some((row, _)) = errors.min_by(|a, b| a.1.total_cmp(&b.1)) {
            let least = named(&self.judged[row]);
            let words = format!(
                "no step could be shown to meet the tolerance; {least} has the least error in local cells"
            );
            return Some(Picked { row, words });
        }
        let step = |row: &usize| self.judged[*row].step_mm;
        let row = *self.rows.iter().min_by(|a, b| step(a).total_cmp(&step(b)))?;
        let words = format!(
            "no step could be shown to meet the tolerance; {} is the smallest",
            named(&self.judged[row])
        );
        Some(Picked { row, words })
    }

    /// The local cells of a table's step and interpolation.
    fn local(&self, row: usize) -> Option<&'j Judged> {
        local_cells_of(self.judged, &self.judged[row])
    }

    /// Orders rows by step, then by bound, the smaller one last, then by the mean error in local cells: stations on nodes
    /// do not distinguish interpolations.
    fn by_size(&self, a: usize, b: usize) -> Ordering {
        let (one, other) = (&self.judged[a], &self.judged[b]);
        let bound = |row: &Judged| row.bound.unwrap_or(f64::INFINITY);
        let local = |row: usize| {
            let figures = self.local(row).and_then(|local| local.figures);
            figures.map_or(f64::INFINITY, |figures| figures.mean)
        };
        one.step_mm
            .total_cmp(&other.step_mm)
            .then_with(|| bound(other).total_cmp(&bound(one)))
            .then_with(|| local(b).total_cmp(&local(a)))
    }

    /// Adds the cost of the choice and its coverage.
    fn with_cost(&self, mut picked: Picked) -> Picked {
        let row = &self.judged[picked.row];
        let local = self.local(picked.row);
        picked.words += &cost(local.filter(|_| row.decided_by != row.judgement).unwrap_or(row));
        if let Some(covered) = &row.covered {
            picked.words += "; ";
            picked.words += &covered.words();
        }
        if self.is_short {
            let percent = 100.0 * ENOUGH;
            let short = format!("; no step answers for {percent:.0} % of the stations like it");
            picked.words += &short;
        }
        picked
    }
}

/// The published choice with what the other source had.
fn beside(judged: &[Judged], mut published: Picked, other: &Picked) -> Picked {
    let row = &judged[other.row];
    published.words += &row.bound.map_or_else(
        || format!("; {} has no bound", named(row)),
        |bound| format!("; {} has a bound of {bound:.3} mm", named(row)),
    );
    published
}

/// The error that the grid adds to that of the model without one, and whether it helps at all, as text.
fn cost(row: &Judged) -> String {
    if row.held_out.is_no_help() {
        return "; a grid does not help here: on held-out stations the errors are no smaller with it".to_owned();
    }
    match row.held_out.excess() {
        Some((excess, error)) if excess > error => {
            let error = expanded(error);
            format!("; it leaves {excess:.3} ± {error:.3} mm more than the model without a grid")
        }
        _ => String::new(),
    }
}

fn named(row: &Judged) -> String {
    format!("{} mm, nodes {}, {}", row.step_mm, row.source.name(), row.interpolation.name())
}

/// The judged tables of a family, in the order of their steps. A step that is no multiple of a measured pitch, does not fit
/// or has the pitches of another is none of the family: the others have to hold without a gap.
fn tables_of(judged: &[Judged], family: (Source, Interpolation)) -> Vec<usize> {
    let of_family = |row: &Judged| {
        row.judgement == Judgement::Table
            && (row.source, row.interpolation) == family
            && row.lattice.is_some()
    };
    let mut rows: Vec<usize> =
        (0..judged.len()).filter(|&place| of_family(&judged[place])).collect();
    rows.sort_by(|&a, &b| judged[a].step_mm.total_cmp(&judged[b].step_mm));
    rows
}
