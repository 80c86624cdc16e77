use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Place;

#[derive(Debug, Error)]
pub enum StoreError {
    #[error("cannot {doing} {path}: {source}{}", advice(doing, source))]
    Folder { doing: &'static str, path: PathBuf, source: io::Error },
    #[error("cannot {doing} {place}: {reason}; {}", trouble.advice())]
    Bucket { doing: &'static str, place: Place, reason: String, trouble: BucketTrouble },
    #[error("cannot use {place}: {variable} {problem}")]
    Environment { place: Place, variable: &'static str, problem: &'static str },
    #[error("{place} is no place on object storage: {problem}; write s3://BUCKET/PREFIX")]
    Address { place: Place, problem: &'static str },
    #[error(
        "{place} is on object storage, which this posegrid was built without: build it with `cargo build --release --features s3`, \
         or name a folder"
    )]
    NotBuilt { place: Place },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BucketTrouble {
    /// It does not answer, or cannot serve the request at the moment.
    NoAnswer,
    Refused,
    /// It denies access as the time that this machine states is not its own.
    Clock,
    NoBucket,
    NoObject,
    Changed,
    Other,
}

impl BucketTrouble {
    const fn advice(self) -> &'static str {
        match self {
            Self::NoAnswer => {
                "check the network and AWS_ENDPOINT_URL, and run again: nothing half done counts"
            }
            Self::Refused => {
                "check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_REGION, what that key may do there, and this machine's clock"
            }
            Self::Clock => {
                "set this machine's clock, which storage allows to be off by some minutes, and run again: nothing half done counts"
            }
            Self::NoBucket => "make the bucket, or check its name and AWS_ENDPOINT_URL",
            Self::NoObject => "check the name",
            Self::Changed => "wait until nobody writes there, and run again",
            Self::Other => "check AWS_ENDPOINT_URL, and whether that storage knows conditional put",
        }
    }
}

impl StoreError {
    pub fn folder<'a>(doing: &'static str, path: &'a Path) -> impl Fn(io::Error) -> Self + use<'a> {
        move |source| Self::Folder { doing, path: path.to_owned(), source }
    }

    pub fn is_missing(&self) -> bool {
        match self {
            Self::Folder { source, .. } => source.kind() == io::ErrorKind::NotFound,
            Self::Bucket { trouble, .. } => *trouble == BucketTrouble::NoObject,
            _ => false,
        }
    }

    /// Whether the same request may succeed later: the request itself is valid.
    pub const fn is_worth_a_retry(&self) -> bool {
        use BucketTrouble::{Changed, Clock, NoAnswer};
        matches!(self, Self::Bucket { trouble: NoAnswer | Changed | Clock, .. })
    }
}

/// Advice for an error of the file system; empty where it needs none. What is only read (`doing`) needs no other
/// folder.
pub fn advice(doing: &str, error: &io::Error) -> &'static str {
    let reads = matches!(doing, "read" | "list" | "look for");
    match error.kind() {
        io::ErrorKind::NotADirectory if reads => {
            "; there is a file where a folder is needed: name the folder of a lake, on the command line or under [output] in the pipeline \
             file"
        }
        io::ErrorKind::PermissionDenied if reads => "; let this user read it",
        io::ErrorKind::IsADirectory => {
            "; there is a folder where a file is looked for: name the file"
        }
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room there, or name another folder under [output] in the pipeline file; run again afterwards"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "; make the folder writable, or name another one under [output] in the pipeline file"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; there is a file where a folder is needed: name another folder under [output] in the pipeline file"
        }
        io::ErrorKind::Unsupported => {
            "; a lake needs a file system with hard links, to let exactly one of two equal runs commit"
        }
        _ => "",
    }
}
