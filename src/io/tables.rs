//! What a piece of work found → its published tables: one file here for each table, one function for each file.
//!
//! Inputs are the domain structs of [`Outcome`] and what the pipeline file says besides ([`PublishContext`]); outputs are
//! checked [`Table`]s. [`publish`] writes all of a run and then the row of `runs` that makes it exist:
//! 1. for each session: `stations`, `rejects`, `clocks`, and `logs` where asked for;
//! 2. of the run: `calibrations`, `parameters`, `scales`, `joint_errors`, `residuals`, `semivariograms`, `grid_steps`,
//!    `compensation`, `accuracy`;
//! 3. the run's page, made of all these tables ([`super::page`]);
//! 4. `runs`, with what came into each stage and what became of it ([`counts`]).

pub mod accuracy;
pub mod calibrations;
pub mod clocks;
pub mod compensation;
pub mod counts;
pub mod drift;
pub mod grid_steps;
pub mod history;
pub mod joint_errors;
pub mod logs;
pub mod parameters;
pub mod rejects;
pub mod residuals;
pub mod sampling_plan;
pub mod scales;
pub mod semivariograms;
pub mod stations;
#[cfg(test)]
mod tests;
mod validity;
mod words;

use thiserror::Error;

use super::lake::{Commit, LakeError, OpenRun};
use super::page::{self, About, Said};
use super::schema::SchemaError;
use super::table::{Table, TableError};
use crate::compensation::Conditions;
use crate::fit::FitSettings;
use crate::fit::full::FullSettings;
use crate::geometry::{Base, Command, Transform};
use crate::grid::Tolerance;
use crate::ingest::PosesError;
use crate::kinematics::Arm;
use crate::manifest::{ManifestError, Outcome as Ending, Replaced, RunKey, Work};
use crate::pipeline::outcome::{JoinedSession, Outcome};
use crate::report;
use crate::report::{Angles, Model, Split};

/// What tables say besides what the stages found.
#[derive(Debug, Clone)]
pub struct PublishContext<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// The frame of commands, in which the compensation table is stated.
    pub command_from_base: Transform<Command, Base>,
    /// `[fit]`.
    pub fit: &'a FitSettings,
    /// `[fit.full]`.
    pub full: &'a FullSettings,
    /// `[tolerance]`.
    pub tolerance: Tolerance,
    /// What the grids are of.
    pub grid: GridBasis,
    /// Variance per axis of measurement and repeatability, to hold a nugget against, mm².
    pub noise_mm2: Option<f64>,
    /// What the results are valid for, as the pipeline file states it.
    pub valid_for: Conditions,
    /// The run that this one takes the place of.
    pub replaces: Option<Replaced>,
}

/// What node values of the grids come from, and how they were judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridBasis {
    /// The model of source `model`.
    pub model: Model,
    /// The joint angles it was given at the nodes.
    pub angles: Angles,
    /// How the stations that judge were kept from training.
    pub split: Split,
    /// Expanded uncertainty (k = 2) that guards verdicts, mm.
    pub guard_mm: f64,
}

/// Why tables cannot be made or published.
#[derive(Debug, Error)]
pub enum PublishError {
    /// Values break a table's contract.
    #[error(transparent)]
    Table(#[from] TableError),
    /// No such table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// The lake cannot be written.
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The counts do not balance, or the row of `runs` cannot be made.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A model cannot be written down.
    #[error(
        "cannot write the model down as JSON: {0}; this is a defect of posegrid, please report it"
    )]
    Model(#[from] serde_json::Error),
    /// Poses that were spilled to disk cannot be read back.
    #[error(transparent)]
    Poses(#[from] PosesError),
}

/// Writes every table of a run, its page, and then its row of `runs`. Its `logs`, if any, were written and kept before.
pub fn publish(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    mut run: OpenRun<'_>,
    work: &Work,
    said: &Said,
) -> Result<Commit, PublishError> {
    let tables = publish_tables(outcome, context, &mut run)?;
    let counts = counts::counts(outcome);
    let about = About {
        work,
        tolerance: context.tolerance,
        choice: &outcome.grids.choice.words,
        verdict: &outcome.verdict,
        counts: &counts,
        written: run.written(),
        said,
    };
    let html = report::page::html(&page::content(&tables, &about));
    run.publish_page(&html)?;
    let row = work.runs_table(&counts, run.written(), &ending(outcome, context))?;
    Ok(run.commit(&row)?)
}

/// Writes the tables and gives them for the page.
fn publish_tables(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    run: &mut OpenRun<'_>,
) -> Result<Vec<Table>, PublishError> {
    let key = run.key().clone();
    run.publish_kept()?;
    let mut tables = Vec::new();
    for session in outcome.training.iter().chain(&outcome.test) {
        tables.extend(of_session(
            session,
            context,
            &key.of_session(&session.name),
        )?);
    }
    tables.extend(of_run(outcome, context, &key)?);
    for table in &tables {
        run.publish(table)?;
    }
    Ok(tables)
}

/// The tables of one session.
pub fn of_session(
    session: &JoinedSession,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<[Table; 3], PublishError> {
    Ok([
        stations::stations(session, context.arm, key)?,
        rejects::rejects(session, key)?,
        clocks::clocks(&session.joined.clock, key)?,
    ])
}

/// The tables of the run as a whole.
pub fn of_run(
    outcome: &Outcome<'_>,
    context: &PublishContext<'_>,
    key: &RunKey,
) -> Result<[Table; 9], PublishError> {
    Ok([
        calibrations::calibrations(outcome, context, key)?,
        parameters::parameters(outcome, context, key)?,
        scales::scales(&outcome.scales, key)?,
        joint_errors::joint_errors(outcome, context, key)?,
        residuals::residuals(&outcome.residuals, key)?,
        semivariograms::semivariograms(&outcome.semivariograms, context.noise_mm2, key)?,
        grid_steps::grid_steps(outcome, context, key)?,
        compensation::compensation(outcome, context, key)?,
        accuracy::accuracy(
            outcome.accuracy.iter().chain(&outcome.at_tip),
            &outcome.verdict,
            &outcome.iso_9283,
            &context.tolerance,
            key,
        )?,
    ])
}

fn ending(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Ending {
    Ending {
        verdict: words::verdict(&outcome.verdict.verdict()).to_owned(),
        reason: outcome.verdict.reason(),
        replaces: context.replaces.clone(),
    }
}
