//! Whether sessions that were pooled, or that judge, are of one arm.
//!
//! Inputs: the full error model of a pool, the base + target fit and the observations of the same pool. Output: per session,
//! the residual of the shared arm beside that of the nominal arm, and a verdict.
//!
//! 1. Shared arm: prediction without the session's own changes, its base aligned anew with each source; median distance left.
//! 2. Nominal arm: base and target fitted; the median residual.
//! 3. Residual allowed for one arm: the instrument's noise, and a change of every joint [`CHANGES`] times as large as expected
//!    between sessions. The model's own noise is not used: in a pool of two arms it has grown to hide them.
//!
//! Why a half: two arms of one make have the nominal arm in common and nothing else. Their errors `e`, `e'` are unrelated
//! and of one size, the shared arm's are at best their mean, and its residual is `|e − e'|/2`, on average 1/√2 of the nominal
//! arm's, and more where the pool has more sessions of the other arm. One arm has its changes as residual: tenths of a
//! milliradian at the very most, where its errors are milliradians. Half the variance of the former is [`LIMIT`] squared.
//!
//! A session that only judges gets the same check ([`unseen`]); it is only named, because the model was not trained on it.

use nalgebra::{Point3, Vector3};
use thiserror::Error;

use super::Calibration;
use super::full::layout::Block;
use super::full::{FullModel, Query};
use super::observation::Observation;
use crate::figures::median;
use crate::geometry::align;
use crate::join::SourceId;
use crate::kinematics::Arm;

/// A shared arm whose residual is more than this share of the nominal arm's is not the session's arm.
pub const LIMIT: f64 = 0.5;
/// One arm changes between sessions by less than this many times the expected change, in every joint at once.
pub const CHANGES: f64 = 2.0;

/// The fit of a pool's shared arm to one of its sessions; median residuals, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedFit {
    /// The session's place in the pool, from 0.
    pub session: usize,
    pub shared_mm: f64,
    pub nominal_mm: f64,
    pub allowed_mm: f64,
}

#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "session {session} does not fit the arm that it is pooled with: the shared arm leaves {shared_mm:.3} mm at its stations \
     where the nominal arm leaves {nominal_mm:.3} mm; one arm would leave {allowed_mm:.3} mm by noise and changes, or at most \
     half of what the nominal one does; sessions of different arms cannot be pooled: name those of one arm only, and say [[fit.full.repaired]] where \
     a joint of this one was repaired"
)]
pub struct NotOneArm {
    pub session: String,
    pub shared_mm: f64,
    pub nominal_mm: f64,
    pub allowed_mm: f64,
}

impl SharedFit {
    pub fn is_same_arm(&self) -> bool {
        self.shared_mm <= self.allowed_mm || self.ratio() <= LIMIT
    }

    /// Residual of the shared arm over that of the nominal arm.
    pub fn ratio(&self) -> f64 {
        self.shared_mm / self.nominal_mm.max(f64::MIN_POSITIVE)
    }
}

/// Refuses a pool of `names` sessions with one that does not share the arm of the others.
///
/// A single session always fits. `change_rad` is the expected change of a joint between sessions.
pub fn check(
    arm: &Arm,
    full: &FullModel,
    nominal: &Calibration,
    observations: &[Observation],
    names: &[&str],
    change_rad: f64,
) -> Result<(), NotOneArm> {
    let fits = fits(arm, full, nominal, observations, change_rad);
    let foreign = fits.iter().filter(|fit| !fit.is_same_arm());
    match foreign.max_by(|a, b| a.ratio().total_cmp(&b.ratio())) {
        None => Ok(()),
        Some(fit) => Err(NotOneArm {
            session: names[fit.session].to_owned(),
            shared_mm: fit.shared_mm,
            nominal_mm: fit.nominal_mm,
            allowed_mm: fit.allowed_mm,
        }),
    }
}

/// The fit of the shared arm to every session of a pool; empty for a single session.
pub fn fits(
    arm: &Arm,
    full: &FullModel,
    nominal: &Calibration,
    observations: &[Observation],
    change_rad: f64,
) -> Vec<SharedFit> {
    let sessions = full.starts().len();
    let fit = |session: usize| {
        let weighted = observations.iter().zip(&full.trained.weights);
        let (own, weights): (Vec<&Observation>, Vec<f64>) =
            weighted.filter(|(o, _)| o.session == session).unzip();
        let stations = own.iter().map(|o| Shared::of(full, o, change_rad));
        let stations: Vec<Shared> = stations.collect::<Option<_>>()?;
        let allowed: Vec<f64> = stations.iter().map(|s| s.allowed_mm).collect();
        let frames = &nominal.frames[session];
        let left_by_nominal = |o: &&Observation| {
            let own = frames.pair(o.source, o.target);
            let target = arm.chain().nominal(&o.axes) * own.flange_from_target.origin().point();
            Some((o.point()?.position - own.tracker_from_base.isometry() * target).norm())
        };
        let nominal: Option<Vec<f64>> = own.iter().map(left_by_nominal).collect();
        let sources = (0..frames.sources().len()).map(SourceId);
        let shared = sources.map(|source| {
            let own = stations.iter().zip(&weights).filter(|(station, _)| station.source == source);
            let (own, weights): (Vec<&Shared>, Vec<f64>) = own.unzip();
            aligned_distances(&own, &weights)
        });
        let shared: Option<Vec<Vec<f64>>> = shared.collect();
        Some(SharedFit {
            session,
            shared_mm: median(&shared?.concat())?,
            nominal_mm: median(&nominal?)?,
            allowed_mm: median(&allowed)?,
        })
    };
    (0..sessions).filter(|_| sessions > 1).filter_map(fit).collect()
}

/// The fit of the arm identified from other sessions to one that took no part, its base found anew: its median residual and
/// the nominal arm's, mm. The session's own changes are not known: each joint's change moves the target, which is at
/// `target_mm` along the flange's axes, by its twist. `None` without stations.
pub fn unseen(
    arm: &Arm,
    observations: &[Observation],
    target_mm: &Vector3<f64>,
    left_mm: &LeftBy,
    change_rad: f64,
) -> Option<SharedFit> {
    let nominal = arm.no_offsets();
    let allowed = |o: &Observation| {
        let differential = arm.chain().differential(&o.axes, &nominal);
        let lever = differential.end.rotation * target_mm;
        let moved = differential.joints.iter();
        let moved = moved.map(|twist| (twist.linear + twist.angular.cross(&lever)).norm_squared());
        let change = (CHANGES * change_rad).powi(2) * moved.sum::<f64>();
        Some((o.point()?.instrument.trace() + change).sqrt())
    };
    let allowed: Vec<f64> = observations.iter().map(allowed).collect::<Option<_>>()?;
    Some(SharedFit {
        session: 0,
        shared_mm: left_mm.identified,
        nominal_mm: left_mm.nominal,
        allowed_mm: median(&allowed)?,
    })
}

/// Median residuals at the stations of a session, base refitted on all of them, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftBy {
    pub identified: f64,
    pub nominal: f64,
}

impl LeftBy {
    pub fn improves(&self) -> bool {
        self.identified <= LIMIT * self.nominal
    }
}

/// One station as predicted by the shared arm.
struct Shared {
    source: SourceId,
    measured: Point3<f64>,
    predicted: Point3<f64>,
    allowed_mm: f64,
}

impl Shared {
    /// `None` of an observation without a position.
    fn of(full: &FullModel, o: &Observation, change_rad: f64) -> Option<Self> {
        let point = o.point()?;
        let predicted = full.predict(&Query::of(o));
        let mut position = predicted.position;
        let mut changed = 0.0;
        for (block, columns) in full.trained.layout.blocks() {
            match block {
                Block::SessionCurve { session, .. } if session == o.session => {
                    // The first column is the joint's constant: the target's motion per radian of the joint.
                    changed += predicted.rows.column(columns.start).norm_squared();
                }
                Block::SessionCommandWeight(session) if session == o.session => {}
                _ => continue,
            }
            for column in columns {
                let moved = predicted.rows.column(column) * full.column_mean(column);
                position -= Vector3::new(moved[0], moved[1], moved[2]);
            }
        }
        let change = (CHANGES * change_rad).powi(2) * changed;
        Some(Self {
            source: o.source,
            measured: point.position,
            predicted: position,
            allowed_mm: (point.instrument.trace() + change).sqrt(),
        })
    }
}

/// Residual distances after aligning one source's measured positions with predicted ones, mm; `None` where they are too few.
fn aligned_distances(stations: &[&Shared], weights: &[f64]) -> Option<Vec<f64>> {
    let measured: Vec<Point3<f64>> = stations.iter().map(|s| s.measured).collect();
    let predicted: Vec<Point3<f64>> = stations.iter().map(|s| s.predicted).collect();
    let base = align(&predicted, &measured, weights)?;
    Some(measured.iter().zip(&predicted).map(|(m, p)| (base * m - p).norm()).collect())
}
