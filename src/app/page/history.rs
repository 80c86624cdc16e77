//! The trend page of a robot: its history, the rows of the tables `history` and `drift` → one HTML file.

mod changes;
mod charts;
pub mod content;
mod first_and_newest;
mod header;
mod nights;
mod reading;
#[cfg(test)]
mod tests;

use maud::html;

pub(super) use charts::named as figure_name;
pub use content::Content;

use super::shell::{self, Maker, Shell};

const SECTIONS: [Maker<Content>; 9] = [
    ("nights", "The last nights", nights::section),
    ("changes", "Changes", changes::section),
    ("accuracy", "Accuracy over the sessions", charts::accuracy),
    ("since", "Base, target and joints since the first session", charts::since_first),
    ("control", "Control charts", |c| Some(charts::control(c))),
    ("curves", "Joint curves, first and newest", first_and_newest::curves),
    ("parameters", "Parameters, first and newest", first_and_newest::parameters),
    ("left-out", "What was left out", changes::left_out),
    ("reading", "How to read this", |content| Some(reading::section(content))),
];

pub fn html(content: &Content) -> String {
    shell::page(&Shell {
        title: format!("History · {}", content.robot),
        header: header::header(content),
        sections: &SECTIONS,
        content,
        footer: html! { "posegrid " (content.version) " · history of " (content.robot) },
    })
}
