//! One session: read and joined.

use nalgebra::Isometry3;

use super::RunError;
use crate::fit::commanded::{CommandFrames, commanded};
use crate::io::lake::OpenRun;
use crate::io::log::{JointSink, SessionRead, read_session};
use crate::io::tables::logs::LogTable;
use crate::io::tables::outcome::JoinedSession;
use crate::join::join;
use crate::pipeline::configuration::{Configuration, SessionFiles};
use crate::pipeline::{damage, driven};
use crate::progress::Progress;

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
    let wrong = |source| RunError::Join {
        session: files.name.clone(),
        source: Box::new(source),
    };
    let joined = join(&read.input, &configuration.arm, &configuration.join).map_err(wrong)?;
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
    })
}
