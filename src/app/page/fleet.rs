//! The page of a fleet: the newest session of each robot → one HTML file. What is "last night" and how long ago a
//! session was follows from a date that the content states, not from the day.

mod bounds;
pub mod content;
mod header;
mod lists;
#[cfg(test)]
mod tests;

use maud::{Markup, html};

pub use content::{Content, Robot};

use super::shell::{self, Maker};

const SECTIONS: [Maker<Content>; 6] = [
    ("worst", "The worst", lists::worst),
    ("bounds", "Bounds over tolerances", bounds::section),
    ("moved", "What moved", |c| Some(lists::moved(c))),
    ("not-measured", "Not measured", |c| Some(lists::not_measured(c))),
    ("robots", "All robots by verdict", |c| Some(lists::all(c))),
    ("reading", "How to read this", |c| Some(reading(c))),
];

pub fn html(content: &Content) -> String {
    let robots = content::how_many(content.robots.len());
    let (title, made) = (format!("Fleet · {robots}"), html! { "fleet of " (robots) });
    shell::page(content, &title, &header::header(content), &SECTIONS, &made)
}

fn reading(content: &Content) -> Markup {
    html! {
        ul {
            li { "Of each robot the newest session counts, by its current run; times are UTC. Last night are the 24 hours up to " (content.as_of_text()) "." }
            li { "Verdict, bound and means are those of that run, as its summary and page have them: the mean error before correction, and what is left of it, at the same stations, which took no part in the correction. The bound covers the share of positions that the pipeline file asks for; a robot is the worse, the larger its bound is over its own tolerance." }
            li { "What moved is tested against all earlier sessions of the robot, with the covariances of both, and counts where it is as large as the tolerance notices; what is out of control left the ordinary spread of the robot's own sessions. The robot's page has both over time." }
            li { "Usually means the middle of the times between a robot's sessions." }
        }
    }
}
