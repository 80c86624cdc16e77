//! The errors before and after that a run states: at the stations of the figure that decides, in its frame and at its angles.
//!
//! - A table: the tool point's errors that judge it, and what it leaves of them.
//! - The identified arm on held-out blocks: the tool point's errors in the run's base frame.
//! - The identified arm on another session: before it the errors of base and target, with its base found in the same way. They are of
//!   reported angles; where the figure is of commanded ones, they are carried to those by the nominal arm.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use crate::fit::commanded::{CommandedPose, SettlingError};
use crate::grid::judge::LeftAt;
use crate::grid::{GridStation, Grids, Judged, Reach};
use crate::judgement::{JoinedSession, Outcome};
use crate::report::compared::{Compared, ErrorPair, Pairs, TableAndArm};
use crate::report::verdict::figure_of;
use crate::report::{Accuracy, Angles, Model, Residual, ResidualSet, Split, Subject};

/// Place and error of stations, by their number.
type ErrorsAt = BTreeMap<usize, (Point3<f64>, Vector3<f64>)>;

pub(super) fn pairs(outcome: &Outcome<'_>) -> Pairs {
    let some = |pair: &Compared| !pair.errors.is_empty();
    let sessions: Vec<&JoinedSession> = outcome.training.iter().chain(&outcome.test).collect();
    let of_session = |(session, split): (&JoinedSession, Split)| {
        let figure = |model| figure_of(&outcome.accuracy, model, split, &session.name);
        let figure = Model::serving().find_map(figure)?;
        let pair = compared(outcome, figure, session.name.clone())?;
        Some((figure.subject.clone(), pair))
    };
    let splits = |session| [(session, Split::Blocks), (session, Split::Session)];
    let is_pooled = outcome.training.len() > 1;
    let each = sessions.into_iter().filter(|_| is_pooled).flat_map(splits);
    Pairs {
        measured: measured(outcome).filter(some),
        predicted: predicted(outcome).filter(some),
        table_and_arm: table_and_arm(&outcome.grids),
        of_sessions: each.filter_map(of_session).collect(),
    }
}

/// What the chosen table leaves beside the identified arm, at the held-out stations where it answers.
fn table_and_arm(grids: &Grids) -> Option<TableAndArm> {
    // What the model leaves at a station is the same whichever step has it.
    let held_out = grids.judged.iter().filter(|row| row.of_test.is_none()).map(|row| &row.held_out);
    let by_arm = held_out.flat_map(|own| own.left.iter().zip(&own.direct));
    let by_arm: BTreeMap<usize, f64> = by_arm.map(|(left, mm)| (left.station, *mm)).collect();
    let left = &grids.deciding()?.held_out.left;
    let three = |own: &LeftAt| {
        let by_arm_mm = *by_arm.get(&own.station)?;
        Some([own.before.norm(), own.error.norm(), by_arm_mm])
    };
    let three: Vec<[f64; 3]> = left.iter().filter_map(three).collect();
    let stations: BTreeSet<usize> = left.iter().map(|own| own.station).collect();
    let mean = |place: usize| three.iter().map(|own| own[place]).sum::<f64>() / three.len() as f64;
    (three.len() == left.len() && !three.is_empty()).then(|| TableAndArm {
        before_mm: mean(0),
        table_mm: mean(1),
        arm_mm: mean(2),
        stations: stations.len(),
    })
}

/// The errors that the verdict's figure is of.
fn predicted(outcome: &Outcome<'_>) -> Option<Compared> {
    let headline = outcome.verdict.headline();
    let mut judges = headline.decides().into_iter().chain(&headline.judges);
    let (judge, figure) = judges.find_map(|judge| Some((judge, judge.figure.as_ref()?)))?;
    compared(outcome, figure, judge.stations.words())
}

/// The errors that a figure is of, at `stations`, in words.
fn compared(outcome: &Outcome<'_>, figure: &Accuracy, stations: String) -> Option<Compared> {
    let subject = &figure.subject;
    let session = named(outcome, subject)?;
    let of_table = |left: &LeftAt| {
        let (before, after) = (left.before, left.error);
        ErrorPair { station: left.station, at: left.at, before, after }
    };
    let (before, errors) = if subject.model == Model::Table {
        let left = &table(outcome, subject)?.held_out.left;
        (of_commands(session), left.iter().map(of_table).collect())
    } else {
        of_the_arm(outcome, session, figure)?
    };
    Some(Compared {
        is_measured: false,
        before: before.to_owned(),
        after: subject.model.name_at(subject.angles),
        frame: frame(outcome, subject).to_owned(),
        stations,
        errors,
    })
}

/// The errors that were measured of a table that drove the session; `None` where none did.
fn measured(outcome: &Outcome<'_>) -> Option<Compared> {
    let driven = outcome.driven.as_ref()?;
    let measured = driven.measured.as_ref()?;
    let after = measured.after.judged().map(|own| (own.station, own.residual));
    let after: BTreeMap<usize, Vector3<f64>> = after.collect();
    let pair = |own: &Residual| {
        let (at, after) = (own.predicted(), *after.get(&own.station)?);
        Some(ErrorPair { station: own.station, at, before: own.residual, after })
    };
    Some(Compared {
        is_measured: true,
        before: "raw command".to_owned(),
        after: format!("{} that drove it", driven.table),
        frame: OF_ITS_OWN.to_owned(),
        stations: measured.before.subject.of_session.clone(),
        errors: measured.before.judged().filter_map(pair).collect(),
    })
}

/// The frame of a session whose base is not that of the run.
const OF_ITS_OWN: &str = "in a base found from other stations of the session";

const fn frame(outcome: &Outcome<'_>, subject: &Subject) -> &'static str {
    match (subject.split, outcome.frame.is_surveyed) {
        (Split::Session, _) => OF_ITS_OWN,
        (_, true) => "in the surveyed base",
        (_, false) => "in the fitted base",
    }
}

fn named<'o>(outcome: &'o Outcome<'_>, subject: &Subject) -> Option<&'o JoinedSession> {
    outcome.training.iter().chain(&outcome.test).find(|own| own.name == subject.of_session)
}

/// The row of the chosen table that held-out blocks judge, or that a test session does.
fn table<'o>(outcome: &'o Outcome<'_>, subject: &Subject) -> Option<&'o Judged> {
    if subject.split != Split::Session {
        return outcome.grids.deciding();
    }
    outcome.grids.judged.iter().find(|row| row.of_test.as_ref() == Some(&subject.of_session))
}

/// The errors before and after that the figure of an identified arm is of, with what those before are errors of.
fn of_the_arm(
    outcome: &Outcome<'_>,
    session: &JoinedSession,
    figure: &Accuracy,
) -> Option<(&'static str, Vec<ErrorPair>)> {
    let subject = &figure.subject;
    let set =
        |is_it: &dyn Fn(&Subject) -> bool| outcome.residuals.iter().find(|set| is_it(&set.subject));
    let is_of_grids = outcome.training.last().is_some_and(|last| last.name == session.name);
    let (before_of, before) = if subject.split == Split::Blocks && is_of_grids {
        (of_commands(session), of_the_tool(outcome, session))
    } else {
        let nominal = set(&|own| {
            (own.model, own.split, own.base_refit)
                == (Model::BaseTarget, subject.split, subject.base_refit)
                && own.of_session == subject.of_session
        })?;
        let mut before: ErrorsAt =
            of_main(nominal).map(|own| (own.station, (own.predicted(), own.residual))).collect();
        if subject.angles == Angles::Commanded {
            carry_to_commands(outcome, session, &mut before);
        }
        ("base and target fitted", before)
    };
    let pair = |own: &Residual| {
        let (at, before) = *before.get(&own.station)?;
        Some(ErrorPair { station: own.station, at, before, after: own.residual })
    };
    let after = of_main(set(&|own| own == subject)?);
    Some((before_of, after.filter_map(pair).collect()))
}

/// The residuals of a set that judge, of the main target.
fn of_main(set: &ResidualSet) -> impl Iterator<Item = &Residual> {
    set.judged().filter(|own| own.is_of_main())
}

/// Carries errors at reported angles to commanded ones, by the nominal arm; stations without a command as sent are left out.
fn carry_to_commands(outcome: &Outcome<'_>, session: &JoinedSession, errors: &mut ErrorsAt) {
    let frame = &outcome.error_frame;
    let (arm, target) = (frame.arm, frame.frames.flange_from_target.origin());
    let stations = session.joined.stations.iter();
    let sent: BTreeMap<usize, Vector3<f64>> = stations
        .zip(&session.commanded.settling_errors)
        .filter_map(|(station, settling)| {
            let axes = arm.axes(&station.joints);
            let sent = settling.as_ref().and_then(SettlingError::sent)?;
            let commanded: Vec<f64> = axes.iter().zip(sent).map(|(q, by)| q + by).collect();
            let at = |axes: &[f64]| arm.chain().nominal(axes) * Point3::from(target.coords());
            Some((station.number, at(&commanded) - at(&axes)))
        })
        .collect();
    errors.retain(|station, (at, error)| {
        let Some(by) = sent.get(station) else { return false };
        *at += by;
        *error -= by;
        true
    });
}

/// What the tool point's errors are relative to, in words.
fn of_commands(session: &JoinedSession) -> &'static str {
    if session.commanded.poses.iter().any(Option::is_some) { "raw command" } else { "nominal arm" }
}

/// The errors of the tool point in the run's base frame, of the session that table and grids are for.
fn of_the_tool(outcome: &Outcome<'_>, session: &JoinedSession) -> ErrorsAt {
    let error_frame = &outcome.error_frame;
    let reach = Reach::new(error_frame.arm, error_frame.flange_from_tool);
    let commanded = session.joined.stations.iter().zip(&session.commanded.poses);
    let station = |(station, pose): (_, &Option<CommandedPose>)| {
        let position = pose.as_ref().map(|pose| pose.position);
        // The block that held the station out is of no interest here.
        let own = GridStation::of(station, position, error_frame, &reach, 0)?;
        Some((own.number, (own.position, own.error)))
    };
    commanded.filter_map(station).collect()
}
