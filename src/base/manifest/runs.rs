use std::collections::BTreeMap;

use serde::Serialize;

use super::ManifestError;

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCount {
    pub stage: &'static str,
    /// The kind of thing counted: messages, readings, dwells.
    pub of: &'static str,
    pub read: u64,
    pub kept: u64,
    pub rejected: BTreeMap<String, u64>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    pub table: String,
    pub session: String,
    pub rows: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub digest: String,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Replaced {
    pub run: String,
    /// The digest of its row in `runs`, as `posegrid::io::tables::runs::row_digest` gives it.
    pub row_digest: String,
}

impl Written {
    /// Its name in the row that it belongs to: TABLE/SESSION.
    pub fn name(&self) -> String {
        format!("{}/{}", self.table, self.session)
    }
}

impl StageCount {
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

/// The processor features that select the arithmetic of this build and its libraries, sorted.
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
    known.into_iter().filter_map(|(name, there)| there.then_some(name)).collect()
}
