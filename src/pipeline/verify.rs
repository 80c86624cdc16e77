//! What a past run claims, recomputed.
//!
//! Inputs: the row of `runs` in a lake ([`Claim`]), the run's files there, and the pipeline file by which its logs are found.
//! Output: [`Verified`], with a [`Verdict`]. The lake is only read. Steps, for one run:
//! 1. the row against itself: its name follows from its inputs, settings and version, its place from its name, its digest
//!    from its content, and the bytes of its file from all that (`row`);
//! 2. the digest of every file it wrote (`altered`);
//! 3. the other runs that it rests on, and what is left of them (`cited`);
//! 4. the inputs that the pipeline file finds today, and its settings (`altered`, `settings`);
//! 5. where those are the same, the run again by the code of `posegrid run` into a temporary lake, and every file compared:
//!    bytes first, then values (`again`, [`crate::io::table::compare`]).
//!
//! Not shown by this: which run a run `replaces`, as that depends on what the lake held when it was computed. It has the
//! digest of that one's row as it was then; and of a row that no later one replaces, a list kept elsewhere knows the digest
//! ([`RowList`]). Every file under the lake is accounted for besides ([`FilesOfLake`]).

mod altered;
mod cited;
mod claim;
mod files;
mod list;
mod recompute;
mod register;
mod row;
mod selection;
mod settings;
mod source;
mod verdict;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::io::lake::{Lake, LakeError};
use crate::io::store::Place;
use crate::progress::Progress;

use super::configuration::ConfigurationError;
pub use altered::{ChangedInput, Found, Output};
pub use cited::{Citation, Left, Role};
pub use claim::{Claim, RowDigests};
pub use files::{FilesOfLake, Foreign, WithoutRow, account};
pub use list::{ListError, ListedRow, RowList, Unexpected};
pub use recompute::{ComparedFile, FileOutcome, clean};
pub use register::Register;
pub use selection::{NoClaim, PastRun, Selected, Selection, select};
pub use settings::ChangedSetting;
use source::{NoSource, Source};
pub use verdict::Verdict;

/// Why nothing can be verified.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// No lake.
    #[error("there is no lake in {}: {reason}; name the folder that `posegrid run` told as its tables", lake.display())]
    NoLake {
        /// The folder.
        lake: Place,
        /// What is missing.
        reason: &'static str,
    },
    /// Neither a run nor a session.
    #[error("{name:?} is neither a run nor a session in {}; its sessions: {}", lake.display(), sessions.join(", "))]
    NoSuchRun {
        /// The name asked for.
        name: String,
        /// The lake.
        lake: Place,
        /// Sessions that it has.
        sessions: Vec<String>,
    },
    /// No run by the pipeline files given.
    #[error("{} has no run by {}; its runs are by {}", lake.display(), asked.join(", "), found.join(", "))]
    NoneByPipeline {
        /// The lake.
        lake: Place,
        /// Names of the pipeline files given.
        asked: Vec<String>,
        /// Names of those that the lake's runs are by.
        found: Vec<String>,
    },
    /// Two pipeline files of one name.
    #[error("{} and {} have one name, and a row of `runs` tells no more than the name: verify their runs one after the other", first.display(), second.display())]
    TwoOfOneName {
        /// The first.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A pipeline file is bad.
    #[error(transparent)]
    Pipeline(#[from] ConfigurationError),
    /// The lake cannot be read.
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The list of rows that are expected cannot be used.
    #[error(transparent)]
    List(#[from] ListError),
}

/// What verifying a run came to.
#[derive(Debug, Clone)]
pub struct Verified {
    /// What the row says.
    pub claim: Claim,
    /// Where the row contradicts itself, in words.
    pub contradictions: Vec<String>,
    /// Every file that the row names.
    pub outputs: Vec<Output>,
    /// The run that took its place.
    pub superseded_by: Option<String>,
    /// Other runs that it rests on.
    pub cited: Vec<Citation>,
    /// Inputs that are not what the row says.
    pub inputs: Vec<ChangedInput>,
    /// Settings that are not what the row says.
    pub settings: Vec<ChangedSetting>,
    /// What computing it again gave.
    pub recomputed: Recomputed,
}

/// What computing a run again gave.
#[derive(Debug, Clone)]
pub enum Recomputed {
    /// It was not computed again, as inputs or settings are others.
    OtherWork,
    /// It could not be: why.
    No(String),
    /// Every file of it, in the row's order; those that are the same byte for byte are counted.
    Yes {
        /// Files with the same bytes.
        same: usize,
        /// The others.
        others: Vec<ComparedFile>,
    },
}

impl Verified {
    /// What it comes to.
    pub fn verdict(&self) -> Verdict {
        verdict::verdict(self)
    }
}

/// Where a row of `runs` contradicts itself, its place, its file or a later row, in words.
pub fn row_contradictions(
    run: &PastRun,
    claim: &Claim,
    register: &Register,
    lake: &Lake,
) -> Vec<String> {
    row::contradictions(run, claim, register, lake)
}

/// Verifies one run, whose row says `claim`; `register` has every run of the lake.
pub fn verify(
    run: &PastRun,
    claim: &Claim,
    register: &Register,
    lake: &Lake,
    progress: &dyn Progress,
) -> Verified {
    let mut verified = Verified {
        claim: claim.clone(),
        contradictions: row::contradictions(run, claim, register, lake),
        outputs: altered::outputs(claim, lake),
        superseded_by: register.superseding(&claim.key).map(str::to_owned),
        cited: cited::citations(claim, register, lake),
        inputs: Vec::new(),
        settings: Vec::new(),
        recomputed: Recomputed::OtherWork,
    };
    verified.recomputed = match &run.pipeline {
        Some(pipeline) => recomputed(&mut verified, pipeline, register, lake, progress),
        None => Recomputed::No(format!(
            "it is by the pipeline file {:?}: give that file with --pipeline",
            claim.pipeline
        )),
    };
    verified
}

fn recomputed(
    verified: &mut Verified,
    pipeline: &Path,
    register: &Register,
    lake: &Lake,
    progress: &dyn Progress,
) -> Recomputed {
    let claim = verified.claim.clone();
    let temporary = match recompute::temporary_lake(lake, &claim.key) {
        Ok(temporary) => temporary,
        Err(reason) => return Recomputed::No(reason),
    };
    let known_arm = cited::known_arm(&claim, register);
    let known_arm = known_arm.and_then(|key| lake.place("calibrations", &key).ok());
    let known_arm = known_arm.as_ref().and_then(Place::as_path);
    let source = Source::find(&claim, pipeline, known_arm, temporary.path());
    let (source, work) = match source.and_then(|source| Ok((source.work(&claim)?, source))) {
        Ok((work, source)) => (source, work),
        Err(NoSource::Missing(lost, reason)) => {
            verified.inputs = altered::missing(&claim, &lost);
            return Recomputed::No(reason);
        }
        Err(NoSource::Other(reason)) => return Recomputed::No(reason),
    };
    let table = source.driven_by();
    let added = table.map(|made| recompute::add_table(lake, &made, temporary.path()));
    if let Some(Err(reason)) = added {
        return Recomputed::No(reason);
    }
    verified.inputs = altered::inputs(&claim.inputs, &work.inputs);
    verified.settings = settings::changed(&claim.settings, &work.settings);
    let other_version = claim.is_other_version();
    let keeps = |setting: &ChangedSetting| other_version && setting.is_one_sided();
    if !verified.inputs.is_empty() || !verified.settings.iter().all(keeps) {
        return Recomputed::OtherWork;
    }
    // Settings that name a plan outrank the logs.
    let has_plan = verified.cited.iter().any(|own| own.role == Role::Planned);
    if let Some(plan) = source.sampling_plan().filter(|_| !has_plan) {
        let cited = Citation::new(Role::Planned, &plan, register, lake);
        verified.cited.push(cited);
    }
    recompute::again(verified, &source, lake, temporary.path(), progress)
}
