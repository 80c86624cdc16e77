//! Plans of the arms that tests know: a KR 210 in a box of one cubic metre, and a UR10.

use nalgebra::Vector3;
use posegrid::figures::Coverage;
use posegrid::fit::full::FullSettings;
use posegrid::fit::{FitSettings, KnownTarget};
use posegrid::geometry::isometry_from_rpy;
use posegrid::grid::{GridSettings, Interpolation, Source, Tolerance, WorkBox};
use posegrid::kinematics::Arm;
use posegrid::plan::{PlanSettings, Region};
use posegrid::simulate::settings::{Cell, GeometryErrors};
use posegrid::simulate::{Poses, SimulateSettings};

use super::NOISE;

/// Where the target is meant to sit at the flange, mm.
const TARGET_MM: [f64; 3] = [25.0, -40.0, 100.0];

/// A plan for a cube about `centre_mm` in the orientation of `home_deg`.
pub fn plan(
    arm: &Arm,
    home_deg: &[f64],
    centre_mm: [f64; 3],
    size_mm: f64,
    tolerance_mm: f64,
) -> PlanSettings {
    let home: Vec<f64> = home_deg.iter().map(|deg| deg.to_radians()).collect();
    let flange_from_target = isometry_from_rpy(TARGET_MM, [0.0; 3]);
    let orientation = (arm.flange(&home).isometry() * flange_from_target).rotation;
    let corner = |sign: f64| centre_mm.map(|middle| middle + sign * size_mm / 2.0);
    let none = Poses::Joints {
        count: 0,
        lower: vec![],
        upper: vec![],
    };
    let realistic = SimulateSettings::realistic(0, home.clone(), none);
    PlanSettings {
        seed: 1,
        home,
        flange_from_target,
        region: Region {
            bounds: WorkBox {
                low_mm: corner(-1.0),
                high_mm: corner(1.0),
            },
            orientation,
            cone_rad: 0.0,
        },
        grid: GridSettings {
            steps_mm: vec![100.0, 125.0, 160.0, 200.0, 250.0, 330.0, 500.0, 1000.0],
            bounds: None,
            orientation_xyzw: None,
            orientation_tolerance_deg: 5.0,
            interpolations: vec![Interpolation::Idw, Interpolation::Trilinear],
            sources: vec![Source::Measured, Source::Model],
            idw_power: 2.0,
        },
        tolerance: Tolerance {
            mm: tolerance_mm,
            share: 0.95,
            confidence: 0.95,
        },
        population: SimulateSettings {
            geometry: GeometryErrors {
                length_sd_mm: 0.3,
                angle_sd_rad: 0.02f64.to_radians(),
            },
            cell: Cell {
                flange_from_target_mm: TARGET_MM,
                ..realistic.cell
            },
            ..realistic
        },
        noise: NOISE,
        fit: FitSettings {
            target: Some(KnownTarget {
                xyz_mm: TARGET_MM,
                sd_mm: 0.2,
            }),
            ..FitSettings::default()
        },
        full: FullSettings::default(),
        up: Some(Vector3::z_axis()),
        robots: 100,
        whole_model_robots: 10,
        test_poses: 200,
        robots_meet: Coverage {
            share: 0.95,
            confidence: 0.95,
        },
        candidates: 600,
        poses: vec![25, 50, 100],
    }
}

/// A KR 210 in a cube of one metre before it.
pub fn kr210(arm: &Arm, tolerance_mm: f64) -> PlanSettings {
    plan(
        arm,
        &[0.0, -75.0, 100.0, 25.0, 55.0, -15.0],
        [1500.0, 0.0, 1100.0],
        1000.0,
        tolerance_mm,
    )
}
