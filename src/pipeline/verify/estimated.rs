//! Estimates, verified by themselves ([`stage`](super::stage)). The lake has to have the sessions as joined that an estimate names. Where a
//! pipeline file has its settings, and no run that was recomputed has shown it already, it is trained anew from them, without any log.

use std::collections::BTreeSet;

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
    each(lake.estimates()?, names, |place, key, table| {
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
    let joined = match all_joined(lake, key, row) {
        Ok(joined) => joined,
        Err(reason) => return Some(Anew::No(reason)),
    };
    let found: Vec<Session> = joined.iter().map(|own| own.session.clone()).collect();
    let configuration = sought.with_sessions(&key.robot, &found, |configuration| {
        let robot = input(&configuration.robot_file, ROBOT);
        configuration.estimate_settings == row.settings
            && joined
                .iter()
                .all(|own| own.settings == configuration.join_settings)
            && robot.is_ok_and(|robot| robot.digest == row.robot_digest)
    })?;
    Some(match trained(lake, key, &joined, configuration, progress) {
        Ok(anew) => anew,
        Err(reason) => Anew::No(reason),
    })
}

/// A session that trained, as the lake has it.
struct Joined {
    session: Session,
    before: JoinedBefore,
    /// The settings of its ingest and join.
    settings: String,
}

/// The sessions that trained, or why one cannot be read.
fn all_joined(lake: &Lake, key: &RunKey, row: &EstimateRow) -> Result<Vec<Joined>, String> {
    let one = |(name, run): (&String, &String)| {
        let key = RunKey::new(&key.robot, name, run);
        let table = lake.read(JOINED, &key).map_err(|error| error.to_string())?;
        let row = JoinedSessionRow::read(&table).pop();
        let row = row.ok_or_else(|| format!("{name} as joined has no row"))?;
        let inputs = inputs(&row).ok_or_else(|| format!("{name} as joined is damaged"))?;
        let inputs = inputs.into_iter().filter(|input| input.name != ROBOT);
        let before = JoinedBefore {
            key,
            inputs: inputs.collect(),
        };
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
    sessions(row).map(one).collect()
}

/// Trains an estimate into a temporary lake with its sessions as joined, and compares.
fn trained(
    lake: &Lake,
    key: &RunKey,
    joined: &[Joined],
    configuration: Configuration,
    progress: &dyn Progress,
) -> Result<Anew, String> {
    let temporary = recompute::temporary_lake(lake, key)?;
    for own in joined {
        let copied = lake.copy_run(
            &[JOINED, ReadingRow::TABLE],
            &own.before.key,
            temporary.path(),
        );
        copied.map_err(|error| error.to_string())?;
    }
    let configuration = Configuration {
        robot: Some(key.robot.clone()),
        lake: Place::of(temporary.path()),
        tree: Tree::Folder,
        ..configuration
    };
    let files = |own: &Joined| SessionFiles {
        name: own.session.name.clone(),
        recorded: Recorded::Joined(own.before.clone()),
        corrected: None,
    };
    let piece = WorkPiece {
        session: key.session.clone(),
        training: joined.iter().map(files).collect(),
        test: Vec::new(),
    };
    let done = estimate_piece(&configuration, &piece, progress);
    let done = done.map_err(|error| error.to_string())?;
    if done.run != key.run {
        return Err("its sessions, or the version, are not those that it was made with".to_owned());
    }
    let tables = [EstimateResidualRow::TABLE, ESTIMATES];
    Ok(compared(lake, &Lake::new(temporary.path()), &tables, key))
}
