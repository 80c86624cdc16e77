//! The frame that every page stands in: its parts → one HTML file that opens anywhere.
//!
//! Input is a [`Shell`]; output is the text of the page, well-formed as XML too. Names come from logs and settings and may be
//! anything: maud escapes every value, and at the end what a reader would not see or what would turn the direction of the
//! text is written out ([`visible`]).

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::report::chart;

pub(super) const STYLE: &str = include_str!("page.css");

/// The parts of a page.
pub(super) struct Shell {
    /// What the page is of, for the window's title.
    pub(super) title: String,
    /// The verdict and the figures it rests on.
    pub(super) header: Markup,
    /// What follows from the verdict on.
    pub(super) sections: Vec<Section>,
    /// Which version and run wrote it.
    pub(super) footer: Markup,
}

/// A section of a page.
pub(super) struct Section {
    /// Its anchor.
    pub(super) id: &'static str,
    /// Its heading.
    pub(super) heading: &'static str,
    /// What it says.
    pub(super) body: Markup,
}

/// What makes a section: its anchor, its heading, and its content; `None` where there is nothing for it.
pub(super) type Maker<C> = (&'static str, &'static str, fn(&C) -> Option<Markup>);

/// The sections that `content` has something for.
pub(super) fn sections<C>(makers: &[Maker<C>], content: &C) -> Vec<Section> {
    let made = makers.iter().filter_map(|&(id, heading, of)| {
        let body = of(content)?;
        Some(Section { id, heading, body })
    });
    made.collect()
}

/// The page.
pub(super) fn page(shell: &Shell) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                // Written with a slash, the page is well-formed XML too, and any parser can check it.
                (PreEscaped("<meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>"))
                title { (shell.title) " · posegrid" }
                style { (PreEscaped(chart::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (shell.header)
                    nav aria-label="Sections" {
                        @for section in &shell.sections { a href={ "#" (section.id) } { (section.heading) } " " }
                    }
                    @for section in &shell.sections {
                        section id=(section.id) { h2 { (section.heading) } (section.body) }
                    }
                    footer { p { (shell.footer) } }
                }
            }
        }
    };
    visible(page.into_string())
}

/// The same page with every character written out that a reader would not see: controls, and marks that turn the direction
/// of text, which could make a name in a log read as something else. Our own markup has none.
fn visible(page: String) -> String {
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

/// A table that scrolls by itself where the screen is narrow, by keys too.
pub(super) fn table(head: &Markup, body: &Markup) -> Markup {
    html! {
        div.scroll tabindex="0" { table { thead { tr { (head) } } tbody { (body) } } }
    }
}
