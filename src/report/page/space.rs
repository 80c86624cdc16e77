//! The work space before and after, how the errors are distributed, and in which order they came.

use maud::{Markup, html};

use super::content::{Content, Residual, Residuals, Subject};
use super::words;
use crate::report::chart::{Arrow, Axis, Chart, Limit, Series, Vectors, vectors};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let judged = judged(content)?;
    let before = set(content, judged, &["base_target"])?;
    let after = set(content, judged, &["full", "geometric"])?;
    let sets = [
        (
            "Before",
            before,
            "Errors with base and target fitted and nothing else corrected.",
        ),
        (
            "After",
            after,
            "Errors that are left when what the model predicts is subtracted.",
        ),
    ];
    let arrows = sets.map(|(name, set, description)| Vectors {
        name: name.to_owned(),
        description: format!("{description} {}.", words::stations(&set.subject)),
        arrows: counting(set).map(arrow).collect(),
        look: words::look(&set.subject.model),
    });
    Some(html! {
        p {
            "Before: " (words::subject(&before.subject)) ". After, predicted: what is left where the prediction of the "
            (words::subject(&after.subject)) " is subtracted. Stations of " (words::stations(&after.subject)) "; none of them took part in the fit."
        }
        (vectors(&arrows)?)
        div.pair {
            figure { (distribution(content, judged)) figcaption { "How these errors are distributed." } }
            figure { (order(before, after)) figcaption { "In the order of the stations: drift shows as a rise or fall along it." } }
        }
    })
}

/// The stations that judge: of an unseen session where there is one, otherwise of held-out blocks.
fn judged(content: &Content) -> Option<&Subject> {
    let ways = [
        ("session", "first"),
        ("session", "none"),
        ("blocks", "none"),
    ];
    let subjects = || content.residuals.iter().rev().map(|set| &set.subject);
    let of_way = |(split, refit): (&str, &str)| {
        subjects().find(|s| s.split == split && s.base_refit == refit)
    };
    ways.into_iter().find_map(of_way)
}

/// The first of `models` that these stations judge; from commands alone where that is there.
fn set<'c>(content: &'c Content, judged: &Subject, models: &[&str]) -> Option<&'c Residuals> {
    let alike = || {
        content
            .residuals
            .iter()
            .filter(|set| is_alike(&set.subject, judged))
    };
    let of_model = |model: &&str| {
        let own = || alike().filter(|set| set.subject.model == **model);
        let commanded = own().find(|set| set.subject.angles == "commanded");
        commanded.or_else(|| own().next())
    };
    models.iter().find_map(of_model)
}

fn is_alike(own: &Subject, judged: &Subject) -> bool {
    own.split == judged.split
        && own.of_session == judged.of_session
        && own.base_refit == judged.base_refit
}

/// Stations whose residuals count: those that the base was found from do not.
fn counting(set: &Residuals) -> impl Iterator<Item = &Residual> {
    set.stations
        .iter()
        .filter(|station| !station.used_for_refit)
}

fn arrow(residual: &Residual) -> Arrow {
    Arrow {
        at: residual.at,
        error: residual.error,
    }
}

fn norm(residual: &Residual) -> f64 {
    residual.error.iter().map(|e| e * e).sum::<f64>().sqrt()
}

fn distribution(content: &Content, judged: &Subject) -> Markup {
    let series = |model: &str| {
        let set = set(content, judged, &[model])?;
        let norms: Vec<f64> = counting(set).map(norm).collect();
        let name = words::subject(&set.subject);
        Some(Series::distribution(&name, &norms).looking(words::look(model)))
    };
    let models = ["base_target", "geometric", "full"];
    Chart {
        title: "Distribution of errors".to_owned(),
        description: "Share of held-out stations whose error is not above a value, by model."
            .to_owned(),
        x: Axis::new("error norm", "mm").including(&[0.0]),
        y: Axis::new("stations not above it", "%").including(&[0.0, 100.0]),
        series: models.into_iter().filter_map(series).collect(),
        limits: vec![Limit {
            name: format!("{} %", words::percent(content.tolerance.share)),
            value: 100.0 * content.tolerance.share,
        }],
    }
    .svg()
}

fn order(before: &Residuals, after: &Residuals) -> Markup {
    let series = |set: &Residuals| {
        let points = counting(set).map(|r| [r.station as f64, norm(r)]);
        let name = words::subject(&set.subject);
        Series::points(&name, points.collect()).looking(words::look(&set.subject.model))
    };
    Chart {
        title: "Errors in the order of the stations".to_owned(),
        description: "Error norm of each held-out station before and after, against its number."
            .to_owned(),
        x: Axis::new("station", ""),
        y: Axis::new("error norm", "mm").logarithmic(),
        series: vec![series(before), series(after)],
        limits: Vec::new(),
    }
    .svg()
}
