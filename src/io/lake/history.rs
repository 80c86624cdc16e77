//! Summaries that a lake keeps for its histories: `.history/ROBOT.jsonl.zst`, a robot's judged sessions, and
//! `.history/figures/ROBOT/SESSION/RUN.json.zst`, the figures that a history compares. Nothing published follows from
//! it; it may be removed, and is then made again.

use std::io::{Read as _, Write as _};

use super::error::folder_error;
use super::{Lake, LakeError, session_key};
use crate::input::Bound;
use crate::manifest::RunKey;

pub(super) const FOLDER: &str = ".history";
pub(super) const FIGURES: &str = "figures";
pub(super) const SUMMARY: &str = ".jsonl.zst";
pub(super) const RUN: &str = ".json.zst";
/// Level of the compression: digits of numbers pack no better at higher ones.
const LEVEL: i32 = 1;

impl Lake {
    /// The summary of the robot whose folder has this name; `None` where there is none that can be read.
    pub fn history_summary(&self, robot: &str) -> Option<Vec<u8>> {
        self.unpacked(&format!("{FOLDER}/{robot}{SUMMARY}"))
    }

    /// Replaces the summary of a robot, completely or not at all.
    pub fn put_history_summary(&self, robot: &str, bytes: &[u8]) -> Result<(), LakeError> {
        self.put_packed(&format!("{FOLDER}/{robot}{SUMMARY}"), bytes)
    }

    /// The figures of a run that a history compares; `None` where there are none that can be read.
    pub fn history_figures(&self, key: &RunKey) -> Option<Vec<u8>> {
        self.unpacked(&figures(key).ok()?)
    }

    /// Replaces the figures of a run, completely or not at all.
    pub fn put_history_figures(&self, key: &RunKey, bytes: &[u8]) -> Result<(), LakeError> {
        self.put_packed(&figures(key)?, bytes)
    }

    fn unpacked(&self, key: &str) -> Option<Vec<u8>> {
        let file = self.store.open(key).ok()?;
        // A damaged file may unpack to more than was packed.
        let most = Bound::TABLE.bytes;
        let mut bytes = Vec::new();
        let unpacked = zstd::Decoder::new(file.take(most)).ok()?.take(most);
        { unpacked }.read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    fn put_packed(&self, key: &str, bytes: &[u8]) -> Result<(), LakeError> {
        let place = self.written_at(key);
        let wrong = folder_error("write", &place);
        let packed = zstd::encode_all(bytes, LEVEL).map_err(&wrong)?;
        let mut temporary = self.store.temporary(key)?;
        let written = temporary.write_all(&packed);
        written.and_then(|()| temporary.sync()).map_err(&wrong)?;
        self.store.put(key, temporary)?;
        Ok(())
    }
}

fn figures(key: &RunKey) -> Result<String, LakeError> {
    let run = super::encoded("run", &key.run)?;
    let folder = session_key(&format!("{FOLDER}/{FIGURES}"), key)?;
    Ok(format!("{folder}/{run}{RUN}"))
}
