//! What every other crate of posegrid counts with: units and stamps, linear algebra, figures of samples, progress, provenance.

pub mod at;
pub mod figures;
pub mod linalg;
pub mod manifest;
pub mod nearest;
pub mod progress;
pub mod units;
