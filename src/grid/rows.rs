//! The rows of the step table: one judgement of one step, source and interpolation each.
//!
//! What the nodes of each answer ([`StepAnswers`]) is one half, and costs; what a tolerance makes of it ([`Judged::by`]) is the other.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::answers::{Answers, ByNumber};
use super::choose::Tolerance;
use super::covered::Covered;
use super::interpolation::Interpolation;
use super::judge::{self, HeldOut};
use super::lattice::Lattice;
use super::measured::{MeasuredGrid, NotOnGrid};
use super::node::{GridStation, PlacedGrid, Reach, Refusal};
use super::settings::{GridPlan, GridSettings, NotJudged};
use super::{GridInput, Judged, Judgement, Source, Verdict};
use crate::figures::{Coverage, Figures, PoseErrors};
use crate::progress::Progress;

/// A row of the step table before a tolerance judges it: where its nodes are, and what they answer at held-out stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepAnswers {
    /// The step asked for, mm.
    pub step_mm: f64,
    /// Source of node values.
    pub source: Source,
    /// Interpolation inside a cell.
    pub interpolation: Interpolation,
    /// The way in which it is judged.
    pub judgement: Judgement,
    /// The reason why there is nothing to judge; `None` where there is.
    pub why_not: Option<String>,
    /// Where the nodes of its table are, in the base frame; `None` for local cells and where there is no table.
    pub lattice: Option<Lattice>,
    /// Pitch along each axis of the base frame, mm; `None` where the step does not fit.
    pub pitch_mm: Option<[f64; 3]>,
    /// Number of nodes of the grid; for local cells, eight for each cell.
    pub nodes: usize,
    /// Number of refused nodes, by reason.
    pub refused_nodes: BTreeMap<Refusal, usize>,
    /// Number of cells of the grid.
    pub cells: usize,
    /// Number of refused cells, by reason.
    pub refused_cells: BTreeMap<Refusal, usize>,
    /// The stations and the part of the box that its table covers; `None` where it has no table.
    pub covered: Option<Covered>,
    /// Its answers.
    pub answers: Answers,
}

/// Everything that all rows of a session are made from.
pub(super) struct Judging<'j> {
    /// Stations and models.
    pub(super) input: &'j GridInput<'j>,
    /// `[grid]`.
    pub(super) settings: &'j GridSettings,
    /// Box, orientation and configuration.
    pub(super) plan: &'j GridPlan,
    /// The arm's inverse kinematics.
    pub(super) reach: &'j Reach<'j>,
    /// Stations of the table's configuration: where the inverse kinematics starts.
    pub(super) like: &'j [&'j GridStation],
    /// The session's own grid, or why it has none.
    pub(super) own: &'j Result<MeasuredGrid, NotOnGrid>,
}

impl Judging<'_> {
    /// The rows of every step.
    pub(super) fn answers(&self, progress: &dyn Progress) -> Vec<StepAnswers> {
        let steps = &self.settings.steps_mm;
        progress.begin("grid steps", steps.len() as u64);
        let mut answers = Vec::new();
        for &step_mm in steps {
            answers.extend(self.of_step(step_mm));
            progress.advance(1);
        }
        progress.end();
        answers
    }

    /// The rows of one step: of model nodes and of measured ones, by each interpolation.
    pub(super) fn of_step(&self, step_mm: f64) -> Vec<StepAnswers> {
        let sources = &self.settings.sources;
        let mut rows = Vec::new();
        if sources.contains(&Source::Model) {
            match self.plan.lattice(step_mm, &self.settings.steps_mm) {
                Ok(lattice) => rows.extend(self.by_model(step_mm, lattice)),
                Err(reason) => rows.extend(self.not_judged(step_mm, &reason)),
            }
        }
        if sources.contains(&Source::Measured) {
            let row = |&interpolation: &Interpolation| self.measured_row(step_mm, interpolation);
            rows.extend(self.settings.interpolations.iter().map(row));
        }
        rows
    }

    /// A step of model nodes: by local cells, and by the table.
    fn by_model(&self, step_mm: f64, lattice: Lattice) -> Vec<StepAnswers> {
        let cells = judge::local_cells(self.reach, self.input.stations, lattice.step);
        let grid = PlacedGrid::new(self.reach, lattice, self.plan.orientation, self.like);
        let serves = |vertices: &[usize; 8]| grid.usable(vertices).is_ok();
        let covered = Covered::of(&lattice, self.plan, self.input.stations, serves);
        let both = |&interpolation: &Interpolation| {
            let row = |judgement| Row {
                step_mm,
                source: Source::Model,
                interpolation,
                judgement,
            };
            [
                self.local_row(row(Judgement::LocalCell), &lattice, &cells),
                self.table_row(row(Judgement::Table), &grid, covered),
            ]
        };
        self.settings.interpolations.iter().flat_map(both).collect()
    }

    /// The rows of a step that is not judged on model nodes, with the reason.
    fn not_judged(&self, step_mm: f64, reason: &NotJudged) -> Vec<StepAnswers> {
        let row = |interpolation, judgement| {
            let row = Row {
                step_mm,
                source: Source::Model,
                interpolation,
                judgement,
            };
            StepAnswers {
                pitch_mm: reason.pitch_mm(),
                ..row.without(reason.to_string())
            }
        };
        let both = |&interpolation: &Interpolation| {
            [Judgement::LocalCell, Judgement::Table].map(|judgement| row(interpolation, judgement))
        };
        self.settings.interpolations.iter().flat_map(both).collect()
    }

    fn local_row(&self, row: Row, lattice: &Lattice, cells: &[judge::LocalCell]) -> StepAnswers {
        let answers = judge::by_local_cell(
            self.input.stations,
            cells,
            self.input.folds,
            &lattice.step,
            row.interpolation,
            self.settings.idw_power,
        );
        StepAnswers {
            pitch_mm: Some(lattice.step),
            nodes: 8 * cells.len(),
            cells: cells.len(),
            refused_cells: answers.refused.clone(),
            ..row.with(answers)
        }
    }

    fn table_row(&self, row: Row, grid: &PlacedGrid, covered: Covered) -> StepAnswers {
        let answers = judge::by_table(
            self.input.stations,
            grid,
            |station| self.plan.is_like(station),
            self.input.folds,
            row.interpolation,
            self.settings.idw_power,
        );
        StepAnswers {
            lattice: Some(grid.lattice),
            pitch_mm: Some(grid.lattice.step),
            nodes: grid.nodes.len(),
            refused_nodes: grid.refused_nodes(),
            cells: grid.lattice.cell_count(),
            refused_cells: grid.refused_cells(),
            covered: Some(covered),
            ..row.with(answers)
        }
    }

    fn measured_row(&self, step_mm: f64, interpolation: Interpolation) -> StepAnswers {
        let row = Row {
            step_mm,
            source: Source::Measured,
            interpolation,
            judgement: Judgement::Table,
        };
        let own = match self.own {
            Ok(own) => own,
            Err(reason) => {
                return row.without(format!("the session is not on a grid: {reason}"));
            }
        };
        let Some(multiples) = own.multiples(step_mm) else {
            let [x, y, z] = own.lattice.step;
            return row.without(format!(
                "the step is no multiple of the pitch {x:.1} × {y:.1} × {z:.1} mm with a cell left"
            ));
        };
        let Some(first) = own.decimated(multiples, [0; 3]) else {
            return row.without("the decimated grid has no cell".to_owned());
        };
        let (stations, power) = (self.input.stations, self.settings.idw_power);
        let answers = own.answers(stations, multiples, interpolation, power);
        let unmeasured = first.nodes.iter().filter(|node| node.is_none()).count();
        let refused = (unmeasured > 0).then_some((Refusal::Unmeasured, unmeasured));
        let configuration = self.plan.configuration;
        let serves =
            |vertices: &[usize; 8]| first.serving(vertices, stations, configuration).is_ok();
        StepAnswers {
            lattice: Some(first.lattice),
            pitch_mm: Some(first.lattice.step),
            nodes: first.nodes.len(),
            refused_nodes: refused.into_iter().collect(),
            cells: first.lattice.cell_count(),
            refused_cells: answers.refused.clone(),
            covered: Some(Covered::of(&first.lattice, self.plan, stations, serves)),
            ..row.with(answers)
        }
    }
}

/// The row of the chosen table, judged by the stations of another session.
pub(super) fn session_row(
    chosen: &Judged,
    session: &str,
    held_out: HeldOut,
    tolerance: &Tolerance,
    guard_mm: f64,
) -> Judged {
    let answered = held_out.norms.len();
    let like = answered + held_out.outside + held_out.refused.values().sum::<usize>();
    let covered = chosen.covered.map(|own| Covered {
        stations: answered,
        like,
        measured: like + held_out.unlike,
        of_box: own.of_box,
    });
    Judged {
        of_test: Some(session.to_owned()),
        covered,
        chosen: false,
        ..chosen.clone()
    }
    .with(held_out, tolerance, guard_mm)
}

/// The columns that identify a row.
#[derive(Clone, Copy)]
struct Row {
    step_mm: f64,
    source: Source,
    interpolation: Interpolation,
    judgement: Judgement,
}

impl Row {
    /// A row with its answers, and nothing yet of where they come from.
    fn with(self, mut answers: Answers) -> StepAnswers {
        answers.given.sort_by_key(|own| (own.sample, own.station));
        StepAnswers {
            step_mm: self.step_mm,
            source: self.source,
            interpolation: self.interpolation,
            judgement: self.judgement,
            why_not: None,
            lattice: None,
            pitch_mm: None,
            nodes: 0,
            refused_nodes: BTreeMap::new(),
            cells: 0,
            refused_cells: BTreeMap::new(),
            covered: None,
            answers,
        }
    }

    /// A row that says why there is nothing to judge.
    fn without(self, reason: String) -> StepAnswers {
        StepAnswers {
            why_not: Some(reason),
            ..self.with(Answers::default())
        }
    }
}

impl Judged {
    /// A row as a tolerance judges it.
    pub(super) fn by(
        tolerance: &Tolerance,
        step: &StepAnswers,
        stations: &ByNumber<'_>,
        guard_mm: f64,
    ) -> Self {
        let row = Self {
            step_mm: step.step_mm,
            source: step.source,
            interpolation: step.interpolation,
            judgement: step.judgement,
            of_test: None,
            lattice: step.lattice,
            pitch_mm: step.pitch_mm,
            nodes: step.nodes,
            refused_nodes: step.refused_nodes.clone(),
            cells: step.cells,
            refused_cells: step.refused_cells.clone(),
            covered: step.covered,
            held_out: HeldOut::default(),
            figures: None,
            bound: None,
            bound_of_session: None,
            model_bound: None,
            verdict: Verdict::NotShown(step.why_not.clone().unwrap_or_default()),
            chosen: false,
        };
        if step.why_not.is_some() {
            return row;
        }
        row.with(
            HeldOut::left_by(&step.answers, stations),
            tolerance,
            guard_mm,
        )
    }

    /// The row judged by what is left of errors on held-out stations.
    fn with(self, mut held_out: HeldOut, tolerance: &Tolerance, guard_mm: f64) -> Self {
        let asked = tolerance.coverage();
        let between_sessions = std::mem::take(&mut held_out.between_sessions);
        let direct = std::mem::take(&mut held_out.direct_by_pose);
        let direct_another_day = std::mem::take(&mut held_out.direct_another_day);
        let bound = wider(&held_out.by_pose, &between_sessions, asked);
        Self {
            figures: Figures::of(&held_out.norms),
            bound,
            bound_of_session: held_out.by_pose.bound(asked),
            model_bound: wider(&direct, &direct_another_day, asked),
            verdict: tolerance.verdict(bound, held_out.counted(), guard_mm),
            held_out,
            ..self
        }
    }
}

/// The bound of errors with between-session variation, never less than what was seen; `None` with too few poses.
fn wider(seen: &PoseErrors, between_sessions: &PoseErrors, asked: Coverage) -> Option<f64> {
    let seen = seen.bound(asked)?;
    let between_sessions = between_sessions.bound(asked);
    Some(between_sessions.map_or(seen, |between_sessions| seen.max(between_sessions)))
}
