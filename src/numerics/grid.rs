//! Grid: stations and an error model → judged steps, and the table of the one chosen.
//!
//! Inputs are stations with their errors and folds, one error model per fold and one of all stations; output is one
//! [`Judged`] row per step, node source, interpolation and judgement, and the chosen [`Table`]. Steps
//! ([`crate::method::grids`]):
//! 1. the box, the tool orientation and the arm configuration of the table ([`settings`]);
//! 2. nodes of each step over the box ([`lattice`]) by inverse kinematics; refused where the arm cannot serve ([`node`]);
//! 3. the session's own nodes, where it was measured on a grid ([`measured`]);
//! 4. every step judged on stations that took no part ([`judge`]), with the coverage of its table ([`covered`]);
//! 5. for model nodes the largest step that is hardly worse than the model itself, for measured ones the largest whose
//!    bound, and that of all smaller steps, is within the tolerance ([`choose`]).

pub mod answers;
pub mod choose;
pub mod covered;
pub mod interpolation;
pub mod judge;
pub mod lattice;
pub mod measured;
pub mod node;
mod rows;
pub mod settings;
mod table;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use thiserror::Error;

pub use choose::{Choice, Picked, Tolerance, WITHIN_MM, notices_mm};
pub use covered::Covered;
pub use interpolation::Interpolation;
pub use judge::HeldOut;
pub use lattice::{Lattice, NoLattice, WorkBox};
pub use measured::{MeasuredGrid, NotOnGrid};
pub use node::{GridStation, PlacedGrid, Reach, Refusal};
pub use settings::{GridSettings, Rule, WITHIN};

use crate::figures::{Figures, least_count};
use crate::fit::ToolErrors;
use crate::kinematics::Configuration;
use crate::progress::Progress;
use answers::by_number;
use rows::Judging;
pub use rows::StepAnswers;

/// The source of node values.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize, serde::Serialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The station measured at the node.
    Measured,
    /// The error model at the node's joint angles.
    Model,
}

impl Source {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Model => "model",
        }
    }
}

/// The way in which a step was judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// A cell of the step around each held-out station.
    LocalCell,
    /// The nodes of the table that would be published.
    Table,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// The bound, with the measurement's guard, is within the tolerance.
    Meets,
    DoesNotMeet,
    /// It could not be shown: the reason.
    NotShown(String),
}

/// One row of the step table: what the nodes of a step answer, as [`StepAnswers`] has it, and what a tolerance makes of that.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    pub step_mm: f64,
    pub source: Source,
    pub interpolation: Interpolation,
    pub judgement: Judgement,
    /// The test session whose stations judged; `None` where held-out blocks did.
    pub of_test: Option<String>,
    pub lattice: Option<Lattice>,
    pub pitch_mm: Option<[f64; 3]>,
    pub nodes: usize,
    pub refused_nodes: std::collections::BTreeMap<Refusal, usize>,
    pub cells: usize,
    pub refused_cells: std::collections::BTreeMap<Refusal, usize>,
    pub covered: Option<Covered>,
    pub interpolation_shown: Option<f64>,
    /// The judgement that has the larger bound: `LocalCell` for a table whose local cells have it.
    pub decided_by: Judgement,
    pub held_out: HeldOut,
    /// Figures of the remaining errors; `None` without any station.
    pub figures: Option<Figures>,
    /// Distribution-free upper tolerance bound with between-session variation: each joint approaches the stations from a
    /// side of its own, and the base has drifted as in a session. Where that variation is not known, the session's own
    /// bound; `None` with too few stations. Of a table the larger of its own and that of its local cells.
    pub bound: Option<f64>,
    /// The bound of the session's own stations as measured; `None` with too few stations.
    pub bound_of_session: Option<f64>,
    /// The bound, with between-session variation as `bound` has it, of what the model itself leaves on the same stations without
    /// a grid, mm; `None` for measured nodes and with too few stations.
    pub model_bound: Option<f64>,
    /// The verdict; for local cells it only informs.
    pub verdict: Verdict,
    pub chosen: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct TableNode {
    /// Joint angles of the nominal arm there, rad, or why there are none.
    pub joints: Result<Vec<f64>, Refusal>,
    /// Error with its covariance (base frame, mm and mm²), or why there is none.
    pub error: Result<(Vector3<f64>, Matrix3<f64>), Refusal>,
    /// Distance to the nearest station of the same configuration, mm.
    pub nearest_mm: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The step asked for, mm.
    pub step_mm: f64,
    /// The positions of the nodes, in the base frame.
    pub lattice: Lattice,
    /// The tool's orientation in the base frame.
    pub orientation: UnitQuaternion<f64>,
    /// The arm configuration, for six-axis arms.
    pub configuration: Option<Configuration>,
    pub source: Source,
    pub interpolation: Interpolation,
    /// The power of inverse distance weighting.
    pub idw_power: f64,
    /// The largest turn of a target's orientation from the table's, rad.
    pub orientation_tolerance_rad: f64,
    /// Radians that one unit of each joint's variable counts as; empty where all are angles.
    pub counted: Vec<f64>,
    /// Second moment of what interpolation adds to the model inside a cell, base frame, mm²; `None` where it is not known.
    pub interpolation_mm2: Option<Matrix3<f64>>,
    /// The nodes in the lattice's order.
    pub nodes: Vec<TableNode>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Grids {
    /// What every step answers, before a tolerance judges it.
    pub answers: Vec<StepAnswers>,
    pub judged: Vec<Judged>,
    /// The chosen table; `None` where no step gives one.
    pub table: Option<Table>,
    pub choice: Choice,
    /// The arm configuration of all tables, for six-axis arms.
    pub configuration: Option<Configuration>,
    pub idw_power: f64,
    /// Expanded uncertainty (k = 2) of the measurement that judged, mm.
    pub guard_mm: f64,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    #[error(
        "no paired station is left to build a grid on; look at the rejects for what was left out"
    )]
    NoStations,
}

#[derive(Clone, Copy)]
pub struct GridInput<'a> {
    pub stations: &'a [GridStation],
    /// For each fold, the errors by a model that did not see its stations.
    pub folds: &'a [ToolErrors<'a>],
    /// The errors by the model of all stations, for the published table.
    pub model: ToolErrors<'a>,
    /// Expanded uncertainty (k = 2) of the measurement that judges, mm: verdicts are guarded by it.
    pub guard_mm: f64,
}

impl Grids {
    /// The row of the chosen table; `None` where no step gives one.
    pub fn chosen(&self) -> Option<&Judged> {
        Some(&self.judged[self.choice.row?])
    }

    /// The row that has the figures of the chosen table: its own, or that of its local cells where their bound is larger.
    pub fn deciding(&self) -> Option<&Judged> {
        let chosen = self.chosen()?;
        let local = local_cells_of(&self.judged, chosen);
        Some(local.filter(|_| chosen.decided_by == Judgement::LocalCell).unwrap_or(chosen))
    }

    /// Judges the chosen table by a test session: by those of its stations that the table covers. Its row is added to the
    /// others; the choice is unchanged. Nothing is added where there is no table.
    pub fn judge_by_session(
        &mut self,
        session: &str,
        stations: &[GridStation],
        model: &ToolErrors<'_>,
        tolerance: &Tolerance,
    ) {
        let (Some(table), Some(chosen)) = (&self.table, self.chosen()) else { return };
        let held_out = table.judged_by(stations, model);
        let shown = table.interpolation_shown(stations);
        let row = rows::session_row(chosen, session, held_out, tolerance, self.guard_mm, shown);
        self.judged.push(row);
    }
}

/// The local cells that judge a table beside its own nodes; `None` of other rows and where there are none.
fn local_cells_of<'j>(judged: &'j [Judged], table: &Judged) -> Option<&'j Judged> {
    let is_its = |own: &&Judged| {
        own.judgement == Judgement::LocalCell
            && (own.source, own.interpolation) == (table.source, table.interpolation)
            && own.step_mm.total_cmp(&table.step_mm).is_eq()
    };
    let is_table = table.judgement == Judgement::Table && table.of_test.is_none();
    judged.iter().find(is_its).filter(|_| is_table)
}

/// Judges every step and builds the table of the one chosen. What steps answer is taken from `known` where it has that of these stations.
pub fn grids(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    settings: &GridSettings,
    tolerance: &Tolerance,
    known: Option<Vec<StepAnswers>>,
    progress: &dyn Progress,
) -> Result<Grids, GridError> {
    let plan = settings.plan(input.stations)?;
    let has_configuration = |station: &&GridStation| station.configuration == plan.configuration;
    let like: Vec<&GridStation> = input.stations.iter().filter(has_configuration).collect();
    let judges = |own: &&GridStation| plan.is_like(own) && plan.bounds.has(&own.position);
    let judging = Judging {
        input,
        settings,
        plan: &plan,
        reach,
        like: &like,
        judges: input.stations.iter().filter(judges).collect(),
        needed: least_count(tolerance.coverage()),
        own: &MeasuredGrid::of(input.stations, &reach.counted),
    };
    let stations = by_number(input.stations);
    let are_at = |known: &Vec<StepAnswers>| known.iter().all(|own| own.answers.are_at(&stations));
    let answers = known.filter(|known| are_at(known) && judging.fit(known));
    let answers = answers.unwrap_or_else(|| judging.answers(progress));
    let by_tolerance = |step: &StepAnswers| Judged::by(tolerance, step, &stations, input.guard_mm);
    let mut judged: Vec<Judged> = answers.iter().map(by_tolerance).collect();
    rows::combine(&mut judged, tolerance, input.guard_mm);
    let mut choice = choose::choose(&judged, settings);
    let mut table = None;
    if let Some(row) = choice.row {
        if let Some(placed) = judging.once_placed(&judged[row], progress) {
            judged[row] = by_tolerance(&placed);
            choice.verdict = judged[row].verdict.clone();
        }
        judged[row].chosen = true;
        table = table::table(&judging, &judged[row], &answers, progress);
    }
    Ok(Grids {
        answers,
        judged,
        table,
        choice,
        configuration: plan.configuration,
        idw_power: settings.idw_power,
        guard_mm: input.guard_mm,
    })
}
