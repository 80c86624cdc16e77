//! The `posegrid` command from two logs to a lake and to corrected targets, as an operator runs it: its results, its exit
//! codes, and what it says and leaves behind when something is wrong.

#[path = "../common/mod.rs"]
mod common;

mod any_arm;
mod asked;
mod bad_input;
mod bad_output;
mod belongs;
mod cell;
mod closed_loop;
mod compact;
mod compensate;
mod conventions;
mod damaged;
mod driven;
mod estimated;
mod export;
mod faults;
mod fleet;
mod forged;
mod gridded;
mod history;
mod init;
mod inspect_tables;
mod interrupted;
mod iso_9283;
mod joined;
mod joints;
mod judged;
mod kept;
mod known;
mod lengths;
mod logged_references;
mod nightly;
mod one_verdict;
mod page;
mod pipelines;
mod planned;
mod pretended;
mod robot;
mod same_work;
mod set_up;
mod several;
mod split;
mod tabled;
mod targets;
mod tasks;
mod unattended;
mod unwritable;
mod verify;
mod written;
