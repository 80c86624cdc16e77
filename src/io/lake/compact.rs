//! The compact form of a lake: rows of many runs of a month in one file, beside the tables and no part of them.
//!
//! ```text
//! compact/states/00000007.jsonl                 the files of a state, a line of JSON each
//! compact/runs/2026-11/GENERATION.parquet       the rows of that month's runs
//! compact/accuracy/2026-11/GENERATION.parquet   their rows of accuracy
//! compact/asked/2026-11/GENERATION.parquet      the requests of that month
//! compact/keys/2026-11/GENERATION.txt.zst       the paths of their rows in runs and asked, a line each
//! ```
//!
//! A generation is named by the digest of its bytes, so the same rows are the same file, and no file ever gets other
//! bytes. A state exists once its file does: of several processes that create one number exactly one succeeds. A reader
//! takes the state with the highest number and the files that it names, and so sees each row once. What is here may be
//! removed at any time, and is then made again.
//!
//! Files that the newest state does not name are kept for `KEPT` after the state that replaced them: a reader that
//! began before has that long to end.

use std::collections::{BTreeSet, HashMap};
use std::io::{self, Read as _, Write as _};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::error::folder_error;
use super::{Lake, Result, request_of};
use crate::schema;
use crate::store::Listed;
use crate::table::Table;
use crate::temporary::{Owner, Temporary};

pub const COMPACT: &str = "compact";
const STATES: &str = "compact/states";
/// The name that stands for a table where a file lists the paths of rows.
pub const KEYS: &str = "keys";
/// How long a file stays after the state that no longer names it was made.
const KEPT: Duration = Duration::from_hours(24);
const DIGITS: usize = 32;
const LEVEL: i32 = 3;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct CompactFile {
    /// Name of the table, or [`KEYS`].
    pub table: String,
    /// The month of its runs, `2026-11`, or `undated`.
    pub month: String,
    pub file: String,
    /// Number of runs with rows in it; of paths those of runs.
    pub runs: u64,
    pub rows: u64,
    pub bytes: u64,
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CompactState {
    /// Its number, from 1; 0 where there is none yet.
    pub number: u64,
    pub files: Vec<CompactFile>,
}

impl CompactState {
    pub fn file(&self, table: &str, month: &str) -> Option<&CompactFile> {
        let mut files = self.files.iter();
        files.find(|own| own.table == table && own.month == month)
    }
}

impl Lake {
    /// The newest state of the compact form; one without files where its file is damaged.
    pub fn compact_state(&self) -> Result<CompactState> {
        let states = self.store.list(STATES, 0..=0)?;
        let Some((number, newest)) = states.iter().filter_map(numbered).max_by_key(|own| own.0)
        else {
            return Ok(CompactState::default());
        };
        let place = self.store.place(&newest.key).named();
        let text = io::read_to_string(self.store.open_listed(newest)?);
        let text = text.map_err(folder_error("read", &place))?;
        let files: Result<_, _> = text.lines().map(serde_json::from_str).collect();
        let files = files.unwrap_or_default();
        Ok(CompactState { number, files })
    }

    /// Creates the state of these files after `before`; false where another process created one meanwhile.
    pub fn create_compact_state(
        &self,
        before: &CompactState,
        files: &[CompactFile],
    ) -> Result<bool> {
        let key = format!("{STATES}/{:08}.jsonl", before.number + 1);
        let line = |file| serde_json::to_string(file).expect("texts and numbers") + "\n";
        let text: String = files.iter().map(line).collect();
        let (temporary, _) = self.written(&key, text.as_bytes())?;
        Ok(self.store.create(&key, temporary)?)
    }

    pub fn put_compact(&self, table: &Table, month: &str, runs: u64) -> Result<CompactFile> {
        let name = &table.schema().table;
        let folder = format!("{COMPACT}/{name}/{month}");
        let (temporary, digest) = self.write(table, &format!("{folder}/new.parquet"))?;
        let key = format!("{folder}/{}.parquet", &digest[..DIGITS]);
        let rows = table.rows() as u64;
        self.put_generation(key, temporary, name, month, runs, rows)
    }

    pub fn put_compact_keys(&self, keys: &BTreeSet<String>, month: &str) -> Result<CompactFile> {
        let folder = format!("{COMPACT}/{KEYS}/{month}");
        let lines = keys.iter().flat_map(|key| [key.as_str(), "\n"]);
        let text: String = lines.collect();
        let place = self.written_at(&folder);
        let packed = zstd::encode_all(text.as_bytes(), LEVEL);
        let packed = packed.map_err(folder_error("write", &place))?;
        let (temporary, digest) = self.written(&format!("{folder}/new.txt.zst"), &packed)?;
        let key = format!("{folder}/{}.txt.zst", &digest[..DIGITS]);
        let (runs, rows) = (runs_among(keys) as u64, keys.len() as u64);
        self.put_generation(key, temporary, KEYS, month, runs, rows)
    }

    fn put_generation(
        &self,
        key: String,
        temporary: Temporary,
        table: &str,
        month: &str,
        runs: u64,
        rows: u64,
    ) -> Result<CompactFile> {
        let bytes = temporary.bytes().map_err(folder_error("write", &self.written_at(&key)))?;
        // Where it is there already it gets the same bytes, which its name is the digest of, and is new again.
        self.store.put(&key, temporary)?;
        let (table, month) = (table.to_owned(), month.to_owned());
        Ok(CompactFile { table, month, file: key, runs, rows, bytes })
    }

    /// Reads the rows of a file of the compact form, checked by the digest of their content.
    pub fn read_compact(&self, file: &CompactFile) -> Result<Table> {
        self.read_key(&file.file, schema::find(&file.table)?)
    }

    /// Reads the paths of the rows of runs in the compact form; `None` where they are damaged or gone.
    pub fn read_compact_keys(&self, file: &CompactFile) -> Option<BTreeSet<String>> {
        let packed = self.as_written(file)?;
        let text = String::from_utf8(zstd::decode_all(&packed[..]).ok()?).ok()?;
        Some(text.lines().map(str::to_owned).collect())
    }

    /// The bytes of a file, whose name is their digest; `None` where they are others, or gone.
    fn as_written(&self, file: &CompactFile) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.store.open(&file.file).ok()?.read_to_end(&mut bytes).ok()?;
        let (_, name) = file.file.rsplit_once('/')?;
        name.starts_with(&blake3::hash(&bytes).to_hex()[..DIGITS]).then_some(bytes)
    }

    /// The months of which a table is gone, or has other bytes; in a bucket another size. Paths of rows are held against their digest
    /// where they are read.
    pub fn damaged_months(&self, state: &CompactState) -> Result<BTreeSet<String>> {
        let listed = self.store.list(COMPACT, 2..=2)?;
        let sizes: HashMap<&str, u64> =
            listed.iter().map(|own| (own.key.as_str(), own.bytes)).collect();
        let is_damaged = |own: &&CompactFile| {
            sizes.get(own.file.as_str()) != Some(&own.bytes)
                || self.folder().is_some() && self.as_written(own).is_none()
        };
        let tables = state.files.iter().filter(|own| own.table != KEYS);
        Ok(tables.filter(is_damaged).map(|own| own.month.clone()).collect())
    }

    /// Removes files that neither the newest state nor one that was replaced less than `KEPT` ago names; returns their
    /// number.
    pub fn remove_replaced(&self) -> Result<usize> {
        let listed = self.store.list(COMPACT, 1..=2)?;
        let mut states: Vec<(u64, &Listed)> = listed.iter().filter_map(numbered).collect();
        states.sort_by_key(|own| own.0);
        let Some(now) = states.last().and_then(|(_, newest)| newest.modified) else { return Ok(0) };
        let is_old = |written: Option<SystemTime>| {
            written.is_some_and(|own| own.checked_add(KEPT).is_some_and(|until| until < now))
        };
        // A state was replaced when the one after it was made.
        let replaced = states.windows(2).take_while(|own| is_old(own[1].1.modified));
        let gone: Vec<&Listed> = replaced.map(|own| own[0].1).collect();
        let mut named = BTreeSet::new();
        for (_, state) in &states[gone.len()..] {
            named.extend(self.named_in(state)?);
        }
        let is_unnamed = |own: &&Listed| !own.key.starts_with(STATES) && !named.contains(&own.key);
        let unnamed = listed.iter().filter(is_unnamed);
        let unnamed: Vec<&Listed> = unnamed.filter(|own| is_old(own.modified)).collect();
        for file in gone.iter().chain(&unnamed) {
            self.store.remove(&file.key)?;
        }
        Ok(gone.len() + unnamed.len())
    }

    fn named_in(&self, state: &Listed) -> Result<Vec<String>> {
        let place = self.store.place(&state.key).named();
        let text = io::read_to_string(self.store.open_listed(state)?);
        let text = text.map_err(folder_error("read", &place))?;
        let files = text.lines().filter_map(|line| serde_json::from_str(line).ok());
        Ok(files.map(|own: CompactFile| own.file).collect())
    }

    /// A file under a temporary name, synced to the disk, and its digest.
    pub(super) fn written(&self, key: &str, bytes: &[u8]) -> Result<(Temporary, String)> {
        let mut temporary = self.store.temporary(key)?;
        let written = temporary.write_all(bytes);
        let digest = written.and_then(|()| temporary.sync());
        let digest = digest.map_err(folder_error("write", &self.written_at(key)))?;
        Ok((temporary, digest))
    }
}

/// The number of runs among paths of rows of runs and requests.
pub fn runs_among(keys: &BTreeSet<String>) -> usize {
    keys.iter().filter(|key| request_of(key).is_none()).count()
}

fn numbered(listed: &Listed) -> Option<(u64, &Listed)> {
    let name = listed.key.strip_prefix(STATES)?.strip_prefix('/')?;
    let number = name.strip_suffix(".jsonl")?.parse().ok()?;
    Some((number, listed))
}

/// Whether a name of a file in a folder of the compact form, given by its parts, is one that this form has; `None` for
/// a temporary.
pub(super) fn is_own(folder: &[&str], name: &str) -> Option<bool> {
    if Owner::of_temporary(name).is_some() {
        return None;
    }
    let is_named = |ending: &str, is: fn(&u8) -> bool| {
        let stem = name.strip_suffix(ending).unwrap_or_default();
        !stem.is_empty() && stem.as_bytes().iter().all(is)
    };
    Some(match folder {
        ["states"] => is_named(".jsonl", u8::is_ascii_digit),
        [KEYS, _] => is_named(".txt.zst", u8::is_ascii_hexdigit),
        [table, _] => schema::find(table).is_ok() && is_named(".parquet", u8::is_ascii_hexdigit),
        _ => false,
    })
}
