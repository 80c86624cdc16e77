//! The frame of every page: head and sections → one HTML file that opens anywhere, well-formed as XML too. Names may hold any
//! character: maud escapes every value, and [`visible`] writes out every character that a reader would not see.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::manifest::VERSION;
use crate::report::chart;

pub(super) const STYLE: &str = include_str!("page.css");

/// The anchor, the heading and the content of a section; the content is `None` where there is nothing to show.
pub(super) type Maker<C> = (&'static str, &'static str, fn(&C) -> Option<Markup>);

/// A page of its title, its head, the sections after that, and in its foot the version and what `made` it.
pub(super) fn page<C>(
    content: &C,
    title: &str,
    header: &Markup,
    sections: &[Maker<C>],
    made: &Markup,
) -> String {
    let made_of = |&(id, heading, of): &Maker<C>| Some((id, heading, of(content)?));
    let sections: Vec<_> = sections.iter().filter_map(made_of).collect();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                // With the slash the page is well-formed XML too, and any parser can check it.
                (PreEscaped("<meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>"))
                title { (title) " · posegrid" }
                style { (PreEscaped(chart::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (header)
                    nav aria-label="Sections" {
                        @for (id, heading, _) in &sections { a href={ "#" (id) } { (heading) } " " }
                    }
                    @for (id, heading, body) in &sections {
                        section id=(id) { h2 { (heading) } (body) }
                    }
                    footer { p { "posegrid " (VERSION) " · " (made) } }
                }
            }
        }
    };
    visible(page.into_string())
}

/// Writes out controls, and marks that change the direction of text, with which a name in a log could read as something
/// else.
fn visible(page: String) -> String {
    if !page.contains(is_hidden) {
        return page;
    }
    let shown = |c: char| {
        if is_hidden(c) { c.escape_unicode().to_string() } else { c.to_string() }
    };
    page.chars().map(shown).collect()
}

pub(super) fn is_hidden(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}');
    turns || (c.is_control() && c != '\n')
}

/// The address of a file: in one `%` is written `%25`.
pub(super) fn address(path: &str) -> String {
    path.replace('%', "%25")
}

/// A table that scrolls on its own where the screen is narrow, also with keys.
pub(super) fn table(head: &Markup, body: &Markup) -> Markup {
    html! {
        div.scroll tabindex="0" { table { thead { tr { (head) } } tbody { (body) } } }
    }
}
