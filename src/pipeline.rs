//! The pipeline: a file becomes a checked plan, a plan becomes pieces of work, and each piece is one run.

pub mod outcome;
pub mod stages;
