//! One session: read and joined.

use nalgebra::Isometry3;

use super::RunError;
use crate::fit::commanded::{CommandFrames, commanded};
use crate::ingest::Recording;
use crate::io::lake::OpenRun;
use crate::io::log::{SessionRead, read_dwells, read_dwells_beside};
use crate::io::tables::logs::LogTable;
use crate::join::join_at_rest;
use crate::pipeline::outcome::JoinedSession;
use crate::pipeline::plan::{Plan, SessionFiles};
use crate::pipeline::{damage, driven};
use crate::progress::Progress;

/// Reads a session, and meanwhile writes its decoded samples, where they are to be published.
pub(super) fn read_for(
    plan: &Plan,
    files: &SessionFiles,
    run: &mut OpenRun<'_>,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    if !plan.logs {
        return read(plan, files, progress);
    }
    let (logs, mapping, rule) = (&files.logs, &plan.mapping, plan.join.arm_rule());
    let mut samples = LogTable::new(run, &files.name);
    let read = read_dwells_beside(logs, mapping, plan.limits, &rule, &mut samples, progress)?;
    within(plan, files, &read.recording)?;
    if let Some(table) = samples.finish((&read).into())? {
        run.keep(table);
    }
    Ok(read)
}

/// Reads a session.
pub(in crate::pipeline) fn read(
    plan: &Plan,
    files: &SessionFiles,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    let rule = plan.join.arm_rule();
    let read = read_dwells(&files.logs, &plan.mapping, plan.limits, &rule, progress)?;
    within(plan, files, &read.recording)?;
    Ok(read)
}

/// That no more of the logs was lost than the pipeline file allows.
fn within(plan: &Plan, files: &SessionFiles, recording: &Recording) -> Result<(), RunError> {
    damage::within(&recording.counts, plan.max_lost_share).map_err(|damage| RunError::Damaged {
        session: files.name.clone(),
        damage,
    })
}

/// Joins a session that was read.
pub(in crate::pipeline) fn joined(
    plan: &Plan,
    files: &SessionFiles,
    read: SessionRead,
) -> Result<JoinedSession, RunError> {
    let wrong = |source| RunError::Join {
        session: files.name.clone(),
        source: Box::new(source),
    };
    let SessionRead {
        recording,
        joints,
        commands,
        readings,
    } = read;
    let (commands, readings) = (&*commands, &*readings);
    let joined = join_at_rest(
        &recording, &joints, commands, readings, &plan.arm, &plan.join,
    );
    let joined = joined.map_err(wrong)?;
    let no_commands = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: None,
    };
    let commanded = commanded(
        &joined.stations,
        &plan.arm,
        &plan.command_frames.unwrap_or(no_commands),
    );
    Ok(JoinedSession {
        name: files.name.clone(),
        sampling_plan: recording.metadata.get("session.plan").cloned(),
        driven_by: driven::driven_by(files, &joined.stations, plan.limits)?,
        log_rejects: recording.rejects,
        counts: recording.counts,
        joined,
        commanded,
    })
}
