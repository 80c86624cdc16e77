//! Figures over the sessions: those charted, and the parameters and joint curves that the runs published.

use rayon::prelude::*;

use super::PastSession;
use crate::history::control::Charted;
use crate::io::lake::Lake;

/// Joint curves are given at every so many degrees.
const EVERY_DEG: f64 = 15.0;

/// One figure of a session.
#[derive(Debug, Clone)]
pub struct Figure {
    /// What it is.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// The joint, from 1.
    pub joint: Option<i64>,
    /// The joint's angle, rad.
    pub angle_rad: Option<f64>,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: Option<f64>,
    /// `mm` or `rad`.
    pub unit: &'static str,
    /// Where it stands on its chart, if it has one.
    pub charted: Option<Charted>,
}

/// What a figure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An accuracy figure.
    Accuracy,
    /// How far base, target or a joint's offset stands from the first session.
    SinceFirst,
    /// An identified parameter.
    Parameter,
    /// A point of a joint's error curve.
    JointCurve,
}

impl Kind {
    /// The word of the table.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::SinceFirst => "since_first",
            Self::Parameter => "parameter",
            Self::JointCurve => "joint_curve",
        }
    }
}

/// The figures of each session; and, in words, what of them could not be read.
pub fn figures(lake: &Lake, sessions: &[PastSession]) -> (Vec<Vec<Figure>>, Vec<String>) {
    let read: Vec<(Vec<Figure>, Vec<String>)> = sessions
        .par_iter()
        .map(|session| of_session(lake, session))
        .collect();
    let (figures, wrong): (Vec<_>, Vec<_>) = read.into_iter().unzip();
    (figures, wrong.concat())
}

fn of_session(lake: &Lake, session: &PastSession) -> (Vec<Figure>, Vec<String>) {
    let mut figures: Vec<Figure> = session.judged.charted.iter().map(charted).collect();
    let mut wrong = Vec::new();
    for read in [parameters, joint_curves] {
        match read(lake, session) {
            Ok(more) => figures.extend(more),
            Err(reason) => wrong.push(reason),
        }
    }
    (figures, wrong)
}

fn charted(charted: &Charted) -> Figure {
    // Accuracy figures are named by several words, columns of a model by one.
    let is_accuracy = charted.name.contains(' ');
    let is_angle = charted.name.contains("_r") || charted.name.starts_with("theta");
    let joint = charted
        .name
        .strip_prefix("theta_")
        .and_then(|joint| joint.parse().ok());
    Figure {
        kind: if is_accuracy {
            Kind::Accuracy
        } else {
            Kind::SinceFirst
        },
        name: charted.name.clone(),
        joint,
        angle_rad: None,
        value: charted.value,
        sd: charted.sd,
        unit: if is_angle && !is_accuracy {
            "rad"
        } else {
            "mm"
        },
        charted: Some(charted.clone()),
    }
}

fn parameters(lake: &Lake, session: &PastSession) -> Result<Vec<Figure>, String> {
    let table = lake
        .read("parameters", &session.key)
        .map_err(|error| error.to_string())?;
    let models = table.text("model");
    let best = ["full", "geometric"]
        .into_iter()
        .find(|best| models.iter().flatten().any(|model| model == *best));
    let units = table.text("unit");
    let row = |row: usize| Figure {
        kind: Kind::Parameter,
        name: table.text("parameter").value(row).to_owned(),
        joint: table.i64("joint").iter().nth(row).flatten(),
        angle_rad: None,
        value: table.f64("identified").value(row),
        sd: table.f64("standard_error").iter().nth(row).flatten(),
        unit: if units.value(row) == "rad" {
            "rad"
        } else {
            "mm"
        },
        charted: None,
    };
    let rows =
        (0..table.rows()).filter(|&row| Some(models.value(row)) == best && units.value(row) != "1");
    Ok(rows.map(row).collect())
}

fn joint_curves(lake: &Lake, session: &PastSession) -> Result<Vec<Figure>, String> {
    let table = lake
        .read("joint_errors", &session.key)
        .map_err(|error| error.to_string())?;
    let angles = table.f64("angle_rad");
    let is_given = |&row: &usize| {
        let degrees = angles.value(row).to_degrees();
        let off = degrees - EVERY_DEG * (degrees / EVERY_DEG).round();
        table.bool("measured").value(row) && off.abs() < 1e-6
    };
    let row = |row: usize| Figure {
        kind: Kind::JointCurve,
        name: "error".to_owned(),
        joint: Some(table.i64("joint").value(row)),
        angle_rad: Some(angles.value(row)),
        value: table.f64("error_rad").value(row),
        sd: Some(table.f64("sd_rad").value(row)),
        unit: "rad",
        charted: None,
    };
    Ok((0..table.rows()).filter(is_given).map(row).collect())
}
