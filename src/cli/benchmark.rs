//! `posegrid benchmark`: models and other programs on open data with fixed splits.
//!
//! Exit codes: 0 the figures are there; 1 the data or predictions are at fault, or output cannot be written; 2 bad usage, or a bad suite.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT};
use crate::benchmark::FigureName;
use crate::io::tables::benchmark::BenchmarkRow;
use crate::page::benchmark::{Content, Entry, about, interval_shown, leader, leak, shown};
use crate::pipeline::benchmark::{Asked, Benchmark, BenchmarkError, benchmark, export, output};

/// Judge models and other programs on open data with fixed splits.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
A suite names open data (repository, licence, digest of each file), the pipeline file that reads them, and fixed splits of their
stations. Nothing is fetched: what is missing is named, with where to download it. Every model of posegrid is trained on the training
stations of a split alone; figures of the stations that judge have bootstrap intervals by block. A split whose test stations stand
among its training stations is named as leaking, with the figures of the split beside it.

Any other program enters by CSV: --export writes what it needs, and it writes ARM/SPLIT.csv with station,x,y,z in mm, in the frame of
the training positions; cxx,cxy,cxz,cyy,cyz,czz (mm²) where it states a covariance.

Examples:
  posegrid benchmark pipelines/benchmarks/stations.toml
  posegrid benchmark pipelines/benchmarks/stations.toml --export given
  posegrid benchmark pipelines/benchmarks/stations.toml --arm wam --predictions mine=predictions

Exit codes: 0 the figures are there; 1 the data or predictions are at fault, or the output cannot be written; 2 bad usage, or a bad
suite.")]
pub struct BenchmarkArgs {
    /// The suite file
    pub suite: PathBuf,
    /// The folder with the data, instead of that of the pipeline files
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Only this arm; may be given several times
    #[arg(long, value_name = "ARM")]
    pub arm: Vec<String>,
    /// Only this split, and the one beside it; may be given several times
    #[arg(long, value_name = "SPLIT")]
    pub split: Vec<String>,
    /// Predictions of another program: a folder with ARM/SPLIT.csv, or the file of the only split
    #[arg(long, value_name = "NAME=PATH", value_parser = named)]
    pub predictions: Vec<(String, PathBuf)>,
    /// Write what other programs need into this folder, and judge nothing
    #[arg(long, value_name = "DIR", conflicts_with = "predictions")]
    pub export: Option<PathBuf>,
    /// The folder of table and page
    #[arg(long, value_name = "DIR", default_value = "benchmark")]
    pub out: PathBuf,
}

fn named(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => {
            Ok((name.to_owned(), PathBuf::from(path)))
        }
        _ => Err("write NAME=PATH".to_owned()),
    }
}

/// Prints the figures; gives the exit code.
pub fn run(args: &BenchmarkArgs, bars: &Bars) -> u8 {
    let asked = Asked {
        suite: args.suite.clone(),
        data: args.data.clone(),
        arms: args.arm.clone(),
        splits: args.split.clone(),
        predictions: args.predictions.clone(),
    };
    let result = match &args.export {
        Some(folder) => export(&asked, folder, &bars.of("benchmark")).map(|paths| written(&paths)),
        None => judged(&asked, args, bars),
    };
    match result {
        Ok(text) => messages::result(text, bars).map_or_else(Undelivered::exit_code, |()| DONE),
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            if error.is_of_suite() { BAD_USAGE } else { NO_RESULT }
        }
    }
}

fn judged(asked: &Asked, args: &BenchmarkArgs, bars: &Bars) -> Result<String, BenchmarkError> {
    let benchmark = benchmark(asked, &bars.of("benchmark"))?;
    for remark in &benchmark.remarks {
        tracing::warn!("{}", Printable(remark));
    }
    let paths = output(&benchmark, &args.out)?;
    Ok(words(&benchmark) + &written(&paths))
}

fn written(paths: &[PathBuf]) -> String {
    let line = |path: &PathBuf| format!("written: {}\n", Printable(&path.display().to_string()));
    paths.iter().map(line).collect()
}

fn words(benchmark: &Benchmark) -> String {
    let content = benchmark.content();
    let mut text = String::new();
    for (arm, told) in &benchmark.told {
        for told in told {
            line(&mut text, &format!("{arm}: {told}"));
        }
    }
    for own in content.splits() {
        split(&mut text, &content, own);
    }
    text
}

fn line(text: &mut String, line: &str) {
    writeln!(text, "{}", Printable(line)).expect("a string");
}

/// The figures of a split, a line for each model.
fn split(text: &mut String, content: &Content, own: (&str, &str)) {
    let rows = || content.of_split(own.0, own.1);
    if let Some(row) = rows().next() {
        line(text, &format!("{}, {}: {}", own.0, own.1, about(row)));
        if let Some(leak) = leak(row) {
            line(text, &format!("  {leak}"));
        }
    }
    if let Some(leader) = leader(content, own) {
        line(text, &format!("  {leader}"));
    }
    let head = FigureName::ALL.map(|name| format!("{:>13}", name.words()));
    line(text, &format!("  {:<44}{}  mean within", "", head.concat()));
    for entry in Content::entries(rows()) {
        let cell = |name| {
            let row = content.figure(own, &entry, name);
            let value = row.map_or_else(|| "-".to_owned(), |row| shown(name, row.value));
            format!("{value:>13}")
        };
        let cells = FigureName::ALL.map(cell).concat();
        let mean = content.figure(own, &entry, FigureName::Mean);
        line(
            text,
            &format!(
                "  {:<44}{cells}{}",
                named_entry(&entry, rows()),
                interval(content, own, &entry, mean)
            ),
        );
    }
}

fn named_entry<'r>(entry: &Entry, mut rows: impl Iterator<Item = &'r BenchmarkRow>) -> String {
    let is_published = rows.any(|row| row.source.is_some() && Entry::of(row) == *entry);
    let published = if is_published { "published: " } else { "" };
    format!("{published}{}", entry.name())
}

/// Interval of a mean, and the mean on the split beside a leaking one.
fn interval(
    content: &Content,
    own: (&str, &str),
    entry: &Entry,
    mean: Option<&BenchmarkRow>,
) -> String {
    let Some(row) = mean else {
        return String::new();
    };
    let mut text = match row.low.zip(row.high) {
        Some((low, high)) => format!("  {}", interval_shown(row.figure, low, high)),
        None => String::new(),
    };
    let beside = row.beside.as_deref().filter(|_| row.leaks);
    let found = beside.and_then(|beside| content.figure((own.0, beside), entry, FigureName::Mean));
    if let Some(found) = found {
        let value = shown(found.figure, found.value);
        write!(text, "; on {}: {value}", found.split).expect("a string");
    }
    text
}
