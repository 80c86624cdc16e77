//! Knocks: the instrument or the base moved at one time in the middle of a session, and no reference tells it.
//!
//! Input: the stations of one session in order of time, and the arm. Output: the motions, and the readings behind each carried to where
//! the instrument stood at first; or a joint that slipped, behind which it stands beside what it reports; or a target that was moved.
//! 1. A model of the session alone is trained, of geometry, frames and slow joint curves. A slow drift of all six motions of the base is
//!    added: Legendre's polynomials over the session, of which the n-th has a variance like 1/n².
//! 2. A knock before a station is six more columns: the base's, at that station and all behind it. Each has a score test `sᵀ V⁻¹ s`,
//!    `s = Bᵀ N⁻¹ e` and `V = Bᵀ N⁻¹ B − Bᵀ N⁻¹ Φ C Φᵀ N⁻¹ B` with the model's rows Φ, their covariance C and residuals e.
//!    A slip of a joint is one more column, another place of the target on the flange three.
//! 3. The most significant one is added to the model, whose sizes are found anew. It is a knock, or the slip of the joint with more
//!    evidence, where the log evidence rises by 20 nats: a slow drift gains nothing by a step. A slip whose statistic is less than nine
//!    tenths of the knock's has 20 nats more than that. It is another place of the target where that has more evidence than the slip, and 40
//!    nats more than the knock.

use std::ops::{Range, RangeInclusive};

use nalgebra::{
    DMatrix, DMatrixView, DVector, Isometry3, Matrix6, Point3, UnitVector3, Vector3, Vector6,
};

use super::regression::few_rows::FewRows;
use super::regression::{Posterior, Sums};
use super::rows::{Around, stations};
use super::settings::FullSettings;
use super::train::{Settled, train};
use super::whitening::kept;
use crate::fit::observation::{Noise, Observation, Source, TrackerUncertainty, observations};
use crate::fit::problem::{Freedom, Owner, Problem, Unknown};
use crate::fit::{FitSettings, identify};
use crate::join::moved::Knock;
use crate::join::references::Motion;
use crate::join::{JoinError, ReadingKind, SourceId, Station, undo};
use crate::kinematics::{Arm, Joint, Motion as Axis, Parameter};
use crate::linalg::gram_of_columns;

/// Fewest measured stations on each side of a knock.
const BESIDE: usize = 20;
/// Least gain in log evidence of a knock or a slip, nats.
const GAIN: f64 = 20.0;
/// Least statistic of a motion that is tried: of sound sessions it has six degrees of freedom.
const TRIED: f64 = 30.0;
/// Share of the statistic of a motion of the base from which on a slip is one of those motions. One with less has to have 20 nats more.
const SLIP_SHARE: f64 = 0.9;
const MOST: usize = 4;
/// Columns of the target's place on the flange.
const TARGET: usize = 3;
const HARMONICS: usize = 6;
/// Polynomials of the slow drift.
const ORDERS: usize = 6;
/// Rounds in which sizes are found.
const ROUNDS: usize = 12;
/// Standard deviations of a knock: of its shift, mm, and of its turn, rad.
const KNOCK: [f64; 2] = [10.0, 5e-3];
/// Standard deviation of a slip, rad.
const SLIP: f64 = 10e-3;
/// Least slip, rad: joints creep by less.
const LEAST_SLIP: f64 = 2e-4;

/// Takes knocks out of the readings of a session: the readings behind each are carried to where the instrument stood before.
///
/// # Errors
///
/// A joint slipped, or the target was moved.
pub fn taken_out(
    stations: &mut [Station],
    arm: &Arm,
    up: Option<UnitVector3<f64>>,
) -> Result<Vec<Knock>, JoinError> {
    let mut found = Vec::new();
    while found.len() < MOST {
        let own = observed(stations, arm);
        let Some((station, step)) = Small::of(&own, arm, up).and_then(|small| small.step()) else {
            break;
        };
        let at = stations.iter().find(|own| own.number == station).map(|own| own.start);
        match step {
            Step::Base(motion) => found.extend(carried(stations, station, *motion)),
            Step::Joint(Slip { joint, by, sd }) => {
                let or =
                    if joint == 0 { ", or all behind it was turned about that axis" } else { "" };
                let joint = &arm.joints()[joint];
                return Err(JoinError::slipped(joint, (by, sd), (station, at), or));
            }
            Step::Target(by) => return Err(JoinError::remounted(by, (station, at))),
        }
    }
    Ok(found)
}

/// Carries the readings of this station and all behind it to where the instrument stood before.
fn carried(stations: &mut [Station], number: usize, motion: Motion) -> Option<Knock> {
    let first = stations.iter().position(|own| own.number == number)?;
    let (before, behind) = stations.split_at_mut(first);
    for reading in behind.iter_mut().flat_map(|own| &mut own.readings) {
        let earlier = reading.value.point().and_then(|own| own.motion_covariance);
        undo(&mut reading.value, &motion);
        let now = reading.value.point_mut().and_then(|own| own.motion_covariance.as_mut());
        for (own, earlier) in now.into_iter().flatten().zip(earlier.into_iter().flatten()) {
            *own += earlier;
        }
    }
    let measured = |own: &[Station]| own.iter().filter(|own| !own.measured().is_empty()).count();
    Some(Knock {
        station: number,
        at: behind.first()?.start,
        stations: [measured(before), measured(behind)],
        motion,
    })
}

/// The readings of places, with no noise but a little: the training finds what there is.
fn observed(stations: &[Station], arm: &Arm) -> Vec<Observation> {
    let uncertainty = TrackerUncertainty {
        range_um: 5.0,
        range_um_per_m: 0.0,
        transverse_um: 5.0,
        transverse_um_per_m: 0.0,
        divisor: 1.0,
        orientation_rad: None,
    };
    let source = Source { reads: ReadingKind::Point, uncertainty: uncertainty.into() };
    let mut own = observations(0, stations, arm, &Noise::of_one(source, 0.02));
    own.retain(|own| own.point().is_some());
    // What was carried drifts as before.
    for observation in &mut own {
        observation.follows_references = false;
    }
    own
}

/// What changed between two stations.
enum Step {
    Base(Box<Motion>),
    Joint(Slip),
    /// The target's way on the flange along its axes and the standard deviations of that, mm.
    Target([Vector3<f64>; 2]),
}

/// A joint that stands beside what it reports, by this much more than before: rad; mm where it slides.
struct Slip {
    joint: usize,
    by: f64,
    sd: f64,
}

#[derive(Clone, Copy)]
enum Columns {
    Base,
    Joint(usize),
    Target,
}

/// The model of one session, and the whitened rows of its stations.
struct Small<'a> {
    observations: &'a [Observation],
    problem: Problem<'a>,
    settled: Settled,
    base: Vec<usize>,
    /// Whether each of them turns it.
    turns: Vec<bool>,
    /// Rows of the columns of the model, then of the drift's: a row of the regression in each column, three for each observation.
    rows: DMatrix<f64>,
    /// Rows of the columns of a step: of the base, then of each joint, then of a session's only target.
    steps: DMatrix<f64>,
    /// Units of each joint's variable that count as one radian.
    units: Vec<f64>,
    values: DVector<f64>,
    /// The observations of each station.
    stations: Vec<Range<usize>>,
    sums: Sums,
}

/// Rows of the columns of a step, as [`Small`] has them; of several targets none is one.
fn rows_of_steps(kept: &FewRows, base: &[usize], target: &[usize]) -> DMatrix<f64> {
    let (rows, joints) = (&kept.transposed, &kept.columns.joints);
    let target = if target.len() == TARGET { target } else { &[] };
    let behind = base.len() + joints.len();
    let mut steps = DMatrix::zeros(behind + target.len(), rows.ncols());
    steps.rows_mut(0, base.len()).copy_from(&rows.select_rows(base));
    for (joint, own) in joints.iter().enumerate() {
        steps.row_mut(base.len() + joint).tr_copy_from(&own.motions);
    }
    steps.rows_mut(behind, target.len()).copy_from(&rows.select_rows(target));
    steps
}

/// Whitened rows, each in a column, with those of the drift's columns, at the time of its station, from −1 to 1 over the session. `base`
/// has the rows of the base's six columns.
fn with_drift(
    model: DMatrix<f64>,
    base: &DMatrixView<'_, f64>,
    stations: &[Range<usize>],
) -> DMatrix<f64> {
    let columns = model.nrows();
    let count = stations.last().map_or(0, |last| last.end) as f64;
    let mut rows = model.resize_vertically(columns + 6 * ORDERS, 0.0);
    for own in stations {
        let time = 2.0 * own.start as f64 / count - 1.0;
        let (first, size) = (3 * own.start, 3 * own.len());
        let moved = base.columns(first, size);
        for order in 1..=ORDERS {
            let share = legendre(order, time) / order as f64;
            let at = (columns + 6 * (order - 1), first);
            rows.view_mut(at, (6, size)).copy_from(&(moved * share));
        }
    }
    rows
}

/// The sizes of the model's parts, found with or without a step.
struct Sized {
    posterior: Posterior,
    /// Factor on the variance of the noise.
    noise: f64,
}

/// A step before a station, and the model with it.
type Tried = Option<((usize, Columns), Sized)>;

impl<'a> Small<'a> {
    fn of(
        observations: &'a [Observation],
        arm: &Arm,
        up: Option<UnitVector3<f64>>,
    ) -> Option<Self> {
        let stations = stations(observations);
        if stations.len() < 2 * BESIDE {
            return None;
        }
        let fit = FitSettings::default();
        let placed = identify(arm, observations, 1, Freedom::BaseAndTarget, &fit).ok()?;
        let (frames, prior) = (&placed.frames, fit.prior());
        let problem = Problem::new(observations, arm.chain(), frames, Freedom::Geometry, &prior);
        let start = DVector::zeros(problem.unknowns.len());
        let settings = FullSettings {
            harmonics: HARMONICS,
            gear_lines: false,
            command_weight: false,
            session_scale_ppm: 0.0,
            ..FullSettings::default()
        };
        let up = up.map(UnitVector3::into_inner);
        let settled = train(&problem, start, &settings, up)?;
        let unknowns = &problem.unknowns;
        let places = |is: fn(&Unknown) -> bool| -> Vec<usize> {
            (0..unknowns.len()).filter(|&place| is(&unknowns[place])).collect()
        };
        let base = places(|own| {
            matches!((own.owner, own.parameter), (Owner::Source { .. }, Parameter::Base(_)))
        });
        if base.len() != 6 {
            return None;
        }
        let target = places(|own| matches!(own.parameter, Parameter::Target(Axis::Translation(_))));
        let is_turn =
            |&own: &usize| matches!(unknowns[own].parameter, Parameter::Base(Axis::Rotation(_)));
        let turns = base.iter().map(is_turn).collect();
        let kept = kept(&Around::new(&problem, &settled.state), &settled.prior_mean);
        let steps = rows_of_steps(&kept, &base, &target);
        let values = kept.values;
        let units = arm.joints().iter().map(Joint::per_radian).collect();
        let rows = with_drift(kept.transposed, &steps.rows(0, 6).as_view(), &stations);
        let sums = Sums {
            information: gram_of_columns(&rows),
            moment: &rows * &values,
            square: values.norm_squared(),
            ln_noise: 0.0,
        };
        Some(Self {
            observations,
            problem,
            settled,
            base,
            turns,
            rows,
            steps,
            units,
            values,
            stations,
            sums,
        })
    }

    /// The number of the first station behind the step of the session, and the step; `None` where it has none.
    fn step(&self) -> Option<(usize, Step)> {
        let without = self.sized(None)?;
        let (station, statistics) = self.most_likely(&without)?;
        if statistics.max() < TRIED {
            return None;
        }
        let near =
            station.saturating_sub(2).max(BESIDE)..=(station + 2).min(self.stations.len() - BESIDE);
        let joints: Vec<Columns> = (0..self.units.len()).map(Columns::Joint).collect();
        let has_target = self.steps.nrows() > 6 + joints.len();
        let target = &[Columns::Target][..usize::from(has_target)];
        let [knock, slip, remounted] =
            [&[Columns::Base], &joints[..], target].map(|own| self.best(&near, own));
        let evidence = |own: &Tried| {
            own.as_ref().map_or(f64::NEG_INFINITY, |own| own.1.posterior.log_evidence)
        };
        // No least statistic: sizes found without a step grow with it, so that all statistics of a large one are alike.
        let is_that_motion = |own: &((usize, Columns), Sized)| match own.0.1 {
            Columns::Joint(joint) => statistics[1 + joint] >= SLIP_SHARE * statistics[0],
            Columns::Base | Columns::Target => false,
        };
        let more = if slip.as_ref().is_some_and(is_that_motion) { 0.0 } else { GAIN };
        let is_slip = evidence(&slip) > evidence(&knock) + more;
        // Where all stations have one orientation, another place of the target is a shift of the base.
        let is_target = evidence(&remounted) > evidence(&slip).max(evidence(&knock) + 2.0 * GAIN);
        let found = match (is_target, is_slip) {
            (true, _) => remounted,
            (false, true) => slip,
            (false, false) => knock,
        };
        let ((station, columns), with) = found?;
        let gain = with.posterior.log_evidence - without.posterior.log_evidence;
        let step = (gain > GAIN).then(|| self.step_at(columns, &with))??;
        Some((self.observations[self.stations[station].start].station, step))
    }

    /// The step with the most evidence of those before some stations.
    fn best(&self, near: &RangeInclusive<usize>, columns: &[Columns]) -> Tried {
        let tried = near.clone().flat_map(|station| columns.iter().map(move |own| (station, *own)));
        let sized = tried.filter_map(|step| Some((step, self.sized(Some(step))?)));
        sized.max_by(|a, b| a.1.posterior.log_evidence.total_cmp(&b.1.posterior.log_evidence))
    }

    /// The model with sizes of curves, drift and noise found by their likelihood; with a step before a station, where one is given.
    fn sized(&self, step: Option<(usize, Columns)>) -> Option<Sized> {
        let columns = self.settled.state.layout.size();
        let sums = step.map_or_else(|| self.sums.clone(), |step| self.sums_with(step));
        let mut components = self.settled.state.components.clone();
        let (mut drift, mut noise) = ([1e-4, 1e-10], 1.0);
        let mut sized = None;
        for _ in 0..ROUNDS {
            let own = components.variances();
            let variances = DVector::from_fn(sums.moment.len(), |place, _| {
                let Some(added) = place.checked_sub(columns) else { return own[place] };
                let turns = usize::from(self.turns[added % 6]);
                match step {
                    _ if added < 6 * ORDERS => drift[turns],
                    Some((_, Columns::Joint(joint))) => (SLIP * self.units[joint]).powi(2),
                    Some((_, Columns::Target)) => KNOCK[0].powi(2),
                    _ => KNOCK[turns].powi(2),
                }
            });
            let sized_sums = divided(&sums, noise, self.values.len());
            let posterior = sized_sums.posterior_at(variances.map(f64::sqrt))?;
            let squares = posterior.whitened.map(|u| u * u);
            let determined = posterior.determined(&posterior.inverse());
            let of_model = |all: &DVector<f64>| all.rows(0, columns).into_owned();
            components.update(&of_model(&squares), &of_model(&determined), &own);
            for (turns, size) in drift.iter_mut().enumerate() {
                let places =
                    (0..6 * ORDERS).filter(|own| usize::from(self.turns[own % 6]) == turns);
                let shown = places.fold((1.0, 1.0), |(squared, counted), own| {
                    (squared + squares[columns + own], counted + determined[columns + own])
                });
                *size *= (shown.0 / shown.1).clamp(0.05, 20.0);
            }
            let mean = posterior.mean();
            let left =
                sums.square - 2.0 * mean.dot(&sums.moment) + mean.dot(&(&sums.information * &mean));
            let free = self.values.len() as f64 - determined.sum();
            sized = Some(Sized { posterior, noise });
            noise = left / free.max(1.0);
        }
        sized
    }

    /// The first row of a station; the end behind the last.
    fn first_row(&self, station: usize) -> usize {
        self.stations.get(station).map_or(self.values.len(), |own| 3 * own.start)
    }

    /// The sums with the columns of a step before a station.
    fn sums_with(&self, (station, columns): (usize, Columns)) -> Sums {
        let first = self.first_row(station);
        let behind = self.values.len() - first;
        let own = match columns {
            Columns::Base => self.steps.view((0, first), (6, behind)),
            Columns::Joint(joint) => self.steps.view((6 + joint, first), (1, behind)),
            Columns::Target => self.steps.view((6 + self.units.len(), first), (TARGET, behind)),
        };
        let along = self.rows.columns(first, behind) * own.transpose();
        let (size, added) = (self.rows.nrows(), own.nrows());
        let all = size + added;
        let mut information = self.sums.information.clone().resize(all, all, 0.0);
        information.view_mut((0, size), (size, added)).copy_from(&along);
        information.view_mut((size, 0), (added, size)).copy_from(&along.transpose());
        information.view_mut((size, size), (added, added)).copy_from(&(own * own.transpose()));
        let mut moment = self.sums.moment.clone().resize_vertically(all, 0.0);
        moment.rows_mut(size, added).copy_from(&(own * self.values.rows(first, behind)));
        Sums { information, moment, ..self.sums }
    }

    /// The station before which a step has the largest statistic, and those of the base, of each joint and of the target there.
    fn most_likely(&self, without: &Sized) -> Option<(usize, DVector<f64>)> {
        let left = &self.values - self.rows.tr_mul(&without.posterior.mean());
        let steps = self.steps.nrows();
        let mut along = DMatrix::zeros(self.rows.nrows(), steps);
        let mut alone = DMatrix::zeros(steps, steps);
        let mut score = DVector::zeros(steps);
        let mut best: Option<(usize, DVector<f64>)> = None;
        let stride = (self.stations.len() / 256).max(1);
        for station in (BESIDE..self.stations.len()).rev() {
            let first = self.first_row(station);
            let count = self.first_row(station + 1) - first;
            let own = self.steps.columns(first, count);
            along += self.rows.columns(first, count) * own.transpose();
            alone += own * own.transpose();
            score += own * left.rows(first, count);
            if station + BESIDE > self.stations.len() || station % stride != 0 {
                continue;
            }
            let half = without.posterior.half(&along.transpose());
            let known = &alone - half.tr_mul(&half) / without.noise;
            let statistics = statistics(&known, &score, self.units.len()) / without.noise;
            if best.as_ref().is_none_or(|(_, most)| statistics.max() > most.max()) {
                best = Some((station, statistics));
            }
        }
        best
    }

    /// The step that the last columns of a model are.
    fn step_at(&self, columns: Columns, with: &Sized) -> Option<Step> {
        let place = self.rows.nrows();
        let mean = with.posterior.mean();
        match columns {
            Columns::Base => self.knock_at(with).map(|own| Step::Base(Box::new(own))),
            Columns::Joint(joint) => {
                let by = mean[place];
                let sd = with.posterior.covariance_of(&[place])[(0, 0)].sqrt();
                let is_slip = by.abs() > LEAST_SLIP * self.units[joint];
                is_slip.then_some(Step::Joint(Slip { joint, by, sd }))
            }
            Columns::Target => {
                let places = [place, place + 1, place + 2];
                let covariance = with.posterior.covariance_of(&places);
                let by = Vector3::from(places.map(|place| mean[place]));
                let sd = Vector3::from_fn(|axis, _| covariance[(axis, axis)].sqrt());
                Some(Step::Target([by, sd]))
            }
        }
    }

    fn knock_at(&self, with: &Sized) -> Option<Motion> {
        let places: Vec<usize> = (self.rows.nrows()..self.rows.nrows() + 6).collect();
        let change = with.posterior.mean().select_rows(&places);
        let covariance = with.posterior.covariance_of(&places);
        let offsets = &self.settled.state.offsets;
        let stands = |change: &DVector<f64>| {
            let mut offsets = offsets.clone();
            self.base.iter().zip(change).for_each(|(&column, by)| offsets[column] += by);
            *self.problem.frames(&offsets)[0].tracker_from_base(SourceId::ONLY).isometry()
        };
        let first = stands(&DVector::zeros(6));
        let moved = |change: &DVector<f64>| -> Isometry3<f64> { stands(change) * first.inverse() };
        let middle = middle(self.observations)?;
        let per_unit: [Vector6<f64>; 6] = std::array::from_fn(|axis| {
            const STEP: f64 = 1e-4;
            let by = moved(&DVector::from_fn(6, |own, _| if own == axis { STEP } else { 0.0 }));
            let (shift, turn) = (by * middle - middle, by.rotation.scaled_axis());
            Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z) / STEP
        });
        let per_unit = Matrix6::from_columns(&per_unit);
        let covariance =
            per_unit * Matrix6::from_fn(|a, b| covariance[(a, b)]) * per_unit.transpose();
        Some(Motion { moved: moved(&change), middle, covariance, part: 1 })
    }
}

/// The score statistics of the columns of the base together, of each of the joints, and of those of the target together.
fn statistics(known: &DMatrix<f64>, score: &DVector<f64>, joints: usize) -> DVector<f64> {
    let together = |first: usize, count: usize| {
        let own = score.rows(first, count);
        let known = known.view((first, first), (count, count)).clone_owned().cholesky();
        known.map_or(0.0, |known| known.solve(&own).dot(&own))
    };
    let behind = 6 + joints;
    let each = (6..behind).map(|own| together(own, 1));
    let all = std::iter::once(together(0, 6)).chain(each);
    DVector::from_vec(all.chain([together(behind, score.len() - behind)]).collect())
}

/// Sums of rows whose noise has `noise` times the variance.
fn divided(sums: &Sums, noise: f64, rows: usize) -> Sums {
    Sums {
        information: &sums.information / noise,
        moment: &sums.moment / noise,
        square: sums.square / noise,
        ln_noise: rows as f64 * noise.ln(),
    }
}

/// Legendre's polynomial of this order at `at`, from −1 to 1.
fn legendre(order: usize, at: f64) -> f64 {
    let step = |(before, now): (f64, f64), n: usize| {
        let n = n as f64;
        (now, ((2.0 * n + 1.0) * at * now - n * before) / (n + 1.0))
    };
    (1..order).fold((1.0, at), step).1
}

/// The middle of all readings, mm.
fn middle(observations: &[Observation]) -> Option<Point3<f64>> {
    let places = observations.iter().map(|own| Some(own.point()?.position.coords));
    let sum: Vector3<f64> = places.sum::<Option<_>>()?;
    Some(Point3::from(sum / observations.len() as f64))
}
