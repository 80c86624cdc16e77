//! The full error model as JSON and back.
//!
//! A column's coefficient is `mean`; the covariance of all columns is `S L⁻ᵀ L⁻¹ S`, S the diagonal of `scale`. `factor`
//! is L: its lower triangle column by column, each from the diagonal down, as little-endian 64-bit numbers in base64, some
//! 3.4 MB for 800 columns (as decimal text it would be 6 MB). Of a pool the factor is that of an arrow
//! ([`super::regression::sessions`]), some 3 MB a session beside it. Robust weights and leave-one-out residuals belong to the
//! stations, not to the model, and are not saved.

use std::borrow::Cow;
use std::num::NonZeroU32;
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{DMatrix, DVector, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::FullModel;
use super::approach::ApproachOffsets;
use super::layout::{Block, Layout};
use super::noise::Repeatability;
use super::partition::Partition;
use super::regression::sessions::{Arrow, OwnRoot};
use super::regression::{Posterior, Root};
use super::stored::StoredFull;
use super::student::Tails;
use crate::fit::model::PartEvidence;
use crate::fit::problem::{Prior, Problem};
use crate::fit::saved::{SavedError, SavedSession, SavedUnknown, VERSION, read, same_length};
use crate::kinematics::{Arm, Motion, Parameter};
use crate::linalg::Cholesky;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedFull {
    pub version: u32,
    pub arm: Arm,
    /// The frames that the unknowns of each session are relative to.
    pub sessions: Vec<SavedSession>,
    pub up: Option<[f64; 3]>,
    /// The unknowns of geometry and frames: the columns of the block `unknowns`.
    pub unknowns: Vec<SavedUnknown>,
    /// Offsets of the unknowns at which the columns are evaluated.
    pub offsets: Vec<f64>,
    pub blocks: Vec<SavedBlock>,
    pub mean: Vec<f64>,
    /// Prior standard deviation of every column; 0 for parts that were dropped.
    pub scale: Vec<f64>,
    /// Factor L of the posterior information over `scale`; of a pool of the shared columns, the sessions' own eliminated.
    pub factor: String,
    /// Of a pool, the factored part of each session; absent of a model whose columns were factored together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub own_factors: Vec<SavedOwn>,
    pub curve_period_turns: NonZeroU32,
    /// Period of the curve of each joint that slides, mm, null where it turns; absent where all turn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub slide_periods_mm: Vec<Option<f64>>,
    /// Age of each session, years before the latest; absent where curves do not age.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ages_years: Vec<f64>,
    /// Repairs of each joint that were still to come in each session; absent where none was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repairs_to_come: Vec<Vec<usize>>,
    pub span_stations: f64,
    pub student_t: f64,
    /// Variance per axis of a session's own drift, mm².
    pub drift_variance_mm2: f64,
    /// Variance per axis of the warm-up drift that all sessions repeat, mm².
    pub warm_up_variance_mm2: f64,
    /// The middle of each session's stations in the base frame, mm, from which its scale counts.
    pub middles_mm: Vec<[f64; 3]>,
    pub scale_sd: f64,
    pub approach: Option<ApproachOffsets>,
    pub log_evidence: f64,
    #[serde(with = "RepeatabilityText")]
    pub repeatability: Repeatability,
    pub parts: Vec<PartEvidence>,
}

/// The factored part of one session: the columns of its own frames, drift, scale and changes, in their order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedOwn {
    /// Factor `L_s` of the information on its own columns.
    pub factor: String,
    /// `L_s⁻¹ B_s`, with `B_s` the information between its own columns and the shared ones: all numbers, column by column.
    pub across: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedBlock {
    #[serde(with = "BlockText")]
    pub block: Block,
    pub columns: usize,
}

/// The text of a block's kind, with joints and sessions counted from 0.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Block", rename_all = "snake_case", deny_unknown_fields)]
enum BlockText {
    Unknowns,
    Gravity,
    CommandWeight,
    ApproachOffset,
    SessionCommandWeight(#[serde(with = "OfSession")] usize),
    OwnCommandWeight(#[serde(with = "OfSession")] usize),
    WarmUp,
    Drift(#[serde(with = "OfSession")] usize),
    Scale(#[serde(with = "OfSession")] usize),
    Curve(#[serde(with = "OfJoint")] usize),
    Earlier { joint: usize, to_come: usize },
    SessionCurve { session: usize, joint: usize },
    Ageing { joint: usize, step: usize },
    Line { joint: usize, cycles: f64 },
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "usize", deny_unknown_fields)]
struct OfSession {
    #[serde(getter = "usize::clone")]
    session: usize,
}

impl From<OfSession> for usize {
    fn from(own: OfSession) -> Self {
        own.session
    }
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "usize", deny_unknown_fields)]
struct OfJoint {
    #[serde(getter = "usize::clone")]
    joint: usize,
}

impl From<OfJoint> for usize {
    fn from(own: OfJoint) -> Self {
        own.joint
    }
}

/// The text of a repeatability; a saved model predicts places, so factors of lengths are not in it.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Repeatability", deny_unknown_fields)]
struct RepeatabilityText {
    #[serde(rename = "position_mm2")]
    position: f64,
    #[serde(rename = "orientation_rad2")]
    orientation: f64,
    #[serde(rename = "joints_rad2")]
    joints: Vec<f64>,
    /// Absent where no station has readings of several targets.
    #[serde(rename = "own_mm2", default, skip_serializing_if = "Option::is_none")]
    own: Option<f64>,
    #[serde(skip)]
    lengths: Vec<f64>,
}

impl FullModel {
    /// The model in the form that is saved; `names` are the sessions' names in the fit's order.
    pub fn saved(&self, arm: &Arm, names: &[&str]) -> SavedFull {
        let block =
            |(block, columns): (_, Range<usize>)| SavedBlock { block, columns: columns.len() };
        SavedFull {
            version: VERSION,
            arm: arm.clone(),
            sessions: SavedSession::all(names, self.starts()),
            up: self.trained.up.map(Into::into),
            unknowns: self.unknowns().iter().map(SavedUnknown::of).collect(),
            offsets: self.trained.offsets.as_slice().to_vec(),
            blocks: self.trained.layout.blocks().map(block).collect(),
            mean: self.trained.mean.as_slice().to_vec(),
            scale: self.posterior.scale.as_slice().to_vec(),
            factor: encode(self.posterior.saved_factor().lower()),
            own_factors: self.posterior.own_factors().iter().map(SavedOwn::of).collect(),
            curve_period_turns: NonZeroU32::new(self.trained.layout.period_turns)
                .expect("a layout's curves repeat after a turn or more"),
            slide_periods_mm: self.trained.layout.slide_periods_mm.clone(),
            ages_years: self.trained.layout.ages_years.clone(),
            repairs_to_come: self.trained.layout.repairs_to_come.clone(),
            span_stations: self.trained.span,
            student_t: self.trained.tails.setting(),
            drift_variance_mm2: self.trained.drift_variance,
            warm_up_variance_mm2: self.trained.warm_up_variance,
            middles_mm: self.trained.middles.iter().map(|middle| middle.coords.into()).collect(),
            scale_sd: self.trained.scale_sd,
            approach: self.trained.approach.clone(),
            log_evidence: self.posterior.log_evidence,
            repeatability: self.trained.repeatability.clone(),
            parts: self.trained.parts.clone(),
        }
    }

    /// A model with the predictions of the saved one; without weights and leave-one-out residuals.
    pub fn from_saved(saved: &SavedFull) -> Result<Self, SavedError> {
        let layout = saved.layout()?;
        let scale = DVector::from_column_slice(&saved.scale);
        let mean = DVector::from_column_slice(&saved.mean);
        let problem = saved.problem()?;
        let root = saved.root(Partition::of(&layout, &problem.unknowns, saved.sessions.len()))?;
        let posterior = Posterior {
            // A dropped column has no scale, and its coefficient is zero.
            whitened: mean.zip_map(&scale, |m, s| if s > 0.0 { m / s } else { 0.0 }),
            scale,
            root,
            log_evidence: saved.log_evidence,
        };
        let offsets = DVector::from_column_slice(&saved.offsets);
        let trained = StoredFull {
            starts: problem.starts.clone(),
            turned: saved.turned(),
            scale: posterior.scale.clone(),
            whitened: posterior.whitened.clone(),
            up: saved.up.map(Vector3::from),
            layout,
            rows_at: offsets.clone(),
            offsets,
            mean,
            tails: Tails::from_setting(saved.student_t),
            drift_variance: saved.drift_variance_mm2,
            warm_up_variance: saved.warm_up_variance_mm2,
            middles: saved.middles()?,
            scale_sd: saved.scale_sd,
            scale_evidence: None,
            approach: saved.approach.clone(),
            sides: None,
            span: saved.span_stations,
            repeatability: saved.repeatability.clone(),
            weights: Vec::new(),
            parts: saved.parts.clone(),
        };
        Ok(Self::of(trained, problem, posterior, Vec::new()))
    }
}

impl SavedFull {
    pub fn read(text: &str) -> Result<Self, SavedError> {
        read(text)
    }

    fn root(&self, partition: Partition) -> Result<Root, SavedError> {
        if self.own_factors.is_empty() {
            return Ok(Root::Columns(factor(&self.factor, partition.size())?));
        }
        let (sessions, shared) = (partition.own.len(), partition.common.len());
        same_length("sessions' own factors", sessions, self.own_factors.len())?;
        let own = self.own_factors.iter().zip(&partition.own);
        Ok(Root::Sessions(Arrow {
            own: own.map(|(saved, own)| saved.root(own.len(), shared)).collect::<Result<_, _>>()?,
            common: factor(&self.factor, shared)?,
            partition,
        }))
    }

    fn layout(&self) -> Result<Layout, SavedError> {
        let columns = self.mean.len();
        let asked =
            self.blocks.iter().try_fold(0_usize, |sum, block| sum.checked_add(block.columns));
        same_length("columns", asked.unwrap_or(usize::MAX), columns)?;
        same_length("prior deviations", columns, self.scale.len())?;
        if !self.ages_years.is_empty() {
            same_length("ages", self.sessions.len(), self.ages_years.len())?;
        }
        let joints = self.arm.joints().len();
        let repairs = &self.repairs_to_come;
        if !repairs.is_empty() {
            same_length("sessions with repairs", self.sessions.len(), repairs.len())?;
            let mut lists = repairs.iter();
            lists.try_for_each(|own| same_length("joints with repairs", joints, own.len()))?;
        }
        same_length("joint repeatabilities", joints, self.repeatability.joints.len())?;
        let mut layout = Layout::new(self.curve_period_turns.get());
        layout.slide_periods_mm = self.slide_periods_mm()?;
        layout.ages_years.clone_from(&self.ages_years);
        layout.repairs_to_come.clone_from(&self.repairs_to_come);
        for block in &self.blocks {
            same_length("columns in a block", self.columns_of(block)?, block.columns)?;
            layout.push(block.block, block.columns);
        }
        Ok(layout)
    }

    /// The period of each sliding joint's curve; an error unless exactly the joints that slide have one, above 0.
    fn slide_periods_mm(&self) -> Result<Vec<Option<f64>>, SavedError> {
        let slides = self.arm.joints().iter().map(|joint| joint.slides);
        let fits = |(slides, period): (bool, &Option<f64>)| {
            period.is_some_and(|mm| mm.is_finite() && mm > 0.0) == slides
        };
        let periods = &self.slide_periods_mm;
        let fitting = if periods.is_empty() {
            slides.filter(|slides| !slides).count()
        } else {
            slides.zip(periods).filter(|own| fits(*own)).count()
        };
        let joints = self.arm.joints().len();
        same_length("joints with a curve's period of their kind", joints, fitting)?;
        Ok(periods.clone())
    }

    fn middles(&self) -> Result<Vec<Point3<f64>>, SavedError> {
        same_length("middles", self.sessions.len(), self.middles_mm.len())?;
        Ok(self.middles_mm.iter().copied().map(Point3::from).collect())
    }

    /// The number of columns that a block must have; its own number where several are possible.
    fn columns_of(&self, block: &SavedBlock) -> Result<usize, SavedError> {
        let (joint, session) = block.block.belongs_to();
        let joints = self.arm.joints().len();
        for (what, place, count) in
            [("joints", joint, joints), ("sessions", session, self.sessions.len())]
        {
            if place.is_some_and(|place| place >= count) {
                let found = count;
                let expected = place.unwrap_or(0).saturating_add(1);
                return Err(SavedError::Length { what, expected, found });
            }
        }
        let columns = block.columns;
        Ok(match block.block {
            Block::Unknowns => self.unknowns.len(),
            Block::Gravity => (1..=joints).sum(),
            Block::CommandWeight
            | Block::ApproachOffset
            | Block::SessionCommandWeight(_)
            | Block::OwnCommandWeight(_) => joints,
            Block::WarmUp | Block::Drift(_) => columns / 3 * 3,
            Block::Curve(_) => columns / 2 * 2,
            Block::Earlier { .. } | Block::SessionCurve { .. } | Block::Ageing { .. } => {
                columns.saturating_sub(1) / 2 * 2 + 1
            }
            Block::Line { .. } => 2,
            Block::Scale(_) => 1,
        })
    }

    /// Whether the targets' own orientations are among the unknowns.
    fn turned(&self) -> bool {
        let turns =
            |own: &SavedUnknown| matches!(own.parameter, Parameter::Target(Motion::Rotation(_)));
        self.unknowns.iter().any(turns)
    }

    /// The problem without observations, whose unknowns are those saved.
    fn problem(&self) -> Result<Problem<'static>, SavedError> {
        let frames =
            self.sessions.iter().map(SavedSession::frames).collect::<Result<Vec<_>, _>>()?;
        // The prior is in `scale`; predictions of a problem without observations do not depend on a prior.
        let problem =
            Problem::of_geometry(&[], &self.arm, &frames, &Prior::default(), self.turned());
        same_length("unknowns", problem.unknowns.len(), self.unknowns.len())?;
        same_length("offsets", problem.unknowns.len(), self.offsets.len())?;
        let other = problem.unknowns.iter().map(SavedUnknown::of).zip(&self.unknowns);
        match other.into_iter().find(|(own, saved)| own != *saved) {
            None => Ok(problem),
            Some((_, saved)) => Err(SavedError::Unknown(saved.parameter)),
        }
    }
}

impl SavedOwn {
    fn of(root: &OwnRoot) -> Self {
        Self { factor: encode(root.factor.lower()), across: encode_numbers(root.across.iter()) }
    }

    fn root(&self, own: usize, shared: usize) -> Result<OwnRoot, SavedError> {
        let across = decode_numbers(&self.across, own * shared)?;
        Ok(OwnRoot {
            factor: factor(&self.factor, own)?,
            across: DMatrix::from_vec(own, shared, across),
        })
    }
}

impl Posterior {
    fn saved_factor(&self) -> Cow<'_, Cholesky> {
        match &self.root {
            Root::Sessions(arrow) => Cow::Borrowed(&arrow.common),
            Root::Columns(_) | Root::Rows(_) => self.factor(),
        }
    }

    fn own_factors(&self) -> &[OwnRoot] {
        match &self.root {
            Root::Sessions(arrow) => &arrow.own,
            Root::Columns(_) | Root::Rows(_) => &[],
        }
    }
}

/// The lower triangle, column by column, as base64 of little-endian numbers.
fn encode(lower: &DMatrix<f64>) -> String {
    let columns = lower.column_iter().enumerate();
    encode_numbers(columns.flat_map(|(column, own)| own.into_iter().skip(column)))
}

/// Numbers as base64, little-endian.
fn encode_numbers<'n>(numbers: impl Iterator<Item = &'n f64>) -> String {
    let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

/// The factor of `size` columns; `size` was checked against lists already read.
fn factor(text: &str, size: usize) -> Result<Cholesky, SavedError> {
    let mut numbers = decode_numbers(text, size * (size + 1) / 2)?.into_iter();
    let mut lower = DMatrix::zeros(size, size);
    for column in 0..size {
        for row in column..size {
            lower[(row, column)] = numbers.next().expect("as many numbers as the triangle has");
        }
    }
    Cholesky::from_lower(lower)
        .ok_or(SavedError::Factor { problem: "has a diagonal that is not positive" })
}

fn decode_numbers(text: &str, count: usize) -> Result<Vec<f64>, SavedError> {
    let bytes =
        STANDARD.decode(text).map_err(|_| SavedError::Factor { problem: "is not base64" })?;
    let (numbers, rest) = bytes.as_chunks::<8>();
    same_length("bytes after the factor's numbers", 0, rest.len())?;
    same_length("numbers in the factor", count, numbers.len())?;
    let numbers: Vec<f64> = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    let are_finite = numbers.iter().all(|number| number.is_finite());
    let problem = "holds a number that is not finite";
    are_finite.then_some(numbers).ok_or(SavedError::Factor { problem })
}
