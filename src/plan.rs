//! Plan: before the tracker is set up, which step, which poses, and what accuracy to expect (METHOD.md 9).

pub mod compare;
pub mod design;
pub mod influence;
pub mod outcomes;
pub mod place;
pub mod robots;
pub mod section;
pub mod settings;
pub mod steps;

use thiserror::Error;

pub use settings::{PlanSettings, Region};

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// A box without volume.
    #[error(
        "the box of {sizes_mm:?} mm has no volume: give [grid] box a low and a high corner that differ along each axis"
    )]
    EmptyBox {
        /// Sizes along the axes, mm.
        sizes_mm: [f64; 3],
    },
    /// A step larger than the box.
    #[error(
        "step {step_mm} mm does not fit into the box of {sizes_mm:?} mm: every step has to fit at least once along each \
         axis; choose smaller steps_mm or a larger box"
    )]
    StepTooLarge {
        /// The step, mm.
        step_mm: f64,
        /// Sizes along the axes, mm.
        sizes_mm: [f64; 3],
    },
    /// Too few poses of the region can be used.
    #[error(
        "only {found} of {drawn} random poses of the region can be measured, but {wanted} are wanted: move or shrink \
         [grid] box or [plan] cone_deg, give another home_deg, or loosen the constraints"
    )]
    OutOfReach {
        /// Poses wanted.
        wanted: usize,
        /// Poses found.
        found: usize,
        /// Poses drawn.
        drawn: usize,
    },
}
