//! The work space before and after, the distribution of the errors, and the errors in the order of the stations.

use maud::{Markup, html};

use super::content::{Content, Residuals};
use super::words;
use crate::io::tables::accuracy::FigureName;
use crate::io::tables::residuals::ResidualRow;
use crate::report::chart::{Arrow, Axis, Chart, Limit, Series, Vectors, vectors};
use crate::report::{Angles, BaseRefit, Model, Split, Subject};

pub(super) fn section(content: &Content) -> Option<Markup> {
    Some(html! {
        @if let Some(state) = &content.table_state { p.lead { strong { "This session was driven by a table: " (state) "." } } }
        @if let Some(driven) = driven(content) { (measured(content, driven)?) }
        (predicted(content)?)
    })
}

/// The errors that a table left in the session that it drove: only these errors after a correction are measured.
fn measured(content: &Content, driven: &Subject) -> Option<Markup> {
    let before = set(content, driven, &[Model::RawCommand])?;
    let after = set(content, driven, &[Model::Table])?;
    let sets = [
        (
            "Before",
            before,
            "Errors against the commands, as the arm makes them.",
        ),
        (
            "After, measured",
            after,
            "Errors against the targets, which the commands were corrected for.",
        ),
    ];
    let n = counting(after).count();
    Some(html! {
        p {
            (n) " stations other than those that the base was found from were measured: the distance of the tool point from its "
            "command (before) and from its target pose (after, measured), on one scale."
            @if let Some([before, after]) = at_tip(content) {
                " At the tool tip the mean error is " (words::number(before, 3)) " mm before and " (words::number(after, 3)) " mm after, measured "
                "with the commanded orientation."
            }
        }
        (vectors(&arrows(sets))?)
        figure { (order(before, after)) figcaption { "The same errors in the order of the stations." } }
    })
}

/// Mean errors of the tool tip before and after at the stations that a table drove.
fn at_tip(content: &Content) -> Option<[f64; 2]> {
    let mean = |model: Model| {
        let own = content.tip.iter().filter(|f| f.split == Split::Session);
        let mut own = own.filter(|f| f.model == model && f.name == FigureName::Mean);
        own.find_map(|figure| figure.value)
    };
    Some([mean(Model::RawCommand)?, mean(Model::Table)?])
}

fn arrows<const N: usize>(sets: [(&str, &Residuals, &str); N]) -> [Vectors; N] {
    sets.map(|(name, set, description)| Vectors {
        name: name.to_owned(),
        description: format!("{description} {}.", words::stations(&set.subject)),
        arrows: counting(set).map(arrow).collect(),
        look: words::look(set.subject.model),
    })
}

fn predicted(content: &Content) -> Option<Markup> {
    let judged = judged(content)?;
    let before = set(content, judged, &[Model::BaseTarget])?;
    let best: Vec<Model> = Model::serving().collect();
    let after = set(content, judged, &best)?;
    let sets = [
        (
            "Before",
            before,
            "Errors with base and target fitted and nothing else corrected.",
        ),
        (
            "After",
            after,
            "Errors that are left when the model's prediction is subtracted.",
        ),
    ];
    Some(html! {
        p {
            "Before: " (words::subject(&before.subject)) ". After, predicted: the error left where the prediction of the "
            (words::subject(&after.subject)) " is subtracted. Stations of " (words::stations(&after.subject)) "; none of them took part in the fit."
        }
        (vectors(&arrows(sets))?)
        div.pair {
            figure { (distribution(content, judged)) figcaption { "Distribution of these errors." } }
            figure { (order(before, after)) figcaption { "In the order of the stations: drift shows as a rise or fall along it." } }
        }
    })
}

/// The stations of a session that a table drove.
fn driven(content: &Content) -> Option<&Subject> {
    let mut subjects = content.residuals.iter().map(|set| &set.subject);
    subjects.find(|subject| subject.model == Model::Table)
}

/// The stations that judge: those of an unseen session where there is one, otherwise those of held-out blocks.
fn judged(content: &Content) -> Option<&Subject> {
    let ways = [
        (Split::Session, BaseRefit::Chosen),
        (Split::Session, BaseRefit::First),
        (Split::Session, BaseRefit::None),
        (Split::Blocks, BaseRefit::None),
    ];
    let subjects = || {
        let sets = content.residuals.iter().rev().map(|set| &set.subject);
        sets.filter(|subject| !subject.model.is_against_commands())
    };
    let of_way = |(split, refit)| subjects().find(|s| s.split == split && s.base_refit == refit);
    ways.into_iter().find_map(of_way)
}

/// The residuals of the first of `models` that these stations judge; from commands alone where these exist.
fn set<'c>(content: &'c Content, judged: &Subject, models: &[Model]) -> Option<&'c Residuals> {
    let alike = || {
        content
            .residuals
            .iter()
            .filter(|set| is_alike(&set.subject, judged))
    };
    let of_model = |model: &Model| {
        let own = || alike().filter(|set| set.subject.model == *model);
        let commanded = own().find(|set| set.subject.angles == Angles::Commanded);
        commanded.or_else(|| own().next())
    };
    models.iter().find_map(of_model)
}

fn is_alike(own: &Subject, judged: &Subject) -> bool {
    own.split == judged.split
        && own.of_session == judged.of_session
        && own.base_refit == judged.base_refit
}

/// Stations whose residuals count: all but those that the base was found from.
fn counting(set: &Residuals) -> impl Iterator<Item = &ResidualRow> {
    set.stations
        .iter()
        .filter(|station| !station.used_for_refit)
}

fn arrow(residual: &ResidualRow) -> Arrow {
    Arrow {
        at: residual.at,
        error: residual.residual,
    }
}

fn norm(residual: &ResidualRow) -> f64 {
    residual.residual.iter().map(|e| e * e).sum::<f64>().sqrt()
}

fn distribution(content: &Content, judged: &Subject) -> Markup {
    let series = |model: Model| {
        let set = set(content, judged, &[model])?;
        let norms: Vec<f64> = counting(set).map(norm).collect();
        let name = words::subject(&set.subject);
        Some(Series::distribution(&name, &norms).looking(words::look(model)))
    };
    let models = Model::ALL.iter().copied();
    let models = models.filter(|model| !model.about().angles.is_empty());
    Chart {
        title: "Distribution of errors".to_owned(),
        description: "Share of held-out stations whose error is not above a value, by model."
            .to_owned(),
        x: Axis::new("error norm", "mm").including(&[0.0]),
        y: Axis::new("stations not above it", "%").including(&[0.0, 100.0]),
        series: models.filter_map(series).collect(),
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
        Series::points(&name, points.collect()).looking(words::look(set.subject.model))
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
