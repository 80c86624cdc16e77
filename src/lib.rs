//! From a robot controller's log and a laser tracker's log to joined stations, identified kinematic errors,
//! error-similarity grids, accuracy reports and a compensation table.
//!
//! ```text
//!  controller.mcap ─┐
//!                   ├─ ingest ─→ join ─→ fit ─→ similarity ─→ grid ─→ compensation ─→ report
//!  tracker.mcap ────┘
//! ```
//!
//! How it is used stands in the chapters of [`guide`], from the first robot file to years of runs. What the stages compute, and
//! why, stands in the chapters of [`method`]: formulas, sources and measured figures. This page is the map of the code.
//!
//! # The stages, in the order of the data
//!
//! | stage | from | to |
//! |---|---|---|
//! | [`ingest`] | decoded messages of both logs, block by block | samples in mm, rad and ns, in order of time |
//! | [`join`] | dwells of the arm, commands and readings | stations, the relation of the clocks, rejects |
//! | [`setup`] | stations, the stated set-up | the mistake of the set-up that explains a disagreement, or nothing |
//! | [`fit`] | stations | identified parameters and the full error model, with covariances |
//! | [`similarity`] | errors and residuals | semivariograms |
//! | [`grid`] | stations and error models | judged steps and the chosen table |
//! | [`compensation`] | a table or the identified arm, target poses | commands, or reasons why there are none |
//! | [`report`] | models and stations that judge them | residuals, accuracy figures, charts |
//!
//! [`judgement`] calls the stages from [`fit`] to [`report`], and has the models judged by stations that did not train them.
//! [`simulate`] makes sessions of known truth, [`plan`] uses it before anything is measured, and [`history`] compares sessions.
//! A stage is a plain function: values in, values out. It reads no file and no clock, and its only randomness is that of a seed.
//!
//! A table of stations is an input like logs: [`io::station_table`] reads it, and [`join::tabled`] makes its rows stations.
//!
//! What ingest and join give of a session is published by itself, and later runs start from it ([`pipeline::run`],
//! [`io::tables::readings`]).
//! There is one road from logs to stations: [`io::log::read_session`] replays the samples of the logs into the detector of dwells
//! ([`join::stationary::Finder`]), and [`join::join`] takes what comes out of it ([`join::JoinInput`]).
//!
//! # Crates: who may use whom
//!
//! ```text
//!  base  ←  arm  ←  numerics  ←  io  ←  app  ←  posegrid
//!    ↖────── files ──────────↙
//! ```
//!
//! Cargo holds the arrows. A crate stands in `src/` under its own name, and this one, `posegrid`, is the command and one door to
//! the modules of all of them.
//!
//! | crate | modules | what it knows |
//! |---|---|---|
//! | `base` | [`units`], [`linalg`], [`figures`], [`at`], [`progress`], [`manifest`] | units, stamps, matrices, figures of samples, provenance |
//! | `arm` | [`geometry`], [`kinematics`] | frames and chains |
//! | `numerics` | the stages above, [`judgement`], [`simulate`], [`plan`], [`history`], [`method`] | a stage uses those before it in the order of the data |
//! | `files` | [`files`] | messages, measured tables, Parquet tables, schemas, stores: files whatever they hold |
//! | `io` | [`io`] | logs, station tables, targets, robot files, rows of tables, the lake |
//! | `app` | [`page`], [`pipeline`], [`cli`] | rows become pages, a pipeline file becomes runs, arguments become exit codes |
//!
//! `tests/house` holds the modules inside a crate against the same order, and names the circles that there are inside a room.
//!
//! # Calling the steps
//!
//! The steps of `posegrid run` as plain functions; a result is a value.
//!
//! ```
//! use std::path::Path;
//! use posegrid::fit::model::{At, PoseModel, Query};
//! use posegrid::fit::{FitSettings, Freedom, identify, observations};
//! use posegrid::io::log::{SessionLogs, read_session};
//! use posegrid::join::join;
//! use posegrid::pipeline::configuration::{Configuration, Overrides};
//! use posegrid::progress::Quiet;
//!
//! // Both logs of the quickstart's session, and what its pipeline file says of them.
//! let configuration = Configuration::load(Path::new("pipelines/quickstart.toml"), &Overrides::default())?;
//! let log = |side: &str| Path::new("tests/recordings/quickstart").join(side);
//! let logs = SessionLogs::of_two(&log("controller.mcap"), &log("tracker.mcap"));
//! let mapping = configuration.reads.mapping().expect("a pipeline file of logs");
//! let read = read_session(&logs, mapping, configuration.file.limits, &configuration.file.join.arm_rule(), &mut (), &Quiet)?;
//! assert!(read.rejects.is_empty(), "nothing is lost");
//!
//! // Dwells of the arm become stations; the two clocks of this session drift apart by less than a thousandth.
//! let joined = join(&read.input, &configuration.arm, &configuration.file.join)?;
//! assert!(joined.stations.iter().filter(|station| !station.measured().is_empty()).count() > 50);
//! assert!(joined.clock.model.drift.abs() < 1e-3);
//!
//! // Base and target alone, then the geometry as well.
//! let seen = observations(0, &joined.stations, &configuration.arm, &configuration.stages.noise);
//! let settings = FitSettings::default();
//! let before = identify(&configuration.arm, &seen, 1, Freedom::BaseAndTarget, &settings)?;
//! let after = identify(&configuration.arm, &seen, 1, Freedom::Geometry, &settings)?;
//! assert!(after.misfit_mm < before.misfit_mm, "training errors: no verdict");
//!
//! // The reflector at the first station by the identified geometry, in the tracker frame, and its covariance, mm.
//! let prediction = after.predict(&At::Joints(Query::of(&seen[0])))?;
//! let left = seen[0].point().expect("the tracker reads points").position - prediction.position;
//! let covariance = after.spread(0, seen[0].source, &prediction).covariance();
//! assert!(left.norm() < 1.0 && covariance.trace().sqrt() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where to add
//!
//! - *A figure*: compute it in [`report`] from residuals or stations; its rows are made in [`io::tables::accuracy`], where its
//!   name is a value of [`io::tables::accuracy::FigureName`] and a word in `schemas/accuracy.toml` (a new version of the
//!   schema, and a line in its `changes`).
//! - *An arm*: a file in `pipelines/robots/` and its line in [`io::robot::ready`]. Another convention of links is a variant of
//!   [`kinematics::Convention`], the elements it makes, and its numbers from the lines of the axes in [`kinematics::restate`];
//!   nothing behind [`kinematics::Chain`] changes.
//! - *An instrument*: another laser tracker is `[tracker] uncertainty` in the pipeline file, a camera is `[tracker] camera`. One
//!   that measures points or poses in another way needs its covariance as a variant of [`fit::Uncertainty`]. One that reads one
//!   length is a [`fit::Gauge`]: a distance from an anchor or a height above a plane, in the base's frame. One that reads something else is a
//!   variant of [`join::ReadingKind`], [`join::Value`] and [`fit::Measured`]; its residual, its rows and its covariance stand in
//!   [`fit::observation`], one at a time and in blocks. A second instrument in a session is a further source, and a further
//!   reflector a further target: the fit takes several of each ([`fit::Frames`], [`join::Reading`]). The join makes readings of one
//!   source on one target ([`join::SourceId::ONLY`]). What comes after the fit is for one source of places
//!   ([`join::SeveralSources`]), and sources of one length train beside it; of several targets it takes the one
//!   reading of each station that [`fit::flange`] derives. [`history`] compares the arm, the base in the frame of the first source of places and
//!   the main target, and integrates out every other source and target; a plan is of one tracker and the main target, and may start from a
//!   session of several ([`fit::full::next::Mounting`]).
//! - *A model*: a file in `src/numerics/fit/registry/` that implements [`fit::PoseModel`] and says what the rest has to know of it
//!   ([`fit::registry::About`]); its line in [`fit::registry`]; and its word in the allowed values of the columns of models in
//!   `schemas/` (`accuracy`, `residuals`, `estimate_residuals`, `semivariograms`, `calibrations`). Evaluation, figures, pages and `compensate` ask the
//!   registry. A further part of the full error model is a block of columns ([`fit::full::layout`]), what they do at a pose
//!   ([`fit::full::design`]) and how large they are ([`fit::full::components`]).
//! - *A log format*: an encoding of messages is a reader in [`files::message`] that takes wanted fields from a payload. A message type
//!   needs no code but field paths in the pipeline file. Another container than MCAP is a source of records beside those in
//!   [`io::log`].
//! - *A key of a pipeline or robot file*: a field of its section's struct ([`pipeline::file`]), and its entry in
//!   `src/app/pipeline/keys/`, from which `posegrid schema pipeline` and the messages of missing keys are made ([`pipeline::keys`]). A
//!   test names the key where one of both is forgotten.
//! - *A table*: a schema in `schemas/`, and one file in [`io::tables`] with the struct of its rows ([`io::rows::Row`]), which a
//!   test holds against the schema.

pub use posegrid_app::{cli, page, pipeline};
pub use posegrid_arm::{geometry, kinematics};
pub use posegrid_base::{at, figures, linalg, manifest, progress, units};
pub use posegrid_files as files;
pub use posegrid_io as io;
pub use posegrid_numerics::{
    compensation, fit, grid, history, ingest, join, judgement, method, plan, report, setup,
    similarity, simulate,
};
pub use posegrid_programs as programs;

pub mod guide;
