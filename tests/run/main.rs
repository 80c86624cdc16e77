//! The `posegrid` command from two logs to a lake and to corrected targets, as an operator runs it: its results, its exit
//! codes, and what it says and leaves behind when something is wrong.

mod bad_input;
mod bad_output;
mod belongs;
mod cell;
mod conventions;
mod damaged;
mod driven;
mod export;
mod forged;
mod inspect_tables;
mod interrupted;
mod iso_9283;
mod joined;
mod joints;
mod judged;
mod kept;
mod lengths;
mod nightly;
mod one_verdict;
mod page;
mod planned;
mod robot;
mod same_work;
mod set_up;
mod several;
mod split;
mod tabled;
mod targets;
mod unattended;
mod unnamed;
mod unwritable;
mod verify;
mod written;
