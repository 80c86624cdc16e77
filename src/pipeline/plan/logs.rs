//! The files in a session's folder that a name or a pattern of `[input]` stands for.
//!
//! A pattern is a path in the folder whose last part may hold `*` (any letters) and `?` (one letter), as recorders number
//! the files of a split recording. Every pattern has to find a file, and none may find a file twice.

use std::path::{Path, PathBuf};

use super::tree::Tree;
use crate::pipeline::file::LogNames;

/// The files of one side, by name; or what the folder lacks.
pub(super) fn find(tree: &Tree, folder: &Path, names: &LogNames) -> Result<Vec<PathBuf>, String> {
    let mut found = Vec::new();
    for pattern in names.patterns() {
        let files = matching(tree, folder, pattern);
        if files.is_empty() {
            return Err(format!("it has no {pattern}"));
        }
        if let Some(twice) = files.iter().find(|file| found.contains(*file)) {
            let name = twice.strip_prefix(folder).unwrap_or(twice).display();
            return Err(format!("its {name} is named twice, by {names}"));
        }
        found.extend(files);
    }
    if found.is_empty() {
        return Err("[input] names no log for one of its sides".to_owned());
    }
    Ok(found)
}

fn matching(tree: &Tree, folder: &Path, pattern: &str) -> Vec<PathBuf> {
    let whole = folder.join(pattern);
    let (Some(parent), Some(last)) = (whole.parent(), whole.file_name()) else {
        return Vec::new();
    };
    let last = last.to_string_lossy();
    if !last.contains(['*', '?']) || tree.is_file(&whole) {
        return if tree.is_file(&whole) {
            vec![whole]
        } else {
            Vec::new()
        };
    }
    let letters: Vec<char> = last.chars().collect();
    let entries = tree.entries(parent).unwrap_or_default().into_iter();
    let mut found: Vec<PathBuf> = entries
        .filter(|path| {
            let name = path.file_name().unwrap_or_default();
            let name: Vec<char> = name.to_string_lossy().chars().collect();
            // A hidden file is a temporary of some program; a pattern has to say that it means it.
            (name.first() != Some(&'.') || letters.first() == Some(&'.')) && fits(&letters, &name)
        })
        .filter(|path| tree.is_file(path))
        .collect();
    found.sort();
    found
}

/// Whether a name fits a pattern; each `*` first stands for nothing, then for one letter more at a time.
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
                let Some((star, from)) = retry else {
                    return false;
                };
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
        // The first place of "ab" is not the one that fits.
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
            let found = find(&Tree::Folder, folder.path(), &LogNames::Several(names))?;
            let name = |path: PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
            Ok::<_, String>(found.into_iter().map(name).collect::<Vec<_>>())
        };
        assert_eq!(find(&["arm_*.mcap"]).unwrap(), ["arm_0.mcap", "arm_1.mcap"]);
        assert_eq!(
            find(&["laser.mcap", "arm_1.mcap"]).unwrap(),
            ["laser.mcap", "arm_1.mcap"]
        );
        assert_eq!(find(&["bag_*.mcap"]).unwrap_err(), "it has no bag_*.mcap");
        assert_eq!(find(&["arm_3.mcap"]).unwrap_err(), "it has no arm_3.mcap");
        let twice = find(&["arm_*.mcap", "arm_1.mcap"]).unwrap_err();
        assert!(twice.contains("arm_1.mcap is named twice"), "{twice}");
        assert!(find(&[]).unwrap_err().contains("no log"));
    }
}
