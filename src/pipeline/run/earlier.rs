//! Sessions that a session is learnt on top of, without their files: what they said is kept, or follows from them as joined.
//!
//! Each is known by the sizes, tags and times of its files ([`super::known`]), which lead to its name as joined in
//! an index of the lake; none of its files is opened. A session that the index does not have is digested like any other, and one whose
//! result is gone is joined again from its files. The index may be removed, and is made again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::known::session_state;
use super::{RunError, lines};
use crate::io::lake::{Lake, LakeError};
use crate::manifest::{Input, ROBOT, RunKey, VERSION};
use crate::pipeline::configuration::{
    Configuration, JoinedBefore, Recorded, SessionFiles, WorkPiece,
};

/// The states of a piece's sessions, and what an index says of those that have one.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    robot: Option<String>,
    states: BTreeMap<String, String>,
    known: BTreeMap<String, Line>,
}

/// A session as joined.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Line {
    state: String,
    session: String,
    run: String,
    inputs: Vec<Input>,
}

impl Earlier {
    /// What a lake's index knows of the sessions of a piece of work; nothing where each is learnt by itself, or the robot is named in logs.
    pub(super) fn of(configuration: &Configuration, piece: &WorkPiece) -> Result<Self, RunError> {
        let Some(robot) = configuration.robot.clone().filter(|_| configuration.grows()) else {
            return Ok(Self::default());
        };
        let digest = super::input(&configuration.robot_file, ROBOT)?.digest;
        let state = |files: &SessionFiles| {
            let texts = session_state(&configuration.tree, files)?;
            let all = [VERSION, &configuration.join_settings, &digest];
            let mut hasher = blake3::Hasher::new();
            for text in all.into_iter().chain(texts.iter().map(String::as_str)) {
                hasher.update(&(text.len() as u64).to_le_bytes());
                hasher.update(text.as_bytes());
            }
            Some((files.name.clone(), hasher.finalize().to_hex().to_string()))
        };
        let lines = Lake::at(&configuration.lake)?.joined_index(&robot);
        Ok(Self {
            states: piece.training.iter().filter_map(state).collect(),
            known: by_state(&lines),
            robot: Some(robot),
        })
    }

    /// The piece of work with earlier sessions as the lake has them joined, where the index knows them; `None` where it knows none.
    pub(super) fn without_files(&self, piece: &WorkPiece) -> Option<WorkPiece> {
        let robot = self.robot.as_ref()?;
        let mut found = piece.clone();
        let (_, earlier) = found.training.split_last_mut()?;
        for files in earlier {
            let state = self.states.get(&files.name);
            let line = state.and_then(|state| self.known.get(state));
            if let Some(line) = line.filter(|line| line.session == files.name) {
                files.recorded = Recorded::Joined(JoinedBefore {
                    key: RunKey::new(robot, &line.session, &line.run),
                    inputs: line.inputs.clone(),
                });
                files.corrected = None;
            }
        }
        (found != *piece).then_some(found)
    }

    /// Adds a session as joined to the index of a lake, where it has a state that the index does not have. There is no lock: a line may be
    /// lost, and its session is digested once more.
    pub(super) fn add(
        &self,
        lake: &Lake,
        key: &RunKey,
        inputs: impl Iterator<Item = Input>,
    ) -> Result<(), LakeError> {
        let (Some(robot), Some(state)) = (&self.robot, self.states.get(&key.session)) else {
            return Ok(());
        };
        let line = Line {
            state: state.clone(),
            session: key.session.clone(),
            run: key.run.clone(),
            inputs: inputs.collect(),
        };
        if self.known.get(state) == Some(&line) {
            return Ok(());
        }
        let mut all = by_state(&lake.joined_index(robot));
        all.retain(|_, own| own.session != line.session);
        all.insert(state.clone(), line);
        lake.put_joined_index(robot, &lines::text(&all))
    }
}

fn by_state(text: &str) -> BTreeMap<String, Line> {
    lines::parsed(text, |line: &Line| &line.state)
}
