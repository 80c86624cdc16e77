//! The rows of the step table: one judgement of one step, source and interpolation each.

use std::collections::BTreeMap;

use super::choose::Tolerance;
use super::interpolation::Interpolation;
use super::judge::{self, HeldOut};
use super::measured::MeasuredGrid;
use super::node::{GridStation, PlacedGrid, Refusal};
use super::settings::{GridPlan, GridSettings};
use super::{GridError, GridInput, Judged, Judgement, Source, Verdict};
use crate::figures::Figures;

pub(super) fn local_row(
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

pub(super) fn table_row(
    input: &GridInput<'_>,
    step_mm: f64,
    grid: Result<&PlacedGrid, &GridError>,
    plan: &GridPlan,
    interpolation: Interpolation,
    settings: &GridSettings,
    tolerance: &Tolerance,
) -> Judged {
    let frame = Row {
        step_mm,
        source: Source::Model,
        interpolation,
        judgement: Judgement::Table,
    };
    let grid = match grid {
        Ok(grid) => grid,
        Err(reason) => {
            return Judged {
                verdict: Verdict::NotShown(reason.to_string()),
                ..frame.empty()
            };
        }
    };
    let like = |station: &GridStation| plan.is_like(station);
    let held_out = judge::by_table(
        input.stations,
        grid,
        like,
        input.folds,
        interpolation,
        settings.idw_power,
    );
    let counts = Counts {
        nodes: grid.nodes.len(),
        refused_nodes: grid.refused_nodes(),
        cells: grid.lattice.cell_count(),
        refused_cells: grid.refused_cells(),
    };
    frame.judged(counts, held_out, tolerance, input.guard_mm)
}

pub(super) fn measured_row(
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

/// The row of the chosen table, judged by another session.
pub(super) fn session_row(
    chosen: &Judged,
    session: &str,
    held_out: HeldOut,
    tolerance: &Tolerance,
    guard_mm: f64,
) -> Judged {
    let frame = Row {
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
    Judged {
        of_test: Some(session.to_owned()),
        ..frame.judged(counts, held_out, tolerance, guard_mm)
    }
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
    refused_nodes: BTreeMap<Refusal, usize>,
    cells: usize,
    refused_cells: BTreeMap<Refusal, usize>,
}

impl Row {
    fn empty(self) -> Judged {
        Judged {
            step_mm: self.step_mm,
            source: self.source,
            interpolation: self.interpolation,
            judgement: self.judgement,
            of_test: None,
            nodes: 0,
            refused_nodes: BTreeMap::new(),
            cells: 0,
            refused_cells: BTreeMap::new(),
            held_out: HeldOut::default(),
            figures: None,
            bound: None,
            bound_of_session: None,
            verdict: Verdict::NotShown(String::new()),
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
        let bound_of_session = held_out.by_pose.bound(tolerance.coverage());
        // Never less than what was seen.
        let between_sessions =
            std::mem::take(&mut held_out.between_sessions).bound(tolerance.coverage());
        let bound = bound_of_session
            .map(|own| between_sessions.map_or(own, |between_sessions| own.max(between_sessions)));
        Judged {
            nodes: counts.nodes,
            refused_nodes: counts.refused_nodes,
            cells: counts.cells,
            refused_cells: counts.refused_cells,
            figures: Figures::of(&held_out.norms),
            bound,
            bound_of_session,
            verdict: tolerance.verdict(bound, held_out.counted(), guard_mm),
            held_out,
            ..self.empty()
        }
    }
}
