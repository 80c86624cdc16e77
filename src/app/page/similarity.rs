//! Similarity: semivariograms of the errors that each model leaves, with the functions fitted to them.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::io::rows::Word as _;
use crate::io::tables::semivariograms::SemivariogramRow;
use crate::report::Model;
use crate::report::chart::{Axis, Chart, Series};
use crate::similarity::{Alikeness, Quantity, Shape, Space};

const POINTS: u32 = 48;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let norms: Vec<&SemivariogramRow> =
        content.semivariograms.iter().filter(|row| row.axis == Quantity::Norm).collect();
    if norms.is_empty() {
        return None;
    }
    Some(html! {
        p {
            "Half the mean squared difference of the errors of two stations, against how far they are apart. A curve that rises "
            "from near the noise shows that near errors are alike, so that they can be interpolated; a flat one shows that there is "
            "nothing left to interpolate. Dots are bins of pairs, lines the model that fits best."
        }
        div.pair {
            figure { (chart(&norms, Space::Joint)) figcaption { "Apart in joint angles." } }
            figure { (chart(&norms, Space::Cartesian)) figcaption { "Apart in the work space." } }
        }
        (fits(&norms))
    })
}

fn chart(rows: &[&SemivariogramRow], space: Space) -> Markup {
    let of_space: Vec<&SemivariogramRow> =
        rows.iter().copied().filter(|row| row.space == space).collect();
    let mut models: Vec<Model> = of_space.iter().map(|row| row.errors).collect();
    models.dedup();
    let reach =
        of_space.iter().filter_map(|row| bin(row)).fold(0.0, |reach: f64, [h, _]| reach.max(h));
    let series = models.iter().map(|model| curve(&of_space, *model, reach));
    let noise = of_space.iter().find_map(|row| row.noise_mm2).filter(|noise| *noise > 0.0);
    let noise = noise.map(|noise| {
        Series::line("noise of the measurement", vec![[0.0, noise], [reach, noise]]).looking(4)
    });
    let (quantity, unit) = if space == Space::Joint {
        ("separation of joint angles", "rad")
    } else {
        ("separation in space", "mm")
    };
    Chart {
        title: format!("Semivariograms, {quantity}"),
        description: "Semivariance of errors against the separation of stations, by model."
            .to_owned(),
        x: Axis::new(quantity, unit).including(&[0.0]),
        y: Axis::new("semivariance", "mm²").logarithmic(),
        series: series.chain(noise).collect(),
        limits: Vec::new(),
    }
    .svg()
}

fn curve(rows: &[&SemivariogramRow], model: Model, reach: f64) -> Series {
    let own = || rows.iter().filter(|row| row.errors == model);
    let bins: Vec<[f64; 2]> = own().filter_map(|row| bin(row)).collect();
    let mut series = Series::points(model.about().name, bins).looking(model.about().look);
    let from = own().find_map(|row| bin(row)).map_or(0.0, |[h, _]| h);
    let line = own().find_map(|row| best(row, from, reach));
    series.marks.splice(0..0, line.map(crate::report::chart::Marks::Line));
    series
}

/// Mean separation of a bin's pairs and their semivariance, mm²; `None` for a fitted model.
fn bin(row: &SemivariogramRow) -> Option<[f64; 2]> {
    Some([row.separation?, row.gamma_mm2?])
}

struct Best {
    shape: Shape,
    nugget_mm2: f64,
    sill_mm2: f64,
    range: f64,
}

impl Best {
    /// The model of a row; `None` for a bin, and for a model that fits worse than another.
    fn of(row: &SemivariogramRow) -> Option<Self> {
        Some(Self {
            shape: row.variogram.filter(|_| row.best == Some(true))?,
            nugget_mm2: row.nugget_mm2?,
            sill_mm2: row.sill_mm2?,
            range: row.range?,
        })
    }
}

/// The curve of a fitted model between two separations, where it is the best.
fn best(row: &SemivariogramRow, from: f64, reach: f64) -> Option<Vec<[f64; 2]>> {
    let model = Best::of(row)?;
    let at = |place: u32| {
        let h = from + (reach - from) * f64::from(place) / f64::from(POINTS);
        let partial = model.sill_mm2 - model.nugget_mm2;
        [h, model.nugget_mm2 + partial * model.shape.at(h / model.range)]
    };
    Some((0..=POINTS).map(at).collect())
}

fn fits(rows: &[&SemivariogramRow]) -> Markup {
    let head = html! { th { "Errors of" } th.word { "Apart in" } th.word { "Model" } th { "Of stations side by side (nugget), mm²" } th { "Far apart (sill), mm²" } th { "Alike within (range)" } th { "Noise, mm²" } th.word { "Meaning" } };
    let body = html! {
        @for row in rows {
            @if let Some(Best { shape, nugget_mm2, sill_mm2, range }) = Best::of(row) {
                tr {
                    th.word scope="row" { (row.errors.about().name) }
                    td.word { @if row.space == Space::Joint { "joint angles" } @else { "space" } }
                    td.word { (shape.word()) }
                    td { (words::number(nugget_mm2, 5)) }
                    td { (words::number(sill_mm2, 5)) }
                    td { @if row.space == Space::Joint { (words::number(range, 2)) " rad" } @else { (words::number(range, 0)) " mm" } }
                    td { (words::optional(row.noise_mm2, 5)) }
                    td.word { (says(row.similarity)) }
                }
            }
        }
    };
    super::table(&head, &body)
}

const fn says(similarity: Alikeness) -> &'static str {
    match similarity {
        Alikeness::Rising => "near errors are alike",
        Alikeness::Flat => "nothing to interpolate",
        Alikeness::TooFewPairs => "too few pairs to judge",
    }
}
