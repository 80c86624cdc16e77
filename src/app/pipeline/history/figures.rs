//! Figures over the sessions: those charted, the parameters and joint curves that the runs published, and the references.

use std::collections::BTreeMap;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::history::control::Charted;
use crate::io::lake::Lake;
use crate::io::rows::Row;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::parameters::ParameterRow;
use crate::io::tables::past::{Figure, Kind, PastSession};
use crate::io::tables::references::ReferenceRow;
use crate::io::tables::words::Unit;
use crate::report::Model;

/// Step of the angles at which joint curves are given, degrees.
const EVERY_DEG: f64 = 15.0;
/// Step of the positions at which the curve of a joint that slides is given, mm.
const EVERY_MM: f64 = 200.0;

/// The figures of each session; and, as text, the figures that could not be read.
pub fn figures(lake: &Lake, sessions: &[PastSession]) -> (Vec<Vec<Figure>>, Vec<String>) {
    figures_of(sessions, |_, session| OfSession::read(lake, session))
}

/// The figures that a page shows: those charted of each session, and of the first and the newest session all.
pub fn figures_of_ends(lake: &Lake, sessions: &[PastSession]) -> (Vec<Vec<Figure>>, Vec<String>) {
    figures_of(sessions, |place, session| {
        if place == 0 || place + 1 == sessions.len() {
            OfSession::read(lake, session)
        } else {
            OfSession::charted(session)
        }
    })
}

fn figures_of(
    sessions: &[PastSession],
    read: impl Fn(usize, &PastSession) -> OfSession + Sync,
) -> (Vec<Vec<Figure>>, Vec<String>) {
    let places = sessions.par_iter().enumerate();
    let read: Vec<OfSession> = places.map(|(place, own)| read(place, own)).collect();
    let mut first = BTreeMap::new();
    let (mut figures, mut wrong) = (Vec::with_capacity(read.len()), Vec::new());
    for (session, own) in sessions.iter().zip(read) {
        let moved = moved(own.references, session.judged.segment, &mut first);
        figures.push(own.figures.into_iter().chain(moved).collect());
        wrong.extend(own.wrong);
    }
    (figures, wrong)
}

#[derive(Default)]
struct OfSession {
    figures: Vec<Figure>,
    /// Its references in their first places.
    references: Vec<ReferenceRow>,
    wrong: Vec<String>,
}

impl OfSession {
    /// The figures on its control charts, which the history has without reading anything.
    fn charted(session: &PastSession) -> Self {
        Self { figures: session.judged.charted.iter().map(charted).collect(), ..Self::default() }
    }

    fn read(lake: &Lake, session: &PastSession) -> Self {
        let mut own = Self::charted(session);
        for read in [parameters, joint_curves] {
            match read(lake, session) {
                Ok(more) => own.figures.extend(more),
                Err(reason) => own.wrong.push(reason),
            }
        }
        match references(lake, session) {
            Ok(rows) => own.references = rows,
            Err(reason) => own.wrong.push(reason),
        }
        own
    }
}

/// The place of a reference in the base frame, mm, and its standard deviation per axis, by segment and name.
type Places = BTreeMap<(usize, String), (Point3<f64>, f64)>;

/// How far each reference of a session is from its place in the segment's first session that has it: there the base moved on the
/// floor, the reference on the base, or the frame that the arm shows.
fn moved(rows: Vec<ReferenceRow>, segment: usize, first: &mut Places) -> Vec<Figure> {
    let figure = |row: ReferenceRow| {
        let at = Point3::from(row.in_base?);
        let key = (segment, row.reference.clone());
        let (before, before_sd_mm) = *first.entry(key).or_insert((at, row.sd_mm));
        Some(Figure {
            kind: Kind::Reference,
            name: row.reference,
            joint: None,
            angle_rad: None,
            value: (at - before).norm(),
            sd: Some(row.sd_mm.hypot(before_sd_mm)),
            unit: Unit::Mm,
            charted: None,
        })
    };
    rows.into_iter().filter_map(figure).collect()
}

/// The references of a session, each in its first place; empty of sessions without any, and of versions before that table.
fn references(lake: &Lake, session: &PastSession) -> Result<Vec<ReferenceRow>, String> {
    let there = lake.has(ReferenceRow::TABLE, &session.key);
    if !there.map_err(|error| error.to_string())? {
        return Ok(Vec::new());
    }
    let mut rows: Vec<ReferenceRow> = read(lake, session)?;
    rows.retain(|row| row.moved_by_mm.is_none() && row.of_session == session.key.session);
    Ok(rows)
}

fn charted(charted: &Charted) -> Figure {
    // Names of accuracy figures have several words, names of a model's columns one.
    let is_accuracy = charted.name.contains(' ');
    let is_angle = charted.name.contains("_r") || charted.name.starts_with("theta");
    // The zero of a joint that turns, or of one that slides.
    let joint =
        ["theta_", "d_"].iter().find_map(|zero| charted.name.strip_prefix(zero)?.parse().ok());
    Figure {
        kind: if is_accuracy { Kind::Accuracy } else { Kind::SinceFirst },
        name: charted.name.clone(),
        joint,
        angle_rad: None,
        value: charted.value,
        sd: charted.sd,
        unit: if is_angle && !is_accuracy { Unit::Rad } else { Unit::Mm },
        charted: Some(charted.clone()),
    }
}

fn parameters(lake: &Lake, session: &PastSession) -> Result<Vec<Figure>, String> {
    let rows: Vec<ParameterRow> = read(lake, session)?;
    let has = |model: &Model| rows.iter().any(|row| row.model == *model);
    let best = Model::serving().find(has);
    let own = rows.into_iter().filter(|row| Some(row.model) == best && row.unit != Unit::One);
    // Several targets and instruments have parameters of one name each, in their order.
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut named = |name: String| {
        let count = seen.entry(name.clone()).or_default();
        *count += 1;
        match *count {
            1 => name,
            count => format!("{name}_{count}"),
        }
    };
    let figure = |row: ParameterRow| Figure {
        kind: Kind::Parameter,
        name: named(row.parameter),
        joint: row.joint,
        angle_rad: None,
        value: row.identified,
        sd: row.standard_error,
        unit: row.unit,
        charted: None,
    };
    Ok(own.map(figure).collect())
}

fn joint_curves(lake: &Lake, session: &PastSession) -> Result<Vec<Figure>, String> {
    let is_given = |row: &JointErrorRow| {
        let (in_mm, in_degrees) =
            ((row.angle_rad, EVERY_MM), (row.angle_rad.to_degrees(), EVERY_DEG));
        let (place, every) = if row.joint_unit == Some(Unit::Mm) { in_mm } else { in_degrees };
        let off = place - every * (place / every).round();
        row.measured && off.abs() < 1e-6
    };
    let figure = |row: JointErrorRow| Figure {
        kind: Kind::JointCurve,
        name: "error".to_owned(),
        joint: Some(row.joint),
        angle_rad: Some(row.angle_rad),
        value: row.error_rad,
        sd: Some(row.sd_rad),
        unit: row.joint_unit.unwrap_or(Unit::Rad),
        charted: None,
    };
    let rows: Vec<JointErrorRow> = read(lake, session)?;
    Ok(rows.into_iter().filter(is_given).map(figure).collect())
}

fn read<R: Row>(lake: &Lake, session: &PastSession) -> Result<Vec<R>, String> {
    let table = lake.read(R::TABLE, &session.key);
    Ok(R::read(&table.map_err(|error| error.to_string())?))
}
