//! The trend page of a robot: its history → one HTML file, as a run's page is.
//!
//! Input is [`Content`], the rows of the tables `history` and `drift`; output is the text of the page. It is a pure
//! function: the same history gives the same bytes. Sections, the verdict first:
//!
//! 1. changes, session by session; 2. accuracy before and after; 3. base, target and joint offsets since the first session, with
//!    bands; 4. control charts; 5. joint curves, first and newest; 6. parameters, first and newest; 7. what was left out.

mod changes;
mod charts;
pub mod content;
mod first_and_newest;
mod header;
mod reading;
#[cfg(test)]
mod tests;

use maud::html;

pub(super) use charts::named as figure_name;
pub use content::Content;

use super::shell::{self, Maker, Shell};

const SECTIONS: [Maker<Content>; 8] = [
    ("changes", "Changes", changes::section),
    ("accuracy", "Accuracy over the sessions", charts::accuracy),
    ("since", "Base, target and joints since the first session", charts::since_first),
    ("control", "Control charts", |c| Some(charts::control(c))),
    ("curves", "Joint curves, first and newest", first_and_newest::curves),
    ("parameters", "Parameters, first and newest", first_and_newest::parameters),
    ("left-out", "What was left out", changes::left_out),
    ("reading", "How to read this", |content| Some(reading::section(content))),
];

/// The page as HTML text.
pub fn html(content: &Content) -> String {
    shell::page(&Shell {
        title: format!("History · {}", content.robot),
        header: header::header(content),
        sections: shell::sections(&SECTIONS, content),
        footer: html! { "posegrid " (content.version) " · history of " (content.robot) },
    })
}
