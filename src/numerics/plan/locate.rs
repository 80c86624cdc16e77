//! After a remount: the few poses that find base and target of an arm that is identified already, and the accuracy that follows.
//!
//! Inputs: the full error model of a past session, the settings of a plan (cell, box, constraints), a number of poses. Output: poses
//! in an order of short travel, and what a model with base and target from them leaves over the box.
//! 1. Candidates are random poses that suit the constraints; those are taken which leave the least mean variance over the box
//!    ([`crate::fit::locate`]), all at one time: their order does not matter to the choice.
//! 2. The promise: the poses are measured first, and the poses of the box follow all through a session as long as the past one. What
//!    remains at each has a covariance: what training left open, how far sessions differ, the warm-up and drift that are still to
//!    come, settling errors that a command does not tell, and one visit's repeatability. Errors are drawn from it.

use nalgebra::{Matrix3, Point3};

use super::PlanError;
use super::compare::{Expected, candidates};
use super::order::visiting_order;
use super::place::Placer;
use super::settings::{PlanSettings, Region};
use crate::fit::SourceId;
use crate::fit::full::elsewhere::Elsewhere;
use crate::fit::full::{FullModel, Known, Query};
use crate::fit::locate::Poses;
use crate::kinematics::Arm;
use crate::report::locate::{LEAST_STATIONS, frame_columns};
use crate::report::refit::Placed;
use crate::simulate::{Commanded, Ingredient, Stream};

const BOX_POSES: usize = 300;

#[derive(Debug, Clone, Copy)]
pub struct Identified<'i> {
    pub model: &'i FullModel,
    /// The session of the model whose target the new session's is compared with.
    pub session: usize,
    /// Standard deviation of the new session's target from that one, per axis, mm; `None` where it was not taken off.
    pub target_sd_mm: Option<f64>,
}

#[derive(Debug, Clone)]
pub struct LocatePlan {
    /// The poses to measure, in an order of short travel from home.
    pub poses: Vec<Commanded>,
    pub promise: Expected,
    /// Expected errors from fewer and from more poses, by their number.
    pub others: Vec<(usize, Expected)>,
    /// Expected errors with base and target from the whole box, each pose of it measured: what only a better arm would improve.
    pub arm_alone: Expected,
}

impl LocatePlan {
    /// Whether the tolerance's share of errors is expected within the tolerance.
    pub fn is_met(&self, settings: &PlanSettings) -> bool {
        self.promise.share_mm <= settings.tolerance.mm
    }
}

/// Chooses `count` poses for an arm; `None` where a factorisation fails, which only rounding can cause.
pub fn locate(
    arm: &Arm,
    identified: &Identified<'_>,
    count: usize,
    settings: &PlanSettings,
) -> Result<Option<LocatePlan>, PlanError> {
    let placer = Placer::new(arm, settings)?;
    if settings.candidates < 2 * count {
        return Err(PlanError::FewCandidates { candidates: settings.candidates, poses: 2 * count });
    }
    let (candidates, _) = candidates(arm, &placer, settings)?;
    let (model, session) = (identified.model, identified.session);
    let Some(elsewhere) = model.elsewhere(arm, session, &settings.full, settings.up) else {
        return Ok(None);
    };
    let region = in_the_box(&placer, settings)?;
    let site = Site { arm, identified, elsewhere: &elsewhere, region, settings };
    Ok(site.planned(&candidates, count))
}

fn in_the_box(placer: &Placer<'_>, settings: &PlanSettings) -> Result<Vec<Commanded>, PlanError> {
    let mut stream = Stream::new(settings.seed, Ingredient::Region);
    let region: &Region = &settings.region;
    Ok(placer.random(region, BOX_POSES, &mut stream, &|_| Ok(()))?.0)
}

struct Site<'s> {
    arm: &'s Arm,
    identified: &'s Identified<'s>,
    elsewhere: &'s Elsewhere,
    region: Vec<Commanded>,
    settings: &'s PlanSettings,
}

impl Site<'_> {
    fn planned(&self, candidates: &[Commanded], count: usize) -> Option<LocatePlan> {
        let all = candidates.iter().chain(&self.region).map(|pose| (pose.clone(), 0));
        let all: Vec<(Commanded, usize)> = all.collect();
        let poses = self.poses(&all, candidates.len());
        let free: Vec<usize> = (0..candidates.len()).collect();
        let region: Vec<usize> = (candidates.len()..all.len()).collect();
        let chosen = |count: usize| -> Vec<Commanded> {
            let places = poses.choose(&free, &region, count).stations;
            let chosen = places.into_iter().map(|place| candidates[place].clone());
            self.ordered(&chosen.collect::<Vec<_>>())
        };
        let own = chosen(count);
        let others = [count / 2, 2 * count].into_iter().filter(|&other| other >= LEAST_STATIONS);
        let others = others.map(|other| Some((other, self.expected(&chosen(other))?)));
        Some(LocatePlan {
            promise: self.expected(&own)?,
            others: others.collect::<Option<_>>()?,
            arm_alone: self.arm_alone()?,
            poses: own,
        })
    }

    fn ordered(&self, poses: &[Commanded]) -> Vec<Commanded> {
        let settings = self.settings;
        let joints: Vec<Vec<f64>> = poses.iter().map(|pose| pose.joints.clone()).collect();
        let speed = settings.population.motion.speed_rad_s;
        let own = self.arm.joints().iter();
        let speeds: Vec<f64> = own.map(|own| speed * own.per_radian()).collect();
        let order = visiting_order(&joints, &settings.home, &speeds);
        order.into_iter().map(|place| poses[place].clone()).collect()
    }

    /// Expected errors over the box once base and target are found from these poses, the first of the session.
    fn expected(&self, poses: &[Commanded]) -> Option<Expected> {
        let used: Vec<usize> = (0..poses.len()).collect();
        let both = self.session(poses);
        let left = both.left(&both.estimator(&used)?);
        Some(self.drawn(&left[poses.len()..]))
    }

    /// Expected errors over the box with base and target from all of its poses.
    fn arm_alone(&self) -> Option<Expected> {
        let poses = self.session(&[]);
        let all: Vec<usize> = (0..poses.count()).collect();
        Some(self.drawn(&poses.left(&poses.estimator(&all)?)))
    }

    fn drawn(&self, left: &[Matrix3<f64>]) -> Expected {
        let nothing = vec![Matrix3::zeros(); left.len()];
        Expected::of(left, &nothing, self.settings)
    }

    /// Poses that find base and target at the beginning of a session, and those of the box evenly all through it.
    fn session(&self, poses: &[Commanded]) -> Poses {
        let first = poses.iter().enumerate();
        let mut all: Vec<(Commanded, usize)> = first.map(|(at, pose)| (pose.clone(), at)).collect();
        let last = self.identified.model.span_stations();
        let count = self.region.len().max(1);
        let later = self.region.iter().enumerate();
        all.extend(later.map(|(place, pose)| (pose.clone(), last * place / count)));
        self.poses(&all, poses.len())
    }

    /// Poses at their times (stations), the first `measured` of them seen by the tracker.
    fn poses(&self, all: &[(Commanded, usize)], measured: usize) -> Poses {
        let axes: Vec<Vec<f64>> = all.iter().map(|(pose, _)| self.arm.axes(&pose.joints)).collect();
        let queries: Vec<Query<'_>> =
            all.iter().zip(&axes).map(|((_, station), axes)| self.query(axes, *station)).collect();
        let model = self.identified.model;
        let to_base = model.frames[self.identified.session]
            .tracker_from_base(SourceId::ONLY)
            .isometry()
            .inverse();
        let turn = to_base.rotation.to_rotation_matrix();
        let (mut placed, mut alone) = (Vec::new(), Vec::new());
        for (place, query) in queries.iter().enumerate() {
            let predicted = model.predict(query);
            let visit = model.visit_covariance(query) + predicted.approach;
            let own = Placed {
                position: to_base * predicted.position,
                flange: to_base.rotation * predicted.flange,
            };
            let seen =
                if place < measured { self.instrument(&own.position) } else { Matrix3::zeros() };
            alone.push(turn * visit * turn.transpose() + seen);
            placed.push(own);
        }
        let scale_sd = model.trained.scale_sd;
        let (columns, precision) = frame_columns(&placed, self.identified.target_sd_mm, scale_sd);
        let half = self.elsewhere.half(&queries, self.identified.target_sd_mm.is_some());
        let poses = Poses { columns, precision, half, alone };
        poses.relative()
    }

    /// Covariance of the tracker at its new place for a position in the base frame, in the base's axes, mm².
    fn instrument(&self, position: &Point3<f64>) -> Matrix3<f64> {
        let cell = &self.settings.population.cell;
        let tracker_from_base = crate::geometry::isometry_from_rpy(
            cell.tracker_from_base_mm,
            cell.tracker_from_base_rpy,
        );
        let source = self.settings.noise.source(SourceId::ONLY);
        let covariance = source.uncertainty.covariance(&(tracker_from_base * position));
        let turn = tracker_from_base.rotation.to_rotation_matrix();
        turn.transpose() * covariance * turn
    }

    const fn query<'q>(&self, axes: &'q [f64], station: usize) -> Query<'q> {
        let session = self.identified.session;
        Query { own: false, station: Some(station), ..Query::at(axes, session, Known::Commanded) }
    }
}
