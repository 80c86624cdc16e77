//! What a page tells: rows of a run's published tables, in the words and units that they are published in.

mod origin;

use crate::grid::{Tolerance, Verdict};

pub use origin::{Clock, Count, Provenance, Reject, Session};

/// Everything on the page of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The robot.
    pub robot: String,
    /// The session, or `pooled`.
    pub session: String,
    /// The run.
    pub run: String,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// Whether it is.
    pub verdict: Verdict,
    /// Who says so: held-out blocks, and every test session.
    pub judges: Vec<Judge>,
    /// The choice of the step in words.
    pub choice: String,
    /// What an operator has to know beside the verdict: topics of which too much was rejected.
    pub warnings: Vec<String>,
    /// What the run found, in words: damage, parts of the model, stations hardly believed.
    pub notes: Vec<String>,
    /// Whether the table that drove the session still holds, where one did.
    pub table_state: Option<String>,
    /// `grid_steps`.
    pub steps: Vec<Step>,
    /// `accuracy`, but for the tool tip.
    pub figures: Vec<Figure>,
    /// `accuracy` of the tool tip.
    pub tip: Vec<Figure>,
    /// `residuals`, those of one subject together, in the subjects' order.
    pub residuals: Vec<Residuals>,
    /// `semivariograms`.
    pub semivariograms: Vec<Variogram>,
    /// `joint_errors`.
    pub joint_errors: Vec<JointError>,
    /// `parameters`.
    pub parameters: Vec<Parameter>,
    /// `calibrations`.
    pub calibrations: Vec<Calibration>,
    /// Each session's `clocks`, `stations` and `rejects`, training sessions first.
    pub sessions: Vec<Session>,
    /// What came into each stage and what became of it.
    pub counts: Vec<Count>,
    /// What the run was made from.
    pub provenance: Provenance,
}

/// Who judges the run, and what they say.
#[derive(Debug, Clone, PartialEq)]
pub struct Judge {
    /// The stations that judge, in words.
    pub stations: String,
    /// The verdict in words.
    pub verdict: String,
    /// The figures it rests on, in words.
    pub words: String,
    /// What else has to be known, in words.
    pub remark: Option<String>,
}

/// A judged step.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// `blocks`, or `session` where a test session judged.
    pub split: String,
    /// The session whose stations judged.
    pub of_session: String,
    /// `measured` or `model`.
    pub source: String,
    /// `idw` or `trilinear`.
    pub interpolation: String,
    /// `table` or `local_cell`.
    pub judgement: String,
    /// mm.
    pub step_mm: f64,
    /// Nodes of the table.
    pub nodes: Option<i64>,
    /// Held-out poses that judged.
    pub held_out: i64,
    /// Visits of them.
    pub visits: i64,
    /// Blocks they come from.
    pub blocks: Option<i64>,
    /// Mean error left, mm.
    pub mean_mm: Option<f64>,
    /// 95th percentile, mm.
    pub p95_mm: Option<f64>,
    /// Largest, mm.
    pub max_mm: Option<f64>,
    /// Upper tolerance bound, mm.
    pub bound_mm: Option<f64>,
    /// Expanded uncertainty of the measurement, mm.
    pub uncertainty_mm: Option<f64>,
    /// `met`, `not_met` or `not_shown`.
    pub verdict: String,
    /// Why not, in words.
    pub reason: Option<String>,
    /// Whether its table is published.
    pub chosen: bool,
}

/// What a figure or a residual is of, in the words of the tables.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Subject {
    /// `none`, `blocks` or `session`.
    pub split: String,
    /// The session the stations are of.
    pub of_session: String,
    /// `none`, `first` or `all`.
    pub base_refit: String,
    /// `raw_command`, `base_target`, `geometric`, `full` or `table`.
    pub model: String,
    /// `reported`, `blended` or `commanded`.
    pub angles: String,
}

/// An accuracy figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What it is of.
    pub subject: Subject,
    /// `measured`, `predicted` or `measured_after`.
    pub evidence: String,
    /// `position_error`, `orientation_error`, `iso_9283` or `coverage`.
    pub quantity: String,
    /// `mean`, `p95`, `AP_p` and so on.
    pub name: String,
    /// Pose of an ISO 9283 figure.
    pub pose: Option<i64>,
    /// The figure; absent where it is not shown.
    pub value: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// Values it is over; of a bound, the poses it counts.
    pub n: i64,
    /// Of a bound, visits of these poses.
    pub visits: Option<i64>,
    /// Values that the standard or the bound asks for.
    pub n_needed: Option<i64>,
    /// Blocks they come from.
    pub blocks: Option<i64>,
    /// Where it carries a verdict.
    pub verdict: Option<String>,
    /// Why not met, not shown, or what limits it.
    pub reason: Option<String>,
}

/// Measured minus predicted at all stations of a subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// What they are of.
    pub subject: Subject,
    /// In the order of the stations.
    pub stations: Vec<Residual>,
}

/// Measured minus predicted at a station.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// The station's number.
    pub station: i64,
    /// Attained position, base frame, mm.
    pub at: [f64; 3],
    /// Measured minus predicted, mm.
    pub error: [f64; 3],
    /// Whether the session's base was found from it.
    pub used_for_refit: bool,
}

/// A bin of a semivariogram, or a model fitted to its bins.
#[derive(Debug, Clone, PartialEq)]
pub struct Variogram {
    /// `joint` or `cartesian`.
    pub space: String,
    /// The model whose errors are compared.
    pub errors: String,
    /// `x`, `y`, `z` or `norm`.
    pub axis: String,
    /// Bin or fitted model.
    pub entry: VariogramEntry,
    /// Variance of the noise, mm².
    pub noise_mm2: Option<f64>,
    /// `similar`, `flat` or `not_shown`.
    pub similarity: String,
}

/// What a row of `semivariograms` holds.
#[derive(Debug, Clone, PartialEq)]
pub enum VariogramEntry {
    /// Mean separation of the bin's pairs and their semivariance, mm².
    Bin {
        /// rad or mm.
        separation: f64,
        /// mm².
        gamma_mm2: f64,
    },
    /// A fitted model.
    Fitted {
        /// `spherical`, `exponential` or `gaussian`.
        shape: String,
        /// mm².
        nugget_mm2: f64,
        /// mm².
        sill_mm2: f64,
        /// rad or mm.
        range: f64,
        /// Whether it fits best.
        best: bool,
    },
}

/// The error of a joint at an angle.
#[derive(Debug, Clone, PartialEq)]
pub struct JointError {
    /// From 1.
    pub joint: i64,
    /// As the controller names it.
    pub name: String,
    /// rad.
    pub angle_rad: f64,
    /// The smooth curve, rad.
    pub curve_rad: f64,
    /// Standard deviation of curve and gear lines, rad.
    pub sd_rad: f64,
    /// Whether stations visited that angle.
    pub measured: bool,
}

/// A parameter of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// The model.
    pub model: String,
    /// Its name.
    pub name: String,
    /// `base`, `link`, `target` or `session`.
    pub belongs_to: String,
    /// The session whose base or target it is.
    pub of_session: Option<String>,
    /// `mm`, `rad` or `1`.
    pub unit: String,
    /// Nominal value.
    pub nominal: f64,
    /// Identified minus nominal.
    pub offset: f64,
    /// Standard error of the offset.
    pub standard_error: Option<f64>,
    /// `told_apart`, `fixed`, `moves_nothing`, `structurally_dependent` or `weak`.
    pub identifiability: String,
    /// What it could not be told apart from.
    pub confused_with: Vec<String>,
}

/// How well a model is determined, and what it is valid for.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The model.
    pub model: String,
    /// Sessions it was identified from.
    pub sessions: Vec<String>,
    /// Stations used.
    pub stations: i64,
    /// Of them, those that count for less than half.
    pub downweighted: i64,
    /// Free parameters.
    pub parameters: i64,
    /// Structural rank.
    pub rank: Option<i64>,
    /// Condition number.
    pub condition: Option<f64>,
    /// s².
    pub variance_factor: Option<f64>,
    /// Misfit per axis, mm.
    pub misfit_mm: Option<f64>,
    /// Iterations made.
    pub iterations: Option<i64>,
    /// What ended them.
    pub convergence: String,
    /// Optional parts that were tried, with what they brought, nats.
    pub parts: Vec<(String, f64)>,
    /// What it is valid for: name and value.
    pub valid_for: Vec<(String, String)>,
}
