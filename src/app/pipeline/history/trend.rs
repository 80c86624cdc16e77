//! The history of a robot → its trend page.

use std::collections::BTreeMap;

use super::{RobotHistory, RunResult};
use crate::history::FALSE_ALARM;
use crate::io::lake::{Lake, LakeError, PAGES};
use crate::io::rows::Word as _;
use crate::io::tables::past::{Figure, Kind, PastSession};
use crate::io::tables::words::{TableVerdict, Unit};
use crate::page::history::content::{Content, Curve, Parameter, Point, Series, Session};
use crate::page::history::html;
use crate::units::WallTime;

/// The page; `figures` are those of each session. In the folder of `linked`, the lake, it leads to the pages of runs.
pub fn trend(
    robot: &RobotHistory,
    figures: &[Vec<Figure>],
    linked: Option<&Lake>,
) -> Result<String, LakeError> {
    Ok(html(&Content {
        robot: robot.robot.clone(),
        false_alarm: FALSE_ALARM,
        runs: robot.runs,
        sessions: sessions(robot, linked)?,
        series: series(figures),
        curves: curves(figures),
        parameters: parameters(figures),
        left_out: left_out(robot),
    }))
}

fn sessions(robot: &RobotHistory, linked: Option<&Lake>) -> Result<Vec<Session>, LakeError> {
    let lasting = PastSession::lasting(&robot.sessions);
    let session = |((past, result), lasting): ((&PastSession, &RunResult), Option<bool>)| {
        let page = linked.map(|lake| lake.file_key(PAGES, &past.key)).transpose()?;
        Ok(Session {
            means: result.before_and_after(),
            name: past.key.session.clone(),
            page: page.map(|key| format!("../{key}")),
            started: result.started_us.map(WallTime::of_us),
            verdict: TableVerdict::of_word(&result.verdict).unwrap_or(TableVerdict::NotShown),
            bound_mm: result.bound_mm,
            tolerance_mm: result.tolerance_mm,
            means_mm: [result.mean_before_mm, result.mean_after_mm],
            segment: past.judged.segment,
            began: past.judged.began.clone(),
            against: past.judged.against,
            moved: past.judged.in_words(),
            lasting,
            out_of_control: past.judged.out_of_control().map(str::to_owned).collect(),
        })
    };
    robot.sessions.iter().zip(&robot.results).zip(lasting).map(session).collect()
}

fn series(figures: &[Vec<Figure>]) -> Vec<Series> {
    let mut series: BTreeMap<&str, Series> = BTreeMap::new();
    for (place, figure) in numbered(figures) {
        let Some(charted) = &figure.charted else { continue };
        let own = series.entry(&figure.name).or_insert_with(|| Series {
            name: figure.name.clone(),
            is_accuracy: figure.kind == Kind::Accuracy,
            points: Vec::new(),
        });
        own.points.push(Point {
            session: place + 1,
            value: figure.value,
            sd: figure.sd,
            average: charted.average.map(|average| average / charted.limit),
        });
    }
    series.into_values().collect()
}

fn numbered(figures: &[Vec<Figure>]) -> impl Iterator<Item = (usize, &Figure)> {
    let numbered = figures.iter().enumerate();
    numbered.flat_map(|(place, own)| own.iter().map(move |figure| (place, figure)))
}

/// Curves of the first and of the newest session.
fn curves(figures: &[Vec<Figure>]) -> Vec<Curve> {
    let is_of = |own: &Figure, joint| own.kind == Kind::JointCurve && own.joint == Some(joint);
    let of = |session: Option<&Vec<Figure>>, joint: usize| -> Vec<[f64; 3]> {
        let own = session.into_iter().flatten().filter(|own| is_of(own, joint));
        own.filter_map(|figure| Some([figure.angle_rad?, figure.value, figure.sd?])).collect()
    };
    let joints = figures.iter().flatten().filter(|figure| figure.kind == Kind::JointCurve);
    let joints = joints.filter_map(|figure| figure.joint).max().unwrap_or(0);
    let slides = |joint: usize| {
        figures.iter().flatten().any(|own| is_of(own, joint) && own.unit == Unit::Mm)
    };
    let curve = |joint| Curve {
        joint,
        slides: slides(joint),
        first: of(figures.first(), joint),
        newest: of(figures.last().filter(|_| figures.len() > 1), joint),
    };
    (1..=joints).map(curve).collect()
}

/// Parameters of the first and of the newest session.
fn parameters(figures: &[Vec<Figure>]) -> Vec<Parameter> {
    let of = |session: &[Figure], name: &str| {
        let own =
            session.iter().find(|figure| figure.kind == Kind::Parameter && figure.name == name)?;
        Some((own.value, own.sd?))
    };
    let (Some(first), Some(newest)) = (figures.first(), figures.last()) else { return Vec::new() };
    let own = newest.iter().filter(|figure| figure.kind == Kind::Parameter);
    let own = own
        .filter(|figure| !figure.name.starts_with("base_") && !figure.name.starts_with("target_"));
    own.map(|figure| Parameter {
        name: figure.name.clone(),
        unit: figure.unit.word(),
        first: of(first, &figure.name),
        newest: of(newest, &figure.name),
    })
    .collect()
}

fn left_out(robot: &RobotHistory) -> Vec<(String, String)> {
    let row = |left_out: &super::LeftOut| {
        let who = match &left_out.key {
            Some(key) => format!("{}, run {}", key.session, key.run),
            None => left_out.place.display().to_string(),
        };
        let why = match &left_out.reason {
            super::Reason::Unreadable(reason) => format!("not readable: {reason}"),
            other => other.word().to_owned(),
        };
        (who, why)
    };
    robot.left_out.iter().map(row).collect()
}
