//! Where whole files stand under keys: a folder, or a bucket of S3-compatible storage.
//!
//! A key is a path within the store, its parts parted by `/`: `runs/ROBOT/SESSION/RUN.parquet`. A store knows nothing of
//! what its files are; the rules of a lake stand on top of these few operations ([`crate::io::lake`]), and so does the
//! fetching of logs. Of all of them, only [`Store::create`] has to tell processes from each other: of several that create
//! one key exactly one does.
//!
//! Buckets are there where posegrid was built with its feature `s3`; what is asynchronous about them stays in their room.

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

use super::lake::temporary::Temporary;
pub use error::{BucketTrouble, StoreError, advice};
pub use folder::Folder;
pub use place::Place;

/// Where whole files stand under keys.
pub trait Store: Debug + Send + Sync {
    /// Where the file of a key is, or would be; the empty key is the store as a whole.
    fn place(&self, key: &str) -> Place;

    /// The folder that the store is, where it is one.
    fn folder(&self) -> Option<&Path> {
        None
    }

    /// Whether the store answers at all and lets us in. A folder that is not there yet does.
    fn check(&self) -> Result<(), StoreError> {
        Ok(())
    }

    /// Whether there is a file of this key.
    fn exists(&self, key: &str) -> Result<bool, StoreError>;

    /// A file, open for reading: what the key holds now, whatever becomes of the key later.
    fn open(&self, key: &str) -> Result<File, StoreError>;

    /// A file as it was listed; where the store has tags, one that changed since is an error.
    fn open_listed(&self, listed: &Listed) -> Result<File, StoreError> {
        self.open(&listed.key)
    }

    /// Copies such a file into one of this machine.
    fn copy_to(&self, listed: &Listed, mut to: File) -> Result<(), StoreError> {
        let mut from = self.open_listed(listed)?;
        let place = self.place(&listed.key).named();
        let copied = io::copy(&mut from, &mut to);
        copied.map(drop).map_err(StoreError::folder("copy", &place))
    }

    /// Several such files; a store that answers slowly is asked for some at a time.
    fn open_all(&self, listed: &[Listed]) -> Vec<Result<File, StoreError>> {
        listed
            .iter()
            .map(|listed| self.open_listed(listed))
            .collect()
    }

    /// The files that stand so many folders below a folder, in the order of their names, part by part; none where there
    /// is no such folder. Files whose names begin with a dot are temporaries, and not listed.
    fn list(&self, folder: &str, levels: RangeInclusive<usize>) -> Result<Vec<Listed>, StoreError>;

    /// The keys of all files below a folder, or of the store where that is empty, at whatever depth and hidden ones too, in
    /// the order of their names, part by part. Links to folders are followed as deep as a lake is, and no deeper.
    fn all(&self, folder: &str) -> Result<Vec<String>, StoreError>;

    /// A local file to write what is to stand under the key.
    fn temporary(&self, key: &str) -> Result<Temporary, StoreError>;

    /// Lets what was written stand under the key, whatever was there; it appears whole or not at all.
    fn put(&self, key: &str, written: Temporary) -> Result<Tag, StoreError>;

    /// The same if nothing is there yet. Of several that create one key at once exactly one does, and is told so.
    fn create(&self, key: &str, written: Temporary) -> Result<bool, StoreError>;

    /// The tag of what stands under the key now.
    fn tag(&self, key: &str) -> Result<Tag, StoreError>;
}

/// What a store calls the content of a file, so that the same tag is the same content; `None` where it has no such name.
pub type Tag = Option<String>;

/// A file that a store lists.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Its key.
    pub key: String,
    /// Its tag.
    pub tag: Tag,
    /// Its size in bytes.
    pub bytes: u64,
}

/// The store at a place.
///
/// # Errors
/// When it is a bucket and this program has none, or the environment does not say how to reach it.
pub fn at(place: &Place) -> Result<Arc<dyn Store>, StoreError> {
    match place {
        Place::Path(path) => Ok(Arc::new(Folder::new(path))),
        #[cfg(feature = "s3")]
        Place::Url(_) => Ok(Arc::new(bucket::Bucket::from_environment(place)?)),
        #[cfg(not(feature = "s3"))]
        Place::Url(_) => Err(StoreError::NotBuilt {
            place: place.clone(),
        }),
    }
}

/// Keys by the names of folders and file, part by part, as a walk through sorted folders gives them.
fn by_parts(a: &str, b: &str) -> std::cmp::Ordering {
    a.split('/').cmp(b.split('/'))
}
