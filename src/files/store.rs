//! A store of whole files under keys (`runs/ROBOT/SESSION/RUN.parquet`): a folder, or a bucket of S3-compatible storage
//! (feature `s3`). Only [`Store::create`] has to distinguish processes: of several that create one key exactly one
//! succeeds.

#[cfg(feature = "s3")]
mod bucket;
mod error;
mod folder;
mod place;

use std::fmt::Debug;
use std::fs::File;
use std::io;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

use super::temporary::Temporary;
pub use error::{BucketTrouble, StoreError, advice};
pub use folder::Folder;
pub use place::{Place, without_secrets};

pub trait Store: Debug + Send + Sync {
    /// Place of the file with a key, whether or not it is there; the empty key is the store as a whole.
    fn place(&self, key: &str) -> Place;

    /// Folder of the store; `None` for a bucket.
    fn folder(&self) -> Option<&Path> {
        None
    }

    fn check(&self) -> Result<(), StoreError> {
        Ok(())
    }

    fn exists(&self, key: &str) -> Result<bool, StoreError>;

    /// Opens a file for reading: it stays readable as it is now, whatever happens to the key later.
    fn open(&self, key: &str) -> Result<File, StoreError>;

    /// Opens a file as it was listed; where the store has tags, one that changed since is an error.
    fn open_listed(&self, listed: &Listed) -> Result<File, StoreError> {
        self.open(&listed.key)
    }

    fn copy_to(&self, listed: &Listed, mut to: File) -> Result<(), StoreError> {
        let mut from = self.open_listed(listed)?;
        let place = self.place(&listed.key).named();
        let copied = io::copy(&mut from, &mut to);
        copied.map(drop).map_err(StoreError::folder("copy", &place))
    }

    /// Opens several files as they were listed; from a slow store some are fetched at a time.
    fn open_all(&self, listed: &[Listed]) -> Vec<Result<File, StoreError>> {
        listed.iter().map(|listed| self.open_listed(listed)).collect()
    }

    /// Files `levels` folders below a folder, by name, part by part; none where there is no such folder, nor
    /// temporaries, whose names begin with a dot.
    fn list(&self, folder: &str, levels: RangeInclusive<usize>) -> Result<Vec<Listed>, StoreError>;

    /// All files below a folder, or of the store where that is empty, hidden ones too, by name, part by part. Links to
    /// folders are followed as deep as a lake is.
    fn all(&self, folder: &str) -> Result<Vec<String>, StoreError>;

    fn temporary(&self, key: &str) -> Result<Temporary, StoreError>;

    /// Whether or not a file is there; it appears completely or not at all.
    fn put(&self, key: &str, written: Temporary) -> Result<Tag, StoreError>;

    /// `true` if there was none yet: for exactly one of several that create one key at once.
    fn create(&self, key: &str, written: Temporary) -> Result<bool, StoreError>;

    fn tag(&self, key: &str) -> Result<Tag, StoreError>;

    /// Removes the file under the key; one that is gone already is no error.
    fn remove(&self, key: &str) -> Result<(), StoreError>;
}

/// The store's name for the content of a file: the same tag means the same content; `None` where the store has no tags.
pub type Tag = Option<String>;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    pub key: String,
    pub tag: Tag,
    pub bytes: u64,
    /// When it was written, by the store's clock; `None` where the store does not know.
    pub modified: Option<SystemTime>,
}

/// An error for a bucket without the feature, or when the environment does not state how to reach it.
pub fn at(place: &Place) -> Result<Arc<dyn Store>, StoreError> {
    match place {
        Place::Path(path) if path.to_str().is_some_and(|path| path.contains("://")) => {
            let problem = "no other scheme than s3 is one, in small letters";
            Err(StoreError::Address { place: place.clone(), problem })
        }
        Place::Path(path) => Ok(Arc::new(Folder::new(path))),
        #[cfg(feature = "s3")]
        Place::Url(_) => Ok(Arc::new(bucket::Bucket::from_environment(place)?)),
        #[cfg(not(feature = "s3"))]
        Place::Url(_) => Err(StoreError::NotBuilt { place: place.clone() }),
    }
}

/// Orders keys by the names of folders and file, part by part, like a walk through sorted folders.
fn by_parts(a: &str, b: &str) -> std::cmp::Ordering {
    a.split('/').cmp(b.split('/'))
}
