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

/// The files of one session, and the configuration that says how they are read.
#[derive(Clone, Copy)]
pub(in crate::pipeline) struct SessionSource<'a> {
    pub(in crate::pipeline) configuration: &'a Configuration,
    pub(in crate::pipeline) files: &'a SessionFiles,
}

impl SessionSource<'_> {
    /// Reads and joins the session. Decoded samples of its logs are written to `run`, where there is one and the pipeline file publishes
    /// them.
    pub(in crate::pipeline) fn joined(
        self,
        run: Option<&mut OpenRun<'_>>,
        progress: &dyn Progress,
    ) -> Result<JoinedSession> {
        match (&self.files.recorded, &self.configuration.reads) {
            (Recorded::Logs(logs), Reads::Logs(mapping)) => {
                let own = OwnLogs { source: self, logs, mapping };
                let read = own.read_into(run, progress)?;
                own.joined(read).map_err(|error| own.mounted_otherwise(error, progress))
            }
            (Recorded::Table(table), Reads::Tables(settings)) => self.of_table(table, settings),
            // Sessions are looked for as what the pipeline file reads, and those as joined are read back before.
            (Recorded::Logs(_), Reads::Tables(_))
            | (Recorded::Table(_), Reads::Logs(_))
            | (Recorded::Joined(_), _) => {
                Err(RunError::OtherKind { session: self.files.name.clone() })
            }
        }
    }

    /// The session of a result of ingest and join: commands and the check of the set-up follow from its stations.
    pub(super) fn of_joined(self, restored: Restored) -> Result<JoinedSession> {
        let set_up = self.set_up(&restored.joined, || None)?;
        Ok(JoinedSession {
            log_rejects: restored.log_rejects,
            counts: restored.counts,
            sampling_plan: restored.sampling_plan,
            set_up,
            ..self.commanded(restored.joined, restored.driven_by)
        })
    }

    fn of_table(self, table: &SessionTable, settings: &StationsSettings) -> Result<JoinedSession> {
        let Self { configuration, files } = self;
        let slides: Vec<_> = configuration.arm.joints().iter().map(|joint| joint.slides).collect();
        let bound = Bound::of(configuration.file.limits);
        let read = station_table::read(&table.path, settings, &table.whose, &slides, bound)?;
        let mounted = self.mounted();
        if let Some(mounted) = mounted {
            mounting::check(&configuration.arm, &files.name, mounted, &read.rows)?;
        }
        let rows = match mounted {
            Some(Mounted::Flange) => read.rows.of_camera_on_flange(),
            Some(Mounted::Fixed) | None => read.rows,
        };
        let mut joined = tabled(rows, &configuration.arm, &configuration.file.join);
        let set_up = self.set_up(&joined, || None)?;
        self.take_knocks_out(&mut joined)?;
        Ok(JoinedSession {
            counts: row_counts(read.read, read.covariances, &joined),
            set_up,
            ..self.with_commands(joined)?
        })
    }

    /// Where the camera is mounted, as the pipeline file states it; `None` of another instrument.
    fn mounted(self) -> Option<Mounted> {
        let source = self.configuration.stages.noise.source(SourceId::ONLY);
        Some(source.uncertainty.camera()?.mounted)
    }

    /// The session with the commands of its stations and the targets that drove it.
    fn with_commands(self, joined: Joined) -> Result<JoinedSession> {
        let limits = self.configuration.file.limits;
        let driven_by = driven::driven_by(self.files, &joined.stations, limits)?;
        Ok(self.commanded(joined, driven_by))
    }

    /// The session with the commands of its stations in the frames that the pipeline file states.
    fn commanded(self, joined: Joined, driven_by: Option<DrivenBy>) -> JoinedSession {
        let no_commands =
            CommandFrames { base_from_command: Isometry3::identity(), flange_from_tool: None };
        let frames = self.configuration.command_frames.unwrap_or(no_commands);
        JoinedSession {
            name: self.files.name.clone(),
            sampling_plan: None,
            driven_by,
            log_rejects: Vec::new(),
            counts: BTreeMap::new(),
            commanded: commanded(&joined.stations, &self.configuration.arm, &frames),
            joined,
            set_up: None,
            stated_sizes: Vec::new(),
        }
    }

    /// Takes knocks of the instrument or the base out of a session that no references follow.
    fn take_knocks_out(self, joined: &mut Joined) -> Result<()> {
        if joined.references.is_empty() {
            let (arm, up) = (&self.configuration.arm, self.configuration.stages.up);
            let knocks = knocks::taken_out(&mut joined.stations, arm, up);
            joined.knocks = knocks.map_err(|source| self.join_error(source))?;
            let last = report_steps::check_last(&joined.stations, arm);
            last.map_err(|source| self.join_error(source))?;
        }
        Ok(())
    }

    /// The disagreement of a joined session with the stated set-up: an error where it is grave, a finding where it is small. `anew` is
    /// the mistake that explains it when the session is joined anew.
    fn set_up(
        self,
        joined: &Joined,
        anew: impl FnOnce() -> Option<Finding>,
    ) -> Result<Option<Finding>> {
        let Self { configuration, files } = self;
        if let Some(frames) = &configuration.command_frames {
            let stepped = report_steps::check(&joined.stations, &configuration.arm, frames);
            stepped.map_err(|source| self.join_error(source))?;
        }
        let stated = &configuration.set_up;
        let gate_mm = configuration.file.join.geometry_gate_mm;
        let evidence = Evidence::of_stations(&joined.stations);
        let found = setup::check(&stated.set_up, &evidence, &stated.alternatives, gate_mm);
        match found.or_else(|| self.of_another_target(joined)) {
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

    /// The disagreement of a target that is not the main one, whose readings alone contradict the arm.
    fn of_another_target(self, joined: &Joined) -> Option<Finding> {
        let Configuration { set_up: stated, file, stages, .. } = self.configuration;
        let set_up = stated.set_up.of_another_target();
        let mut others = Evidence::of_others(&joined.stations);
        others.find_map(|(target, evidence)| {
            let gate_mm = file.join.geometry_gate_mm;
            let found = setup::check(&set_up, &evidence, &stated.alternatives, gate_mm)?;
            let name = target.name(&stages.fit.target_names);
            found.is_grave.then_some(Finding { target: Some(name), ..found })
        })
    }

    fn join_error(self, source: JoinError) -> RunError {
        RunError::Join { session: self.files.name.clone(), source: Box::new(source) }
    }

    /// The error of logs that cannot be joined, with the mistake of the set-up that explains it.
    fn unjoined(self, read: &SessionRead, source: JoinError) -> RunError {
        let is_searched =
            matches!(source, JoinError::NoCommonPattern { .. } | JoinError::AmbiguousShift { .. });
        if !is_searched {
            return self.join_error(source);
        }
        let (session, source) = (self.files.name.clone(), Box::new(source));
        match self.explained_anew(read) {
            Some(finding) => RunError::SetUp { session, finding: Box::new(finding) },
            None => RunError::Unexplained { session, source },
        }
    }

    /// The mistake under whose correction the logs can be joined; `None` where there is none.
    fn explained_anew(self, read: &SessionRead) -> Option<Finding> {
        let (stated, settings) = (&self.configuration.set_up, &self.configuration.file.join);
        let supposed = Supposed::of(&read.input, &self.configuration.arm, settings).ok()?;
        setup::explain(&stated.set_up, &supposed, &stated.alternatives, settings.geometry_gate_mm)
    }
}

struct OwnLogs<'a> {
    source: SessionSource<'a>,
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
        let SessionSource { configuration, files } = self.source;
        let Some(run) = run.filter(|_| configuration.file.output.logs) else {
            return self.read(&mut (), progress);
        };
        let mut samples = LogTable::new(run, &files.name);
        let read = self.read(&mut samples, progress)?;
        if let Some(table) = samples.finish(&read.input)? {
            run.keep(table);
        }
        Ok(read)
    }

    /// Reads the logs; their joint samples go to `sink` too.
    fn read(&self, sink: &mut dyn JointSink, progress: &dyn Progress) -> Result<SessionRead> {
        let SessionSource { configuration, files } = self.source;
        let (limits, rule) = (configuration.file.limits, configuration.file.join.arm_rule());
        let read = read_session(self.logs, self.mapping, limits, &rule, sink, progress)?;
        // No more of the logs may be lost than the pipeline file allows.
        damage::within(&read.counts, configuration.file.input.max_lost_share)
            .map_err(|damage| RunError::Damaged { session: files.name.clone(), damage })?;
        Ok(read)
    }

    /// The error of logs that contradict the stated set-up: of a camera's, that it is mounted otherwise, where they can be joined so.
    fn mounted_otherwise(&self, error: RunError, progress: &dyn Progress) -> RunError {
        let is_of_set_up = matches!(
            error,
            RunError::SetUp { .. } | RunError::Join { .. } | RunError::Unexplained { .. }
        );
        let (true, Some(stated)) = (is_of_set_up, self.source.mounted()) else { return error };
        let mut mapping = self.mapping.clone();
        mapping.tracker.eye_in_hand = !mapping.tracker.eye_in_hand;
        let other = OwnLogs { mapping: &mapping, ..*self };
        let joined = other.read(&mut (), progress);
        let joined = joined.and_then(|read| other.joined(read));
        joined.map_or(error, |joined| RunError::Mounted {
            session: self.source.files.name.clone(),
            stated: mounting::key(stated),
            right: mounting::key(mounting::other(stated)),
            evidence: format!("so {} dwells are joined", joined.joined.paired()),
        })
    }

    fn joined(&self, read: SessionRead) -> Result<JoinedSession> {
        let source = self.source;
        let (arm, settings) = (&source.configuration.arm, &source.configuration.file.join);
        let joined = join(&read.input, arm, settings);
        let mut joined = joined.map_err(|error| source.unjoined(&read, error))?;
        // Where nothing explains all of a disagreement, the logs may be joined at a wrong offset.
        let set_up = source.set_up(&joined, || source.explained_anew(&read))?;
        source.take_knocks_out(&mut joined)?;
        let counts = with_references(read.counts, &read.input, &joined);
        Ok(JoinedSession {
            sampling_plan: read.metadata.get("session.plan").cloned(),
            log_rejects: read.rejects,
            counts,
            set_up,
            ..source.with_commands(joined)?
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
    let read: u64 = input.references.iter().map(|own| own.readings.count() as u64).sum();
    let rejects = joined.rejects.iter().filter(|own| own.is_of_reference);
    let rejected: u64 = rejects.map(|own| own.readings).sum();
    let numbers =
        [("messages", read), ("kept", read.saturating_sub(rejected)), ("rejected", rejected)];
    for (name, number) in numbers {
        counts.insert(format!("references.{name}"), number);
    }
    counts
}

/// Rows read, kept and rejected, as the messages of a log are counted.
fn row_counts(read: u64, covariances: CovarianceCounts, joined: &Joined) -> BTreeMap<String, u64> {
    let rejected =
        |kind: RowItem| joined.row_rejects.iter().filter(|own| own.kind == kind).count() as u64;
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
    let stated = covariances.named().map(|(name, count)| (format!("readings.{name}"), count));
    counts.chain(stated).collect()
}
