//! Plan: before the tracker is set up, which step, which poses, and what accuracy to expect (METHOD.md 9).

pub mod design;
