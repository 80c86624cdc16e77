//! The trend page of a robot: its history, the rows of the tables `history` and `drift` → one HTML file.

mod changes;
mod charts;
pub mod content;
mod first_and_newest;
mod header;
mod nights;
#[cfg(test)]
mod tests;

use maud::{Markup, html};

pub(super) use charts::named as figure_name;
pub use content::Content;

use super::shell::{self, Maker};

const SECTIONS: [Maker<Content>; 9] = [
    ("nights", "The last nights", nights::section),
    ("changes", "Changes", changes::section),
    ("accuracy", "Accuracy over the sessions", charts::accuracy),
    ("since", "Base, target and joints since the first session", charts::since_first),
    ("control", "Control charts", |c| Some(charts::control(c))),
    ("curves", "Joint curves, first and newest", first_and_newest::curves),
    ("parameters", "Parameters, first and newest", first_and_newest::parameters),
    ("left-out", "What was left out", changes::left_out),
    ("reading", "How to read this", |content| Some(reading(content))),
];

pub fn html(content: &Content) -> String {
    let (title, made) =
        (format!("History · {}", content.robot), html! { "history of " (content.robot) });
    shell::page(content, &title, &header::header(content), &SECTIONS, &made)
}

fn reading(content: &Content) -> Markup {
    let length = format!("{:.0}", 1.0 / content.false_alarm);
    let expected = content.false_alarm * content.sessions.len() as f64;
    html! {
        ul {
            li { "Sessions are in the order of the first stamps of their controller logs; of each only the current run counts. Another robot file, pipeline file, setting, version or model begins a segment, and nothing is compared across." }
            li { "A session is compared with all before it, pooled, since each part last moved. The covariances of both decide; a direction that one of them does not determine takes no part. Parts of a model that sessions share but that are not compared (fast curves, gear lines, drift within a session) make the test wider, never sharper." }
            li { "The smallest p-value of all hypotheses times their number has to be below 1 in " (length) ": a session without a change has a false alarm once in " (length) " at most, " (format!("{expected:.1}")) " in these " (content.sessions.len()) "." }
            li { "Significant is not large: how far a part moved is given next to it. The control charts ask another question, whether the change is more than the sessions' ordinary spread." }
            li { "Base includes the tracker: only their motion relative to each other is measured. The target is the tool or adapter that carries it." }
        }
        p { "The numbers are in " code { "history.parquet" } " and " code { "drift.parquet" } " next to this page; " code { "posegrid schema history" } " and " code { "posegrid schema drift" } " describe each column." }
    }
}
