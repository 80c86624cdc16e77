//! The files of a benchmark: what other programs need of its splits, and its results.

use std::io;
use std::path::{Path, PathBuf};

use super::Benchmark;
use super::data::ArmData;
use super::error::BenchmarkError;
use super::judged::Opened;
use crate::fit::Observation;
use crate::io::input::{self, Bound};
use crate::io::predictions::{GivenStation, csv_of};
use crate::io::table::write;
use crate::io::whole_file::replace_whole;
use crate::page::benchmark::html;

/// Copies the robot file of an arm into its folder.
pub(super) fn robot(data: &ArmData, folder: &Path) -> Result<PathBuf, BenchmarkError> {
    let path = &data.configuration.robot_file;
    let bytes = input::bytes(path, Bound::ANY)
        .map_err(|source| BenchmarkError::Write { path: path.clone(), source })?;
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    put(folder, &format!("robot.{ending}"), &bytes)
}

/// Writes the stations of a split: those that train with their positions, those that test with joints alone.
pub(super) fn stations(opened: &Opened<'_>, folder: &Path) -> Result<Vec<PathBuf>, BenchmarkError> {
    let divided = &opened.divided;
    let sessions: Vec<&String> = opened.split.train.keys().collect();
    let given = |session: &str, own: &Observation, is_given: bool| GivenStation {
        session: session.to_owned(),
        station: own.station,
        joints: joints(opened.data, session, own.station),
        measured: own.point().map(|point| point.position).filter(|_| is_given),
    };
    let names = opened.data.sessions.iter().map(|own| &own.name);
    let names: Vec<&String> = names.filter(|name| sessions.contains(name)).collect();
    let train = divided.train.iter().map(|own| given(names[own.session], own, true));
    let test = divided.test.iter();
    let test = test.map(|own| given(&own.session, &own.observation, opened.finds_base(own)));
    let files = [("train.csv", train.collect::<Vec<_>>()), ("test.csv", test.collect())];
    let written = files.into_iter().map(|(name, stations)| {
        let bytes = csv_of(&stations)
            .map_err(|source| BenchmarkError::Write { path: folder.join(name), source })?;
        put(folder, name, &bytes)
    });
    written.collect()
}

fn joints(data: &ArmData, session: &str, number: usize) -> Vec<f64> {
    let stations = data.session(session).map(|own| &own.joined.stations);
    let mut stations = stations.into_iter().flatten();
    let own = stations.find(|own| own.number == number);
    own.map(|own| own.joints.clone()).unwrap_or_default()
}

/// Writes the table and the page of a benchmark into a folder; gives their paths.
pub fn output(benchmark: &Benchmark, folder: &Path) -> Result<Vec<PathBuf>, BenchmarkError> {
    let table = &benchmark.rows.table;
    let bytes = write(table, Vec::new()).map_err(|error| BenchmarkError::Write {
        path: folder.to_owned(),
        source: io::Error::other(error),
    })?;
    let page = html(&benchmark.content());
    let table = put(folder, &format!("{}.parquet", table.schema().table), &bytes)?;
    Ok(vec![table, put(folder, "benchmark.html", page.as_bytes())?])
}

/// Replaces an earlier file, completely or not at all.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, BenchmarkError> {
    let path = folder.join(name);
    let written = std::fs::create_dir_all(folder).and_then(|()| replace_whole(&path, bytes));
    match written {
        Ok(()) => Ok(path),
        Err(source) => Err(BenchmarkError::Write { path, source }),
    }
}
