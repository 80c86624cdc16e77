//! What a lake keeps beside its tables, as no part of them: nothing published follows from it, and what is removed is made again.
//!
//! - [`INDEX`]: what a batch told of each run, by the state of the files that it was made from; beside it a file of each task that was
//!   done alone.
//! - `.history/ROBOT.jsonl.zst`: a robot's judged sessions; `.history/figures/ROBOT/SESSION/RUN.json.zst`: the figures of a run that a
//!   history compares.
//!
//! Each file is packed, and its first line is the digest of the rest and of this version: what is damaged, or of another version, is not
//! read.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;

use super::error::folder_error;
use super::{ASKED, FLEET, Lake, OVER_TIME, RUNS, Result, encoded, session_key};
use crate::input::Bound;
use crate::manifest::{RunKey, VERSION};
use crate::store::{Listed, Place, StoreError};

/// Version of what is kept and of its meaning; raised by any change.
const FORMAT: u32 = 6;
pub const INDEX: &str = ".index/runs.jsonl.zst";
pub(super) const FOLDERS: [&str; 3] = [".index", ".history", OVER_TIME];
/// The folder of tasks that were done alone, and that of the figures of runs.
pub(super) const ALONE: &str = ".index/alone";
pub(super) const FIGURES: &str = ".history/figures";
const OPEN_AT_ONCE: usize = 256;
/// Level of the compression: digits of numbers pack no better at higher ones.
const LEVEL: i32 = 1;

/// The key of the file of a single task with this state, which has hexadecimal digits only.
pub fn alone_key(state: &str) -> String {
    format!("{ALONE}/{state}.json.zst")
}

/// The key of the summary of the robot whose folder has this name.
pub fn summary_key(robot: &str) -> String {
    format!(".history/{robot}.jsonl.zst")
}

pub fn figures_key(key: &RunKey) -> Result<String> {
    Ok(format!("{}/{}.json.zst", session_key(FIGURES, key)?, encoded("run", &key.run)?))
}

impl Lake {
    /// The text that was kept with a key; `None` where there is none that can be read.
    pub fn kept(&self, key: &str) -> Option<String> {
        kept(self.store.open(key))
    }

    /// The texts of these files, several at a time.
    pub fn all_kept(&self, files: &[Listed]) -> Vec<Option<String>> {
        let opened = files.chunks(OPEN_AT_ONCE).flat_map(|files| self.store.open_all(files));
        opened.map(kept).collect()
    }

    /// Keeps a text, completely or not at all.
    pub fn keep(&self, key: &str, text: &str) -> Result<()> {
        let place = self.written_at(key);
        let sealed = format!("{}\n{text}", seal(text));
        let packed = zstd::encode_all(sealed.as_bytes(), LEVEL);
        self.put_whole(key, &packed.map_err(folder_error("write", &place))?)
    }

    /// Writes a page over time, in place of an earlier one; gives its place.
    pub fn keep_page(&self, name: &str, bytes: &[u8]) -> Result<Place> {
        let key = format!("{OVER_TIME}/{name}");
        self.put_whole(&key, bytes)?;
        Ok(self.store.place(&key))
    }

    /// Writes a file beside the tables, completely or not at all.
    pub(super) fn put_whole(&self, key: &str, bytes: &[u8]) -> Result<()> {
        let (temporary, _) = self.written(key, bytes)?;
        self.store.put(key, temporary)?;
        Ok(())
    }

    /// The files of single tasks, by the states that they are named after.
    pub fn kept_alone(&self) -> Result<BTreeMap<String, Listed>> {
        let listed = self.store.list(ALONE, 0..=0)?.into_iter();
        let state = |key: &str| Some(key.rsplit('/').next()?.strip_suffix(".json.zst")?.to_owned());
        Ok(listed.filter_map(|own| Some((state(&own.key)?, own))).collect())
    }

    /// The keys of the rows of all runs and of all requests, as [`Lake::file_key`] and [`request_key`](super::request_key) have them.
    pub fn run_and_request_keys(&self) -> Result<BTreeSet<String>> {
        let listed = [self.store.list(RUNS, 2..=2)?, self.requests(ASKED)?];
        Ok(listed.concat().into_iter().map(|own| own.key).collect())
    }

    /// Whether the pages of all nights are there, of whatever nights; `true` where that cannot be asked.
    pub fn has_pages(&self) -> bool {
        self.has_key(&format!("{OVER_TIME}/{FLEET}")).unwrap_or(true)
    }

    pub fn has_key(&self, key: &str) -> Result<bool> {
        Ok(self.store.exists(key)?)
    }
}

fn kept(file: Result<File, StoreError>) -> Option<String> {
    // A damaged file may unpack to more than was packed.
    let most = Bound::TABLE.bytes;
    let mut text = String::new();
    let mut unpacked = zstd::Decoder::new(file.ok()?.take(most)).ok()?.take(most);
    unpacked.read_to_string(&mut text).ok()?;
    let (stated, rest) = text.split_once('\n')?;
    (stated == seal(rest)).then(|| rest.to_owned())
}

fn seal(text: &str) -> String {
    blake3::hash(format!("{FORMAT} {VERSION}\n{text}").as_bytes()).to_hex().to_string()
}
