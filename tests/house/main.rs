//! Which module uses which: the crates of the front page, held against every path in `src`.
//!
//! Paths are read from the source text: `crate::…` and `super::…`, in `use` and elsewhere, comments and inline tests left
//! out. An edge that is not in [`MAY_USE`] fails, and so does an entry that no line of `src` needs any more.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// What each module uses and may use, from the core outwards.
const MAY_USE: &[(&str, &str)] = &[
    // Core.
    ("units", ""),
    ("geometry", "units"),
    ("kinematics", "geometry units"),
    ("linalg", ""),
    ("figures", "units"),
    ("progress", ""),
    ("at", ""),
    // The stages, in the order of the data.
    ("ingest", "geometry units"),
    ("join", "figures geometry ingest kinematics units"),
    ("setup", "figures geometry ingest join kinematics units"),
    ("fit", "figures geometry join kinematics linalg units"),
    ("similarity", "units"),
    ("grid", "figures fit join kinematics progress units"),
    ("compensation", "fit geometry grid kinematics units"),
    ("report", "figures fit geometry grid join kinematics units"),
    (
        "judgement",
        "figures fit geometry grid ingest join kinematics manifest progress report setup similarity units",
    ),
    ("simulate", "geometry ingest join kinematics units"),
    ("plan", "figures fit geometry grid join kinematics linalg progress report simulate units"),
    ("history", "compensation figures fit kinematics linalg report units"),
    // What reads and writes.
    ("files", "at manifest units"),
    ("programs", "geometry kinematics"),
    ("manifest", ""),
    (
        "io",
        "at compensation figures files fit geometry grid history ingest join judgement kinematics manifest plan progress report setup similarity \
         units",
    ),
    ("page", "figures fit grid io manifest plan report similarity units"),
    // What puts it all to work.
    (
        "pipeline",
        "at compensation figures files fit geometry grid history ingest io join judgement kinematics manifest page plan progress report setup similarity simulate units",
    ),
    (
        "cli",
        "at compensation files geometry grid history ingest io kinematics manifest page pipeline plan programs progress simulate units",
    ),
];

/// Modules of one room that use each other in a circle, and why they stay so.
const CIRCLES: &[(&str, &[&str], &str)] = &[
    ("cli", &["messages", "progress"], "a message stops the bars, a bar is drawn between messages"),
    (
        "compensation",
        &["identified", "pose"],
        "the identified arm is solved for a target, a target's answer names the arm",
    ),
    (
        "io",
        &["lake", "tables"],
        "a lake goes by the rows of table runs, which are one of its tables",
    ),
    (
        "pipeline",
        &["driven", "history", "planning", "promise", "run", "verify"],
        "each command begins from what a run leaves, and a run plans, drives and verifies",
    ),
];

/// Paths from a module to what it uses, each from the crate's root.
type Uses = BTreeSet<(Vec<String>, Vec<String>)>;

#[test]
fn modules_use_what_their_ring_may_use() {
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (from, to) in uses() {
        let (from, to) = (from[0].clone(), to[0].clone());
        let is_room = MAY_USE.iter().any(|(room, _)| *room == to);
        if from != to && is_room {
            found.entry(from).or_default().insert(to);
        }
    }
    for (room, may) in MAY_USE {
        let may: BTreeSet<String> = may.split_whitespace().map(str::to_owned).collect();
        let does = found.remove(*room).unwrap_or_default();
        let more: Vec<_> = does.difference(&may).collect();
        assert!(more.is_empty(), "`{room}` uses {more:?}, which its ring may not use");
        let less: Vec<_> = may.difference(&does).collect();
        assert!(
            less.is_empty(),
            "`{room}` does not use {less:?} any more: take them from the table"
        );
    }
    assert!(found.is_empty(), "modules that the table does not know: {found:?}");
}

#[test]
fn circles_inside_a_room_are_named_with_a_reason() {
    let mut of_rooms: BTreeMap<String, BTreeSet<(String, String)>> = BTreeMap::new();
    let modules = modules();
    for (from, to) in uses() {
        let (Some(inner), Some(used)) = (from.get(1), to.get(1)) else {
            continue;
        };
        let is_module = modules.contains(&to[..2]);
        if from[0] == to[0] && inner != used && is_module {
            let edges = of_rooms.entry(from[0].clone()).or_default();
            edges.insert((inner.clone(), used.clone()));
        }
    }
    let circles = of_rooms
        .iter()
        .flat_map(|(room, edges)| circles(edges).into_iter().map(|circle| (room.clone(), circle)));
    let found: BTreeSet<(String, Vec<String>)> = circles.collect();
    let named = CIRCLES.iter().map(|(room, circle, _)| {
        (room.to_string(), circle.iter().map(ToString::to_string).collect())
    });
    assert_eq!(found, named.collect());
}

/// Sets of two modules or more each of which reaches all the others.
fn circles(edges: &BTreeSet<(String, String)>) -> BTreeSet<Vec<String>> {
    let reached = |from: &String| {
        let mut seen = BTreeSet::new();
        let mut next = vec![from];
        while let Some(module) = next.pop() {
            let used = edges.iter().filter(|(user, _)| user == module).map(|(_, used)| used);
            next.extend(used.filter(|used| seen.insert((*used).clone())));
        }
        seen
    };
    let of: BTreeMap<&String, BTreeSet<String>> =
        edges.iter().map(|(from, _)| (from, reached(from))).collect();
    let together = |from: &String| -> Vec<String> {
        let back = |to: &&String| of.get(to).is_some_and(|reached| reached.contains(from));
        of[from].iter().filter(back).cloned().collect()
    };
    of.keys().map(|from| together(from)).filter(|circle| circle.len() > 1).collect()
}

/// Whether a crate is one room.
fn is_crate(room: &str) -> bool {
    matches!(room, "files" | "io" | "programs")
}

/// Every path in `src` from a module to another place in the crate.
fn uses() -> Uses {
    let mut uses = Uses::new();
    let all = modules();
    for (module, file) in files() {
        let text = fs::read_to_string(&file).expect("a source file");
        for path in paths(&production(&text)) {
            let base = match path.up {
                // Inside a crate that is a room its root is the room; `io` names the modules of `files` there too.
                None if is_crate(&module[0]) => {
                    let rooms = [module[0].clone(), "files".to_owned()];
                    let is_of =
                        |room: &String| all.contains(&[room.clone(), path.names[0].clone()][..]);
                    rooms.into_iter().find(is_of).into_iter().collect()
                }
                None => Vec::new(),
                Some(levels) => module[..module.len().saturating_sub(levels)].to_vec(),
            };
            let full: Vec<String> = base.into_iter().chain(path.names).collect();
            if !full.is_empty() {
                uses.insert((module.clone(), full));
            }
        }
    }
    assert!(uses.len() > 1000, "the source is not where the test looks for it");
    uses
}

/// Modules by their paths from the crate's root, with their files.
fn files() -> Vec<(Vec<String>, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of the source") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "rs") {
                let inside = path.strip_prefix(&root).expect("inside").with_extension("");
                let names = inside.iter().map(|name| name.to_string_lossy().into_owned());
                let mut names: Vec<String> = names.collect();
                // A crate's folder is no module, but for one that is a room.
                if names.len() > 1 && !is_crate(&names[0]) {
                    names.remove(0);
                }
                found.push((names, path));
            }
        }
    }
    let is_front =
        |module: &[String]| module.last().is_some_and(|name| name == "lib" || name == "main");
    let is_test = |module: &[String]| module.iter().any(|name| name == "tests");
    found.retain(|(module, _)| !is_front(module) && !is_test(module));
    found
}

fn modules() -> BTreeSet<Vec<String>> {
    files().into_iter().map(|(module, _)| module).collect()
}

/// The text without comments and without the tests at its end.
fn production(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    code.collect::<Vec<_>>().join("\n")
}

/// A path to somewhere in the crate.
struct Used {
    /// How many modules up it begins; `None`: at the crate's root.
    up: Option<usize>,
    /// The names that follow.
    names: Vec<String>,
}

/// Paths that begin with `crate::` or `super::`; of a group in braces one for each of its members.
fn paths(code: &str) -> Vec<Used> {
    let mut found = Vec::new();
    let starts = code.match_indices("crate::").chain(code.match_indices("super::"));
    for (start, word) in starts {
        let before = &code[..start];
        if before.ends_with("super::")
            || before.ends_with(|c: char| c.is_alphanumeric() || c == '_')
        {
            continue;
        }
        let mut rest = &code[start..];
        let mut up = (word == "super::").then_some(0);
        if word == "crate::" {
            rest = &rest[word.len()..];
        }
        while let (Some(levels), Some(behind)) = (up, rest.strip_prefix("super::")) {
            (up, rest) = (Some(levels + 1), behind);
        }
        for names in names(rest) {
            found.push(Used { up, names });
        }
    }
    found
}

/// `a::b::{c, d::e}` → `a::b::c`, `a::b::d`: of a group the first name of each member.
fn names(text: &str) -> Vec<Vec<String>> {
    let mut names = Vec::new();
    let mut rest = text;
    loop {
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        if end > 0 {
            names.push(rest[..end].to_owned());
        }
        match rest[end..].strip_prefix("::") {
            Some(behind) if end > 0 => rest = behind,
            _ => break,
        }
    }
    let Some(group) = rest.strip_prefix('{') else {
        return vec![names];
    };
    let (mut depth, mut member, mut members) = (1, String::new(), Vec::new());
    for c in group.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if depth == 0 || (depth == 1 && c == ',') {
            members.push(std::mem::take(&mut member));
        } else {
            member.push(c);
        }
        if depth == 0 {
            break;
        }
    }
    let first = |member: &String| {
        let name = member.trim().split(|c: char| !(c.is_alphanumeric() || c == '_')).next();
        name.filter(|name| !name.is_empty() && *name != "self").map(str::to_owned)
    };
    let ends = members.iter().filter_map(first);
    let mut found: Vec<_> = ends.map(|end| names.iter().cloned().chain([end]).collect()).collect();
    if found.is_empty() {
        found.push(names);
    }
    found
}

#[test]
fn paths_are_found_in_groups_and_upwards() {
    let code = "use crate::a::{b, c::{d, e}};\nuse super::super::f::g;\nlet x = crate::h::I::new(); // crate::no::more";
    let found: Vec<String> = paths(&production(code))
        .iter()
        .map(|path| format!("{:?} {}", path.up, path.names.join("::")))
        .collect();
    let wanted = ["None a::b", "None a::c", "None h::I::new", "Some(2) f::g"];
    assert_eq!(found, wanted);
}
