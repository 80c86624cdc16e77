//! Programs that enter: their files of predictions, each station once and none besides, in the unit and frame of the training.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::data::input;
use super::error::{BenchmarkError, PredictionsFault};
use crate::benchmark::Compared;
use crate::benchmark::suite::{Suite, SuiteArm, SuiteSplit};
use crate::io::predictions::{self, PredictedStation};
use crate::manifest::Input;
use crate::pipeline::stages::split::Tested;

/// Stations named in a message up to this many.
const NAMED: usize = 5;

/// A program, and the place of its predictions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Program {
    /// Its name.
    pub name: String,
    /// A folder with ARM/SPLIT.csv, or the file of one split.
    pub path: PathBuf,
}

impl Program {
    /// The programs of the command line and those that the suite names.
    pub(super) fn all(given: &[(String, PathBuf)], suite: &Suite, base: &Path) -> Vec<Self> {
        let named = suite.programs.iter();
        let named = named.map(|own| (own.name.clone(), base.join(&own.predictions)));
        let all = given.iter().cloned().chain(named);
        all.map(|(name, path)| Self { name, path }).collect()
    }

    /// Its file for a split; `None` where a folder has none.
    pub(super) fn file(&self, arm: &SuiteArm, split: &SuiteSplit) -> Option<PathBuf> {
        if !self.path.is_dir() {
            return Some(self.path.clone());
        }
        let path = self.path.join(&arm.name).join(format!("{}.csv", split.name));
        path.exists().then_some(path)
    }

    /// Its predictions of the stations `tested`, and the file as an input.
    pub(super) fn predictions(
        &self,
        (arm, split): (&SuiteArm, &SuiteSplit),
        tested: &[Tested],
        path: &Path,
    ) -> Result<(Vec<Compared>, Input), BenchmarkError> {
        let wrong = |fault| self.fault(arm, split, fault);
        let read = predictions::read(path).map_err(|error| wrong(error.into()))?;
        let compared = compared(&read, tested)
            .map_err(|fault| wrong(PredictionsFault::Stations { path: path.to_owned(), fault }))?;
        let name = format!("predictions/{}", self.name);
        Ok((compared, input(arm, path, &name)?))
    }

    /// The error of predictions for a split.
    pub(super) fn fault(
        &self,
        arm: &SuiteArm,
        split: &SuiteSplit,
        fault: PredictionsFault,
    ) -> BenchmarkError {
        BenchmarkError::Predictions {
            program: self.name.clone(),
            arm: arm.name.clone(),
            split: split.name.clone(),
            fault: Box::new(fault),
        }
    }
}

/// Predictions beside the measurements, in the order of `tested`.
fn compared(read: &[PredictedStation], tested: &[Tested]) -> Result<Vec<Compared>, String> {
    let several = tested.iter().any(|own| own.session != tested[0].session);
    let mut by_station: BTreeMap<(&str, usize), &PredictedStation> = BTreeMap::new();
    for own in read {
        let session = match &own.session {
            Some(session) => session.as_str(),
            None if several => {
                return Err(
                    "several sessions test: a column session says which a station is of".to_owned()
                );
            }
            None => tested.first().map_or("", |own| &own.session),
        };
        if let Some(earlier) = by_station.insert((session, own.station), own) {
            return Err(format!(
                "line {}: station {} of session {session:?} was predicted in line {} already",
                own.line, own.station, earlier.line
            ));
        }
    }
    let (mut missing, mut compared) = (Vec::new(), Vec::new());
    for own in tested {
        let station = own.observation.station;
        let found = by_station.remove(&(&*own.session, station));
        match found.zip(own.observation.point()) {
            Some((found, point)) => compared.push(Compared {
                measured: point.position,
                predicted: found.position,
                covariance: found.covariance,
            }),
            None => missing.push((own.session.as_str(), station)),
        }
    }
    let others: Vec<(&str, usize)> = by_station.into_keys().collect();
    if missing.is_empty() && others.is_empty() {
        return Ok(compared);
    }
    Err(format!(
        "the stations are not those that test: {} missing{}, {} that do not test{}; test.csv of --export has those that do",
        missing.len(),
        named(&missing),
        others.len(),
        named(&others)
    ))
}

fn named(stations: &[(&str, usize)]) -> String {
    if stations.is_empty() {
        return String::new();
    }
    let some = stations.iter().take(NAMED);
    let some: Vec<String> = some.map(|(session, station)| format!("{session}/{station}")).collect();
    let more = if stations.len() > NAMED { ", …" } else { "" };
    format!(" ({}{more})", some.join(", "))
}
