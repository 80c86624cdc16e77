//! Words of the tables → words on the page, and numbers in fixed digits.

use maud::{Markup, html};

use super::content::Subject;
use crate::report::{Angles, Model};

/// What corrects the error.
pub(super) fn model(word: &str) -> &str {
    Model::of_word(word).map_or(word, |model| model.about().name)
}

/// The look of a model in every chart.
pub(super) fn look(model: &str) -> usize {
    Model::of_word(model).map_or(3, |model| model.about().look)
}

/// The model of a subject, with the angles where they make a difference.
pub(super) fn subject(subject: &Subject) -> String {
    match (Model::of_word(&subject.model), subject.angles.as_str()) {
        (Some(model), "commanded") => model.name_at(Angles::Commanded),
        _ => model(&subject.model).to_owned(),
    }
}

/// The stations that judged.
pub(super) fn stations(subject: &Subject) -> String {
    let session = &subject.of_session;
    if subject.model == "table" && subject.split == "session" {
        return format!("{session}, driven by a table; base from its first stations");
    }
    if subject.model == "raw_command" && subject.split == "none" {
        return format!("{session}, every station");
    }
    judged(subject)
}

/// The stations that took no part or did, by how they were kept from training.
pub(super) fn judged(subject: &Subject) -> String {
    let session = &subject.of_session;
    match (subject.split.as_str(), subject.base_refit.as_str()) {
        ("none", _) => format!("{session}, training"),
        ("blocks", _) => format!("{session}, held-out blocks"),
        (_, "first") => format!("{session}, unseen; base from its first stations"),
        (_, "all") => format!("{session}, unseen; base refitted on all of it"),
        _ => format!("{session}, unseen"),
    }
}

/// A verdict's word.
pub(super) fn verdict(word: &str) -> &str {
    match word {
        "met" => "met",
        "not_met" => "not met",
        "not_shown" => "not shown",
        other => other,
    }
}

/// Whether a parameter could be told apart.
pub(super) fn identifiability(word: &str) -> &str {
    match word {
        "told_apart" => "told apart",
        "fixed" => "fixed by the settings",
        "moves_nothing" => "moves nothing that was measured",
        "structurally_dependent" => "the same motion as others",
        "weak" => "hardly more than its prior",
        other => other,
    }
}

/// A table's word with its underscores as spaces; a sentence stays as it is.
pub(super) fn plain(word: &str) -> String {
    let is_word = !word.contains(' ');
    if is_word {
        word.replace('_', " ")
    } else {
        word.to_owned()
    }
}

/// A number in fixed digits, with a real minus; the element carries the value that the table has.
pub(super) fn number(value: f64, digits: usize) -> Markup {
    html! { data value=(value) { (fixed(value, digits)) } }
}

/// The same of a value that may be absent.
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

/// A whole number with its thousands apart.
pub(super) fn whole(value: u64) -> String {
    let digits = value.to_string();
    let place = |i: usize| i > 0 && (digits.len() - i).is_multiple_of(3);
    digits
        .char_indices()
        .fold(String::new(), |mut text, (i, digit)| {
            if place(i) {
                text.push('\u{202f}');
            }
            text.push(digit);
            text
        })
}

/// A share as a percentage without needless digits.
pub(super) fn percent(share: f64) -> String {
    let text = format!("{:.2}", 100.0 * share);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_in_fixed_digits() {
        assert_eq!(fixed(-0.0004, 3), "0.000");
        assert_eq!(fixed(-1.25, 1), "\u{2212}1.2");
        assert_eq!(whole(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(
            [percent(0.95), percent(0.995), percent(1.0)],
            ["95", "99.5", "100"]
        );
    }
}
