//! The errors before and after that stand beside the verdict: at the stations of the figure that decides, and in its frame.
//!
//! - Held-out blocks that judge the table: the tool point's errors in the run's base frame, and what the table leaves of them.
//! - Held-out blocks that judge the identified arm: before it the errors against the raw command where the base is surveyed, and those
//!   of base and target fitted elsewhere.
//! - A test session: before it the errors of base and target, with its base found in the same way.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::fit::commanded::CommandedPose;
use crate::grid::judge::LeftAt;
use crate::grid::{GridStation, Judged, Reach};
use crate::io::tables::outcome::Outcome;
use crate::report::compared::{Compared, ErrorPair};
use crate::report::{Accuracy, Model, Residual, ResidualSet, Split, Subject};

/// Place and error of stations, by their number.
type ErrorsAt = BTreeMap<usize, (Point3<f64>, Vector3<f64>)>;

/// The errors that the headline of a run is of; `None` where no station judges.
pub(super) fn compared(outcome: &Outcome<'_>) -> Option<Compared> {
    let headline = outcome.verdict.headline();
    let mut judges = headline.decides().into_iter().chain(headline.judges());
    let (judge, figure) = judges.find_map(|judge| Some((judge, judge.figure.as_ref()?)))?;
    let (before, before_of) = before(outcome, figure)?;
    let pairs = after(outcome, figure)?.into_iter();
    let pairs = pairs.filter_map(|(station, after)| {
        let (at, before) = *before.get(&station)?;
        Some(ErrorPair {
            station,
            at,
            before,
            after,
        })
    });
    let subject = &figure.subject;
    Some(Compared {
        before: before_of.to_owned(),
        after: subject.model.name_at(subject.angles),
        frame: frame(outcome, subject).to_owned(),
        stations: judge.stations.words(),
        errors: pairs.collect(),
    })
}

/// The errors that were measured of a table that drove the session; `None` where none did.
pub(super) fn measured(outcome: &Outcome<'_>) -> Option<Compared> {
    let driven = outcome.driven.as_ref()?;
    let measured = driven.measured.as_ref()?;
    let after = measured.after.judged();
    let after: BTreeMap<usize, Vector3<f64>> =
        after.map(|own| (own.station, own.residual)).collect();
    let pair = |own: &Residual| {
        Some(ErrorPair {
            station: own.station,
            at: own.predicted(),
            before: own.residual,
            after: *after.get(&own.station)?,
        })
    };
    Some(Compared {
        before: "raw command".to_owned(),
        after: format!("{} that drove it", driven.table),
        frame: OF_ITS_OWN.to_owned(),
        stations: measured.before.subject.of_session.clone(),
        errors: measured.before.judged().filter_map(pair).collect(),
    })
}

/// The frame of a session whose base is not that of the run.
const OF_ITS_OWN: &str = "in a base found from other stations of the session";

/// The frame of the errors, in words.
const fn frame(outcome: &Outcome<'_>, subject: &Subject) -> &'static str {
    match (subject.split, outcome.frame.is_surveyed) {
        (Split::Session, _) => OF_ITS_OWN,
        (_, true) => "in the surveyed base",
        (_, false) => "in the fitted base",
    }
}

/// The errors that are left, by station.
fn after(outcome: &Outcome<'_>, figure: &Accuracy) -> Option<Vec<(usize, Vector3<f64>)>> {
    let subject = &figure.subject;
    if subject.model == Model::Table {
        let left = |left: &LeftAt| (left.station, left.error);
        return Some(
            table(outcome, subject)?
                .held_out
                .left
                .iter()
                .map(left)
                .collect(),
        );
    }
    let set = outcome
        .residuals
        .iter()
        .find(|set| set.subject == *subject)?;
    Some(
        set.judged()
            .filter(|own| own.is_of_main())
            .map(|own| (own.station, own.residual))
            .collect(),
    )
}

/// The row of the chosen table that held-out blocks judge, or that a test session does.
fn table<'o>(outcome: &'o Outcome<'_>, subject: &Subject) -> Option<&'o Judged> {
    if subject.split != Split::Session {
        return outcome.grids.deciding();
    }
    let mut rows = outcome.grids.judged.iter();
    rows.find(|row| row.of_test.as_ref() == Some(&subject.of_session))
}

/// Place and error of the stations before correction, in the frame of `figure`, with what they are errors of.
fn before(outcome: &Outcome<'_>, figure: &Accuracy) -> Option<(ErrorsAt, &'static str)> {
    let subject = &figure.subject;
    let blocks = subject.split == Split::Blocks;
    if blocks && (subject.model == Model::Table || outcome.frame.is_surveyed) {
        return Some((of_the_tool(outcome), of_commands(outcome)));
    }
    let is_it = |set: &&ResidualSet| {
        let own = &set.subject;
        (own.model, own.split, own.base_refit)
            == (Model::BaseTarget, subject.split, subject.base_refit)
            && own.of_session == subject.of_session
    };
    let set = outcome.residuals.iter().find(is_it)?;
    let error = |own: &Residual| (own.station, (own.predicted(), own.residual));
    let judged = set.judged().filter(|own| own.is_of_main());
    Some((judged.map(error).collect(), "base and target fitted"))
}

/// What the tool point's errors are relative to, in words.
fn of_commands(outcome: &Outcome<'_>) -> &'static str {
    let commands = outcome.training.last().map(|own| &own.commanded.poses);
    let has_commands = commands.is_some_and(|poses| poses.iter().any(Option::is_some));
    if has_commands {
        "raw command"
    } else {
        "nominal arm"
    }
}

/// The errors of the tool point in the run's base frame, of the session that table and grids are for.
fn of_the_tool(outcome: &Outcome<'_>) -> ErrorsAt {
    let Some(session) = outcome.training.last() else {
        return ErrorsAt::new();
    };
    let error_frame = &outcome.error_frame;
    let reach = Reach::new(error_frame.arm(), *error_frame.flange_from_tool());
    let commanded = session.joined.stations.iter().zip(&session.commanded.poses);
    let station = |(station, pose): (_, &Option<CommandedPose>)| {
        let position = pose.as_ref().map(|pose| pose.position);
        // The block that held the station out is of no interest here.
        let own = GridStation::of(station, position, error_frame, &reach, 0)?;
        Some((own.number, (own.position, own.error)))
    };
    commanded.filter_map(station).collect()
}
