//! The dwells of two logs under another arm than the stated one: which of them belong together, if that arm were right.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::average::median;
use super::decide::{by_half, decide_as_one};
use super::dwell::{ArmDwell, TargetDwell};
use super::observe::{self, Observation};
use super::pattern::Dwells;
use super::readings::Readings;
use super::{JoinError, JoinInput, JoinSettings};
use crate::kinematics::Arm;

/// The most dwells of the arm that are matched, from the middle of its log: enough for a pattern, few enough to try many arms.
const MOST: usize = 300;

/// Pairs agree when the arm explains their positions but for this share of their spread.
const AGREEING: f64 = 0.2;

/// Median distance of positions from their barycentre, mm.
fn usual_distance_mm(positions: &[Vector3<f64>]) -> f64 {
    let middle = positions.iter().sum::<Vector3<f64>>() / positions.len().max(1) as f64;
    let mut distances: Vec<f64> = positions.iter().map(|p| (p - middle).norm()).collect();
    median(&mut distances)
}

/// The places of the base, as the source sees it, that a session has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bases {
    One,
    /// Each for about half of the session.
    Two,
}

#[derive(Debug, Clone)]
pub struct Supposed {
    seen: Observation,
}

/// A dwell of the arm and the reading that would belong to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Matched {
    pub joints: Vec<f64>,
    pub measured: Vector3<f64>,
}

impl Supposed {
    /// The dwells of `input`; an error where the logs have too few.
    pub fn of(input: &JoinInput, arm: &Arm, settings: &JoinSettings) -> Result<Self, JoinError> {
        let readings = Readings::find(&*input.readings, settings)?;
        let mut seen = observe::observe(&readings, &input.joints, arm, settings)?;
        let beyond = seen.arm.len().saturating_sub(MOST);
        seen.arm.drain(..beyond / 2);
        seen.arm.truncate(MOST);
        Ok(Self { seen })
    }

    /// The pairs that agree if the flange (base frame, mm) at reported angles is `flange` and `map` makes the
    /// positions what they should be; `None` where no clock offset makes the logs agree within `gate_mm`.
    pub fn under(
        &self,
        bases: Bases,
        flange: impl Fn(&[f64]) -> Isometry3<f64>,
        map: &Matrix3<f64>,
        gate_mm: f64,
    ) -> Option<Vec<Matched>> {
        let moved = |own: &ArmDwell| ArmDwell { flange: flange(&own.joints), ..own.clone() };
        let mapped =
            |own: &TargetDwell| TargetDwell { position: map * own.position, ..own.clone() };
        let arm: Vec<ArmDwell> = self.seen.arm.iter().map(moved).collect();
        let target: Vec<TargetDwell> = self.seen.target.iter().map(mapped).collect();
        let dwells = Dwells { arm: &arm, target: &target };
        let decision = match bases {
            Bases::One => decide_as_one(dwells, gate_mm).ok(),
            Bases::Two => by_half(dwells, gate_mm),
        }?;
        // Points that hardly move agree with anything.
        let positions: Vec<Vector3<f64>> =
            decision.support.iter().map(|pair| target[pair.target].position).collect();
        if decision.median_mm > AGREEING * usual_distance_mm(&positions) {
            return None;
        }
        let matched = decision.support.iter().map(|pair| Matched {
            joints: self.seen.arm[pair.arm].joints.clone(),
            measured: self.seen.target[pair.target].position,
        });
        Some(matched.collect())
    }
}
