//! The results of a piece of work → the rows of its published tables: one file here for each table, one struct for its
//! rows.
//!
//! Inputs are the domain structs of [`Outcome`] and the statements of the pipeline file ([`PublishContext`]); outputs are
//! rows with their checked [`Table`]s:
//! 1. for each session as joined, once for all runs that start from it: `readings`, `joined_sessions`;
//! 2. for each session of a run ([`SessionRows`]): `stations`, `rejects`, `clocks`, `reference_motion`; `logs` are written where they are read ([`logs`]);
//! 3. for the run ([`RunRows`]): `calibrations`, `parameters`, `scales`, `sources`, `references`, `joint_errors`, `residuals`,
//!    `length_residuals`, `semivariograms`, `grid_steps`, `compensation`, `accuracy`.
//!
//! The numbers of items that each stage read, kept and rejected ([`counts`]) are in `runs` ([`runs`]).

pub mod accuracy;
pub mod calibrations;
pub mod clocks;
pub mod compensation;
pub mod counts;
pub mod drift;
pub mod error_frame;
pub mod estimates;
pub mod grid_steps;
pub mod grids;
pub mod history;
pub mod joined_sessions;
pub mod joint_errors;
pub mod length_residuals;
pub mod logs;
pub mod parameters;
pub mod past;
pub mod plan_figures;
pub mod readings;
pub mod references;
pub mod rejects;
pub mod residuals;
pub mod runs;
pub mod sampling_plan;
pub mod scales;
pub mod semivariograms;
pub mod sources;
pub mod stage_results;
pub mod stations;
pub mod validity;
pub mod words;

use thiserror::Error;

use super::lake::LakeError;
use crate::compensation::Conditions;
use crate::fit::FitSettings;
use crate::fit::full::FullSettings;
use crate::geometry::{Base, Command, Transform};
use crate::grid::{Covered, Tolerance};
use crate::ingest::PosesError;
use crate::judgement::{JoinedSession, Outcome};
use crate::kinematics::Arm;
use crate::manifest::{ManifestError, Replaced, RunKey};
use crate::report::compared::{Compared, Pairs};
use crate::rows::{Row, Rows};
use crate::schema::SchemaError;
use crate::table::{Table, TableError};
use accuracy::AccuracyRow;
use calibrations::CalibrationRow;
use clocks::ClockRow;
use compensation::NodeRow;
use grid_steps::StepRow;
use joint_errors::JointErrorRow;
use length_residuals::LengthResidualRow;
use parameters::ParameterRow;
use references::{MotionRow, ReferenceRow};
use rejects::RejectRow;
use residuals::ResidualRow;
use runs::Ending;
use scales::ScaleRow;
use semivariograms::SemivariogramRow;
use sources::SourceRow;
use stations::StationRow;

/// The content of tables that does not come from the stages.
#[derive(Debug, Clone)]
pub struct PublishContext<'a> {
    pub arm: &'a Arm,
    /// The frame of commands, in which the compensation table is stated.
    pub command_from_base: Transform<Command, Base>,
    pub fit: &'a FitSettings,
    /// `[fit.full]`.
    pub full: &'a FullSettings,
    pub tolerance: Tolerance,
    /// Variance per axis of measurement and repeatability, to compare a nugget with, mm²; `None` where it is not known.
    pub noise_mm2: Option<f64>,
    /// The conditions that the results are valid for, as the pipeline file states them.
    pub valid_for: Conditions,
    /// The sessions as joined that the run started from.
    pub made_of: Vec<RunKey>,
    pub estimate: String,
    pub grids: String,
    /// The run that this one replaces; `None` where it replaces none.
    pub replaces: Option<Replaced>,
    pub pairs: Pairs,
}

type Result<T, E = PublishError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum PublishError {
    /// Values break a table's contract.
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Schema(#[from] SchemaError),
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The counts do not balance, or the row of `runs` cannot be made.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    #[error(
        "cannot write the model down as JSON: {0}; this is a defect of posegrid, please report it"
    )]
    Model(#[from] serde_json::Error),
    #[error(transparent)]
    Poses(#[from] PosesError),
}

#[derive(Debug, Clone)]
pub struct SessionRows {
    pub name: String,
    pub stations: Rows<StationRow>,
    pub rejects: Rows<RejectRow>,
    pub clocks: Rows<ClockRow>,
    pub reference_motion: Rows<MotionRow>,
}

impl SessionRows {
    pub fn of(session: &JoinedSession, arm: &Arm, key: &RunKey) -> Result<Self, TableError> {
        Ok(Self {
            name: session.name.clone(),
            stations: Row::table(stations::rows(session, arm), key)?,
            rejects: Row::table(rejects::rows(session), key)?,
            clocks: Row::table(vec![clocks::row(&session.joined.clock)], key)?,
            reference_motion: Row::table(references::motions(session), key)?,
        })
    }

    /// The tables that are written, in the order of the stages.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        let motion = where_there(&self.reference_motion.table);
        let always = [&self.stations.table, &self.rejects.table, &self.clocks.table];
        always.into_iter().chain(motion)
    }
}

#[derive(Debug, Clone)]
pub struct RunRows {
    pub calibrations: Rows<CalibrationRow>,
    pub parameters: Rows<ParameterRow>,
    pub scales: Rows<ScaleRow>,
    pub sources: Rows<SourceRow>,
    pub references: Rows<ReferenceRow>,
    pub joint_errors: Rows<JointErrorRow>,
    pub residuals: Rows<ResidualRow>,
    pub length_residuals: Rows<LengthResidualRow>,
    pub semivariograms: Rows<SemivariogramRow>,
    pub steps: Rows<StepRow>,
    pub compensation: Rows<NodeRow>,
    pub accuracy: Rows<AccuracyRow>,
}

impl RunRows {
    pub fn of(outcome: &Outcome<'_>, context: &PublishContext<'_>, key: &RunKey) -> Result<Self> {
        let semivariograms = semivariograms::rows(&outcome.semivariograms, context.noise_mm2);
        let accuracy = accuracy::rows(
            outcome.accuracy.iter().chain(&outcome.at_tip),
            &outcome.verdict,
            &outcome.iso_9283,
            &context.tolerance,
            key,
            &outcome.starts(),
        );
        let targets = &outcome.targets.names;
        let trained = outcome.training.iter().map(|own| own.name.as_str());
        let trained: Vec<&str> = trained.collect();
        let sources = sources::rows(&outcome.sources, &outcome.stated_sizes, &trained);
        let lengths = length_residuals::rows(&outcome.length_residuals, targets);
        Ok(Self {
            calibrations: Row::table(calibrations::rows(outcome, context)?, key)?,
            parameters: Row::table(parameters::rows(outcome, context), key)?,
            scales: Row::table(scales::rows(&outcome.scales), key)?,
            sources: Row::table(sources, key)?,
            references: Row::table(references::places(outcome), key)?,
            joint_errors: Row::table(joint_errors::rows(outcome, context), key)?,
            residuals: Row::table(residuals::rows(&outcome.residuals, targets), key)?,
            length_residuals: Row::table(lengths, key)?,
            semivariograms: Row::table(semivariograms, key)?,
            steps: Row::table(grid_steps::rows(outcome, context), key)?,
            compensation: Row::table(compensation::rows(outcome, context, key), key)?,
            accuracy: Row::table(accuracy, key)?,
        })
    }

    /// The tables that are written, in the order of the stages.
    pub fn tables(&self) -> impl Iterator<Item = &Table> {
        let always = [
            &self.calibrations.table,
            &self.parameters.table,
            &self.scales.table,
            &self.joint_errors.table,
            &self.residuals.table,
            &self.semivariograms.table,
            &self.steps.table,
            &self.compensation.table,
            &self.accuracy.table,
        ];
        let rare = [&self.sources.table, &self.references.table, &self.length_residuals.table];
        always.into_iter().chain(rare.into_iter().filter_map(where_there))
    }
}

/// A table that few sessions have anything for, where it has rows: the others have no file of it.
fn where_there(table: &Table) -> Option<&Table> {
    (table.rows() > 0).then_some(table)
}

pub fn ending(outcome: &Outcome<'_>, context: &PublishContext<'_>) -> Ending {
    let verdict = &outcome.verdict;
    let (figure, covered) = (verdict.headline().figure(), verdict.headline().covered());
    let stated = context.pairs.stated();
    let (mean_before_mm, mean_after_mm) =
        stated.and_then(Compared::figures).map(|[before, after]| (before.mean, after.mean)).unzip();
    let starts = || outcome.training.iter().filter_map(JoinedSession::started);
    let made_of = context.made_of.iter().map(|own| format!("{}/{}", own.session, own.run));
    let ending = Ending {
        session_started: outcome.training.last().and_then(JoinedSession::started),
        first_session_started: starts().min(),
        verdict: (&verdict.verdict()).into(),
        reason: verdict.reason(),
        verdict_of: Some(verdict.applied.into()),
        statement: Some(verdict.statement()),
        mean_before_mm,
        mean_after_mm,
        means_of: stated.map(Compared::of),
        bound_mm: figure.and_then(|figure| figure.bound),
        held_out: figure.map(|figure| figure.counted.poses),
        visits: figure.map(|figure| figure.counted.visits),
        stations_covered_share: covered.map(Covered::of_stations),
        means_by_poses_mm: verdict.means_by_poses_mm.map(Into::into),
        made_of: Some(made_of.collect()),
        estimate: Some(context.estimate.clone()),
        grids: Some(context.grids.clone()),
        ..Ending::default()
    };
    ending.replacing(context.replaces.clone())
}

#[cfg(test)]
mod tests;
