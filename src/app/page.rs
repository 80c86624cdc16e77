//! The page of a run: the rows that it published → one HTML file that opens anywhere, even from a mail: no script, no
//! network. The same [`Content`] gives the same bytes. `shell` makes the frame around the sections and escapes names,
//! which may hold any character.

pub mod acceptance;
mod accuracy;
pub mod content;
pub mod fleet;
pub mod history;
mod iso_9283;
mod joints;
mod logs;
mod models;
mod parameters;
pub mod plan;
mod provenance;
mod shell;
mod similarity;
mod space;
mod steps;
#[cfg(test)]
mod tests;
mod verdict;
mod words;

use maud::html;

pub use content::{Content, Statements};
pub use words::{alike, instrument, percent};

use shell::{Maker, table};

const SECTIONS: [Maker<Content>; 12] = [
    ("space", "The work space before and after", space::section),
    ("steps", "Error against step", steps::section),
    ("accuracy", "Accuracy before and after", accuracy::section),
    ("iso-9283", "ISO 9283", iso_9283::section),
    ("similarity", "Similarity of errors", similarity::section),
    ("joints", "Joint curves", joints::section),
    ("parameters", "Identified parameters", parameters::section),
    ("clocks", "Clocks and pairing", logs::clocks_section),
    ("rejects", "What was left out", |c| Some(logs::rejects_section(c))),
    ("models", "Fit of the models", models::section),
    ("provenance", "Provenance", |c| Some(provenance::section(c))),
    ("reading", "How to read the tables", |c| Some(provenance::reading_section(c))),
];

pub fn html(content: &Content) -> String {
    let title = format!("{} · {}", content.key.robot, content.key.session);
    let made = html! { "run " code { (content.key.run) } };
    shell::page(content, &title, &verdict::header(content), &SECTIONS, &made)
}
