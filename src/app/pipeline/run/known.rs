//! Work that was done before, known by the sizes, tags and times of its files: none of them is opened.
//!
//! The state of a piece of work is a digest of what its run follows from, with the size and the tag of each file, or its times where
//! the storage has no tags, in the place of its contents. A batch keeps in the lake's index what it told of the run that a state led to
//! ([`INDEX`]); a later one with the same state tells it again. A file that changed within the last moments has
//! no state yet, so that a second change in the same instant is not overlooked: it is digested. Runs that are gone from `runs` are
//! not told, nor are those of sessions whose current run was changed by a request since.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::{Done, Took};
use crate::files::input::{self, Bound};
use crate::files::store::Listed;
use crate::io::lake::{INDEX, Lake, LakeError, PAGES, alone_key, request_key};
use crate::io::rows::Word as _;
use crate::io::tables::words::VerdictOf;
use crate::manifest::{self, RunKey, VERSION};
use crate::pipeline::configuration::{Recorded, SessionFiles, Tree};
use crate::pipeline::fleet::FleetPiece;

/// A file that changed later than this may change again at a time that is stated alike.
const SETTLED: Duration = Duration::from_secs(2);

/// Work that was done before, and what is added to it.
#[derive(Debug)]
pub struct Known {
    pub lake: Lake,
    /// What was told, by the state that led to it.
    before: BTreeMap<String, Told>,
    /// What the lake holds; `None` where it is asked for each piece of work.
    listed: Option<Held>,
    /// What single tasks told, by the state that led to it, as far as it was gathered.
    gathered: Mutex<BTreeMap<String, Told>>,
    /// Digest of each robot file, read once.
    robots: Mutex<BTreeMap<PathBuf, Option<String>>>,
    now: Mutex<BTreeMap<String, Told>>,
}

#[derive(Debug, Default)]
struct Held {
    /// The files of tasks that were done alone, by their states.
    alone: BTreeMap<String, Listed>,
    /// Keys of the rows of all runs and of all requests.
    rows: BTreeSet<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Told {
    #[serde(flatten)]
    key: RunKey,
    /// Number of the last request of the session, when the run was current.
    asked: u64,
    /// Whether it is met; `None` where it could not be shown.
    met: Option<bool>,
    of: Option<String>,
    reason: Option<String>,
    rejected: Vec<String>,
    has_page: bool,
    /// `None` where the lake had the run before, or an earlier version made it.
    #[serde(default)]
    took: Option<Took>,
}

impl Known {
    /// Reads the index of a lake, and lists its runs where it has one.
    pub fn read(lake: Lake) -> Result<Self, LakeError> {
        let before = index(&lake);
        let alone = lake.kept_alone()?;
        let rows = if before.is_empty() && alone.is_empty() {
            BTreeSet::new()
        } else {
            lake.run_and_request_keys()?
        };
        Ok(Self { before, listed: Some(Held { alone, rows }), ..Self::nothing(lake) })
    }

    /// Asks a lake for one piece of work at a time: for a task, which is one of many. A task was listed as what the index does not
    /// know, so that the index is not read.
    pub fn one_by_one(lake: Lake) -> Self {
        Self { listed: None, ..Self::nothing(lake) }
    }

    pub fn nothing(lake: Lake) -> Self {
        Self {
            lake,
            before: BTreeMap::new(),
            listed: Some(Held::default()),
            gathered: Mutex::default(),
            robots: Mutex::default(),
            now: Mutex::default(),
        }
    }

    /// The state of a piece of work; `None` where a file of it has none, as it changed in the last moments.
    pub fn state(&self, own: FleetPiece<'_>) -> Option<String> {
        are_settled(own).then(|| self.state_now(own))?
    }

    /// The state of a piece of work once none of its files can change in the moment that it states: where one changed just now, or later
    /// than this machine's clock says that it is, after it was watched for as long as that takes.
    pub fn settled_state(&self, own: FleetPiece<'_>) -> Option<String> {
        if !are_settled(own) {
            sleep(SETTLED);
        }
        self.state_now(own)
    }

    /// The state of a piece of work as its files are now, to be held against an earlier one: what had a state when it was listed
    /// has the same one for as long as it does not change, whatever the clock of the machine that looks.
    pub fn state_now(&self, own: FleetPiece<'_>) -> Option<String> {
        let FleetPiece { configuration, piece, .. } = own;
        let mut hasher = blake3::Hasher::new();
        let mut add = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        add(VERSION);
        add(&configuration.pipeline);
        add(configuration.robot.as_deref().unwrap_or_default());
        add(&configuration.settings);
        add(&self.robot(&configuration.robot_file)?);
        add(&piece.session);
        for (role, files) in [("learns", &piece.training), ("judges", &piece.test)] {
            for session in files {
                add(role);
                for text in of_session(&configuration.tree, session)? {
                    add(&text);
                }
            }
        }
        Some(hasher.finalize().to_hex().to_string())
    }

    /// What was told of the run that a state led to; `None` where nothing was, or the run is gone or not the current one.
    pub fn told(&self, state: &str) -> Option<Done> {
        let in_index = self.before.get(state).filter(|own| self.is_current(own));
        let told = match in_index {
            Some(told) => told.clone(),
            None => self.told_alone(state).filter(|own| self.is_current(own))?,
        };
        let done = told.done(&self.lake)?;
        self.add(state, told);
        Some(done)
    }

    /// Reads what single tasks told of these states, several files at once; what the index has of current runs is not read.
    pub fn gather(&self, states: impl IntoIterator<Item = String>) {
        let Some(held) = self.listed.as_ref().filter(|held| !held.alone.is_empty()) else { return };
        let is_known =
            |state: &String| self.before.get(state).is_some_and(|own| self.is_current(own));
        let unread = states.into_iter().filter(|state| !is_known(state));
        let listed = unread.filter_map(|state| Some((held.alone.get(&state)?.clone(), state)));
        let (files, states): (Vec<Listed>, Vec<String>) = listed.unzip();
        let texts = self.lake.all_kept(&files);
        let told = states.into_iter().zip(texts).filter_map(|(state, text)| {
            let told = serde_json::from_str(&text?).ok()?;
            Some((state, told))
        });
        self.gathered.lock().unwrap_or_else(PoisonError::into_inner).extend(told);
    }

    /// Time and memory that runs of a robot took, or those of all robots where it has none.
    pub fn took(&self, robot: Option<&str>) -> Vec<Took> {
        let gathered = self.gathered.lock().unwrap_or_else(PoisonError::into_inner);
        let all = self.before.values().chain(gathered.values());
        let all: Vec<(bool, Took)> = all
            .filter_map(|own| Some((robot.is_some_and(|robot| own.key.robot == robot), own.took?)))
            .collect();
        let has_own = all.iter().any(|(is_own, _)| *is_own);
        all.into_iter().filter(|(is_own, _)| *is_own || !has_own).map(|(_, took)| took).collect()
    }

    /// Adds what was gathered to the index as it is now, so that those files are not read again. There is no lock: of a batch that
    /// ends in the same moment lines may be lost, whose sessions the next batch digests.
    pub fn keep_gathered(&self) -> Result<(), LakeError> {
        let gathered = self.gathered.lock().unwrap_or_else(PoisonError::into_inner);
        if gathered.is_empty() {
            return Ok(());
        }
        let mut all = index(&self.lake);
        all.extend(gathered.clone());
        keep(&self.lake, INDEX, &all)
    }

    fn told_alone(&self, state: &str) -> Option<Told> {
        let gathered = self.gathered.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(told) = gathered.get(state) {
            return Some(told.clone());
        }
        drop(gathered);
        let may_be_there = self.listed.as_ref().is_none_or(|held| held.alone.contains_key(state));
        let text = may_be_there.then(|| self.lake.kept(&alone_key(state)))??;
        serde_json::from_str(&text).ok()
    }

    /// Whether the run that was told has a row, and its session no request since.
    fn is_current(&self, told: &Told) -> bool {
        let is_there = |row: Result<String, LakeError>| match &self.listed {
            None => self.lake.has_key(&row?),
            Some(held) => Ok(held.rows.contains(&row?)),
        };
        let row = is_there(self.lake.file_key("runs", &told.key));
        let [last, later] =
            [0, 1].map(|more| is_there(request_key(&told.key, told.asked.saturating_add(more))));
        matches!((row, last, later), (Ok(true), Ok(true), Ok(false)))
    }

    /// Keeps what is told of a task that was done alone, likewise: in a file of its own, as there may be others at once.
    pub fn keep_alone(
        &self,
        state: &str,
        own: FleetPiece<'_>,
        done: &Done,
    ) -> Result<(), LakeError> {
        if self.state_now(own).as_deref() != Some(state) {
            return Ok(());
        }
        keep(&self.lake, &alone_key(state), &Told::of(done))
    }

    /// Keeps what is told of a run, if its files have the state after it that they had before it.
    pub fn keep(&self, state: Option<&str>, own: FleetPiece<'_>, done: &Done) {
        let Some(state) = state else { return };
        if self.state(own).as_deref() == Some(state) {
            self.add(state, Told::of(done));
        }
    }

    fn add(&self, state: &str, told: Told) {
        self.now.lock().unwrap_or_else(PoisonError::into_inner).insert(state.to_owned(), told);
    }

    /// Writes the index where it changed: what was told now, and before of runs that nothing was told of now.
    pub fn write(&self) -> Result<(), LakeError> {
        let now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        let told: BTreeSet<&RunKey> = now.values().map(|own| &own.key).collect();
        let mut all = now.clone();
        let before = self.before.iter();
        let others = before.filter(|(_, own)| !told.contains(&own.key) && self.is_current(own));
        all.extend(others.map(|(state, own)| (state.clone(), own.clone())));
        if all == self.before { Ok(()) } else { keep(&self.lake, INDEX, &all) }
    }

    /// The digest of a robot file, which is read once.
    fn robot(&self, path: &Path) -> Option<String> {
        let mut robots = self.robots.lock().unwrap_or_else(PoisonError::into_inner);
        let digest = robots.entry(path.to_owned()).or_insert_with(|| {
            let digested = manifest::digest(input::open(path, Bound::ANY).ok()?);
            Some(digested.ok()?.0)
        });
        digest.clone()
    }
}

impl Told {
    fn of(done: &Done) -> Self {
        Self {
            key: done.key.clone(),
            asked: done.asked,
            met: done.met(),
            of: done.verdict_of.map(|of| of.word().to_owned()),
            reason: done.reason.clone(),
            rejected: done.rejected.clone(),
            has_page: done.page.is_some(),
            took: done.took,
        }
    }

    fn done(&self, lake: &Lake) -> Option<Done> {
        let of = self.of.as_ref().map(|word| VerdictOf::of_word(word));
        Some(Done {
            asked: self.asked,
            verdict_of: of.map_or(Some(None), |of| of.map(Some))?,
            rejected: self.rejected.clone(),
            page: if self.has_page { Some(lake.place(PAGES, &self.key).ok()?) } else { None },
            ..Done::before(lake, &self.key, self.met, self.reason.clone())
        })
    }
}

/// What the index of a lake says; nothing where it cannot be used.
fn index(lake: &Lake) -> BTreeMap<String, Told> {
    lake.kept(INDEX).and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}

fn keep(lake: &Lake, key: &str, told: &impl Serialize) -> Result<(), LakeError> {
    lake.keep(key, &serde_json::to_string(told).expect("texts and numbers"))
}

/// Texts that a session's state follows from.
fn of_session(tree: &Tree, session: &SessionFiles) -> Option<Vec<String>> {
    let mut texts = vec![session.name.clone()];
    let sides: [(&str, &[PathBuf]); 2] = match &session.recorded {
        Recorded::Logs(logs) => [("controller", &logs.controller), ("tracker", &logs.tracker)],
        Recorded::Table(table) => {
            texts.push(format!("{:?}", table.whose));
            [("stations", std::slice::from_ref(&table.path)), ("", &[])]
        }
        Recorded::Joined(_) => return None,
    };
    let corrected: &[PathBuf] = session.corrected.as_slice();
    for (side, paths) in sides.into_iter().chain([("corrected", corrected)]) {
        for path in paths {
            texts.push(format!("{side} {}", path.display()));
            texts.push(of_file(tree, path)?);
        }
    }
    Some(texts)
}

pub(in crate::pipeline) fn files_of(session: &SessionFiles) -> impl Iterator<Item = &PathBuf> {
    let recorded = match &session.recorded {
        Recorded::Logs(logs) => logs.controller.iter().chain(&logs.tracker).collect(),
        Recorded::Table(table) => vec![&table.path],
        Recorded::Joined(_) => Vec::new(),
    };
    recorded.into_iter().chain(&session.corrected)
}

/// What changes with a file: its size, and its tag or times.
fn of_file(tree: &Tree, path: &Path) -> Option<String> {
    match tree {
        Tree::Listed { files, .. } => {
            let listed = files.get(path)?;
            Some(format!("{} {}", listed.bytes, listed.tag.as_ref()?))
        }
        Tree::Folder => {
            let metadata = path.metadata().ok()?;
            let modified = metadata.modified().ok()?;
            let (inode, changed) = inode_and_change(&metadata);
            let since = |time: SystemTime| time.duration_since(SystemTime::UNIX_EPOCH).ok();
            let (modified, changed) = (since(modified), changed.and_then(since));
            Some(format!("{} {modified:?} {changed:?} {inode}", metadata.len()))
        }
    }
}

fn are_settled(FleetPiece { configuration, piece, .. }: FleetPiece<'_>) -> bool {
    let mut files = piece.training.iter().chain(&piece.test).flat_map(files_of);
    files.all(|path| is_settled(&configuration.tree, path))
}

/// Whether a file changed long enough ago for another change to have another time. Programs set the time of modification as they
/// like, a copy from a machine with another clock for one: where the system has a time that they cannot set, that alone counts.
fn is_settled(tree: &Tree, path: &Path) -> bool {
    let changed = || {
        let metadata = path.metadata().ok()?;
        inode_and_change(&metadata).1.or(metadata.modified().ok())
    };
    let settled = |changed: SystemTime| {
        let age = SystemTime::now().duration_since(changed);
        age.is_ok_and(|age| age >= SETTLED)
    };
    match tree {
        Tree::Listed { .. } => true,
        Tree::Folder => changed().is_some_and(settled),
    }
}

/// Number of a file in its file system, and the time when anything about it changed last, which no program sets.
#[cfg(unix)]
fn inode_and_change(metadata: &Metadata) -> (u64, Option<SystemTime>) {
    use std::os::unix::fs::MetadataExt as _;
    let seconds = u64::try_from(metadata.ctime()).ok();
    let nanoseconds = u32::try_from(metadata.ctime_nsec()).ok();
    let since = seconds.zip(nanoseconds).map(|(seconds, ns)| Duration::new(seconds, ns));
    let changed = since.and_then(|since| SystemTime::UNIX_EPOCH.checked_add(since));
    (metadata.ino(), changed)
}

/// There is neither on this system.
#[cfg(not(unix))]
fn inode_and_change(_: &Metadata) -> (u64, Option<SystemTime>) {
    (0, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn a_file_has_a_state_once_it_has_settled_and_another_one_after_a_change() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mcap");
        std::fs::write(&path, "one").expect("writable");
        assert!(!is_settled(&Tree::Folder, &path), "it changed just now");
        std::thread::sleep(SETTLED + Duration::from_millis(50));
        assert!(is_settled(&Tree::Folder, &path));
        let first = of_file(&Tree::Folder, &path);
        assert!(first.is_some());
        assert_eq!(of_file(&Tree::Folder, &path), first);
        let modified = path.metadata().and_then(|own| own.modified());
        std::fs::write(&path, "two").expect("writable");
        let file = std::fs::File::options().write(true).open(&path);
        let file = file.expect("there");
        file.set_modified(modified.expect("known")).expect("writable");
        assert!(!is_settled(&Tree::Folder, &path), "it changed just now");
        std::thread::sleep(SETTLED + Duration::from_millis(50));
        assert_ne!(
            of_file(&Tree::Folder, &path),
            first,
            "of another content, with the size and time of the first"
        );
        // Copied from a machine whose clock is an hour ahead, with its times.
        let ahead = SystemTime::now() + Duration::from_hours(1);
        file.set_modified(ahead).expect("writable");
        std::thread::sleep(SETTLED + Duration::from_millis(50));
        assert!(is_settled(&Tree::Folder, &path));
    }
}
