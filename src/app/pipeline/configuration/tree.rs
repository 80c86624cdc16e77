//! The tree in which sessions are searched: a folder, or a prefix on object storage as it was listed once.
//!
//! A file on object storage is looked up by its address in the form of a path, which cannot be opened: it is fetched under
//! a generated name before it is read ([`crate::pipeline::fetch`]).

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::ops::{Bound, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::files::store::{self, Listed, Place, Store, StoreError};

/// Depth of a log: in its session's folder, or a few folders below it.
const LEVELS: RangeInclusive<usize> = 1..=8;

#[derive(Debug, Clone)]
pub enum Tree {
    /// Those of this machine's file system.
    Folder,
    /// Those on object storage.
    Listed {
        store: Arc<dyn Store>,
        /// Every file below the prefix, by its address in the form of a path.
        files: Arc<BTreeMap<PathBuf, Listed>>,
    },
}

impl Tree {
    pub fn at(place: &Place) -> Result<Self, StoreError> {
        if place.as_path().is_some() {
            return Ok(Self::Folder);
        }
        let store = store::at(place)?;
        let listed = store.list("", LEVELS)?.into_iter();
        let files = listed.map(|listed| (store.place(&listed.key).named(), listed));
        Ok(Self::Listed { files: Arc::new(files.collect()), store })
    }

    pub fn is_dir(&self, path: &Path) -> bool {
        match self {
            Self::Folder => path.is_dir(),
            Self::Listed { files, .. } => below(files, path).next().is_some(),
        }
    }

    pub fn is_file(&self, path: &Path) -> bool {
        match self {
            Self::Folder => path.is_file(),
            Self::Listed { files, .. } => files.contains_key(path),
        }
    }

    /// Size of a file, bytes; `None` where there is none.
    pub fn size(&self, path: &Path) -> Option<u64> {
        match self {
            Self::Folder => path.metadata().ok().map(|own| own.len()),
            Self::Listed { files, .. } => files.get(path).map(|own| own.bytes),
        }
    }

    /// The entries of a folder, by name.
    pub fn entries(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let mut paths: Vec<PathBuf> = match self {
            Self::Folder => {
                fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?
            }
            Self::Listed { files, .. } => below(files, folder)
                .filter_map(|path| {
                    let rest = path.strip_prefix(folder).ok()?;
                    Some(folder.join(rest.components().next()?))
                })
                .collect(),
        };
        paths.sort();
        paths.dedup();
        Ok(paths)
    }
}

/// The files below a folder: paths are in the order of their parts, so these follow the folder itself.
fn below<'a>(
    files: &'a BTreeMap<PathBuf, Listed>,
    folder: &'a Path,
) -> impl Iterator<Item = &'a Path> {
    let from = files.range::<Path, _>((Bound::Included(folder), Bound::Unbounded));
    let from = from.map(|(path, _)| &**path);
    from.skip_while(move |path| *path == folder).take_while(move |path| path.starts_with(folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::store::Folder;

    #[test]
    fn what_was_listed_is_a_tree_of_its_own() {
        let root = "s3://bucket/cell";
        let keys = ["mon/a.mcap", "mon/bags/b.mcap", "mon-2/a.mcap", "tue"];
        let listed =
            |key: &str| Listed { key: key.to_owned(), tag: None, bytes: 1, modified: None };
        let tree = Tree::Listed {
            store: Arc::new(Folder::new("nowhere")),
            files: Arc::new(
                keys.iter()
                    .map(|key| (PathBuf::from(format!("{root}/{key}")), listed(key)))
                    .collect(),
            ),
        };
        let at = |key: &str| Path::new(root).join(key);
        assert_eq!(tree.entries(Path::new(root)).unwrap(), [at("mon"), at("mon-2"), at("tue")]);
        assert!(
            tree.is_dir(&at("mon")) && tree.is_dir(&at("mon/bags")) && !tree.is_dir(&at("tue"))
        );
        assert!(tree.is_file(&at("tue")) && tree.is_file(&at("mon/bags/b.mcap")));
        assert!(!tree.is_file(&at("mon")) && !tree.is_file(&at("mon/../mon/a.mcap")));
        assert!(tree.entries(&at("wed")).unwrap().is_empty());
    }
}
