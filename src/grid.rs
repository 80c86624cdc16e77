//! Grid: stations and an error model → judged steps, and the table of the largest step that holds.
//!
//! Inputs are stations with their errors and folds, one error model per fold and one of all stations; output is one
//! [`Judged`] row per step, node source, interpolation and judgement, and the chosen [`Table`]. Steps (METHOD.md 5):
//! 1. the box, the tool orientation and the arm configuration of the table ([`settings`]);
//! 2. nodes of each step, placed by inverse kinematics; refused where the arm cannot serve ([`node`]);
//! 3. the session's own nodes, where it was measured on a grid ([`measured`]);
//! 4. every step judged on stations that took no part ([`judge`]);
//! 5. the largest step whose bound, and that of all smaller steps, is within the tolerance ([`choose`]).

pub mod choose;
pub mod interpolation;
pub mod judge;
pub mod lattice;
pub mod measured;
pub mod node;
pub mod settings;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use thiserror::Error;

pub use choose::{Choice, Tolerance};
pub use interpolation::Interpolation;
pub use judge::HeldOut;
pub use lattice::{Lattice, WorkBox};
pub use measured::{MeasuredGrid, NotOnGrid};
pub use node::{GridStation, PlacedGrid, Reach, Refusal};
pub use settings::GridSettings;

use crate::figures::{Figures, upper_tolerance_bound_of};
use crate::fit::ErrorModel;
use crate::kinematics::Configuration;
use crate::progress::Progress;

/// Where node values come from.
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
    /// The name in files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Model => "model",
        }
    }
}

/// How a step was judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judgement {
    /// A cell of the step around each held-out station.
    LocalCell,
    /// The very nodes that would be published.
    Table,
}

/// What came out of judging one step.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// The bound, with the measurement's guard, is within the tolerance.
    Meets,
    /// It is not.
    DoesNotMeet,
    /// It could not be shown: why.
    NotShown(String),
}

/// One row of the step table.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// The step asked for, mm.
    pub step_mm: f64,
    /// Where node values come from.
    pub source: Source,
    /// How values inside a cell follow.
    pub interpolation: Interpolation,
    /// How it was judged.
    pub judgement: Judgement,
    /// Nodes of the grid; for local cells, the eight of each cell.
    pub nodes: usize,
    /// Refused nodes by reason.
    pub refused_nodes: std::collections::BTreeMap<Refusal, usize>,
    /// Cells of the grid.
    pub cells: usize,
    /// Refused cells by reason.
    pub refused_cells: std::collections::BTreeMap<Refusal, usize>,
    /// What is left on held-out stations.
    pub held_out: HeldOut,
    /// Figures of what is left; `None` without any station.
    pub figures: Option<Figures>,
    /// Distribution-free upper tolerance bound; `None` with too few stations.
    pub bound: Option<f64>,
    /// The verdict; for local cells it informs and decides nothing.
    pub verdict: Verdict,
    /// Whether this row's table was chosen.
    pub chosen: bool,
}

/// A node of the published table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableNode {
    /// Joint angles of the nominal arm there, or why there are none.
    pub joints: Result<Vec<f64>, Refusal>,
    /// Error with its covariance (base frame, mm and mm²), or why there is none.
    pub error: Result<(Vector3<f64>, Matrix3<f64>), Refusal>,
    /// Distance to the nearest station of the same configuration, mm.
    pub nearest_mm: f64,
}

/// The published table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The step asked for, mm.
    pub step_mm: f64,
    /// Where the nodes are, in the base frame.
    pub lattice: Lattice,
    /// The tool's orientation in the base frame.
    pub orientation: UnitQuaternion<f64>,
    /// The arm configuration, for six-axis arms.
    pub configuration: Option<Configuration>,
    /// Where node values come from.
    pub source: Source,
    /// How values inside a cell follow.
    pub interpolation: Interpolation,
    /// IDW's power.
    pub idw_power: f64,
    /// The largest turn of a target's orientation from the table's, rad.
    pub orientation_tolerance_rad: f64,
    /// The nodes in the lattice's order.
    pub nodes: Vec<TableNode>,
}

/// All judged steps and the table chosen among them.
#[derive(Debug, Clone, PartialEq)]
pub struct Grids {
    /// Every step, source, interpolation and judgement.
    pub judged: Vec<Judged>,
    /// The chosen table.
    pub table: Table,
    /// Why it was chosen and what it holds.
    pub choice: Choice,
    /// Expanded uncertainty (k = 2) of the measurement that judged, mm.
    pub guard_mm: f64,
}

/// Why there are no grids.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// No stations to build on.
    #[error(
        "no paired station is left to build a grid on; look at the rejects for what was left out"
    )]
    NoStations,
    /// A step that fits into the box along no axis or only some.
    #[error(
        "step {step_mm} mm does not fit into the box of {sizes} mm: every step has to fit at least once along each \
         axis; choose smaller steps_mm or a larger box"
    )]
    StepTooLarge {
        /// The step.
        step_mm: f64,
        /// The box's sizes.
        sizes: String,
    },
    /// Neither source could give a table.
    #[error("no source could give a table: {reason}")]
    NoTable {
        /// Why.
        reason: String,
    },
}

/// Everything grids are built and judged on.
#[derive(Clone, Copy)]
pub struct GridInput<'a> {
    /// The stations, with their errors and folds.
    pub stations: &'a [GridStation],
    /// For each fold, a model that did not see its stations.
    pub folds: &'a [&'a dyn ErrorModel],
    /// The model of all stations, for the published table.
    pub model: &'a dyn ErrorModel,
    /// Expanded uncertainty (k = 2) of the measurement that judges, mm: verdicts are guarded by it.
    pub guard_mm: f64,
}

/// Judges every step and builds the table of the one chosen.
pub fn grids(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    settings: &GridSettings,
    tolerance: &Tolerance,
    progress: &dyn Progress,
) -> Result<Grids, GridError> {
    let plan = settings.plan(input.stations)?;
    let like: Vec<&GridStation> = input
        .stations
        .iter()
        .filter(|station| station.configuration == plan.configuration)
        .collect();
    progress.begin("grid steps", settings.steps_mm.len() as u64);
    let mut judged = Vec::new();
    for &step_mm in &settings.steps_mm {
        let lattice =
            Lattice::new(&plan.bounds, [step_mm; 3]).ok_or_else(|| plan.too_large(step_mm))?;
        let grid = PlacedGrid::new(reach, lattice, plan.orientation, &like);
        let cells = judge::local_cells(reach, input.stations, [step_mm; 3]);
        for &interpolation in &settings.interpolations {
            if settings.sources.contains(&Source::Model) {
                judged.push(local_row(
                    input,
                    step_mm,
                    &cells,
                    interpolation,
                    settings,
                    tolerance,
                ));
                judged.push(table_row(
                    input,
                    step_mm,
                    &grid,
                    &plan,
                    interpolation,
                    settings,
                    tolerance,
                ));
            }
            if settings.sources.contains(&Source::Measured) {
                judged.push(measured_row(
                    input,
                    step_mm,
                    interpolation,
                    settings,
                    tolerance,
                ));
            }
        }
        progress.advance(1);
    }
    progress.end();
    let choice = choose::choose(&judged)?;
    judged[choice.row].chosen = true;
    let table = table(input, reach, &plan, &like, &judged[choice.row], settings)?;
    Ok(Grids {
        judged,
        table,
        choice,
        guard_mm: input.guard_mm,
    })
}

fn local_row(
    input: &GridInput<'_>,
    step_mm: f64,
    cells: &[judge::LocalCell],
    interpolation: Interpolation,
    settings: &GridSettings,
    tolerance: &Tolerance,
) -> Judged {
    let step = [step_mm; 3];
    let held_out = judge::by_local_cell(
        input.stations,
        cells,
        input.folds,
        &step,
        interpolation,
        settings.idw_power,
    );
    let refused_cells = held_out.refused.clone();
    let frame = Row {
        step_mm,
        source: Source::Model,
        interpolation,
        judgement: Judgement::LocalCell,
    };
    let counts = Counts {
        nodes: 8 * cells.len(),
        cells: cells.len(),
        refused_cells,
        ..Counts::default()
    };
    frame.judged(counts, held_out, tolerance, input.guard_mm)
}

fn table_row(
    input: &GridInput<'_>,
    step_mm: f64,
    grid: &PlacedGrid,
    plan: &settings::GridPlan,
    interpolation: Interpolation,
    settings: &GridSettings,
    tolerance: &Tolerance,
) -> Judged {
    let like = |station: &GridStation| plan.is_like(station);
    let held_out = judge::by_table(
        input.stations,
        grid,
        like,
        input.folds,
        interpolation,
        settings.idw_power,
    );
    let frame = Row {
        step_mm,
        source: Source::Model,
        interpolation,
        judgement: Judgement::Table,
    };
    let counts = Counts {
        nodes: grid.nodes.len(),
        refused_nodes: grid.refused_nodes(),
        cells: grid.lattice.cell_count(),
        refused_cells: grid.refused_cells(),
    };
    frame.judged(counts, held_out, tolerance, input.guard_mm)
}

fn measured_row(
    input: &GridInput<'_>,
    step_mm: f64,
    interpolation: Interpolation,
    settings: &GridSettings,
    tolerance: &Tolerance,
) -> Judged {
    let frame = Row {
        step_mm,
        source: Source::Measured,
        interpolation,
        judgement: Judgement::Table,
    };
    let not_shown = |reason: String| Judged {
        verdict: Verdict::NotShown(reason),
        ..frame.empty()
    };
    let own = match MeasuredGrid::of(input.stations) {
        Ok(own) => own,
        Err(reason) => return not_shown(format!("the session is not on a grid: {reason}")),
    };
    let Some(multiples) = own.multiples(step_mm) else {
        let [x, y, z] = own.lattice.step;
        return not_shown(format!(
            "the step is no multiple of the pitch {x:.1} × {y:.1} × {z:.1} mm with a cell left"
        ));
    };
    let held_out = own.judge(input.stations, multiples, interpolation, settings.idw_power);
    let Some(first) = own.decimated(multiples, [0; 3]) else {
        return not_shown("the decimated grid has no cell".to_owned());
    };
    let unmeasured = first.nodes.iter().filter(|node| node.is_none()).count();
    let refused = |count: usize| {
        (count > 0)
            .then_some((Refusal::Unmeasured, count))
            .into_iter()
            .collect()
    };
    let counts = Counts {
        nodes: first.nodes.len(),
        refused_nodes: refused(unmeasured),
        cells: first.lattice.cell_count(),
        refused_cells: held_out.refused.clone(),
    };
    frame.judged(counts, held_out, tolerance, input.guard_mm)
}

/// What names a row.
#[derive(Clone, Copy)]
struct Row {
    step_mm: f64,
    source: Source,
    interpolation: Interpolation,
    judgement: Judgement,
}

#[derive(Default)]
struct Counts {
    nodes: usize,
    refused_nodes: std::collections::BTreeMap<Refusal, usize>,
    cells: usize,
    refused_cells: std::collections::BTreeMap<Refusal, usize>,
}

impl Row {
    fn empty(self) -> Judged {
        Judged {
            step_mm: self.step_mm,
            source: self.source,
            interpolation: self.interpolation,
            judgement: self.judgement,
            nodes: 0,
            refused_nodes: std::collections::BTreeMap::new(),
            cells: 0,
            refused_cells: std::collections::BTreeMap::new(),
            held_out: HeldOut::default(),
            figures: None,
            bound: None,
            verdict: Verdict::NotShown(String::new()),
            chosen: false,
        }
    }

    fn judged(
        self,
        counts: Counts,
        held_out: HeldOut,
        tolerance: &Tolerance,
        guard_mm: f64,
    ) -> Judged {
        let bound =
            upper_tolerance_bound_of(&held_out.norms, held_out.stations, tolerance.coverage());
        Judged {
            nodes: counts.nodes,
            refused_nodes: counts.refused_nodes,
            cells: counts.cells,
            refused_cells: counts.refused_cells,
            figures: Figures::of(&held_out.norms),
            bound,
            verdict: tolerance.verdict(bound, held_out.stations, guard_mm),
            held_out,
            ..self.empty()
        }
    }
}

/// The nodes of the chosen row, with their values and covariances.
fn table(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    plan: &settings::GridPlan,
    like: &[&GridStation],
    chosen: &Judged,
    settings: &GridSettings,
) -> Result<Table, GridError> {
    let (lattice, nodes) = match chosen.source {
        Source::Model => model_nodes(input, reach, plan, like, chosen.step_mm)?,
        Source::Measured => measured_nodes(input, plan, chosen.step_mm)?,
    };
    Ok(Table {
        step_mm: chosen.step_mm,
        lattice,
        orientation: plan.orientation,
        configuration: plan.configuration,
        source: chosen.source,
        interpolation: chosen.interpolation,
        idw_power: settings.idw_power,
        orientation_tolerance_rad: settings.orientation_tolerance_deg.to_radians(),
        nodes,
    })
}

fn model_nodes(
    input: &GridInput<'_>,
    reach: &Reach<'_>,
    plan: &settings::GridPlan,
    like: &[&GridStation],
    step_mm: f64,
) -> Result<(Lattice, Vec<TableNode>), GridError> {
    let lattice =
        Lattice::new(&plan.bounds, [step_mm; 3]).ok_or_else(|| plan.too_large(step_mm))?;
    let grid = PlacedGrid::new(reach, lattice, plan.orientation, like);
    let nodes = grid.nodes.into_iter().map(|node| TableNode {
        error: node
            .joints
            .as_ref()
            .map(|joints| input.model.error_with_covariance(joints))
            .map_err(|refusal| *refusal),
        joints: node.joints,
        nearest_mm: node.nearest_mm,
    });
    Ok((lattice, nodes.collect()))
}

fn measured_nodes(
    input: &GridInput<'_>,
    plan: &settings::GridPlan,
    step_mm: f64,
) -> Result<(Lattice, Vec<TableNode>), GridError> {
    let no_table = |reason: String| GridError::NoTable { reason };
    let own = MeasuredGrid::of(input.stations).map_err(|reason| no_table(reason.to_string()))?;
    let multiples = own
        .multiples(step_mm)
        .ok_or_else(|| no_table(format!("{step_mm} mm is no multiple of the pitch")))?;
    let grid = own
        .decimated(multiples, [0; 3])
        .ok_or_else(|| no_table("no cell is left".to_owned()))?;
    let variance = (input.guard_mm / 2.0).powi(2);
    let refused = |refusal: Refusal, nearest_mm: f64| TableNode {
        joints: Err(refusal),
        error: Err(refusal),
        nearest_mm,
    };
    let node = |place: &Option<usize>| match place.map(|place| &input.stations[place]) {
        None => refused(Refusal::Unmeasured, f64::INFINITY),
        Some(station) if station.configuration != plan.configuration => {
            refused(Refusal::OtherConfiguration, 0.0)
        }
        Some(station) => TableNode {
            joints: Ok(station.joints.clone()),
            error: Ok((station.error, Matrix3::identity() * variance)),
            nearest_mm: 0.0,
        },
    };
    Ok((grid.lattice, grid.nodes.iter().map(node).collect()))
}
