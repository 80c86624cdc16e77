//! Logs on object storage → local copies to read, under generated names.
//!
//! Input: a piece of work as it was listed. Output: [`Fetched`], the same piece with paths that can be read; its copies are
//! removed with it. No part of an object's name becomes part of a path. A log that differs from the listed one is an error.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use thiserror::Error;

use super::configuration::{SessionFiles, Tree, WorkPiece};
use crate::files::store::StoreError;
use crate::files::temporary;

const COPIES: &str = "posegrid-logs";

/// A piece of work whose logs can be read.
#[derive(Debug)]
pub struct Fetched {
    /// With paths that can be read.
    pub(super) piece: WorkPiece,
    /// Path of each copy, by the address of its original.
    pub(super) copies: BTreeMap<PathBuf, PathBuf>,
    /// Folder of the copies; `None` where the logs are local.
    _folder: Option<TempDir>,
}

#[derive(Debug, Error)]
pub enum FetchError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("cannot write a copy of {} in {}: {source}; TMPDIR names the folder that copies are made in", of.display(), folder.display())]
    Copy { of: PathBuf, folder: PathBuf, source: io::Error },
}

impl Fetched {
    /// Fetches the logs of a piece of work that are not on this machine.
    pub fn of(tree: &Tree, piece: &WorkPiece) -> Result<Self, FetchError> {
        let (mut piece, mut copies) = (piece.clone(), BTreeMap::new());
        if matches!(tree, Tree::Folder) {
            return Ok(Self { piece, copies, _folder: None });
        }
        temporary::clean_folders(COPIES);
        let folder = temporary::folder(COPIES).map_err(wrong(Path::new("logs")))?;
        for path in files_of(&mut piece) {
            let own = folder.path().join(format!("{}.{}", copies.len() + 1, ending(path)));
            let copy = match copies.get(path) {
                Some(copy) => PathBuf::clone(copy),
                None => fetch(tree, path, &own)?,
            };
            let address = std::mem::replace(path, copy.clone());
            copies.insert(address, copy);
        }
        Ok(Self { piece, copies, _folder: Some(folder) })
    }

    /// A message with the addresses of the originals in place of the copies' paths.
    pub fn told(&self, message: &str) -> String {
        let told = |text: String, (address, copy): (&PathBuf, &PathBuf)| {
            text.replace(&copy.display().to_string(), &address.display().to_string())
        };
        self.copies.iter().fold(message.to_owned(), told)
    }
}

fn files_of(piece: &mut WorkPiece) -> impl Iterator<Item = &mut PathBuf> {
    let sessions = piece.training.iter_mut().chain(&mut piece.test);
    sessions.flat_map(|session| {
        let SessionFiles { recorded, corrected, .. } = session;
        recorded.paths_mut().into_iter().chain(corrected)
    })
}

/// Extensions of tables, which determine how they are read.
const TABLES: [&str; 10] =
    ["csv", "txt", "tsv", "dat", "parquet", "json", "jsonl", "yaml", "yml", "xlsx"];

fn ending(path: &Path) -> &'static str {
    let own = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    TABLES.into_iter().find(|known| *known == own).unwrap_or("mcap")
}

fn fetch(tree: &Tree, address: &Path, copy: &Path) -> Result<PathBuf, FetchError> {
    let Tree::Listed { store, files } = tree else { return Ok(address.to_owned()) };
    let listed = files.get(address).expect("a log that was listed");
    let file = File::options().write(true).create_new(true).open(copy);
    store.copy_to(listed, file.map_err(wrong(address))?)?;
    Ok(copy.to_owned())
}

fn wrong(of: &Path) -> impl Fn(io::Error) -> FetchError + use<'_> {
    move |source| FetchError::Copy { of: of.to_owned(), folder: std::env::temp_dir(), source }
}
