//! Rivals: the models that papers use for the errors that another model leaves, to be compared with the full error model.
//!
//! Inputs are the model underneath (the identified geometry in a run) and its stations; output is a [`PoseModel`] that adds to the
//! model underneath an error predicted from the stations' own ([`ErrorMap`]). A rival is compared: it is not saved
//! ([`super::registry::Made::Rival`]), and node values are of one only where it wins and is asked for ([`crate::report::rivals`]).
//! - [`kriging`]: a Gaussian process with one kernel of all joints;
//! - [`idw`]: inverse distance weights of the nearest stations, in space or in joint space;
//! - `network`, with the feature `learned`: an ensemble of small neural networks.

pub mod idw;
pub mod kriging;
#[cfg(feature = "learned")]
pub mod network;

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3, Vector3};

use super::frames::Frames;
use super::gap::Gap;
use super::model::{At, Known, Open, PoseModel, Prediction, Query, Spread};
use super::observation::Observation;
use crate::join::SourceId;
use crate::kinematics::Arm;

/// A place at which an error is predicted.
#[derive(Debug, Clone, Copy)]
pub struct Place<'p> {
    /// Axis variables, rad; mm where a joint slides.
    pub axes: &'p [f64],
    /// Their origin.
    pub known: Known<'p>,
    /// Temperature, °C; `None` where it is not known.
    pub temperature_c: Option<f64>,
    /// Position by the model underneath, base frame, mm.
    pub position: Point3<f64>,
}

/// A predicted error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Attained position minus that of the model underneath, along the axes of the base, mm.
    pub error: Vector3<f64>,
    /// Variance of what then remains along each axis of the base, without that of a measurement, mm².
    pub variance: Vector3<f64>,
}

/// A prediction of errors from places.
pub trait ErrorMap: Debug + Send + Sync {
    /// The error at a place.
    fn at(&self, place: &Place<'_>) -> Estimate;
}

/// A station with the error that the model underneath leaves there.
#[derive(Debug, Clone)]
pub struct Sample<'s> {
    /// The station's place.
    pub place: Place<'s>,
    /// Measured minus predicted position, along the axes of the base, mm.
    pub error: Vector3<f64>,
    /// Variance of the measured position, mean of the three axes, mm².
    pub measured_variance: f64,
}

/// A model that adds the errors of a map to a model underneath.
#[derive(Debug)]
pub struct Rival {
    under: Arc<dyn PoseModel>,
    map: Box<dyn ErrorMap>,
}

impl Rival {
    /// The sum of `under` and a map of the errors that it leaves.
    pub fn new(under: Arc<dyn PoseModel>, map: impl ErrorMap + 'static) -> Self {
        Self { under, map: Box::new(map) }
    }
}

/// The measured positions with the errors that `under` leaves; lengths have none.
pub fn samples<'s>(under: &dyn PoseModel, observations: &'s [Observation]) -> Vec<Sample<'s>> {
    let sample = |own: &'s Observation| {
        let query = Query::of(own);
        let predicted = under.position(&At::Joints(query)).ok()?;
        let base = tracker_from_base(under, &query);
        Some(Sample {
            place: Place::of(&query, &base, &predicted),
            error: base.inverse_transform_vector(&(own.point()?.position - predicted)),
            measured_variance: own.measured.variance_mm2(),
        })
    };
    observations.iter().filter_map(sample).collect()
}

/// At most `most` of `all`, evenly spread.
fn spread_evenly<T: Clone>(all: &[T], most: usize) -> Vec<T> {
    let count = all.len().min(most);
    (0..count).map(|place| all[place * all.len() / count].clone()).collect()
}

/// Mean variance of the measured positions, mm².
fn mean_measured_variance(samples: &[Sample<'_>]) -> f64 {
    let sum: f64 = samples.iter().map(|own| own.measured_variance).sum();
    sum / samples.len().max(1) as f64
}

fn tracker_from_base(under: &dyn PoseModel, query: &Query<'_>) -> Isometry3<f64> {
    let frames = &under.frames()[query.session];
    *frames.tracker_from_base(query.source).isometry()
}

/// Whether each axis variable slides, in the arm's order.
pub fn slides(arm: &Arm) -> Vec<bool> {
    arm.joints().iter().map(|joint| joint.slides).collect()
}

impl<'p> Place<'p> {
    fn of(query: &Query<'p>, tracker_from_base: &Isometry3<f64>, predicted: &Point3<f64>) -> Self {
        Self {
            axes: query.axes,
            known: query.known,
            temperature_c: query.temperature_c,
            position: tracker_from_base.inverse_transform_point(predicted),
        }
    }
}

impl PoseModel for Rival {
    fn frames(&self) -> &[Frames] {
        self.under.frames()
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        let query = at.joints()?;
        let under = self.under.predict(at)?;
        let base = tracker_from_base(&*self.under, query);
        let estimate = self.map.at(&Place::of(query, &base, &under.position));
        let turn = base.rotation.to_rotation_matrix();
        let alone = turn * Matrix3::from_diagonal(&estimate.variance) * turn.transpose();
        Ok(Prediction {
            position: under.position + base * estimate.error,
            open: Some(Open { rows: DMatrix::zeros(3, 0), alone }),
            ..under
        })
    }

    fn spread(&self, _: usize, _: SourceId, prediction: &Prediction) -> Spread {
        let open = prediction.open.as_ref();
        Spread::Of(open.map_or_else(Matrix3::zeros, |open| open.alone))
    }

    fn saved(&self, _: &Arm, _: &[&str]) -> Option<Result<String, serde_json::Error>> {
        None
    }
}

#[cfg(test)]
mod test {
    use super::*;

    pub(super) fn place(axes: &[f64], position: [f64; 3]) -> Place<'_> {
        Place { axes, known: Known::Reported, temperature_c: None, position: position.into() }
    }

    /// A station with this error along each axis, mm, measured to 0.1 mm.
    pub(super) fn sample(axes: &[f64], position: [f64; 3], error_mm: f64) -> Sample<'_> {
        sample_at(axes, position, Vector3::repeat(error_mm), 0.01)
    }

    /// A station with this error, mm, and this variance of its measurement, mm².
    pub(super) fn sample_at(
        axes: &[f64],
        position: [f64; 3],
        error: Vector3<f64>,
        measured_variance: f64,
    ) -> Sample<'_> {
        Sample { place: place(axes, position), error, measured_variance }
    }
}
