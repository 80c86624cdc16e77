//! The data of a session that speak about its set-up: reported angles, readings and commands, station by station.

use nalgebra::{Point3, Vector3};

use crate::join::{Command, Reading, Station};

/// The most stations that are compared, spread over the session: the set-up has a dozen numbers.
const MOST: usize = 250;

/// One station as the logs state it.
#[derive(Debug, Clone, PartialEq)]
pub struct Dwelt {
    /// Reported joint angles in the order of the robot file's joints, rad as the pipeline file's unit makes them.
    pub reported: Vec<f64>,
    /// Measured position in the instrument's frame, mm as the pipeline file's unit makes them.
    pub measured: Vector3<f64>,
    /// The command in force, in the frame of commands; absent without commands.
    pub command: Option<Command>,
}

/// The measured stations of one session, at most 250.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evidence {
    /// The stations, in time order.
    pub stations: Vec<Dwelt>,
}

impl Evidence {
    /// The measured stations of a joined session; one of several readings speaks for its station.
    pub fn of_stations(stations: &[Station]) -> Self {
        let dwelt = |station: &Station| {
            let measured = station.measured().iter().find_map(Reading::position)?;
            Some(Dwelt {
                reported: station.joints.clone(),
                measured: measured.coords,
                command: station.command.clone(),
            })
        };
        Self::spread(stations.iter().filter_map(dwelt).collect())
    }

    /// At most 250 of `stations`, evenly spread.
    pub fn spread(stations: Vec<Dwelt>) -> Self {
        let stride = stations.len().div_ceil(MOST).max(1);
        Self {
            stations: stations.into_iter().step_by(stride).collect(),
        }
    }

    /// The commanded positions with the places of their stations.
    pub(super) fn commands(&self) -> impl Iterator<Item = (usize, &Command)> {
        let stations = self.stations.iter().enumerate();
        stations.filter_map(|(place, station)| Some((place, station.command.as_ref()?)))
    }
}

/// The point of a vector from the origin.
pub(super) fn point(vector: &Vector3<f64>) -> Point3<f64> {
    Point3::from(*vector)
}
