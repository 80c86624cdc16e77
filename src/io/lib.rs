//! What posegrid reads and writes: logs, station tables, targets, robot files, tables of runs, the lake.

pub mod calibrations_table;
pub mod common;
pub mod compensation_table;
pub mod export;
pub mod inspect;
pub mod lake;
pub mod log;
pub mod log_writer;
pub mod robot;
pub mod rows;
pub mod station_table;
pub mod tables;
pub mod targets;

// Names of the crates below, as if they were modules here.
use posegrid_arm::{geometry, kinematics};
use posegrid_base::{at, figures, manifest, nearest, progress, units};
use posegrid_files::{
    input, measured_table, message, schema, store, system, table, temporary, whole_file,
};
use posegrid_numerics::{
    compensation, fit, grid, history, ingest, join, judgement, plan, report, setup, similarity,
};
