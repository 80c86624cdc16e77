//! What can go wrong with a store, and what to try.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Place;

/// Why a store cannot be used.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The file system refused.
    #[error("cannot {doing} {path}: {source}{}", advice(source))]
    Folder {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The object storage refused, or did not answer.
    #[error("cannot {doing} {place}: {reason}; {}", trouble.advice())]
    Bucket {
        /// What was tried.
        doing: &'static str,
        /// Where.
        place: Place,
        /// What the storage said, without anything secret.
        reason: String,
        /// What kind of trouble it is.
        trouble: BucketTrouble,
    },
    /// The environment does not say how to reach the object storage.
    #[error("cannot use {place}: {variable} {problem}")]
    Environment {
        /// What was asked for.
        place: Place,
        /// The variable.
        variable: &'static str,
        /// What is wrong with it, and what to try.
        problem: &'static str,
    },
    /// An address that is none.
    #[error("{place} is no place on object storage: {problem}; write s3://BUCKET/PREFIX")]
    Address {
        /// What was given.
        place: Place,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// This program was built without object storage.
    #[error(
        "{place} is on object storage, which this posegrid was built without: build it with `cargo build --release --features s3`, \
         or name a folder"
    )]
    NotBuilt {
        /// What was asked for.
        place: Place,
    },
}

/// Kinds of trouble with object storage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BucketTrouble {
    /// It does not answer, or says that it cannot just now.
    NoAnswer,
    /// It does not let us.
    Refused,
    /// There is no such bucket.
    NoBucket,
    /// There is no such object.
    NoObject,
    /// An object is not what it was.
    Changed,
    /// Anything else.
    Other,
}

impl BucketTrouble {
    const fn advice(self) -> &'static str {
        match self {
            Self::NoAnswer => {
                "check the network and AWS_ENDPOINT_URL, and run again: nothing half done counts"
            }
            Self::Refused => {
                "check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_REGION, and what that key may do there"
            }
            Self::NoBucket => "make the bucket, or check its name and AWS_ENDPOINT_URL",
            Self::NoObject => "check the name",
            Self::Changed => "wait until nobody writes there, and run again",
            Self::Other => "check AWS_ENDPOINT_URL, and whether that storage knows conditional put",
        }
    }
}

impl StoreError {
    /// The error of doing something at a path, of what the system says.
    pub fn folder<'a>(doing: &'static str, path: &'a Path) -> impl Fn(io::Error) -> Self + use<'a> {
        move |source| Self::Folder {
            doing,
            path: path.to_owned(),
            source,
        }
    }

    /// Whether the same may go well another time: nothing is wrong with what was asked for.
    pub const fn is_worth_a_retry(&self) -> bool {
        use BucketTrouble::{Changed, NoAnswer};
        matches!(
            self,
            Self::Bucket {
                trouble: NoAnswer | Changed,
                ..
            }
        )
    }
}

/// What to try about an error of the file system; nothing where that is plain.
pub fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room there, or name another folder under [output] in the pipeline file; run again afterwards"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "; make the folder writable, or name another one under [output] in the pipeline file"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; a file stands where a folder is needed: name another folder under [output] in the pipeline file"
        }
        io::ErrorKind::Unsupported => {
            "; a lake needs a file system with hard links, to let exactly one of two equal runs commit"
        }
        _ => "",
    }
}
