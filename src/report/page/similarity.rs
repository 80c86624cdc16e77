//! Similarity: semivariograms of what each model leaves, with the models fitted to them.

use maud::{Markup, html};

use super::content::{Content, Variogram, VariogramEntry};
use super::words;
use crate::report::chart::{Axis, Chart, Series};
use crate::similarity::Shape;

/// Points that a fitted curve is drawn by.
const POINTS: u32 = 48;

pub(super) fn section(content: &Content) -> Option<Markup> {
    let norms: Vec<&Variogram> = content
        .semivariograms
        .iter()
        .filter(|row| row.axis == "norm")
        .collect();
    if norms.is_empty() {
        return None;
    }
    Some(html! {
        p {
            "Half the mean squared difference of the errors of two stations, against how far they are apart. A curve that rises "
            "from near the noise says that near errors are alike, so that they can be interpolated; a flat one says there is "
            "nothing left to interpolate. Dots are bins of pairs, lines the model that fits best."
        }
        div.pair {
            figure { (chart(&norms, "joint")) figcaption { "Apart in joint angles." } }
            figure { (chart(&norms, "cartesian")) figcaption { "Apart in the work space." } }
        }
        (fits(&norms))
    })
}

fn chart(rows: &[&Variogram], space: &str) -> Markup {
    let of_space: Vec<&Variogram> = rows
        .iter()
        .copied()
        .filter(|row| row.space == space)
        .collect();
    let mut models: Vec<&str> = of_space.iter().map(|row| row.errors.as_str()).collect();
    models.dedup();
    let reach = of_space
        .iter()
        .filter_map(|row| row.bin())
        .fold(0.0, |reach: f64, [h, _]| reach.max(h));
    let series = models.iter().map(|model| curve(&of_space, model, reach));
    let noise = of_space
        .iter()
        .find_map(|row| row.noise_mm2)
        .filter(|noise| *noise > 0.0);
    let noise = noise.map(|noise| {
        Series::line(
            "noise of the measurement",
            vec![[0.0, noise], [reach, noise]],
        )
        .looking(4)
    });
    let (quantity, unit) = if space == "joint" {
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

fn curve(rows: &[&Variogram], model: &str, reach: f64) -> Series {
    let own = || rows.iter().filter(|row| row.errors == model);
    let bins: Vec<[f64; 2]> = own().filter_map(|row| row.bin()).collect();
    let mut series = Series::points(words::model(model), bins).looking(words::look(model));
    let from = own().find_map(|row| row.bin()).map_or(0.0, |[h, _]| h);
    let line = own().find_map(|row| row.best(from, reach));
    series
        .marks
        .splice(0..0, line.map(crate::report::chart::Marks::Line));
    series
}

impl Variogram {
    fn bin(&self) -> Option<[f64; 2]> {
        match self.entry {
            VariogramEntry::Bin {
                separation,
                gamma_mm2,
            } => Some([separation, gamma_mm2]),
            VariogramEntry::Fitted { .. } => None,
        }
    }

    /// The curve of a fitted model between two separations, where it is the best.
    fn best(&self, from: f64, reach: f64) -> Option<Vec<[f64; 2]>> {
        let VariogramEntry::Fitted {
            shape,
            nugget_mm2,
            sill_mm2,
            range,
            best: true,
        } = &self.entry
        else {
            return None;
        };
        let shape = match shape.as_str() {
            "spherical" => Shape::Spherical,
            "exponential" => Shape::Exponential,
            _ => Shape::Gaussian,
        };
        let at = |place: u32| {
            let h = from + (reach - from) * f64::from(place) / f64::from(POINTS);
            [
                h,
                nugget_mm2 + (sill_mm2 - nugget_mm2) * shape.at(h / range),
            ]
        };
        Some((0..=POINTS).map(at).collect())
    }
}

fn fits(rows: &[&Variogram]) -> Markup {
    let head = html! { th { "Errors of" } th.word { "Apart in" } th.word { "Model" } th { "Nugget, mm²" } th { "Sill, mm²" } th { "Range" } th { "Noise, mm²" } th.word { "Says" } };
    let body = html! {
        @for row in rows {
            @if let VariogramEntry::Fitted { shape, nugget_mm2, sill_mm2, range, best: true } = &row.entry {
                tr {
                    th.word scope="row" { (words::model(&row.errors)) }
                    td.word { @if row.space == "joint" { "joint angles" } @else { "space" } }
                    td.word { (shape) }
                    td { (words::number(*nugget_mm2, 5)) }
                    td { (words::number(*sill_mm2, 5)) }
                    td { @if row.space == "joint" { (words::number(*range, 2)) " rad" } @else { (words::number(*range, 0)) " mm" } }
                    td { (words::optional(row.noise_mm2, 5)) }
                    td.word { (says(&row.similarity)) }
                }
            }
        }
    };
    super::table(&head, &body)
}

fn says(similarity: &str) -> &str {
    match similarity {
        "similar" => "near errors are alike",
        "flat" => "nothing to interpolate",
        _ => "too few pairs to tell",
    }
}
