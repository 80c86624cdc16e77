//! The page of a run: what it published → one HTML file that opens anywhere, from a mail too: no script, no network.
//!
//! Input is [`Content`], rows of the run's tables as they are published; output is the text of the page. It is a pure
//! function: the same tables give the same bytes. Sections, the verdict first:
//!
//! 1. verdict, chosen step and bound in words; 2. the work space before and after on one scale; 3. error against step;
//! 4. accuracy before and after, ISO 9283 figures where there are; 5. similarity; 6. joint curves; 7. parameters and what
//!    could not be told apart; 8. clocks, pairing and rejects; 9. how the models came out; 10. provenance.
//!
//! Names come from logs and settings and may be anything: maud escapes every value, and at the end what a reader would
//! not see or what would turn the direction of the text is written out ([`visible`]).

mod accuracy;
pub mod content;
mod joints;
mod logs;
mod models;
mod parameters;
mod provenance;
mod similarity;
mod space;
mod steps;
#[cfg(test)]
mod tests;
mod verdict;
mod words;

use maud::{DOCTYPE, Markup, PreEscaped, html};

pub use content::Content;

use super::chart;

const STYLE: &str = include_str!("page/page.css");

/// A section: its anchor, its heading, and what makes its content; `None` where the run has nothing for it.
type Section = (&'static str, &'static str, fn(&Content) -> Option<Markup>);

const SECTIONS: [Section; 12] = [
    ("space", "The work space before and after", space::section),
    ("steps", "Error against step", steps::section),
    ("accuracy", "Accuracy before and after", accuracy::section),
    ("iso-9283", "ISO 9283", accuracy::iso_section),
    ("similarity", "Similarity of errors", similarity::section),
    ("joints", "Joint curves", joints::section),
    ("parameters", "Identified parameters", parameters::section),
    ("clocks", "Clocks and pairing", logs::clocks_section),
    ("rejects", "What was left out", |c| {
        Some(logs::rejects_section(c))
    }),
    ("models", "How the models came out", models::section),
    ("provenance", "Provenance", |c| Some(provenance::section(c))),
    ("reading", "How to read the tables", |c| {
        Some(provenance::reading_section(c))
    }),
];

/// The page.
pub fn html(content: &Content) -> String {
    let sections: Vec<_> = SECTIONS
        .into_iter()
        .filter_map(|(id, heading, of)| Some((id, heading, of(content)?)))
        .collect();
    let title = format!("{} · {}", content.robot, content.session);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                // Written with a slash, the page is well-formed XML too, and any parser can check it.
                (PreEscaped("<meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>"))
                title { (title) " · posegrid" }
                style { (PreEscaped(chart::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (verdict::header(content))
                    nav aria-label="Sections" {
                        @for (id, heading, _) in &sections { a href={ "#" (id) } { (heading) } " " }
                    }
                    @for (id, heading, section) in &sections {
                        section id=(id) { h2 { (heading) } (section) }
                    }
                    footer { p { "posegrid " (content.provenance.version) " · run " code { (content.run) } } }
                }
            }
        }
    };
    visible(page.into_string())
}

/// The same page with every character written out that a reader would not see: controls, and marks that turn the direction
/// of text, which could make a name in a log read as something else. Our own markup has none.
pub fn visible(page: String) -> String {
    if !page.contains(is_hidden) {
        return page;
    }
    let shown = |c: char| {
        if is_hidden(c) {
            c.escape_unicode().to_string()
        } else {
            c.to_string()
        }
    };
    page.chars().map(shown).collect()
}

fn is_hidden(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}');
    turns || (c.is_control() && c != '\n')
}

/// A table that scrolls by itself where the screen is narrow.
fn table(head: &Markup, body: &Markup) -> Markup {
    html! {
        div.scroll { table { thead { tr { (head) } } tbody { (body) } } }
    }
}
