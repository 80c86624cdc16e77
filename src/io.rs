//! Everything that touches a file: logs, Parquet tables, schemas, the lake.

pub mod log;
pub mod message;
