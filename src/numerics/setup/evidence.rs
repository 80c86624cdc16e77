//! The data of a session that speak about its set-up: reported angles, readings and commands, station by station.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, UnitQuaternion, Vector3};

use crate::join::{Command, Station, TargetId};

/// The most stations that are compared, spread over the session: the set-up has a dozen numbers.
const MOST: usize = 250;

#[derive(Debug, Clone, PartialEq)]
pub struct Dwelt {
    /// Reported joint angles in the order of the robot file's joints, rad as the pipeline file's unit makes them.
    pub reported: Vec<f64>,
    /// Measured position in the instrument's frame, mm as the pipeline file's unit makes them.
    pub measured: Vector3<f64>,
    /// Measured orientation in the instrument's frame; absent for a reflector.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The command in force, in the frame of commands; absent without commands.
    pub command: Option<Command>,
}

/// The measured stations of one session, at most 250.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evidence {
    pub stations: Vec<Dwelt>,
    /// The stations before and behind each of them; beside the first and the last they themselves.
    beside: Vec<[Dwelt; 2]>,
}

impl Evidence {
    /// The measured stations of a joined session; of several targets those that have the main one, which stated places and commands are
    /// of, unless another was measured at more than twice as many.
    pub fn of_stations(stations: &[Station]) -> Self {
        Self::of_target(stations, held_against(stations))
    }

    /// The same for each other target, of which commands and stated places say nothing.
    pub fn of_others(stations: &[Station]) -> impl Iterator<Item = (TargetId, Self)> {
        let main = held_against(stations);
        let readings = stations.iter().flat_map(Station::measured);
        let all: BTreeSet<TargetId> = readings.map(|own| own.target).collect();
        all.into_iter().filter(move |own| *own != main).map(|own| {
            let mut evidence = Self::of_target(stations, own);
            let beside = evidence.beside.iter_mut().flatten();
            for own in evidence.stations.iter_mut().chain(beside) {
                own.command = None;
            }
            (own, evidence)
        })
    }

    fn of_target(stations: &[Station], target: TargetId) -> Self {
        let dwelt = |station: &Station| {
            let mut own = station.measured().iter().filter(|r| r.target == target);
            let (measured, reading) = own.find_map(|own| Some((own.position()?, own)))?;
            Some(Dwelt {
                reported: station.joints.clone(),
                measured: measured.coords,
                orientation: reading.orientation(),
                command: station.command.clone(),
            })
        };
        Self::spread(stations.iter().filter_map(dwelt).collect())
    }

    /// At most 250 of `stations`, evenly spread.
    pub fn spread(stations: Vec<Dwelt>) -> Self {
        let beside = stations.iter().enumerate().map(|(place, own)| {
            let [before, behind] = [place.saturating_sub(1), place + 1];
            [before, behind].map(|at| stations.get(at).unwrap_or(own).clone())
        });
        let beside = beside.collect();
        Self { stations, beside }.thinned(MOST)
    }

    /// At most so many of the stations, evenly spread.
    pub(super) fn thinned(&self, most: usize) -> Self {
        let stride = self.stations.len().div_ceil(most).max(1);
        let stations = self.stations.iter().step_by(stride).cloned().collect();
        Self { stations, beside: self.beside.iter().step_by(stride).cloned().collect() }
    }

    /// Each station, or that in the row before (−1) or behind it (1).
    pub(super) fn of_row(&self, row: i8) -> Vec<&Dwelt> {
        match row {
            0 => self.stations.iter().collect(),
            _ => self.beside.iter().map(|beside| &beside[usize::from(row > 0)]).collect(),
        }
    }

    /// The commands of [`Self::of_row`] with the places of their stations.
    pub(super) fn commands(&self, row: i8) -> impl Iterator<Item = (usize, &Command)> {
        let stations = self.of_row(row).into_iter().enumerate();
        stations.filter_map(|(place, station)| Some((place, station.command.as_ref()?)))
    }
}

/// The main target, unless another was measured at more than twice as many stations; then that, of equally many the first.
fn held_against(stations: &[Station]) -> TargetId {
    let mut counts: BTreeMap<TargetId, usize> = BTreeMap::new();
    for reading in stations.iter().flat_map(Station::measured) {
        *counts.entry(reading.target).or_default() += 1;
    }
    let of_main = counts.get(&TargetId::MAIN).copied().unwrap_or_default();
    match counts.into_iter().rev().max_by_key(|(_, count)| *count) {
        Some((target, count)) if count > 2 * of_main => target,
        _ => TargetId::MAIN,
    }
}

pub(super) fn point(vector: &Vector3<f64>) -> Point3<f64> {
    Point3::from(*vector)
}
