//! Training: rounds of linear regression, in which sizes, noise, weights and gear lines settle.
//!
//! Each round: rows at the current geometry; whitened by the current noise and weights; one Gram matrix; a few steps of
//! the variance components on it; leave-one-out residuals; from them the noise, the weights and new gear lines.

use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use super::components::{Components, Part};
use super::design::{PoseView, gravity_columns};
use super::layout::{Block, Layout};
use super::lines::{self, FoundLine};
use super::noise::{NoiseEvidence, Repeatability};
use super::regression::{Posterior, Sums};
use super::settings::FullSettings;
use crate::fit::observation::Observation;
use crate::fit::problem::{Problem, residual};
use crate::kinematics::Twist;

/// Steps of the variance components in each round; the last round only settles.
const STEPS: [usize; 5] = [1, 1, 1, 1, 2];
/// Rounds after which gear lines are looked for.
const LINE_ROUNDS: usize = 3;
/// Gear lines taken per joint in one round.
const LINES_PER_ROUND: usize = 3;
/// Harmonics of a joint that hardly moves the target.
const FEW_HARMONICS: usize = 12;
/// A joint moves the target little when its lever is below this share of the largest.
const LITTLE: f64 = 0.05;
/// Observations a worker takes at once; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 16;

/// The state that rounds improve.
#[derive(Debug, Clone)]
pub struct State {
    /// Columns of the model.
    pub layout: Layout,
    /// Sizes of its parts.
    pub components: Components,
    /// What is left beside them.
    pub repeatability: Repeatability,
    /// Weight of each observation.
    pub weights: Vec<f64>,
    /// Offsets of the problem's unknowns at which rows are taken.
    pub offsets: DVector<f64>,
    /// Span of the drift's basis, stations.
    pub span: f64,
}

/// One observation's rows and residual at the current offsets.
pub struct Row {
    /// Unwhitened rows.
    pub rows: DMatrix<f64>,
    /// Measured minus predicted.
    pub value: DVector<f64>,
    /// Motion by each joint.
    pub joints: Vec<Twist>,
}

/// What one observation says when it is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Measured minus predicted by all others.
    pub residual: DVector<f64>,
    /// Inverse of its covariance.
    pub information: DMatrix<f64>,
    /// Squared Mahalanobis distance at weight 1, of position and orientation together.
    pub distance_squared: f64,
    noise: NoiseEvidence,
}

/// A settled model.
#[derive(Debug, Clone)]
pub struct Settled {
    /// The state it settled in.
    pub state: State,
    /// Sums of the last round.
    pub sums: Sums,
    /// Posterior of the last round.
    pub posterior: Posterior,
    /// Prior mean of the columns at the last round's offsets.
    pub prior_mean: DVector<f64>,
    /// Leave-one-out residuals of the last round.
    pub left_out: Vec<LeftOut>,
}

/// Trains on `problem` from the offsets of a geometric fit; `None` if a factorisation fails.
pub fn train(
    problem: &Problem<'_>,
    start: DVector<f64>,
    settings: &FullSettings,
    up: Option<Vector3<f64>>,
) -> Option<Settled> {
    let mut state = State::new(problem, start, settings, up.is_some());
    let prior_variances = unknown_variances(problem);
    for (round, &steps) in STEPS.iter().enumerate() {
        let rows = rows(problem, &state, up);
        let prior_mean = prior_mean(problem, &state);
        let (sums, covariances) = sums(problem, &state, &rows, &prior_mean);
        let posterior = settle(&mut state.components, &sums, steps)?;
        let left_out = leave_one_out(&state, &rows, &prior_mean, &covariances, &posterior);
        if round + 1 == STEPS.len() {
            return Some(Settled {
                state,
                sums,
                posterior,
                prior_mean,
                left_out,
            });
        }
        state
            .repeatability
            .update(&left_out.iter().map(|l| l.noise.clone()).collect::<Vec<_>>());
        state.weights = student_weights(&left_out, settings.student_t);
        if settings.gear_lines && round < LINE_ROUNDS {
            let found = find_lines(problem, &state.layout, &rows, &left_out, settings);
            state.take_in(&found, &prior_variances, settings);
        }
        let moved = posterior.mean() + prior_mean;
        state.offsets += moved.rows(0, state.offsets.len());
    }
    None
}

impl State {
    fn new(
        problem: &Problem<'_>,
        offsets: DVector<f64>,
        settings: &FullSettings,
        has_up: bool,
    ) -> Self {
        let observations = problem.observations();
        let last = observations.iter().map(|o| o.station).max().unwrap_or(0);
        let span = (last + 1) as f64;
        let layout = layout(problem, &offsets, settings, has_up, span);
        let components = Components::new(&layout, &unknown_variances(problem), settings, span);
        let joints = observations.first().map_or(0, |o| o.axes.len());
        Self {
            components,
            repeatability: Repeatability::expected(settings, joints),
            weights: vec![1.0; observations.len()],
            offsets,
            span,
            layout,
        }
    }

    fn take_in(&mut self, found: &[FoundLine], unknowns: &[f64], settings: &FullSettings) {
        for line in found {
            self.layout.push(
                Block::Line {
                    joint: line.joint,
                    cycles: line.cycles,
                },
                2,
            );
        }
        let mut components = Components::new(&self.layout, unknowns, settings, self.span);
        components.inherit(&self.components);
        self.components = components;
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small positive count"
)]
fn layout(
    problem: &Problem<'_>,
    offsets: &DVector<f64>,
    settings: &FullSettings,
    has_up: bool,
    span: f64,
) -> Layout {
    let sessions = problem.starts().len();
    let observations = problem.observations();
    let joints = observations.first().map_or(0, |o| o.axes.len());
    let mut layout = Layout::default();
    layout.push(Block::Unknowns, problem.unknowns().len());
    if settings.gravity && has_up {
        layout.push(Block::Gravity, gravity_columns(joints));
    }
    if settings.blend && observations.iter().any(|o| o.shortfall.is_some()) {
        layout.push(Block::Blend, joints);
        layout.push(Block::StopShort, joints);
        (0..sessions)
            .filter(|_| sessions > 1)
            .for_each(|session| layout.push(Block::SessionBlend(session), joints));
    }
    if settings.drift {
        // Beyond this order the prior leaves nothing.
        let orders = (1.5 * span / settings.drift_length_stations)
            .ceil()
            .clamp(2.0, 40.0) as usize;
        layout.push(Block::WarmUp, 3 * orders);
        (0..sessions).for_each(|session| layout.push(Block::Drift(session), 3 * orders));
    }
    for (joint, harmonics) in harmonics(problem, offsets, settings, joints)
        .into_iter()
        .enumerate()
    {
        layout.push(Block::Curve(joint), 2 * harmonics);
        for session in (0..sessions).filter(|_| sessions > 1) {
            layout.push(
                Block::SessionCurve { session, joint },
                2 * FEW_HARMONICS.min(harmonics) + 1,
            );
        }
    }
    layout
}

/// Full harmonics for joints that move the target, fewer for those that hardly do.
fn harmonics(
    problem: &Problem<'_>,
    offsets: &DVector<f64>,
    settings: &FullSettings,
    joints: usize,
) -> Vec<usize> {
    let observations = problem.observations();
    let views = observations
        .iter()
        .map(|o| problem.view(o.session, &o.axes, offsets).joints);
    let levers = views.fold(vec![0.0f64; joints], |largest, twists| {
        largest
            .iter()
            .zip(twists)
            .map(|(lever, twist)| lever.max(twist.linear.norm()))
            .collect()
    });
    let longest = levers.iter().copied().fold(0.0, f64::max);
    // An orientation shows what a position near the axis does not.
    let turned = observations.iter().any(|o| o.orientation.is_some());
    let few = if turned {
        2 * settings.harmonics / 3
    } else {
        FEW_HARMONICS
    };
    let count = |lever: &f64| {
        if *lever > LITTLE * longest {
            settings.harmonics
        } else {
            few
        }
    };
    levers.iter().map(count).collect()
}

/// Prior variances of the problem's unknowns; those without a prior get one far wider than any frame can be off.
fn unknown_variances(problem: &Problem<'_>) -> Vec<f64> {
    const WIDE_MM: f64 = 300.0;
    const WIDE_RAD: f64 = 0.3;
    let wide = |angle: bool| if angle { WIDE_RAD } else { WIDE_MM };
    let precisions = problem.prior_precision().iter().zip(problem.unknowns());
    precisions
        .map(|(&p, unknown)| {
            if p > 0.0 {
                p.recip()
            } else {
                wide(unknown.parameter.is_angle()).powi(2)
            }
        })
        .collect()
}

/// What the prior expects of the columns, relative to the offsets the rows are taken at.
fn prior_mean(problem: &Problem<'_>, state: &State) -> DVector<f64> {
    let mut mean = DVector::zeros(state.layout.size());
    for (place, precision) in problem.prior_precision().iter().enumerate() {
        if *precision > 0.0 {
            mean[place] = problem.prior_mean()[place] - state.offsets[place];
        }
    }
    mean
}

fn rows(problem: &Problem<'_>, state: &State, up: Option<Vector3<f64>>) -> Vec<Row> {
    let frames = problem.frames(&state.offsets);
    let row = |observation: &Observation| {
        let view = problem.view(observation.session, &observation.axes, &state.offsets);
        let root = frames[observation.session]
            .tracker_from_base
            .isometry()
            .rotation;
        let pose = PoseView {
            unknowns: &view.unknowns,
            joints: &view.joints,
            axes: &view.axes,
            end: view.end.translation.vector.into(),
            up: up.map(|up| root * up),
            base: *root.to_rotation_matrix().matrix(),
            angles: &observation.axes,
            shortfall: observation.shortfall.as_deref(),
            session: Some(observation.session),
            time: Some(observation.station as f64 / state.span),
        };
        let left = residual(observation, &view.end);
        let mut value = left.position.as_slice().to_vec();
        value.extend(left.rotation.iter().flat_map(|rotation| rotation.iter()));
        Row {
            rows: pose.rows(&state.layout, value.len()),
            value: DVector::from_vec(value),
            joints: view.joints,
        }
    };
    problem
        .observations()
        .par_iter()
        .with_min_len(CHUNK)
        .map(row)
        .collect()
}

/// Whitens all rows and sums them; also the covariance of each observation at its weight.
fn sums(
    problem: &Problem<'_>,
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
) -> (Sums, Vec<DMatrix<f64>>) {
    let whiten = |((observation, row), weight): ((&Observation, &Row), &f64)| {
        let covariance = state.repeatability.covariance(observation, &row.joints) / *weight;
        let factor = covariance
            .clone()
            .cholesky()
            .expect("an instrument's covariance plus repeatability is positive")
            .l();
        let value = &row.value - &row.rows * prior_mean;
        let white = |matrix: &DMatrix<f64>| {
            factor
                .solve_lower_triangular(matrix)
                .expect("a factor has no zero pivot")
        };
        let value = factor
            .solve_lower_triangular(&value)
            .expect("a factor has no zero pivot");
        let ln = 2.0 * factor.diagonal().map(f64::ln).sum();
        (white(&row.rows), value, ln, covariance)
    };
    let observations = problem
        .observations()
        .par_iter()
        .zip(rows)
        .zip(&state.weights);
    let parts: Vec<_> = observations.with_min_len(CHUNK).map(whiten).collect();
    let count: usize = parts.iter().map(|part| part.1.len()).sum();
    let mut stacked = DMatrix::zeros(count, state.layout.size());
    let mut values = DVector::zeros(count);
    let (mut first, mut ln_noise) = (0, 0.0);
    let mut covariances = Vec::with_capacity(parts.len());
    for (white, value, ln, covariance) in parts {
        stacked.rows_mut(first, value.len()).copy_from(&white);
        values.rows_mut(first, value.len()).copy_from(&value);
        first += value.len();
        ln_noise += ln;
        covariances.push(covariance);
    }
    (Sums::new(&stacked, &values, ln_noise), covariances)
}

/// `steps` steps of the sizes on one Gram matrix, and the posterior where they end.
fn settle(components: &mut Components, sums: &Sums, steps: usize) -> Option<Posterior> {
    for _ in 0..steps {
        let variances = components.variances();
        let posterior = sums.posterior(&variances)?;
        components.update(
            &posterior.whitened.map(|u| u * u),
            &posterior.determined(),
            &variances,
        );
    }
    sums.posterior(&components.variances())
}

/// Leave-one-out residuals in closed form: `r₋ = K⁻¹ α`, `α = N⁻¹ r`, `K = N⁻¹ − N⁻¹ H N⁻¹`.
fn leave_one_out(
    state: &State,
    rows: &[Row],
    prior_mean: &DVector<f64>,
    covariances: &[DMatrix<f64>],
    posterior: &Posterior,
) -> Vec<LeftOut> {
    let mean = posterior.mean() + prior_mean;
    let chunk = |chunk: usize| {
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(rows.len());
        let stacked = stack(&rows[range.clone()]);
        let half = posterior.half(&stacked);
        let mut first = 0;
        let mut left_out = Vec::with_capacity(CHUNK);
        for place in range {
            let row = &rows[place];
            let own = half.columns(first, row.value.len());
            first += row.value.len();
            let noise = &covariances[place];
            let explained = own.tr_mul(&own);
            left_out.push(left_out_of(
                row,
                &mean,
                noise,
                &explained,
                state.weights[place],
            ));
        }
        left_out
    };
    (0..rows.len().div_ceil(CHUNK))
        .into_par_iter()
        .flat_map_iter(chunk)
        .collect()
}

fn left_out_of(
    row: &Row,
    mean: &DVector<f64>,
    noise: &DMatrix<f64>,
    explained: &DMatrix<f64>,
    weight: f64,
) -> LeftOut {
    let inverse = |matrix: &DMatrix<f64>| {
        matrix
            .clone()
            .try_inverse()
            .expect("a positive definite covariance")
    };
    let noise_inverse = inverse(noise);
    let left = &row.value - &row.rows * mean;
    let alpha = &noise_inverse * left;
    let information = &noise_inverse - &noise_inverse * explained * &noise_inverse;
    let covariance = inverse(&information);
    let residual = &covariance * &alpha;
    let at_weight_one = &covariance - noise + noise * weight;
    let distance_squared = residual.dot(&(inverse(&at_weight_one) * &residual));
    LeftOut {
        noise: NoiseEvidence::new(&alpha, &information, &row.joints, weight),
        residual,
        information,
        distance_squared,
    }
}

fn stack(rows: &[Row]) -> DMatrix<f64> {
    let count = rows.iter().map(|row| row.value.len()).sum();
    let mut stacked = DMatrix::zeros(count, rows[0].rows.ncols());
    let mut first = 0;
    for row in rows {
        stacked
            .rows_mut(first, row.value.len())
            .copy_from(&row.rows);
        first += row.value.len();
    }
    stacked
}

/// `(ν + r)/(ν + d²)`: a station far from what all others say counts little.
fn student_weights(left_out: &[LeftOut], freedom: f64) -> Vec<f64> {
    let weight = |l: &LeftOut| (freedom + l.residual.len() as f64) / (freedom + l.distance_squared);
    left_out
        .iter()
        .map(|l| if freedom > 0.0 { weight(l) } else { 1.0 })
        .collect()
}

fn find_lines(
    problem: &Problem<'_>,
    layout: &Layout,
    rows: &[Row],
    left_out: &[LeftOut],
    settings: &FullSettings,
) -> Vec<FoundLine> {
    let joints = rows.first().map_or(0, |row| row.joints.len());
    let of_joint = |joint: usize| {
        let stations = problem.observations().iter().zip(rows).zip(left_out).map(
            |((observation, row), left_out)| {
                let twist = &row.joints[joint];
                let column = DVector::from_fn(row.value.len(), |i, _| {
                    if i < 3 {
                        twist.linear[i]
                    } else {
                        twist.angular[i - 3]
                    }
                });
                lines::evidence(
                    &column,
                    &left_out.residual,
                    &left_out.information,
                    observation.axes[joint],
                )
            },
        );
        let stations: Vec<_> = stations.collect();
        // A joint that hardly moves the target says nothing of its gears.
        let moves = layout
            .columns(Block::Curve(joint))
            .is_some_and(|c| c.len() > 2 * FEW_HARMONICS);
        let most = if moves { LINES_PER_ROUND } else { 0 };
        lines::find(
            joint,
            &stations,
            &layout.lines(joint),
            settings.line_threshold,
            most,
        )
    };
    (0..joints).flat_map(of_joint).collect()
}

/// The parts that can be left out as a whole, with what they brought.
#[derive(Debug, Clone, PartialEq)]
pub struct PartEvidence {
    /// The part's name.
    pub name: &'static str,
    /// Log evidence with it minus without it, nats.
    pub gain: f64,
    /// Whether it stayed in the model.
    pub kept: bool,
}

/// A part that can be left out as a whole: its name, and the blocks it consists of.
type Optional = (&'static str, fn(Block) -> bool);

const OPTIONAL: [Optional; 5] = [
    ("gravity", |block| block == Block::Gravity),
    ("blend", |block| {
        matches!(
            block,
            Block::Blend | Block::StopShort | Block::SessionBlend(_)
        )
    }),
    ("drift", |block| {
        matches!(block, Block::WarmUp | Block::Drift(_))
    }),
    ("gear_lines", |block| matches!(block, Block::Line { .. })),
    ("session_changes", |block| {
        matches!(block, Block::SessionCurve { .. })
    }),
];

impl Settled {
    /// Tries the model without each optional part, and drops those whose absence the evidence prefers.
    pub fn weigh_parts(&mut self) -> Vec<PartEvidence> {
        let mut found = Vec::new();
        for (name, is_of) in OPTIONAL {
            let mut variances = self.posterior.scale.map(|scale| scale * scale);
            let mut columns = 0;
            for (_, own) in self
                .state
                .layout
                .blocks()
                .filter(|(block, _)| is_of(*block))
            {
                columns += own.len();
                variances.rows_mut(own.start, own.len()).fill(0.0);
            }
            if columns == 0 {
                continue;
            }
            let Some(without) = self.sums.posterior(&variances) else {
                continue;
            };
            let gain = self.posterior.log_evidence - without.log_evidence;
            let kept = gain > 0.0;
            if !kept {
                self.posterior = without;
                self.state.components.drop_parts(|part| part.is_of(name));
            }
            found.push(PartEvidence { name, gain, kept });
        }
        found
    }
}

impl Part {
    fn is_of(self, name: &str) -> bool {
        match self {
            Self::Gravity => name == "gravity",
            Self::WarmUp | Self::Drift => name == "drift",
            Self::SessionBlend | Self::StopShort => name == "blend",
            Self::SessionCurve => name == "session_changes",
            Self::Line { .. } => name == "gear_lines",
            Self::ShortCurve(_) | Self::LongCurve(_) => false,
        }
    }
}
