//! A model's posterior → the information of the stations alone.

use nalgebra::{DMatrix, DVector};

use super::Estimate;
use super::column::{Column, frame_motions};
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::saved::{SavedCalibration, SavedError};
use crate::fit::{FramePair, Owner, TargetId, Unknown};
use crate::kinematics::Parameter;

/// Pairs `cos, sin` of a joint's curve that are compared between sessions: those with a period of at least 90°.
const CURVE_PAIRS: usize = 4;

/// A posterior over some columns, mm and rad.
struct Posterior<'p> {
    columns: Vec<Column>,
    covariance: &'p DMatrix<f64>,
    means: Vec<f64>,
    /// Precision of each column's prior; 0 without one.
    precision: Vec<f64>,
    /// The fitted frames.
    frames: FramePair,
}

impl Estimate {
    /// The estimate from a full error model of one session; `None` when its covariance cannot be inverted. Several sources
    /// are refused; of several targets the main one is compared, for all are known by it and the arm.
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
            frames: session.main()?,
        };
        Ok(posterior.estimate())
    }

    /// The estimate from a geometric calibration of one session; `None` when its covariance cannot be inverted.
    pub fn of_geometric(saved: &SavedCalibration) -> Result<Option<Self>, SavedError> {
        let Some(session) = saved.sessions.first() else {
            return Ok(None);
        };
        let parameters = parameters(saved)?;
        // The arm's, those of the source, and of several targets those of the first.
        let kept = saved.unknowns.iter().enumerate();
        let kept: Vec<usize> = kept
            .filter(|(_, own)| own.of == 0)
            .map(|(place, _)| place)
            .collect();
        let parameters: Vec<_> = kept.iter().map(|&place| parameters[place]).collect();
        let size = parameters.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| {
            let (i, j) = (kept[i], kept[j]);
            saved.covariance[i.max(j)][i.min(j)]
        });
        let precision = |sd: &Option<f64>| sd.map_or(0.0, |sd| sd.powi(-2));
        let posterior = Posterior {
            columns: parameters
                .iter()
                .map(|(own, _)| Column::Chain(*own))
                .collect(),
            covariance: &covariance,
            means: parameters.iter().map(|(_, offset)| *offset).collect(),
            precision: kept
                .iter()
                .map(|&place| precision(&saved.prior_sd[place]))
                .collect(),
            frames: session.frames()?.main()?,
        };
        Ok(posterior.estimate())
    }
}

impl Posterior<'_> {
    /// The estimate: the posterior with the prior removed.
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

    /// Posterior mean of a column; zero for base and target, which are measured from the fitted frames.
    fn offset(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() {
            0.0
        } else {
            self.means[place]
        }
    }

    /// Prior mean of a column: minus the fitted offset for base and target, zero for the others.
    fn expected(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() {
            -self.means[place]
        } else {
            0.0
        }
    }
}

/// The unknowns of a calibration with their offsets; its frames already contain those of base and target.
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

/// Whether a column of gravity, by its place among them, is the deflection of a joint that slides, in mm.
fn is_of_a_slide(model: &FullModel, place: usize) -> bool {
    let periods = model.layout().slide_periods_mm();
    let rows = periods.iter().enumerate();
    let mut columns =
        rows.flat_map(|(joint, period)| vec![period.is_some(); periods.len() - joint]);
    columns.nth(place).unwrap_or(false)
}

/// Columns of the model that are compared between sessions, with their places; dropped parts have no scale and are left out.
fn shared_columns(model: &FullModel) -> Vec<(usize, Column)> {
    let mut shared = Vec::new();
    for (block, own) in model.layout().blocks() {
        let first = own.start;
        match block {
            Block::Unknowns => {
                let is_main = |unknown: &Unknown| match unknown.owner {
                    Owner::Arm | Owner::Source { .. } => true,
                    Owner::Target { target, .. } => target == TargetId::MAIN,
                };
                let unknowns = own.zip(model.unknowns());
                let unknowns = unknowns.filter(|(_, unknown)| is_main(unknown));
                shared.extend(unknowns.map(|(place, own)| (place, Column::Chain(own.parameter))));
            }
            Block::Gravity => {
                let turns = own.filter(|place| !is_of_a_slide(model, place - first));
                shared.extend(turns.map(|place| (place, Column::Gravity(place - first))));
            }
            // The period of a slide's curve is that of its session's range: coefficients of two sessions are of other functions.
            Block::Curve(joint) if model.layout().slide_period_mm(joint).is_none() => {
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
