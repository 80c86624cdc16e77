//! The truth behind a synthetic session, as JSON and as a table of stations.

use std::fmt::Write;

use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;

use super::settings::SimulateSettings;
use super::timeline::{Stop, ns};
use super::tracker::{TrueReadingCounts, View};
use super::true_arm::{ArmErrors, curve_unit};
use crate::join::{Command, Pairing, Reading, Station, Unmeasured};
use crate::kinematics::Arm;
use crate::units::{ClockModel, Controller, Stamp};

/// Error curves are tabulated at this many angles per joint, from limit to limit.
const CURVE_POINTS: u32 = 181;

#[derive(Debug, Clone, Serialize)]
pub struct Truth {
    pub model: String,
    pub settings: SimulateSettings,
    pub parameters: Vec<TrueParameter>,
    pub arm: ArmErrors,
    pub joint_errors: Vec<TrueCurve>,
    pub clock: TrueClock,
    pub stations_visited: usize,
    /// Number of these stations that the beam missed.
    pub stations_lost: usize,
    pub readings: TrueReadingCounts,
    /// Distances between attained and commanded target position in the base frame, mm.
    pub raw_error_mm: RawError,
    /// The stations; in a table of their own, not in the JSON.
    #[serde(skip)]
    pub stations: Vec<TrueStation>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueParameter {
    pub name: String,
    pub unit: &'static str,
    pub offset: f64,
}

/// One joint's error curve (without its gear line), tabulated from limit to limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueCurve {
    pub joint: String,
    pub angles_rad: Vec<f64>,
    pub errors_rad: Vec<f64>,
}

/// `tracker − t₀ = (1 + drift)(controller − t₀) + offset`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrueClock {
    pub origin_ns: i64,
    pub offset_ns: f64,
    pub drift: f64,
}

/// Distances over all stations, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct RawError {
    pub mean: f64,
    pub rms: f64,
    pub max: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct TrueStation {
    pub number: usize,
    pub start: Stamp<Controller>,
    pub end: Stamp<Controller>,
    pub measured: bool,
    /// The command: the measured target's pose in the nominal base frame, mm.
    pub command: Isometry3<f64>,
    /// Joint angles that the controller computed for the command, rad.
    pub commanded: Vec<f64>,
    /// Joint angles that the controller reported while stationary, rad.
    pub reported: Vec<f64>,
    /// Errors of the true angles on this visit beyond the arm's own errors, rad.
    pub visit: Vec<f64>,
    /// The part of `visit` that no other visit repeats, rad.
    pub repeated: Vec<f64>,
    pub base_drift_mm: Vector3<f64>,
    /// Where a point that stands still is seen by the tracker, from where it is seen at the start.
    pub tracker_moved: Isometry3<f64>,
    /// True pose of the measured target in the base frame at mid-dwell, drift of the base included, mm.
    pub base_from_target: Isometry3<f64>,
    /// True pose of the measured target in the tracker frame, without the tracker's noise, mm.
    pub tracker_from_target: Isometry3<f64>,
}

impl TrueStation {
    pub(super) fn of(number: usize, stop: &Stop, view: &View<'_>) -> Self {
        let stamp = |t_s: f64| view.clock.origin.plus_ns(ns(t_s));
        let middle_s = stop.start_s.midpoint(stop.end_s);
        let base_from_target = view.base_from_target(middle_s);
        Self {
            number,
            start: stamp(stop.start_s),
            end: stamp(stop.end_s),
            measured: !view.lost[number],
            command: stop.base_from_target,
            commanded: stop.commanded.clone(),
            reported: stop.reported.clone(),
            visit: stop.visit.clone(),
            repeated: stop.repeated.clone(),
            base_drift_mm: view.base_drift(middle_s),
            tracker_moved: view.tracker_moved(middle_s),
            tracker_from_target: view.seen(middle_s, &base_from_target),
            base_from_target,
        }
    }

    /// The station with this reading, which goes to its own command; unmeasured without one.
    pub(super) fn station(&self, joint_samples: usize, reading: Option<Reading>) -> Station {
        Station {
            number: self.number,
            start: self.start,
            end: self.end,
            joints: self.reported.clone(),
            joint_samples,
            command: Some(Command {
                position: Point3::from(self.command.translation.vector),
                orientation: Some(self.command.rotation),
            }),
            pairing: match reading {
                Some(_) => Pairing::Paired,
                None => Pairing::Unmeasured(Unmeasured::NoReadings),
            },
            readings: reading.into_iter().collect(),
        }
    }

    pub fn error_mm(&self) -> Vector3<f64> {
        self.base_from_target.translation.vector - self.command.translation.vector
    }
}

impl Truth {
    pub(super) fn of(
        arm: &Arm,
        settings: &SimulateSettings,
        errors: &ArmErrors,
        view: &View<'_>,
        readings: TrueReadingCounts,
    ) -> Self {
        let stops = &view.timeline.stops;
        let stations: Vec<TrueStation> = stops
            .iter()
            .enumerate()
            .map(|(number, stop)| TrueStation::of(number, stop, view))
            .collect();
        Self {
            model: arm.model().to_owned(),
            settings: settings.clone(),
            parameters: parameters(arm, errors),
            joint_errors: curves(arm, errors),
            clock: TrueClock {
                origin_ns: view.clock.origin.ns(),
                offset_ns: view.clock.offset_ns,
                drift: view.clock.drift,
            },
            stations_visited: stations.len(),
            stations_lost: stations.iter().filter(|station| !station.measured).count(),
            readings,
            raw_error_mm: RawError::of(&stations),
            arm: errors.clone(),
            stations,
        }
    }

    /// The relation of the clocks as a [`ClockModel`].
    pub(super) fn clock_model(&self) -> ClockModel {
        ClockModel {
            origin: Stamp::from_ns(self.clock.origin_ns),
            offset_ns: self.clock.offset_ns,
            drift: self.clock.drift,
        }
    }

    /// The truth without its stations as JSON, numbers to ten digits.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        let mut value = serde_json::to_value(self)?;
        shorten(&mut value);
        Ok(serde_json::to_string_pretty(&value)? + "\n")
    }

    /// The stations as CSV: times in ns of the controller, angles in rad, lengths in mm, quaternions x y z w.
    pub fn stations_csv(&self, joint_names: &[&str]) -> String {
        let mut csv = String::from("station,start_ns,end_ns,measured");
        for kind in ["commanded", "reported"] {
            for name in joint_names {
                push(&mut csv, format_args!(",{}", quoted(&format!("{kind}_{name}"))));
            }
        }
        for frame in ["command", "base", "tracker"] {
            for column in ["x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"] {
                push(&mut csv, format_args!(",{frame}_{column}"));
            }
        }
        csv.push_str(",error_x_mm,error_y_mm,error_z_mm\n");
        for station in &self.stations {
            station.push_row(&mut csv);
        }
        csv
    }
}

/// The text as one CSV cell, in quotes where it needs them.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

impl TrueStation {
    fn push_row(&self, csv: &mut String) {
        let (start, end) = (self.start.ns(), self.end.ns());
        push(csv, format_args!("{},{start},{end},{}", self.number, self.measured));
        for angle in self.commanded.iter().chain(&self.reported) {
            push(csv, format_args!(",{angle:.9}"));
        }
        for pose in [&self.command, &self.base_from_target, &self.tracker_from_target] {
            for x in &pose.translation.vector {
                push(csv, format_args!(",{:.6}", x + 0.0));
            }
            for q in super::tracker::logged_quaternion(&pose.rotation) {
                push(csv, format_args!(",{q:.9}"));
            }
        }
        for error in &self.error_mm() {
            push(csv, format_args!(",{error:.6}"));
        }
        csv.push('\n');
    }
}

impl RawError {
    fn of(stations: &[TrueStation]) -> Self {
        if stations.is_empty() {
            return Self::default();
        }
        let errors: Vec<f64> = stations.iter().map(|s| s.error_mm().norm()).collect();
        let n = errors.len() as f64;
        Self {
            mean: errors.iter().sum::<f64>() / n,
            rms: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            max: errors.iter().copied().fold(0.0, f64::max),
        }
    }
}

fn parameters(arm: &Arm, errors: &ArmErrors) -> Vec<TrueParameter> {
    arm.chain()
        .parameters()
        .iter()
        .zip(&errors.offsets)
        .map(|(parameter, &offset)| TrueParameter {
            name: parameter.to_string(),
            unit: parameter.unit(),
            offset,
        })
        .collect()
}

fn curves(arm: &Arm, errors: &ArmErrors) -> Vec<TrueCurve> {
    let tabulated = |joint: &crate::kinematics::Joint, curve: &super::JointCurve| {
        let width = (joint.upper - joint.lower) / f64::from(CURVE_POINTS - 1);
        let angles: Vec<f64> =
            (0..CURVE_POINTS).map(|i| joint.lower + width * f64::from(i)).collect();
        TrueCurve {
            joint: joint.name.clone(),
            errors_rad: angles
                .iter()
                .map(|&q| joint.per_radian() * curve.at(q / curve_unit(joint)))
                .collect(),
            angles_rad: angles,
        }
    };
    arm.joints().iter().zip(&errors.curves).map(|(joint, curve)| tabulated(joint, curve)).collect()
}

fn shorten(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Array(items) => items.iter_mut().for_each(shorten),
        serde_json::Value::Object(fields) => fields.values_mut().for_each(shorten),
        serde_json::Value::Number(number) if number.is_f64() => {
            *value = super::short(number.as_f64().expect("just asked")).into();
        }
        _ => {}
    }
}

fn push(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a string does not fail");
}
