//! The cell as a pipeline file states it → the settings of a plan.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::fit::{CameraUncertainty, FitSettings, Noise, TrackerUncertainty, Uncertainty};
use crate::geometry::rpy;
use crate::kinematics::{Arm, SingularityFactors};
use crate::pipeline::configuration::{
    ConfigurationError, ConfigurationErrorKind, Result, placed, several_targets, upwards,
};
use crate::pipeline::file::PipelineFile;
use crate::plan::line_of_sight::{Constraints, KeepOut, LineOfSight};
use crate::plan::section::{ConstraintsSection, PlanSection};
use crate::plan::{PlanSettings, Region};
use crate::simulate::settings::{Cell, TrackerErrors};

/// Frames of the cell as the file states them.
pub(super) struct Placed<'p> {
    path: &'p Path,
    tracker_from_base: Isometry3<f64>,
    flange_from_target: Isometry3<f64>,
}

impl<'p> Placed<'p> {
    pub(super) fn new(path: &'p Path, file: &PipelineFile, section: &PlanSection) -> Result<Self> {
        let tool = file.commanded.as_ref().and_then(|section| section.flange_from_tool);
        let tool =
            tool.map(|tool| placed(path, "[commanded] flange_from_tool", &tool)).transpose()?;
        let target = of_main_target(file).target.map(|target| target.xyz_mm);
        let flange_from_target = match (target, tool) {
            (Some(xyz_mm), tool) => Isometry3::from_parts(
                Translation3::from(xyz_mm),
                tool.map_or_else(UnitQuaternion::identity, |tool| tool.rotation),
            ),
            (None, Some(tool)) => tool,
            (None, None) => {
                return Err(ConfigurationErrorKind::missing(
                    "[fit] target",
                    "a plan has to know where the target will sit at the flange (of several the main one, under its name in \
                             [fit.targets]): give its xyz_mm and sd_mm, or \
                             [commanded] flange_from_tool where the tool is the target",
                )
                .at(path));
            }
        };
        Ok(Self {
            path,
            tracker_from_base: placed(
                path,
                "[plan] tracker_from_base",
                &section.tracker_from_base,
            )?,
            flange_from_target,
        })
    }

    /// All settings that the plan follows from.
    pub(super) fn settings(
        &self,
        arm: &Arm,
        file: &PipelineFile,
        section: &PlanSection,
    ) -> Result<PlanSettings> {
        let missing = |key, reason| ConfigurationErrorKind::missing(key, reason).at(self.path);
        let bounds = file.grid.bounds.ok_or_else(|| {
            missing("[grid] box", "a plan has no stations to take a box from: give low_mm and high_mm in the base frame")
        })?;
        let home = section.home_deg.iter().zip(arm.joints());
        let home: Vec<f64> = home.map(|(value, joint)| joint.read(*value)).collect();
        let at_home = arm.flange(&home).isometry() * self.flange_from_target;
        let orientation = file.grid.orientation_xyzw.map_or(at_home.rotation, |[x, y, z, w]| {
            // The table's orientation is the tool's: that of the target here.
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
        });
        let fit = of_main_target(file);
        let up = file.robot.up;
        Ok(PlanSettings {
            seed: section.seed,
            flange_from_target: self.flange_from_target,
            region: Region { bounds, orientation, cone_rad: section.cone_deg.to_radians() },
            candidate_cone_rad: section.candidate_cone_deg.max(section.cone_deg).to_radians(),
            constraints: self.constraints(arm, &home, &section.constraints)?,
            grid: file.grid.clone(),
            tolerance: file.tolerance,
            population: section.expect.population(
                self.cell(file.fit.geometric.orientations),
                match &file.tracker.uncertainty {
                    Uncertainty::Tracker(own) => tracker(own),
                    Uncertainty::Camera(own) => {
                        camera(own, self.tracker_from_base.translation.vector.norm())
                    }
                },
                up.unwrap_or([0.0, 0.0, 1.0]),
            ),
            known: None,
            noise: Noise::of_one(file.tracker_source(), fit.repeatability_mm),
            fit,
            full: file.fit.full.clone(),
            up: up.map(|up| upwards(self.path, up)).transpose()?,
            robots: section.robots,
            whole_model_robots: section.whole_model_robots,
            test_poses: section.test_poses,
            robots_meet: section.robots_meet,
            candidates: section.candidates,
            poses: section.poses.clone(),
            drift_check_every: section.drift_check_every,
            verify_poses: section.verify_poses,
            home,
        })
    }

    fn cell(&self, six_dof: bool) -> Cell {
        Cell {
            tracker_from_base_mm: self.tracker_from_base.translation.vector.into(),
            tracker_from_base_rpy: rpy(&self.tracker_from_base.rotation),
            flange_from_target_mm: self.flange_from_target.translation.vector.into(),
            flange_from_target_rpy: rpy(&self.flange_from_target.rotation),
            six_dof,
            ..Cell::default()
        }
    }

    fn constraints(
        &self,
        arm: &Arm,
        home: &[f64],
        section: &ConstraintsSection,
    ) -> Result<Constraints> {
        let nominal = arm.no_offsets();
        let factors = SingularityFactors::of(arm, &nominal, home);
        let line_of_sight = section.line_of_sight.map(|line_of_sight| {
            let facing = Unit::try_new(Vector3::from(line_of_sight.facing), 1e-6);
            let wrong = || {
                ConfigurationErrorKind::setting(
                    "[plan.constraints] line_of_sight.facing",
                    format!("{:?}", line_of_sight.facing),
                    "a direction, for example [0, 0, 1]",
                )
            };
            let facing = facing.ok_or_else(|| wrong().at(self.path))?;
            Ok::<LineOfSight, ConfigurationError>(LineOfSight {
                tracker: Point3::from(self.tracker_from_base.inverse().translation.vector),
                facing,
                acceptance_rad: line_of_sight.acceptance_deg.to_radians(),
                range_mm: line_of_sight.range_mm,
                link_radius_mm: line_of_sight.link_radius_mm,
            })
        });
        let boxes = section.keep_out.iter().map(|keep_out| KeepOut {
            name: keep_out.name.clone(),
            least_mm: keep_out.low_mm,
            most_mm: keep_out.high_mm,
        });
        Ok(Constraints {
            configuration: factors.as_ref().map(SingularityFactors::configuration),
            least_singularity_factor: factors.map_or(0.0, |_| section.least_singularity_factor),
            limit_margin_rad: section.limit_margin_deg.to_radians(),
            flange_from_target: self.flange_from_target,
            keep_out: boxes.collect(),
            keep_out_margin_mm: section.keep_out_margin_mm,
            tracker: line_of_sight.transpose()?,
        })
    }
}

/// The geometric fit of planned sessions, whose target is the main one of the pipeline file.
fn of_main_target(file: &PipelineFile) -> FitSettings {
    let fit = &file.fit.geometric;
    let main = several_targets(file).first().and_then(|name| fit.targets.get(name).copied());
    FitSettings {
        target: fit.target.or(main),
        targets: BTreeMap::new(),
        target_distances: Vec::new(),
        ..fit.clone()
    }
}

/// The instrument in the form of simulated sessions.
fn tracker(uncertainty: &TrackerUncertainty) -> TrackerErrors {
    let simulated = TrackerErrors::adm();
    TrackerErrors {
        radial_mm: uncertainty.range_um * 1e-3,
        radial_per_mm: uncertainty.range_um_per_m * 1e-6,
        transverse_mm: uncertainty.transverse_um * 1e-3,
        transverse_per_mm: uncertainty.transverse_um_per_m * 1e-6,
        divisor: uncertainty.divisor,
        orientation_rad: uncertainty.orientation_rad.unwrap_or(simulated.orientation_rad),
        ..simulated
    }
}

/// A camera in the form of simulated sessions: its uncertainty at a distance (mm) stands for that everywhere.
fn camera(uncertainty: &CameraUncertainty, distance_mm: f64) -> TrackerErrors {
    let at = uncertainty.covariance(&Point3::new(0.0, 0.0, distance_mm));
    TrackerErrors {
        radial_mm: at[(2, 2)].sqrt(),
        radial_per_mm: 0.0,
        transverse_mm: at[(0, 0)].sqrt(),
        transverse_per_mm: 0.0,
        divisor: 1.0,
        orientation_rad: uncertainty.orientation_rad(distance_mm),
        ..TrackerErrors::adm()
    }
}
