//! `posegrid simulate` as a user runs it, and the committed quickstart session as its command makes it.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{CommandFactory, Parser};
use posegrid::cli::simulate::{SimulateArgs, SimulatedSession, run};

/// The command line of `posegrid simulate` alone.
#[derive(Parser)]
struct Simulate {
    #[command(flatten)]
    args: SimulateArgs,
}

const FILES: [&str; 4] = ["controller.mcap", "tracker.mcap", "truth.json", "truth_stations.csv"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs the words of a command line, its robot file taken from the repository.
fn simulate<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<SimulatedSession, String> {
    let command = std::iter::once("simulate").chain(words);
    let mut args = Simulate::try_parse_from(command).map_err(|error| error.to_string())?.args;
    args.robot = root().join(&args.robot);
    run(&args).map_err(|error| error.to_string())
}

fn words(out: &Path, more: &str) -> Vec<String> {
    let fixed = "pipelines/robots/kr210-r2700-extra.toml --home 0,-75,100,25,55,-15";
    let mut words: Vec<String> = fixed.split(' ').map(str::to_owned).collect();
    words.extend(more.split_whitespace().map(str::to_owned));
    words.extend(["--out".to_owned(), out.display().to_string()]);
    words
}

/// A session of the KR 210; 8 stations where no flag says otherwise.
fn simulate_small(out: &Path, more: &str) -> Result<SimulatedSession, String> {
    let size = if more.contains("--size") { "" } else { " --size 100,100,100" };
    let words = words(out, &format!("{more}{size}"));
    simulate(words.iter().map(String::as_str))
}

#[test]
fn the_flags_are_consistent() {
    Simulate::command().debug_assert();
}

/// The command line in the quickstart's README, without `posegrid simulate` and its `--out`.
fn quickstart_command() -> String {
    let readme = root().join("tests/recordings/quickstart/README.md");
    let text = fs::read_to_string(&readme).unwrap_or_else(|e| panic!("{}: {e}", readme.display()));
    let (_, command) = text.split_once("posegrid simulate ").expect("the README gives the command");
    let (command, _) = command.split_once("```").expect("in a fenced block");
    command.replace("\\\n", " ")
}

#[test]
fn the_quickstart_session_is_what_its_command_makes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("quickstart");
    let command = quickstart_command();
    let words = command.split_whitespace().map(|word| {
        if word == "tests/recordings/quickstart" {
            out.to_str().expect("a temporary folder with a UTF-8 name")
        } else {
            word
        }
    });
    simulate(words).expect("the command runs");
    for file in FILES {
        let made = fs::read(out.join(file)).expect("made");
        let committed = root().join("tests/recordings/quickstart").join(file);
        let committed =
            fs::read(&committed).unwrap_or_else(|e| panic!("{}: {e}", committed.display()));
        // Not assert_eq: a megabyte of bytes helps nobody.
        assert!(
            made == committed,
            "{file}: run the README's command anew and commit what it makes"
        );
    }
}

#[test]
fn a_log_reads_back_as_the_recording_it_was_written_from() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let session = simulate_small(folder.path(), "--six-dof --seed 3").expect("in reach");
    let recording = &session.simulated.recording;
    let log = fs::read(folder.path().join("tracker.mcap")).expect("written");
    let mut read = Vec::new();
    for message in mcap::MessageStream::new(&log).expect("an MCAP file") {
        let message = message.expect("a message");
        if message.channel.topic == "/tracker/pose" {
            let double = |at: usize| {
                f64::from_le_bytes(message.data[at..at + 8].try_into().expect("8 bytes"))
            };
            // After encapsulation, stamp, and "tracker" with its length and padding: 28 bytes.
            read.push((message.publish_time, [28, 36, 44].map(double)));
        }
    }
    assert_eq!(read.len(), recording.readings.stamps.len());
    for ((ns, metres), (stamp, mm)) in
        read.iter().zip(recording.readings.stamps.iter().zip(&recording.readings.positions))
    {
        assert_eq!(i64::try_from(*ns).expect("a stamp"), stamp.ns());
        for (m, mm) in metres.iter().zip(mm) {
            assert!((m * 1000.0 - mm).abs() < 1e-9);
        }
    }
}

#[test]
fn zero_switches_each_error_off() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let off = "--length-sd-mm 0 --angle-sd-mrad 0 --slow-curve-urad 0 --fast-curve-urad 0 --gear-line-urad 0 \
               --backlash-urad 0 --stops-short-urad 0 --repeatability-urad 0 --sag-urad 0 --target-sd-mm 0 --base-drift-mm 0";
    let session = simulate_small(folder.path(), off).expect("in reach");
    // Reported angles are rounded to 1e-7 rad: below 1 µm at 3 m.
    assert!(session.simulated.truth.raw_error_mm.max < 1e-3);
}

#[test]
fn bad_usage_says_what_to_do() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let cases = [
        ("--size 1,2", "give three"),
        ("--size 1,2,nan", "not a finite number"),
        ("--grid-step 0", "no node at a step of 0 mm"),
        ("--grid-step 1e-9", "widen the step"),
        ("--random 3 --centre 9000,0,0", "move or shrink the box"),
        ("--dwell-s 0", "dwell_s = 0"),
        ("--dwell-s 999999", "samples of joints"),
        ("--clock-offset-s 1e300", "offset_s"),
        ("--camera 1500,0.2,240", "give 4"),
        ("--camera 1500,0.2,240,2.5", "give a whole number"),
        ("--camera 1500,0.2,240,1", "between 2 and 100"),
        ("--camera 1500,0,240,5", "noise_px = 0"),
        ("--scanner 0.1,0.02 --six-dof", "cannot be used with"),
        ("--on-flange", "--camera"),
        ("--understated 2", "--scanner"),
        ("--scanner 0.1,0.02 --camera 1500,0.2,240,5", "cannot be used with"),
        ("--clock-offset-s 1e9", "choose another clock origin or offset"),
    ];
    for (flags, expected) in cases {
        let error = simulate_small(&out, flags).expect_err(flags);
        assert!(error.contains(expected), "{flags}: {error}");
    }
    let no_robot = simulate(["nowhere.toml", "--home", "0", "--out", "x"]).expect_err("no file");
    assert!(
        no_robot.contains("nowhere.toml") && no_robot.contains("pipelines/robots"),
        "{no_robot}"
    );
    let wrong_home = simulate([
        "pipelines/robots/ur10.toml",
        "--home",
        "0,1",
        "--out",
        out.to_str().expect("UTF-8"),
    ]);
    assert!(wrong_home.expect_err("too few angles").contains("2 angles, but the arm has 6"));
}

#[test]
fn an_earlier_session_is_not_overwritten() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    simulate_small(folder.path(), "--random 3").expect("in reach");
    let before = fs::read(folder.path().join("truth.json")).expect("written");
    let error = simulate_small(folder.path(), "--random 4").expect_err("there is one already");
    assert!(error.contains("controller.mcap exists already"), "{error}");
    let after = fs::read(folder.path().join("truth.json")).expect("still there");
    assert!(before == after);
    let names: Vec<PathBuf> = fs::read_dir(folder.path())
        .expect("the folder")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    assert_eq!(names.len(), FILES.len(), "nothing partial is left: {names:?}");
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    fs::write(&file, "not a folder").expect("written");
    let error = simulate_small(&file.join("out"), "").expect_err("a file is in the way");
    assert!(
        error.contains("file/out") && error.contains("a part of its path is a file"),
        "{error}"
    );
}

/// A pipeline that reads one simulated session: its logs, or its table by the section in the head of that.
fn pipeline(folder: &Path, session: &str, tracker: &str, from_table: bool, poses: bool) -> PathBuf {
    let mut lines = vec![
        "[robot]".to_owned(),
        format!("file = \"{}/pipelines/robots/kr210-r2700-extra.toml\"", root().display()),
        "name = \"kr\"\n[input]\nfolder = \".\"".to_owned(),
        format!("sessions = [\"{session}\"]"),
    ];
    if from_table {
        let table = fs::read_to_string(folder.join(session).join("stations.csv")).expect("written");
        lines.push("stations = \"stations.csv\"".to_owned());
        let head = table.lines().filter_map(|line| line.strip_prefix("# "));
        let head = head.skip(1).filter(|line| !line.starts_with("commanded"));
        lines.extend(head.map(str::to_owned));
        lines.push("[tracker]".to_owned());
    } else {
        lines.push(
            "[controller]\ntopic = \"/joint_states\"\ntime = \"header\"\nunit = \"rad\"\n[tracker]\n\
             topic = \"/tracker/pose_with_covariance\"\ntime = \"header\"\nunit = \"m\""
                .to_owned(),
        );
        lines.extend((!poses).then(|| "ignore_orientation = true".to_owned()));
    }
    let kind = if from_table { "table" } else { "log" };
    lines.push(format!("{tracker}\n[fit]\norientations = {poses}"));
    lines.push(
        "[fit.full]\nenabled = false\n[grid]\nsteps_mm = [400]\n[tolerance]\nmm = 3\nshare = 0.95\nconfidence = 0.95"
            .to_owned(),
    );
    lines.push(format!("[output]\nlake = \"lake-{session}-{kind}\""));
    let path = folder.join(format!("{session}-{kind}.toml"));
    fs::write(&path, lines.join("\n")).expect("writable");
    path
}

/// What `posegrid run --verbose` says of the size of the noise: the factor on what is stated, and its standard error, half of what stands behind ±.
fn size(pipeline: &Path) -> (f64, f64) {
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .args(["run", "--verbose"])
        .arg(pipeline)
        .output()
        .expect("started");
    let said = String::from_utf8_lossy(&run.stdout);
    let line = said.lines().find(|line| line.contains("times what"));
    let line = line.unwrap_or_else(|| panic!("{said}\n{}", String::from_utf8_lossy(&run.stderr)));
    let before = line.split(" times what").next().unwrap_or_default();
    let words: Vec<&str> = before.split_whitespace().rev().take(3).collect();
    let number = |word: &str| word.parse().unwrap_or_else(|_| panic!("{line}"));
    (number(words[2]), number(words[0]) / 2.0)
}

#[test]
fn the_noise_of_other_instruments_is_found_in_their_logs_and_tables() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let camera = "camera = { focal_px = 1500, noise_px = 0.2, target_mm = 240, corners = 5, looks_along = [0, 0, 1]";
    let cases = [
        (
            "scan",
            "--scanner 0.1,0.02 --understated 2",
            "uncertainty = { range_um = 300, range_um_per_m = 0, transverse_um = 60, transverse_um_per_m = 0, divisor = 1 }".to_owned(),
            2.0,
        ),
        (
            "cell",
            "--camera 1500,0.2,240,5 --understated 1.5",
            format!("{camera} }}"),
            1.5,
        ),
        (
            "flange",
            "--camera 1500,0.2,240,5 --on-flange",
            format!("{camera}, mounted = \"flange\" }}"),
            1.0,
        ),
    ];
    for (name, flags, tracker, understated) in cases {
        let words = words(
            &folder.path().join(name),
            &format!(
                "{flags} --table --session {name} --random-joints 150 --spread-deg 20 --arm 7 --seed 6"
            ),
        );
        simulate(words.iter().map(String::as_str)).expect("in reach");
        // Half of the variance is shared by all readings of a station, the other half is that of their mean.
        let expected = understated * (0.5_f64 + 0.5 / 47.0).sqrt();
        for from_table in [false, true] {
            let poses = name != "scan";
            let path = pipeline(folder.path(), name, &tracker, from_table, poses);
            let (size, se) = size(&path);
            println!("{name}: {size} ± {se}, expected {expected:.3}");
            assert!(
                (size - expected).abs() < 3.0 * se,
                "{name}: {size} ± {se}, expected {expected:.3}"
            );
        }
    }
}
