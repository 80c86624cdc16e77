//! `grids`: the steps of an estimate's grids before a tolerance judges them, for runs that differ in what comes after. Its row makes them
//! exist; `grid_errors` has what each step answers at each held-out station.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::Result;
use super::stage_results::{self, FileColumns, MadeColumns, NotRestored, signed};
use crate::grid::answers::Answer;
use crate::grid::{Interpolation, Judgement, Source, StepAnswers};
use crate::lake::Lake;
use crate::manifest::{Input, RunKey, Work, Written};
use crate::rows::{Row as _, row};
use crate::table::Table;

pub const ESTIMATE: &str = "estimate";

row! {
    pub struct GridsRow of "grids" {
        made: MadeColumns,
        estimate: String,
        steps: String,
        files: FileColumns,
        row_digest: Option<String>,
    }
}

row! {
    /// The answer of a step at a held-out station.
    pub struct GridErrorRow of "grid_errors" {
        step_mm: f64,
        source: Source,
        interpolation: Interpolation,
        judgement: Judgement,
        sample: usize,
        station: usize,
        error_mm as [error: point]: [f64; 3],
        model_error_mm as [model_error: point]: Option<[f64; 3]>,
    }
}

/// The work of grids, of which their name follows: the estimate is their input.
pub fn work(robot: &str, session: &str, estimate: &str, settings: String) -> Work {
    let input = Input { name: ESTIMATE.to_owned(), bytes: 0, digest: estimate.to_owned() };
    Work::of_stage(robot, session, Vec::new(), vec![input], settings)
}

pub fn errors(steps: &[StepAnswers], key: &RunKey) -> Result<Table> {
    let of_step = |step: &StepAnswers| {
        let row = |own: &Answer| GridErrorRow {
            step_mm: step.step_mm,
            source: step.source,
            interpolation: step.interpolation,
            judgement: step.judgement,
            sample: own.sample,
            station: own.station,
            error_mm: own.interpolated.into(),
            model_error_mm: own.predicted.map(Into::into),
        };
        step.answers.given.iter().map(row).collect::<Vec<_>>()
    };
    let rows = steps.iter().flat_map(of_step).collect();
    Ok(GridErrorRow::table(rows, key)?.table)
}

/// The table `grids` of the steps of this work, whose answers were written as `written`.
pub fn table(steps: &[StepAnswers], work: &Work, written: &[Written]) -> Result<Table> {
    let estimate = work.inputs.iter().find(|input| input.name == ESTIMATE);
    let row = GridsRow {
        made: work.into(),
        estimate: estimate.map_or_else(String::new, |own| own.digest.clone()),
        steps: serde_json::to_string(steps)?,
        files: written.into(),
        row_digest: None,
    };
    Ok(signed(&work.key(), row, |row, row_digest| GridsRow { row_digest, ..row })?)
}

/// The words that identify a step, and its length by its bits.
type Name = (u64, &'static str, &'static str, bool);

fn name(step_mm: f64, source: Source, by: Interpolation, judgement: Judgement) -> Name {
    let is_table = judgement == Judgement::Table;
    (step_mm.to_bits(), source.name(), by.name(), is_table)
}

pub fn restored(lake: &Lake, key: &RunKey) -> Result<Vec<StepAnswers>, NotRestored> {
    let row: GridsRow = stage_results::row(lake, key)?;
    let mut steps: Vec<StepAnswers> = serde_json::from_str(&row.steps)?;
    let names = steps.iter().enumerate().map(|(place, own)| {
        let name = name(own.step_mm, own.source, own.interpolation, own.judgement);
        (name, place)
    });
    let places: BTreeMap<Name, usize> = names.collect();
    for own in GridErrorRow::read(&lake.read(GridErrorRow::TABLE, key)?) {
        let name = name(own.step_mm, own.source, own.interpolation, own.judgement);
        let place = places.get(&name).ok_or(NotRestored::OtherStep(own.step_mm))?;
        steps[*place].answers.given.push(Answer {
            station: own.station,
            sample: own.sample,
            interpolated: Vector3::from(own.error_mm),
            predicted: own.model_error_mm.map(Vector3::from),
        });
    }
    Ok(steps)
}
