//! A small neural network: an ensemble of five, with an uncertainty calibrated by conformal prediction.
//!
//! Inputs of the network are the sine and cosine of each joint (of one that slides its variable), commanded minus reported angles, the
//! temperature where stations have one (their mean where it is not known, and whether it is), and where the angles came from. Outputs are
//! the errors along the axes of the base. Steps:
//! 1. whole blocks of the work space part the stations into three disjoint sets ([`crate::fit::holdout`]): the last blocks calibrate, one
//!    block fold stops a member, another for each, and the rest trains it (`Parts`);
//! 2. five members from first weights of their own are trained (`member`);
//! 3. the mean of the members is the error, their variance and that of their validation the variance; its factor makes 95 % of the
//!    calibration stations lie inside their ellipsoids (split conformal prediction: Lei et al., Distribution-free predictive inference for
//!    regression, 2018);
//! 4. outside the measured range of a joint or of the temperature the error fades to zero within `FADES_RAD` and `FADES_C`, and the variance
//!    to that of all errors: a network knows nothing there, and says so.
//!
//! The blocks that judge are none of these: they are held out of all stations that a rival sees.

mod member;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, Matrix3, Point3, RowDVector, Vector3};

use super::{ErrorMap, Estimate, Place, Sample};
use crate::figures::{CHI_SQUARED_3_95, extremes};
use crate::fit::holdout::{Blocks, FOLDS};
use crate::fit::model::Known;
use crate::units::SLIDE_MM_PER_RAD;
use member::{Member, Set};

/// Members of the ensemble.
const MEMBERS: usize = 5;
/// Fewest stations that calibrate: with fewer no 95 % is among them.
const LEAST_CALIBRATION: usize = 19;
/// Fewest stations that train a member.
const LEAST_TRAINING: usize = 30;
/// Distance from the measured range of a joint within which the network fades, rad; a mm of sliding counts as a mrad.
const FADES_RAD: f64 = 0.1;
/// Distance from the range of the measured temperatures within which the network fades, °C.
const FADES_C: f64 = 2.0;

/// The ensemble.
#[derive(Debug)]
pub struct Network {
    slides: Vec<bool>,
    /// The temperature that stands for one that is not known, °C; `None` where none of the stations has one, and it is no input.
    usual_c: Option<f64>,
    inputs: Scale,
    outputs: Scale,
    members: Vec<Member>,
    /// Mean square of what members leave of their validation sets, along each axis of the base, mm².
    left: Vector3<f64>,
    /// Factor on variances, measurements included.
    conformal: f64,
    /// Variance of a measured position, mm².
    measured: f64,
    /// Least and largest value of each axis variable at the stations.
    ranges: Vec<[f64; 2]>,
    /// Least and largest temperature there, °C; `None` where none is known.
    temperatures: Option<[f64; 2]>,
    /// Variance of the errors themselves, mm².
    unknown: Vector3<f64>,
}

/// Mean and standard deviation of each column.
#[derive(Debug, Clone)]
struct Scale {
    mean: RowDVector<f64>,
    sd: RowDVector<f64>,
}

/// The stations of each purpose, by their places.
struct Parts {
    calibration: Vec<usize>,
    /// Block folds that are left to train and to stop.
    folds: Vec<Vec<usize>>,
}

impl Network {
    /// The ensemble of these stations; `None` of fewer than can be parted into training, validation and calibration.
    pub fn new(samples: &[Sample<'_>], slides: &[bool]) -> Option<Self> {
        let parts = Parts::of(samples)?;
        let usual_c = usual_c(samples);
        let rows: Vec<RowDVector<f64>> =
            samples.iter().map(|own| inputs(&own.place, slides, usual_c)).collect();
        let rows = DMatrix::from_rows(&rows);
        let errors = DMatrix::from_fn(samples.len(), 3, |row, axis| samples[row].error[axis]);
        let learnt: Vec<usize> = parts.folds.concat();
        let (input_scale, output_scale) = (Scale::of(&rows, &learnt), Scale::of(&errors, &learnt));
        let (inputs, outputs) = (input_scale.scaled(&rows), output_scale.scaled(&errors));
        let (members, left) = members(&parts, &inputs, &outputs)?;
        let own = Self {
            slides: slides.to_vec(),
            usual_c,
            inputs: input_scale,
            left: Vector3::from_fn(|axis, _| left[axis] * output_scale.sd[axis].powi(2)),
            outputs: output_scale,
            members,
            conformal: 1.0,
            measured: super::mean_measured_variance(samples),
            ranges: ranges(samples, slides.len()),
            temperatures: temperatures(samples),
            unknown: unknown(samples),
        };
        let conformal = own.conformal(samples, &parts.calibration);
        Some(Self { conformal, ..own })
    }

    /// The factor with which 95 % of the stations at `places`, and of another, lie inside their ellipsoids.
    fn conformal(&self, samples: &[Sample<'_>], places: &[usize]) -> f64 {
        let distance = |place: &usize| {
            let sample = &samples[*place];
            let (error, variance) = self.ensemble(&sample.place);
            let total = variance.add_scalar(self.measured);
            let off = sample.error - error;
            off.component_mul(&off).component_div(&total).sum()
        };
        let mut distances: Vec<f64> = places.iter().map(distance).collect();
        distances.sort_by(f64::total_cmp);
        distances[rank(distances.len()) - 1] / CHI_SQUARED_3_95
    }

    /// Mean and variance of the members, with that of their validation, mm and mm².
    fn ensemble(&self, place: &Place<'_>) -> (Vector3<f64>, Vector3<f64>) {
        let inputs = inputs(place, &self.slides, self.usual_c);
        let inputs = self.inputs.scaled_row(&inputs);
        let each: Vec<Vector3<f64>> =
            self.members.iter().map(|own| self.outputs.unscaled(&own.at(&inputs))).collect();
        let count = each.len() as f64;
        let mean = each.iter().sum::<Vector3<f64>>() / count;
        let squares = each.iter().map(|own| (own - mean).component_mul(&(own - mean)));
        (mean, squares.sum::<Vector3<f64>>() / (count - 1.0) + self.left)
    }

    /// Share of the network at a place: 1 inside all measured ranges, less the further outside.
    fn share(&self, place: &Place<'_>) -> f64 {
        let each = place.axes.iter().zip(&self.ranges).zip(&self.slides);
        let turned = each.map(|((own, range), slides)| {
            let unit = if *slides { SLIDE_MM_PER_RAD } else { 1.0 };
            beyond(*own, *range) / (unit * FADES_RAD)
        });
        let warm = place.temperature_c.zip(self.temperatures);
        let warm = warm.map(|(own, range)| beyond(own, range) / FADES_C);
        (-0.5 * turned.chain(warm).map(|own| own * own).sum::<f64>()).exp()
    }
}

impl ErrorMap for Network {
    fn at(&self, place: &Place<'_>) -> Estimate {
        let (error, variance) = self.ensemble(place);
        let calibrated = variance.add_scalar(self.measured) * self.conformal;
        let inside = calibrated.map(|own| (own - self.measured).max(0.0));
        let share = self.share(place);
        Estimate {
            error: error * share,
            variance: inside * share + self.unknown.sup(&inside) * (1.0 - share),
        }
    }
}

impl Parts {
    /// Whole block folds from the last on calibrate until they are enough; the others train.
    fn of(samples: &[Sample<'_>]) -> Option<Self> {
        let positions: Vec<Point3<f64>> = samples.iter().map(|own| own.place.position).collect();
        let mut folds = vec![Vec::new(); FOLDS];
        for (place, fold) in Blocks::default().folds(&positions).into_iter().enumerate() {
            folds[fold].push(place);
        }
        folds.retain(|own| !own.is_empty());
        let mut calibration = Vec::new();
        while calibration.len() < LEAST_CALIBRATION {
            calibration.extend(folds.pop()?);
        }
        let left: usize = folds.iter().map(Vec::len).sum();
        let largest = folds.iter().map(Vec::len).max()?;
        (left >= LEAST_TRAINING + largest && folds.len() > 1).then_some(Self { calibration, folds })
    }
}

/// The members, each stopped by a fold of its own where there are enough, and what they leave of these in scaled squares.
fn members(
    parts: &Parts,
    inputs: &DMatrix<f64>,
    outputs: &DMatrix<f64>,
) -> Option<(Vec<Member>, Vector3<f64>)> {
    let (mut members, mut left) = (Vec::new(), Vec::new());
    for number in 0..MEMBERS {
        let stopping = number % parts.folds.len();
        let others = parts.folds.iter().enumerate();
        let others = others.filter(|(fold, _)| *fold != stopping);
        let training: Vec<usize> = others.flat_map(|(_, own)| own.clone()).collect();
        let validation = &parts.folds[stopping];
        let of = |places: &[usize]| (inputs.select_rows(places), outputs.select_rows(places));
        let (training, validation) = (of(&training), of(validation));
        let member = Member::train(set(&training), set(&validation), number as u64).ok()?;
        for (own, wanted) in validation.0.row_iter().zip(validation.1.row_iter()) {
            let off = member.at(&own.into_owned()) - wanted;
            left.push(Vector3::new(off[0], off[1], off[2]));
        }
        members.push(member);
    }
    let squares = left.iter().map(|own| own.component_mul(own));
    let mean = squares.sum::<Vector3<f64>>() / left.len() as f64;
    Some((members, mean))
}

fn set((inputs, outputs): &(DMatrix<f64>, DMatrix<f64>)) -> Set<'_> {
    Set { inputs, outputs }
}

/// The mean temperature of the stations where it is known, °C; `None` where none is.
fn usual_c(samples: &[Sample<'_>]) -> Option<f64> {
    let known = samples.iter().filter_map(|own| own.place.temperature_c);
    let known: Vec<f64> = known.collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}

/// The inputs of a place: sine and cosine of each joint, commanded minus reported angles in mrad, where the angles came from, and the
/// temperature where stations have one.
fn inputs(place: &Place<'_>, slides: &[bool], usual_c: Option<f64>) -> RowDVector<f64> {
    let mut row = Vec::with_capacity(3 * place.axes.len() + 4);
    for (own, slides) in place.axes.iter().zip(slides) {
        let pair = if *slides { [*own / SLIDE_MM_PER_RAD, 0.0] } else { [own.sin(), own.cos()] };
        row.extend(pair);
    }
    let sent = match place.known {
        Known::Both(error) => error.sent(),
        Known::Reported | Known::Commanded => None,
    };
    let from = [sent.is_some(), place.known == Known::Commanded];
    match sent {
        Some(sent) => row.extend(sent.iter().map(|own| own * 1e3)),
        None => row.extend(std::iter::repeat_n(0.0, place.axes.len())),
    }
    row.extend(from.map(|own| f64::from(u8::from(own))));
    if let Some(usual_c) = usual_c {
        let is_known = place.temperature_c.is_some();
        row.extend([place.temperature_c.unwrap_or(usual_c), f64::from(u8::from(is_known))]);
    }
    RowDVector::from_vec(row)
}

/// The rank of the conformal quantile among so many: the least k with `k ≥ 0.95 (n + 1)`, at most n.
fn rank(count: usize) -> usize {
    (19 * (count + 1)).div_ceil(20).min(count)
}

/// The distance of a value from a range; 0 inside.
fn beyond(own: f64, [low, high]: [f64; 2]) -> f64 {
    (low - own).max(own - high).max(0.0)
}

fn temperatures(samples: &[Sample<'_>]) -> Option<[f64; 2]> {
    let known = samples.iter().filter_map(|own| own.place.temperature_c);
    extremes(known).map(|(low, high)| [low, high])
}

fn ranges(samples: &[Sample<'_>], axes: usize) -> Vec<[f64; 2]> {
    let range = |axis: usize| {
        let own = samples.iter().map(|own| own.place.axes[axis]);
        [own.clone().fold(f64::INFINITY, f64::min), own.fold(f64::NEG_INFINITY, f64::max)]
    };
    (0..axes).map(range).collect()
}

/// Mean squares of the errors themselves, widened so that 95 % of them lie inside their ellipsoids, mm².
fn unknown(samples: &[Sample<'_>]) -> Vector3<f64> {
    let squares = samples.iter().map(|own| own.error.component_mul(&own.error));
    let mean = squares.sum::<Vector3<f64>>() / samples.len() as f64;
    let inverse = Matrix3::from_diagonal(&mean.map(|own| own.max(f64::MIN_POSITIVE).recip()));
    let distance = |own: &Sample<'_>| own.error.dot(&(inverse * own.error));
    let mut distances: Vec<f64> = samples.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    mean * (distances[rank(distances.len()) - 1] / CHI_SQUARED_3_95).max(1.0)
}

impl Scale {
    /// Mean and standard deviation of each column over the rows at `places`; 1 of a column that does not vary.
    fn of(rows: &DMatrix<f64>, places: &[usize]) -> Self {
        let rows = rows.select_rows(places);
        let sd = rows.row_variance().map(|own| if own > 1e-18 { own.sqrt() } else { 1.0 });
        Self { mean: rows.row_mean(), sd }
    }

    fn scaled(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let rows: Vec<RowDVector<f64>> =
            rows.row_iter().map(|own| self.scaled_row(&own.into_owned())).collect();
        DMatrix::from_rows(&rows)
    }

    fn scaled_row(&self, row: &RowDVector<f64>) -> RowDVector<f64> {
        (row - &self.mean).component_div(&self.sd)
    }

    fn unscaled(&self, row: &RowDVector<f64>) -> Vector3<f64> {
        let own = row.component_mul(&self.sd) + &self.mean;
        Vector3::new(own[0], own[1], own[2])
    }
}
