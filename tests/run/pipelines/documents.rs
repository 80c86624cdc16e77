//! The README and the guide: their TOML is taken where it stands in a whole file, and links lead to files.

use std::fs;
use std::path::{Path, PathBuf};

use posegrid::geometry::Placement;
use posegrid::kinematics::RobotFile;
use posegrid::pipeline::file::PipelineFile;
use posegrid::programs::Cell;
use toml::{Table, Value};

/// A fenced text of a document.
struct Piece {
    /// The document.
    file: PathBuf,
    text: String,
}

/// Every fenced text in TOML of the README and the guide.
fn pieces() -> Vec<Piece> {
    let guide = fs::read_dir("src/guide").expect("part of the project");
    let mut files: Vec<_> = guide.map(|entry| entry.expect("listed").path()).collect();
    files.push("README.md".into());
    files.sort();
    let of_file = |file: PathBuf| {
        let document = fs::read_to_string(&file).expect("text");
        let after = document.split("```toml\n").skip(1);
        let text = after.map(|after| after.split("```").next().expect("fenced").to_owned());
        text.map(|text| Piece { file: file.clone(), text }).collect::<Vec<_>>()
    };
    files.into_iter().flat_map(of_file).collect()
}

/// A file with what a piece says in the place of what it says itself.
fn with(file: &str, piece: &str) -> Result<Value, toml::de::Error> {
    let text = fs::read_to_string(file).expect("part of the project");
    let mut whole: Table = toml::from_str(&text)?;
    // A camera stands in the place of the tracker that the file has.
    let has_camera = piece.lines().any(|line| line.starts_with("camera = "));
    if let Some(Value::Table(tracker)) = whole.get_mut("tracker").filter(|_| has_camera) {
        tracker.remove("uncertainty");
    }
    put(&mut whole, toml::from_str(piece)?);
    Ok(Value::Table(whole))
}

fn put(whole: &mut Table, piece: Table) {
    for (key, value) in piece {
        match (whole.get_mut(&key), value) {
            (Some(Value::Table(there)), Value::Table(more)) => put(there, more),
            (_, value) => {
                whole.insert(key, value);
            }
        }
    }
}

/// Reads a piece as what it is.
fn read(piece: &str) -> Result<(), Box<dyn std::error::Error>> {
    let robot = "pipelines/robots/kr210-r2700-extra.toml";
    if piece.starts_with('{') {
        for line in piece.lines() {
            let named = toml::from_str::<Table>(&format!("placement = {line}"))?;
            let placement: Placement = named["placement"].clone().try_into()?;
            placement.isometry()?;
        }
    } else if piece.starts_with("# cell.toml") {
        toml::from_str::<Cell>(piece)?;
    } else if piece.contains("[[joint]]") {
        toml::from_str::<RobotFile>(piece)?.arm()?;
    } else if piece.starts_with("joint_map") {
        let file: RobotFile = with(robot, piece)?.try_into()?;
        file.arm()?;
    } else {
        let of_tables = piece.contains("[stations");
        let file = if of_tables { "stations-wam" } else { "plan-kr210" };
        let _: PipelineFile = with(&format!("pipelines/{file}.toml"), piece)?.try_into()?;
    }
    Ok(())
}

#[test]
fn toml_of_the_readme_and_the_guide_is_taken() {
    let pieces = pieces();
    assert!(pieces.len() > 6, "{}", pieces.len());
    for Piece { file, text } in pieces {
        read(&text).unwrap_or_else(|e| panic!("{}: {e} in\n{text}", file.display()));
    }
}

#[test]
fn a_key_that_is_not_there_is_found() {
    let piece = "[report]\ntool_place = { frame = \"tool\", xyz_mm = [0, 0, 200] }\n";
    let error = read(piece).unwrap_err().to_string();
    assert!(error.contains("tool_place"), "{error}");
}

#[test]
fn the_readme_is_short_and_its_links_lead_to_files() {
    let readme = fs::read_to_string("README.md").expect("part of the project");
    let lines = readme.lines().count();
    assert!(lines <= 180, "{lines} lines: move something into src/guide");
    let links = readme.split("](").skip(1);
    let links: Vec<_> = links.filter_map(|rest| rest.split(')').next()).collect();
    let files = links.iter().filter(|link| !link.starts_with("https://"));
    let missing: Vec<_> = files.filter(|file| !Path::new(file).exists()).collect();
    assert!(links.len() > 10 && missing.is_empty(), "{missing:?}");
    let guide = fs::read_dir("src/guide").expect("part of the project");
    for chapter in guide.map(|entry| entry.expect("listed").path()) {
        let chapter = chapter.to_str().expect("UTF-8");
        assert!(links.contains(&chapter), "{chapter} is not in the README");
        links_lead_to_chapters(chapter);
    }
}

/// Reference links of a chapter are to files beside it, for whoever reads it as a file.
fn links_lead_to_chapters(chapter: &str) {
    let text = fs::read_to_string(chapter).expect("part of the project");
    let definitions = text.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]: "));
    let definitions = definitions.filter(|(label, _)| !label.contains(']'));
    for (label, target) in definitions {
        let (file, _) = target.split_once('#').unwrap_or((target, ""));
        assert!(
            Path::new("src/guide").join(file).exists(),
            "{chapter}: [{label}] leads to {target}"
        );
    }
    assert!(!text.contains("](crate::"), "{chapter}: a link that leads nowhere in a file");
}
