//! `accuracy`: the figures in long form, one row each.

use std::collections::BTreeMap;

use super::compensation::table_id;
use super::grid_steps::whole;
use super::words::{self, Role, TableVerdict, Unit};
use crate::figures::{COVERAGE_FACTOR, Figures, least_count};
use crate::grid::{Tolerance, Verdict};
use crate::manifest::RunKey;
use crate::report::iso_9283::{Characteristic, Figure, Iso9283};
use crate::report::verdict::RunVerdict;
use crate::report::{Accuracy, Model, Moment, Point, Split, Subject};
use crate::rows::{row, words};
use crate::units::WallTime;

row! {
    pub struct AccuracyRow of "accuracy" {
        subject: Subject,
        base_stations: Option<usize>,
        target_found: Option<bool>,
        role: Role,
        evidence: Moment,
        moment: BeforeAfter,
        point: Point,
        quantity: FigureKind,
        name: FigureName,
        session_started: Option<WallTime>,
        pose: Option<usize>,
        value: Option<f64>,
        unit: Unit,
        expanded_uncertainty: Option<f64>,
        coverage_factor: Option<f64>,
        n: usize,
        visits: Option<usize>,
        blocks: Option<usize>,
        n_needed: Option<i64>,
        share: Option<f64>,
        confidence: Option<f64>,
        tolerance: Option<f64>,
        verdict: Option<TableVerdict>,
        reason: Option<String>,
        table_id: Option<String>,
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FigureName {
    Mean,
    Rms,
    P95,
    P99,
    Max,
    MeanPlus3Sd,
    /// Distribution-free upper tolerance bound.
    Bound,
    Iso(Characteristic),
    /// Share of stations inside their 95 % ellipsoid.
    ShareInEllipsoid,
    MeanMahalanobisSquared,
}

words! {
    pub enum BeforeAfter {
        Before: "before",
        /// After, measured or predicted.
        After: "after",
    }

    pub enum FigureKind {
        PositionError: "position_error",
        Iso9283: "iso_9283",
        /// The agreement of stated covariances with the errors found.
        Coverage: "coverage",
    }
    FigureName {
        Mean: "mean",
        Rms: "rms",
        P95: "p95",
        P99: "p99",
        Max: "max",
        MeanPlus3Sd: "mean_plus_3sd",
        Bound: "bound",
        Iso(Characteristic::ApP): "AP_p",
        Iso(Characteristic::ApX): "AP_x",
        Iso(Characteristic::ApY): "AP_y",
        Iso(Characteristic::ApZ): "AP_z",
        Iso(Characteristic::ApA): "AP_a",
        Iso(Characteristic::ApB): "AP_b",
        Iso(Characteristic::ApC): "AP_c",
        Iso(Characteristic::RpL): "RP_l",
        Iso(Characteristic::RpA): "RP_a",
        Iso(Characteristic::RpB): "RP_b",
        Iso(Characteristic::RpC): "RP_c",
        Iso(Characteristic::AdP): "AD_p",
        Iso(Characteristic::AdX): "AD_x",
        Iso(Characteristic::AdY): "AD_y",
        Iso(Characteristic::AdZ): "AD_z",
        Iso(Characteristic::Rd): "RD",
        Iso(Characteristic::VapP): "vAP_p",
        Iso(Characteristic::DapP): "dAP_p",
        ShareInEllipsoid: "share_in_ellipsoid",
        MeanMahalanobisSquared: "mean_mahalanobis_squared",
    }
}

impl AccuracyRow {
    /// A figure of this kind and name, with all other columns absent.
    fn of(
        subject: &Subject,
        point: Point,
        moment: Moment,
        quantity: FigureKind,
        name: FigureName,
        unit: Unit,
    ) -> Self {
        Self {
            subject: subject.clone(),
            base_stations: None,
            target_found: None,
            role: subject.split.into(),
            evidence: moment,
            moment: match moment {
                Moment::Before => BeforeAfter::Before,
                Moment::After | Moment::MeasuredAfter => BeforeAfter::After,
            },
            point,
            quantity,
            name,
            session_started: None,
            pose: None,
            value: None,
            unit,
            expanded_uncertainty: None,
            coverage_factor: None,
            n: 0,
            visits: None,
            blocks: None,
            n_needed: None,
            share: None,
            confidence: None,
            tolerance: None,
            verdict: None,
            reason: None,
            table_id: None,
        }
    }

    fn with_uncertainty(self, expanded_mm: f64) -> Self {
        Self {
            expanded_uncertainty: Some(expanded_mm),
            coverage_factor: Some(COVERAGE_FACTOR),
            ..self
        }
    }
}

/// The rows of all figures, with the start of their sessions (`starts`, by name). The bound of the run's own table has the verdict
/// of that table.
pub fn rows<'a>(
    all: impl Iterator<Item = &'a Accuracy>,
    verdict: &RunVerdict,
    iso_9283: &[Iso9283],
    tolerance: &Tolerance,
    key: &RunKey,
    starts: &BTreeMap<&str, WallTime>,
) -> Vec<AccuracyRow> {
    let of_sets = all.flat_map(|of| {
        let (verdict, reason) = if carries_verdict(of) {
            (verdict.table.verdict(), verdict.table.reason())
        } else {
            (of.verdict.clone(), words::reason(&of.verdict).map(str::to_owned))
        };
        figures(of, &verdict, reason.as_ref(), tolerance, key)
    });
    let dated = |row: AccuracyRow| AccuracyRow {
        session_started: starts.get(row.subject.of_session.as_str()).copied(),
        ..row
    };
    let of_iso = iso_9283.iter();
    let of_iso = of_iso.flat_map(|of| of.figures.iter().map(move |figure| iso_figure(of, figure)));
    of_sets.chain(of_iso).map(dated).collect()
}

/// Whether a figure is the one that the verdict of the table stands with: the run's own table on held-out blocks.
fn carries_verdict(of: &Accuracy) -> bool {
    (of.subject.model, of.subject.split, of.point) == (Model::Table, Split::Blocks, Point::Tool)
}

/// The figures of one set, without those that are absent; the bound always, since it has the verdict.
fn figures(
    of: &Accuracy,
    verdict: &Verdict,
    reason: Option<&String>,
    tolerance: &Tolerance,
    key: &RunKey,
) -> Vec<AccuracyRow> {
    let (figures, coverage) = (of.figures.as_ref(), of.coverage.as_ref());
    let norms = [
        (FigureName::Mean, figures.map(|f| f.mean)),
        (FigureName::Rms, figures.map(|f| f.rms)),
        (FigureName::P95, figures.map(|f| f.p95)),
        (FigureName::P99, figures.map(|f| f.p99)),
        (FigureName::Max, figures.map(|f| f.max)),
        (FigureName::MeanPlus3Sd, figures.map(Figures::mean_plus_3_sd)),
    ];
    let covered = [
        (FigureName::ShareInEllipsoid, coverage.map(|c| c.inside)),
        (FigureName::MeanMahalanobisSquared, coverage.map(|c| c.mean_squared_distance)),
    ];
    let figure = |kind, name, value| figure(of, kind, name, value, key);
    let there = |(kind, name, value): (FigureKind, FigureName, Option<f64>)| {
        value.map(|value| figure(kind, name, Some(value)))
    };
    let norms = norms.map(|(name, value)| (FigureKind::PositionError, name, value));
    let covered = covered.map(|(name, value)| (FigureKind::Coverage, name, value));
    let bound = AccuracyRow {
        n: of.counted.poses,
        visits: Some(of.counted.visits),
        n_needed: Some(whole(least_count(tolerance.coverage()))),
        share: Some(tolerance.share),
        confidence: Some(tolerance.confidence),
        tolerance: Some(tolerance.mm),
        verdict: Some(verdict.into()),
        reason: reason.cloned(),
        ..figure(FigureKind::PositionError, FigureName::Bound, of.bound)
    };
    norms.into_iter().chain(covered).filter_map(there).chain([bound]).collect()
}

fn figure(
    of: &Accuracy,
    quantity: FigureKind,
    name: FigureName,
    value: Option<f64>,
    key: &RunKey,
) -> AccuracyRow {
    // Residuals against their own covariances are a number without unit.
    let is_length = quantity == FigureKind::PositionError;
    let unit = if is_length { Unit::Mm } else { Unit::One };
    let own = (of.subject.model == Model::Table).then(|| table_id(key).to_owned());
    let row = AccuracyRow {
        value,
        n: of.figures.map_or(0, |figures| figures.n),
        base_stations: of.finders.map(|finders| finders.stations),
        target_found: of.finders.map(|finders| finders.with_target),
        blocks: of.blocks,
        table_id: of.driven_by.clone().or(own),
        ..AccuracyRow::of(&of.subject, of.point, of.moment, quantity, name, unit)
    };
    if is_length { row.with_uncertainty(of.expanded_uncertainty_mm) } else { row }
}

/// A figure of ISO 9283, under the standard's name.
fn iso_figure(of: &Iso9283, figure: &Figure) -> AccuracyRow {
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
