//! `accuracy`: the figures in long form, one row each.

use super::compensation::table_id;
use super::grid_steps::whole;
use super::{PublishError, words};
use crate::figures::least_count;
use crate::grid::Tolerance;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::manifest::RunKey;
use crate::report::{Accuracy, Model, Moment, Point};

/// Coverage factor of the expanded uncertainties.
const COVERAGE_FACTOR: f64 = 2.0;

/// One figure of one set of stations.
struct Figure<'a> {
    of: &'a Accuracy,
    name: &'static str,
    value: Option<f64>,
}

/// The table of all figures.
pub fn accuracy<'a>(
    all: impl Iterator<Item = &'a Accuracy>,
    tolerance: &Tolerance,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let rows: Vec<Figure<'_>> = all.flat_map(figures).collect();
    let subjects = || rows.iter().map(|row| &row.of.subject);
    let table_of = |of: &'_ Accuracy| {
        let own = (of.subject.model == Model::Table).then(|| table_id(key));
        of.driven_by.clone().or(own.map(str::to_owned))
    };
    let table = Columns::new(schema::find("accuracy")?, rows.len()).key(key);
    let table = words::subjects(table, subjects)
        .column("point", rows.iter().map(|row| point(row.of.point)))
        .column("table_id", rows.iter().map(|row| table_of(row.of)))
        .absent(["pose"]);
    Ok(limits(values(table, &rows), &rows, tolerance).finish()?)
}

/// The figures of one set, those that are not there left out; the bound always, as it carries the verdict.
fn figures(of: &Accuracy) -> Vec<Figure<'_>> {
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
        ("bound", of.bound),
        ("share_in_ellipsoid", of.coverage.map(|c| c.inside)),
        (
            "mean_mahalanobis_squared",
            of.coverage.map(|c| c.mean_squared_distance),
        ),
    ];
    let there = |(name, value): &(&'static str, Option<f64>)| value.is_some() || *name == BOUND;
    let figure = |(name, value)| Figure { of, name, value };
    named.into_iter().filter(there).map(figure).collect()
}

const BOUND: &str = "bound";

impl Figure<'_> {
    fn is_bound(&self) -> bool {
        self.name == BOUND
    }

    /// Whether it is of residuals against their own covariances: a number without unit.
    fn is_coverage(&self) -> bool {
        matches!(self.name, "share_in_ellipsoid" | "mean_mahalanobis_squared")
    }
}

const fn point(point: Point) -> &'static str {
    match point {
        Point::Measured => "measured_point",
        Point::Tool => "tool_point",
        Point::Tip => "tool_tip",
    }
}

fn values(columns: Columns, rows: &[Figure<'_>]) -> Columns {
    let moment = |row: &Figure<'_>| match row.of.moment {
        Moment::Before => ("measured", "before"),
        Moment::After => ("predicted", "after"),
        Moment::MeasuredAfter => ("measured_after", "after"),
    };
    let quantity = |row: &Figure<'_>| {
        if row.is_coverage() {
            "coverage"
        } else {
            "position_error"
        }
    };
    let uncertainty =
        |row: &Figure<'_>| (!row.is_coverage()).then_some(row.of.expanded_uncertainty_mm);
    columns
        .column("evidence", rows.iter().map(|row| moment(row).0))
        .column("moment", rows.iter().map(|row| moment(row).1))
        .column("quantity", rows.iter().map(quantity))
        .column("name", rows.iter().map(|row| row.name))
        .column("value", rows.iter().map(|row| row.value))
        .column(
            "unit",
            rows.iter()
                .map(|row| if row.is_coverage() { "1" } else { "mm" }),
        )
        .column("expanded_uncertainty", rows.iter().map(uncertainty))
        .column(
            "coverage_factor",
            rows.iter()
                .map(|row| uncertainty(row).map(|_| COVERAGE_FACTOR)),
        )
        .column(
            "n",
            rows.iter()
                .map(|row| row.of.figures.map_or(0, |figures| figures.n)),
        )
        .column("blocks", rows.iter().map(|row| row.of.blocks))
}

/// What the bound is held against.
fn limits(columns: Columns, rows: &[Figure<'_>], tolerance: &Tolerance) -> Columns {
    let needed = whole(least_count(tolerance.coverage()));
    let bound = || rows.iter().map(|row| row.is_bound().then_some(row.of));
    columns
        .column("n_needed", bound().map(|of| of.map(|_| needed)))
        .column("share", bound().map(|of| of.map(|_| tolerance.share)))
        .column(
            "confidence",
            bound().map(|of| of.map(|_| tolerance.confidence)),
        )
        .column("tolerance", bound().map(|of| of.map(|_| tolerance.mm)))
        .column(
            "verdict",
            bound().map(|of| of.map(|of| words::verdict(&of.verdict))),
        )
        .column(
            "reason",
            bound().map(|of| of.and_then(|of| words::reason(&of.verdict))),
        )
}
