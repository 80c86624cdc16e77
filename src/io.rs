//! Everything that touches a file: logs, Parquet tables, schemas, the lake.

<<<<<<< HEAD
pub mod lake;
pub mod log_writer;
pub mod schema;
pub mod table;
=======
pub mod log;
pub mod message;
>>>>>>> logs
