//! A lake → its compact form: the rows of `runs`, `accuracy` and `asked`, a file for each month.
//!
//! 1. The paths of rows of `runs` and `asked` are listed, and compared with those that the newest state has ([`CompactState`]).
//! 2. New rows are read. A run belongs to the month of its `session_started`, UTC, or to [`UNDATED`]; a request to
//!    that of its time. A run whose row or accuracy cannot be
//!    read, or is not what was written, is left out with the reason, and tried again the next time.
//! 3. Each month with new runs, or with runs that are gone, is written anew (`month`): the rows of its earlier generation and the new ones, in
//!    the order of robot, session and run. Months without any keep their files.
//! 4. The state that names all files is created, which makes them count. Where another process was first, all begins again from its state.
//! 5. Files that were replaced long enough ago are removed.
//!
//! The files follow from the rows alone: the same lake has the same compact form, in however many steps it was made.

mod month;

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use thiserror::Error;

use crate::files::store::{Listed, Place};
use crate::files::table::TableError;
use crate::io::lake::{ASKED, CompactFile, CompactState, KEYS, Lake, LakeError, runs_among};
use crate::progress::Progress;
use month::{Month, NewRun, row};

pub const UNDATED: &str = "undated";
pub const TABLES: [&str; 3] = ["runs", "accuracy", ASKED];
/// Number of new runs up to which their rows are held between finding their month and writing it; more are read a second time.
const HELD: usize = 10_000;
/// Number of attempts, where other processes make states or files turn out to be damaged.
const ATTEMPTS: usize = 5;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Compacted {
    /// Number of the state that holds now.
    pub state: u64,
    pub is_new: bool,
    pub files: Vec<CompactFile>,
    pub months: Vec<String>,
    pub runs: usize,
    /// Number of runs that are new in it.
    pub added: usize,
    /// Number of runs that are gone from the lake, and from it.
    pub gone: usize,
    pub left_out: Vec<LeftOut>,
    /// Number of replaced files that were removed.
    pub removed: usize,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    pub place: Place,
    pub reason: String,
}

type Result<T, E = CompactError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum CompactError {
    #[error(
        "there is no lake in {0}: it has no row in runs; name the folder that `posegrid run` printed as its tables"
    )]
    NoLake(Place),
    #[error(transparent)]
    Lake(#[from] LakeError),
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(
        "the compact form of {0} changed during each of {ATTEMPTS} attempts, as other processes write it; what they wrote holds: run again"
    )]
    Overtaken(Place),
}

enum Attempt {
    Done(Compacted),
    /// Another process made a state meanwhile.
    Overtaken,
    /// A month's files in the earlier state are damaged: it is made from its runs again.
    Damaged(String),
}

pub fn compact(lake: &Lake, progress: &dyn Progress) -> Result<Compacted> {
    let mut damaged = BTreeSet::new();
    for _ in 0..ATTEMPTS {
        match lake.read_with(|| attempt(lake, &damaged, progress))? {
            Attempt::Done(mut done) => {
                done.removed = lake.remove_replaced()?;
                return Ok(done);
            }
            Attempt::Overtaken => {}
            Attempt::Damaged(month) => {
                damaged.insert(month);
            }
        }
    }
    Err(CompactError::Overtaken(lake.root()))
}

fn attempt(lake: &Lake, damaged: &BTreeSet<String>, progress: &dyn Progress) -> Result<Attempt> {
    let mut listed = lake.run_files()?;
    if listed.is_empty() {
        return Err(CompactError::NoLake(lake.root()));
    }
    listed.extend(lake.requests(ASKED)?);
    let state = lake.compact_state()?;
    let found = lake.damaged_months(&state)?;
    for month in found.difference(damaged) {
        tracing::warn!(
            "files of the compact form of {month} are gone or damaged; it is made from its runs again"
        );
    }
    let mut months = known(lake, &state, &(damaged | &found));
    let mut done = Compacted::default();
    compare(lake, &listed, &mut months, &mut done, progress);
    let mut files = Vec::new();
    for (month, own) in months {
        if own.new.is_empty() && own.gone.is_empty() {
            let kept = state.files.iter().filter(|file| file.month == month);
            files.extend(kept.cloned());
            done.runs += runs_among(&own.keys);
            continue;
        }
        match own.rewritten(lake, &state, &month, &mut done, progress)? {
            Some(written) => files.extend(written),
            None => return Ok(Attempt::Damaged(month)),
        }
    }
    progress.end();
    files.sort();
    done.is_new = files != state.files;
    done.state = state.number + u64::from(done.is_new);
    if done.is_new && !lake.create_compact_state(&state, &files)? {
        return Ok(Attempt::Overtaken);
    }
    done.files = files;
    Ok(Attempt::Done(done))
}

/// The months of a state, without those that are damaged.
fn known(lake: &Lake, state: &CompactState, damaged: &BTreeSet<String>) -> BTreeMap<String, Month> {
    let files = state.files.par_iter();
    let files = files.filter(|file| file.table == KEYS && !damaged.contains(&file.month));
    let read = |own: &CompactFile| {
        let keys = lake.read_compact_keys(own)?;
        Some((own.month.clone(), Month { keys, ..Month::default() }))
    };
    files.filter_map(read).collect()
}

/// Finds what is gone from each month, and reads what is new.
fn compare(
    lake: &Lake,
    listed: &[Listed],
    months: &mut BTreeMap<String, Month>,
    done: &mut Compacted,
    progress: &dyn Progress,
) {
    let there: BTreeSet<&str> = listed.iter().map(|file| file.key.as_str()).collect();
    for own in months.values_mut() {
        let is_gone = |key: &&String| !there.contains(key.as_str());
        own.gone = own.keys.iter().filter(is_gone).cloned().collect();
    }
    let known = |file: &Listed| months.values().any(|own| own.keys.contains(&file.key));
    let new: Vec<Listed> = listed.iter().filter(|file| !known(file)).cloned().collect();
    progress.begin("runs", new.len() as u64);
    let is_held = new.len() <= HELD;
    let read = |file: Listed| {
        let row = row(lake, &file);
        let dated = row.map(|row| (month::of(&row), is_held.then_some(row)));
        (file, dated)
    };
    let read: Vec<_> = new.into_par_iter().map(read).collect();
    for (file, dated) in read {
        match dated {
            Ok((month, row)) => {
                months.entry(month).or_default().new.push(NewRun { file, row });
            }
            Err(reason) => {
                progress.advance(1);
                done.leave_out(lake, &file, reason);
            }
        }
    }
}

impl Compacted {
    fn leave_out(&mut self, lake: &Lake, file: &Listed, reason: String) {
        self.left_out.push(LeftOut { place: lake.place_of(&file.key), reason });
    }
}
