//! What the logs of a session gave: rows of `clocks`, `stations` and `rejects`.

use std::collections::BTreeMap;

use super::row::{Row, rows};
use crate::io::table::Table;
use crate::report::page::content::{Clock, Reject, Session};

/// A session of the run; `None` where its tables are not among these.
pub(super) fn of_session(tables: &[Table], name: &str, trained: bool) -> Option<Session> {
    let own = |table| {
        rows(tables, table)
            .filter(move |row| row.table.key().is_some_and(|key| key.session == name))
    };
    let mut dwells: BTreeMap<(String, Option<String>), usize> = BTreeMap::new();
    for row in own("stations") {
        *dwells
            .entry((row.text("verdict"), row.optional_text("reason")))
            .or_default() += 1;
    }
    Some(Session {
        name: name.to_owned(),
        trained,
        clock: own("clocks").next().map(|row| clock(&row))?,
        dwells: dwells
            .into_iter()
            .map(|((verdict, reason), count)| (verdict, reason, count))
            .collect(),
        rejects: own("rejects").map(|row| reject(&row)).collect(),
    })
}

fn clock(row: &Row<'_>) -> Clock {
    Clock {
        offset_ns: ["offset_ns", "offset_se_ns"].map(|column| row.number(column)),
        drift_ppm: ["drift_ppm", "drift_se_ppm"].map(|column| row.number(column)),
        edges: row.whole("matched_edges"),
        rms_ns: row.number("edge_rms_ns"),
        method: row.text("method"),
    }
}

fn reject(row: &Row<'_>) -> Reject {
    Reject {
        stage: row.text("stage"),
        kind: row.text("kind"),
        reason: row.text("reason"),
        number: row.optional_whole("number"),
    }
}
