//! From a robot controller's log and a laser tracker's log to joined stations, identified kinematic errors,
//! error-similarity grids, accuracy reports and a compensation table.
//!
//! ```text
//!  controller.mcap ─┐
//!                   ├─ ingest ─→ join ─→ fit ─→ similarity ─→ grid ─→ compensation ─→ report
//!  tracker.mcap ────┘
//! ```
//!
//! Core modules ([`units`], [`geometry`], [`kinematics`]) know no stage. A stage is a plain function that uses core and
//! the output of earlier stages. Only [`io`], the pipeline and the command line read and write.

// Core: knows no stage.
pub mod figures;
pub mod geometry;
pub mod kinematics;
pub mod linalg;
pub mod progress;
pub mod units;

// The stages, in data order.
pub mod ingest;

pub mod join;

pub mod fit;

pub mod similarity;

pub mod grid;

pub mod compensation;

pub mod report;

// Before measuring.
pub mod plan;
pub mod simulate;

// Across sessions.
pub mod history;

// Everything that reads and writes.
pub mod cli;
pub mod io;
pub mod manifest;
pub mod pipeline;
