//! The sessions of a pool, a row each: before, after on held-out blocks, and after where the others alone were learnt from.

use maud::{Markup, html};

use crate::io::tables::accuracy::{AccuracyRow, FigureName};
use crate::page::content::{Content, Session};
use crate::page::words;
use crate::report::compared::Compared;
use crate::report::{BaseRefit, Model, Point, Split, Subject};

const SHOWN: usize = 10;

/// The sessions of a pool; nothing for a run that learnt from one.
pub(super) fn rows(content: &Content) -> Markup {
    let head = html! {
        th { "Session" } th { "Before, blocks" } th { "After" } th { "Bound" } th { "Before, learnt from the others" } th { "After" } th { "Bound" }
        th { "In 95 % ellipsoid" } th.word { "Verdict" }
    };
    let body = html! { @for session in &content.sessions { (row(content, session)) } };
    let table = crate::page::table(&head, &body);
    html! {
        p {
            "Each session by its mean error, mm, before and after at the same stations: on blocks of it that were held out; and by an estimate "
            "that did not see it, with its base from some of its stations, on the others."
        }
        @if content.sessions.len() > SHOWN {
            details { summary { "All " (content.sessions.len()) " sessions" } (table) }
        } @else {
            (table)
        }
    }
}

fn row(content: &Content, session: &Session) -> Markup {
    let figures = &content.figures;
    let of = |model: Model, split: Split, name: FigureName| {
        figure(figures, &session.name, model, split, name).and_then(|own| own.value)
    };
    let best = |split: Split| {
        let mean = |model: &Model| of(*model, split, FigureName::Mean).is_some();
        Model::serving().find(mean).unwrap_or(Model::Full)
    };
    let (blocks, alone) = (best(Split::Blocks), best(Split::Session));
    let pair = |split: Split| {
        let is_it = |(own, _): &&(Subject, Compared)| {
            (own.split, &own.of_session) == (split, &session.name)
        };
        let found = content.said.pairs.of_sessions.iter().find(is_it);
        let means = found.and_then(|(_, own)| own.figures());
        html! { @for place in 0..2 { td { (words::optional(means.map(|own| own[place].mean), 3)) } } }
    };
    let inside = of(alone, Split::Session, FigureName::ShareInEllipsoid);
    let bound = figure(figures, &session.name, alone, Split::Session, FigureName::Bound);
    html! {
        tr {
            th.word scope="row" { (session.name) @if !session.trained { small { "only judged" } } }
            (pair(Split::Blocks))
            td { (words::optional(of(blocks, Split::Blocks, FigureName::Bound), 3)) }
            (pair(Split::Session))
            td { (words::optional(of(alone, Split::Session, FigureName::Bound), 3)) }
            td { @match inside { Some(share) => { data value=(share) { (words::fixed(100.0 * share, 1)) } " %" }, None => "–" } }
            td.word { (bound.and_then(|own| own.verdict).map_or("–", words::verdict)) }
        }
    }
}

/// The figure of a model at the angles that say most of a program, by held-out blocks or by a session that took no part.
fn figure<'f>(
    figures: &'f [AccuracyRow],
    session: &str,
    model: Model,
    split: Split,
    name: FigureName,
) -> Option<&'f AccuracyRow> {
    // A session that took no part is judged in a base of its own, found from stations that do not judge.
    let is_judged = |own: &AccuracyRow| {
        split != Split::Session
            || !matches!(own.subject.base_refit, BaseRefit::None | BaseRefit::All)
    };
    let is_it = |own: &&AccuracyRow| {
        (own.subject.model, own.subject.split, own.name) == (model, split, name)
            && is_judged(own)
            && own.point == Point::Measured
            && own.subject.of_session == session
    };
    let own = || figures.iter().filter(is_it);
    let mut angles = model.about().angles.iter().rev();
    angles.find_map(|angles| own().find(|figure| figure.subject.angles == *angles))
}
