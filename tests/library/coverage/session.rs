//! One simulated session, measured, and the full error model trained on three quarters of it.
//!
//! The session has every ingredient of `SimulateSettings::realistic`: wrong geometry (0.4 mm, 0.3 mrad), joint curves with a
//! slow part (0.1 mrad over 50°) and a fast one (20 µrad over 6°), gear lines (10 µrad), gravity (0.4 mrad), backlash
//! (20 µrad), stopping short of the command (50 µrad), repeatability (5 µrad), a drifting base (20 µm and more), a laser
//! tracker's noise, lost beams and outlying readings. None of it is drawn from the model's own priors.

use std::f64::consts::SQRT_2;

use nalgebra::{Isometry3, Point3, Vector3};
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::{FullModel, FullSettings, Purpose};
use posegrid::fit::{self, FitSettings, Freedom, Noise, Observation, Source, TrackerUncertainty};
use posegrid::geometry::isometry_from_rpy;
use posegrid::join::ReadingKind;
use posegrid::kinematics::Arm;
use posegrid::simulate::{Poses, SimulateSettings, TrueStation, Truth, simulate};

/// Every fourth station is kept from the training.
const FRESH: usize = 4;

/// An arm and where it is measured.
pub struct Cell {
    /// Its name in the report.
    pub name: &'static str,
    /// Its robot file.
    pub robot: &'static str,
    /// Reported angles about which configurations are drawn, degrees.
    pub home_deg: [f64; 6],
    /// How far each joint goes to either side, degrees.
    pub spread_deg: [f64; 6],
}

pub const CELLS: [Cell; 3] = [
    Cell {
        name: "KR 210",
        robot: "kr210-r2700-extra",
        home_deg: [0.0, -75.0, 95.0, 0.0, 60.0, 0.0],
        spread_deg: [60.0, 30.0, 35.0, 90.0, 40.0, 120.0],
    },
    Cell {
        name: "IRB 120",
        robot: "irb120",
        home_deg: [0.0, 10.0, 0.0, 0.0, 60.0, 0.0],
        spread_deg: [60.0, 40.0, 45.0, 90.0, 40.0, 120.0],
    },
    Cell {
        name: "UR10",
        robot: "ur10",
        home_deg: [0.0, -70.0, 90.0, -110.0, -90.0, 0.0],
        spread_deg: [60.0, 40.0, 45.0, 60.0, 50.0, 120.0],
    },
];

/// What a simulated tracker is known to do: half of its variance is common to all readings of a station, the other half
/// shows in their scatter. So the instrument's figure for a station is the data sheet's over √2.
fn noise() -> Noise {
    Noise::of_one(
        Source {
            reads: ReadingKind::Point,
            uncertainty: TrackerUncertainty {
                range_um: 10.0,
                range_um_per_m: 0.3,
                transverse_um: 15.0,
                transverse_um_per_m: 6.0,
                divisor: 2.0 * SQRT_2,
                orientation_rad: None,
            }
            .into(),
        },
        0.03,
    )
}

/// A session, what is behind it, and the model that saw three quarters of it.
pub struct Session {
    pub arm: Arm,
    pub truth: Truth,
    pub training: Vec<Observation>,
    pub fresh: Vec<Observation>,
    pub model: FullModel,
}

/// What a position is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attained {
    /// Where the arm stood on that visit.
    OnThisVisit,
    /// Where it stands without what no other visit repeats.
    OnAverage,
}

impl Session {
    /// Session `seed` of a cell, `stations` stations in all.
    pub fn new(cell: &Cell, seed: u64, stations: usize) -> Self {
        let arm = super::common::arm(cell.robot);
        let settings = settings(cell, seed, stations);
        let simulated = simulate(&arm, &settings).expect("reachable poses");
        let joined = simulated.stations();
        let frames = CommandFrames {
            base_from_command: Isometry3::identity(),
            flange_from_tool: Some(isometry_from_rpy(
                settings.cell.flange_from_target_mm,
                settings.cell.flange_from_target_rpy,
            )),
        };
        let mut all = fit::observations(0, &joined, &arm, &noise());
        fit::add_commands(&mut all, &joined, &commanded(&joined, &arm, &frames));
        let (fresh, training): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|o| o.station % FRESH == FRESH - 1);
        Self { model: trained(&arm, &training), truth: simulated.truth, arm, training, fresh }
    }

    /// What really was at an observation's station.
    pub fn true_station(&self, observation: &Observation) -> &TrueStation {
        &self.truth.stations[observation.station]
    }

    /// Where the target really was in the tracker's frame, mm, without the tracker's noise.
    pub fn attained(&self, observation: &Observation, attained: Attained) -> Vector3<f64> {
        let station = self.true_station(observation);
        if attained == Attained::OnThisVisit {
            return station.tracker_from_target.translation.vector;
        }
        let parts = station.visit.iter().zip(&station.repeated);
        let visit: Vec<f64> = parts.map(|(all, repeated)| all - repeated).collect();
        let arm = &self.truth.arm;
        let in_base = arm.base_from_target(&self.arm, &station.reported, &visit);
        let cell = &self.truth.settings.cell;
        let tracker_from_base =
            isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
        let drifted = Point3::from(in_base.translation.vector + station.base_drift_mm);
        (tracker_from_base * drifted).coords
    }
}

fn settings(cell: &Cell, seed: u64, stations: usize) -> SimulateSettings {
    let home = cell.home_deg.map(f64::to_radians);
    let bound = |side: f64| -> Vec<f64> {
        home.iter().zip(cell.spread_deg).map(|(q, spread)| q + side * spread.to_radians()).collect()
    };
    let poses = Poses::Joints { count: stations, lower: bound(-1.0), upper: bound(1.0) };
    SimulateSettings::realistic(seed, home.to_vec(), poses)
}

fn trained(arm: &Arm, training: &[Observation]) -> FullModel {
    let settings = FitSettings::default();
    let start = fit::identify(arm, training, 1, Freedom::Geometry, &settings).expect("a fit");
    FullModel::train(
        arm,
        training,
        (&start.frames[..], &start.geometry[..]),
        &settings.prior(),
        &FullSettings::default(),
        Purpose::Published,
        Some(Vector3::z_axis()),
    )
    .expect("a positive definite model")
}
