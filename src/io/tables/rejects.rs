//! `rejects`: messages and byte ranges of the logs, readings and dwells that were left out, with reasons.

use super::{PublishError, stations};
use crate::ingest::LogReject;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::join::{JoinReject, Pairing, Station};
use crate::manifest::RunKey;
use crate::pipeline::outcome::JoinedSession;

/// One row, its number aside.
#[derive(Debug, Clone, Default)]
struct Row<'a> {
    stage: &'static str,
    kind: &'static str,
    number: Option<u64>,
    reason: &'a str,
    log: Option<&'a LogReject>,
    clock: Option<&'static str>,
    span_ns: Option<(i64, i64)>,
    station: Option<usize>,
}

/// The table of one session's rejects, in the order of the stages.
pub fn rejects(session: &JoinedSession, key: &RunKey) -> Result<Table, PublishError> {
    let mut rows: Vec<Row<'_>> = session.log_rejects.iter().map(of_log).collect();
    rows.extend(session.joined.rejects.iter().map(of_readings));
    rows.extend(session.joined.stations.iter().filter_map(of_dwell));
    let logs = || rows.iter().map(|row| row.log);
    let table = Columns::new(schema::find("rejects")?, rows.len())
        .key(key)
        .column("reject", 0..rows.len())
        .column("stage", rows.iter().map(|row| row.stage))
        .column("kind", rows.iter().map(|row| row.kind))
        .column("number", rows.iter().map(|row| row.number))
        .column("reason", rows.iter().map(|row| row.reason))
        .column("file", logs().map(|log| log.map(|log| &log.file)))
        .column(
            "topic",
            logs().map(|log| log.and_then(|log| log.topic.as_ref())),
        )
        .column(
            "byte_start",
            logs().map(|log| log.map(|log| log.byte_start)),
        )
        .column("byte_end", logs().map(|log| log.map(|log| log.byte_end)))
        .column("clock", rows.iter().map(|row| row.clock))
        .column(
            "start_ns",
            rows.iter().map(|row| row.span_ns.map(|span| span.0)),
        )
        .column(
            "end_ns",
            rows.iter().map(|row| row.span_ns.map(|span| span.1)),
        )
        .column("station", rows.iter().map(|row| row.station));
    Ok(table.finish()?)
}

/// Messages where their number is known, otherwise the bytes they were lost with.
fn of_log(log: &LogReject) -> Row<'_> {
    let (kind, number) = match log.messages {
        Some(messages) => ("messages", messages),
        None => ("bytes", log.byte_end.saturating_sub(log.byte_start)),
    };
    Row {
        stage: "ingest",
        kind,
        number: Some(number),
        reason: &log.reason,
        log: Some(log),
        clock: log.time_span_ns.map(|_| log.clock.name()),
        span_ns: log.time_span_ns,
        ..Row::default()
    }
}

fn of_readings(reject: &JoinReject) -> Row<'_> {
    Row {
        stage: "join",
        kind: "readings",
        number: Some(reject.readings),
        reason: &reject.reason,
        clock: Some("tracker"),
        span_ns: Some((reject.start.ns(), reject.end.ns())),
        ..Row::default()
    }
}

fn of_dwell(station: &Station) -> Option<Row<'_>> {
    let reason = match station.pairing {
        Pairing::Paired => return None,
        Pairing::Unmeasured(_) | Pairing::Ambiguous => stations::reason(&station.pairing)?,
    };
    Some(Row {
        stage: "join",
        kind: "dwell",
        number: Some(1),
        reason,
        clock: Some("controller"),
        span_ns: Some((station.start.ns(), station.end.ns())),
        station: Some(station.number),
        ..Row::default()
    })
}
