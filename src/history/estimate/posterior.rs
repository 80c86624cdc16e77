//! A model's posterior → what the stations alone say.

use nalgebra::{DMatrix, DVector};

use super::Estimate;
use super::column::{Column, frame_motions};
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::saved::{SavedCalibration, SavedError};
use crate::fit::{FramePair, Unknown};
use crate::kinematics::Parameter;

/// Pairs `cos, sin` of a joint's curve that sessions share: those of at least 90° a period.
const CURVE_PAIRS: usize = 4;

/// A posterior over some columns, mm and rad.
struct Posterior<'p> {
    columns: Vec<Column>,
    covariance: &'p DMatrix<f64>,
    means: Vec<f64>,
    /// Precision of each column's prior; 0 without one.
    precision: Vec<f64>,
    /// The frames as they were found.
    frames: FramePair,
}

impl Estimate {
    /// Of a full error model of one session; `None` where the covariance is none. Refused of several sources or targets.
    pub fn of_full(model: &FullModel) -> Result<Option<Self>, SavedError> {
        let frames = model.fitted_frames();
        let Some(session) = frames.first() else {
            return Ok(None);
        };
        let (places, columns): (Vec<usize>, Vec<Column>) =
            shared_columns(model).into_iter().unzip();
        let scale = model.prior_sd();
        let posterior = Posterior {
            columns,
            covariance: &model.covariance_of(&places),
            means: places.iter().map(|&p| model.column_mean(p)).collect(),
            precision: places.iter().map(|&p| scale[p].powi(-2)).collect(),
            frames: session.one()?,
        };
        Ok(posterior.estimate())
    }

    /// Of a geometric calibration of one session; `None` where the covariance is none.
    pub fn of_geometric(saved: &SavedCalibration) -> Result<Option<Self>, SavedError> {
        let Some(session) = saved.sessions.first() else {
            return Ok(None);
        };
        let parameters = parameters(saved)?;
        let size = parameters.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| saved.covariance[i.max(j)][i.min(j)]);
        let precision = |sd: &Option<f64>| sd.map_or(0.0, |sd| sd.powi(-2));
        let posterior = Posterior {
            columns: parameters
                .iter()
                .map(|(own, _)| Column::Chain(*own))
                .collect(),
            covariance: &covariance,
            means: parameters.iter().map(|(_, offset)| *offset).collect(),
            precision: saved.prior_sd.iter().map(precision).collect(),
            frames: session.frames()?.one()?,
        };
        Ok(posterior.estimate())
    }
}

impl Posterior<'_> {
    /// Takes the prior out.
    fn estimate(&self) -> Option<Estimate> {
        let units: Vec<f64> = self.columns.iter().map(Column::unit).collect();
        let size = units.len();
        let scaled = |i: usize, j: usize| self.covariance[(i, j)] / (units[i] * units[j]);
        let mut information = DMatrix::from_fn(size, size, scaled).cholesky()?.inverse();
        let own = DVector::from_fn(size, |i, _| self.offset(i) / units[i]);
        let mut moment = &information * own;
        for (i, unit) in units.iter().enumerate() {
            let prior = self.precision[i] * unit * unit;
            information[(i, i)] -= prior;
            moment[i] -= prior * self.expected(i) / unit;
        }
        Some(Estimate {
            columns: self.columns.clone(),
            information,
            moment,
            base: Some(*self.frames.tracker_from_base.isometry()),
            target: Some(*self.frames.flange_from_target.isometry()),
        })
    }

    /// From the frames as they were found, base and target are off by nothing.
    fn offset(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() {
            0.0
        } else {
            self.means[place]
        }
    }

    /// And their prior is off by as much as they moved; that of everything else is at zero.
    fn expected(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() {
            -self.means[place]
        } else {
            0.0
        }
    }
}

/// The unknowns of a calibration with their offsets; those of base and target are in its frames already.
fn parameters(saved: &SavedCalibration) -> Result<Vec<(Parameter, f64)>, SavedError> {
    let chain = saved.arm.chain()?.parameters();
    let offset = |parameter: Parameter| {
        let place = chain.iter().position(|own| *own == parameter);
        place
            .and_then(|place| saved.geometry.get(place))
            .copied()
            .unwrap_or(0.0)
    };
    let known: Vec<Parameter> = chain.iter().copied().chain(frame_motions()).collect();
    let parameter = |name: &String| {
        let found = known.iter().find(|own| own.to_string() == *name);
        let wrong = || SavedError::Unknown {
            what: "a parameter",
            name: name.clone(),
        };
        found.map(|own| (*own, offset(*own))).ok_or_else(wrong)
    };
    saved
        .unknowns
        .iter()
        .map(|unknown| parameter(&unknown.parameter))
        .collect()
}

/// Columns of the model that sessions share, with their places; parts that were dropped have no scale and say nothing.
fn shared_columns(model: &FullModel) -> Vec<(usize, Column)> {
    let mut shared = Vec::new();
    for (block, own) in model.layout().blocks() {
        let first = own.start;
        match block {
            Block::Unknowns => {
                let parameter = |unknown: &Unknown| Column::Chain(unknown.parameter);
                shared.extend(own.zip(model.unknowns().iter().map(parameter)));
            }
            Block::Gravity => {
                shared.extend(own.map(|place| (place, Column::Gravity(place - first))));
            }
            Block::Curve(joint) => {
                let coefficient = |place| Column::Curve {
                    joint: joint + 1,
                    coefficient: place - first,
                };
                let slow = own.take(2 * CURVE_PAIRS);
                shared.extend(slow.map(|place| (place, coefficient(place))));
            }
            _ => {}
        }
    }
    shared.retain(|(place, _)| model.prior_sd()[*place] > 0.0);
    shared
}
