//! The pipeline: a file becomes a checked configuration, a configuration becomes pieces of work, and each piece is one run.

pub mod compact;
mod compared;
pub mod configuration;
pub mod damage;
mod driven;
pub mod fetch;
pub mod file;
pub mod fleet;
pub mod history;
pub mod keys;
pub mod planning;
mod promise;
pub mod robot_entry;
pub mod robot_file;
pub mod run;
pub mod summary;
pub mod tasks;
pub mod verify;
mod words;

pub(crate) use words::some_of;
