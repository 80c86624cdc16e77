//! Tasks: the pieces of work of a fleet as jobs that an engine hands out to machines.
//!
//! A task is named by the state of its inputs ([`Known::state`]), so that listing opens no log, and doing it twice is doing it once: the
//! run's row is created or was there, and the bytes are the same. What was done is kept in the lake's index, a file for each task, since
//! tasks at once have no lock.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::configuration::{SessionFiles, WorkPiece};
use super::fleet::{Fleet, FleetPiece};
use super::run::{Done, Known, Size, Took, run_piece};
use crate::manifest::VERSION;
use crate::progress::Progress;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The state of its inputs: another content, setting or version is another task.
    pub id: String,
    pub version: String,
    /// The robot; `None` where the logs' metadata name it.
    pub robot: Option<String>,
    /// The session of its tables, or `pooled`.
    pub session: String,
    pub learns_from: Vec<String>,
    pub judged_on: Vec<String>,
    pub bytes: u64,
    /// Time that it may take, s, by what runs of the lake took: to share work out by, not to rely on.
    pub expected_s: f64,
    /// Memory that it may take, MB, likewise.
    pub expected_mb: f64,
}

/// How a task ended, as a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ended {
    pub id: String,
    /// The robot; `None` where it is not known.
    pub robot: Option<String>,
    /// The session of its tables; `None` where there is no such task.
    pub session: Option<String>,
    /// `done`, `done-before`, `failed` or `fault`.
    pub ended: How,
    /// The run; `None` where there is none.
    pub run: Option<String>,
    /// Which run it took the place of, and how the two differ, in words; `None` where it was current, or the first.
    pub took_place: Option<String>,
    /// Whether the tolerance is met; `None` where that is not shown, or there is no run.
    pub met: Option<bool>,
    /// Why there is no result, or why the tolerance is not met.
    pub reason: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum How {
    Done,
    DoneBefore,
    /// Its inputs have no result: doing it again gives the same.
    Failed,
    /// The machine or the storage failed: doing it again may help.
    Fault,
}

/// The tasks of a fleet that are not known as done, in the order of its pieces; and the sessions that have no state, as a file of theirs is
/// gone or has no tag.
pub fn open(fleet: &Fleet, known: &Known) -> (Vec<Task>, Vec<String>) {
    let (mut tasks, mut without) = (Vec::new(), Vec::new());
    let state = |own: FleetPiece<'_>| known.state_now(own);
    let states: Vec<Option<String>> = fleet.pieces().into_iter().map(state).collect();
    known.gather(states.iter().flatten().cloned());
    let mut took: BTreeMap<Option<&str>, Vec<Took>> = BTreeMap::new();
    for (own, state) in fleet.pieces().into_iter().zip(states) {
        match state {
            None => without.push(own.label()),
            Some(state) if known.told(&state).is_none() => {
                let robot = own.configuration.robot.as_deref();
                let took = took.entry(robot).or_insert_with(|| known.took(robot));
                tasks.push(task(own, state, took));
            }
            Some(_) => {}
        }
    }
    (tasks, without)
}

fn task(own: FleetPiece<'_>, id: String, took: &[Took]) -> Task {
    let names = |files: &[SessionFiles]| files.iter().map(|own| own.name.clone()).collect();
    let WorkPiece { session, training, test } = own.piece;
    let size = Size::of(own);
    let expected = size.expected(took);
    Task {
        id,
        version: VERSION.to_owned(),
        robot: own.configuration.robot.clone(),
        session: session.clone(),
        learns_from: names(training),
        judged_on: names(test),
        bytes: size.bytes,
        expected_s: (10.0 * expected.seconds).ceil() / 10.0,
        expected_mb: expected.megabytes.ceil(),
    }
}

/// Does the task of that id among the pieces of a fleet, unless it is known as done and current.
pub fn work(fleet: &Fleet, known: &Known, id: &str, progress: &dyn Progress) -> Ended {
    let is_it = |own: &FleetPiece<'_>| known.state_now(*own).as_deref() == Some(id);
    let Some(own) = fleet.pieces().into_iter().find(is_it) else { return no_such(id) };
    if known.settled_state(own).as_deref() != Some(id) {
        return no_such(id);
    }
    if let Some(done) = known.told(id) {
        return ended(id, &done);
    }
    match run_piece(own, progress) {
        Ok(done) => match known.keep_alone(id, own, &done) {
            Ok(()) => ended(id, &done),
            Err(error) => failed(id, Some(own), How::Fault, error.to_string()),
        },
        Err(error) => {
            let how = if error.is_fault() { How::Fault } else { How::Failed };
            failed(id, Some(own), how, error.to_string())
        }
    }
}

/// How a task ended that nothing makes.
fn no_such(id: &str) -> Ended {
    let reason = "there is no such work: files or settings changed since it was listed, or another version listed it; list the tasks again";
    failed(id, None, How::Failed, reason.to_owned())
}

fn ended(id: &str, done: &Done) -> Ended {
    Ended {
        id: id.to_owned(),
        robot: Some(done.key.robot.clone()),
        session: Some(done.key.session.clone()),
        ended: if done.already_there { How::DoneBefore } else { How::Done },
        run: Some(done.key.run.clone()),
        took_place: done.took_place.clone(),
        met: done.met(),
        reason: done.reason.clone(),
    }
}

fn failed(id: &str, own: Option<FleetPiece<'_>>, how: How, reason: String) -> Ended {
    Ended {
        id: id.to_owned(),
        robot: own.and_then(|own| own.configuration.robot.clone()),
        session: own.map(|own| own.piece.session.clone()),
        ended: how,
        run: None,
        took_place: None,
        met: None,
        reason: Some(reason),
    }
}
