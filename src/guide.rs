//! The guide, chapter by chapter: how posegrid is used, from the first robot file to years of runs.
//!
//! The README is the first hour, the tutorials are the second. These modules hold text only. What is computed, and why, stands in
//! [`crate::method`], with what was measured. Every command has an example in its `--help`, and `posegrid schema TABLE` shows each
//! column of a table, `posegrid schema pipeline` each key of a pipeline file.
//!
//! | chapter | question it answers | command |
//! |---|---|---|
//! | [`first_night`] | From the logs of a cell to a page every morning: a tutorial | `init`, `check`, `run` |
//! | [`spreadsheet_abb`] | From a spreadsheet to a corrected RAPID program: a tutorial | `init`, `compensate` |
//! | [`install`] | How does it reach a machine: source, wheel, package, image, Windows? | |
//! | [`robot_file`] | How is the nominal arm stated, and how is the statement checked? | `schema robot` |
//! | [`pipeline_file`] | What does a pipeline file have to say, and what is a session? | `schema pipeline`, `check` |
//! | [`fleet`] | How are many robots stated in one pipeline file, and how is their work shared out? | `run`, `tasks`, `task` |
//! | [`logs`] | Which logs and messages are read, and what becomes of damaged ones? | `inspect` |
//! | [`station_tables`] | How is a table of stations read, where there are no logs? | `inspect` |
//! | [`cameras`] | How are a camera's poses, markers and several targets in one log read? | |
//! | [`tables`] | What does a run write, and how is it read? | `run`, `schema` |
//! | [`questions`] | What does an analyst ask the tables, and how? | |
//! | [`figures`] | How are figures, bounds and verdicts read? What accuracy is usual? | |
//! | [`compensate`] | How are targets corrected, and how does a table reach a controller? | `compensate`, `export` |
//! | [`driven_session`] | Did the correction work? | `run` |
//! | [`planning`] | How many poses, and which, before anything is measured? | `plan` |
//! | [`simulate`] | How is a session of known truth made? | `simulate` |
//! | [`operating`] | What waits, what is kept, what of several batches and interruptions? | `run` |
//! | [`history`] | What moved since the last session? | `history` |
//! | [`verify`] | Is a result of years ago still what it was? What may be deleted? | `verify` |
//! | [`storage`] | How are sessions and lake kept on object storage? | |

#![expect(
    clippy::doc_markdown,
    reason = "the chapters are prose: names of products are not names of items"
)]

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/first_night.md")]
pub mod first_night {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/spreadsheet_abb.md")]
pub mod spreadsheet_abb {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/install.md")]
pub mod install {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/robot_file.md")]
pub mod robot_file {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/pipeline_file.md")]
pub mod pipeline_file {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/fleet.md")]
pub mod fleet {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/logs.md")]
pub mod logs {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/station_tables.md")]
pub mod station_tables {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/cameras.md")]
pub mod cameras {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/tables.md")]
pub mod tables {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/questions.md")]
pub mod questions {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/figures.md")]
pub mod figures {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/compensate.md")]
pub mod compensate {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/driven_session.md")]
pub mod driven_session {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/planning.md")]
pub mod planning {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/simulate.md")]
pub mod simulate {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/operating.md")]
pub mod operating {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/history.md")]
pub mod history {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/verify.md")]
pub mod verify {}

#[doc = include_str!("links.md")]
#[doc = include_str!("guide/storage.md")]
pub mod storage {}
