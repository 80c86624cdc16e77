//! What the guide says of running every night: the units and the cron line, as they stand there.

use std::fs;
use std::process::Command;

use super::cell::{Cell, Ended, ended};

const BINARY: &str = "/usr/local/bin/posegrid";
const PIPELINE: &str = "/srv/cell/cell.toml";

/// The fenced text of the guide that begins with this line.
fn text(first: &str) -> String {
    let guide = fs::read_to_string("src/guide/first_night.md").expect("part of the project");
    let start = guide.find(&format!("\n{first}\n"));
    let start = start.unwrap_or_else(|| panic!("{first:?} begins no text of the guide"));
    let text = guide[start + 1..].split("\n```").next();
    text.expect("fenced").to_owned()
}

/// A command line of the guide with our own binary and pipeline file in it.
fn ours(line: &str, cell: &Cell) -> String {
    assert!(line.contains(BINARY) && line.contains(PIPELINE), "{line}");
    line.replace(BINARY, env!("CARGO_BIN_EXE_posegrid"))
        .replace(PIPELINE, cell.pipeline().to_str().expect("UTF-8"))
}

/// Runs a command line as a scheduler does: with hardly any environment, from `/`.
fn bare(line: &str) -> Ended {
    let mut command = std::process::Command::new("env");
    ended(command.args(["-i", "PATH=/usr/bin:/bin", "sh", "-c", line]).current_dir("/"))
}

fn small() -> Cell {
    Cell::new().with("harmonics = 12", "enabled = false").with_simulated("mon", &["--random", "12"])
}

#[test]
fn the_service_runs_as_it_stands_in_the_guide() {
    let cell = small();
    let service = text("# /etc/systemd/system/posegrid.service");
    let line = service.lines().find_map(|line| line.strip_prefix("ExecStart="));
    let line = ours(line.expect("a command"), &cell);
    bare(&line).expect(3, &["done         mon: not shown", "\"level\":\"INFO\""]);
}

#[test]
fn the_cron_line_runs_as_it_stands_in_the_guide() {
    let cell = small();
    let crontab = text("# m h dom mon dow command");
    let line = crontab.lines().find(|line| line.contains(BINARY)).expect("a line");
    let (when, command) = line.split_at(line.find(BINARY).expect("looked for"));
    assert_eq!(when.split_whitespace().count(), 5, "{line}");
    assert!(!command.contains('%'), "cron takes it for the end of the line: {command}");
    bare(&ours(command, &cell)).expect(3, &["done         mon: not shown"]);
}

#[test]
fn systemd_takes_the_units_as_they_stand_in_the_guide() {
    let probe = Command::new("systemd-analyze").arg("--version").output();
    if !probe.is_ok_and(|probe| probe.status.success()) {
        assert!(std::env::var_os("CI").is_none(), "systemd-analyze is absent: CI must have it");
        eprintln!(
            "SKIPPED: systemd-analyze is absent, so this test has shown nothing (apt-get install systemd)"
        );
        return;
    }
    let cell = small();
    for name in ["posegrid.service", "posegrid.timer"] {
        let unit = text(&format!("# /etc/systemd/system/{name}"));
        let unit = if name.ends_with("service") { ours(&unit, &cell) } else { unit };
        fs::write(cell.path(name), unit).expect("writable");
    }
    let units = ["posegrid.service", "posegrid.timer"].map(|name| cell.path(name));
    let verified = Command::new("systemd-analyze").arg("verify").args(units).output();
    let verified = verified.expect("started");
    let told = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(verified.status.success(), "{told}");
    assert!(!told.contains("posegrid"), "{told}");
}
