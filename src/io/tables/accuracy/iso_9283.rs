//! Rows of ISO 9283's figures, under the standard's names.

use super::{AccuracyRow, FigureKind, FigureName, Unit};
use crate::report::iso_9283::{Figure, Iso9283};

pub(super) fn rows(all: &[Iso9283]) -> impl Iterator<Item = AccuracyRow> {
    all.iter().flat_map(|of| of.figures.iter().map(move |figure| row(of, figure)))
}

fn row(of: &Iso9283, figure: &Figure) -> AccuracyRow {
    let is_angle = figure.characteristic.is_angle();
    let row = AccuracyRow {
        pose: figure.pose,
        value: figure.value,
        n: figure.n,
        n_needed: i64::try_from(figure.n_needed).ok(),
        reason: figure.remark.clone(),
        table_id: of.driven_by.clone(),
        ..AccuracyRow::of(
            &of.subject,
            of.point,
            of.moment,
            FigureKind::Iso9283,
            FigureName::Iso(figure.characteristic),
            if is_angle { Unit::Rad } else { Unit::Mm },
        )
    };
    if is_angle { row } else { row.with_uncertainty(of.expanded_uncertainty_mm) }
}
