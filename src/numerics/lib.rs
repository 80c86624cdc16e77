//! From recordings to stations, identified errors, grids, corrections and reports. A stage is a plain function: values in, values
//! out. It reads no file and no clock, and its only randomness is that of a seed.

pub mod compensation;
pub mod fit;
pub mod grid;
pub mod history;
pub mod ingest;
pub mod join;
pub mod judgement;
pub mod method;
pub mod plan;
pub mod report;
pub mod setup;
pub mod similarity;
pub mod simulate;

// Names of the crates below, as if they were modules here.
use posegrid_arm::{geometry, kinematics};
use posegrid_base::{figures, linalg, manifest, progress, units};
