//! The work space before and after, the distribution of the errors, and the errors in the order of the stations.

use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::io::tables::accuracy::FigureName;
use crate::report::chart::{Arrow, Axis, Chart, Limit, Scene, Series, Vectors, vectors};
use crate::report::compared::{Compared, ErrorPair};
use crate::report::{Model, Split};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let pairs = [&content.said.pairs.measured, &content.said.pairs.predicted];
    let shown = pairs.map(|pair| shown(content, pair.as_ref()?));
    if content.said.table_state.is_none() && shown.iter().all(Option::is_none) {
        return None;
    }
    Some(html! {
        @if let Some(state) = &content.said.table_state { p.lead { strong { "This session was driven by a table: " (state) "." } } }
        @for shown in shown.iter().flatten() { (shown) }
    })
}

/// Mean errors of the tool tip before and after at the stations that a table drove.
fn at_tip(content: &Content) -> Option<[f64; 2]> {
    let mean = |model: Model| {
        let own = content.tip.iter().filter(|f| f.subject.split == Split::Session);
        let mut own = own.filter(|f| f.subject.model == model && f.name == FigureName::Mean);
        own.find_map(|figure| figure.value)
    };
    Some([mean(Model::RawCommand)?, mean(Model::Table)?])
}

/// Errors of a smaller share of those before are too short to be seen on the same scale.
const SMALL: f64 = 0.25;

/// Errors before and after, measured or predicted.
fn shown(content: &Content, compared: &Compared) -> Option<Markup> {
    let evidence = if compared.is_measured { "measured" } else { "predicted" };
    let sets = [
        drawn(compared, "Before", &compared.before, |pair| pair.before),
        drawn(compared, "After", &compared.after, |pair| pair.after),
    ];
    let scene = Scene { bounds: content.bounds, tolerance_mm: content.tolerance.mm };
    let [before, after] = compared.figures()?;
    let series = |name: &'static str, error: fn(&ErrorPair) -> nalgebra::Vector3<f64>| {
        let points = compared.errors.iter().map(|pair| [pair.station as f64, error(pair).norm()]);
        (name, points.collect::<Vec<_>>())
    };
    let both = [series("before", |pair| pair.before), series("after", |pair| pair.after)];
    Some(html! {
        p {
            strong { "Before" } " (" (compared.before) "): mean " (words::fixed(before.mean, 3)) " mm, largest " (words::fixed(before.max, 3))
            " mm. " strong { "After" } ", " (evidence) " (" (compared.after) "): mean " (words::fixed(after.mean, 3)) " mm, largest "
            (words::fixed(after.max, 3)) " mm. Both " (compared.frame) ", at " (compared.count()) " stations of " (compared.stations)
            "; none of them took part in what corrects them."
            @if let Some([before, after]) = at_tip(content).filter(|_| compared.is_measured) {
                " At the tool tip the mean error is " (words::number(before, 3)) " mm before and " (words::number(after, 3)) " mm after, measured "
                "with the commanded orientation."
            }
        }
        (vectors(&sets, &scene)?)
        @if after.max < SMALL * before.max {
            p { "The errors after once more, on a scale of their own:" }
            (vectors(&[Vectors { name: "After, larger".to_owned(), ..sets[1].clone() }], &scene)?)
        }
        div.pair {
            figure { (distribution(content, &both)) figcaption { "Distribution of these errors." } }
            figure { (order(&both)) figcaption { "In the order of the stations: drift shows as a rise or fall along it." } }
        }
    })
}

fn drawn(
    compared: &Compared,
    name: &str,
    of: &str,
    error: impl Fn(&ErrorPair) -> nalgebra::Vector3<f64>,
) -> Vectors {
    let arrow = |pair: &ErrorPair| Arrow { at: pair.at.into(), error: error(pair).into() };
    Vectors {
        name: name.to_owned(),
        description: format!("Errors: {of}, {}, {}.", compared.frame, compared.stations),
        arrows: compared.errors.iter().map(arrow).collect(),
    }
}

/// The distributions of the errors before and after, in the same looks as in every chart here.
fn distribution(content: &Content, both: &[(&str, Vec<[f64; 2]>); 2]) -> Markup {
    let numbered = both.iter().enumerate();
    let series = numbered.map(|(place, (name, points))| {
        let norms: Vec<f64> = points.iter().map(|[_, norm]| *norm).collect();
        Series::distribution(name, &norms).looking(1 - place)
    });
    Chart {
        title: "Distribution of errors".to_owned(),
        description: "Share of stations whose error is not above a value, before and after."
            .to_owned(),
        x: Axis::new("error norm", "mm").including(&[0.0]),
        y: Axis::new("stations not above it", "%").including(&[0.0, 100.0]),
        series: series.collect(),
        limits: vec![Limit {
            name: format!("{} %", words::percent(content.tolerance.share)),
            value: 100.0 * content.tolerance.share,
        }],
    }
    .svg()
}

fn order(both: &[(&str, Vec<[f64; 2]>); 2]) -> Markup {
    let numbered = both.iter().enumerate();
    let series = numbered
        .map(|(place, (name, points))| Series::points(name, points.clone()).looking(1 - place));
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
