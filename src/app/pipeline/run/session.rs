//! One session: read and joined, from its two logs or from a table of its stations.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use super::{Result, RunError, mounting};
use crate::files::input::Bound;
use crate::fit::commanded::{CommandFrames, commanded};
use crate::fit::full::knocks;
use crate::fit::{Mounted, report_steps};
use crate::ingest::covariances::CovarianceCounts;
use crate::ingest::{Mapping, StationsSettings};
use crate::io::lake::OpenRun;
use crate::io::log::{JointSink, SessionLogs, SessionRead, read_session};
use crate::io::station_table;
use crate::io::tables::joined_sessions::Restored;
use crate::io::tables::logs::LogTable;
use crate::join::supposed::Supposed;
use crate::join::tabled::tabled;
use crate::join::{JoinError, JoinInput, Joined, RowItem, SourceId, join};
use crate::judgement::{DrivenBy, JoinedSession};
use crate::pipeline::configuration::{Configuration, Reads, Recorded, SessionFiles, SessionTable};
use crate::pipeline::{damage, driven};
use crate::progress::Progress;
use crate::setup::{self, Evidence, Finding};

/// Reads and joins a session. Decoded samples of its logs are written to `run`, where there is one and the pipeline file publishes
/// them.
pub(in crate::pipeline) fn session(
    configuration: &Configuration,
    files: &SessionFiles,
    run: Option<&mut OpenRun<'_>>,
    progress: &dyn Progress,
) -> Result<JoinedSession> {
    match (&files.recorded, &configuration.reads) {
        (Recorded::Logs(logs), Reads::Logs(mapping)) => {
            let own = OwnLogs { configuration, files, logs, mapping };
            let read = own.read_into(run, progress)?;
            own.joined(read).map_err(|error| own.mounted_otherwise(error, progress))
        }
        (Recorded::Table(table), Reads::Tables(settings)) => {
            of_table(configuration, files, table, settings)
        }
        // Sessions are looked for as what the pipeline file reads, and those as joined are read back before.
        (Recorded::Logs(_), Reads::Tables(_))
        | (Recorded::Table(_), Reads::Logs(_))
        | (Recorded::Joined(_), _) => Err(RunError::OtherKind { session: files.name.clone() }),
    }
}

struct OwnLogs<'a> {
    configuration: &'a Configuration,
    files: &'a SessionFiles,
    logs: &'a SessionLogs,
    mapping: &'a Mapping,
}

impl OwnLogs<'_> {
    /// Reads the logs, and writes their decoded samples at the same time, where they are to be published.
    fn read_into(
        &self,
        run: Option<&mut OpenRun<'_>>,
        progress: &dyn Progress,
    ) -> Result<SessionRead> {
        let Some(run) = run.filter(|_| self.configuration.file.output.logs) else {
            return self.read(&mut (), progress);
        };
        let mut samples = LogTable::new(run, &self.files.name);
        let read = self.read(&mut samples, progress)?;
        if let Some(table) = samples.finish(&read.input)? {
            run.keep(table);
        }
        Ok(read)
    }

    /// Reads the logs; their joint samples go to `sink` too.
    fn read(&self, sink: &mut dyn JointSink, progress: &dyn Progress) -> Result<SessionRead> {
        let (limits, rule) =
            (self.configuration.file.limits, self.configuration.file.join.arm_rule());
        let read = read_session(self.logs, self.mapping, limits, &rule, sink, progress)?;
        // No more of the logs may be lost than the pipeline file allows.
        damage::within(&read.counts, self.configuration.file.input.max_lost_share)
            .map_err(|damage| RunError::Damaged { session: self.files.name.clone(), damage })?;
        Ok(read)
    }

    /// The error of logs that contradict the stated set-up: of a camera's, that it is mounted otherwise, where they can be joined so.
    fn mounted_otherwise(&self, error: RunError, progress: &dyn Progress) -> RunError {
        let is_of_set_up = matches!(
            error,
            RunError::SetUp { .. } | RunError::Join { .. } | RunError::Unexplained { .. }
        );
        let (true, Some(stated)) = (is_of_set_up, mounted(self.configuration)) else {
            return error;
        };
        let mut mapping = self.mapping.clone();
        mapping.tracker.eye_in_hand = !mapping.tracker.eye_in_hand;
        let Self { configuration, files, logs, .. } = *self;
        let other = OwnLogs { configuration, files, logs, mapping: &mapping };
        let joined = other.read(&mut (), progress);
        let joined = joined.and_then(|read| other.joined(read));
        joined.map_or(error, |joined| RunError::Mounted {
            session: self.files.name.clone(),
            stated: mounting::key(stated),
            right: mounting::key(mounting::other(stated)),
            evidence: format!("so {} dwells are joined", joined.joined.paired()),
        })
    }

    fn joined(&self, read: SessionRead) -> Result<JoinedSession> {
        let (configuration, files) = (self.configuration, self.files);
        let (arm, settings) = (&configuration.arm, &configuration.file.join);
        let joined = join(&read.input, arm, settings);
        let mut joined = joined.map_err(|source| unjoined(configuration, files, &read, source))?;
        // Where nothing explains all of a disagreement, the logs may be joined at a wrong offset.
        let set_up =
            set_up(configuration, files, &joined, || explained_anew(configuration, &read))?;
        without_knocks(configuration, files, &mut joined)?;
        let counts = with_references(read.counts, &read.input, &joined);
        Ok(JoinedSession {
            sampling_plan: read.metadata.get("session.plan").cloned(),
            log_rejects: read.rejects,
            counts,
            set_up,
            ..with_commands(configuration, files, joined)?
        })
    }
}

/// The counts of a session's logs with those of the readings of references: read, used in looks, and left out.
fn with_references(
    mut counts: BTreeMap<String, u64>,
    input: &JoinInput,
    joined: &Joined,
) -> BTreeMap<String, u64> {
    if input.references.is_empty() {
        return counts;
    }
    let read = input.references.iter();
    let read: u64 = read.map(|own| own.readings.count() as u64).sum();
    let rejects = joined.rejects.iter().filter(|own| own.is_of_reference);
    let rejected: u64 = rejects.map(|own| own.readings).sum();
    let numbers =
        [("messages", read), ("kept", read.saturating_sub(rejected)), ("rejected", rejected)];
    for (name, number) in numbers {
        counts.insert(format!("references.{name}"), number);
    }
    counts
}

/// The session of a result of ingest and join: commands and the check of the set-up follow from its stations.
pub(super) fn of_joined(
    configuration: &Configuration,
    files: &SessionFiles,
    restored: Restored,
) -> Result<JoinedSession> {
    let set_up = set_up(configuration, files, &restored.joined, || None)?;
    Ok(JoinedSession {
        log_rejects: restored.log_rejects,
        counts: restored.counts,
        sampling_plan: restored.sampling_plan,
        set_up,
        ..commanded_in(configuration, files, restored.joined, restored.driven_by)
    })
}

/// Where the camera is mounted, as the pipeline file states it; `None` of another instrument.
fn mounted(configuration: &Configuration) -> Option<Mounted> {
    let source = configuration.stages.noise.source(SourceId::ONLY);
    Some(source.uncertainty.camera()?.mounted)
}

fn of_table(
    configuration: &Configuration,
    files: &SessionFiles,
    table: &SessionTable,
    settings: &StationsSettings,
) -> Result<JoinedSession> {
    let joints = configuration.arm.joints().iter();
    let slides: Vec<bool> = joints.map(|joint| joint.slides).collect();
    let bound = Bound::of(configuration.file.limits);
    let read = station_table::read(&table.path, settings, &table.whose, &slides, bound)?;
    let mounted = mounted(configuration);
    if let Some(mounted) = mounted {
        mounting::check(&configuration.arm, &files.name, mounted, &read.rows)?;
    }
    let rows = match mounted {
        Some(Mounted::Flange) => read.rows.of_camera_on_flange(),
        Some(Mounted::Fixed) | None => read.rows,
    };
    let mut joined = tabled(rows, &configuration.arm, &configuration.file.join);
    let set_up = set_up(configuration, files, &joined, || None)?;
    without_knocks(configuration, files, &mut joined)?;
    Ok(JoinedSession {
        counts: row_counts(read.read, read.covariances, &joined),
        set_up,
        ..with_commands(configuration, files, joined)?
    })
}

/// Rows read, kept and rejected, as the messages of a log are counted.
fn row_counts(read: u64, covariances: CovarianceCounts, joined: &Joined) -> BTreeMap<String, u64> {
    let rejected = |kind: RowItem| {
        let rejects = joined.row_rejects.iter();
        rejects.filter(|own| own.kind == kind).count() as u64
    };
    let rows = ("rows", read.saturating_sub(rejected(RowItem::Row)), rejected(RowItem::Row));
    let used = joined.references.iter().flat_map(|course| &course.followed.places);
    let used: u64 = used.map(|place| place.readings as u64).sum();
    let references = ("references", used, rejected(RowItem::Reference));
    let has_references = used > 0 || references.2 > 0;
    let streams = [Some(rows), has_references.then_some(references)];
    let counts = streams.into_iter().flatten().flat_map(|(name, kept, rejected)| {
        [
            (format!("{name}.messages"), kept + rejected),
            (format!("{name}.kept"), kept),
            (format!("{name}.rejected"), rejected),
        ]
    });
    let stated = covariances.named();
    let stated = stated.map(|(name, count)| (format!("readings.{name}"), count));
    counts.chain(stated).collect()
}

/// A session with the commands of its stations and the targets that drove it.
fn with_commands(
    configuration: &Configuration,
    files: &SessionFiles,
    joined: Joined,
) -> Result<JoinedSession> {
    let driven_by = driven::driven_by(files, &joined.stations, configuration.file.limits)?;
    Ok(commanded_in(configuration, files, joined, driven_by))
}

/// A session with the commands of its stations in the frames that the pipeline file states.
fn commanded_in(
    configuration: &Configuration,
    files: &SessionFiles,
    joined: Joined,
    driven_by: Option<DrivenBy>,
) -> JoinedSession {
    let no_commands =
        CommandFrames { base_from_command: Isometry3::identity(), flange_from_tool: None };
    let frames = configuration.command_frames.unwrap_or(no_commands);
    JoinedSession {
        name: files.name.clone(),
        sampling_plan: None,
        driven_by,
        log_rejects: Vec::new(),
        counts: BTreeMap::new(),
        commanded: commanded(&joined.stations, &configuration.arm, &frames),
        joined,
        set_up: None,
        stated_sizes: Vec::new(),
    }
}

/// Takes knocks of the instrument or the base out of a session that no references follow.
fn without_knocks(
    configuration: &Configuration,
    files: &SessionFiles,
    joined: &mut Joined,
) -> Result<()> {
    if joined.references.is_empty() {
        let up = configuration.stages.up;
        let knocks = knocks::taken_out(&mut joined.stations, &configuration.arm, up);
        joined.knocks = knocks.map_err(|source| join_error(files, source))?;
        let last = report_steps::check_last(&joined.stations, &configuration.arm);
        last.map_err(|source| join_error(files, source))?;
    }
    Ok(())
}

/// The disagreement of a joined session with the stated set-up: an error where it is grave, a finding where it is small. `anew` is
/// the mistake that explains it when the session is joined anew.
fn set_up(
    configuration: &Configuration,
    files: &SessionFiles,
    joined: &Joined,
    anew: impl FnOnce() -> Option<Finding>,
) -> Result<Option<Finding>> {
    if let Some(frames) = &configuration.command_frames {
        let stepped = report_steps::check(&joined.stations, &configuration.arm, frames);
        stepped.map_err(|source| join_error(files, source))?;
    }
    let stated = &configuration.set_up;
    let gate_mm = configuration.file.join.geometry_gate_mm;
    let evidence = Evidence::of_stations(&joined.stations);
    let found = setup::check(&stated.set_up, &evidence, &stated.alternatives, gate_mm);
    match found {
        Some(finding) if finding.is_grave => {
            // Fewer than half of the dwells may have been joined at a wrong offset, where a plane agrees with its mirror.
            let is_whole = 2 * joined.paired() >= joined.stations.len();
            let anew = if is_whole && !finding.mistakes.is_empty() { None } else { anew() };
            let finding = Box::new(anew.unwrap_or(finding));
            Err(RunError::SetUp { session: files.name.clone(), finding })
        }
        found => Ok(found),
    }
}

fn join_error(files: &SessionFiles, source: JoinError) -> RunError {
    RunError::Join { session: files.name.clone(), source: Box::new(source) }
}

/// The error of logs that cannot be joined, with the mistake of the set-up that explains it.
fn unjoined(
    configuration: &Configuration,
    files: &SessionFiles,
    read: &SessionRead,
    source: JoinError,
) -> RunError {
    let is_searched =
        matches!(source, JoinError::NoCommonPattern { .. } | JoinError::AmbiguousShift { .. });
    if !is_searched {
        return join_error(files, source);
    }
    let (session, source) = (files.name.clone(), Box::new(source));
    match explained_anew(configuration, read) {
        Some(finding) => RunError::SetUp { session, finding: Box::new(finding) },
        None => RunError::Unexplained { session, source },
    }
}

/// The mistake under whose correction the logs can be joined; `None` where there is none.
fn explained_anew(configuration: &Configuration, read: &SessionRead) -> Option<Finding> {
    let (stated, settings) = (&configuration.set_up, &configuration.file.join);
    let supposed = Supposed::of(&read.input, &configuration.arm, settings).ok()?;
    setup::explain(&stated.set_up, &supposed, &stated.alternatives, settings.geometry_gate_mm)
}
