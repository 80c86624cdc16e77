//! The claims of a past run, recomputed.
//!
//! Inputs: the row of `runs` in a lake ([`Claim`]), the run's files there, and the pipeline file that finds its logs.
//! Output: [`Verified`], with a [`Verdict`]. The lake is only read. Steps, for one run:
//! 1. the row against itself: its name follows from its inputs, settings and version, its place from its name, its digest
//!    from its content, and the bytes of its file from all that (`row`);
//! 2. the digest of every file it wrote (`altered`);
//! 3. the other runs that it depends on, and their tables that are left (`cited`);
//! 4. the inputs that the pipeline file finds today, and its settings (`altered`, `settings`);
//! 5. where those are the same, the run is recomputed by the code of `posegrid run` into a temporary lake, and every file
//!    compared: bytes first, then values (`again`, [`crate::files::table::compare`]).
//!
//! Results of stages, which runs start from, are verified by themselves ([`StageVerifier`]). The row of a run is held against those that
//! it names (`chain`).
//!
//! This does not show which run a run `replaces`, since that depends on the contents of the lake when it was computed. The
//! row has the digest of the replaced row at that time; the digest of a row that no later one replaces is known only to who kept it
//! elsewhere. Every file under the lake is also counted ([`FilesOfLake`]).

mod altered;
mod cited;
mod claim;
mod files;
mod recompute;
mod row;
mod selection;
mod settings;
mod source;
mod stage;
mod verdict;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

use crate::files::store::Place;
use crate::io::lake::{Lake, LakeError};
use crate::progress::Progress;

use super::configuration::ConfigurationError;
pub(super) use altered::is_gone;
pub use altered::{ChangedInput, Found, Output};
pub use cited::{Citation, Left, Role};
pub use claim::{Claim, Register};
pub use files::{FilesOfLake, Foreign, WithoutRow, account};
pub use recompute::{ComparedFile, FileOutcome, clean};
pub use row::contradictions as row_contradictions;
pub use selection::{NoClaim, PastRun, Selected, Selection, select};
pub use settings::ChangedSetting;
pub(super) use settings::changed as changed_settings;
pub use source::Sought;
use source::{NoSource, Source};
pub use stage::{Anew, StageVerified, StageVerifier};
pub use verdict::Verdict;

#[derive(Debug, Error)]
pub enum VerifyError {
    #[error("there is no lake in {}: {reason}; name the folder that `posegrid run` printed as its tables", lake.display())]
    NoLake { lake: Place, reason: &'static str },
    #[error("{name:?} is neither a run nor a session in {}; its sessions: {}", lake.display(), sessions.join(", "))]
    NoSuchRun { name: String, lake: Place, sessions: Vec<String> },
    #[error("{} has no run by {}; its runs are by {}", lake.display(), asked.join(", "), found.join(", "))]
    NoneByPipeline { lake: Place, asked: Vec<String>, found: Vec<String> },
    #[error("{} and {} have one name, and a row of `runs` has only the name: verify their runs one after the other", first.display(), second.display())]
    TwoOfOneName { first: PathBuf, second: PathBuf },
    #[error(transparent)]
    Pipeline(#[from] ConfigurationError),
    #[error(transparent)]
    Lake(#[from] LakeError),
}

#[derive(Debug, Clone)]
pub struct Verified {
    pub claim: Arc<Claim>,
    pub contradictions: Vec<String>,
    pub outputs: Vec<Output>,
    /// The run that is current in its place; `None` where it is the current one.
    pub superseded_by: Option<String>,
    /// Other runs that it depends on.
    pub cited: Vec<Citation>,
    pub inputs: Vec<ChangedInput>,
    pub settings: Vec<ChangedSetting>,
    pub recomputed: Recomputed,
}

#[derive(Debug, Clone)]
pub enum Recomputed {
    /// It was not recomputed, since inputs or settings differ.
    OtherWork,
    No(String),
    /// All its files, in the row's order; those that are the same byte for byte are only counted.
    Yes {
        same: usize,
        others: Vec<ComparedFile>,
    },
}

impl Verified {
    pub fn verdict(&self) -> Verdict {
        verdict::verdict(self)
    }

    /// The estimate and the grids that it shows: what the run was recomputed with was made anew, and compared with them.
    pub fn shows(&self) -> impl Iterator<Item = &String> {
        let of_stages = self.claim.run.ending.estimate.iter().chain(&self.claim.run.ending.grids);
        of_stages.filter(|_| matches!(self.recomputed, Recomputed::Yes { .. }))
    }
}

/// Verifies one run, whose row is `claim`; `register` has every run of the lake, and `sought` the sessions that pipeline files find.
pub fn verify(
    run: &PastRun,
    claim: &Arc<Claim>,
    register: &Register,
    sought: &mut Sought,
    lake: &Lake,
    progress: &dyn Progress,
) -> Verified {
    let mut verified = Verified {
        claim: Arc::clone(claim),
        contradictions: row_contradictions(run, claim, register, lake),
        outputs: altered::outputs(claim, lake),
        superseded_by: match lake.current(&claim.key) {
            Ok(Some(current)) => Some(current.run).filter(|run| *run != claim.key.run),
            // Rows that cannot be read are told by themselves.
            _ => register.superseding(&claim.key),
        },
        cited: cited::citations(claim, register, lake),
        inputs: Vec::new(),
        settings: Vec::new(),
        recomputed: Recomputed::OtherWork,
    };
    verified.recomputed = match &run.pipeline {
        Some(pipeline) => recomputed(&mut verified, pipeline, register, sought, lake, progress),
        None => Recomputed::No(format!(
            "it was made by the pipeline file {:?}: give that file with --pipeline",
            claim.run.pipeline
        )),
    };
    verified
}

fn recomputed(
    verified: &mut Verified,
    pipeline: &Path,
    register: &Register,
    sought: &mut Sought,
    lake: &Lake,
    progress: &dyn Progress,
) -> Recomputed {
    let claim = Arc::clone(&verified.claim);
    let temporary = match recompute::temporary_lake(lake, &claim.key) {
        Ok(temporary) => temporary,
        Err(reason) => return Recomputed::No(reason),
    };
    let known_arm = cited::known_arm(&claim, register);
    let known_arm = known_arm.and_then(|key| lake.place("calibrations", &key).ok());
    let known_arm = known_arm.as_ref().and_then(Place::as_path);
    let source = Source::find(&claim, pipeline, sought, known_arm, temporary.path());
    let (source, work) = match source.and_then(|source| Ok((source.work(&claim)?, source))) {
        Ok((work, source)) => (source, work),
        Err(NoSource::Missing(lost, reason)) => {
            verified.inputs = altered::missing(&claim, &lost);
            return Recomputed::No(reason);
        }
        Err(NoSource::Other(reason)) => return Recomputed::No(reason),
    };
    let added = source.driven_by().map(|made| recompute::add_table(lake, &made, temporary.path()));
    if let Some(Err(reason)) = added {
        return Recomputed::No(reason);
    }
    verified.inputs = altered::inputs(&claim.inputs, &work.inputs);
    verified.settings = settings::changed(&claim.run.made.settings, &work.settings);
    let other_version = claim.is_other_version();
    let keeps = |setting: &ChangedSetting| other_version && setting.is_one_sided();
    if !verified.inputs.is_empty() || !verified.settings.iter().all(keeps) {
        return Recomputed::OtherWork;
    }
    // A plan named in the settings outranks one in the logs.
    let has_plan = verified.cited.iter().any(|own| own.role == Role::Planned);
    if let Some(plan) = source.sampling_plan().filter(|_| !has_plan) {
        let cited = Citation::new(Role::Planned, &plan, register, lake);
        verified.cited.push(cited);
    }
    recompute::again(verified, &source, lake, temporary.path(), progress)
}
