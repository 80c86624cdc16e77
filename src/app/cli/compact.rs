//! `posegrid compact`: the tables for people, a file for each month. Exit codes: 0 up to date; 3 some run could not be
//! read and is not in it; 1 the lake cannot be read or written; 2 bad usage, or no such lake.

use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::files::store::Place;
use crate::io::lake::{COMPACT, KEYS, Lake, LakeError};
use crate::pipeline::compact::{CompactError, Compacted, TABLES, compact};

/// Keep the tables for people by month, so that years of runs are read in seconds.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
The rows of runs and accuracy of each month's sessions (UTC; undated where no clock has an epoch), and of asked of each month, become one
file each in LAKE/compact.
Only months with new runs are written anew. The tables themselves stay as they are, and posegrid verify proves them as before.

LAKE/compact/states has a file for each state, which names the files that count: a reader takes the newest and sees each row once. A
compaction that is killed leaves the state before, and of several at once each state is made by one. Replaced files are removed a day
after; all of LAKE/compact may be removed at any time, and is made again. The SQL of posegrid schema views --compact reads it.

Examples:
  posegrid compact lake
  posegrid compact s3://bucket/lake        # after the nightly run

Exit codes: 0 up to date; 3 some run could not be read, and is not in it; 1 the lake cannot be read or written; 2 bad usage, or no such
lake.")]
pub struct CompactArgs {
    /// The place of the published tables
    pub lake: PathBuf,
}

pub fn run(args: &CompactArgs, bars: &Bars) -> u8 {
    let progress = bars.of("compact");
    let lake = Lake::at(&Place::of(&args.lake)).map_err(CompactError::from);
    match lake.and_then(|lake| compact(&lake, &progress)) {
        Ok(done) => told(&done, bars),
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            match error {
                CompactError::NoLake(_) | CompactError::Lake(LakeError::Schema(_)) => BAD_USAGE,
                _ => NO_RESULT,
            }
        }
    }
}

fn told(done: &Compacted, bars: &Bars) -> u8 {
    for left_out in &done.left_out {
        let text = format!("left out: {}: {}", left_out.place, left_out.reason);
        tracing::warn!("{}", Printable(&text));
    }
    let code = if done.left_out.is_empty() { DONE } else { NOT_MET };
    messages::last_result(words(done).join("\n"), code, bars)
}

fn words(done: &Compacted) -> Vec<String> {
    let Compacted { state, runs, added, gone, .. } = done;
    let left_out = done.left_out.len();
    let first = if done.is_new {
        format!("state {state}: {runs} runs, {added} new, {gone} gone, {left_out} left out")
    } else {
        format!("state {state} is up to date: {runs} runs, {left_out} left out")
    };
    let mut lines = vec![first];
    lines.extend(TABLES.into_iter().chain([KEYS]).map(|table| of_table(done, table)));
    if !done.months.is_empty() {
        lines.push(format!("  months written: {}", done.months.join(", ")));
    }
    if done.removed > 0 {
        lines.push(format!("  replaced files removed: {}", done.removed));
    }
    lines
}

fn of_table(done: &Compacted, table: &str) -> String {
    let files = || done.files.iter().filter(|file| file.table == table);
    let rows: u64 = files().map(|file| file.rows).sum();
    let bytes: u64 = files().map(|file| file.bytes).sum();
    let (count, megabytes) = (files().count(), bytes as f64 / 1e6);
    format!("  {COMPACT}/{table}: {count} files, {rows} rows, {megabytes:.1} MB")
}
