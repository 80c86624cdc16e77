//! The arm as a chain of elementary transforms, each a constant, a joint variable, or a constant with a free parameter
//! (an *elementary transform sequence*; `posegrid::method::kinematics`). DH, Hayati and URDF are such sequences, so one
//! core serves every convention and the derivative of any element is one column: its unit twist carried to the end.

pub mod arm;
mod arm_error;
mod axes;
pub mod batch;
pub mod chain;
pub mod configuration;
pub mod convention;
pub mod held;
pub mod inverse;
mod joint;
mod motion;
pub mod named;
pub mod parameter;
pub mod restate;
pub mod robot_file;
pub mod screws;
mod sin_cos;
mod twist;

pub use arm::{Arm, Joint};
pub use axes::Axes;
pub use batch::{BatchChain, BatchColumns, Poses};
pub use chain::{Chain, Differential, Element};
pub use configuration::{Configuration, Side, SingularityFactors};
pub use convention::Convention;
pub use held::{ChainView, HeldChain};
pub use inverse::{Anywhere, Inverse, InverseError, InverseSettings, inverse};
pub use motion::{Axis, Motion};
pub use parameter::{GaugePart, LinkQuantity, Parameter};
pub use restate::RestateError;
pub use robot_file::{ArmError, JointFile, JointKind, RobotFile};
pub use screws::{Line, Screw, Screws};
pub use twist::Twist;
