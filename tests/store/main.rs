//! `posegrid` with sessions and lake on object storage, against an S3-compatible server on loopback: the same bytes as in
//! folders, one commit of several, nothing half done whatever goes wrong on the way, nothing secret told.
//!
//! The server is moto, from `PyPI` (`server.py` beside this file). Python is `POSEGRID_PYTHON`, or that of `target/ci-venv`, which
//! `.ci/run` makes.

mod asked;
mod bytes;
#[path = "../run/cell.rs"]
#[expect(dead_code, reason = "each test binary uses its own part")]
mod cell;
mod faults;
mod history;
mod interrupted;
mod memory;
mod names;
#[path = "../run/pretended.rs"]
mod pretended;
mod refused;
mod secrets;
mod server;
mod slow;
mod stub;
mod way;
