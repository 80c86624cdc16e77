//! The lock of a lake: of several batches at once, one works and the others learn which one. A lake is sound without
//! it, since a run is committed by a hard link. The system locks `.lock` for as long as the process lives, so no lock
//! is ever left over; the file names the process that locked it last.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::PathBuf;
use std::time::Duration;

use super::{Lake, LakeError, folder_error};
use crate::temporary::host;

/// The locked file; its dot hides it from readers.
const FILE: &str = ".lock";

const MOST_WORDS: u64 = 1000;

#[derive(Debug)]
pub struct Lock {
    _file: File,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder {
    pub path: PathBuf,
    /// The holder's description of itself; empty where it has not written it yet.
    pub words: String,
    /// Time since the lock was taken, by the file system's clock; `None` where that is not known.
    pub age: Option<Duration>,
}

#[derive(Debug)]
pub enum Locking {
    Done(Lock),
    Held(Holder),
    /// This file system does not support locks here.
    Refused(LakeError),
    /// The lake is on object storage, which has no locks: of two batches that do the same work one commits it.
    NoFolder,
}

impl Lake {
    /// Locks the lake, if no other process has it; `by` describes this process to others, after its number and host.
    pub fn lock(&self, by: &str) -> Locking {
        let Some(root) = self.folder() else { return Locking::NoFolder };
        let path = root.join(FILE);
        let refused = |error| Locking::Refused(folder_error("lock", &path)(error));
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = match fs::create_dir_all(root).and_then(|()| options.open(&path)) {
            Ok(file) => file,
            Err(error) => return refused(error),
        };
        match file.try_lock() {
            Ok(()) => {
                // It is locked even if there is no room to write by which process.
                let _ = sign(&mut file, by);
                Locking::Done(Lock { _file: file })
            }
            Err(TryLockError::WouldBlock) => Locking::Held(Holder::of(path.clone(), &file)),
            Err(TryLockError::Error(error)) => refused(error),
        }
    }
}

fn sign(file: &mut File, by: &str) -> io::Result<()> {
    file.set_len(0)?;
    write!(file, "process {} on host {}: {by}", std::process::id(), host())
}

impl Holder {
    fn of(path: PathBuf, file: &File) -> Self {
        let mut words = Vec::new();
        // A description that cannot be read is left empty.
        let _ = file.take(MOST_WORDS).read_to_end(&mut words);
        let signed = file.metadata().and_then(|metadata| metadata.modified());
        let age = signed.ok().and_then(|signed| signed.elapsed().ok());
        Self { path, words: String::from_utf8_lossy(&words).into_owned(), age }
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
        // Another opening of the file is another owner, even in the same process.
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
