//! The method, chapter by chapter: from two logs to a compensation table, with formulas, sources and measured figures.
//!
//! These modules hold text only. Each chapter says what a stage computes, why, from which source, and what was measured
//! with it. It links to the code, and the code links back to it. What is known but not done here is said to be so.
//!
//! | chapter | question it answers | code |
//! |---|---|---|
//! | [`problem`] | What is wrong with an arm, and what does the pipeline do about it? Words, and the data behind the figures. | `posegrid::pipeline` |
//! | [`frames`] | In which frame, unit and clock is a number? | [`crate::geometry`], [`crate::units`] |
//! | [`kinematics`] | Where is the reflector for given joint angles, and how does it move with each parameter? | [`crate::kinematics`] |
//! | [`join`] | Which readings of the tracker belong to which dwell of the arm? | [`crate::join`] |
//! | [`references`] | Did the instrument or the base move while it was measured? | [`crate::join::references`] |
//! | [`set_up`] | Do logs and files describe one cell? | [`crate::setup`] |
//! | [`identification`] | Which parameters does the session determine, and how well? | [`crate::fit`] |
//! | [`error_model`] | What is left after the geometry, and how is it predicted? | [`crate::fit::full`] |
//! | [`similarity`] | Are near errors alike? | [`crate::similarity`] |
//! | [`grids`] | How coarse may a table be? | [`crate::grid`] |
//! | [`compensation`] | Which command brings the tool to its target? | [`crate::compensation`] |
//! | [`accuracy`] | How good is it, and by which figure? | [`crate::report`], [`crate::figures`] |
//! | [`history`] | Did the arm change between sessions? | [`crate::history`] |
//! | [`planning`] | How many poses, and which, before anything is measured? | [`crate::plan`] |
//! | [`uncertainty`] | What is in a stated standard deviation, and does it hold? | all of them |
//! | [`measured`] | What time, memory and storage does it take, how do other models do, and what did the longer proofs give? | |
//! | [`sources`] | Where does it come from? | |

#![expect(
    clippy::doc_markdown,
    reason = "the chapters are prose: names of people are not names of items"
)]

#[doc = include_str!("method/problem.md")]
pub mod problem {}

#[doc = include_str!("method/frames.md")]
pub mod frames {}

#[doc = include_str!("method/kinematics.md")]
pub mod kinematics {}

#[doc = include_str!("method/join.md")]
pub mod join {}

#[doc = include_str!("method/references.md")]
pub mod references {}

#[doc = include_str!("method/set_up.md")]
pub mod set_up {}

#[doc = include_str!("method/identification.md")]
pub mod identification {}

#[doc = include_str!("method/error_model.md")]
pub mod error_model {}

#[doc = include_str!("method/similarity.md")]
pub mod similarity {}

#[doc = include_str!("method/grids.md")]
pub mod grids {}

#[doc = include_str!("method/compensation.md")]
pub mod compensation {}

#[doc = include_str!("method/accuracy.md")]
pub mod accuracy {}

#[doc = include_str!("method/history.md")]
pub mod history {}

#[doc = include_str!("method/planning.md")]
pub mod planning {}

#[doc = include_str!("method/uncertainty.md")]
pub mod uncertainty {}

#[doc = include_str!("method/measured.md")]
pub mod measured {}

#[doc = include_str!("method/sources.md")]
pub mod sources {}
