//! Sessions as joined, verified by themselves ([`stage`](super::stage)). Where a pipeline file finds a session's files under the same settings
//! of ingest and join, they are joined anew, and both tables compared. The sessions of a pipeline file are looked for once.

use super::recompute;
use super::sought::Sought;
use super::stage::{Anew, StageVerified, Stated, compared, each, of_file};
use crate::io::lake::{JOINED, Lake, LakeError};
use crate::io::store::Place;
use crate::io::table::Row as _;
use crate::io::tables::joined_sessions::{self, JoinedSessionRow, inputs};
use crate::io::tables::readings::ReadingRow;
use crate::manifest::RunKey;
use crate::pipeline::configuration::{Configuration, Overrides, WorkPiece};
use crate::pipeline::run::join_session;
use crate::progress::Progress;

/// Verifies the sessions as joined of these names, of sessions or results; of all where there are none.
pub fn joined(
    lake: &Lake,
    sought: &mut Sought,
    names: &[String],
    progress: &dyn Progress,
) -> Result<Vec<StageVerified>, LakeError> {
    each(lake.rows_of_all(JOINED)?, names, |place, key, table| {
        let Some(row) = JoinedSessionRow::read(table).pop() else {
            return Ok((Vec::new(), None));
        };
        let Some(inputs) = inputs(&row) else {
            let problem = "its lists of files read differ in length".to_owned();
            return Ok((vec![problem], None));
        };
        let stated = Stated {
            rows: JOINED,
            place,
            key,
            row: table,
            work: joined_sessions::work(&key.robot, &key.session, inputs, row.settings.clone()),
            version: &row.version,
            settings_digest: &row.settings_digest,
            row_digest: row.row_digest.as_ref(),
        };
        let mut problems = stated.contradictions(lake);
        let files = (&row.table_names[..], &row.table_digests[..]);
        problems.extend(of_file(lake, key, ReadingRow::TABLE, files));
        let anew = problems.is_empty();
        let anew = anew.then(|| anew_of(lake, key, &row, sought, progress));
        Ok((problems, anew.flatten()))
    })
}

/// The session joined anew by the first pipeline file that finds its files under the same settings; `None` where none does.
fn anew_of(
    lake: &Lake,
    key: &RunKey,
    row: &JoinedSessionRow,
    sought: &mut Sought,
    progress: &dyn Progress,
) -> Option<Anew> {
    let overrides = Overrides {
        robot: Some(key.robot.clone()),
        sessions: vec![key.session.clone()],
        ..Overrides::default()
    };
    let (configuration, piece) = sought.find(&overrides, |configuration| {
        let pieces = WorkPiece::each_session(&configuration.pieces);
        let piece = pieces.into_iter().find(|own| own.session == key.session)?;
        (configuration.join_settings == row.settings).then_some(piece)
    })?;
    let temporary = match recompute::temporary_lake(lake, key) {
        Ok(temporary) => temporary,
        Err(reason) => return Some(Anew::No(reason)),
    };
    let configuration = Configuration {
        robot: Some(key.robot.clone()),
        lake: Place::of(temporary.path()),
        ..configuration
    };
    Some(match join_session(&configuration, &piece, progress) {
        Err(error) => Anew::No(error.to_string()),
        Ok(done) if done.run != key.run => {
            Anew::No("its files, or the version, are not those that it was made with".to_owned())
        }
        Ok(_) => {
            let tables = [ReadingRow::TABLE, JOINED];
            compared(lake, &Lake::new(temporary.path()), &tables, key)
        }
    })
}
