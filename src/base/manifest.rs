//! Provenance of a run: inputs, settings and counts. Its name is derived from their digests and the program's version,
//! so the same work has one name anywhere; CPU features, which may change the last bits, are recorded beside.

mod runs;

use std::io::{self, Read};

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use runs::{Replaced, StageCount, Written, cpu_features, platform};

pub const VERSION: &str = env!("CARGO_PKG_VERSION");

pub const ROBOT: &str = "robot";

/// Bytes of the digest in a run's name: among fewer than 2⁶⁴ runs two equal names are unlikely.
const RUN_BYTES: usize = 16;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RunKey {
    pub robot: String,
    pub session: String,
    pub run: String,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Input {
    pub name: String,
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub digest: String,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Work {
    pub robot: String,
    pub session: String,
    pub pipeline: String,
    pub sessions: Vec<String>,
    /// Sessions that are only used to judge it.
    pub test_sessions: Vec<String>,
    pub inputs: Vec<Input>,
    /// Every setting, as [`canonical`] writes it.
    pub settings: String,
}

#[derive(Debug, Error)]
pub enum ManifestError {
    #[error(
        "stage {stage} read {read} {of}, kept {kept} and rejected {rejected}: {kept} + {rejected} is not {read}; \
         this is a defect of posegrid, please report it"
    )]
    Unbalanced { stage: &'static str, of: &'static str, read: u64, kept: u64, rejected: u64 },
    #[error("cannot write the settings as JSON: {0}")]
    Settings(#[from] serde_json::Error),
}

impl RunKey {
    pub fn new(
        robot: impl Into<String>,
        session: impl Into<String>,
        run: impl Into<String>,
    ) -> Self {
        Self { robot: robot.into(), session: session.into(), run: run.into() }
    }

    #[must_use]
    pub fn of_session(&self, session: &str) -> Self {
        Self::new(&self.robot, session, &self.run)
    }
}

/// BLAKE3 of everything that `reader` gives, hexadecimal, and the number of bytes; in bounded memory.
pub fn digest(reader: impl Read) -> io::Result<(String, u64)> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(reader)?;
    Ok((hasher.finalize().to_hex().to_string(), hasher.count()))
}

/// Settings as JSON with sorted keys and without spaces: equal settings give equal texts.
pub fn canonical(settings: &impl Serialize) -> Result<String, ManifestError> {
    let mut value = serde_json::to_value(settings)?;
    value.sort_all_objects();
    Ok(value.to_string())
}

impl Work {
    pub fn of_stage(
        robot: &str,
        session: &str,
        sessions: Vec<String>,
        inputs: Vec<Input>,
        settings: String,
    ) -> Self {
        Self {
            robot: robot.to_owned(),
            session: session.to_owned(),
            pipeline: String::new(),
            sessions,
            test_sessions: Vec::new(),
            inputs,
            settings,
        }
    }

    /// BLAKE3 of its settings, hexadecimal.
    pub fn settings_digest(&self) -> String {
        blake3::hash(self.settings.as_bytes()).to_hex().to_string()
    }

    pub fn key(&self) -> RunKey {
        self.key_by_version(VERSION)
    }

    /// The key of the run that this work makes with the program version `version`.
    pub fn key_by_version(&self, version: &str) -> RunKey {
        let mut hasher = blake3::Hasher::new();
        // Each text is digested with its length: ("ab", "c") and ("a", "bc") are different work.
        let mut add = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        for text in [version, &self.robot, &self.session, &self.pipeline, &self.settings] {
            add(text);
        }
        for sessions in [&self.sessions, &self.test_sessions] {
            add(&sessions.len().to_string());
            for session in sessions {
                add(session);
            }
        }
        for input in &self.inputs {
            add(&input.name);
            add(&input.digest);
        }
        RunKey::new(&self.robot, &self.session, &hasher.finalize().to_hex()[..2 * RUN_BYTES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work() -> Work {
        Work {
            robot: "ur10".to_owned(),
            session: "grid".to_owned(),
            pipeline: "nightly".to_owned(),
            sessions: vec!["grid".to_owned()],
            test_sessions: Vec::new(),
            inputs: vec![Input {
                name: "controller.mcap".to_owned(),
                bytes: 3,
                digest: digest(&b"log"[..]).unwrap().0,
            }],
            settings: canonical(&serde_json::json!({"fit": {"prior_mm": 3.0}})).unwrap(),
        }
    }

    #[test]
    fn a_digest_is_blake3_of_the_bytes() {
        // The first test vector of the BLAKE3 paper: the hash of the empty input.
        let nothing = "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262";
        assert_eq!(digest(io::empty()).unwrap(), (nothing.to_owned(), 0));
        let long = vec![7; 1 << 20];
        let expected = (blake3::hash(&long).to_hex().to_string(), 1 << 20);
        assert_eq!(digest(&long[..]).unwrap(), expected);
    }

    #[test]
    fn settings_are_written_in_one_way() {
        let text = r#"{"b": [1, 2.50], "a": {"z": null, "y": "ü"}}"#;
        let settings: serde_json::Value = serde_json::from_str(text).unwrap();
        assert_eq!(canonical(&settings).unwrap(), r#"{"a":{"y":"ü","z":null},"b":[1,2.5]}"#);
    }

    #[test]
    fn every_part_of_the_work_changes_the_name_of_the_run() {
        let base = work().key();
        assert_eq!(base, work().key());
        assert_eq!(base.run.len(), 32, "16 bytes, hexadecimal");
        let changes: [fn(&mut Work); 8] = [
            |work| work.robot.push('2'),
            |work| work.session.push('2'),
            |work| work.pipeline.push('2'),
            |work| work.settings = work.settings.replace("3.0", "2.0"),
            |work| work.inputs[0].digest = "00".repeat(32),
            |work| work.inputs[0].name = "tracker.mcap".to_owned(),
            |work| work.inputs.clear(),
            // Training and judging are different roles of the same session.
            |work| std::mem::swap(&mut work.sessions, &mut work.test_sessions),
        ];
        for change in changes {
            let mut changed = work();
            change(&mut changed);
            assert_ne!(changed.key().run, base.run, "{changed:?}");
        }
        assert_ne!(work().key_by_version("0.0.0").run, base.run);
    }
}
