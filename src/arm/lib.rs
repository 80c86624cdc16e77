pub mod geometry;
pub mod kinematics;

// Names of the crates below, as if they were modules here.
use posegrid_base::units;
