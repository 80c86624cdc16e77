//! Results of stages that runs start from, each verified by itself.
//!
//! Its name has to follow from its inputs, settings and version, its digest from its content, its file has to be as its row says, and the
//! lake has to have the results that it was made of. Where a pipeline file has its settings, and no run that was recomputed has shown
//! it already, it is made anew in a temporary lake and compared: a session from its files, where they are found, and all others from the
//! sessions as joined, without any log.

use std::collections::BTreeSet;

use super::recompute;
use super::source::Sought;
use crate::files::store::Place;
use crate::files::table::Table;
use crate::files::table::compare::compare;
use crate::io::lake::{ESTIMATES, GRIDS, JOINED, Lake, LakeError, RunRow, STAGES, Stage};
use crate::io::rows::Row as _;
use crate::io::tables::estimates::{self, EstimateRow};
use crate::io::tables::grids::{self, GridsRow};
use crate::io::tables::joined_sessions::{self, JoinedSessionRow};
use crate::io::tables::stage_results::{ResultRow, row, row_digest};
use crate::manifest::{ROBOT, RunKey, Work, digest};
use crate::pipeline::configuration::{
    Configuration, JoinedBefore, Overrides, Recorded, Session, SessionFiles, WorkPiece,
};
use crate::pipeline::fleet::FleetPiece;
use crate::pipeline::run::{input, stage_piece};
use crate::progress::Progress;

/// Columns that depend on version and machine, or on digests of what does.
pub(super) const OF_THE_MACHINE: [&str; 8] = [
    "estimate",
    "version",
    "platform",
    "cpu_features",
    "session_runs",
    "settings_digest",
    "table_digests",
    "row_digest",
];

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageVerified {
    pub place: Place,
    /// Robot, session and result; `None` where the row cannot be read.
    pub key: Option<RunKey>,
    /// Contradictions and changes, as text.
    pub problems: Vec<String>,
    /// Whether it was computed anew; `None` where what that takes is not found, or a run that was recomputed has shown it.
    pub anew: Option<Anew>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Anew {
    /// It is equal: byte for byte, or in its values where another machine made it.
    Same,
    Differs(Vec<String>),
    No(String),
}

impl StageVerified {
    /// Whether something was changed, or differs when computed anew.
    pub const fn is_mismatch(&self) -> bool {
        !self.problems.is_empty() || matches!(self.anew, Some(Anew::Differs(_)))
    }
}

pub struct StageVerifier<'a> {
    pub lake: &'a Lake,
    pub sought: &'a mut Sought,
    /// Names of sessions or results; of all where there are none.
    pub names: &'a [String],
    /// Results that recomputed runs have shown, which are not made again.
    pub shown: &'a BTreeSet<String>,
    pub progress: &'a dyn Progress,
}

impl StageVerifier<'_> {
    pub fn all(mut self) -> Result<Vec<(Stage, Vec<StageVerified>)>, LakeError> {
        let of_stage = |stage: Stage| {
            let rows = self.lake.rows_of_all(stage.rows)?.into_iter();
            let verified = rows.filter_map(|row| self.one(stage, row).transpose());
            Ok((stage, verified.collect::<Result<_, _>>()?))
        };
        STAGES.into_iter().map(of_stage).collect()
    }

    /// Verifies the result of a row; `None` where it has none of the names.
    fn one(
        &mut self,
        stage: Stage,
        (place, row): RunRow,
    ) -> Result<Option<StageVerified>, LakeError> {
        let table = row.and_then(|row| Ok(row.believed(&place.named())?));
        let key = table.as_ref().ok().and_then(|table| table.key().cloned());
        let names = self.names;
        let is_named = |key: &RunKey| names.contains(&key.session) || names.contains(&key.run);
        if table.is_ok() && !names.is_empty() && !key.as_ref().is_some_and(is_named) {
            return Ok(None);
        }
        let (problems, anew) = match (&table, &key) {
            (Ok(table), Some(key)) if table.rows() == 1 => {
                self.of_row(stage, &place, key, table)?
            }
            (Ok(_), _) => (vec!["it has several rows, or states no session".to_owned()], None),
            (Err(problem), _) => (vec![problem.to_string()], None),
        };
        Ok(Some(StageVerified { place, key, problems, anew }))
    }

    /// The contradictions of a row, and whether its result was made anew.
    fn of_row(
        &mut self,
        stage: Stage,
        place: &Place,
        key: &RunKey,
        table: &Table,
    ) -> Result<(Vec<String>, Option<Anew>), LakeError> {
        let row = ResultRow::read(table).swap_remove(0);
        let Some((work, made_of)) = work_of(stage, key, table, &row) else {
            return Ok((vec!["its lists differ in length".to_owned()], None));
        };
        let mut problems = contradictions(table, &row, &work);
        if self.lake.place(stage.rows, key).ok().as_ref() != Some(place) {
            problems.push("it is not at the place of its own name".to_owned());
        }
        if let (Some(names), Some(digests)) = (&row.table_names, &row.table_digests) {
            problems.extend(of_file(self.lake, key, stage.table, names, digests));
        }
        for (stage, key) in &made_of {
            if !self.lake.has(stage.rows, key)? {
                let RunKey { session, run, .. } = key;
                let name = stage.names[0];
                problems.push(format!("the lake does not have the {name} {run} of {session}"));
            }
        }
        let is_open = problems.is_empty() && !self.shown.contains(&key.run);
        let anew = is_open.then(|| {
            let anew = self.anew(stage, key, &row.made.settings, made_of);
            anew.unwrap_or_else(|reason| Some(Anew::No(reason)))
        });
        Ok((problems, anew.flatten()))
    }

    /// The result made anew by the first pipeline file that has its settings and finds what it was made of; `None` where none does.
    fn anew(
        &mut self,
        stage: Stage,
        key: &RunKey,
        settings: &str,
        mut made_of: Vec<(Stage, RunKey)>,
    ) -> Result<Option<Anew>, String> {
        let found = if stage == JOINED {
            self.files_of(key, settings)
        } else {
            let estimate = made_of.iter().find(|(stage, _)| *stage == ESTIMATES);
            let estimate = estimate.map_or_else(|| key.clone(), |(_, key)| key.clone());
            self.trained(&estimate, |configuration| match stage {
                GRIDS => configuration.grids_settings == settings,
                _ => configuration.estimate_settings == settings,
            })?
        };
        let Some((configuration, piece)) = found else { return Ok(None) };
        made_of.retain(|(stage, _)| *stage == ESTIMATES);
        made_of.extend(piece.training.iter().filter_map(|own| match &own.recorded {
            Recorded::Joined(before) => Some((JOINED, before.key.clone())),
            Recorded::Logs(_) | Recorded::Table(_) => None,
        }));
        let temporary = recompute::temporary_lake(self.lake, key)?;
        for (stage, key) in &made_of {
            let copied = self.lake.copy_run(&stage.tables(), key, temporary.path());
            copied.map_err(|error| error.to_string())?;
        }
        let configuration = Configuration {
            robot: Some(key.robot.clone()),
            lake: Place::of(temporary.path()),
            ..configuration
        };
        let (configuration, piece) = (&configuration, &piece);
        let own = FleetPiece { configuration, piece, is_of_several: false };
        let done = stage_piece(own, stage, self.progress);
        if done.map_err(|error| error.to_string())?.run != key.run {
            return Err(
                "its inputs, or the version, are not those that it was made with".to_owned()
            );
        }
        compared(self.lake, &Lake::new(temporary.path()), stage, key).map(Some)
    }

    /// The first pipeline file that finds a session's files under these settings of ingest and join.
    fn files_of(&mut self, key: &RunKey, settings: &str) -> Option<(Configuration, WorkPiece)> {
        let overrides = Overrides {
            robot: Some(key.robot.clone()),
            sessions: vec![key.session.clone()],
            ..Overrides::default()
        };
        self.sought.find(&overrides, |configuration| {
            let pieces = WorkPiece::each_session(&configuration.pieces);
            let piece = pieces.into_iter().find(|own| own.session == key.session)?;
            (configuration.join_settings == settings).then_some(piece)
        })
    }

    /// The first pipeline file that `has` the settings, with the robot file and the sessions as joined of an estimate.
    fn trained(
        &self,
        estimate: &RunKey,
        has: impl Fn(&Configuration) -> bool,
    ) -> Result<Option<(Configuration, WorkPiece)>, String> {
        let trained: EstimateRow = row(self.lake, estimate).map_err(|error| error.to_string())?;
        let (mut training, mut settings) = (Vec::new(), Vec::new());
        for (name, run) in trained.session_names.iter().zip(&trained.session_runs) {
            let key = RunKey::new(&estimate.robot, name, run);
            let joined: JoinedSessionRow =
                row(self.lake, &key).map_err(|error| error.to_string())?;
            let inputs =
                joined.inputs.inputs().ok_or_else(|| format!("{name} as joined is damaged"))?;
            let inputs = inputs.into_iter().filter(|input| input.name != ROBOT).collect();
            let recorded = Recorded::Joined(JoinedBefore { key, inputs });
            training.push(SessionFiles { name: name.clone(), recorded, corrected: None });
            settings.push(joined.made.settings);
        }
        let session = |own: &SessionFiles| {
            let (name, recorded) = (own.name.clone(), Ok(own.recorded.clone()));
            Session { name, recorded, corrected: None, robot: None }
        };
        let sessions: Vec<Session> = training.iter().map(session).collect();
        let found = self.sought.with_sessions(&estimate.robot, &sessions, |configuration| {
            let robot = input(&configuration.robot_file, ROBOT);
            has(configuration)
                && settings.iter().all(|own| *own == configuration.join_settings)
                && robot.is_ok_and(|robot| robot.digest == trained.robot_digest)
        });
        let session = estimate.session.clone();
        let piece = WorkPiece { session, training, test: Vec::new() };
        Ok(found.map(|configuration| (configuration, piece)))
    }
}

/// A result's work, and the results that it was made of; `None` where its lists contradict each other.
fn work_of(
    stage: Stage,
    key: &RunKey,
    table: &Table,
    row: &ResultRow,
) -> Option<(Work, Vec<(Stage, RunKey)>)> {
    let RunKey { robot, session, .. } = key;
    let settings = row.made.settings.clone();
    Some(match stage {
        JOINED => {
            let inputs = JoinedSessionRow::read(table).pop()?.inputs.inputs()?;
            (joined_sessions::work(robot, session, inputs, settings), Vec::new())
        }
        ESTIMATES => {
            let row = EstimateRow::read(table).pop()?;
            let sessions = || row.session_names.iter().zip(&row.session_runs);
            if row.session_names.len() != row.session_runs.len() {
                return None;
            }
            let inputs = estimates::inputs(&row.robot_digest, sessions());
            let made_of = sessions().map(|(name, run)| (JOINED, RunKey::new(robot, name, run)));
            (estimates::work(robot, session, inputs, settings), made_of.collect())
        }
        _ => {
            let estimate = GridsRow::read(table).pop()?.estimate;
            let made_of = vec![(ESTIMATES, RunKey::new(robot, session, &estimate))];
            (grids::work(robot, session, &estimate, settings), made_of)
        }
    })
}

fn contradictions(table: &Table, row: &ResultRow, work: &Work) -> Vec<String> {
    let mut problems = Vec::new();
    let found = row_digest(table);
    if row.row_digest.as_ref() != Some(&found) {
        problems.push(format!(
            "its content has the digest {found}, and it states another one: it was changed"
        ));
    }
    if work.settings_digest() != row.made.settings_digest {
        problems.push("its settings do not have the digest that it states".to_owned());
    }
    let follows = work.key_by_version(&row.made.version).run;
    if table.key().is_some_and(|key| key.run != follows) {
        problems.push(format!("from its inputs, settings and version follows the name {follows}"));
    }
    problems
}

/// The only file of a result, missing or not as its row says.
fn of_file(
    lake: &Lake,
    key: &RunKey,
    table: &str,
    names: &[String],
    digests: &[String],
) -> Option<String> {
    if *names != [format!("{table}/{}", key.session)] {
        return Some(format!("it names the files {}", names.join(", ")));
    }
    let opened = lake.open(table, key).map_err(|error| error.to_string());
    let found = opened.and_then(|file| digest(file).map_err(|error| error.to_string()));
    match found {
        Ok((found, _)) if *digests == [found.clone()] => None,
        Ok((found, _)) => Some(format!(
            "{table}: its file has the digest {found}, and was written with another one"
        )),
        Err(reason) => Some(format!("{table}: {reason}")),
    }
}

/// Compares both tables of a result with those made anew.
fn compared(lake: &Lake, again: &Lake, stage: Stage, key: &RunKey) -> Result<Anew, String> {
    let mut told = Vec::new();
    for table in stage.tables() {
        let [own, other] = [lake, again].map(|lake| lake.read(table, key));
        let (own, other) =
            own.and_then(|own| Ok((own, other?))).map_err(|error| error.to_string())?;
        if compare(&own, &other, &OF_THE_MACHINE).same_values().is_none() {
            told.push(table.to_owned());
        }
    }
    Ok(if told.is_empty() { Anew::Same } else { Anew::Differs(told) })
}
