//! Charts over the sessions: accuracy, places since the first session, moving averages.

use maud::{Markup, html};

use super::content::{Content, Point, Series};
use crate::page::words::fixed;
use crate::report::Model;
use crate::report::chart::{Axis, Chart, Limit, Marks, Series as Drawn};

const MOST: usize = 400;

pub(super) fn accuracy(content: &Content) -> Option<Markup> {
    let own: Vec<&Series> = content.series.iter().filter(|series| series.is_accuracy).collect();
    if own.is_empty() {
        return None;
    }
    let drawn = own.iter().map(|series| {
        let points = thinned(&series.points).map(|point| [point.session as f64, point.value]);
        Drawn::line_and_points(&named(&series.name), points.collect())
    });
    let chart = Chart {
        title: "Accuracy over the sessions".to_owned(),
        description: "Mean and 95th percentile of held-out position errors in each session, before and after.".to_owned(),
        x: Axis::of_whole_numbers("session", "no."),
        y: Axis::new("position error", "mm").including(&[0.0]),
        series: drawn.collect(),
        limits: Vec::new(),
    };
    Some(html! {
        p { "Position errors of held-out stations: before (base and target fitted) and predicted after." }
        figure { (chart.svg()) figcaption { "Mean and 95th percentile; sessions are numbered as in the table of changes." } }
    })
}

/// A series name such as `before base_target mean` in the words of the page.
pub(in crate::page) fn named(name: &str) -> String {
    let words: Vec<&str> = name.split(' ').collect();
    match words[..] {
        [moment, of, figure] => {
            let of = Model::of_word(of).map_or(of, |of| of.about().name);
            format!("{moment}, {of}: {figure}")
        }
        _ => name.to_owned(),
    }
}

/// One chart: its title, the prefixes of its series' names, its unit, and the number of such units in a mm or rad.
type Group = (&'static str, &'static [&'static str], &'static str, f64);

const GROUPS: [Group; 5] = [
    ("Base, place", &["base_x", "base_y", "base_z"], "mm", 1.0),
    ("Base, orientation", &["base_rx", "base_ry", "base_rz"], "mrad", 1e3),
    ("Target, place", &["target_x", "target_y", "target_z"], "mm", 1.0),
    ("Target, orientation", &["target_rx", "target_ry", "target_rz"], "mrad", 1e3),
    ("Joint offsets", &["theta_"], "mrad", 1e3),
];

pub(super) fn since_first(content: &Content) -> Option<Markup> {
    let figures: Vec<Markup> = GROUPS.iter().filter_map(|group| place(content, group)).collect();
    (!figures.is_empty()).then(|| {
        html! {
            p {
                "Change of each since the first session of its segment, all estimated together, with bands of two standard deviations, of both "
                "sessions together. The offset of the first joint is the base's rotation about its axis, that of the last joint the target's."
            }
            div.pair { @for figure in &figures { (figure) } }
        }
    })
}

fn place(content: &Content, (title, names, unit, scale): &Group) -> Option<Markup> {
    let is_own = |series: &&Series| names.iter().any(|name| series.name.starts_with(name));
    let own: Vec<&Series> =
        content.series.iter().filter(|series| !series.is_accuracy).filter(is_own).collect();
    if own.is_empty() {
        return None;
    }
    let chart = Chart {
        title: (*title).to_owned(),
        description: "Change since the first session, with bands of two standard deviations."
            .to_owned(),
        x: Axis::of_whole_numbers("session", "no."),
        y: Axis::new("since the first session", unit),
        series: own.iter().map(|series| banded(series, *scale)).collect(),
        limits: Vec::new(),
    };
    Some(html! { figure { (chart.svg()) figcaption { (title) } } })
}

fn banded(series: &Series, scale: f64) -> Drawn {
    let at = |point: &Point| point.session as f64;
    let line: Vec<[f64; 2]> =
        thinned(&series.points).map(|point| [at(point), scale * point.value]).collect();
    let band = thinned(&series.points).map(|point| {
        let half = 2.0 * point.sd.unwrap_or(0.0);
        [at(point), scale * (point.value - half), scale * (point.value + half)]
    });
    let band = Marks::Band(band.collect());
    Drawn::new(&series.name, vec![band, Marks::Line(line.clone()), Marks::Points(line)])
}

pub(super) fn control(content: &Content) -> Markup {
    let groups = [(true, "Accuracy figures"), (false, "Base, target and joint offsets")];
    let figures = groups.map(|(is_accuracy, caption)| {
        let own = content.series.iter().filter(|series| series.is_accuracy == is_accuracy);
        let averages = own.map(|series| Drawn::line(&named(&series.name), averages(series)));
        figure(caption, averages.collect())
    });
    html! {
        p {
            "Each figure is compared with mean and spread of those before it (self-starting scores), and the scores are averaged with exponential "
            "weights, 0.2 for the newest (EWMA). Drawn is the average over its limit: beyond ±1, and with a value as far off as the tolerance notices, it is out of control, and its chart starts again. "
            "All charts of the robot together leave their limits once in " (format!("{:.0}", 1.0 / content.false_alarm)) " sessions without a change, or less. "
            "A figure's first two sessions have no score."
        }
        div.pair { @for figure in &figures { (figure) } }
    }
}

/// Averages over their limits, thinned where there are many; an average that is out of control always stays.
fn averages(series: &Series) -> Vec<[f64; 2]> {
    let own = series.points.iter();
    let all = own.filter_map(|point| Some([point.session as f64, point.average?])).enumerate();
    let every = series.points.len().div_ceil(MOST).max(1);
    let kept =
        all.filter(|(place, [_, average])| place.is_multiple_of(every) || average.abs() > 1.0);
    kept.map(|(_, point)| point).collect()
}

fn figure(caption: &str, drawn: Vec<Drawn>) -> Markup {
    let limit = |value: f64| Limit { name: format!("limit {}", fixed(value, 0)), value };
    let chart = Chart {
        title: format!("Moving averages: {caption}"),
        description: "Exponentially weighted moving averages over their control limits.".to_owned(),
        x: Axis::of_whole_numbers("session", "no."),
        y: Axis::new("average over limit", "").including(&[-1.2, 1.2]),
        series: drawn,
        limits: vec![limit(1.0), limit(-1.0)],
    };
    html! { figure { (chart.svg()) figcaption { (caption) } } }
}

fn thinned(points: &[Point]) -> impl Iterator<Item = &Point> {
    points.iter().step_by(points.len().div_ceil(MOST).max(1))
}
