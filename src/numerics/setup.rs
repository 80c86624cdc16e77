//! Set-up: what the logs of a joined session state, held against what the pipeline file and the robot file state.
//!
//! Inputs: [`Evidence`] (reported angles, readings and commands of the stations) and the stated [`SetUp`]. Output: nothing for a
//! sound session, otherwise a [`Finding`]: the mistake that explains the disagreement, by how much, and the key to edit. Pure.
//!
//! 1. [`Agreement`]: the median disagreement of each relation (readings and arm, commands and arm, surveyed base, …).
//! 2. Where one is beyond what nominal arms are off by, the usual mistakes ([`Hypothesis`]) are tried one by one: units, mirrored
//!    readings, quaternions, order and sign of joints, frames turned or inverted, another robot file, signs of links.
//! 3. Frames and link quantities are moved to where the logs agree best.
//! 4. A mistake is named when it takes the worst disagreement to a third, leaves no more than sound arms leave, and explains more
//!    than any other; several that the logs cannot separate are named together.
//! 5. Where none explains everything, two at once are tried.
//!
//! The method is in [`crate::method::set_up`].

mod agreement;
mod evidence;
mod hypotheses;
mod search;
mod set_up;
mod shifts;
mod unjoined;

pub use agreement::{Agreement, Relation};
pub use evidence::{Dwelt, Evidence};
pub use hypotheses::{Alternatives, FrameKey, Hypothesis, KnownArm, OtherReading};
pub use search::{Finding, check};
pub use set_up::{Reread, SetUp, UnitKeys, Units};
pub use unjoined::explain;
