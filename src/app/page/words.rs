use maud::{Markup, html};

use crate::fit::{Identifiability, Mounted, Uncertainty};
use crate::grid::Interpolation;
use crate::io::rows::Word as _;
use crate::io::tables::plan_figures::{CorrectedBy, FigureRow};
use crate::io::tables::sampling_plan::VisitPurpose;
use crate::io::tables::words::TableVerdict;
use crate::plan::Kind;
use crate::report::chart::Limit;
use crate::report::{BaseRefit, Model, Moment, Split, Subject};

pub(super) fn stations(subject: &Subject) -> String {
    let how = match (subject.model, subject.split) {
        (Model::Table, Split::Session) => "driven by a table; base from its first stations",
        (Model::RawCommand, Split::None) => "every station",
        _ => return judged(subject),
    };
    format!("{}, {how}", subject.of_session)
}

/// The stations that judged, with how they were kept from training or that they were not.
pub(super) fn judged(subject: &Subject) -> String {
    let how = match (subject.split, subject.base_refit) {
        (Split::None, _) => "training",
        (Split::Blocks, _) => "held-out blocks",
        (Split::Session, BaseRefit::First) => "unseen; base from its first stations",
        (Split::Session, BaseRefit::Chosen) => "unseen; base from stations chosen by their poses",
        (Split::Session, BaseRefit::All) => "unseen; base refitted on all of it",
        (Split::Session, BaseRefit::None) => "unseen",
    };
    format!("{}, {how}", subject.of_session)
}

pub(super) const fn verdict(verdict: TableVerdict) -> &'static str {
    match verdict {
        TableVerdict::Met => "met",
        TableVerdict::NotMet => "not met",
        TableVerdict::NotShown => "not shown",
    }
}

pub(super) const fn headline(verdict: TableVerdict) -> &'static str {
    match verdict {
        TableVerdict::Met => "Tolerance met",
        TableVerdict::NotMet => "Tolerance not met",
        TableVerdict::NotShown => "Not shown to meet the tolerance",
    }
}

pub(super) const fn evidence(of: Moment) -> &'static str {
    match of {
        Moment::Before => "before",
        Moment::After => "after, predicted",
        Moment::MeasuredAfter => "after, measured",
    }
}

/// The uncertainty of an instrument, as the pipeline file states it.
pub fn instrument(of: &Uncertainty, takes_orientations: bool) -> String {
    match of {
        Uncertainty::Tracker(of) => {
            let orientation = of.orientation_rad.filter(|_| takes_orientations);
            let orientation = orientation
                .map_or_else(String::new, |rad| format!("; {:.0} µrad in orientation", 1e6 * rad));
            format!(
                "{} µm + {} µm/m along the beam, {} µm + {} µm/m across it, limits divided by {}{orientation}",
                of.range_um,
                of.range_um_per_m,
                of.transverse_um,
                of.transverse_um_per_m,
                of.divisor
            )
        }
        Uncertainty::Camera(of) => {
            let place = match of.mounted {
                Mounted::Fixed => "a camera in the cell, the target at the flange",
                Mounted::Flange => "a camera on the flange, the target in the cell",
            };
            format!(
                "{place}; focal length {} px, corners found to {} px, a target of {} mm with {} corners along an edge",
                of.focal_px, of.noise_px, of.target_mm, of.corners
            )
        }
    }
}

/// The sign of a verdict, which distinguishes them without colour too.
pub(super) fn mark(verdict: TableVerdict) -> Markup {
    let (class, sign) = sign(verdict);
    html! { span class={ "mark " (class) } aria-hidden="true" { (sign) } }
}

/// Class and sign of a verdict's mark.
pub(super) const fn sign(verdict: TableVerdict) -> (&'static str, &'static str) {
    match verdict {
        TableVerdict::Met => ("met", "✓"),
        TableVerdict::NotMet => ("not-met", "✗"),
        TableVerdict::NotShown => ("not-shown", "?"),
    }
}

pub(super) const fn identifiability(found: Identifiability) -> &'static str {
    match found {
        Identifiability::Identifiable => "identifiable",
        Identifiability::MovesNothing => "moves nothing that was measured",
        Identifiability::StructurallyDependent => "the same motion as others",
        Identifiability::Weak => "hardly more than its prior",
        Identifiability::Confounded => "known together with others only",
        Identifiability::ByConvention => "zero by convention: offsets are counted from it",
    }
}

pub(super) fn design(design: Kind) -> String {
    match design {
        Kind::DOptimal => "D-optimal".to_owned(),
        Kind::UniformGrid | Kind::Random | Kind::GreedyVariance => plain(design.word()),
    }
}

/// The interpolation inside a cell, with the word of the tables where that is an abbreviation.
pub(super) const fn inside(own: Interpolation) -> &'static str {
    match own {
        Interpolation::Idw => "inverse distance (idw)",
        Interpolation::Trilinear => "trilinear",
    }
}

/// Warnings that differ in session, numbers and names alone, each first one with the others, in their order.
pub fn alike(warnings: &[String]) -> Vec<(&str, Vec<&str>)> {
    let mut folded: Vec<(&str, Vec<&str>)> = Vec::new();
    for own in warnings {
        match folded.iter_mut().find(|(first, _)| kind(first) == kind(own)) {
            Some((_, others)) => others.push(own),
            None => folded.push((own, Vec::new())),
        }
    }
    folded
}

/// A warning without its session, and without what stands between quotes or is a number.
fn kind(warning: &str) -> String {
    let text = warning.split_once(": ").map_or(warning, |(_, text)| text);
    let unnamed: String = text.split('"').step_by(2).collect();
    unnamed.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// A message whose commands and keys between ticks are code.
pub(super) fn message(text: &str) -> Markup {
    html! {
        @for (place, part) in text.split('`').enumerate() {
            @if place % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}

/// Source of the node values, and interpolation inside a cell, in a few words.
pub(super) fn family(figure: &FigureRow) -> String {
    let source = plain(figure.source.word());
    match figure.interpolation {
        Some(interpolation) => format!("{source}, {}", inside(interpolation)),
        None => source,
    }
}

/// Source of the node values, and interpolation inside a cell, for a sentence.
pub(super) fn origin(figure: &FigureRow) -> String {
    let source = match figure.source {
        CorrectedBy::Measured => "as measured".to_owned(),
        CorrectedBy::Model => "from the model".to_owned(),
        CorrectedBy::IdentifiedArm => plain(figure.source.word()),
    };
    let inside = figure.interpolation.map(|own| format!(", {} inside a cell", inside(own)));
    format!("node values {source}{}", inside.unwrap_or_default())
}

pub(super) fn purpose(purpose: VisitPurpose) -> &'static str {
    match purpose {
        VisitPurpose::Identify => "identify",
        VisitPurpose::Verify => "verify",
        VisitPurpose::DriftCheck => "again, for drift",
    }
}

/// A table's word with its underscores as spaces; a sentence stays as it is.
pub(super) fn plain(word: &str) -> String {
    if word.contains(' ') { word.to_owned() } else { word.replace('_', " ") }
}

/// A number in fixed digits, with a minus sign; the element carries the value of the table.
pub(super) fn number(value: f64, digits: usize) -> Markup {
    html! { data value=(value) { (fixed(value, digits)) } }
}

/// A number in fixed digits, or a dash where it is absent.
pub(super) fn optional(value: Option<f64>, digits: usize) -> Markup {
    html! { @match value { Some(value) => (number(value, digits)), None => "–" } }
}

/// A number in fixed digits; never `-0`.
pub(super) fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("\u{2212}{rest}"),
        None => text,
    }
}

/// The line of a tolerance in a chart.
pub(super) fn tolerance(mm: f64) -> Limit {
    Limit { name: format!("tolerance {mm} mm"), value: mm }
}

pub(super) fn whole(value: u64) -> String {
    let digits = value.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join("\u{202f}")
}

pub fn percent(share: f64) -> String {
    format!("{:.2}", 100.0 * share).trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_that_differ_in_session_numbers_and_names_alone_are_folded() {
        let all = [
            "mon: reference \"F1\" was moved by 0.31 mm",
            "mon: the log ends too early",
            "tue: reference \"F2\" was moved by 12.05 mm",
        ]
        .map(str::to_owned);
        let [first, log, second] = all.each_ref().map(String::as_str);
        assert_eq!(alike(&all), [(first, vec![second]), (log, vec![])]);
    }

    #[test]
    fn numbers_are_written_in_fixed_digits() {
        assert_eq!(fixed(-0.0004, 3), "0.000");
        assert_eq!(fixed(-1.25, 1), "\u{2212}1.2");
        assert_eq!(whole(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!([percent(0.95), percent(0.995), percent(1.0)], ["95", "99.5", "100"]);
    }
}
