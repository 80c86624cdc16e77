//! Estimates, verified by themselves ([`stage`](super::stage)). The lake has to have the sessions as joined that an estimate names. Where a
//! pipeline file has its settings, and no run that was recomputed has shown it already, it is trained anew from them, without any log.

use std::collections::BTreeSet;
use std::path::Path;

use super::recompute;
use super::sought::Sought;
use super::stage::{Anew, StageVerified, Stated, compared, each, of_file};
use crate::io::lake::{ESTIMATES, JOINED, Lake, LakeError};
use crate::io::store::Place;
use crate::io::table::Row as _;
use crate::io::tables::estimates::{self, EstimateRow};
use crate::io::tables::joined_sessions::{JoinedSessionRow, inputs};
use crate::io::tables::readings::ReadingRow;
use crate::io::tables::residuals::EstimateResidualRow;
use crate::manifest::{ROBOT, RunKey};
use crate::pipeline::configuration::{
    Configuration, JoinedBefore, Recorded, Session, SessionFiles, Tree, WorkPiece,
};
use crate::pipeline::run::{estimate_piece, input};
use crate::progress::Progress;

/// Verifies the estimates of these names, of sessions or results; of all where there are none. Those that are `shown` by runs that were
/// recomputed are not trained again.
pub fn estimates(
    lake: &Lake,
    sought: &Sought,
    names: &[String],
    shown: &BTreeSet<String>,
    progress: &dyn Progress,
) -> Result<Vec<StageVerified>, LakeError> {
    each(lake.rows_of_all(ESTIMATES)?, names, |place, key, table| {
        let Some(row) = EstimateRow::read(table).pop() else {
            return Ok((Vec::new(), None));
        };
        if row.session_names.len() != row.session_runs.len() {
            let problem = "its lists of sessions differ in length".to_owned();
            return Ok((vec![problem], None));
        }
        let own = estimates::inputs(&row.robot_digest, sessions(&row));
        let stated = Stated {
            rows: ESTIMATES,
            place,
            key,
            row: table,
            work: estimates::work(&key.robot, &key.session, own, row.settings.clone()),
            version: &row.version,
            settings_digest: &row.settings_digest,
            row_digest: row.row_digest.as_ref(),
        };
        let mut problems = stated.contradictions(lake);
        if let (Some(names), Some(digests)) = (&row.table_names, &row.table_digests) {
            let files = (&names[..], &digests[..]);
            problems.extend(of_file(lake, key, EstimateResidualRow::TABLE, files));
        }
        for (session, run) in sessions(&row) {
            if !lake.has(JOINED, &RunKey::new(&key.robot, session, run))? {
                problems.push(format!("the lake does not have {session} as joined {run}"));
            }
        }
        let is_open = problems.is_empty() && !shown.contains(&key.run);
        let anew = is_open.then(|| anew_of(lake, key, &row, sought, progress));
        Ok((problems, anew.flatten()))
    })
}

/// The sessions that train, with their results.
fn sessions(row: &EstimateRow) -> impl Iterator<Item = (&String, &String)> {
    row.session_names.iter().zip(&row.session_runs)
}

/// The estimate trained anew by the first pipeline file with its settings; `None` where none has them.
fn anew_of(
    lake: &Lake,
    key: &RunKey,
    row: &EstimateRow,
    sought: &Sought,
    progress: &dyn Progress,
) -> Option<Anew> {
    let trained = match Trained::of(lake, key, row) {
        Ok(trained) => trained,
        Err(reason) => return Some(Anew::No(reason)),
    };
    let configuration =
        trained.by(sought, |configuration| configuration.estimate_settings == row.settings)?;
    Some(trained.anew(lake, configuration, progress).unwrap_or_else(Anew::No))
}

/// The sessions that an estimate was trained on, as the lake has them.
pub(super) struct Trained {
    key: RunKey,
    robot_digest: String,
    sessions: Vec<Joined>,
}

/// A session that trained.
struct Joined {
    session: Session,
    before: JoinedBefore,
    /// The settings of its ingest and join.
    settings: String,
}

impl Trained {
    /// The sessions of the estimate with this row, or why one cannot be read.
    pub(super) fn of(lake: &Lake, key: &RunKey, row: &EstimateRow) -> Result<Self, String> {
        let one = |(name, run): (&String, &String)| {
            let key = RunKey::new(&key.robot, name, run);
            let table = lake.read(JOINED, &key).map_err(|error| error.to_string())?;
            let row = JoinedSessionRow::read(&table).pop();
            let row = row.ok_or_else(|| format!("{name} as joined has no row"))?;
            let inputs = inputs(&row).ok_or_else(|| format!("{name} as joined is damaged"))?;
            let inputs = inputs.into_iter().filter(|input| input.name != ROBOT);
            let before = JoinedBefore { key, inputs: inputs.collect() };
            Ok(Joined {
                session: Session {
                    name: name.clone(),
                    recorded: Ok(Recorded::Joined(before.clone())),
                    corrected: None,
                    robot: None,
                },
                before,
                settings: row.settings,
            })
        };
        let sessions: Result<_, String> = sessions(row).map(one).collect();
        Ok(Self { key: key.clone(), robot_digest: row.robot_digest.clone(), sessions: sessions? })
    }

    /// The configuration of the first pipeline file that `has` the settings, with these sessions and their robot file.
    pub(super) fn by(
        &self,
        sought: &Sought,
        has: impl Fn(&Configuration) -> bool,
    ) -> Option<Configuration> {
        let sessions = self.sessions.iter();
        let found: Vec<Session> = sessions.clone().map(|own| own.session.clone()).collect();
        sought.with_sessions(&self.key.robot, &found, |configuration| {
            let robot = input(&configuration.robot_file, ROBOT);
            has(configuration)
                && sessions.clone().all(|own| own.settings == configuration.join_settings)
                && robot.is_ok_and(|robot| robot.digest == self.robot_digest)
        })
    }

    /// Copies the sessions as joined into a lake in a folder; gives the configuration for it, and the piece of work.
    pub(super) fn copied(
        &self,
        lake: &Lake,
        to: &Path,
        configuration: Configuration,
    ) -> Result<(Configuration, WorkPiece), String> {
        for own in &self.sessions {
            let copied = lake.copy_run(&[JOINED, ReadingRow::TABLE], &own.before.key, to);
            copied.map_err(|error| error.to_string())?;
        }
        let files = |own: &Joined| SessionFiles {
            name: own.session.name.clone(),
            recorded: Recorded::Joined(own.before.clone()),
            corrected: None,
        };
        let piece = WorkPiece {
            session: self.key.session.clone(),
            training: self.sessions.iter().map(files).collect(),
            test: Vec::new(),
        };
        let configuration = Configuration {
            robot: Some(self.key.robot.clone()),
            lake: Place::of(to),
            tree: Tree::Folder,
            ..configuration
        };
        Ok((configuration, piece))
    }

    /// The estimate trained in a temporary lake with its sessions as joined, and compared.
    fn anew(
        &self,
        lake: &Lake,
        configuration: Configuration,
        progress: &dyn Progress,
    ) -> Result<Anew, String> {
        let temporary = recompute::temporary_lake(lake, &self.key)?;
        let (configuration, piece) = self.copied(lake, temporary.path(), configuration)?;
        let done = estimate_piece(&configuration, &piece, progress);
        let done = done.map_err(|error| error.to_string())?;
        if done.run != self.key.run {
            return Err(OTHERS.to_owned());
        }
        let tables = [EstimateResidualRow::TABLE, ESTIMATES];
        Ok(compared(lake, &Lake::new(temporary.path()), &tables, &self.key))
    }
}

/// Why a result made anew has another name.
pub(super) const OTHERS: &str = "its sessions, or the version, are not those that it was made with";
