//! The runs of a lake that are verified.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use super::VerifyError;
use super::claim::{Claim, Register};
use super::verdict::Verdict;
use crate::files::store::Place;
use crate::files::table::Seal;
use crate::io::lake::{Lake, LakeError, RunRow, Stands};
use crate::pipeline::configuration::files;

#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// Pipeline files that find inputs; without any, every run is selected and none recomputed.
    pub pipelines: Vec<PathBuf>,
    /// Runs or sessions; empty for all that the pipeline files made.
    pub names: Vec<String>,
    /// Number of runs in the sample, drawn by `seed`; absent for all.
    pub sample: Option<usize>,
    pub seed: u64,
}

#[derive(Debug, Clone)]
pub struct PastRun {
    /// Place of its row in `runs`.
    pub place: Place,
    pub claim: Result<Arc<Claim>, NoClaim>,
    /// The digest in its file compared with its content; `None` where it cannot be read.
    pub seal: Option<Seal>,
    /// The pipeline file that made it, where one of that name was given.
    pub pipeline: Option<PathBuf>,
}

/// The reason why a row of `runs` cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoClaim {
    pub reason: String,
    /// Whether its file is damaged or changed, as far as is known.
    pub is_damage: bool,
}

impl NoClaim {
    pub fn verdict(&self) -> Verdict {
        let of = if self.is_damage { Verdict::RowUnreadable } else { Verdict::NotRecomputed };
        of(self.reason.clone())
    }
}

/// The runs that are asked for, in the order of robot, session and run.
#[derive(Debug, Clone)]
pub struct Selected {
    pub runs: Vec<PastRun>,
    /// Number of runs left out because other pipeline files made them, by the names of those.
    pub by_others: BTreeMap<String, usize>,
    pub not_drawn: usize,
    /// Every run of the lake, for citations.
    pub register: Register,
    /// Rows that cannot be read, by their paths below the lake.
    pub(super) unread: Vec<String>,
}

pub fn select(lake: &Lake, selection: &Selection) -> Result<Selected, VerifyError> {
    let pipelines = pipelines(&selection.pipelines)?;
    let past = past(lake, &pipelines)?;
    known(lake, &past, &selection.names)?;
    let mut selected = Selected {
        runs: Vec::new(),
        by_others: BTreeMap::new(),
        not_drawn: 0,
        register: Register {
            runs: past.iter().filter_map(|run| at_its_place(run, lake)).collect(),
        },
        unread: unread(&past, lake),
    };
    for run in past {
        // A row that cannot be read belongs to no name, and has to be reported.
        let Ok(claim) = &run.claim else {
            selected.runs.push(run);
            continue;
        };
        let named = selection.names.iter().any(|name| is_named(claim, name));
        if !named && !selection.names.is_empty() {
            continue;
        }
        if named || run.pipeline.is_some() || pipelines.is_empty() {
            selected.runs.push(run);
        } else {
            *selected.by_others.entry(claim.run.pipeline.clone()).or_default() += 1;
        }
    }
    if selected.runs.is_empty() && !selected.by_others.is_empty() {
        return Err(VerifyError::NoneByPipeline {
            lake: lake.root(),
            asked: pipelines.into_keys().collect(),
            found: selected.by_others.into_keys().collect(),
        });
    }
    if let Some(count) = selection.sample {
        let all = selected.runs.len();
        selected.runs = drawn(selected.runs, count, selection.seed);
        selected.not_drawn = all - selected.runs.len();
    }
    Ok(selected)
}

/// The claim of a row, if it is at the place of its run's row; otherwise `None`.
fn at_its_place(run: &PastRun, lake: &Lake) -> Option<Arc<Claim>> {
    let claim = run.claim.as_ref().ok()?;
    let own = lake.place("runs", &claim.key).ok()?;
    (own == run.place).then(|| Arc::clone(claim))
}

/// Paths below the lake of rows that cannot be read.
fn unread(past: &[PastRun], lake: &Lake) -> Vec<String> {
    let root = lake.root().named();
    let unread = past.iter().filter(|run| run.claim.is_err());
    let key = |run: &PastRun| {
        let place = run.place.named();
        let below = place.strip_prefix(&root).ok()?;
        Some(below.to_string_lossy().into_owned())
    };
    unread.filter_map(key).collect()
}

/// The pipeline files, which have to be sound, by name.
fn pipelines(paths: &[PathBuf]) -> Result<BTreeMap<String, PathBuf>, VerifyError> {
    let mut named: BTreeMap<String, PathBuf> = BTreeMap::new();
    for path in paths {
        files::Source::read(path)?.sound()?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        if let Some(first) = named.insert(name.into_owned(), path.clone())
            && first != *path
        {
            return Err(VerifyError::TwoOfOneName { first, second: path.clone() });
        }
    }
    Ok(named)
}

fn past(lake: &Lake, pipelines: &BTreeMap<String, PathBuf>) -> Result<Vec<PastRun>, VerifyError> {
    let no_lake = |reason| VerifyError::NoLake { lake: lake.root(), reason };
    if lake.folder().is_some_and(|folder| !folder.is_dir()) {
        return Err(no_lake("there is no such folder"));
    }
    let rows = lake.runs()?;
    if rows.is_empty() && !has_files(lake)? {
        return Err(no_lake("it has no row in runs, so no run"));
    }
    let run = |(place, row): RunRow| {
        let seal = row.as_ref().ok().map(|row| row.seal.clone());
        let claim = row.map_err(NoClaim::from).and_then(|row| {
            Claim::of(&row.table).map(Arc::new).map_err(|reason| NoClaim {
                reason: format!("{}: {reason}", place.display()),
                is_damage: true,
            })
        });
        let pipeline =
            claim.as_ref().ok().and_then(|own| pipelines.get(&own.run.pipeline).cloned());
        PastRun { place, claim, seal, pipeline }
    };
    Ok(rows.into_iter().map(run).collect())
}

impl From<LakeError> for NoClaim {
    fn from(error: LakeError) -> Self {
        let is_damage = matches!(&error, LakeError::File(error) if error.is_damage());
        Self { is_damage, reason: error.to_string() }
    }
}

/// Whether there is a file where only runs have files, so that there was a lake.
fn has_files(lake: &Lake) -> Result<bool, LakeError> {
    let files = lake.files("")?;
    Ok(files.iter().any(|file| matches!(file.stands, Stands::OfRun { .. })))
}

/// Whether `name` is the claim's run or session.
fn is_named(claim: &Claim, name: &str) -> bool {
    claim.key.run == name || claim.key.session == name
}

fn known(lake: &Lake, past: &[PastRun], names: &[String]) -> Result<(), VerifyError> {
    let claims = || past.iter().filter_map(|run| run.claim.as_ref().ok());
    let unknown = |name: &&String| !claims().any(|claim| is_named(claim, name));
    if !names.iter().any(|name| unknown(&name)) {
        return Ok(());
    }
    // Its row may be gone, and its files still there.
    let files = lake.files("")?;
    let has_files = |name: &String| {
        files.iter().any(|file| match &file.stands {
            Stands::OfRun { session, run, .. } => run == name || session == name,
            _ => false,
        })
    };
    let mut unknown = names.iter().filter(unknown);
    let Some(name) = unknown.find(|name| !has_files(name)) else { return Ok(()) };
    let sessions: BTreeSet<String> = claims().map(|claim| claim.key.session.clone()).collect();
    let (name, sessions) = (name.clone(), Vec::from_iter(sessions));
    Err(VerifyError::NoSuchRun { name, lake: lake.root(), sessions })
}

/// The `count` runs whose names, digested after the seed, come first: neither the user nor the program chooses, and anybody
/// can draw the same again.
fn drawn(runs: Vec<PastRun>, count: usize, seed: u64) -> Vec<PastRun> {
    let lot = |run: &PastRun| {
        let name = run.place.stem();
        *blake3::hash(format!("{seed}/{name}").as_bytes()).as_bytes()
    };
    let mut lots: Vec<_> = runs.into_iter().map(|run| (lot(&run), run)).collect();
    lots.sort_by_key(|(lot, _)| *lot);
    lots.truncate(count);
    let mut drawn: Vec<PastRun> = lots.into_iter().map(|(_, run)| run).collect();
    drawn.sort_by(|a, b| a.place.cmp(&b.place));
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(names: &[&str]) -> Vec<PastRun> {
        let run = |name: &&str| PastRun {
            place: Place::of(format!("lake/runs/r/s/{name}.parquet")),
            claim: Err(NoClaim { reason: "not looked at".to_owned(), is_damage: false }),
            seal: None,
            pipeline: None,
        };
        names.iter().map(run).collect()
    }

    #[test]
    fn a_sample_follows_from_the_seed_alone() {
        let all = ["a", "b", "c", "d", "e", "f"];
        let draw = |names: &[&str], seed| -> Vec<Place> {
            let drawn = drawn(runs(names), 2, seed);
            drawn.into_iter().map(|run| run.place).collect()
        };
        let mut backwards = all;
        backwards.reverse();
        assert_eq!(draw(&all, 7), draw(&backwards, 7));
        assert_eq!(draw(&all, 7).len(), 2);
        assert!((0..10).any(|seed| draw(&all, seed) != draw(&all, 7)));
        assert_eq!(drawn(runs(&all), 100, 7).len(), 6, "no more than there are");
    }
}
