//! The work space before and after, and how the errors are distributed.

use maud::{Markup, html};

use super::content::{Content, Residual, Subject};
use super::words;
use crate::report::chart::{Arrow, Axis, Chart, Limit, Series, Vectors, vectors};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let judged = judged(content)?;
    let before = set(content, &judged, &["base_target"])?;
    let after = set(content, &judged, &["full", "geometric"])?;
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
    let arrows = sets.map(|(name, subject, description)| Vectors {
        name: name.to_owned(),
        description: format!("{description} {}.", words::stations(subject)),
        arrows: of(content, subject)
            .map(|r| Arrow {
                at: r.at,
                error: r.error,
            })
            .collect(),
    });
    Some(html! {
        p {
            "Before: " (words::subject(before)) ". After, predicted: what is left where the " (words::subject(after))
            " is subtracted. Stations: " (words::stations(after)) "; none of them took part in the fit."
        }
        (vectors(&arrows)?)
        figure { (distribution(content, &judged)) figcaption { "How the same errors are distributed." } }
    })
}

/// The stations that judge: of an unseen session where there is one, otherwise of held-out blocks.
fn judged(content: &Content) -> Option<Subject> {
    let ways = [
        ("session", "first"),
        ("session", "none"),
        ("blocks", "none"),
    ];
    let of_way = |(split, refit): (&str, &str)| {
        let is_so = |r: &&Residual| r.subject.split == split && r.subject.base_refit == refit;
        content
            .residuals
            .iter()
            .rev()
            .find(is_so)
            .map(|r| r.subject.clone())
    };
    ways.into_iter().find_map(of_way)
}

/// The first of `models` that these stations judge; from commands alone where that is there.
fn set<'c>(content: &'c Content, judged: &Subject, models: &[&str]) -> Option<&'c Subject> {
    let alike = || {
        content
            .residuals
            .iter()
            .map(|r| &r.subject)
            .filter(|own| is_alike(own, judged))
    };
    let of_model = |model: &&str| {
        let own = || alike().filter(|subject| subject.model == **model);
        own()
            .find(|subject| subject.angles == "commanded")
            .or_else(|| own().next())
    };
    models.iter().find_map(of_model)
}

fn is_alike(own: &Subject, judged: &Subject) -> bool {
    (&own.split, &own.of_session, &own.base_refit)
        == (&judged.split, &judged.of_session, &judged.base_refit)
}

/// Stations whose residuals count: those that the base was found from do not.
fn of<'c>(content: &'c Content, subject: &'c Subject) -> impl Iterator<Item = &'c Residual> {
    content
        .residuals
        .iter()
        .filter(move |r| r.subject == *subject && !r.used_for_refit)
}

fn distribution(content: &Content, judged: &Subject) -> Markup {
    let series = |model: &str| {
        let subject = set(content, judged, &[model])?;
        let norms: Vec<f64> = of(content, subject)
            .map(|r| r.error.iter().map(|e| e * e).sum::<f64>().sqrt())
            .collect();
        Some(Series::distribution(&words::subject(subject), &norms).looking(words::look(model)))
    };
    Chart {
        title: "Distribution of errors".to_owned(),
        description: "Share of held-out stations whose error is not above a value, by model."
            .to_owned(),
        x: Axis::new("error norm", "mm").including(&[0.0]),
        y: Axis::new("stations not above it", "%").including(&[0.0, 100.0]),
        series: ["base_target", "geometric", "full"]
            .into_iter()
            .filter_map(series)
            .collect(),
        limits: vec![Limit {
            name: format!("{} %", words::percent(content.tolerance.share)),
            value: 100.0 * content.tolerance.share,
        }],
    }
    .svg()
}
