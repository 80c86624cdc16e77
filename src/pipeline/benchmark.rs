//! A suite → figures of every model and program on its splits.
//!
//! Steps ([`crate::benchmark`] computes, this reads and writes):
//! 1. the suite is read and checked;
//! 2. of each arm the files are digested, then read and joined by the pipeline file that the arm names (`data`), as a run does;
//! 3. of each split the models are trained on its training stations alone, other programs enter (`entered`), and all are judged
//!    (`judged`);
//! 4. rows become the table `benchmark` and a page.
//!
//! Nothing is fetched.

mod data;
mod entered;
mod error;
mod judged;
mod written;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::benchmark::Suite;
use crate::benchmark::suite::{SuiteArm, SuiteSplit};
use crate::io::input::{self, Bound};
use crate::io::table::{Row as _, Rows};
use crate::io::tables::benchmark::BenchmarkRow;
use crate::manifest::VERSION;
use crate::page::benchmark::Content;
use crate::progress::Progress;
use data::ArmData;
use entered::Program;
pub use error::{BenchmarkError, PredictionsFault};
use judged::Opened;

/// What is asked for.
#[derive(Debug, Clone, Default)]
pub struct Asked {
    /// The suite file.
    pub suite: PathBuf,
    /// The folder of the data, instead of that in the pipeline files.
    pub data: Option<PathBuf>,
    /// Only these arms; empty for all.
    pub arms: Vec<String>,
    /// Only these splits, and those beside them; empty for all.
    pub splits: Vec<String>,
    /// Programs by name, and the place of their predictions.
    pub predictions: Vec<(String, PathBuf)>,
}

/// The result of a suite.
#[derive(Debug)]
pub struct Benchmark {
    /// The suite.
    pub suite: Suite,
    /// Items read, kept and left out, by the arm's name.
    pub told: Vec<(String, Vec<String>)>,
    /// What the suite does not state, and programs without predictions for a split, in sentences.
    pub remarks: Vec<String>,
    /// The rows of table `benchmark`.
    pub rows: Rows<BenchmarkRow>,
}

impl Benchmark {
    /// What its page shows.
    pub fn content(&self) -> Content {
        Content {
            version: VERSION.to_owned(),
            suite: self.suite.clone(),
            told: self.told.clone(),
            remarks: self.remarks.clone(),
            rows: self.rows.rows.clone(),
        }
    }
}

/// A suite that was read, with what of it is asked for.
struct Chosen<'a> {
    asked: &'a Asked,
    suite: Suite,
    base: PathBuf,
}

/// Reads and checks a suite file.
pub fn suite(path: &Path) -> Result<Suite, BenchmarkError> {
    let text = input::text(path, Bound::SETTINGS)
        .map_err(|source| BenchmarkError::Read { path: path.to_owned(), source })?;
    let suite: Suite = toml::from_str(&text).map_err(|source| BenchmarkError::Parse {
        path: path.to_owned(),
        source: Box::new(source),
    })?;
    suite.check().map_err(|source| BenchmarkError::Suite { path: path.to_owned(), source })?;
    Ok(suite)
}

/// Runs a suite.
pub fn benchmark(asked: &Asked, progress: &dyn Progress) -> Result<Benchmark, BenchmarkError> {
    let chosen = Chosen::read(asked)?;
    let programs = Program::all(&asked.predictions, &chosen.suite, &chosen.base);
    let (mut rows, mut told, mut remarks) = (Vec::new(), Vec::new(), Vec::new());
    chosen.entries(&programs, &mut remarks)?;
    // Everything is read and divided before the first model is trained, so that what is wrong shows at once.
    let data = chosen.data(progress)?;
    for (arm, data) in &data {
        told.push((arm.name.clone(), data.told()));
        remarks.extend(data.remarks.iter().cloned());
    }
    let opened = chosen.opened(&data)?;
    progress.begin("splits", opened.len() as u64);
    for split in &opened {
        rows.extend(split.rows(&programs, progress)?);
    }
    progress.end();
    Ok(Benchmark {
        rows: BenchmarkRow::table_of_several(rows)?,
        suite: chosen.suite,
        told,
        remarks,
    })
}

/// Writes what other programs need of each split into a folder: ARM/robot.toml, ARM/SPLIT/train.csv and test.csv. Gives their paths.
pub fn export(
    asked: &Asked,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Vec<PathBuf>, BenchmarkError> {
    let chosen = Chosen::read(asked)?;
    let data = chosen.data(progress)?;
    let mut paths = Vec::new();
    for (arm, data) in &data {
        paths.push(written::robot(data, &folder.join(&arm.name))?);
    }
    for opened in chosen.opened(&data)? {
        let folder = folder.join(&opened.arm.name).join(&opened.split.name);
        paths.extend(written::stations(&opened, &folder)?);
    }
    Ok(paths)
}

pub use written::output;

impl<'a> Chosen<'a> {
    fn read(asked: &'a Asked) -> Result<Self, BenchmarkError> {
        let suite = suite(&asked.suite)?;
        let arms: Vec<&str> = suite.arms.iter().map(|own| &*own.name).collect();
        known("arm", &asked.arms, &arms)?;
        let base = asked.suite.parent().unwrap_or(Path::new("")).to_owned();
        let chosen = Self { asked, suite, base };
        let splits = chosen.arms().flat_map(|arm| &arm.splits);
        let splits: Vec<&str> = splits.map(|own| &*own.name).collect();
        known("split", &asked.splits, &splits)?;
        Ok(chosen)
    }

    fn arms(&self) -> impl Iterator<Item = &SuiteArm> {
        let is_asked =
            |arm: &&SuiteArm| self.asked.arms.is_empty() || self.asked.arms.contains(&arm.name);
        self.suite.arms.iter().filter(is_asked)
    }

    /// The splits of an arm that are asked for, and those beside them.
    fn splits<'s>(&'s self, arm: &'s SuiteArm) -> impl Iterator<Item = &'s SuiteSplit> {
        let asked = &self.asked.splits;
        let own = arm.splits.iter().filter(move |split| asked.contains(&split.name));
        let beside: BTreeSet<&String> = own.filter_map(|split| split.beside.as_ref()).collect();
        let is_asked = move |split: &&SuiteSplit| {
            asked.is_empty() || asked.contains(&split.name) || beside.contains(&split.name)
        };
        arm.splits.iter().filter(is_asked)
    }

    /// The data of each arm.
    fn data(&self, progress: &dyn Progress) -> Result<Vec<(&SuiteArm, ArmData)>, BenchmarkError> {
        let data = self.asked.data.as_deref();
        let read = |arm| Ok((arm, ArmData::read(arm, &self.base, data, progress)?));
        self.arms().map(read).collect()
    }

    /// Every split with its stations divided.
    fn opened<'d>(
        &'d self,
        data: &'d [(&'d SuiteArm, ArmData)],
    ) -> Result<Vec<Opened<'d>>, BenchmarkError> {
        let suite = (&self.suite, &self.asked.suite);
        let each = data
            .iter()
            .flat_map(|(arm, data)| self.splits(arm).map(move |split| (*arm, split, data)));
        each.map(|(arm, split, data)| Opened::new(suite, (arm, split), data)).collect()
    }

    fn each(&self) -> impl Iterator<Item = (&SuiteArm, &SuiteSplit)> {
        self.arms().flat_map(|arm| self.splits(arm).map(move |split| (arm, split)))
    }

    /// Checks that every program has predictions, and tells for which splits it has none.
    fn entries(
        &self,
        programs: &[Program],
        remarks: &mut Vec<String>,
    ) -> Result<(), BenchmarkError> {
        for program in programs {
            let all = self.each().count();
            let none: Vec<String> = self
                .each()
                .filter(|(arm, split)| program.file(arm, split).is_none())
                .map(|(arm, split)| format!("{}/{}", arm.name, split.name))
                .collect();
            let is_file = !program.path.is_dir();
            if none.len() == all || (is_file && all > 1) {
                return Err(BenchmarkError::NoPredictions {
                    program: program.name.clone(),
                    path: program.path.clone(),
                });
            }
            if !none.is_empty() {
                remarks.push(format!(
                    "{} has no predictions for {}",
                    program.name,
                    none.join(", ")
                ));
            }
        }
        Ok(())
    }
}

fn known(what: &'static str, asked: &[String], known: &[&str]) -> Result<(), BenchmarkError> {
    let Some(name) = asked.iter().find(|name| !known.contains(&name.as_str())) else {
        return Ok(());
    };
    Err(BenchmarkError::Unknown {
        what,
        name: name.clone(),
        known: known.iter().map(|own| (*own).to_owned()).collect(),
    })
}
