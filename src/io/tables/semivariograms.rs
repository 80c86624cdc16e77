//! `semivariograms`: bins of the empirical semivariograms, and the models fitted to them.

use super::words::Unit;
use crate::report::Model;
use crate::rows::{row, words};
use crate::similarity::{Alikeness, Bin, Quantity, Semivariogram, Shape, Space, VariogramModel};

row! {
    /// A bin of a semivariogram, or a model fitted to its bins: the columns of the other are absent.
    pub struct SemivariogramRow of "semivariograms" {
        space: Space,
        errors: Model,
        axis: Quantity,
        entry: Entry,
        bin: Option<i64>,
        variogram: Option<Shape>,
        separation_unit: Unit,
        separation_lower: Option<f64>,
        separation_upper: Option<f64>,
        separation: Option<f64>,
        pairs: u64,
        gamma_mm2: Option<f64>,
        nugget_mm2: Option<f64>,
        sill_mm2: Option<f64>,
        range: Option<f64>,
        misfit_mm2: Option<f64>,
        best: Option<bool>,
        noise_mm2: Option<f64>,
        similarity: Alikeness,
    }
}

words! {
    pub enum Entry {
        Bin: "bin",
        Fitted: "fitted",
    }
}

/// The rows of all semivariograms; `noise_mm2` is the variance of one axis that a nugget is compared with.
pub fn rows(
    found: &[(Model, Vec<Semivariogram>)],
    noise_mm2: Option<f64>,
) -> Vec<SemivariogramRow> {
    let of_model = |(errors, all): &(Model, Vec<Semivariogram>)| -> Vec<SemivariogramRow> {
        let rows = all.iter().flat_map(|of| entries(*errors, of, noise_mm2));
        rows.collect()
    };
    found.iter().flat_map(of_model).collect()
}

fn entries(errors: Model, of: &Semivariogram, noise_mm2: Option<f64>) -> Vec<SemivariogramRow> {
    let noise_mm2 = noise_mm2.map(|noise| noise * axes(of.quantity));
    let row =
        |entry, bin, model| SemivariogramRow { noise_mm2, ..row(errors, of, entry, bin, model) };
    let bins = of.bins.iter().map(|bin| row(Entry::Bin, Some(bin), None));
    let models = of.models.iter().enumerate();
    let models = models.map(|(place, model)| SemivariogramRow {
        best: Some(place == 0),
        ..row(Entry::Fitted, None, Some(model))
    });
    bins.chain(models).collect()
}

fn row(
    errors: Model,
    of: &Semivariogram,
    entry: Entry,
    bin: Option<&Bin>,
    model: Option<&VariogramModel>,
) -> SemivariogramRow {
    SemivariogramRow {
        space: of.space,
        errors,
        axis: of.quantity,
        entry,
        bin: bin.map(number),
        variogram: model.map(|own| own.shape),
        separation_unit: match of.space {
            Space::Joint => Unit::Rad,
            Space::Cartesian => Unit::Mm,
        },
        separation_lower: bin.map(|own| own.from),
        separation_upper: bin.map(|own| own.to),
        separation: bin.map(|own| own.separation),
        pairs: bin.map_or_else(|| of.bins.iter().map(|bin| bin.pairs).sum(), |own| own.pairs),
        gamma_mm2: bin.map(|own| own.gamma),
        nugget_mm2: model.map(|own| own.nugget),
        sill_mm2: model.map(|own| own.sill),
        range: model.map(|own| own.range),
        misfit_mm2: model.map(|own| own.misfit.sqrt()),
        best: None,
        noise_mm2: None,
        similarity: of.alikeness,
    }
}

/// Bins are of equal width from 0, and those without pairs are left out.
#[expect(clippy::cast_possible_truncation, reason = "a small count; the cast saturates")]
fn number(bin: &Bin) -> i64 {
    (bin.from / (bin.to - bin.from)).round() as i64
}

const fn axes(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::X | Quantity::Y | Quantity::Z => 1.0,
        Quantity::Norm => 3.0,
    }
}
