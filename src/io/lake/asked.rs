//! The current run of a session: the one that was asked for last. A request creates the next row of `asked`,
//! `asked/ROBOT/SESSION/NUMBER.parquet`, whole or not at all: of several at once each number is created by one, and the
//! others look again. In a session without rows, which earlier versions wrote, the run that no other replaces is
//! current, the last by name of several.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{SystemTime, UNIX_EPOCH};

use super::{Lake, LakeError, RUNS, Result, session_key};
use crate::manifest::{Replaced, RunKey};
use crate::rows::{Row as _, row};
use crate::store::Listed;
use crate::tables::runs::row_digest;
use crate::units::WallTime;

pub const ASKED: &str = "asked";

row! {
    pub struct AskedRow of "asked" {
        number: u64,
        replaced: Option<String>,
        asked_at: WallTime,
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    /// Number of the session's last request that changed its current run.
    pub number: u64,
    pub replaced: Option<String>,
}

/// The folder of a session and the number, of the key of a row of `asked`; `None` for other keys.
pub fn request_of(key: &str) -> Option<(&str, u64)> {
    let (folder, file) = key.rsplit_once('/')?;
    let number: u64 = file.strip_suffix(".parquet")?.parse().ok()?;
    let is_own = folder.starts_with("asked/") && folder.matches('/').count() == 2;
    let is_number = (1..u64::MAX).contains(&number) && file == file_name(number);
    (is_own && is_number).then_some((folder, number))
}

pub fn request_key(key: &RunKey, number: u64) -> Result<String> {
    let folder = session_key(ASKED, key)?;
    Ok(format!("{folder}/{}", file_name(number)))
}

fn file_name(number: u64) -> String {
    format!("{number:08}.parquet")
}

impl Lake {
    /// The current run of the robot and session of `key`, with the digest of its row; `None` where there is none yet.
    pub fn current(&self, key: &RunKey) -> Result<Option<Replaced>> {
        self.current_by(&self.requests(&session_key(ASKED, key)?)?, key)
    }

    fn current_by(&self, requests: &[Listed], key: &RunKey) -> Result<Option<Replaced>> {
        for file in requests.iter().rev() {
            let (own, _) = self.request(&file.key)?;
            if self.exists(&own)? {
                let row_digest = row_digest(&self.read(RUNS, &own)?);
                let run = own.run;
                return Ok(Some(Replaced { run, row_digest }));
            }
        }
        self.unreplaced(key)
    }

    /// The last run of a session by name that no other replaces. A file that is not at the place of its row is not read
    /// as a row.
    fn unreplaced(&self, key: &RunKey) -> Result<Option<Replaced>> {
        let rows = self.rows(RUNS, &session_key(RUNS, key)?, 0)?;
        let (mut runs, mut replaced) = (BTreeMap::new(), BTreeSet::new());
        for (place, row) in rows {
            let row = row?.believed(&place.named())?;
            let text = |column: &str| row.text(column).iter().flatten().next().map(str::to_owned);
            let Some(run) = text("run") else { continue };
            let own = RunKey::new(&key.robot, &key.session, &run);
            if row.key() != Some(&own) || self.place(RUNS, &own)? != place {
                continue;
            }
            runs.insert(run, row_digest(&row));
            replaced.extend(text("replaces"));
        }
        let mut current = runs.into_iter().filter(|(run, _)| !replaced.contains(run));
        let current = current.next_back();
        Ok(current.map(|(run, row_digest)| Replaced { run, row_digest }))
    }

    pub fn ask(&self, key: &RunKey) -> Result<Asked> {
        loop {
            let requests = self.requests(&session_key(ASKED, key)?)?;
            let last = requests.last().and_then(|file| request_of(&file.key));
            let last = last.map_or(0, |(_, number)| number);
            let before = self.current_by(&requests, key)?.map(|own| own.run);
            let replaced = before.filter(|run| *run != key.run);
            let is_new = last == 0 || replaced.is_some();
            let asked = Asked { number: last + u64::from(is_new), replaced };
            if !is_new || self.create_request(key, &asked)? {
                return Ok(asked);
            }
        }
    }

    /// Creates the row of a request now; false where another process created one of its number.
    fn create_request(&self, key: &RunKey, asked: &Asked) -> Result<bool> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_us = i64::try_from(now.unwrap_or_default().as_micros());
        let asked_at = WallTime::of_us(now_us.unwrap_or(i64::MAX));
        let row = AskedRow { number: asked.number, replaced: asked.replaced.clone(), asked_at };
        let row = AskedRow::table(vec![row], key);
        let row = row.map_err(|source| LakeError::Record { source })?;
        let file = request_key(key, asked.number)?;
        let (temporary, _) = self.write(&row.table, &file)?;
        Ok(self.store.create(&file, temporary)?)
    }

    /// The files of requests in the folder of a session, of a robot or of all, in their order; nothing is read.
    pub fn requests(&self, folder: &str) -> Result<Vec<Listed>> {
        let levels = 2_usize.saturating_sub(folder.matches('/').count());
        let mut listed = self.store.list(folder, levels..=levels)?;
        listed.retain(|file| request_of(&file.key).is_some());
        Ok(listed)
    }

    /// The run and the row of a request, which has to be the one of its place.
    pub fn request(&self, key: &str) -> Result<(RunKey, AskedRow)> {
        let table = self.read_key(key, AskedRow::schema())?;
        let row = table.key().cloned().zip(AskedRow::read(&table).pop());
        let is_own = |(own, row): &(RunKey, AskedRow)| {
            request_key(own, row.number).is_ok_and(|own| own == key)
        };
        row.filter(is_own).ok_or_else(|| LakeError::NotAsked { place: self.store.place(key) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_requests_are_known_and_no_others() {
        let twelve = Some(("asked/r/s", 12));
        assert_eq!(request_of("asked/r/s/00000012.parquet"), twelve);
        let more = Some(("asked/r/s", 123_456_789));
        assert_eq!(request_of("asked/r/s/123456789.parquet"), more);
        for other in [
            "asked/r/s/12.parquet",
            "asked/r/s/00000000.parquet",
            "asked/r/00000012.parquet",
            "asked/r/s/0000000a.parquet",
            "runs/r/s/00000012.parquet",
        ] {
            assert_eq!(request_of(other), None, "{other}");
        }
    }
}
