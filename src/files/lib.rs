//! Files whatever they hold: messages, measured tables, Parquet tables by their schemas, stores. It knows no arm and no stage.

pub mod input;
pub mod measured_table;
pub mod memory;
pub mod message;
pub mod schema;
pub mod stated;
pub mod store;
pub mod system;
pub mod table;
pub mod temporary;
pub mod whole_file;

// Names of the crate below, as if they were modules here.
use posegrid_base::{at, manifest, nearest, units};
