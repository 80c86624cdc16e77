//! What puts it all to work: a pipeline file becomes runs, rows of tables become pages, arguments become exit codes.

// `println!` and `eprintln!` end the thread where stdout or stderr refuses: `cli::streams` has what does not.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

pub mod cli;
pub mod page;
pub mod pipeline;

// Names of the crates below, as if they were modules here.
use posegrid_arm::{geometry, kinematics};
use posegrid_base::{at, figures, manifest, nearest, progress, units};
use posegrid_files as files;
use posegrid_io as io;
use posegrid_numerics::{
    compensation, fit, grid, history, ingest, join, judgement, plan, report, setup, similarity,
    simulate,
};
use posegrid_programs as programs;
