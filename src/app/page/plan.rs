//! The page of a plan: its published rows → one HTML file, like a run's page.
//!
//! Input is [`Content`], rows of `sampling_plan` and `plan_figures` as published; output is the text of the page. It is a
//! pure function: the same rows give the same bytes. Sections, the verdict first:
//!
//! 1. the promise in words, and what has to be measured for it; 2. the uniform grid, accuracy against step; 3. designs,
//!    accuracy against the number of poses; 4. the session, pose by pose; 5. provenance.

mod cells;
pub mod content;
mod designs;
mod promise;
mod provenance;
mod session;
mod steps;
#[cfg(test)]
mod tests;

use maud::html;

pub use content::{About, Content};

use super::shell::{self, Maker, Shell, table};

const SECTIONS: [Maker<Content>; 5] = [
    ("grid", "Uniform grid", steps::section),
    ("designs", "Better designs", designs::section),
    ("session", "The session", session::section),
    ("provenance", "Provenance", |c| Some(provenance::section(c))),
    ("reading", "How to read the tables", |c| Some(provenance::reading_section(c))),
];

/// The page as HTML text.
pub fn html(content: &Content) -> String {
    shell::page(&Shell {
        title: format!("Plan · {}", content.robot),
        header: promise::header(content),
        sections: shell::sections(&SECTIONS, content),
        footer: html! { "posegrid " (content.provenance.version) " · plan " code { (content.plan) } },
    })
}
