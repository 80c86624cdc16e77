//! The summary of a batch as one JSON document, for scripts.

use serde_json::{Map, Value, json};

use super::summary::{Totals, in_order};
use super::work::Ending;
use crate::io::lake::{Lake, LakeError};
use crate::io::rows::{Row as _, Word as _};
use crate::io::tables::runs::RunRow;
use crate::io::tables::words::VerdictOf;
use crate::manifest::VERSION;
use crate::pipeline::configuration::SetAside;
use crate::pipeline::fleet::{Fleet, FleetPiece};
use crate::pipeline::run::Done;

/// Every session in the order of the configuration, and the totals. A figure that there is none of is null.
pub fn document(
    fleet: &Fleet,
    endings: &[Ending],
    set_aside: &[SetAside],
    exit_code: u8,
) -> Result<String, LakeError> {
    let lake = Lake::at(&fleet.lake)?;
    let pieces = fleet.pieces();
    let of_pieces = pieces.iter().zip(endings).map(|(own, ending)| session(&lake, own, ending));
    let sessions = in_order(of_pieces, set_aside, |own| Ok(of_aside(own)));
    let sessions = sessions.into_iter().collect::<Result<Vec<Value>, LakeError>>()?;
    let document = json!({
        "version": VERSION,
        "lake": fleet.lake.to_string(),
        "exit_code": exit_code,
        "totals": Totals::of(endings, set_aside),
        "sessions": sessions,
    });
    Ok(format!("{document:#}\n"))
}

fn of_aside(aside: &SetAside) -> Value {
    json!({ "session": aside.session, "state": aside.state(), "reason": aside.why.reason() })
}

fn session(lake: &Lake, own: &FleetPiece<'_>, ending: &Ending) -> Result<Value, LakeError> {
    let mut said = match ending {
        Ending::Done(done) => finished(lake, done)?,
        Ending::OfStage(done) => json!({ "run": done.run, "words": done.words }),
        Ending::Failed(failure) => {
            json!({ "reason": failure.reason, "because_of": failure.session })
        }
        Ending::Stopped | Ending::NotStarted => Value::Object(Map::new()),
    };
    said["session"] = json!(own.label());
    said["state"] = json!(ending.state());
    Ok(said)
}

fn finished(lake: &Lake, done: &Done) -> Result<Value, LakeError> {
    let row = RunRow::read(&lake.read(RunRow::TABLE, &done.key)?).pop();
    let ending = row.map(|row| row.ending).unwrap_or_default();
    let summary = done.summary.as_ref();
    Ok(json!({
        "robot": done.key.robot,
        "run": done.key.run,
        "verdict": ending.verdict.word(),
        "verdict_of": ending.verdict_of.map(VerdictOf::word),
        "statement": ending.statement,
        "reason": ending.reason,
        "bound_mm": ending.bound_mm,
        "mean_before_mm": ending.mean_before_mm,
        "mean_after_mm": ending.mean_after_mm,
        "means_of": ending.means_of,
        "held_out": ending.held_out,
        "visits": ending.visits,
        "stations_covered_share": ending.stations_covered_share,
        "rejected_beyond": done.rejected,
        "warnings": summary.map(|own| &own.warnings),
        "table": done.corrects.as_ref().map(ToString::to_string),
        "page": done.page.as_ref().map(ToString::to_string),
    }))
}
