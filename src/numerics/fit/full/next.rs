//! The full error model of an arm identified before, for a session still to come, and its update when it is measured.
//!
//! Inputs: a trained [`FullModel`], and the relation of the new session to one of its own ([`Mounting`]). Output: a model of
//! one session of which no station is known yet.
//! 1. Columns of the arm (geometry, curves, gravity, gear lines, command–feedback weight) keep their mean and covariance, the
//!    sessions' own parts being integrated out.
//! 2. Columns of a session (base, drift, scale, differences of curves and command–feedback weight) get any session's prior.
//! 3. [`FullModel::learned`] conditions it on the session's stations with all sizes fixed. The result equals training on both
//!    sessions together, if their sizes are the same.

use nalgebra::{DMatrix, DVector, Isometry3, UnitVector3};

use super::approach::ApproachOffsets;
use super::components::Components;
use super::layout::{Block, Layout};
use super::leave_one_out::{leave_one_out, of_observations, of_readings};
use super::regression::{Posterior, Root};
use super::rows::{Around, State, stations};
use super::stored::StoredFull;
use super::whitening::summed;
use super::{FullModel, FullSettings, at_fitted_bases};
use crate::fit::frames::Frames;
use crate::fit::gauge::{Gauge, Sees};
use crate::fit::observation::Observation;
use crate::fit::problem::{KnownGauge, KnownTarget, Owner, Prior, Problem, Unknown};
use crate::geometry::{Base, Flange, Target, Tracker, Transform};
use crate::join::{SourceId, TargetId};
use crate::kinematics::Arm;
use crate::linalg::{Cholesky, gram_of_columns};

/// Rounds of rows, posterior and weights: the base's start is within a millimetre, so the second is exact to micrometres.
const ROUNDS: usize = 3;
type Columns = Vec<Column>;

#[derive(Debug, Clone, PartialEq)]
pub struct Mounting {
    pub session: usize,
    pub sources: Vec<Placed>,
    pub targets: Vec<Mounted>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Placed {
    Same,
    /// One of them was moved; this is the approximate pose of the base, mm.
    Moved(Transform<Tracker, Base>),
    Length {
        gauge: Gauge,
        known: KnownGauge,
    },
}

/// Mounting of a new session's measured target, relative to the session before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mounted {
    Same,
    /// The target of the session before, removed and mounted again in its place.
    Again {
        sd_mm: f64,
    },
    Other {
        flange_from_target: Transform<Flange, Target>,
        sd_mm: f64,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    /// A column of the past model (its index), and the variance added to it.
    Kept(usize, f64),
    /// A column with its prior only.
    Fresh,
}

/// The warm-up of a session that is still to come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WarmUp {
    /// It may begin at any temperature: the warm-up is a drift of its own.
    Unknown,
    /// It repeats what the sessions that were measured have in common.
    Repeats,
}

/// Standard deviation of the target's turn when it is mounted again, rad.
const REMOUNTED_RAD: f64 = 0.01;

impl FullModel {
    /// The model of a session of `stations` stations to be measured; `None` where rounding makes a factorisation fail.
    pub fn next(
        &self,
        arm: &Arm,
        mounting: &Mounting,
        stations: usize,
        settings: &FullSettings,
        up: Option<UnitVector3<f64>>,
    ) -> Option<Self> {
        self.coming(arm, mounting, stations, settings, up, WarmUp::Unknown)
    }

    /// [`Self::next`], with the warm-up that sessions repeat or without.
    pub(super) fn coming(
        &self,
        arm: &Arm,
        mounting: &Mounting,
        stations: usize,
        settings: &FullSettings,
        up: Option<UnitVector3<f64>>,
        warm_up: WarmUp,
    ) -> Option<Self> {
        let trained = &self.starts()[mounting.session];
        let starts = [mounting.frames(trained, |_, stated| stated, |_, stated| stated)];
        let turned = self.trained.turned;
        let problem = Problem::of_geometry(&[], arm, &starts, &mounting.prior(), turned);
        let span = stations.max(1) as f64;
        let (layout, columns) = self.next_columns(&problem, mounting, settings, warm_up);
        let variances = super::columns::unknown_variances(&problem);
        let components = Components::new(&layout, &variances, settings, span);
        let expected = components.variances().map(f64::sqrt);
        let mut fresh = self.fresh_scale(&layout, &expected);
        if warm_up == WarmUp::Repeats {
            self.widen_drift(&layout, &expected, &mut fresh);
        }
        let (posterior, mean) = self.carried(&layout, &columns, fresh)?;
        let offset = |column: &Column| match column {
            Column::Kept(past, _) => self.trained.offsets[*past],
            Column::Fresh => 0.0,
        };
        let unknowns = columns.iter().take(problem.unknowns.len());
        let offsets = DVector::from_iterator(problem.unknowns.len(), unknowns.map(offset));
        let unknown_warm_up = match warm_up {
            WarmUp::Unknown => self.trained.warm_up_variance,
            WarmUp::Repeats => 0.0,
        };
        let trained = StoredFull {
            starts: problem.starts.clone(),
            scale: posterior.scale.clone(),
            whitened: posterior.whitened.clone(),
            up: up.map(UnitVector3::into_inner),
            layout,
            rows_at: offsets.clone(),
            offsets,
            drift_variance: self.trained.drift_variance + unknown_warm_up,
            warm_up_variance: self.trained.warm_up_variance - unknown_warm_up,
            middles: vec![self.trained.middles[mounting.session]],
            scale_sd: 1e-6 * settings.session_scale_ppm,
            scale_evidence: None,
            sides: None,
            mean,
            span,
            weights: Vec::new(),
            ..self.trained.clone()
        };
        Some(Self::of(trained, problem, posterior, Vec::new()))
    }

    fn next_columns(
        &self,
        problem: &Problem<'_>,
        mounting: &Mounting,
        settings: &FullSettings,
        warm_up: WarmUp,
    ) -> (Layout, Columns) {
        let mut layout = Layout::new(self.trained.layout.period_turns);
        layout.slide_periods_mm.clone_from(&self.trained.layout.slide_periods_mm);
        let unknowns = problem.unknowns.iter();
        let mut columns: Columns = unknowns.map(|own| self.next_unknown(own, mounting)).collect();
        layout.push(Block::Unknowns, columns.len());
        let few = 2 * super::columns::few_harmonics(settings);
        for (block, range) in self.trained.layout.blocks() {
            let repeats = block == Block::WarmUp && warm_up == WarmUp::Repeats;
            if !block.is_of_arm() && !repeats {
                continue;
            }
            layout.push(block, range.len());
            columns.extend(range.clone().map(|past| Column::Kept(past, 0.0)));
            let own = match block {
                Block::Curve(joint) => {
                    Some((Block::SessionCurve { session: 0, joint }, few.min(range.len()) + 1))
                }
                Block::CommandWeight => Some((Block::SessionCommandWeight(0), range.len())),
                _ => None,
            };
            if let Some((block, count)) = own {
                layout.push(block, count);
                columns.extend(vec![Column::Fresh; count]);
            }
        }
        let joints = self.trained.repeatability.joints.len();
        let mut fresh: Vec<(Block, usize)> = self.next_drift(settings).into_iter().collect();
        if settings.session_scale_ppm > 0.0 {
            fresh.push((Block::Scale(0), 1));
        }
        // A session without commanded orientations did not determine the command–feedback weight.
        if settings.command_weight && !self.knows_approach() {
            fresh.extend([(Block::CommandWeight, joints), (Block::ApproachOffset, joints)]);
        }
        for (block, count) in fresh {
            layout.push(block, count);
            columns.extend(vec![Column::Fresh; count]);
        }
        (layout, columns)
    }

    /// Whether it was trained on commands that determine the command–feedback weight.
    pub fn knows_approach(&self) -> bool {
        self.trained.layout.columns(Block::CommandWeight).is_some()
    }

    fn next_drift(&self, settings: &FullSettings) -> Option<(Block, usize)> {
        let mut drifts = self.trained.layout.blocks().filter_map(|(block, columns)| {
            matches!(block, Block::Drift(_)).then_some(columns.len())
        });
        let count = drifts.next()?;
        settings.drift.then_some((Block::Drift(0), count))
    }

    fn next_unknown(&self, own: &Unknown, mounting: &Mounting) -> Column {
        let session = mounting.session;
        let kept = |owner, added| {
            let wanted = Unknown { owner, ..*own };
            let past = self.unknowns().iter().position(|other| *other == wanted);
            past.map_or(Column::Fresh, |column| Column::Kept(column, added))
        };
        match own.owner {
            Owner::Arm => kept(Owner::Arm, 0.0),
            Owner::Source { source, .. } => match mounting.sources[source.0] {
                Placed::Same => kept(Owner::Source { session, source }, 0.0),
                Placed::Moved(_) | Placed::Length { .. } => Column::Fresh,
            },
            Owner::Target { target, .. } => {
                let past = Owner::Target { session, target };
                match mounting.targets[target.0] {
                    Mounted::Same => kept(past, 0.0),
                    Mounted::Again { .. } if own.parameter.is_angle() => {
                        kept(past, REMOUNTED_RAD * REMOUNTED_RAD)
                    }
                    Mounted::Again { sd_mm } => kept(past, sd_mm * sd_mm),
                    Mounted::Other { .. } => Column::Fresh,
                }
            }
        }
    }

    /// Mean and covariance of the kept columns, with the prior standard deviations `scale` of the others.
    fn carried(
        &self,
        layout: &Layout,
        columns: &[Column],
        mut scale: DVector<f64>,
    ) -> Option<(Posterior, DVector<f64>)> {
        let size = layout.size();
        let kept = |column: &Column| match column {
            Column::Kept(past, _) => Some(*past),
            Column::Fresh => None,
        };
        let kept: Vec<usize> = columns.iter().filter_map(kept).collect();
        let past = self.posterior.covariance_of(&kept);
        let mut places = vec![0; self.trained.layout.size()];
        kept.iter().enumerate().for_each(|(place, &column)| places[column] = place);
        let mut mean = DVector::zeros(size);
        for (place, column) in columns.iter().enumerate() {
            if let Column::Kept(own, added) = *column {
                scale[place] = self.posterior.scale[own].hypot(added.sqrt());
                mean[place] = self.trained.mean[own];
            }
        }
        let mut whitened = DMatrix::identity(size, size);
        for (column, from) in columns.iter().enumerate() {
            let (Column::Kept(from, added), true) = (*from, scale[column] > 0.0) else { continue };
            for (row, other) in columns.iter().enumerate() {
                let (Column::Kept(other, _), true) = (*other, scale[row] > 0.0) else { continue };
                let own = if row == column { added } else { 0.0 };
                whitened[(row, column)] =
                    (past[(places[other], places[from])] + own) / (scale[row] * scale[column]);
            }
        }
        let half = Cholesky::new(whitened)?.inverse_upper();
        let posterior = Posterior {
            root: Root::Columns(Cholesky::new(gram_of_columns(&half))?),
            whitened: mean.zip_map(&scale, |m, s| if s > 0.0 { m / s } else { 0.0 }),
            log_evidence: 0.0,
            scale,
        };
        Some((posterior, mean))
    }

    /// Prior standard deviations of a session's own parts: those found over the past sessions, where there were several.
    fn fresh_scale(&self, layout: &Layout, expected: &DVector<f64>) -> DVector<f64> {
        let mut scale = expected.clone();
        for (block, columns) in layout.blocks() {
            let is_alike = |past: Block| match (block, past) {
                (Block::SessionCurve { joint, .. }, Block::SessionCurve { joint: other, .. }) => {
                    joint == other
                }
                (Block::SessionCommandWeight(_), Block::SessionCommandWeight(_))
                | (Block::Drift(_), Block::Drift(_)) => true,
                _ => false,
            };
            let past = self.trained.layout.blocks().find(|(past, _)| is_alike(*past));
            let past = past.filter(|(_, past)| past.len() == columns.len());
            // A drift that one session did not need may occur in another.
            let found = past.map(|(_, past)| self.posterior.scale.rows(past.start, past.len()));
            if let Some(found) = found.filter(|found| found.amax() > 0.0) {
                scale.rows_mut(columns.start, columns.len()).copy_from(&found);
            }
        }
        scale
    }

    /// Widens the drift of a session that is still to come by what past sessions leave open of its size. A base drifts as warm as the
    /// arm began, so each session has a size of its own, and is one observation of sizes however many stations it has: with an
    /// inverse-gamma prior of weight `ν₀` around the expected variance, the mean over S sessions is `(ν₀ expected + S found)/(ν₀ + S − 2)`.
    fn widen_drift(&self, layout: &Layout, expected: &DVector<f64>, scale: &mut DVector<f64>) {
        let sessions = self.starts().len() as f64;
        let weight = super::components::WEIGHT;
        for (block, columns) in layout.blocks() {
            if !matches!(block, Block::Drift(_)) {
                continue;
            }
            for column in columns {
                let (before, found) = (expected[column].powi(2), scale[column].powi(2));
                let sum = weight * before + sessions * found;
                scale[column] = (sum / (weight + sessions - 2.0)).sqrt();
            }
        }
    }

    /// The model once stations of its session are measured; `frames` are base and target that the nominal arm fits to
    /// them. `None` where a factorisation fails, which only rounding can cause.
    pub fn learned(&self, arm: &Arm, observations: &[Observation], frames: Frames) -> Option<Self> {
        let turned = self.trained.turned;
        let mut observations = observations.to_vec();
        if !turned {
            for observation in &mut observations {
                observation.measured = observation.measured.without_turn();
            }
        }
        let (frames, prior) = ([frames], Prior::default());
        let problem = Problem::of_geometry(&observations, arm, &frames, &prior, turned);
        let mut state = self.state(stations(&observations).len());
        for _ in 1..ROUNDS {
            let (posterior, expected, left_out) = self.round(&problem, &state)?;
            state.weights = left_out.iter().map(|l| l.weight(self.trained.tails)).collect();
            state.offsets += (posterior.mean() + expected).rows(0, state.offsets.len());
        }
        let (posterior, expected, left_out) = self.round(&problem, &state)?;
        let mean = posterior.mean() + expected;
        let approach = ApproachOffsets::of(&observations, &state.layout, &mean);
        let mean = at_fitted_bases(&problem.unknowns, &mut state.offsets, mean);
        let trained = StoredFull {
            starts: problem.starts.clone(),
            middles: state.middles,
            scale_evidence: None,
            approach: approach.or_else(|| self.trained.approach.clone()),
            layout: state.layout,
            rows_at: state.offsets.clone(),
            offsets: state.offsets,
            mean,
            scale: posterior.scale.clone(),
            whitened: posterior.whitened.clone(),
            weights: of_readings(&observations, &state.weights),
            sides: None,
            ..self.trained.clone()
        };
        let empty = Problem::of_geometry(&[], arm, &frames, &prior, turned);
        Some(Self::of(trained, empty, posterior, of_observations(&left_out)))
    }

    fn state(&self, stations: usize) -> State {
        State {
            up: self.trained.up,
            layout: self.trained.layout.clone(),
            components: Components::default(),
            repeatability: self.trained.repeatability.clone(),
            tails: self.trained.tails,
            weights: vec![1.0; stations],
            offsets: self.trained.offsets.clone(),
            span: self.trained.span,
            middles: self.trained.middles.clone(),
        }
    }

    /// The posterior at a state, the prior mean of the columns there, and the stations' leave-one-out residuals.
    fn round(
        &self,
        problem: &Problem<'_>,
        state: &State,
    ) -> Option<(Posterior, DVector<f64>, Vec<super::LeftOut>)> {
        let around = Around::new(problem, state);
        let mut expected = self.trained.mean.clone();
        let mut unknowns = expected.rows_mut(0, state.offsets.len());
        unknowns -= &state.offsets - &self.trained.offsets;
        let posterior = summed(&around, &expected).common.posterior_after(&self.posterior)?;
        let left_out = leave_one_out(&around, &expected, &posterior, posterior.inverse());
        Some((posterior, expected, left_out))
    }

    /// A draw of all coefficients from the posterior: `mean + S L⁻ᵀ z`, whose covariance is the posterior's when `z`
    /// are independent normal numbers.
    pub fn drawn(&self, z: DVector<f64>) -> DVector<f64> {
        &self.trained.mean + self.posterior.backward(z).component_mul(&self.posterior.scale)
    }

    /// Offsets of the arm's own chain and the frames of a session, at coefficients of all columns.
    pub fn geometry_of(&self, coefficients: &DVector<f64>, session: usize) -> (Vec<f64>, Frames) {
        let offsets = &self.trained.offsets + coefficients.rows(0, self.trained.offsets.len());
        (self.problem.geometry(&offsets), self.problem.frames(&offsets).swap_remove(session))
    }
}

impl Mounting {
    fn prior(&self) -> Prior {
        let expected = |target: &Mounted| match target {
            Mounted::Other { flange_from_target, sd_mm } => Some(KnownTarget {
                xyz_mm: flange_from_target.isometry().translation.vector.into(),
                sd_mm: *sd_mm,
            }),
            Mounted::Same | Mounted::Again { .. } => None,
        };
        Prior {
            geometry: None,
            targets: self.targets.iter().map(expected).collect(),
            distances: Vec::new(),
            gauges: self.sources.iter().map(Placed::known_gauge).collect(),
        }
    }

    /// The starting frames for a session's stations: those of `past` where nothing was moved, otherwise those that its
    /// `stations` determine.
    /// Panics when they are not of as many sources and targets.
    pub fn starts(&self, past: &Frames, stations: &Frames) -> Frames {
        let other = |target, stated: Transform<Flange, Target>| {
            let turn = stations.flange_from_target(target).isometry().rotation;
            Transform::claim(Isometry3::from_parts(stated.isometry().translation, turn))
        };
        self.frames(past, |source, _| *stations.tracker_from_base(source), other)
    }

    /// The frames of the new session: those of `past`, and of what was moved those that `moved` and `other` make of the stated ones.
    fn frames(
        &self,
        past: &Frames,
        moved: impl Fn(SourceId, Transform<Tracker, Base>) -> Transform<Tracker, Base>,
        other: impl Fn(TargetId, Transform<Flange, Target>) -> Transform<Flange, Target>,
    ) -> Frames {
        let sources = self.sources.iter().enumerate().map(|(place, now)| match now {
            Placed::Same => *past.tracker_from_base(SourceId(place)),
            Placed::Moved(tracker_from_base) => moved(SourceId(place), *tracker_from_base),
            Placed::Length { .. } => Transform::identity(),
        });
        let targets = self.targets.iter().enumerate().map(|(place, now)| match now {
            Mounted::Same | Mounted::Again { .. } => *past.flange_from_target(TargetId(place)),
            Mounted::Other { flange_from_target, .. } => {
                other(TargetId(place), *flange_from_target)
            }
        });
        let sees: Vec<Sees> = self.sources.iter().map(Placed::sees).collect();
        Frames::new(sources.collect(), targets.collect())
            .expect("a session has a source and a target")
            .seeing(&sees)
    }
}

impl Placed {
    const fn sees(&self) -> Sees {
        match self {
            Self::Same | Self::Moved(_) => Sees::Places,
            Self::Length { gauge, .. } => Sees::Length(*gauge),
        }
    }

    fn known_gauge(&self) -> KnownGauge {
        match self {
            Self::Same | Self::Moved(_) => KnownGauge::default(),
            Self::Length { known, .. } => *known,
        }
    }
}
