//! The rows of the step table: one judgement of one step, source and interpolation each.
//!
//! What the nodes of each answer ([`StepAnswers`]) is one half, and costs; what a tolerance makes of it ([`Judged::by`]) is the other.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::answers::{Answers, ByNumber};
use super::choose::Tolerance;
use super::covered::Covered;
use super::interpolation::Interpolation;
use super::judge::{self, HeldOut, LocalCell};
use super::lattice::Lattice;
use super::measured::{Decimated, MeasuredGrid, NotOnGrid};
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
    pub source: Source,
    pub interpolation: Interpolation,
    pub judgement: Judgement,
    /// The reason why there is nothing to judge; `None` where there is.
    pub why_not: Option<String>,
    /// Where the nodes of its table are, in the base frame; `None` for local cells and where there is no table.
    pub lattice: Option<Lattice>,
    /// Pitch along each axis of the base frame, mm; `None` where the step does not fit.
    pub pitch_mm: Option<[f64; 3]>,
    /// Number of nodes of the grid; for local cells, eight for each cell.
    pub nodes: usize,
    pub refused_nodes: BTreeMap<Refusal, usize>,
    pub cells: usize,
    pub refused_cells: BTreeMap<Refusal, usize>,
    /// The stations and the part of the box that its table covers; `None` where it has no table, or one whose nodes are not placed.
    pub covered: Option<Covered>,
    /// How much of the interpolation error its stations can show: 0 at nodes, 1 at uniform places; `None` of local cells and
    /// without a station.
    pub interpolation_shown: Option<f64>,
    pub answers: Answers,
}

/// Everything that all rows of a session are made from.
pub(super) struct Judging<'j> {
    pub(super) input: &'j GridInput<'j>,
    pub(super) settings: &'j GridSettings,
    pub(super) plan: &'j GridPlan,
    pub(super) reach: &'j Reach<'j>,
    /// Stations of the table's configuration: where the inverse kinematics starts.
    pub(super) like: &'j [&'j GridStation],
    /// Stations that the table answers for: in its box, of its configuration, and turned from its orientation within the tolerance.
    pub(super) judges: Vec<&'j GridStation>,
    /// Number of poses that a bound needs: with fewer judges the nodes of a step judge nothing.
    pub(super) needed: f64,
    /// The session's own grid, or why it has none.
    pub(super) own: &'j Result<MeasuredGrid, NotOnGrid>,
}

impl Judging<'_> {
    pub(super) fn answers(&self, progress: &dyn Progress) -> Vec<StepAnswers> {
        let steps = &self.settings.steps_mm;
        progress.begin("grid steps", steps.len() as u64);
        let mut answers = Vec::new();
        for &step_mm in steps {
            answers.extend(self.of_step(step_mm, progress));
            progress.advance(1);
        }
        progress.end();
        answers
    }

    /// Whether answers of another run have the nodes that this one places.
    pub(super) fn fit(&self, known: &[StepAnswers]) -> bool {
        let is_table = |own: &&StepAnswers| {
            (own.source, own.judgement) == (Source::Model, Judgement::Table)
                && own.lattice.is_some()
        };
        let mut tables = known.iter().filter(is_table);
        tables.all(|own| own.covered.is_some() == self.is_judged())
    }

    /// Whether enough stations like the table stand in its box for a bound. If not, local cells of all stations choose, each at its own
    /// orientation, and only the nodes of the chosen step are all placed.
    fn is_judged(&self) -> bool {
        self.judges.len() as f64 >= self.needed
    }

    /// The rows of one step: of model nodes and of measured ones, by each interpolation.
    fn of_step(&self, step_mm: f64, progress: &dyn Progress) -> Vec<StepAnswers> {
        let sources = &self.settings.sources;
        let mut rows = Vec::new();
        if sources.contains(&Source::Model) {
            match self.plan.lattice(step_mm, &self.settings.steps_mm) {
                Ok(lattice) => rows.extend(self.by_model(step_mm, lattice, progress)),
                Err(reason) => rows.extend(self.not_judged(step_mm, &reason)),
            }
        }
        if sources.contains(&Source::Measured) {
            rows.extend(self.measured(step_mm));
        }
        rows
    }

    /// A step of model nodes: by local cells, and by the table.
    fn by_model(
        &self,
        step_mm: f64,
        lattice: Lattice,
        progress: &dyn Progress,
    ) -> Vec<StepAnswers> {
        let cells = self.local_cells(lattice.step);
        let some = (!self.is_judged()).then(|| {
            let cells = self.places().filter_map(|place| lattice.locate(place));
            cells.flat_map(|cell| cell.vertices).collect()
        });
        let grid = self.placed(lattice, some.as_ref(), progress);
        let both = |&interpolation: &Interpolation| {
            let row = |judgement| Row { step_mm, source: Source::Model, interpolation, judgement };
            let local = self.by_cells(&lattice.step, &cells, interpolation, None);
            [
                row(Judgement::LocalCell).around(local, lattice.step, cells.len()),
                self.table_row(row(Judgement::Table), &grid, some.is_none()),
            ]
        };
        self.settings.interpolations.iter().flat_map(both).collect()
    }

    /// The nodes of a lattice at the table's orientation, all or `some` by their numbers.
    pub(super) fn placed(
        &self,
        lattice: Lattice,
        some: Option<&BTreeSet<usize>>,
        progress: &dyn Progress,
    ) -> PlacedGrid {
        PlacedGrid::new(self.reach, lattice, self.plan.orientation, self.like, some, progress)
    }

    /// The row of a chosen table whose nodes were not placed to judge it.
    pub(super) fn once_placed(&self, row: &Judged, progress: &dyn Progress) -> Option<StepAnswers> {
        if row.covered.is_some() {
            return None;
        }
        let grid = self.placed(row.lattice?, None, progress);
        let row = Row {
            step_mm: row.step_mm,
            source: row.source,
            interpolation: row.interpolation,
            judgement: row.judgement,
        };
        Some(self.table_row(row, &grid, true))
    }

    /// The stations around which local cells are placed.
    fn around(&self) -> Vec<&GridStation> {
        if self.is_judged() { self.judges.clone() } else { self.input.stations.iter().collect() }
    }

    /// A cell of these pitches around each station.
    fn local_cells(&self, pitch: [f64; 3]) -> Vec<LocalCell> {
        let orientation = self.is_judged().then_some(self.plan.orientation);
        let folds = self.input.folds;
        judge::local_cells(self.reach, &self.around(), folds, pitch, &self.plan.bounds, orientation)
    }

    /// What local cells answer, with node values of the model, or of measured stations (`measured`: what each adds to the model).
    fn by_cells(
        &self,
        pitch: &[f64; 3],
        cells: &[LocalCell],
        interpolation: Interpolation,
        measured: Option<&[Vector3<f64>]>,
    ) -> Answers {
        let around = self.around();
        let power = self.settings.idw_power;
        let unlike = self.input.stations.len() - around.len();
        let found = judge::by_local_cell(&around, cells, pitch, interpolation, power, measured);
        Answers { unlike, ..found }
    }

    /// Second moment of what interpolation adds to the model inside the cells of the `chosen` row's table, base frame, mm²; `None` where no
    /// local cell has an answer. Local cells of model nodes have answered already.
    pub(super) fn interpolation(
        &self,
        lattice: &Lattice,
        chosen: &Judged,
        answers: &[StepAnswers],
    ) -> Option<Matrix3<f64>> {
        let is_its = |own: &&StepAnswers| {
            (own.judgement, own.source) == (Judgement::LocalCell, Source::Model)
                && own.interpolation == chosen.interpolation
                && own.pitch_mm == Some(lattice.step)
        };
        if let Some(own) = answers.iter().find(is_its) {
            return own.answers.interpolation();
        }
        let cells = self.local_cells(lattice.step);
        self.by_cells(&lattice.step, &cells, chosen.interpolation, None).interpolation()
    }

    /// The rows of a step that is not judged on model nodes, with the reason.
    fn not_judged(&self, step_mm: f64, reason: &NotJudged) -> Vec<StepAnswers> {
        let row = |interpolation, judgement| {
            let row = Row { step_mm, source: Source::Model, interpolation, judgement };
            StepAnswers { pitch_mm: reason.pitch_mm(), ..row.without(reason.to_string()) }
        };
        let both = |&interpolation: &Interpolation| {
            [Judgement::LocalCell, Judgement::Table].map(|judgement| row(interpolation, judgement))
        };
        self.settings.interpolations.iter().flat_map(both).collect()
    }

    /// The row of a table of which all nodes are placed, or those alone that its stations need.
    fn table_row(&self, row: Row, grid: &PlacedGrid, is_whole: bool) -> StepAnswers {
        let (stations, lattice) = (self.input.stations, grid.lattice);
        let answers = judge::by_table(
            stations,
            grid,
            |station| self.plan.is_like(station),
            self.input.folds,
            row.interpolation,
            self.settings.idw_power,
        );
        let serves = |vertices: &[usize; 8]| grid.usable(vertices).is_ok();
        let row = StepAnswers {
            lattice: Some(lattice),
            pitch_mm: Some(lattice.step),
            nodes: grid.nodes.len(),
            cells: lattice.cell_count(),
            interpolation_shown: lattice.interpolation_shown(self.places()),
            ..row.with(answers)
        };
        if !is_whole {
            return row;
        }
        StepAnswers {
            refused_nodes: grid.refused_nodes(),
            refused_cells: grid.refused_cells(),
            covered: Some(Covered::of(&lattice, self.plan, stations, serves)),
            ..row
        }
    }

    /// Positions of the stations that the table answers for.
    fn places(&self) -> impl Iterator<Item = &Point3<f64>> {
        self.judges.iter().map(|own| &own.position)
    }

    /// The rows of a step of measured nodes. Where the step is the pitch itself along an axis, no station lies between its nodes there,
    /// so local cells judge beside the decimated grids.
    fn measured(&self, step_mm: f64) -> Vec<StepAnswers> {
        let source = Source::Measured;
        let row = |interpolation, judgement| Row { step_mm, source, interpolation, judgement };
        let interpolations = self.settings.interpolations.iter().copied();
        let (own, multiples, first) = match self.decimated(step_mm) {
            Ok(found) => found,
            Err(reason) => {
                let table = |own| row(own, Judgement::Table).without(reason.clone());
                return interpolations.map(table).collect();
            }
        };
        let is_judged = (0..3).all(|axis| multiples[axis] > 1 || own.lattice.counts[axis] == 2);
        let pitch = first.lattice.step;
        let around = (!is_judged).then(|| {
            let left = judge::left_by_model(&self.around(), self.input.folds);
            left.map(|left| (left, self.local_cells(pitch)))
        });
        let both = |interpolation| {
            let local = around.as_ref().map(|around| {
                let row = row(interpolation, Judgement::LocalCell);
                let Ok((left, cells)) = around else {
                    return row.without("the model has no value at some station".to_owned());
                };
                let answers = self.by_cells(&pitch, cells, interpolation, Some(left));
                row.around(answers, pitch, cells.len())
            });
            let table = row(interpolation, Judgement::Table);
            local.into_iter().chain([self.measured_row(table, own, multiples, &first)])
        };
        interpolations.flat_map(both).collect()
    }

    /// The session's grid, its pitches in the step along each axis, and the grid of nodes so far apart; or why there is none.
    fn decimated(&self, step_mm: f64) -> Result<(&MeasuredGrid, [usize; 3], Decimated), String> {
        let own = self.own.as_ref();
        let own = own.map_err(|reason| format!("the session is not on a grid: {reason}"))?;
        let [x, y, z] = own.lattice.step;
        let multiples = own.multiples(step_mm).ok_or_else(|| {
            format!(
                "the step is no multiple of the pitch {x:.1} × {y:.1} × {z:.1} mm with a cell left"
            )
        })?;
        let first = own.decimated(multiples, [0; 3]);
        Ok((own, multiples, first.ok_or("the decimated grid has no cell")?))
    }

    fn measured_row(
        &self,
        row: Row,
        own: &MeasuredGrid,
        multiples: [usize; 3],
        first: &Decimated,
    ) -> StepAnswers {
        let (stations, power) = (self.input.stations, self.settings.idw_power);
        let (answers, shown) = own.answers(stations, multiples, row.interpolation, power);
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
            interpolation_shown: shown,
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
    interpolation_shown: Option<f64>,
) -> Judged {
    let stations = held_out.norms.len();
    let like = stations + held_out.outside + held_out.refused.values().sum::<usize>();
    let measured = like + held_out.unlike;
    let covered = chosen.covered.map(|own| Covered { stations, like, measured, ..own });
    Judged {
        of_test: Some(session.to_owned()),
        covered,
        interpolation_shown,
        decided_by: Judgement::Table,
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
            interpolation_shown: None,
            answers,
        }
    }

    /// A row of `count` local cells of this pitch, mm.
    fn around(self, answers: Answers, pitch: [f64; 3], count: usize) -> StepAnswers {
        StepAnswers {
            pitch_mm: Some(pitch),
            nodes: 8 * count,
            cells: count,
            refused_cells: answers.refused.clone(),
            ..self.with(answers)
        }
    }

    /// A row that says why there is nothing to judge.
    fn without(self, reason: String) -> StepAnswers {
        StepAnswers { why_not: Some(reason), ..self.with(Answers::default()) }
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
            interpolation_shown: step.interpolation_shown,
            decided_by: step.judgement,
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
        row.with(HeldOut::left_by(&step.answers, stations), tolerance, guard_mm)
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

/// Gives each table the larger of its own bound and that of the local cells of its step, and the verdict on it.
pub(super) fn combine(judged: &mut [Judged], tolerance: &Tolerance, guard_mm: f64) {
    for row in 0..judged.len() {
        let Some(local) = super::local_cells_of(judged, &judged[row]) else { continue };
        let (bound, model_bound) = (local.bound, local.model_bound);
        let counted = local.held_out.counted();
        let table = &mut judged[row];
        if table.bound.is_some_and(|own| bound.is_none_or(|bound| bound > own)) {
            table.bound = bound;
            table.model_bound = model_bound;
            table.decided_by = Judgement::LocalCell;
            table.verdict = tolerance.verdict(bound, counted, guard_mm);
        }
    }
}

/// The bound of errors with between-session variation, never less than what was seen; `None` with too few poses.
fn wider(seen: &PoseErrors, between_sessions: &PoseErrors, asked: Coverage) -> Option<f64> {
    let seen = seen.bound(asked)?;
    let between_sessions = between_sessions.bound(asked);
    Some(between_sessions.map_or(seen, |between_sessions| seen.max(between_sessions)))
}
