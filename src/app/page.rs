//! The page of a run: the rows that it published → one HTML file that opens anywhere, even from a mail: no script, no
//! network.
//!
//! Input is [`Content`], the rows of the run's tables ([`mod@content`]); output is the text of the page. It is a pure
//! function: the same rows give the same bytes. Sections, the verdict first:
//!
//! 1. verdict, chosen step and bound; 2. the work space before and after on one scale; 3. error against step;
//! 4. accuracy before and after, ISO 9283 figures where there are; 5. similarity; 6. joint curves; 7. parameters and which
//!    are not identifiable; 8. clocks, pairing and rejects; 9. fit of the models; 10. provenance.
//!
//! `shell` makes the frame around the sections and escapes names, which may hold any character; the page of a plan,
//! [`plan`], uses it too.

mod accuracy;
pub mod content;
pub mod fleet;
mod from_rows;
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

pub use content::Content;
pub use from_rows::{About, Statements, content};

use shell::{Maker, Shell, table};

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

/// The page as HTML text.
pub fn html(content: &Content) -> String {
    shell::page(&Shell {
        title: format!("{} · {}", content.robot, content.session),
        header: verdict::header(content),
        sections: shell::sections(&SECTIONS, content),
        footer: html! { "posegrid " (content.provenance.version) " · run " code { (content.run) } },
    })
}
