//! `accuracy`: the figures in long form, one row each; those of repeated visits in `iso_9283`.

mod iso_9283;

use super::compensation::table_id;
use super::grid_steps::whole;
use super::{PublishError, words};
use crate::figures::least_count;
use crate::grid::{Tolerance, Verdict};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;
use crate::report::iso_9283::Iso9283;
use crate::report::verdict::RunVerdict;
use crate::report::{Accuracy, Model, Moment, Point, Split, Subject};

/// Coverage factor of the expanded uncertainties.
const COVERAGE_FACTOR: f64 = 2.0;

/// A row of the table.
struct Row<'a> {
    subject: &'a Subject,
    point: Point,
    moment: Moment,
    table_id: Option<String>,
    quantity: &'static str,
    name: &'static str,
    pose: Option<usize>,
    value: Option<f64>,
    unit: &'static str,
    expanded_uncertainty: Option<f64>,
    n: usize,
    visits: Option<usize>,
    blocks: Option<usize>,
    n_needed: Option<i64>,
    reason: Option<String>,
    /// Of a bound: what it is held against.
    verdict: Option<Verdict>,
}

/// The table of all figures. The bound of the run's own table has the verdict of the run.
pub fn accuracy<'a>(
    all: impl Iterator<Item = &'a Accuracy>,
    verdict: &RunVerdict,
    iso_9283: &'a [Iso9283],
    tolerance: &Tolerance,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let of_sets = all.flat_map(|of| {
        let own = (
            of.verdict.clone(),
            words::reason(&of.verdict).map(str::to_owned),
        );
        let (verdict, reason) = if carries_verdict(of) {
            (verdict.verdict(), verdict.reason())
        } else {
            own
        };
        figures(of, &verdict, reason.as_ref(), tolerance, key)
    });
    let rows: Vec<Row<'_>> = of_sets.chain(iso_9283::rows(iso_9283)).collect();
    let all = || rows.iter();
    let table = Columns::new(schema::find("accuracy")?, rows.len()).key(key);
    let table = words::subjects(table, || all().map(|row| row.subject))
        .column("point", all().map(|row| point(row.point)))
        .column("table_id", all().map(|row| row.table_id.as_ref()))
        .column("pose", all().map(|row| row.pose));
    Ok(limits(values(table, &rows), &rows, tolerance).finish()?)
}

/// Whether a figure is the one that the verdict of the run is read from: the run's own table on held-out blocks.
fn carries_verdict(of: &Accuracy) -> bool {
    (of.subject.model, of.subject.split, of.point) == (Model::Table, Split::Blocks, Point::Tool)
}

/// The figures of one set, those that are not there left out; the bound always, as it carries the verdict.
fn figures<'a>(
    of: &'a Accuracy,
    verdict: &Verdict,
    reason: Option<&String>,
    tolerance: &Tolerance,
    key: &RunKey,
) -> Vec<Row<'a>> {
    let figures = of.figures.as_ref();
    let named = [
        ("mean", figures.map(|f| f.mean)),
        ("rms", figures.map(|f| f.rms)),
        ("p95", figures.map(|f| f.p95)),
        ("p99", figures.map(|f| f.p99)),
        ("max", figures.map(|f| f.max)),
        (
            "mean_plus_3sd",
            figures.map(crate::figures::Figures::mean_plus_3_sd),
        ),
        (BOUND, of.bound),
        ("share_in_ellipsoid", of.coverage.map(|c| c.inside)),
        (
            "mean_mahalanobis_squared",
            of.coverage.map(|c| c.mean_squared_distance),
        ),
    ];
    let there = |(name, value): &(&'static str, Option<f64>)| value.is_some() || *name == BOUND;
    let figure = |(name, value)| figure(of, name, value, tolerance, key);
    let judged = |row: Row<'a>| match row.name {
        BOUND => Row {
            verdict: Some(verdict.clone()),
            reason: reason.cloned(),
            n: of.counted.poses,
            visits: Some(of.counted.visits),
            ..row
        },
        _ => row,
    };
    let rows = named.into_iter().filter(there).map(figure);
    rows.map(judged).collect()
}

const BOUND: &str = "bound";

fn figure<'a>(
    of: &'a Accuracy,
    name: &'static str,
    value: Option<f64>,
    tolerance: &Tolerance,
    key: &RunKey,
) -> Row<'a> {
    // Residuals against their own covariances: a number without unit.
    let is_coverage = matches!(name, "share_in_ellipsoid" | "mean_mahalanobis_squared");
    let is_bound = name == BOUND;
    let own = (of.subject.model == Model::Table).then(|| table_id(key).to_owned());
    Row {
        subject: &of.subject,
        point: of.point,
        moment: of.moment,
        table_id: of.driven_by.clone().or(own),
        quantity: if is_coverage {
            "coverage"
        } else {
            "position_error"
        },
        name,
        pose: None,
        value,
        unit: if is_coverage { "1" } else { "mm" },
        expanded_uncertainty: (!is_coverage).then_some(of.expanded_uncertainty_mm),
        n: of.figures.map_or(0, |figures| figures.n),
        visits: None,
        blocks: of.blocks,
        n_needed: is_bound.then(|| whole(least_count(tolerance.coverage()))),
        reason: None,
        verdict: None,
    }
}

const fn point(point: Point) -> &'static str {
    match point {
        Point::Measured => "measured_point",
        Point::Tool => "tool_point",
        Point::Tip => "tool_tip",
    }
}

fn values(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let moment = |row: &Row<'_>| match row.moment {
        Moment::Before => ("measured", "before"),
        Moment::After => ("predicted", "after"),
        Moment::MeasuredAfter => ("measured_after", "after"),
    };
    let all = || rows.iter();
    columns
        .column("evidence", all().map(|row| moment(row).0))
        .column("moment", all().map(|row| moment(row).1))
        .column("quantity", all().map(|row| row.quantity))
        .column("name", all().map(|row| row.name))
        .column("value", all().map(|row| row.value))
        .column("unit", all().map(|row| row.unit))
        .column(
            "expanded_uncertainty",
            all().map(|row| row.expanded_uncertainty),
        )
        .column(
            "coverage_factor",
            all().map(|row| row.expanded_uncertainty.map(|_| COVERAGE_FACTOR)),
        )
        .column("n", all().map(|row| row.n))
        .column("visits", all().map(|row| row.visits))
        .column("blocks", all().map(|row| row.blocks))
}

/// What figures are held against.
fn limits(columns: Columns, rows: &[Row<'_>], tolerance: &Tolerance) -> Columns {
    let of_bounds = |value: f64| {
        rows.iter()
            .map(move |row| row.verdict.as_ref().map(|_| value))
    };
    columns
        .column("n_needed", rows.iter().map(|row| row.n_needed))
        .column("share", of_bounds(tolerance.share))
        .column("confidence", of_bounds(tolerance.confidence))
        .column("tolerance", of_bounds(tolerance.mm))
        .column(
            "verdict",
            rows.iter()
                .map(|row| row.verdict.as_ref().map(words::verdict)),
        )
        .column("reason", rows.iter().map(|row| row.reason.as_ref()))
}
