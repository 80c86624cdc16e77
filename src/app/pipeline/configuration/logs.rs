//! The files in a folder that match a name or a pattern of `[input]`.
//!
//! A pattern is a path in the folder whose last part may hold `*` (any letters) and `?` (one letter), since recorders
//! number the files of a split recording, and `{session}` once, for the session's name. Every pattern has to match a file,
//! and no two may match the same file.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::tree::Tree;
use crate::pipeline::file::{LogNames, SESSION_PLACE};

/// The reason why one side of a session has no files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Lack {
    /// They do not exist, or not yet.
    Absent(String),
    /// They are ambiguous.
    Wrong(String),
}

/// The files of one side, by name; an error states what the folder lacks.
pub(super) fn find(tree: &Tree, folder: &Path, names: &LogNames) -> Result<Vec<PathBuf>, Lack> {
    let mut found = Vec::new();
    for pattern in names.patterns() {
        let files =
            matching(tree, folder, pattern).map_err(|error| Lack::Wrong(error.to_string()))?;
        if files.is_empty() {
            return Err(Lack::Absent(format!("it has no {pattern}")));
        }
        add_once(&mut found, files, folder, names)?;
    }
    Ok(found)
}

/// The file that may or may not exist, by name; an error where there is more than one.
pub(super) fn at_most_one(
    tree: &Tree,
    folder: &Path,
    names: &LogNames,
) -> Result<Option<PathBuf>, Lack> {
    let found = all(tree, folder, names).map_err(|error| Lack::Wrong(error.to_string()))?;
    match &found[..] {
        [] => Ok(None),
        [one] => Ok(Some(one.clone())),
        several => Err(Lack::Wrong(format!(
            "it has {} files {names}; a session is driven by one file of corrected targets",
            several.len()
        ))),
    }
}

/// The files of one side of every session, by the name in the place of `{session}`.
pub(super) fn find_named(
    tree: &Tree,
    folder: &Path,
    names: &LogNames,
) -> io::Result<BTreeMap<String, Result<Vec<PathBuf>, Lack>>> {
    let mut sides: BTreeMap<String, Result<Vec<PathBuf>, Lack>> = BTreeMap::new();
    let mut patterns: BTreeMap<String, usize> = BTreeMap::new();
    for pattern in names.patterns() {
        let mut by_session: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        for (session, path) in named(tree, folder, pattern, SESSION_PLACE)? {
            by_session.entry(session).or_default().push(path);
        }
        for (session, files) in by_session {
            *patterns.entry(session.clone()).or_default() += 1;
            let side = sides.entry(session).or_insert_with(|| Ok(Vec::new()));
            if let Ok(found) = side
                && let Err(lack) = add_once(found, files, folder, names)
            {
                *side = Err(lack);
            }
        }
    }
    for (session, found) in patterns {
        if found < names.patterns().len() && sides[&session].is_ok() {
            let lack = Lack::Absent(format!("it has not all of {names}"));
            sides.insert(session, Err(lack));
        }
    }
    Ok(sides)
}

/// Every file that matches a pattern without `{session}`, if there is any.
pub(super) fn all(tree: &Tree, folder: &Path, names: &LogNames) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for pattern in names.patterns() {
        found.extend(matching(tree, folder, pattern)?);
    }
    found.sort();
    found.dedup();
    Ok(found)
}

fn add_once(
    found: &mut Vec<PathBuf>,
    files: Vec<PathBuf>,
    folder: &Path,
    names: &LogNames,
) -> Result<(), Lack> {
    if let Some(twice) = files.iter().find(|file| found.contains(*file)) {
        let name = twice.strip_prefix(folder).unwrap_or(twice).display();
        return Err(Lack::Wrong(format!("its {name} is named twice, by {names}")));
    }
    found.extend(files);
    Ok(())
}

fn matching(tree: &Tree, folder: &Path, pattern: &str) -> io::Result<Vec<PathBuf>> {
    let whole = folder.join(pattern);
    if tree.is_file(&whole) {
        return Ok(vec![whole]);
    }
    let (Some(parent), Some(last)) = (whole.parent(), whole.file_name()) else { return Ok(vec![]) };
    let last = letters(&last.to_string_lossy());
    if !last.contains(&'*') && !last.contains(&'?') {
        return Ok(Vec::new());
    }
    let found = files(tree, parent)?.into_iter();
    let own = found.filter(|(name, _)| shown(name, &last) && fits(&last, name));
    Ok(own.map(|(_, path)| path).collect())
}

/// Files that match a pattern with `place` in it, like `{session}`, and the name in that place in each.
pub(in crate::pipeline) fn named(
    tree: &Tree,
    folder: &Path,
    pattern: &str,
    place: &str,
) -> io::Result<Vec<(String, PathBuf)>> {
    let whole = folder.join(pattern);
    let (Some(parent), Some(last)) = (whole.parent(), whole.file_name()) else { return Ok(vec![]) };
    let last = last.to_string_lossy();
    let (before, after) = last.split_once(place).unwrap_or((&last, ""));
    let (before, after) = (letters(before), letters(after));
    let own = files(tree, parent)?.into_iter().filter(|(name, _)| shown(name, &before));
    Ok(own.filter_map(|(name, path)| Some((between(&before, &after, &name)?, path))).collect())
}

/// Whether a file is one that a pattern names in a folder.
pub(in crate::pipeline) fn is_matched(folder: &Path, pattern: &str, path: &Path) -> bool {
    let whole = folder.join(pattern);
    let last = |path: &Path| letters(&path.file_name().unwrap_or_default().to_string_lossy());
    whole.parent() == path.parent() && fits(&last(&whole), &last(path))
}

/// The files of a folder with the letters of their names, by name; empty where there is no folder.
fn files(tree: &Tree, folder: &Path) -> io::Result<Vec<(Vec<char>, PathBuf)>> {
    let mut paths = match tree.entries(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    paths.retain(|path| tree.is_file(path));
    let name = |path: &PathBuf| letters(&path.file_name().unwrap_or_default().to_string_lossy());
    Ok(paths.into_iter().map(|path| (name(&path), path)).collect())
}

fn letters(text: &str) -> Vec<char> {
    text.chars().collect()
}

/// A hidden file is a temporary of some program; only a pattern that begins with a dot matches it.
fn shown(name: &[char], pattern: &[char]) -> bool {
    name.first() != Some(&'.') || pattern.first() == Some(&'.')
}

/// The shortest part of a name, and of those the first, for which the parts before and after it match.
fn between(before: &[char], after: &[char], name: &[char]) -> Option<String> {
    let ends = |length: usize| (0..=name.len() - length).map(move |start| (start, start + length));
    let mut parts = (1..=name.len()).flat_map(ends);
    let (start, end) =
        parts.find(|&(start, end)| fits(before, &name[..start]) && fits(after, &name[end..]))?;
    Some(name[start..end].iter().collect())
}

/// Whether a name matches a pattern; each `*` first matches nothing, then one letter more at a time.
fn fits(pattern: &[char], name: &[char]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut retry = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                retry = Some((p, n));
                p += 1;
            }
            Some(&letter) if letter == '?' || letter == name[n] => (p, n) = (p + 1, n + 1),
            _ => {
                let Some((star, from)) = retry else { return false };
                retry = Some((star, from + 1));
                (p, n) = (star + 1, from + 1);
            }
        }
    }
    pattern[p..].iter().all(|&letter| letter == '*')
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_pattern_fits_what_it_says() {
        let fits = |pattern: &str, name: &str| {
            let letters = |text: &str| text.chars().collect::<Vec<_>>();
            fits(&letters(pattern), &letters(name))
        };
        assert!(fits("arm_*.mcap", "arm_0.mcap") && fits("arm_*.mcap", "arm_.mcap"));
        assert!(fits("arm_?.mcap", "arm_ü.mcap") && !fits("arm_?.mcap", "arm_10.mcap"));
        assert!(!fits("arm_*.mcap", "arm_0.mcap.zst") && fits("arm_*.mcap*", "arm_0.mcap.zst"));
        // The first place of "ab" is not the matching one.
        assert!(fits("*ab?", "abab1") && !fits("*ab", "abab1") && fits("**", ""));
    }

    #[test]
    fn files_are_found_once_or_missed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["arm_1.mcap", "arm_0.mcap", ".arm_2.mcap", "laser.mcap"] {
            fs::write(folder.path().join(name), b"").expect("writable");
        }
        fs::create_dir(folder.path().join("arm_3.mcap")).expect("writable");
        let find = |names: &[&str]| {
            let names = names.iter().map(|&name| name.to_owned()).collect();
            let found = find(&Tree::Folder, folder.path(), &LogNames::Several(names));
            let name = |path: PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
            let found = found.map(|found| found.into_iter().map(name).collect::<Vec<_>>());
            found.map_err(|lack| match lack {
                Lack::Absent(reason) | Lack::Wrong(reason) => reason,
            })
        };
        assert_eq!(find(&["arm_*.mcap"]).unwrap(), ["arm_0.mcap", "arm_1.mcap"]);
        assert_eq!(find(&["laser.mcap", "arm_1.mcap"]).unwrap(), ["laser.mcap", "arm_1.mcap"]);
        assert_eq!(find(&["bag_*.mcap"]).unwrap_err(), "it has no bag_*.mcap");
        assert_eq!(find(&["arm_3.mcap"]).unwrap_err(), "it has no arm_3.mcap");
        let twice = find(&["arm_*.mcap", "arm_1.mcap"]).unwrap_err();
        assert!(twice.contains("arm_1.mcap is named twice"), "{twice}");
    }

    #[test]
    fn a_session_is_what_stands_in_its_place() {
        let session = |pattern: &str, name: &str| {
            let (before, after) = pattern.split_once(SESSION_PLACE).unwrap();
            between(&letters(before), &letters(after), &letters(name))
        };
        assert_eq!(session("{session}_arm.mcap", "mon_arm.mcap").unwrap(), "mon");
        assert_eq!(session("arm-{session}", "arm-2026.11").unwrap(), "2026.11");
        assert_eq!(session("{session}_arm.mcap", "_arm.mcap"), None, "no name at all");
        // A split recording: the shortest name, so that both parts belong to one session.
        for part in ["mon_arm_0.mcap", "mon_arm_1.mcap"] {
            assert_eq!(session("{session}_arm_*.mcap", part).unwrap(), "mon");
        }
    }

    #[test]
    fn files_are_sorted_into_sessions() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["mon_a.mcap", "mon_a.log", "tue_a.mcap", ".wed_a.mcap"] {
            fs::write(folder.path().join(name), b"").expect("writable");
        }
        let names =
            |names: &[&str]| LogNames::Several(names.iter().map(|&name| name.to_owned()).collect());
        let found =
            find_named(&Tree::Folder, folder.path(), &names(&["{session}_a.mcap"])).unwrap();
        assert_eq!(found.keys().collect::<Vec<_>>(), ["mon", "tue"]);
        let both = names(&["{session}_a.mcap", "{session}_a.log"]);
        let found = find_named(&Tree::Folder, folder.path(), &both).unwrap();
        assert_eq!(found["mon"].as_ref().unwrap().len(), 2);
        assert!(
            matches!(&found["tue"], Err(Lack::Absent(reason)) if reason.contains("not all of"))
        );
        let twice = names(&["{session}_a.mcap", "{session}_?.mcap"]);
        let found = find_named(&Tree::Folder, folder.path(), &twice).unwrap();
        assert!(
            matches!(&found["mon"], Err(Lack::Wrong(reason)) if reason.contains("named twice"))
        );
    }
}
