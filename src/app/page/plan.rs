//! The page of a plan: rows of `sampling_plan` and `plan_figures` → one HTML file.

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

pub use content::Content;

use super::shell::{self, Maker, table};

const SECTIONS: [Maker<Content>; 5] = [
    ("grid", "Uniform grid", steps::section),
    ("designs", "Better designs", designs::section),
    ("session", "The session", session::section),
    ("provenance", "Provenance", |c| Some(provenance::section(c))),
    ("reading", "How to read the tables", |c| Some(provenance::reading_section(c))),
];

pub fn html(content: &Content) -> String {
    let title = format!("Plan · {}", content.robot);
    let made = html! { "plan " code { (content.plan) } };
    shell::page(content, &title, &promise::header(content), &SECTIONS, &made)
}
