//! One session: read and joined.

use nalgebra::Isometry3;

use super::RunError;
use crate::fit::commanded::{CommandFrames, commanded};
use crate::io::lake::OpenRun;
use crate::io::log::{JointSink, SessionRead, read_session};
use crate::io::tables::logs::LogTable;
use crate::io::tables::outcome::JoinedSession;
use crate::join::supposed::Supposed;
use crate::join::{JoinError, Joined, join};
use crate::pipeline::configuration::{Configuration, SessionFiles};
use crate::pipeline::{damage, driven};
use crate::progress::Progress;
use crate::setup::{self, Evidence, Finding};

/// Reads a session, and writes its decoded samples at the same time, where they are to be published.
pub(super) fn read_for(
    configuration: &Configuration,
    files: &SessionFiles,
    run: &mut OpenRun<'_>,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    if !configuration.logs {
        return read(configuration, files, &mut (), progress);
    }
    let mut samples = LogTable::new(run, &files.name);
    let read = read(configuration, files, &mut samples, progress)?;
    if let Some(table) = samples.finish(&read.input)? {
        run.keep(table);
    }
    Ok(read)
}

/// Reads a session; its joint samples go to `sink` too.
pub(in crate::pipeline) fn read(
    configuration: &Configuration,
    files: &SessionFiles,
    sink: &mut dyn JointSink,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    let (logs, mapping, rule) = (
        &files.logs,
        &configuration.mapping,
        configuration.join.arm_rule(),
    );
    let read = read_session(logs, mapping, configuration.limits, &rule, sink, progress)?;
    // No more of the logs may be lost than the pipeline file allows.
    damage::within(&read.counts, configuration.max_lost_share).map_err(|damage| {
        RunError::Damaged {
            session: files.name.clone(),
            damage,
        }
    })?;
    Ok(read)
}

/// Joins a session that was read.
pub(in crate::pipeline) fn joined(
    configuration: &Configuration,
    files: &SessionFiles,
    read: SessionRead,
) -> Result<JoinedSession, RunError> {
    let joined = join(&read.input, &configuration.arm, &configuration.join)
        .map_err(|source| unjoined(configuration, files, &read, source))?;
    let set_up = set_up(configuration, files, &read, &joined)?;
    let no_commands = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: None,
    };
    let commanded = commanded(
        &joined.stations,
        &configuration.arm,
        &configuration.command_frames.unwrap_or(no_commands),
    );
    Ok(JoinedSession {
        name: files.name.clone(),
        sampling_plan: read.metadata.get("session.plan").cloned(),
        driven_by: driven::driven_by(files, &joined.stations, configuration.limits)?,
        log_rejects: read.rejects,
        counts: read.counts,
        joined,
        commanded,
        set_up,
    })
}

/// The disagreement of a joined session with the stated set-up: an error where it is grave, a finding where it is small.
fn set_up(
    configuration: &Configuration,
    files: &SessionFiles,
    read: &SessionRead,
    joined: &Joined,
) -> Result<Option<Finding>, RunError> {
    let stated = &configuration.set_up;
    let gate_mm = configuration.join.geometry_gate_mm;
    let evidence = Evidence::of_stations(&joined.stations);
    let found = setup::check(&stated.set_up, &evidence, &stated.alternatives, gate_mm);
    match found {
        Some(finding) if finding.is_grave => {
            // Where nothing explains all of it, the logs may be joined at a wrong offset.
            let anew = if finding.explains_all {
                None
            } else {
                explained_anew(configuration, read)
            };
            Err(RunError::SetUp {
                session: files.name.clone(),
                finding: Box::new(anew.unwrap_or(finding)),
            })
        }
        found => Ok(found),
    }
}

/// The error of logs that cannot be joined, with the mistake of the set-up that explains it.
fn unjoined(
    configuration: &Configuration,
    files: &SessionFiles,
    read: &SessionRead,
    source: JoinError,
) -> RunError {
    let session = files.name.clone();
    let is_searched = matches!(
        source,
        JoinError::NoCommonPattern { .. } | JoinError::AmbiguousShift { .. }
    );
    let source = Box::new(source);
    if !is_searched {
        return RunError::Join { session, source };
    }
    match explained_anew(configuration, read) {
        Some(finding) => RunError::SetUp {
            session,
            finding: Box::new(finding),
        },
        None => RunError::Unexplained { session, source },
    }
}

/// The mistake under whose correction the logs can be joined; `None` where there is none.
fn explained_anew(configuration: &Configuration, read: &SessionRead) -> Option<Finding> {
    let supposed = Supposed::of(&read.input, &configuration.arm, &configuration.join).ok()?;
    let stated = &configuration.set_up;
    setup::explain(
        &stated.set_up,
        &supposed,
        &stated.alternatives,
        configuration.join.geometry_gate_mm,
    )
}
