//! The index of finished work, `.index/runs.jsonl`, and beside it a file for each task that was done alone: what a
//! batch told of each run, by the state of its inputs. Nothing published follows from it; it may be removed, and is
//! then made again.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read as _, Write as _};

use super::error::folder_error;
use super::{ASKED, Lake, LakeError, RUNS};
use crate::store::{Listed, StoreError};

pub(super) const FOLDER: &str = ".index";
const KEY: &str = ".index/runs.jsonl";
/// The folder in it with a file for each task that was done alone.
pub(super) const ALONE: &str = ".index/alone";
/// Number of its files that are open at once.
const OPEN_AT_ONCE: usize = 256;

impl Lake {
    /// The text of the index; empty where there is none that can be read.
    pub fn index(&self) -> String {
        let mut text = String::new();
        let read = |text: &mut String| {
            self.store.exists(KEY).ok().filter(|is_there| *is_there)?;
            self.store.open(KEY).ok()?.read_to_string(text).ok()
        };
        match read(&mut text) {
            Some(_) => text,
            None => String::new(),
        }
    }

    /// Replaces the index, completely or not at all.
    pub fn put_index(&self, text: &str) -> Result<(), LakeError> {
        self.put_whole(KEY, text.as_bytes())
    }

    /// The files of single tasks, by the states that they are named after.
    pub fn index_alone(&self) -> Result<BTreeMap<String, Listed>, LakeError> {
        let listed = self.store.list(ALONE, 0..=0)?.into_iter();
        let state = |key: &str| {
            let name = key.rsplit('/').next()?;
            Some(name.strip_suffix(".json")?.to_owned())
        };
        Ok(listed.filter_map(|own| Some((state(&own.key)?, own))).collect())
    }

    /// The texts of these files of single tasks, several at a time; `None` of one that cannot be read.
    pub fn told_alone_all(&self, files: &[Listed]) -> Vec<Option<String>> {
        let text = |file: Result<File, StoreError>| {
            let mut text = String::new();
            file.ok()?.read_to_string(&mut text).ok()?;
            Some(text)
        };
        let opened = files.chunks(OPEN_AT_ONCE).flat_map(|files| self.store.open_all(files));
        opened.map(text).collect()
    }

    /// The file of a single task; `None` where it cannot be read.
    pub fn told_alone(&self, state: &str) -> Option<String> {
        self.text_at(&alone(state)?)
    }

    /// Writes the file of a single task, completely or not at all.
    pub fn put_alone(&self, state: &str, text: &str) -> Result<(), LakeError> {
        let Some(key) = alone(state) else {
            return Ok(());
        };
        self.put_whole(&key, text.as_bytes())
    }

    fn text_at(&self, key: &str) -> Option<String> {
        let mut text = String::new();
        let mut file = self.store.open(key).ok()?;
        file.read_to_string(&mut text).ok()?;
        Some(text)
    }

    /// Writes a file beside the tables, completely or not at all.
    pub(super) fn put_whole(&self, key: &str, bytes: &[u8]) -> Result<(), LakeError> {
        let mut temporary = self.store.temporary(key)?;
        let written = temporary.write_all(bytes);
        let written = written.and_then(|()| temporary.sync());
        written.map_err(folder_error("write", &self.written_at(key)))?;
        self.store.put(key, temporary)?;
        Ok(())
    }

    /// The keys of the rows of all runs and of all requests, as [`Lake::file_key`] and
    /// [`request_key`](super::request_key) have them.
    pub fn run_and_request_keys(&self) -> Result<BTreeSet<String>, LakeError> {
        let listed = [self.store.list(RUNS, 2..=2)?, self.requests(ASKED)?];
        Ok(listed.concat().into_iter().map(|own| own.key).collect())
    }

    pub fn has_key(&self, key: &str) -> Result<bool, LakeError> {
        Ok(self.store.exists(key)?)
    }
}

/// The key of the file of a single task; `None` of a text that is no state, which has hexadecimal digits only.
fn alone(state: &str) -> Option<String> {
    let is_state = !state.is_empty() && state.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_state.then(|| format!("{ALONE}/{state}.json"))
}
