//! Planning: the `[plan]` section of a pipeline file → a published plan.
//!
//! Inputs: the pipeline file at a path, no log. Output: [`Planned`]; in the lake, the tables `sampling_plan` and
//! `plan_figures`, the plan's page made of them, and the row of `runs` that makes them exist. The plan's id is that run; the same file gives the same plan.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use thiserror::Error;

use super::file::PipelineFile;
use super::plan::{PlanError, files};
use super::run::{self, RunError, input};
use crate::fit::{Noise, TrackerUncertainty};
use crate::io::lake::{Commit, Lake, LakeError};
use crate::io::page::{self, plan::About};
use crate::io::tables::{PublishError, sampling_plan};
use crate::kinematics::{Arm, SingularityFactors};
use crate::manifest::{self, ManifestError, Outcome, RunKey, StageCount, Work};
use crate::plan::section::{ConstraintsSection, PlanSection};
use crate::plan::sight::{Constraints, KeepOut, Sight};
use crate::plan::{self, PlanSettings, Region, SamplingPlan};
use crate::progress::Progress;
use crate::report;
use crate::simulate::settings::{Cell, TrackerErrors};

/// The session under which a plan stands in the lake.
pub const SESSION: &str = "plan";

/// A checked pipeline file with its `[plan]`.
#[derive(Debug)]
pub struct Planning {
    /// The nominal arm.
    pub arm: Arm,
    /// What the plan follows from.
    pub settings: PlanSettings,
    /// The folder of published tables.
    pub lake: PathBuf,
    command_from_base: Isometry3<f64>,
    work: Work,
}

/// A plan that was made, or was there already.
#[derive(Debug)]
pub struct Planned {
    /// Its id.
    pub key: RunKey,
    /// What it says.
    pub plan: SamplingPlan,
    /// Where its page is; plans of versions that wrote none have none.
    pub page: Option<PathBuf>,
    /// Whether the lake had it already.
    pub already_there: bool,
}

/// Why there is no plan.
#[derive(Debug, Error)]
pub enum PlanningError {
    /// The pipeline file.
    #[error(transparent)]
    File(#[from] PlanError),
    /// The settings have no canonical form.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// An input cannot be read.
    #[error(transparent)]
    Input(#[from] Box<RunError>),
    /// The plan itself.
    #[error("plan: {0}")]
    Plan(#[from] plan::PlanError),
    /// The tables cannot be published.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The lake cannot be read or written.
    #[error(transparent)]
    Lake(#[from] LakeError),
}

impl PlanningError {
    /// Whether the pipeline file is at fault.
    pub const fn is_usage(&self) -> bool {
        matches!(self, Self::File(_))
    }
}

impl Planning {
    /// Reads and checks the pipeline file at `path`.
    pub fn load(path: &Path, lake: Option<&Path>) -> Result<Self, PlanningError> {
        let read = files::read(path)?;
        let file = &read.file;
        let section = file.plan.as_ref().ok_or_else(|| PlanError::Missing {
            path: path.to_owned(),
            key: "[plan]",
            reason: "it says what robot to expect and where the tracker stands; at least home_deg and tracker_from_base",
        })?;
        check(path, section, read.arm.joints().len())?;
        let settings = Placed::new(path, file, section)?.settings(&read.arm, file, section)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let work = Work {
            robot: file
                .robot
                .name
                .clone()
                .unwrap_or_else(|| stem.clone().into_owned()),
            session: SESSION.to_owned(),
            pipeline: stem.into_owned(),
            sessions: Vec::new(),
            test_sessions: Vec::new(),
            inputs: vec![input(&read.robot_file, "robot").map_err(Box::new)?],
            settings: manifest::canonical(&(file, section))?,
        };
        let base_from_command = match &file.commanded {
            Some(section) => placed(
                path,
                "[commanded] base_from_command",
                &section.base_from_command,
            )?,
            None => Isometry3::identity(),
        };
        Ok(Self {
            arm: read.arm,
            settings,
            lake: lake.map_or(read.lake, Path::to_owned),
            command_from_base: base_from_command.inverse(),
            work,
        })
    }

    /// Makes the plan and publishes it.
    pub fn make(&self, progress: &dyn Progress) -> Result<Planned, PlanningError> {
        let key = self.work.key();
        let plan = plan::plan(&self.arm, &self.settings, progress)?;
        let lake = Lake::new(&self.lake);
        let commit = self.publish(&plan, &lake, &key)?;
        let page = run::page(&lake, &key).map_err(Box::new)?;
        Ok(Planned {
            key,
            plan,
            page,
            already_there: commit == Commit::AlreadyThere,
        })
    }

    /// Writes the tables of a plan, its page, and then its row of `runs`.
    fn publish(
        &self,
        plan: &SamplingPlan,
        lake: &Lake,
        key: &RunKey,
    ) -> Result<Commit, PlanningError> {
        let replaces = lake.current(key)?;
        let Some(mut run) = lake.start(key)? else {
            return Ok(Commit::AlreadyThere);
        };
        let frame = &self.command_from_base;
        let tables = [
            sampling_plan::sampling_plan(plan, &self.settings, &self.arm, frame, key)?,
            sampling_plan::plan_figures(plan, &self.settings, key)?,
        ];
        for table in &tables {
            run.publish(table)?;
        }
        let counts = counts(plan);
        let about = About {
            work: &self.work,
            counts: &counts,
            written: run.written(),
        };
        let html = report::page::plan::html(&page::plan::content(&tables, &about));
        run.publish_page(&html)?;
        let row = self
            .work
            .runs_table(&counts, run.written(), &ending(plan, replaces))?;
        Ok(run.commit(&row)?)
    }
}

/// Candidates in and out: in = kept + rejected.
fn counts(plan: &SamplingPlan) -> Vec<StageCount> {
    let drawn = &plan.candidates;
    let rejected: BTreeMap<String, u64> = drawn
        .refused
        .iter()
        .map(|(reason, count)| ((*reason).to_owned(), *count as u64))
        .collect();
    vec![StageCount {
        stage: "plan",
        of: "candidate poses",
        read: drawn.poses as u64,
        kept: drawn.poses as u64 - rejected.values().sum::<u64>(),
        rejected,
    }]
}

fn ending(plan: &SamplingPlan, replaces: Option<String>) -> Outcome {
    let promise = &plan.promise;
    let verdict = match promise.bound_mm {
        _ if plan.is_met() => "met",
        Some(_) => "not_met",
        None => "not_shown",
    };
    Outcome {
        verdict: verdict.to_owned(),
        reason: (!plan.is_met()).then(|| {
            format!(
                "{} of {} simulated robots meet the tolerance: at least {:.3} of all, {:.3} are asked for",
                promise.meet, promise.robots, promise.share_at_least, promise.share_asked
            )
        }),
        replaces,
    }
}

/// Counts and sizes of a `[plan]` that cannot be.
fn check(path: &Path, section: &PlanSection, joints: usize) -> Result<(), PlanError> {
    let wrong = |key: &str, found: String, wanted: &str| PlanError::Setting {
        path: path.to_owned(),
        key: format!("[plan] {key}"),
        found,
        wanted: wanted.to_owned(),
    };
    if section.home_deg.len() != joints {
        let wanted = format!("one angle for each of the arm's {joints} joints, degrees");
        return Err(wrong(
            "home_deg",
            format!("{} angles", section.home_deg.len()),
            &wanted,
        ));
    }
    let counts = [
        ("robots", section.robots),
        ("whole_model_robots", section.whole_model_robots),
        ("test_poses", section.test_poses),
        ("candidates", section.candidates),
    ];
    for (key, found) in counts {
        if !(1..=MOST).contains(&found) {
            return Err(wrong(key, found.to_string(), "1 to 100000"));
        }
    }
    let sizes = plan::session::LEAST_POSES..=MOST_POSES;
    if section.poses.is_empty() || !section.poses.iter().all(|poses| sizes.contains(poses)) {
        let wanted = "one number of poses or more, each from 10 to 2000, for example [25, 50, 100]";
        return Err(wrong("poses", format!("{:?}", section.poses), wanted));
    }
    for (key, found) in [
        ("drift_check_every", section.drift_check_every),
        ("verify_poses", section.verify_poses),
    ] {
        if found > MOST_POSES {
            return Err(wrong(key, found.to_string(), "0 to 2000"));
        }
    }
    for (key, found) in [
        ("cone_deg", section.cone_deg),
        ("candidate_cone_deg", section.candidate_cone_deg),
    ] {
        if !(0.0..=180.0).contains(&found) {
            return Err(wrong(key, found.to_string(), "0 to 180 degrees"));
        }
    }
    let expect = &section.expect;
    let sizes = [
        ("length_sd_mm", expect.length_sd_mm),
        ("angle_sd_deg", expect.angle_sd_deg),
        ("slow_curve_urad", expect.slow_curve_urad),
        ("fast_curve_urad", expect.fast_curve_urad),
        ("gear_line_urad", expect.gear_line_urad),
        ("backlash_urad", expect.backlash_urad),
        ("stops_short_urad", expect.stops_short_urad),
        ("repeatability_urad", expect.repeatability_urad),
        ("sag_urad", expect.sag_urad),
        ("target_sd_mm", expect.target_sd_mm),
        ("base_drift_mm", expect.base_drift_mm),
    ];
    for (key, found) in sizes {
        if found < 0.0 {
            return Err(wrong(
                &format!("expect.{key}"),
                found.to_string(),
                "0 or more",
            ));
        }
    }
    let shares = [
        ("robots_meet.share", section.robots_meet.share),
        ("robots_meet.confidence", section.robots_meet.confidence),
    ];
    for (key, found) in shares {
        if !(found > 0.0 && found < 1.0) {
            return Err(wrong(
                key,
                found.to_string(),
                "between 0 and 1, for example 0.95",
            ));
        }
    }
    if !(0.0..1.0).contains(&expect.lost_share) {
        return Err(wrong(
            "expect.lost_share",
            expect.lost_share.to_string(),
            "0 or more and below 1",
        ));
    }
    Ok(())
}

/// More robots or poses than this are a slip of the pen.
const MOST: usize = 100_000;
/// More poses than this are no session.
const MOST_POSES: usize = 2000;

fn placed(
    path: &Path,
    key: &'static str,
    placement: &crate::geometry::Placement,
) -> Result<Isometry3<f64>, PlanError> {
    placement.isometry().map_err(|source| PlanError::Placement {
        path: path.to_owned(),
        key,
        source,
    })
}

/// Frames of the cell as the file states them.
struct Placed<'p> {
    path: &'p Path,
    tracker_from_base: Isometry3<f64>,
    flange_from_target: Isometry3<f64>,
}

impl<'p> Placed<'p> {
    fn new(path: &'p Path, file: &PipelineFile, section: &PlanSection) -> Result<Self, PlanError> {
        let tool = file
            .commanded
            .as_ref()
            .and_then(|section| section.flange_from_tool);
        let tool = tool
            .map(|tool| placed(path, "[commanded] flange_from_tool", &tool))
            .transpose()?;
        let target = file.fit.geometric.target.map(|target| target.xyz_mm);
        let flange_from_target = match (target, tool) {
            (Some(xyz_mm), tool) => Isometry3::from_parts(
                Translation3::from(xyz_mm),
                tool.map_or_else(UnitQuaternion::identity, |tool| tool.rotation),
            ),
            (None, Some(tool)) => tool,
            (None, None) => {
                return Err(PlanError::Missing {
                    path: path.to_owned(),
                    key: "[fit] target",
                    reason: "a plan has to know where the target will sit at the flange: give its xyz_mm and sd_mm, or \
                             [commanded] flange_from_tool where the tool is the target",
                });
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

    fn settings(
        &self,
        arm: &Arm,
        file: &PipelineFile,
        section: &PlanSection,
    ) -> Result<PlanSettings, PlanError> {
        let missing = |key, reason| PlanError::Missing {
            path: self.path.to_owned(),
            key,
            reason,
        };
        let bounds = file.grid.bounds.ok_or_else(|| {
            missing("[grid] box", "a plan has no stations to take a box from: give low_mm and high_mm in the base frame")
        })?;
        let home: Vec<f64> = section
            .home_deg
            .iter()
            .map(|deg| deg.to_radians())
            .collect();
        let at_home = arm.flange(&home).isometry() * self.flange_from_target;
        let orientation = file
            .grid
            .orientation_xyzw
            .map_or(at_home.rotation, |[x, y, z, w]| {
                // The table's orientation is the tool's: that of the target here.
                UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
            });
        let fit = &file.fit.geometric;
        let up = file.robot.up;
        Ok(PlanSettings {
            seed: section.seed,
            flange_from_target: self.flange_from_target,
            region: Region {
                bounds,
                orientation,
                cone_rad: section.cone_deg.to_radians(),
            },
            candidate_cone_rad: section
                .candidate_cone_deg
                .max(section.cone_deg)
                .to_radians(),
            constraints: self.constraints(arm, &home, &section.constraints)?,
            grid: file.grid.clone(),
            tolerance: file.tolerance,
            population: section.expect.population(
                self.cell(fit.orientations),
                tracker(&file.tracker.uncertainty),
                up.unwrap_or([0.0, 0.0, 1.0]),
            ),
            noise: Noise {
                tracker: file.tracker.uncertainty,
                repeatability_mm: fit.repeatability_mm,
                orientations: fit.orientations,
            },
            fit: fit.clone(),
            full: file.fit.full.clone(),
            up: up.map(|up| Unit::new_normalize(Vector3::from(up))),
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
        let rpy = |placement: &Isometry3<f64>| {
            let (roll, pitch, yaw) = placement.rotation.euler_angles();
            [roll, pitch, yaw]
        };
        Cell {
            tracker_from_base_mm: self.tracker_from_base.translation.vector.into(),
            tracker_from_base_rpy: rpy(&self.tracker_from_base),
            flange_from_target_mm: self.flange_from_target.translation.vector.into(),
            flange_from_target_rpy: rpy(&self.flange_from_target),
            six_dof,
            ..Cell::default()
        }
    }

    fn constraints(
        &self,
        arm: &Arm,
        home: &[f64],
        section: &ConstraintsSection,
    ) -> Result<Constraints, PlanError> {
        let nominal = vec![0.0; arm.chain().parameters().len()];
        let factors = SingularityFactors::of(arm, &nominal, home);
        let sight = section.sight.map(|sight| {
            let facing = Unit::try_new(Vector3::from(sight.facing), 1e-6);
            let facing = facing.ok_or_else(|| PlanError::Setting {
                path: self.path.to_owned(),
                key: "[plan.constraints] sight.facing".to_owned(),
                found: format!("{:?}", sight.facing),
                wanted: "a direction, for example [0, 0, 1]".to_owned(),
            })?;
            Ok::<Sight, PlanError>(Sight {
                tracker: Point3::from(self.tracker_from_base.inverse().translation.vector),
                facing,
                acceptance_rad: sight.acceptance_deg.to_radians(),
                range_mm: sight.range_mm,
                link_radius_mm: sight.link_radius_mm,
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
            tracker: sight.transpose()?,
        })
    }
}

/// The instrument as simulated sessions have it.
fn tracker(uncertainty: &TrackerUncertainty) -> TrackerErrors {
    let simulated = TrackerErrors::adm();
    TrackerErrors {
        radial_mm: uncertainty.range_um * 1e-3,
        radial_per_mm: uncertainty.range_um_per_m * 1e-6,
        transverse_mm: uncertainty.transverse_um * 1e-3,
        transverse_per_mm: uncertainty.transverse_um_per_m * 1e-6,
        divisor: uncertainty.divisor,
        orientation_rad: uncertainty
            .orientation_rad
            .unwrap_or(simulated.orientation_rad),
        ..simulated
    }
}
