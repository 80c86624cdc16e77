//! `semivariograms`: bins of the empirical semivariograms, and the models fitted to them.

use super::{PublishError, words};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;
use crate::report::Model;
use crate::similarity::{Alikeness, Bin, Quantity, Semivariogram, Shape, Space, VariogramModel};

/// One row: a bin, or a fitted model and whether it is the best.
struct Row<'a> {
    errors: Model,
    of: &'a Semivariogram,
    entry: Entry<'a>,
}

enum Entry<'a> {
    Bin(&'a Bin),
    Fitted(&'a VariogramModel, bool),
}

/// The table of all semivariograms; `noise_mm2` is the variance of one axis that a nugget is held against.
pub fn semivariograms(
    found: &[(Model, Vec<Semivariogram>)],
    noise_mm2: Option<f64>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let rows: Vec<Row<'_>> = found
        .iter()
        .flat_map(|(errors, all)| all.iter().flat_map(move |of| entries(*errors, of)))
        .collect();
    let noise = |row: &Row<'_>| noise_mm2.map(|noise| noise * axes(row.of.quantity));
    let table = Columns::new(schema::find("semivariograms")?, rows.len())
        .key(key)
        .column("space", rows.iter().map(|row| space(row.of.space).0))
        .column("errors", rows.iter().map(|row| words::model(row.errors)))
        .column("axis", rows.iter().map(|row| axis(row.of.quantity)))
        .column(
            "separation_unit",
            rows.iter().map(|row| space(row.of.space).1),
        )
        .column("noise_mm2", rows.iter().map(noise))
        .column(
            "similarity",
            rows.iter().map(|row| similarity(row.of.alikeness)),
        );
    Ok(fitted(bins(table, &rows), &rows).finish()?)
}

fn entries(errors: Model, of: &Semivariogram) -> impl Iterator<Item = Row<'_>> {
    let fitted = |(place, model)| Entry::Fitted(model, place == 0);
    let models = of.models.iter().enumerate().map(fitted);
    let entries = of.bins.iter().map(Entry::Bin).chain(models);
    entries.map(move |entry| Row { errors, of, entry })
}

impl Row<'_> {
    fn bin(&self) -> Option<&Bin> {
        match self.entry {
            Entry::Bin(bin) => Some(bin),
            Entry::Fitted(..) => None,
        }
    }

    fn fitted(&self) -> Option<&VariogramModel> {
        match self.entry {
            Entry::Bin(_) => None,
            Entry::Fitted(model, _) => Some(model),
        }
    }

    fn pairs(&self) -> u64 {
        let all = || self.of.bins.iter().map(|bin| bin.pairs).sum();
        self.bin().map_or_else(all, |bin| bin.pairs)
    }

    fn best(&self) -> Option<bool> {
        match self.entry {
            Entry::Bin(_) => None,
            Entry::Fitted(_, best) => Some(best),
        }
    }
}

fn bins(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let bins = || rows.iter().map(Row::bin);
    let entry = |row: &Row<'_>| if row.bin().is_some() { "bin" } else { "fitted" };
    columns
        .column("entry", rows.iter().map(entry))
        .column("bin", bins().map(|bin| bin.map(number)))
        .column(
            "separation_lower",
            bins().map(|bin| bin.map(|bin| bin.from)),
        )
        .column("separation_upper", bins().map(|bin| bin.map(|bin| bin.to)))
        .column(
            "separation",
            bins().map(|bin| bin.map(|bin| bin.separation)),
        )
        .column("pairs", rows.iter().map(Row::pairs))
        .column("gamma_mm2", bins().map(|bin| bin.map(|bin| bin.gamma)))
}

fn fitted(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let models = || rows.iter().map(Row::fitted);
    columns
        .column(
            "variogram",
            models().map(|model| model.map(|model| shape(model.shape))),
        )
        .column(
            "nugget_mm2",
            models().map(|model| model.map(|model| model.nugget)),
        )
        .column(
            "sill_mm2",
            models().map(|model| model.map(|model| model.sill)),
        )
        .column(
            "range",
            models().map(|model| model.map(|model| model.range)),
        )
        .column(
            "misfit_mm2",
            models().map(|model| model.map(|model| model.misfit.sqrt())),
        )
        .column("best", rows.iter().map(Row::best))
}

/// Bins are of equal width from 0, and those without pairs are left out.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a small count; the cast saturates"
)]
fn number(bin: &Bin) -> i64 {
    (bin.from / (bin.to - bin.from)).round() as i64
}

/// Axes that a quantity sums over.
const fn axes(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::X | Quantity::Y | Quantity::Z => 1.0,
        Quantity::Norm => 3.0,
    }
}

const fn axis(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::X => "x",
        Quantity::Y => "y",
        Quantity::Z => "z",
        Quantity::Norm => "norm",
    }
}

/// The space's word and the unit of its separations.
const fn space(space: Space) -> (&'static str, &'static str) {
    match space {
        Space::Joint => ("joint", "rad"),
        Space::Cartesian => ("cartesian", "mm"),
    }
}

const fn shape(shape: Shape) -> &'static str {
    match shape {
        Shape::Spherical => "spherical",
        Shape::Exponential => "exponential",
        Shape::Gaussian => "gaussian",
    }
}

const fn similarity(alikeness: Alikeness) -> &'static str {
    match alikeness {
        Alikeness::Rising => "similar",
        Alikeness::Flat => "flat",
        Alikeness::TooFewPairs => "not_shown",
    }
}
