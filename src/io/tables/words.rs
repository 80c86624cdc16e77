//! Enumerations → the words that the schemas allow.

use nalgebra::{Isometry3, Matrix3, UnitQuaternion};

use crate::grid::Verdict;
use crate::io::table::Columns;
use crate::report::{Angles, BaseRefit, Model, Split, Subject};

/// The columns that say what residuals or figures are of.
pub(super) fn subjects<'s, S: Iterator<Item = &'s Subject>>(
    table: Columns,
    all: impl Fn() -> S,
) -> Columns {
    table
        .column("split", all().map(|s| split(s.split)))
        .column("model", all().map(|s| model(s.model)))
        .column("angles", all().map(|s| angles(s.angles)))
        .column("base_refit", all().map(|s| base_refit(s.base_refit)))
        .column("role", all().map(|s| role(s.split)))
        .column("of_session", all().map(|s| &s.of_session))
}

pub(super) const fn model(model: Model) -> &'static str {
    model.about().word
}

pub(super) const fn angles(angles: Angles) -> &'static str {
    match angles {
        Angles::Reported => "reported",
        Angles::Blended => "blended",
        Angles::Commanded => "commanded",
    }
}

pub(super) const fn split(split: Split) -> &'static str {
    match split {
        Split::None => "none",
        Split::Blocks => "blocks",
        Split::Session => "session",
    }
}

/// What part the stations of a split had in the fit.
pub(super) const fn role(split: Split) -> &'static str {
    match split {
        Split::None => "training",
        Split::Blocks | Split::Session => "held_out",
    }
}

pub(super) const fn base_refit(refit: BaseRefit) -> &'static str {
    match refit {
        BaseRefit::None => "none",
        BaseRefit::First => "first",
        BaseRefit::All => "all",
    }
}

pub(super) const fn verdict(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Meets => "met",
        Verdict::DoesNotMeet => "not_met",
        Verdict::NotShown(_) => "not_shown",
    }
}

/// Why a verdict is not shown.
pub(super) fn reason(verdict: &Verdict) -> Option<&str> {
    match verdict {
        Verdict::NotShown(reason) => Some(reason),
        Verdict::Meets | Verdict::DoesNotMeet => None,
    }
}

/// x y z w.
pub(super) fn xyzw(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    rotation.coords.into()
}

/// x y z, mm, and x y z w.
pub(super) fn placement(isometry: &Isometry3<f64>) -> ([f64; 3], [f64; 4]) {
    (isometry.translation.vector.into(), xyzw(&isometry.rotation))
}

/// xx xy xz yy yz zz.
pub(super) fn upper(matrix: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place])
}
