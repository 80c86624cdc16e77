//! Before measuring: which poses, and in which order.
pub mod order;
pub mod sight;
