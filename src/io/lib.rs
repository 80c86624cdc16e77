//! Everything that touches a file: logs, Parquet tables, schemas, the lake.

pub mod calibrations_table;
pub mod common;
pub mod compensation_table;
pub mod export;
pub mod input;
pub mod inspect;
pub mod lake;
pub mod log;
pub mod log_writer;
pub mod measured_table;
pub mod memory;
pub mod message;
pub mod robot;
pub mod schema;
mod stated;
pub mod station_table;
pub mod store;
pub mod system;
pub mod table;
pub mod tables;
pub mod targets;
pub mod whole_file;

// Names of the crates below, as if they were modules here.
use posegrid_arm::{geometry, kinematics};
use posegrid_base::{at, figures, manifest, nearest, progress, units};
use posegrid_numerics::{
    compensation, fit, grid, history, ingest, join, judgement, plan, report, setup, similarity,
};
