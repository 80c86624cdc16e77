//! The rows of the step table: one judgement of one step, source and interpolation each.

use std::collections::BTreeMap;

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

/// Everything that all rows of a session are made from.
pub(super) struct Judging<'j> {
    /// Stations and models.
    pub(super) input: &'j GridInput<'j>,
    /// The tolerance: limit, share of positions and confidence.
    pub(super) tolerance: &'j Tolerance,
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
    /// The rows of one step: of model nodes and of measured ones, by each interpolation.
    pub(super) fn of_step(&self, step_mm: f64) -> Vec<Judged> {
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
    fn by_model(&self, step_mm: f64, lattice: Lattice) -> Vec<Judged> {
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
    fn not_judged(&self, step_mm: f64, reason: &NotJudged) -> Vec<Judged> {
        let row = |interpolation, judgement| {
            let row = Row {
                step_mm,
                source: Source::Model,
                interpolation,
                judgement,
            };
            Judged {
                pitch_mm: reason.pitch_mm(),
                ..row.not_shown(reason.to_string())
            }
        };
        let both = |&interpolation: &Interpolation| {
            [Judgement::LocalCell, Judgement::Table].map(|judgement| row(interpolation, judgement))
        };
        self.settings.interpolations.iter().flat_map(both).collect()
    }

    fn local_row(&self, row: Row, lattice: &Lattice, cells: &[judge::LocalCell]) -> Judged {
        let held_out = judge::by_local_cell(
            self.input.stations,
            cells,
            self.input.folds,
            &lattice.step,
            row.interpolation,
            self.settings.idw_power,
        );
        let counts = Counts {
            nodes: 8 * cells.len(),
            cells: cells.len(),
            refused_cells: held_out.refused.clone(),
            ..Counts::default()
        };
        Judged {
            pitch_mm: Some(lattice.step),
            ..row.judged(counts, held_out, self.tolerance, self.input.guard_mm)
        }
    }

    fn table_row(&self, row: Row, grid: &PlacedGrid, covered: Covered) -> Judged {
        let held_out = judge::by_table(
            self.input.stations,
            grid,
            |station| self.plan.is_like(station),
            self.input.folds,
            row.interpolation,
            self.settings.idw_power,
        );
        let counts = Counts {
            nodes: grid.nodes.len(),
            refused_nodes: grid.refused_nodes(),
            cells: grid.lattice.cell_count(),
            refused_cells: grid.refused_cells(),
        };
        Judged {
            lattice: Some(grid.lattice),
            pitch_mm: Some(grid.lattice.step),
            covered: Some(covered),
            ..row.judged(counts, held_out, self.tolerance, self.input.guard_mm)
        }
    }

    fn measured_row(&self, step_mm: f64, interpolation: Interpolation) -> Judged {
        let row = Row {
            step_mm,
            source: Source::Measured,
            interpolation,
            judgement: Judgement::Table,
        };
        let own = match self.own {
            Ok(own) => own,
            Err(reason) => {
                return row.not_shown(format!("the session is not on a grid: {reason}"));
            }
        };
        let Some(multiples) = own.multiples(step_mm) else {
            let [x, y, z] = own.lattice.step;
            return row.not_shown(format!(
                "the step is no multiple of the pitch {x:.1} × {y:.1} × {z:.1} mm with a cell left"
            ));
        };
        let Some(first) = own.decimated(multiples, [0; 3]) else {
            return row.not_shown("the decimated grid has no cell".to_owned());
        };
        let (stations, power) = (self.input.stations, self.settings.idw_power);
        let held_out = own.judge(stations, multiples, interpolation, power);
        let unmeasured = first.nodes.iter().filter(|node| node.is_none()).count();
        let refused = (unmeasured > 0).then_some((Refusal::Unmeasured, unmeasured));
        let counts = Counts {
            nodes: first.nodes.len(),
            refused_nodes: refused.into_iter().collect(),
            cells: first.lattice.cell_count(),
            refused_cells: held_out.refused.clone(),
        };
        let configuration = self.plan.configuration;
        let serves =
            |vertices: &[usize; 8]| first.serving(vertices, stations, configuration).is_ok();
        Judged {
            lattice: Some(first.lattice),
            pitch_mm: Some(first.lattice.step),
            covered: Some(Covered::of(&first.lattice, self.plan, stations, serves)),
            ..row.judged(counts, held_out, self.tolerance, self.input.guard_mm)
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
    let row = Row {
        step_mm: chosen.step_mm,
        source: chosen.source,
        interpolation: chosen.interpolation,
        judgement: Judgement::Table,
    };
    let counts = Counts {
        nodes: chosen.nodes,
        refused_nodes: chosen.refused_nodes.clone(),
        cells: chosen.cells,
        refused_cells: chosen.refused_cells.clone(),
    };
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
        lattice: chosen.lattice,
        pitch_mm: chosen.pitch_mm,
        covered,
        ..row.judged(counts, held_out, tolerance, guard_mm)
    }
}

/// The columns that identify a row.
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
    refused_nodes: BTreeMap<Refusal, usize>,
    cells: usize,
    refused_cells: BTreeMap<Refusal, usize>,
}

impl Row {
    /// A row that says why there is nothing to judge.
    fn not_shown(self, reason: String) -> Judged {
        Judged {
            step_mm: self.step_mm,
            source: self.source,
            interpolation: self.interpolation,
            judgement: self.judgement,
            of_test: None,
            lattice: None,
            pitch_mm: None,
            nodes: 0,
            refused_nodes: BTreeMap::new(),
            cells: 0,
            refused_cells: BTreeMap::new(),
            covered: None,
            held_out: HeldOut::default(),
            figures: None,
            bound: None,
            bound_of_session: None,
            model_bound: None,
            verdict: Verdict::NotShown(reason),
            chosen: false,
        }
    }

    fn judged(
        self,
        counts: Counts,
        mut held_out: HeldOut,
        tolerance: &Tolerance,
        guard_mm: f64,
    ) -> Judged {
        let asked = tolerance.coverage();
        let between_sessions = std::mem::take(&mut held_out.between_sessions);
        let direct = std::mem::take(&mut held_out.direct_by_pose);
        let direct_another_day = std::mem::take(&mut held_out.direct_another_day);
        let bound = wider(&held_out.by_pose, &between_sessions, asked);
        Judged {
            nodes: counts.nodes,
            refused_nodes: counts.refused_nodes,
            cells: counts.cells,
            refused_cells: counts.refused_cells,
            figures: Figures::of(&held_out.norms),
            bound,
            bound_of_session: held_out.by_pose.bound(asked),
            model_bound: wider(&direct, &direct_another_day, asked),
            verdict: tolerance.verdict(bound, held_out.counted(), guard_mm),
            held_out,
            ..self.not_shown(String::new())
        }
    }
}

/// The bound of errors with between-session variation, never less than what was seen; `None` with too few poses.
fn wider(seen: &PoseErrors, between_sessions: &PoseErrors, asked: Coverage) -> Option<f64> {
    let seen = seen.bound(asked)?;
    let between_sessions = between_sessions.bound(asked);
    Some(between_sessions.map_or(seen, |between_sessions| seen.max(between_sessions)))
}
