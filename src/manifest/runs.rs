//! What a run counts and writes, and the machine that computes it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::ManifestError;

/// What came into a stage and what became of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCount {
    /// The stage.
    pub stage: &'static str,
    /// What is counted: messages, readings, dwells.
    pub of: &'static str,
    /// How many came in.
    pub read: u64,
    /// How many were kept.
    pub kept: u64,
    /// How many were rejected, by reason.
    pub rejected: BTreeMap<String, u64>,
}

/// One table file that a run wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The table.
    pub table: String,
    /// The session whose file it is.
    pub session: String,
    /// Rows in it.
    pub rows: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub digest: String,
}

/// A run that another takes the place of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replaced {
    /// Its name.
    pub run: String,
    /// The digest of its row in `runs`, as [`crate::io::tables::runs::row_digest`] gives it.
    pub row_digest: String,
}

impl StageCount {
    /// That what came in was kept or rejected.
    pub fn check(&self) -> Result<(), ManifestError> {
        let rejected = self.rejected.values().sum();
        if self.kept.checked_add(rejected) == Some(self.read) {
            return Ok(());
        }
        Err(ManifestError::Unbalanced {
            stage: self.stage,
            of: self.of,
            read: self.read,
            kept: self.kept,
            rejected,
        })
    }
}

/// Processor architecture and operating system, as `x86_64-linux`.
pub fn platform() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

/// The processor features by which this build and its libraries choose their arithmetic, sorted.
pub fn cpu_features() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let known = [
        ("avx", std::is_x86_feature_detected!("avx")),
        ("avx2", std::is_x86_feature_detected!("avx2")),
        ("avx512f", std::is_x86_feature_detected!("avx512f")),
        ("fma", std::is_x86_feature_detected!("fma")),
        ("sse4.1", std::is_x86_feature_detected!("sse4.1")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let known: [(&str, bool); 0] = [];
    known
        .into_iter()
        .filter_map(|(name, there)| there.then_some(name))
        .collect()
}
