//! Logs in, recordings out: on real recordings, on logs built here, and on logs that were damaged on purpose.

mod build;
mod damage;
mod encodings;
mod inspect;
mod recordings;
mod sound;
