//! Logs in, recordings out: on real recordings, on logs built here, and on logs that were damaged on purpose.

mod behind;
mod build;
mod conformance;
mod damage;
mod dwells;
mod encodings;
mod files;
mod fuzz;
mod inspect;
mod lengths;
#[path = "../common/mapping.rs"]
mod made;
mod markers;
mod mutator;
mod raw;
mod recordings;
mod sound;
mod tables;

use posegrid::ingest::JointAngles;

/// The angles of one joint (from 0), sample after sample.
fn of_joint(angles: &JointAngles, joint: usize) -> Vec<f64> {
    angles.rows().map(|row| row[joint]).collect()
}
