//! `targets_by_geometry`: targets whose readings do not name them, and what is stated of them.

use nalgebra::Vector3;

use super::checks::{Check, wrong_unless};
use crate::fit::FitSettings;
use crate::ingest::StationsSettings;
use crate::join::assigned::{MOST, Stated, StatedDistance};
use crate::pipeline::file::PipelineFile;

/// The section that lists targets to be found by geometry, and their names; none where readings name their targets.
fn names(file: &PipelineFile) -> (&'static str, &[String]) {
    let of_table = file.stations.as_ref();
    let of_log = file.tracker.mapping.as_ref();
    match (of_table, of_log) {
        (Some(stations), _) => ("stations", &stations.targets_by_geometry),
        (None, Some(tracker)) => ("tracker", &tracker.targets_by_geometry),
        (None, None) => ("tracker", &[]),
    }
}

/// Stated places and distances of the targets that are to be found by geometry; `None` where readings name their targets.
pub(super) fn unnamed(file: &PipelineFile) -> Option<Stated> {
    let (_, names) = names(file);
    (!names.is_empty()).then(|| stated(names, &file.fit.geometric))
}

/// Stated places and distances of the targets of these names.
fn stated(names: &[String], fit: &FitSettings) -> Stated {
    let own = FitSettings { target_names: names.to_vec(), ..fit.clone() };
    let prior = own.prior();
    let place = |name: &String| {
        let known = fit.targets.get(name)?;
        Some((Vector3::from(known.xyz_mm), known.sd_mm))
    };
    let distances = prior.distances.iter().map(|own| StatedDistance {
        between: own.between.map(|target| target.0),
        mm: own.mm,
        sd_mm: own.sd_mm,
    });
    Stated {
        places: names.iter().map(place).collect(),
        distances: distances.collect(),
        names: names.to_vec(),
    }
}

/// Checks the names of targets that are found by geometry, and that enough is stated of them.
pub(super) fn targets(file: &PipelineFile) -> Check {
    let (section, names) = names(file);
    if names.is_empty() {
        return Ok(());
    }
    let key = format!("[{section}] targets_by_geometry");
    let twice = names.iter().enumerate().any(|(place, name)| names[..place].contains(name));
    wrong_unless(
        (2..=MOST).contains(&names.len()) && !twice,
        &key,
        names.join(", "),
        format!("2 to {MOST} names, each of one target"),
    )?;
    let stated = stated(names, &file.fit.geometric);
    let unknown = stated.unknown_distance();
    wrong_unless(
        unknown.is_none(),
        &key,
        unknown
            .map_or_else(String::new, |pair| format!("no distance between {}", pair.join(" and "))),
        "the places of both at the flange in [fit.targets], or their distance in [[fit.target_distances]]: by them it is found which \
         reading is of which target",
    )
}

/// Checks the table of stations whose readings do not name their targets.
pub(super) fn columns(stations: &StationsSettings) -> Check {
    if stations.targets_by_geometry.is_empty() {
        return Ok(());
    }
    let key = "[stations] targets_by_geometry";
    wrong_unless(
        stations.target.is_none() && stations.targets.is_empty(),
        key,
        "beside target",
        "without `target` and `targets`: readings name their targets, or do not",
    )?;
    wrong_unless(
        stations.measured.iter().all(|own| own.name.is_none()),
        "[[stations.measured]] name",
        "beside targets_by_geometry",
        "left out: the columns hold readings of any of the targets",
    )?;
    let is_long = stations.is_long_unnamed();
    wrong_unless(
        !stations.measured.is_empty() && (!is_long || stations.station.is_some()),
        key,
        "no station",
        "`station`, the column that says which rows belong together, with one [stations.measured]; or several [[stations.measured]]",
    )?;
    wrong_unless(
        !is_long || (stations.references.is_empty() && stations.lengths.is_empty()),
        key,
        "rows of single readings beside references or lengths",
        "a table with the readings of a station in one row, or a column `target` that names each reading",
    )
}
