//! The reasons why a benchmark has no result.

use std::path::PathBuf;

use thiserror::Error;

use crate::benchmark::suite::SuiteFile;
use crate::benchmark::{SuiteError, Unlike};
use crate::io::input::toml_problem;
use crate::io::predictions::PredictionsError;
use crate::io::table::TableError;
use crate::manifest::ManifestError;
use crate::pipeline::configuration::ConfigurationError;
use crate::pipeline::run::RunError;
use crate::pipeline::stages::StageError;

/// The reason why a benchmark has no result.
#[derive(Debug, Error)]
pub enum BenchmarkError {
    /// The suite cannot be read.
    #[error("cannot read the suite {}: {source}", path.display())]
    Read {
        /// The suite.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The suite is no TOML, or has a key that is missing or unknown.
    #[error("suite {}: {}", path.display(), toml_problem(source))]
    Parse {
        /// The suite.
        path: PathBuf,
        /// Why.
        source: Box<toml::de::Error>,
    },
    /// The suite contradicts itself.
    #[error("suite {}: {source}", path.display())]
    Suite {
        /// The suite.
        path: PathBuf,
        /// Where and how.
        source: SuiteError,
    },
    /// A name on the command line that the suite does not have.
    #[error("the suite has no {what} {name:?}; it has {}", known.join(", "))]
    Unknown {
        /// `arm` or `split`.
        what: &'static str,
        /// The name.
        name: String,
        /// Those there are.
        known: Vec<String>,
    },
    /// The pipeline file of an arm.
    #[error("arm {arm:?}: {source}")]
    Pipeline {
        /// The arm.
        arm: String,
        /// What is wrong with it.
        source: Box<ConfigurationError>,
    },
    /// A file that is not there.
    #[error(
        "arm {arm:?}: {} is not there: download {} from {repository} ({licence}) into the folder of the data, which --data DIR names",
        path.display(), origin.as_deref().unwrap_or("it")
    )]
    NotThere {
        /// The arm.
        arm: String,
        /// Where it is looked for.
        path: PathBuf,
        /// Its path in the repository.
        origin: Option<String>,
        /// The repository.
        repository: String,
        /// The licence.
        licence: String,
    },
    /// A file with another content.
    #[error(
        "arm {arm:?}: the BLAKE3 digest of {} is {found}, but the suite's data have {stated}: it is another version or was altered; download it again from \
         {repository}", path.display()
    )]
    Digest {
        /// The arm.
        arm: String,
        /// The file.
        path: PathBuf,
        /// Its digest.
        found: String,
        /// The suite's.
        stated: String,
        /// The repository.
        repository: String,
    },
    /// A file that cannot be read.
    #[error("arm {arm:?}: cannot read {}: {source}", path.display())]
    Input {
        /// The arm.
        arm: String,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A session that the pipeline file does not find.
    #[error("arm {arm:?}, session {session:?}: {reason}")]
    Session {
        /// The arm.
        arm: String,
        /// The session.
        session: String,
        /// Why it cannot be used.
        reason: String,
    },
    /// A session cannot be read or joined.
    #[error("arm {arm:?}: {source}")]
    Run {
        /// The arm.
        arm: String,
        /// Why.
        source: Box<RunError>,
    },
    /// A split cannot be trained or judged.
    #[error("arm {arm:?}, split {split:?}: {fault}")]
    Split {
        /// The arm.
        arm: String,
        /// The split.
        split: String,
        /// Why.
        fault: String,
    },
    /// A program's predictions cannot be used.
    #[error("predictions of {program}, arm {arm:?}, split {split:?}: {fault}")]
    Predictions {
        /// The program.
        program: String,
        /// The arm.
        arm: String,
        /// The split.
        split: String,
        /// Why.
        fault: Box<PredictionsFault>,
    },
    /// A program without any predictions.
    #[error(
        "predictions of {program}: {} has none for the splits asked for: it is a folder with ARM/SPLIT.csv for one of them at least, or the file of \
         one split (--arm and --split choose it)", path.display()
    )]
    NoPredictions {
        /// The program.
        program: String,
        /// The place.
        path: PathBuf,
    },
    /// The settings have no canonical form.
    #[error(transparent)]
    Settings(#[from] ManifestError),
    /// The table cannot be made.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Something cannot be written.
    #[error("cannot write {}: {}", path.display(), crate::io::whole_file::told(source))]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// Why predictions cannot be used.
#[derive(Debug, Error)]
pub enum PredictionsFault {
    /// The file is no file of predictions.
    #[error(transparent)]
    File(#[from] PredictionsError),
    /// Their stations are not those that test.
    #[error("{}: {fault}", path.display())]
    Stations {
        /// The file.
        path: PathBuf,
        /// Which.
        fault: String,
    },
    /// They are in another unit or frame.
    #[error("{}: {unlike}", path.display())]
    Unlike {
        /// The file.
        path: PathBuf,
        /// How they are recognised.
        unlike: Unlike,
    },
}

impl BenchmarkError {
    /// Whether the suite or its use is at fault, not the data or the predictions.
    pub const fn is_of_suite(&self) -> bool {
        matches!(
            self,
            Self::Read { .. }
                | Self::Parse { .. }
                | Self::Suite { .. }
                | Self::Unknown { .. }
                | Self::Pipeline { .. }
        )
    }

    pub(super) fn not_there(
        arm: &crate::benchmark::suite::SuiteArm,
        file: &SuiteFile,
        path: PathBuf,
    ) -> Self {
        Self::NotThere {
            arm: arm.name.clone(),
            path,
            origin: file.origin.clone(),
            repository: arm.source.repository.clone(),
            licence: arm.source.licence.clone(),
        }
    }

    pub(super) fn stage(arm: &str, split: &str, source: &StageError) -> Self {
        Self::Split { arm: arm.to_owned(), split: split.to_owned(), fault: source.to_string() }
    }
}
