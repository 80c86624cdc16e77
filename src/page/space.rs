//! The work space before and after, the distribution of the errors, and the errors in the order of the stations.

use maud::{Markup, html};

use super::content::{Content, Residuals};
use super::words;
use crate::io::tables::accuracy::FigureName;
use crate::io::tables::residuals::ResidualRow;
use crate::report::chart::{Arrow, Axis, Chart, Limit, Scene, Series, Vectors, vectors};
use crate::report::compared::{Compared, ErrorPair};
use crate::report::{Angles, BaseRefit, Model, Split, Subject};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let predicted = predicted(content);
    let measured = driven(content).and_then(|driven| measured(content, driven));
    if content.table_state.is_none() && predicted.is_none() && measured.is_none() {
        return None;
    }
    Some(html! {
        @if let Some(state) = &content.table_state { p.lead { strong { "This session was driven by a table: " (state) "." } } }
        @if let Some(measured) = measured { (measured) }
        @if let Some(predicted) = predicted { (predicted) }
    })
}

/// What the errors are drawn in.
const fn scene(content: &Content) -> Scene {
    Scene {
        bounds: content.bounds,
        tolerance_mm: content.tolerance.mm,
    }
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
    let [before_name, after_name] = ["before", "after, measured"];
    Some(html! {
        p {
            (n) " stations other than those that the base was found from were measured: the distance of the tool point from its "
            "command (before) and from its target pose (after, measured), on one scale."
            @if let Some([before, after]) = at_tip(content) {
                " At the tool tip the mean error is " (words::number(before, 3)) " mm before and " (words::number(after, 3)) " mm after, measured "
                "with the commanded orientation."
            }
        }
        (vectors(&arrows(sets), &scene(content))?)
        figure { (order(&[(before_name, norms(before)), (after_name, norms(after))])) figcaption { "The same errors in the order of the stations." } }
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
    })
}

/// Number of each station that counts, with its error norm.
fn norms(set: &Residuals) -> Vec<[f64; 2]> {
    let norms = counting(set).map(|own| [own.station as f64, norm(own)]);
    norms.collect()
}

/// The errors before and after that the headline is of.
fn predicted(content: &Content) -> Option<Markup> {
    let compared = content.compared.as_ref()?;
    let sets = [
        drawn(compared, "Before", &compared.before, |pair| pair.before),
        drawn(compared, "After", &compared.after, |pair| pair.after),
    ];
    let [before, after] = compared.figures()?;
    let series = |name: &str, error: fn(&ErrorPair) -> [f64; 3]| {
        let pairs = compared.errors.iter();
        let points = pairs.map(|pair| [pair.station as f64, length(error(pair))]);
        (name.to_owned(), points.collect::<Vec<_>>())
    };
    let both = [
        series("before", |pair| pair.before.into()),
        series("after", |pair| pair.after.into()),
    ];
    Some(html! {
        p {
            strong { "Before" } " (" (compared.before) "): mean " (words::fixed(before.mean, 3)) " mm, largest " (words::fixed(before.max, 3))
            " mm. " strong { "After" } ", predicted (" (compared.after) "): mean " (words::fixed(after.mean, 3)) " mm, largest "
            (words::fixed(after.max, 3)) " mm. Both " (compared.frame) ", at " (compared.count()) " stations of " (compared.stations)
            "; none of them took part in what corrects them."
        }
        (vectors(&sets, &scene(content))?)
        div.pair {
            figure { (distribution(content, compared, &both)) figcaption { "Distribution of these errors, and of those that the models leave on stations that took no part." } }
            figure { (order(&both.each_ref().map(|(name, points)| (&**name, points.clone())))) figcaption { "In the order of the stations: drift shows as a rise or fall along it." } }
        }
    })
}

/// One state of the errors of the headline.
fn drawn(
    compared: &Compared,
    name: &str,
    of: &str,
    error: impl Fn(&ErrorPair) -> nalgebra::Vector3<f64>,
) -> Vectors {
    let arrow = |pair: &ErrorPair| Arrow {
        at: pair.at.into(),
        error: error(pair).into(),
    };
    Vectors {
        name: name.to_owned(),
        description: format!("Errors: {of}, {}, {}.", compared.frame, compared.stations),
        arrows: compared.errors.iter().map(arrow).collect(),
    }
}

/// The stations of a session that a table drove.
fn driven(content: &Content) -> Option<&Subject> {
    let mut subjects = content.residuals.iter().map(|set| &set.subject);
    subjects.find(|subject| subject.model == Model::Table)
}

/// The stations that judge: those of an unseen session where there is one, otherwise those of held-out blocks.
fn judged(content: &Content) -> Option<&Subject> {
    let subjects = || {
        let sets = content.residuals.iter().rev().map(|set| &set.subject);
        sets.filter(|subject| !subject.model.is_against_commands())
    };
    let is_own_base = |own: &&Subject| !matches!(own.base_refit, BaseRefit::None | BaseRefit::All);
    let sessions = || subjects().filter(|own| own.split == Split::Session);
    sessions()
        .find(is_own_base)
        .or_else(|| subjects().find(|own| own.split == Split::Blocks))
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
    length(residual.residual)
}

fn length(error: [f64; 3]) -> f64 {
    error.iter().map(|e| e * e).sum::<f64>().sqrt()
}

/// The distributions of the errors before and after, and of what the models leave at the stations that judge them.
fn distribution(
    content: &Content,
    compared: &Compared,
    both: &[(String, Vec<[f64; 2]>)],
) -> Markup {
    let judged = judged(content);
    let shown = [&compared.before, &compared.after];
    let of_model = |model: Model| {
        let set = set(content, judged?, &[model])?;
        let norms: Vec<f64> = counting(set).map(norm).collect();
        let name = words::subject(&set.subject);
        (!shown.contains(&&name)).then(|| Series::distribution(&name, &norms))
    };
    let of_both = both.iter().map(|(name, points)| {
        let norms: Vec<f64> = points.iter().map(|[_, norm]| *norm).collect();
        Series::distribution(name, &norms)
    });
    let models = [Model::BaseTarget, Model::Geometric, Model::Full];
    let models = models.into_iter().filter_map(of_model);
    let numbered = of_both.chain(models).enumerate();
    Chart {
        title: "Distribution of errors".to_owned(),
        description: "Share of stations that took no part whose error is not above a value, before, after and by model."
            .to_owned(),
        x: Axis::new("error norm", "mm").including(&[0.0]),
        y: Axis::new("stations not above it", "%").including(&[0.0, 100.0]),
        series: numbered
            .map(|(place, series)| series.looking(look(place)))
            .collect(),
        limits: vec![Limit {
            name: format!("{} %", words::percent(content.tolerance.share)),
            value: 100.0 * content.tolerance.share,
        }],
    }
    .svg()
}

/// The look of errors before (0), after (1) and of further series, the same in every chart here.
const fn look(place: usize) -> usize {
    match place {
        0 => 1,
        1 => 0,
        more => more,
    }
}

fn order(both: &[(&str, Vec<[f64; 2]>); 2]) -> Markup {
    let numbered = both.iter().enumerate();
    let series = numbered
        .map(|(place, (name, points))| Series::points(name, points.clone()).looking(look(place)));
    Chart {
        title: "Errors in the order of the stations".to_owned(),
        description: "Error norm of each station before and after, against its number.".to_owned(),
        x: Axis::new("station", ""),
        y: Axis::new("error norm", "mm").logarithmic(),
        series: series.collect(),
        limits: Vec::new(),
    }
    .svg()
}
