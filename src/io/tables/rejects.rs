//! `rejects`: messages and byte ranges of the logs, readings and dwells that were left out, with reasons.

use super::stations::Unpaired;
use crate::ingest::{LogReject, LossKind, SpanClock};
use crate::join::{JoinReject, RejectCode, RowItem, RowReject, Station, Unmeasured};
use crate::judgement::JoinedSession;
use crate::rows::{Word, row, words};

row! {
    #[derive(Default)]
    pub struct RejectRow of "rejects" {
        reject: usize,
        stage: Stage,
        kind: RejectKind,
        number: u64,
        code: Option<RejectCode>,
        reason: String,
        file: Option<String>,
        topic: Option<String>,
        byte_start: Option<u64>,
        byte_end: Option<u64>,
        clock: Option<SpanClock>,
        start_ns: Option<i64>,
        end_ns: Option<i64>,
        station: Option<usize>,
        line: Option<u64>,
        column: Option<String>,
    }
}

words! {
    #[derive(Default)]
    pub enum Stage {
        #[default]
        Ingest: "ingest",
        Join: "join",
    }

    #[derive(Default)]
    pub enum RejectKind {
        #[default]
        Bytes: "bytes",
        Messages: "messages",
        Readings: "readings",
        Dwell: "dwell",
        /// A row of a table of stations.
        Rows: "rows",
        References: "references",
    }
    RejectCode {
        Damaged: "damaged",
        NotFound: "not_found",
        NothingLost: "nothing_lost",
        Unusable: "unusable",
        Missing: "missing",
        Repeated: "repeated",
        Settling: "settling",
        Moving: "moving",
        Outlier: "outlier",
        NoArmDwell: "no_arm_dwell",
        Alone: "alone",
        Unmeasured(Unmeasured::NoReadings): "no_readings",
        Unmeasured(Unmeasured::TooFewReadings): "too_few_readings",
        Unmeasured(Unmeasured::TargetMoved): "target_moved",
        Unmeasured(Unmeasured::OutsideTrackerLog): "outside_tracker_log",
        Unmeasured(Unmeasured::WrongTarget): "wrong_target",
        Unmeasured(Unmeasured::InstrumentMoved): "instrument_moved",
        Unmeasured(Unmeasured::FlippedView): "flipped_view",
        SeveralCandidates: "several_candidates",
    }
}

pub fn rows(session: &JoinedSession) -> Vec<RejectRow> {
    let logs = session.log_rejects.iter().map(of_log);
    let readings = session.joined.rejects.iter().map(of_readings);
    let dwells = session.joined.stations.iter().filter_map(of_dwell);
    let rows = session.joined.row_rejects.iter().map(of_row);
    let all = logs.chain(rows).chain(readings).chain(dwells).enumerate();
    all.map(|(reject, row)| RejectRow { reject, ..row }).collect()
}

/// A row with this number of items, without its own number and place.
fn of(stage: Stage, kind: RejectKind, number: u64, code: RejectCode, reason: &str) -> RejectRow {
    let reason = reason.to_owned();
    RejectRow { stage, kind, number, code: Some(code), reason, ..RejectRow::default() }
}

/// Messages where their number is known, otherwise the bytes they were lost with.
fn of_log(log: &LogReject) -> RejectRow {
    let (kind, number) = match log.messages {
        Some(messages) => (RejectKind::Messages, messages),
        None => (RejectKind::Bytes, log.byte_end.saturating_sub(log.byte_start)),
    };
    let code = match log.loss {
        LossKind::Bytes => RejectCode::Damaged,
        LossKind::Unusable => RejectCode::Unusable,
        LossKind::Missing => RejectCode::NotFound,
        LossKind::Nothing | LossKind::Stamps => RejectCode::NothingLost,
    };
    RejectRow {
        file: Some(log.file.clone()),
        topic: log.topic.clone(),
        byte_start: Some(log.byte_start),
        byte_end: Some(log.byte_end),
        clock: log.time_span_ns.map(|_| log.clock),
        start_ns: log.time_span_ns.map(|(start, _)| start),
        end_ns: log.time_span_ns.map(|(_, end)| end),
        ..of(Stage::Ingest, kind, number, code, &log.reason)
    }
}

fn of_row(reject: &RowReject) -> RejectRow {
    let (stage, kind) = match reject.kind {
        RowItem::Row => (Stage::Ingest, RejectKind::Rows),
        RowItem::Reading => (Stage::Join, RejectKind::Readings),
        RowItem::Reference => (Stage::Join, RejectKind::References),
    };
    RejectRow {
        file: Some(reject.file.clone()),
        station: reject.station,
        line: Some(reject.line),
        column: reject.column.clone(),
        ..of(stage, kind, 1, reject.code, &reject.reason)
    }
}

fn of_readings(reject: &JoinReject) -> RejectRow {
    let kind = if reject.is_of_reference { RejectKind::References } else { RejectKind::Readings };
    RejectRow {
        clock: Some(SpanClock::Tracker),
        start_ns: Some(reject.start.ns()),
        end_ns: Some(reject.end.ns()),
        ..of(Stage::Join, kind, reject.readings, reject.code, &reject.reason)
    }
}

fn of_dwell(station: &Station) -> Option<RejectRow> {
    let reason = Unpaired::of(&station.pairing)?;
    let code = match reason {
        Unpaired::Unmeasured(why) => RejectCode::Unmeasured(why),
        Unpaired::SeveralCandidates => RejectCode::SeveralCandidates,
    };
    Some(RejectRow {
        clock: Some(SpanClock::Controller),
        start_ns: Some(station.start.ns()),
        end_ns: Some(station.end.ns()),
        station: Some(station.number),
        ..of(Stage::Join, RejectKind::Dwell, 1, code, reason.word())
    })
}
