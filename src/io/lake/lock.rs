//! The lock of a lake: of several runs at once, one works and the others are told which.
//!
//! It saves work, not bytes: a lake stays sound without it, since a run is committed by a hard link. The system locks the
//! file `.lock` for as long as the process lives, however it ends, so no lock is ever left over; the file itself stays, and
//! says who locked it last. Only those who write whole batches lock; readers never do.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::temporary::host;
use super::{Lake, LakeError, folder_error};

/// The locked file, hidden from readers by its dot.
const FILE: &str = ".lock";

/// Bytes of a holder's own words that are read.
const MOST_WORDS: u64 = 1000;

/// A lake that this process has to itself until this is dropped.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

/// Who has the lake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder {
    /// The file that is locked.
    pub path: PathBuf,
    /// What the holder says of itself, where it has come to that.
    pub words: String,
    /// For how long, as far as the file system's clock tells.
    pub age: Option<Duration>,
}

/// What became of locking.
#[derive(Debug)]
pub enum Locking {
    /// The lake is ours.
    Done(Lock),
    /// Another process has it.
    Held(Holder),
    /// This file system gives no lock here.
    Refused(LakeError),
    /// The lake is on object storage, which has no locks: of two batches that do the same work one commits it.
    NoFolder,
}

impl Lake {
    /// Locks the lake, if no other process has it; `by` is what others are told of this one, besides its number and host.
    pub fn lock(&self, by: &str) -> Locking {
        let Some(root) = self.folder() else {
            return Locking::NoFolder;
        };
        let path = root.join(FILE);
        let refused = |error| Locking::Refused(folder_error("lock", &path)(error));
        let mut file = match lock_file(root, &path) {
            Ok(file) => file,
            Err(error) => return refused(error),
        };
        match file.try_lock() {
            Ok(()) => {
                // It is locked whether or not there is room to say by whom.
                let _ = sign(&mut file, by);
                Locking::Done(Lock { _file: file })
            }
            Err(TryLockError::WouldBlock) => Locking::Held(Holder::of(path.clone(), &file)),
            Err(TryLockError::Error(error)) => refused(error),
        }
    }
}

fn lock_file(root: &Path, path: &Path) -> io::Result<File> {
    fs::create_dir_all(root)?;
    File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(path)
}

fn sign(file: &mut File, by: &str) -> io::Result<()> {
    file.set_len(0)?;
    write!(
        file,
        "process {} on host {}: {by}",
        std::process::id(),
        host()
    )
}

impl Holder {
    fn of(path: PathBuf, file: &File) -> Self {
        let mut words = Vec::new();
        // Words that cannot be read are no reason to say nothing of the rest.
        let _ = file.take(MOST_WORDS).read_to_end(&mut words);
        let signed = file.metadata().and_then(|metadata| metadata.modified());
        Self {
            path,
            words: String::from_utf8_lossy(&words).into_owned(),
            age: signed.ok().and_then(|signed| signed.elapsed().ok()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_the_lake_and_others_are_reported_who() {
        let folder = tempfile::tempdir().unwrap();
        let lake = Lake::new(folder.path().join("new/lake"));
        let Locking::Done(lock) = lake.lock("run a.toml") else {
            panic!("nobody else has it");
        };
        // Another opening of the file is another owner, in the same process too.
        let Locking::Held(holder) = lake.lock("run b.toml") else {
            panic!("it is locked");
        };
        let pid = std::process::id();
        assert!(holder.words.starts_with(&format!("process {pid} on host ")));
        assert!(holder.words.ends_with(": run a.toml") && holder.age.is_some());
        drop(lock);
        let Locking::Done(_lock) = lake.lock("b") else {
            panic!("it was given back");
        };
        let words = fs::read_to_string(lake.folder().unwrap().join(FILE)).unwrap();
        assert!(words.ends_with(": b"), "the words of the last: {words}");
    }

    #[test]
    fn a_lake_that_cannot_be_is_not_taken_for_a_locked_one() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("file"), "").unwrap();
        let lake = Lake::new(folder.path().join("file/lake"));
        assert!(matches!(lake.lock("a"), Locking::Refused(_)));
    }
}
