//! The data of an arm: files with their digests checked, read and joined as its pipeline file says.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::error::BenchmarkError;
use crate::benchmark::suite::{SuiteArm, SuiteFile};
use crate::io::input::{self, Bound};
use crate::io::tables::outcome::JoinedSession;
use crate::manifest::{self, Input, ROBOT};
use crate::pipeline::configuration::{Configuration, Overrides, SessionFiles, Why, files};
use crate::pipeline::run;
use crate::progress::Progress;

/// An arm with its sessions.
#[derive(Debug)]
pub(super) struct ArmData {
    pub(super) configuration: Configuration,
    /// The sessions, in the suite's order.
    pub(super) sessions: Vec<JoinedSession>,
    /// The files, with the digest of each.
    pub(super) inputs: Vec<Input>,
    /// What the suite does not state of its files, in sentences.
    pub(super) remarks: Vec<String>,
}

impl ArmData {
    /// Reads the sessions of an arm; `base` is the suite's folder, `data` that of the files where it is not the pipeline file's.
    pub(super) fn read(
        arm: &SuiteArm,
        base: &Path,
        data: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<Self, BenchmarkError> {
        let of_pipeline =
            |source| BenchmarkError::Pipeline { arm: arm.name.clone(), source: Box::new(source) };
        let path = base.join(&arm.pipeline);
        let mut files = files::read(&path, None).map_err(of_pipeline)?;
        let section = &mut files.file.input;
        if let Some(data) = data {
            section.folder = std::path::absolute(data).unwrap_or_else(|_| data.to_owned());
        }
        if let Some(folder) = &arm.folder {
            section.folder.push(folder);
        }
        let names: Vec<String> = arm.sessions.iter().map(|own| own.name.clone()).collect();
        files.file.input.sessions = Some(names);
        files.file.input.test = Vec::new();
        let folder = files.sessions().named();
        let checked = checked(arm, &folder)?;
        let tree = files.tree().map_err(of_pipeline)?;
        let configuration = Configuration::of(&path, files, tree, None, &Overrides::default());
        let configuration = configuration.map_err(of_pipeline)?;
        let sessions = sessions(arm, &configuration, progress)?;
        let mut inputs = vec![robot(arm, &configuration.robot_file)?];
        inputs.extend(checked.inputs);
        Ok(Self { configuration, sessions, inputs, remarks: checked.remarks })
    }

    /// The session of that name.
    pub(super) fn session(&self, name: &str) -> Option<&JoinedSession> {
        self.sessions.iter().find(|own| own.name == name)
    }

    /// Items read, kept and left out of each session, in a sentence.
    pub(super) fn told(&self) -> Vec<String> {
        self.sessions.iter().map(told).collect()
    }
}

/// Files that are what the suite says.
struct Checked {
    inputs: Vec<Input>,
    remarks: Vec<String>,
}

/// Digests every file, and compares it with the suite's.
fn checked(arm: &SuiteArm, folder: &Path) -> Result<Checked, BenchmarkError> {
    let mut checked = Checked { inputs: Vec::new(), remarks: Vec::new() };
    for session in &arm.sessions {
        for file in &session.files {
            let input = digested(arm, file, folder.join(&file.path))?;
            if file.blake3.is_none() {
                checked.remarks.push(format!(
                    "arm {:?}: the suite states no digest of {}; that of this file is blake3 = {:?}",
                    arm.name,
                    file.path.display(),
                    input.digest
                ));
            }
            checked.inputs.push(input);
        }
    }
    Ok(checked)
}

fn digested(arm: &SuiteArm, file: &SuiteFile, path: PathBuf) -> Result<Input, BenchmarkError> {
    if !path.exists() {
        return Err(BenchmarkError::not_there(arm, file, path));
    }
    let input = input(arm, &path, &file.path.to_string_lossy())?;
    match &file.blake3 {
        Some(stated) if !stated.eq_ignore_ascii_case(&input.digest) => {
            Err(BenchmarkError::Digest {
                arm: arm.name.clone(),
                path,
                found: input.digest,
                stated: stated.clone(),
                repository: arm.source.repository.clone(),
            })
        }
        _ => Ok(input),
    }
}

fn robot(arm: &SuiteArm, path: &Path) -> Result<Input, BenchmarkError> {
    input(arm, path, ROBOT)
}

/// A file of an arm as an input, with its digest.
pub(super) fn input(arm: &SuiteArm, path: &Path, name: &str) -> Result<Input, BenchmarkError> {
    let digested = input::open(path, Bound::ANY).and_then(manifest::digest);
    let (digest, bytes) = digested.map_err(|source| BenchmarkError::Input {
        arm: arm.name.clone(),
        path: path.to_owned(),
        source,
    })?;
    Ok(Input { name: name.to_owned(), bytes, digest })
}

/// The sessions of an arm, read and joined, in the suite's order.
fn sessions(
    arm: &SuiteArm,
    configuration: &Configuration,
    progress: &dyn Progress,
) -> Result<Vec<JoinedSession>, BenchmarkError> {
    let pieces = configuration.pieces.iter();
    let found: BTreeMap<&str, &SessionFiles> =
        pieces.flat_map(|piece| &piece.training).map(|files| (&*files.name, files)).collect();
    let mut sessions = Vec::new();
    for own in &arm.sessions {
        let wrong = |reason: String| BenchmarkError::Session {
            arm: arm.name.clone(),
            session: own.name.clone(),
            reason,
        };
        let Some(files) = found.get(&*own.name) else {
            let mut aside = configuration.set_aside.iter();
            let aside = aside.find(|aside| aside.session == own.name);
            let reason = aside.map(|aside| Why::reason(&aside.why));
            return Err(wrong(reason.unwrap_or("the pipeline file does not find it").to_owned()));
        };
        let joined = run::session(configuration, files, None, progress);
        let joined = joined.map_err(|source| BenchmarkError::Run {
            arm: arm.name.clone(),
            source: Box::new(source),
        })?;
        let found = joined.joined.stations.len();
        if let Some(stations) = own.stations.filter(|stations| *stations != found) {
            return Err(wrong(format!(
                "{found} stations were read, and the suite's lists are for {stations}: the pipeline file reads the data otherwise than the suite \
                 was written for"
            )));
        }
        sessions.push(joined);
    }
    Ok(sessions)
}

fn told(session: &JoinedSession) -> String {
    let stations = &session.joined.stations;
    let measured = stations.iter().filter(|own| !own.measured().is_empty());
    let mut told = format!(
        "session {}: {} stations, {} with a reading",
        session.name,
        stations.len(),
        measured.count()
    );
    let counts = session.counts.keys();
    let streams: BTreeSet<&str> =
        counts.filter_map(|name| name.strip_suffix(".messages")).collect();
    for stream in streams {
        let number =
            |part: &str| session.counts.get(&format!("{stream}.{part}")).copied().unwrap_or(0);
        let (read, rejected) = (number("messages"), number("rejected"));
        let kept = read.saturating_sub(rejected);
        write!(told, "; {stream}: {read} read = {kept} kept + {rejected} left out")
            .expect("a string");
    }
    told
}
