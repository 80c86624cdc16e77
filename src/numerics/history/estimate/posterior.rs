//! A model's posterior → the information of the stations alone.

use nalgebra::{DMatrix, DVector, Isometry3};

use super::Estimate;
use super::column::Column;
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::saved::{SavedCalibration, SavedError, SavedUnknown};
use crate::fit::{Frames, Sees, SourceId, TargetId};
use crate::kinematics::Parameter;
use crate::linalg::gram;

/// Pairs `cos, sin` of the curve of a joint that turns that are compared between sessions: those with a period of at least 90°.
const CURVE_PAIRS: usize = 4;
/// Positions at which the curve of a joint that slides is compared: multiples of this, mm. It is twice the usual short length, so that
/// the values at two positions are more than one.
const EVERY_MM: f64 = 200.0;
/// The most positions of one curve: a range beyond two hundred metres is an error in the data.
const MOST_POSITIONS: usize = 1000;

/// A posterior over some columns, mm and rad.
struct Posterior {
    columns: Vec<Column>,
    covariance: DMatrix<f64>,
    means: Vec<f64>,
    /// Precision of the columns' prior; 0 for one without.
    precision: DMatrix<f64>,
    frames: Compared,
}

/// The frames of a session that are compared with those of others. Every further source and target is integrated out.
struct Compared {
    /// The source whose frame it is: the first that reads places; `None` where each reads one length, and the base has only its own.
    source: Option<SourceId>,
    /// The base in that source's frame, mm.
    base: Option<Isometry3<f64>>,
    /// The place of the main target on the flange, mm.
    target: Isometry3<f64>,
    share: f64,
}

impl Compared {
    fn of(frames: &Frames) -> Self {
        let mut sees = frames.sees().iter();
        let source = sees.position(|own| *own == Sees::Places).map(SourceId);
        Self {
            base: source.map(|source| *frames.tracker_from_base(source).isometry()),
            source,
            target: *frames.flange_from_target(TargetId::MAIN).isometry(),
            share: 1.0,
        }
    }

    /// The frames of a fit that counts the readings of a station as independent.
    fn of_independent(frames: &Frames) -> Self {
        Self { share: share(frames), ..Self::of(frames) }
    }

    /// Whether an unknown of this parameter is compared: it is the arm's, or of the source or target (by its place `of` in the session)
    /// whose frame is.
    fn has(&self, parameter: Parameter, of: usize) -> bool {
        match parameter {
            Parameter::Link { .. } => true,
            Parameter::Base(_) => self.source == Some(SourceId(of)),
            Parameter::Target(_) => TargetId(of) == TargetId::MAIN,
            Parameter::Gauge(_) => false,
        }
    }
}

/// One position over the positions that a station's readings amount to: three numbers of each target, one of each length. Readings of one
/// station share the arm's own errors at it (its repeatability, and what geometry does not model), so in a geometric fit those of
/// several targets and instruments count as one position together.
fn share(frames: &Frames) -> f64 {
    let count = |is: fn(&Sees) -> bool| frames.sees().iter().filter(|own| is(own)).count();
    let lengths = count(|own| matches!(own, Sees::Length(_)));
    let places = count(|own| *own == Sees::Places).min(1);
    let numbers = 3 * places * frames.targets().len() + lengths;
    (3.0 / numbers as f64).min(1.0)
}

struct Values {
    columns: Vec<Column>,
    /// The values per unit of the model's columns.
    rows: DMatrix<f64>,
    precision: DMatrix<f64>,
}

impl Estimate {
    /// The estimate from a full error model of one session; `None` when its covariance cannot be inverted, or it has no session.
    ///
    /// `ranges` are the lowest and highest axis variable of each joint over the stations, rad or mm: the curve of a joint that slides is
    /// compared within them, and not at all where they are empty.
    pub fn of_full(model: &FullModel, ranges: &[[f64; 2]]) -> Option<Self> {
        let frames = model.fitted_frames();
        let frames = frames.first()?;
        // A size of readings' own noise is found where the fit knows what they share.
        let compared = match model.trained.repeatability.own {
            Some(_) => Compared::of(frames),
            None => Compared::of_independent(frames),
        };
        Posterior::of_full(model, ranges, compared).estimate()
    }

    /// The estimate from a geometric calibration of one session; `None` when its covariance cannot be inverted.
    pub fn of_geometric(saved: &SavedCalibration) -> Result<Option<Self>, SavedError> {
        let Some(session) = saved.sessions.first() else { return Ok(None) };
        let frames = Compared::of_independent(&session.frames()?);
        let unknowns = &saved.unknowns;
        let is_kept = |place: &usize| frames.has(unknowns[*place].parameter, unknowns[*place].of);
        let kept: Vec<usize> = (0..unknowns.len()).filter(is_kept).collect();
        let parameters = kept.iter().map(|&place| unknowns[place].parameter);
        let size = kept.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| {
            let (i, j) = (kept[i], kept[j]);
            saved.covariance[i.max(j)][i.min(j)]
        });
        let precision = |sd: &Option<f64>| sd.map_or(0.0, |sd| sd.powi(-2));
        let joints = saved.arm.joints();
        let slides = |joint: usize| joints.get(joint - 1).is_some_and(|own| own.slides);
        let precisions = kept.iter().map(|&place| precision(&saved.prior_sd[place])).collect();
        let posterior = Posterior {
            columns: parameters.clone().map(|own| Column::of(own, slides)).collect(),
            covariance,
            means: parameters.map(|own| saved.offset(own)).collect(),
            precision: DMatrix::from_diagonal(&DVector::from_vec(precisions)),
            frames,
        };
        Ok(posterior.estimate())
    }
}

impl Posterior {
    /// The posterior of a model's shared columns, and of the values of its slides' curves.
    fn of_full(model: &FullModel, ranges: &[[f64; 2]], frames: Compared) -> Self {
        let (places, mut columns): (Vec<usize>, Vec<Column>) =
            shared_columns(model, &frames).into_iter().unzip();
        let values = slide_curves(model, ranges);
        let size = places.len() + values.iter().map(|own| own.columns.len()).sum::<usize>();
        let mut rows = DMatrix::zeros(size, model.trained.layout.size());
        let mut precision = DMatrix::zeros(size, size);
        for (row, &place) in places.iter().enumerate() {
            rows[(row, place)] = 1.0;
            precision[(row, row)] = model.posterior.scale[place].powi(-2);
        }
        let mut first = places.len();
        for own in values {
            let count = own.columns.len();
            rows.rows_mut(first, count).copy_from(&own.rows);
            let mut block = precision.view_mut((first, first), (count, count));
            block.copy_from(&own.precision);
            columns.extend(own.columns);
            first += count;
        }
        let mut means = model.means_of_rows(&rows);
        for (mean, &place) in means.iter_mut().zip(&places) {
            *mean = model.column_mean(place);
        }
        Self {
            covariance: model.covariance_of_rows(&rows),
            columns,
            means: means.as_slice().to_vec(),
            precision,
            frames,
        }
    }

    fn estimate(&self) -> Option<Estimate> {
        let units: Vec<f64> = self.columns.iter().map(Column::unit).collect();
        let size = units.len();
        let scaled = |i: usize, j: usize| self.covariance[(i, j)] / (units[i] * units[j]);
        let mut information = DMatrix::from_fn(size, size, scaled).cholesky()?.inverse();
        let own = DVector::from_fn(size, |i, _| self.offset(i) / units[i]);
        let expected = DVector::from_fn(size, |i, _| self.expected(i) / units[i]);
        let prior = |i: usize, j: usize| self.precision[(i, j)] * units[i] * units[j];
        let prior = DMatrix::from_fn(size, size, prior);
        let moment = &information * own - &prior * expected;
        information -= prior;
        Some(Estimate {
            columns: self.columns.clone(),
            information: information * self.frames.share,
            moment: moment * self.frames.share,
            base: self.frames.base,
            target: Some(self.frames.target),
        })
    }

    fn offset(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() { 0.0 } else { self.means[place] }
    }

    /// Prior mean of a column: minus the fitted offset for base and target, zero for the others.
    fn expected(&self, place: usize) -> f64 {
        if self.columns[place].is_of_a_frame() { -self.means[place] } else { 0.0 }
    }
}

/// Whether a column of gravity, by its place among them, is the deflection of a joint that slides, in mm.
fn is_of_a_slide(model: &FullModel, place: usize) -> bool {
    let periods = &model.trained.layout.slide_periods_mm;
    let rows = periods.iter().enumerate();
    let mut columns =
        rows.flat_map(|(joint, period)| vec![period.is_some(); periods.len() - joint]);
    columns.nth(place).unwrap_or(false)
}

/// Columns of the model that are compared between sessions, with their places; dropped parts have no scale and are left out.
fn shared_columns(model: &FullModel, frames: &Compared) -> Vec<(usize, Column)> {
    let mut shared = Vec::new();
    for (block, own) in model.trained.layout.blocks() {
        let first = own.start;
        match block {
            Block::Unknowns => {
                let slides =
                    |joint: usize| model.trained.layout.slide_period_mm(joint - 1).is_some();
                let unknowns = own.zip(model.unknowns());
                let unknowns = unknowns.filter(|(_, unknown)| {
                    let own = SavedUnknown::of(unknown);
                    frames.has(own.parameter, own.of)
                });
                shared.extend(
                    unknowns.map(|(place, own)| (place, Column::of(own.parameter, slides))),
                );
            }
            Block::Gravity => {
                let column = |place| {
                    if is_of_a_slide(model, place) {
                        Column::SlideGravity(place)
                    } else {
                        Column::Gravity(place)
                    }
                };
                shared.extend(own.map(|place| (place, column(place - first))));
            }
            // The coefficients of a slide's curve are of its own session's functions: its values are compared.
            Block::Curve(joint) if model.trained.layout.slide_period_mm(joint).is_none() => {
                let coefficient =
                    |place| Column::Curve { joint: joint + 1, coefficient: place - first };
                shared.extend(own.take(2 * CURVE_PAIRS).map(|place| (place, coefficient(place))));
            }
            _ => {}
        }
    }
    shared.retain(|(place, _)| model.posterior.scale[*place] > 0.0);
    shared
}

/// The values of the curves of joints that slide at positions that their session measured; none of a curve that was dropped.
fn slide_curves(model: &FullModel, ranges: &[[f64; 2]]) -> Vec<Values> {
    let curve = |(joint, range): (usize, &[f64; 2])| {
        model.trained.layout.slide_period_mm(joint)?;
        let (places, positions): (Vec<i64>, Vec<f64>) = positions(*range).into_iter().unzip();
        let rows = model.curve_rows(joint, &positions);
        let prior = gram(&model.posterior.prior_half(&rows).as_view());
        let precision = prior.cholesky()?.inverse();
        let joint = joint + 1;
        let column = |at_mm| Column::SlideCurve { joint, at_mm };
        Some(Values { columns: places.into_iter().map(column).collect(), rows, precision })
    };
    ranges.iter().enumerate().filter_map(curve).collect()
}

/// Multiples of [`EVERY_MM`] from `low` to `high`, mm, as whole numbers and as positions; none where nothing was measured.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a float to integer cast saturates, and a slide is shorter than that"
)]
fn positions([low, high]: [f64; 2]) -> Vec<(i64, f64)> {
    std::iter::successors(Some((low / EVERY_MM).ceil()), |place| Some(place + 1.0))
        .map(|place| place * EVERY_MM)
        .take_while(|position| *position <= high)
        .take(MOST_POSITIONS)
        .map(|position| (position as i64, position))
        .collect()
}
