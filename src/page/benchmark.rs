//! The page of a benchmark: all arms × models in one table, then each split with every figure → one HTML file, as a run's page is.
//!
//! Input is [`Content`], the suite and the rows of table `benchmark`; output is the text of the page. It is a pure function: the same rows
//! give the same bytes. A split that leaks is named so wherever its figures stand, with those beside it.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use maud::{Markup, html};

use super::shell::{self, Maker, Shell, table};
use crate::benchmark::FigureName;
use crate::benchmark::suite::{SplitKind, Suite};
use crate::io::tables::benchmark::{BenchmarkRow, Entrant, TableBase};
use crate::report::{Angles, Model};

/// What the page shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// Version of the program that made it.
    pub version: String,
    /// The suite.
    pub suite: Suite,
    /// Items read, kept and left out, by the arm's name.
    pub told: Vec<(String, Vec<String>)>,
    /// What the suite does not state, in sentences.
    pub remarks: Vec<String>,
    /// The rows of table `benchmark`.
    pub rows: Vec<BenchmarkRow>,
}

/// A model or program, in the order of the columns.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Entry {
    /// Who predicts.
    pub entrant: Entrant,
    place: usize,
    /// The model's name in the table.
    pub model: String,
    /// The angles that it predicts from.
    pub angles: Option<Angles>,
}

const SECTIONS: [Maker<Content>; 4] = [
    ("all", "All arms and models", |c| Some(all(c))),
    ("splits", "Every split", |c| Some(splits(c))),
    ("data", "The data", |c| Some(data(c))),
    ("reading", "How to read this", |c| Some(reading(c))),
];

/// The page as HTML text.
pub fn html(content: &Content) -> String {
    shell::page(&Shell {
        title: format!("Benchmark · {}", content.suite.name),
        header: header(content),
        sections: shell::sections(&SECTIONS, content),
        footer: html! { "posegrid " (content.version) " · suite " (content.suite.name) },
    })
}

impl Entry {
    /// The entry of a row.
    pub fn of(row: &BenchmarkRow) -> Self {
        let models = Model::ALL.iter();
        let mut known = models.map(|model| model.about().word);
        Self {
            entrant: row.entrant,
            place: known.position(|word| word == row.model).unwrap_or(Model::ALL.len()),
            model: row.model.clone(),
            angles: row.angles,
        }
    }

    /// Its name for people.
    pub fn name(&self) -> String {
        let model = Model::of_word(&self.model).filter(|_| self.entrant == Entrant::Posegrid);
        match (model, self.angles) {
            (Some(model), Some(angles)) => model.name_at(angles),
            _ => self.model.clone(),
        }
    }
}

impl Content {
    /// Arm and split of every split with rows, in the suite's order.
    pub fn splits(&self) -> Vec<(&str, &str)> {
        let arms = self.suite.arms.iter();
        let all = arms.flat_map(|arm| arm.splits.iter().map(|split| (&*arm.name, &*split.name)));
        all.filter(|(arm, split)| self.of_split(arm, split).next().is_some()).collect()
    }

    /// The rows of a split.
    pub fn of_split<'c>(
        &'c self,
        arm: &'c str,
        split: &'c str,
    ) -> impl Iterator<Item = &'c BenchmarkRow> {
        let rows = self.rows.iter();
        rows.filter(move |row| row.robot == arm && row.split == split)
    }

    /// The entries of some rows, each once, in the order of display.
    pub fn entries<'c>(rows: impl Iterator<Item = &'c BenchmarkRow>) -> Vec<Entry> {
        let entries: BTreeSet<Entry> = rows.map(Entry::of).collect();
        entries.into_iter().collect()
    }

    /// A figure of an entry on a split.
    pub fn figure(
        &self,
        (arm, split): (&str, &str),
        entry: &Entry,
        name: FigureName,
    ) -> Option<&BenchmarkRow> {
        let mut rows = self.rows.iter();
        rows.find(|row| {
            row.robot == arm && row.split == split && row.figure == name && Entry::of(row) == *entry
        })
    }
}

/// How a split stands: stations, blocks, base, and what it leaks, in a sentence.
pub fn about(row: &BenchmarkRow) -> String {
    let kind = match row.split_kind {
        SplitKind::Rows => "by rows",
        SplitKind::Region => "by region",
        SplitKind::Session => "by session",
    };
    let base = match row.base {
        TableBase::Training => "base as trained",
        TableBase::Stations => "base from stations that judge nothing",
        TableBase::Test => "base fitted to the stations that judge: for comparing models only",
    };
    let mut told = format!(
        "{kind}: {} stations train, {} judge in {} blocks, {base}",
        row.train_stations, row.test_stations, row.blocks
    );
    if row.left_out > 0 {
        write!(told, "; {} listed have no usable reading", row.left_out).expect("a string");
    }
    if row.same_poses > 0 {
        write!(told, "; {} judge at a pose that trained", row.same_poses).expect("a string");
    }
    told
}

/// What a split leaks, in a sentence; `None` where it does not.
pub fn leak(row: &BenchmarkRow) -> Option<String> {
    let beside = row.beside.as_deref().unwrap_or("none");
    row.leaks.then(|| {
        format!(
            "leaks: the stations that judge stand among those that train ({:.0} % of their nearest neighbours, {:.1}° away at the median); it shows \
             interpolation, and {beside} beside it shows the arm elsewhere",
            100.0 * row.neighbour_share,
            row.nearest_rad.to_degrees()
        )
    })
}

/// Who leaves least on a split and by how much, in a sentence: less than the full error model, or where that leads than the next.
pub fn leader(content: &Content, own: (&str, &str)) -> Option<String> {
    let computed = content.of_split(own.0, own.1).filter(|row| row.entrant != Entrant::Published);
    let mean = |entry: Entry| {
        let row = content.figure(own, &entry, FigureName::Mean)?;
        Some((entry, row.value))
    };
    let mut means: Vec<(Entry, f64)> =
        Content::entries(computed).into_iter().filter_map(mean).collect();
    means.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (first, least_mm) = means.first()?;
    let told = format!("{} leaves least, a mean of {least_mm:.3} mm", first.name());
    let is_full = |entry: &Entry| {
        entry.entrant == Entrant::Posegrid && entry.model == Model::Full.about().word
    };
    let other = means.iter().map(|(entry, _)| entry);
    let compared =
        if is_full(first) { other.clone().find(|entry| !is_full(entry))? } else { first };
    let row = content.figure(own, compared, FigureName::Difference)?;
    let than = if is_full(first) {
        format!("{} leaves {:.3} mm more", compared.name(), row.value)
    } else {
        format!("{:.3} mm less than the full error model", -row.value)
    };
    let chance = match row.low.zip(row.high) {
        Some((low, high)) if low <= 0.0 && high >= 0.0 => "; that is within chance",
        Some(_) => "; that is more than chance",
        None => "; of too few blocks to tell it from chance",
    };
    Some(format!("{told}; {than}{chance}"))
}

/// A value as shown: mm with three digits, shares as percentages.
pub fn shown(name: FigureName, value: f64) -> String {
    if name.is_length() { format!("{value:.3}") } else { format!("{:.1} %", 100.0 * value) }
}

/// An interval as shown.
pub fn interval_shown(name: FigureName, low: f64, high: f64) -> String {
    if name.is_length() {
        format!("{low:.3} – {high:.3}")
    } else {
        format!("{:.1} – {:.1} %", 100.0 * low, 100.0 * high)
    }
}

fn header(content: &Content) -> Markup {
    let splits = content.splits();
    let leaking = splits
        .iter()
        .filter(|(arm, split)| content.of_split(arm, split).any(|row| row.leaks))
        .count();
    let own = &content.suite.bootstrap;
    html! {
        header {
            p.which { "Benchmark · " (content.suite.name) }
            h1 { (number_of(content.told.len(), "arm")) ", " (number_of(splits.len(), "split")) }
            p.lead { (content.suite.description) }
            p { "Every station judged took no part in training. " @if leaking > 0 { (leaking) " of the splits " @if leaking == 1 { "leaks and is named so." } @else { "leak and are named so." } } }
            p.note { "Intervals of " (shown(FigureName::Coverage, own.confidence)) " from " (own.draws) " draws of whole blocks, seed " (own.seed) "." }
            @for remark in &content.remarks { p.warning { (remark) } }
        }
    }
}

/// One row a split, one column a model.
fn all(content: &Content) -> Markup {
    let computed = || content.rows.iter().filter(|row| row.entrant != Entrant::Published);
    let entries = Content::entries(computed());
    let head = html! {
        th.word { "Arm and split" }
        @for entry in &entries { th { (entry.name()) } }
    };
    let body = html! {
        @for own in content.splits() {
            tr {
                td.word {
                    (own.0) ", " a href={ "#" (anchor(own)) } { (own.1) }
                    @if content.of_split(own.0, own.1).any(|row| row.leaks) { small.not-met { "leaks" } }
                }
                @for entry in &entries { td { (mean(content, own, entry)) } }
            }
        }
    };
    html! {
        p { "Mean distance of measured and predicted position, mm, with its interval. Where a split leaks, the figure of the split beside it stands below." }
        (table(&head, &body))
    }
}

fn mean(content: &Content, own: (&str, &str), entry: &Entry) -> Markup {
    let Some(row) = content.figure(own, entry, FigureName::Mean) else {
        return html! { "–" };
    };
    let beside = row.beside.as_deref().filter(|_| row.leaks);
    let beside = beside.and_then(|beside| content.figure((own.0, beside), entry, FigureName::Mean));
    html! {
        (shown(row.figure, row.value))
        (interval(row))
        @if let Some(beside) = beside { small { (beside.split) ": " (shown(beside.figure, beside.value)) } }
    }
}

fn interval(row: &BenchmarkRow) -> Markup {
    html! {
        @if let Some((low, high)) = row.low.zip(row.high) {
            small { (interval_shown(row.figure, low, high)) }
        }
    }
}

fn anchor((arm, split): (&str, &str)) -> String {
    format!("{arm}.{split}")
}

fn splits(content: &Content) -> Markup {
    html! { @for own in content.splits() { (split(content, own)) } }
}

/// A split with every figure of every entry.
fn split(content: &Content, own: (&str, &str)) -> Markup {
    let entries = Content::entries(content.of_split(own.0, own.1));
    let first = content.of_split(own.0, own.1).next();
    let head = html! {
        th.word { "Model" }
        @for name in FigureName::ALL {
            th { (name.words()) @if name.is_length() { ", mm" } }
        }
    };
    let body = html! {
        @for entry in &entries {
            tr {
                td.word {
                    (entry.name())
                    @if let Some(source) = source(content, own, entry) { p.note { "published: " (source) } }
                }
                @for name in FigureName::ALL {
                    td {
                        @if let Some(row) = content.figure(own, entry, name) { (shown(name, row.value)) (interval(row)) }
                        @else { "–" }
                    }
                }
            }
        }
    };
    html! {
        h3 id=(anchor(own)) { (own.0) ", " (own.1) }
        @if let Some(row) = first {
            p.note { (about(row)) }
            @if let Some(leak) = leak(row) { p.warning { (leak) "." } }
        }
        @if let Some(leader) = leader(content, own) { p { (leader) "." } }
        (table(&head, &body))
    }
}

fn source<'c>(content: &'c Content, own: (&'c str, &'c str), entry: &Entry) -> Option<&'c str> {
    let mut rows = content.of_split(own.0, own.1);
    rows.find_map(|row| row.source.as_deref().filter(|_| Entry::of(row) == *entry))
}

fn data(content: &Content) -> Markup {
    let head = html! { th.word { "Arm" } th.word { "Source and licence" } th.word { "Read, kept and left out" } };
    let arms = content.suite.arms.iter();
    let arms = arms
        .filter_map(|arm| Some((arm, &content.told.iter().find(|(name, _)| *name == arm.name)?.1)));
    let body = html! {
        @for (arm, told) in arms {
            tr {
                td.word { (arm.name) }
                td.word {
                    (arm.source.repository) small { (arm.source.licence) }
                    @if let Some(citation) = &arm.source.citation { (citation) }
                }
                td.word { @for told in told { p { (told) } } }
            }
        }
    };
    table(&head, &body)
}

fn reading(content: &Content) -> Markup {
    html! {
        ul {
            li { "Errors are distances of measured and predicted positions of the measured target at the stations that judge. Base and target are those of the training unless the split says otherwise." }
            li { "Coverage is the share of stations inside the 95 % ellipsoids that a model states, and improvement one minus its mean error over that of the nominal arm with base and target fitted. The difference is its mean error minus that of the full error model; it is more than chance where its interval has no zero in it. Of many models the one that leads on a split leads by chance too: it was chosen by the same stations." }
            li { "A split leaks where the stations that judge stand among those that train. Of their six nearest neighbours in joint space as many train as if stations had been drawn by lot, or a quarter of that at least by rows and nine tenths by region." }
            li { "An interval is from drawing whole blocks of the work space (a quarter of its extent along each axis) with replacement; there is none with fewer than eight blocks. All models of a split are judged on the same draws." }
            li { "Published figures are repeated from their sources, and were not computed here." }
        }
        @if !content.suite.programs.is_empty() {
            p { "Programs of the suite: " @for own in &content.suite.programs { (own.name) " " } }
        }
    }
}

/// A number of things in words: one arm, two arms.
fn number_of(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}
