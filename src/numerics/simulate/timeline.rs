//! The arm's motion over time: minimum-jerk moves between stops, and the errors that differ from visit to visit.

use nalgebra::Isometry3;

use super::poses::Commanded;
use super::random::{Ingredient, Stream};
use super::settings::SimulateSettings;
use super::true_arm::ArmErrors;
use super::{ANGLE_RESOLUTION, rounded};
use crate::kinematics::{Arm, Joint};
use crate::units::{NS_PER_S, round_ns};

/// A joint that moves less than this keeps the side of its backlash, rad.
const LEAST_MOVE_RAD: f64 = 1e-6;
/// Times are whole multiples of this, s.
const TICK_S: f64 = 1e-3;

/// One dwell, and the move that leads to it.
#[derive(Debug, Clone)]
pub(super) struct Stop {
    /// The command: the measured target's pose in the base frame of the nominal arm, mm.
    pub(super) base_from_target: Isometry3<f64>,
    /// The joint angles that the controller computed for it, rad.
    pub(super) commanded: Vec<f64>,
    /// The joint angles that the controller reports while stationary, rad.
    pub(super) reported: Vec<f64>,
    /// Errors of the joint angles on this visit beyond the arm's own errors, rad.
    pub(super) visit: Vec<f64>,
    /// The part of `visit` that no other visit repeats, rad.
    pub(super) repeated: Vec<f64>,
    pub(super) departs_s: f64,
    pub(super) start_s: f64,
    pub(super) end_s: f64,
}

/// Reported angles at one moment, and the errors of the true ones beyond the arm's own errors, rad.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) reported: Vec<f64>,
    pub(super) visit: Vec<f64>,
}

/// All stops of a session in time order, from a start at home.
#[derive(Debug, Clone)]
pub(super) struct Timeline {
    home: Vec<f64>,
    pub(super) stops: Vec<Stop>,
}

impl Timeline {
    pub(super) fn plan(
        arm: &Arm,
        settings: &SimulateSettings,
        errors: &ArmErrors,
        commanded: &[Commanded],
    ) -> Self {
        let mut visits = Visits::new(settings, arm);
        let mut pauses = Stream::new(settings.seed, Ingredient::Pauses);
        let motion = &settings.motion;
        let mut stops: Vec<Stop> = Vec::with_capacity(commanded.len());
        for command in commanded {
            let (from, departs_s) = match stops.last() {
                Some(stop) => (&stop.reported, stop.end_s),
                None => (&settings.home, 0.0),
            };
            let Visit { reported, off, repeated } = visits.next(from, &command.joints, errors);
            let turn = largest_turn(arm, from, &reported);
            let start_s = departs_s + ticks(motion.move_s + turn / motion.speed_rad_s);
            let pause = motion.dwell_s + pauses.between(0.0, motion.dwell_spread_s);
            stops.push(Stop {
                base_from_target: command.base_from_target,
                commanded: command.joints.clone(),
                reported,
                visit: off,
                repeated,
                departs_s,
                start_s,
                end_s: start_s + ticks(pause),
            });
        }
        Self { home: settings.home.clone(), stops }
    }

    pub(super) fn end_s(&self) -> f64 {
        self.stops.last().map_or(0.0, |stop| stop.end_s)
    }

    /// The number of the stop that the arm moves to or dwells at.
    pub(super) fn stop_at(&self, t_s: f64) -> Option<usize> {
        let next = self.stops.partition_point(|stop| stop.end_s < t_s);
        let last = self.stops.len().checked_sub(1)?;
        Some(next.min(last))
    }

    /// The arm's state at a moment: stationary, or on a minimum-jerk move.
    pub(super) fn state(&self, t_s: f64) -> State {
        let Some(number) = self.stop_at(t_s) else {
            return State { reported: self.home.clone(), visit: vec![0.0; self.home.len()] };
        };
        let stop = &self.stops[number];
        let way = minimum_jerk((t_s - stop.departs_s) / (stop.start_s - stop.departs_s));
        let between = |from: &[f64], to: &[f64]| -> Vec<f64> {
            from.iter().zip(to).map(|(a, b)| a + way * (b - a)).collect()
        };
        match number.checked_sub(1).map(|before| &self.stops[before]) {
            // While the arm is stationary, the reported angles are the very same numbers, not a mean that rounds to them.
            _ if way >= 1.0 => State { reported: stop.reported.clone(), visit: stop.visit.clone() },
            Some(before) => State {
                reported: between(&before.reported, &stop.reported),
                visit: between(&before.visit, &stop.visit),
            },
            None => {
                State { reported: between(&self.home, &stop.reported), visit: stop.visit.clone() }
            }
        }
    }
}

struct Visit {
    reported: Vec<f64>,
    /// Errors of the true angles beyond the arm's own errors, rad.
    off: Vec<f64>,
    /// The part of `off` that no other visit repeats, rad.
    repeated: Vec<f64>,
}

/// The errors that differ from visit to visit: settling error, side of the backlash, repeatability.
struct Visits<'a> {
    settings: &'a SimulateSettings,
    stops_short: Stream,
    repeatability: Stream,
    /// Direction of each joint's last move.
    direction: Vec<f64>,
    /// Units of each joint's variable that count as one radian.
    per_radian: Vec<f64>,
}

impl<'a> Visits<'a> {
    fn new(settings: &'a SimulateSettings, arm: &Arm) -> Self {
        Self {
            settings,
            stops_short: Stream::new(settings.seed, Ingredient::StopsShort),
            repeatability: Stream::new(settings.seed, Ingredient::Repeatability),
            direction: vec![0.0; arm.joints().len()],
            per_radian: arm.joints().iter().map(Joint::per_radian).collect(),
        }
    }

    fn next(&mut self, from: &[f64], commanded: &[f64], errors: &ArmErrors) -> Visit {
        let settings = &self.settings.joints;
        let repeated = self
            .repeatability
            .normals(commanded.len(), 1.0)
            .into_iter()
            .enumerate()
            .map(|(joint, own)| {
                let expected = settings.repeatability_rad * self.per_radian[joint];
                own * errors.repeatability_rad(joint, expected)
            })
            .collect::<Vec<_>>();
        let mut reported = Vec::with_capacity(commanded.len());
        let mut off = Vec::with_capacity(commanded.len());
        for (joint, &command) in commanded.iter().enumerate() {
            let moved = command - from[joint];
            let per_radian = self.per_radian[joint];
            if moved.abs() > LEAST_MOVE_RAD * per_radian {
                self.direction[joint] = moved.signum();
            }
            let short = settings.stops_short_rad * self.stops_short.between(0.5, 1.5) * per_radian;
            let reported_at = command - self.direction[joint] * short;
            let reports = rounded(reported_at, ANGLE_RESOLUTION * per_radian);
            let nearer = settings.nearer_command;
            let beside =
                errors.true_minus_reported(joint, command - reports, self.direction[joint], nearer);
            reported.push(reports);
            off.push(beside + repeated[joint]);
        }
        Visit { reported, off, repeated }
    }
}

pub(super) fn ns(t_s: f64) -> i64 {
    round_ns(t_s * NS_PER_S)
}

fn ticks(t_s: f64) -> f64 {
    (t_s / TICK_S).round().max(1.0) * TICK_S
}

/// The largest move of a joint, rad; 1000 mm of one that slides count as a rad.
fn largest_turn(arm: &Arm, from: &[f64], to: &[f64]) -> f64 {
    from.iter()
        .zip(to)
        .zip(arm.joints().iter().map(Joint::counted))
        .map(|((a, b), counted)| (a - b).abs() * counted)
        .fold(0.0, f64::max)
}

/// Share of the way at share `t` of the time, with velocity and acceleration zero at both ends (Flash and Hogan 1985).
fn minimum_jerk(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_jerk_starts_and_ends_with_zero_speed() {
        assert!(minimum_jerk(0.0).abs() < f64::EPSILON);
        assert!((minimum_jerk(0.5) - 0.5).abs() < 1e-15);
        assert!((minimum_jerk(1.0) - 1.0).abs() < 1e-15);
        // Cubic at the ends: in a thousandth of the time the arm moves about 1e-8 of the way.
        assert!(minimum_jerk(1e-3) < 1.1e-8);
    }
}
