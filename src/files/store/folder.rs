//! A folder as a store: temporaries next to the files, renamed or hard-linked into place.

use std::fs::{self, File};
use std::io;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use super::{Listed, Place, Store, StoreError, Tag, by_parts};
use crate::temporary::{Temporary, removed_now};

/// Depth of folders above the files of a lake: of the table, the robot and the session.
const FOLDERS: usize = 3;

#[derive(Debug, Clone)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    fn path(&self, key: &str) -> PathBuf {
        if key.is_empty() { self.root.clone() } else { self.root.join(key) }
    }
}

impl Store for Folder {
    fn place(&self, key: &str) -> Place {
        Place::Path(self.path(key))
    }

    fn folder(&self) -> Option<&Path> {
        Some(&self.root)
    }

    fn exists(&self, key: &str) -> Result<bool, StoreError> {
        let path = self.path(key);
        path.try_exists().map_err(StoreError::folder("look for", &path))
    }

    fn open(&self, key: &str) -> Result<File, StoreError> {
        let path = self.path(key);
        File::open(&path).map_err(StoreError::folder("read", &path))
    }

    fn list(&self, folder: &str, levels: RangeInclusive<usize>) -> Result<Vec<Listed>, StoreError> {
        let mut folders = vec![folder.to_owned()];
        let mut files = Vec::new();
        for level in 0..=*levels.end() {
            if levels.contains(&level) {
                let names = self.names_in(&folders, Path::is_file)?.into_iter();
                files.extend(names.filter(|key| !is_hidden(key)));
            }
            folders = self.names_in(&folders, Path::is_dir)?;
        }
        let listed = files.into_iter().map(|key| self.listed(key));
        let mut listed = listed.collect::<Result<Vec<_>, _>>()?;
        listed.sort_by(|a, b| by_parts(&a.key, &b.key));
        Ok(listed)
    }

    fn all(&self, folder: &str) -> Result<Vec<String>, StoreError> {
        let mut keys = Vec::new();
        let mut folders = vec![folder.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in self.entries(&folder)? {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                let key = match &*folder {
                    "" => name.into_owned(),
                    folder => format!("{folder}/{name}"),
                };
                if is_folder(&entry, key.matches('/').count()) {
                    folders.push(key);
                } else {
                    keys.push(key);
                }
            }
        }
        keys.sort_by(|a, b| by_parts(a, b));
        Ok(keys)
    }

    fn temporary(&self, key: &str) -> Result<Temporary, StoreError> {
        let path = self.path(key);
        let folder = path.parent().expect("keys have names");
        fs::create_dir_all(folder).map_err(StoreError::folder("make the folder", folder))?;
        Temporary::beside(&path).map_err(StoreError::folder("write", &path))
    }

    fn put(&self, key: &str, written: Temporary) -> Result<Tag, StoreError> {
        let path = self.path(key);
        let replaced = written.replace(&path);
        replaced.map_err(StoreError::folder("write", &path))?;
        Ok(None)
    }

    fn create(&self, key: &str, written: Temporary) -> Result<bool, StoreError> {
        let path = self.path(key);
        let created = written.create(&path);
        created.map_err(StoreError::folder("create by a hard link", &path))
    }

    fn tag(&self, _key: &str) -> Result<Tag, StoreError> {
        Ok(None)
    }

    fn remove(&self, key: &str) -> Result<(), StoreError> {
        let path = self.path(key);
        removed_now(&path).map(drop).map_err(StoreError::folder("remove", &path))
    }
}

impl Folder {
    fn listed(&self, key: String) -> Result<Listed, StoreError> {
        let path = self.path(&key);
        let metadata = path.metadata();
        let metadata = metadata.map_err(StoreError::folder("look for", &path))?;
        Ok(Listed { key, tag: None, bytes: metadata.len(), modified: metadata.modified().ok() })
    }

    /// The keys of the entries of this kind in the folders; none where there is no such folder.
    fn names_in(
        &self,
        folders: &[String],
        is_wanted: fn(&Path) -> bool,
    ) -> Result<Vec<String>, StoreError> {
        let mut keys = Vec::new();
        for folder in folders {
            let entries = self.entries(folder)?;
            let wanted = entries.iter().filter(|entry| is_wanted(&entry.path()));
            // A lake's names are ASCII; other entries are not the lake's.
            let names = wanted.filter_map(|entry| entry.file_name().into_string().ok());
            keys.extend(names.map(|name| format!("{folder}/{name}")));
        }
        Ok(keys)
    }

    /// The entries of a folder; none where there is no such folder.
    fn entries(&self, key: &str) -> Result<Vec<fs::DirEntry>, StoreError> {
        let folder = self.path(key);
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.and_then(Iterator::collect::<io::Result<Vec<_>>>),
        };
        entries.map_err(StoreError::folder("list", &folder))
    }
}

/// Whether an entry is a folder to search. Below the folders of sessions no link is followed: it may lead back.
fn is_folder(entry: &fs::DirEntry, depth: usize) -> bool {
    let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
    is_folder || (depth < FOLDERS && entry.path().is_dir())
}

fn is_hidden(key: &str) -> bool {
    let name = key.rsplit('/').next();
    name.is_some_and(|name| name.starts_with('.'))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn put(store: &Folder, key: &str, text: &str) {
        let mut temporary = store.temporary(key).unwrap();
        temporary.write_all(text.as_bytes()).unwrap();
        temporary.sync().unwrap();
        store.put(key, temporary).unwrap();
    }

    #[test]
    fn files_are_listed_at_their_depth_in_the_order_of_their_names() {
        let root = tempfile::tempdir().unwrap();
        let store = Folder::new(root.path());
        for key in ["t/a-b/s/1", "t/a/s/2", "t/a/s/.hidden", "t/a/s/deep/3", "t/4"] {
            put(&store, key, key);
        }
        let keys = |folder, level| -> Vec<String> {
            let listed = store.list(folder, level..=level).unwrap();
            listed.into_iter().map(|listed| listed.key).collect()
        };
        // Folder by folder: "a" before "a-b", though '-' comes before '/'.
        assert_eq!(keys("t", 2), ["t/a/s/2", "t/a-b/s/1"]);
        assert_eq!(keys("t/a/s", 0), ["t/a/s/2"]);
        assert!(keys("nowhere", 2).is_empty());
        // All files, hidden ones and deeper ones too, in the order of their parts.
        let all = ["t/4", "t/a/s/.hidden", "t/a/s/2", "t/a/s/deep/3", "t/a-b/s/1"];
        assert_eq!(store.all("").unwrap(), all);
        assert_eq!(store.all("t/a-b").unwrap(), ["t/a-b/s/1"]);
        assert!(store.all("nowhere").unwrap().is_empty());
        assert_eq!(store.list("t", 0..=0).unwrap()[0].bytes, 3, "the text \"t/4\"");
    }
}
