//! Starting anchors and planes of sources that read one length, with the nominal arm.
//!
//! 1. Candidates in closed form from the flange's origins `f`: for distances `d` the equation `|f − a|² = (d − o)²` is linear in the
//!    anchor `a`, the offset `o` and `o² − |a|²`; for heights `h` the equation `n·f − c = h` is linear in the plane, or its normal is the
//!    direction in which the flanges spread least. A stated place is a candidate, too.
//! 2. From each of them anchor or plane and the target's place on the flange by damped least squares with Cauchy's weights, so that
//!    wrong numbers do not pull them; the best is taken.

use std::rc::Rc;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Unit, Vector3};

use crate::figures::median;
use crate::fit::gauge::{Anchor, Gauge, Plane};
use crate::fit::loss::{Loss, Numbers};
use crate::fit::problem::{KnownGauge, KnownTarget};
use crate::join::average::SIGMA_PER_MAD;
use crate::kinematics::{Axis, GaugePart};
use crate::units::MM_PER_M;

const STEPS: usize = 60;
/// Standard deviation of a target's place on the flange that is not stated, mm: it keeps one tool orientation from running away.
const TARGET_MM: f64 = 300.0;
/// Singular values below this share of the largest say nothing.
const NOTHING: f64 = 1e-6;
/// A later candidate has to be better by this share: normals of both signs explain readings that are all the same.
const BETTER: f64 = 1e-6;
const ROUNDS: usize = 8;
/// Cauchy's tuning constant, in standard deviations.
const TUNING: f64 = 2.0;
/// Standard deviation below which the readings of a nominal arm do not scatter, mm.
const LEAST_SD_MM: f64 = 1e-3;

#[derive(Debug, Clone, Copy)]
pub(super) struct SeenAt {
    pub(super) flange: Isometry3<f64>,
    pub(super) mm: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    pub(super) gauge: KnownGauge,
    /// The target's stated place on the flange; `None` where none is stated.
    pub(super) target: Option<KnownTarget>,
}

/// The anchor that distances are read from, and the target's place on the flange, mm; `None` without a candidate.
pub(super) fn distance(seen: &[SeenAt], known: &Known) -> Option<(Gauge, Vector3<f64>)> {
    let stated = known.gauge.place.map(|place| Point3::from(place.xyz_mm));
    let linear = [None, Some(known.gauge.offset.map_or(0.0, |own| own.0))];
    let solved = linear.into_iter().filter_map(|offset| anchor(seen, offset));
    let places: Vec<Point3<f64>> = stated.into_iter().chain(solved).collect();
    let of_place = |place: Point3<f64>| {
        let left = seen.iter().map(|own| {
            let origin = Point3::from(own.flange.translation.vector);
            own.mm - (origin - place).norm()
        });
        let mean = left.sum::<f64>() / seen.len() as f64;
        Gauge::Distance(Anchor { place, offset_mm: known.gauge.offset.map_or(mean, |own| own.0) })
    };
    best(places.into_iter().map(of_place), seen, known)
}

/// The plane that heights are read above, and the target's place on the flange, mm; `None` without a candidate.
pub(super) fn height(seen: &[SeenAt], known: &Known) -> Option<(Gauge, Vector3<f64>)> {
    let origins: Vec<Vector3<f64>> = seen.iter().map(|own| own.flange.translation.vector).collect();
    let n = seen.len().max(1) as f64;
    let (middle, level) =
        (origins.iter().sum::<Vector3<f64>>() / n, seen.iter().map(|own| own.mm).sum::<f64>() / n);
    let (mut scatter, mut slope) = (Matrix3::zeros(), Vector3::zeros());
    for (origin, own) in origins.iter().zip(seen) {
        let away = origin - middle;
        scatter += away * away.transpose();
        slope += away * (own.mm - level);
    }
    let eigen = scatter.symmetric_eigen();
    let thin: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let thin = if thin[thin.iamax()] < 0.0 { -thin } else { thin };
    let risen = scatter.try_inverse().map(|inverse| inverse * slope);
    let normals = [Some(thin), Some(-thin), risen];
    let of_normal = |normal: Vector3<f64>| {
        let normal = Unit::try_new(normal, NOTHING)?;
        Some(Gauge::Height(Plane::new(normal, normal.dot(&middle) - level)))
    };
    best(normals.into_iter().flatten().filter_map(of_normal), seen, known)
}

/// The anchor by the linear equation, with its offset stated or found; mm.
fn anchor(seen: &[SeenAt], offset_mm: Option<f64>) -> Option<Point3<f64>> {
    let level = seen.iter().map(|own| own.mm).sum::<f64>() / seen.len().max(1) as f64;
    let columns = if offset_mm.is_some() { 4 } else { 5 };
    let mut rows = DMatrix::zeros(seen.len(), columns);
    let mut right = DVector::zeros(seen.len());
    for (row, own) in seen.iter().enumerate() {
        let origin = own.flange.translation.vector / MM_PER_M;
        let distance = (own.mm - offset_mm.unwrap_or(level)) / MM_PER_M;
        for axis in 0..3 {
            rows[(row, axis)] = 2.0 * origin[axis];
        }
        rows[(row, 3)] = 1.0;
        if columns == 5 {
            rows[(row, 4)] = 2.0 * distance;
        }
        right[row] = origin.norm_squared() - distance * distance;
    }
    let svd = rows.svd(true, true);
    let floor = NOTHING * svd.singular_values.max();
    let solved = svd.solve(&right, floor).ok()?;
    let place = Vector3::new(solved[0], solved[1], solved[2]) * MM_PER_M;
    place.iter().all(|own| own.is_finite()).then(|| place.into())
}

/// The best of the candidates after least squares; of equally good ones the first.
fn best(
    candidates: impl Iterator<Item = Gauge>,
    seen: &[SeenAt],
    known: &Known,
) -> Option<(Gauge, Vector3<f64>)> {
    let solved: Vec<Solving<'_>> =
        candidates.map(|candidate| Solving::new(candidate, seen, known).robust()).collect();
    let sd_mm = solved.iter().map(Solving::sd_mm).fold(f64::INFINITY, f64::min);
    let costs = solved.iter().map(|own| (own.robust_cost(sd_mm), own));
    let (_, found) =
        costs.reduce(|best, other| if other.0 < best.0 * (1.0 - BETTER) { other } else { best })?;
    Some((found.gauge, found.target))
}

#[derive(Clone)]
struct Solving<'s> {
    gauge: Gauge,
    target: Vector3<f64>,
    cost: f64,
    seen: &'s [SeenAt],
    weights: Rc<[f64]>,
    known: &'s Known,
}

impl<'s> Solving<'s> {
    fn new(gauge: Gauge, seen: &'s [SeenAt], known: &'s Known) -> Self {
        let target = known.target.map_or([0.0; 3], |own| own.xyz_mm).into();
        let mut own = Self {
            gauge,
            target,
            cost: f64::INFINITY,
            seen,
            weights: vec![1.0; seen.len()].into(),
            known,
        };
        own.cost = own.normal().2;
        own
    }

    /// The solution with Cauchy's weights, whose scale is from the median of what is left.
    fn robust(self) -> Self {
        let mut own = self.solved();
        for _ in 0..ROUNDS {
            let loss = Loss::Cauchy { tuning: TUNING };
            let left: Vec<f64> = own.left_mm().map(f64::abs).collect();
            own.weights = loss.weights(&left, Numbers::One).into();
            own.cost = own.normal().2;
            own = own.solved();
        }
        own
    }

    fn left_mm(&self) -> impl Iterator<Item = f64> {
        self.seen.iter().map(|own| {
            let place = own.flange * Point3::from(self.target);
            own.mm - self.gauge.reading_mm(&place)
        })
    }

    /// Standard deviation of what is left, by its median, mm.
    fn sd_mm(&self) -> f64 {
        let left: Vec<f64> = self.left_mm().map(f64::abs).collect();
        (median(&left).unwrap_or(0.0) * SIGMA_PER_MAD).max(LEAST_SD_MM)
    }

    /// Cauchy's cost of all readings at this scale, and that of the stated values, mm².
    fn robust_cost(&self, sd_mm: f64) -> f64 {
        let unit = TUNING * sd_mm;
        let readings = self.left_mm().map(|left| (left / unit).powi(2).ln_1p());
        let stated = self.stated().into_iter().map(|(_, away, sd)| (away / sd).powi(2));
        unit * unit * readings.sum::<f64>() + stated.sum::<f64>()
    }

    fn solved(mut self) -> Self {
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (information, gradient, _) = self.normal();
            let mut damped = information.clone();
            for place in 0..damped.nrows() {
                damped[(place, place)] += damping * information[(place, place)].max(NOTHING);
            }
            let Some(factor) = damped.cholesky() else { break };
            let other = self.stepped(&factor.solve(&gradient));
            if other.cost < self.cost {
                let settled = other.cost > self.cost * (1.0 - 1e-9);
                self = other;
                damping *= 0.1;
                if settled {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        self
    }

    fn stepped(&self, step: &DVector<f64>) -> Self {
        let of = |part: GaugePart| {
            let place = self.gauge.parts().iter().position(|own| *own == part);
            place.map_or(0.0, |place| step[3 + place])
        };
        let mut other = Self {
            gauge: self.gauge.moved(of).as_start(),
            target: self.target + Vector3::new(step[0], step[1], step[2]),
            ..self.clone()
        };
        other.cost = other.normal().2;
        other
    }

    /// Information, gradient and cost: readings count as 1 mm, stated values by their standard deviations.
    fn normal(&self) -> (DMatrix<f64>, DVector<f64>, f64) {
        let parts = self.gauge.parts();
        let size = 3 + parts.len();
        let (mut information, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut cost = 0.0;
        let mut row = DVector::zeros(size);
        for (own, weight) in self.seen.iter().zip(self.weights.iter()) {
            let place = own.flange * Point3::from(self.target);
            let along = own.flange.rotation.inverse() * self.gauge.direction(&place);
            row.rows_mut(0, 3).copy_from(&along);
            for (column, part) in parts.iter().enumerate() {
                row[3 + column] = self.gauge.by_part(*part, &place);
            }
            let left = own.mm - self.gauge.reading_mm(&place);
            information.ger(*weight, &row, &row, 1.0);
            gradient.axpy(weight * left, &row, 1.0);
            cost += weight * left * left;
        }
        for (place, away, sd) in self.stated() {
            information[(place, place)] += sd.powi(-2);
            gradient[place] += away * sd.powi(-2);
            cost += (away / sd).powi(2);
        }
        (information, gradient, cost)
    }

    /// Each stated unknown: its place in the vector, stated minus present value (mm), and the standard deviation (mm).
    fn stated(&self) -> Vec<(usize, f64, f64)> {
        let target = self.known.target;
        let sd_mm = target.map_or(TARGET_MM, |own| own.sd_mm);
        let place = Vector3::from(target.map_or([0.0; 3], |own| own.xyz_mm));
        let mut stated: Vec<_> =
            (0..3).map(|axis| (axis, place[axis] - self.target[axis], sd_mm)).collect();
        if let Gauge::Distance(anchor) = &self.gauge {
            if let Some(known) = self.known.gauge.place {
                let away = Point3::from(known.xyz_mm) - anchor.place;
                let axes = Axis::ALL.iter().enumerate();
                stated.extend(axes.map(|(at, axis)| (3 + at, axis.unit().dot(&away), known.sd_mm)));
            }
            if let Some((mm, sd_mm)) = self.known.gauge.offset {
                stated.push((6, mm - anchor.offset_mm, sd_mm));
            }
        }
        stated
    }
}
