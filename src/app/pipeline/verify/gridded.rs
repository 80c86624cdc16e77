//! Grids, verified by themselves ([`stage`](super::stage)). The lake has to have the estimate that they name. Where it has its sessions as
//! joined too, and a pipeline file has the settings, and no run that was recomputed has shown them already, they are made anew from the
//! estimate: nothing is trained, and no log is read.

use std::collections::BTreeSet;

use super::estimated::{OTHERS, Trained};
use super::recompute;
use super::sought::Sought;
use super::stage::{Anew, StageVerified, Stated, compared, each, of_file};
use crate::io::lake::{ESTIMATES, GRIDS, Lake, LakeError};
use crate::io::table::Row as _;
use crate::io::tables::estimates::EstimateRow;
use crate::io::tables::grids::{self, GridErrorRow, GridsRow};
use crate::io::tables::residuals::EstimateResidualRow;
use crate::manifest::RunKey;
use crate::pipeline::configuration::Configuration;
use crate::pipeline::run::grids_piece;
use crate::progress::Progress;

/// Verifies the grids of these names, of sessions or results; of all where there are none. Those that are `shown` by runs that were
/// recomputed are not made again.
pub fn grids(
    lake: &Lake,
    sought: &Sought,
    names: &[String],
    shown: &BTreeSet<String>,
    progress: &dyn Progress,
) -> Result<Vec<StageVerified>, LakeError> {
    each(lake.rows_of_all(GRIDS)?, names, |place, key, table| {
        let Some(row) = GridsRow::read(table).pop() else {
            return Ok((Vec::new(), None));
        };
        let (robot, session) = (&key.robot, &key.session);
        let stated = Stated {
            rows: GRIDS,
            place,
            key,
            row: table,
            work: grids::work(robot, session, &row.estimate, row.settings.clone()),
            version: &row.version,
            settings_digest: &row.settings_digest,
            row_digest: row.row_digest.as_ref(),
        };
        let mut problems = stated.contradictions(lake);
        let files = (&row.table_names[..], &row.table_digests[..]);
        problems.extend(of_file(lake, key, GridErrorRow::TABLE, files));
        let estimate = RunKey::new(robot, session, &row.estimate);
        if !lake.has(ESTIMATES, &estimate)? {
            problems.push(format!("the lake does not have the estimate {}", row.estimate));
        }
        let is_open = problems.is_empty() && !shown.contains(&key.run);
        let anew = is_open.then(|| anew_of(lake, key, &row, sought, progress));
        Ok((problems, anew.flatten()))
    })
}

/// The grids made anew by the first pipeline file with their settings; `None` where none has them.
fn anew_of(
    lake: &Lake,
    key: &RunKey,
    row: &GridsRow,
    sought: &Sought,
    progress: &dyn Progress,
) -> Option<Anew> {
    let estimate = RunKey::new(&key.robot, &key.session, &row.estimate);
    let trained = match trained(lake, &estimate) {
        Ok(trained) => trained,
        Err(reason) => return Some(Anew::No(reason)),
    };
    let configuration =
        trained.by(sought, |configuration| configuration.grids_settings == row.settings)?;
    let anew = anew(lake, (key, &estimate), &trained, configuration, progress);
    Some(anew.unwrap_or_else(Anew::No))
}

/// The sessions of the estimate, or why they cannot be read.
fn trained(lake: &Lake, estimate: &RunKey) -> Result<Trained, String> {
    let table = lake.read(ESTIMATES, estimate);
    let table = table.map_err(|error| error.to_string())?;
    let row = EstimateRow::read(&table).pop();
    let row = row.ok_or_else(|| "its estimate has no row".to_owned())?;
    Trained::of(lake, estimate, &row)
}

/// The grids made in a temporary lake with their estimate, and compared.
fn anew(
    lake: &Lake,
    (key, estimate): (&RunKey, &RunKey),
    trained: &Trained,
    configuration: Configuration,
    progress: &dyn Progress,
) -> Result<Anew, String> {
    let temporary = recompute::temporary_lake(lake, key)?;
    let (configuration, piece) = trained.copied(lake, temporary.path(), configuration)?;
    let tables = [ESTIMATES, EstimateResidualRow::TABLE];
    let copied = lake.copy_run(&tables, estimate, temporary.path());
    copied.map_err(|error| error.to_string())?;
    let done = grids_piece(&configuration, &piece, progress);
    let done = done.map_err(|error| error.to_string())?;
    if done.run != key.run {
        return Err(OTHERS.to_owned());
    }
    let tables = [GridErrorRow::TABLE, GRIDS];
    Ok(compared(lake, &Lake::new(temporary.path()), &tables, key))
}
