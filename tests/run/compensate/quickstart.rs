//! The quickstart as a newcomer runs it, once for all tests of this program.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A folder with what the quickstart reads, and the lake that its run wrote.
pub struct Quickstart {
    /// The folder: `pipelines/`, `tests/recordings/quickstart/` and `lake/` stand in it as in a checkout.
    pub folder: PathBuf,
    /// What the run printed on stdout.
    pub printed: String,
}

impl Quickstart {
    pub fn sh(&self, lines: &str) -> String {
        sh(&self.folder, lines)
    }

    /// The run's file of a table, its path from the folder.
    pub fn table(&self, name: &str) -> String {
        format!("lake/{name}/kr210-demo/quickstart/{}.parquet", self.run())
    }

    /// The run's id.
    pub fn run(&self) -> String {
        let rows = self.folder.join("lake/runs/kr210-demo/quickstart");
        let mut files = fs::read_dir(rows).expect("there");
        let file = files.next().expect("one").expect("listed").path();
        assert!(files.next().is_none(), "one run");
        let stem = file.file_stem().expect("named");
        stem.to_string_lossy().into_owned()
    }
}

/// The lines of a shell run in a folder, with our program on the path; what they print on stdout. They have to succeed.
pub fn sh(folder: &Path, lines: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_posegrid"));
    let mut path = OsString::from(program.parent().expect("in a folder"));
    path.push(":/usr/bin:/bin");
    let done = Command::new("sh")
        .args(["-e", "-c", lines])
        .env("PATH", path)
        .current_dir(folder)
        .output()
        .expect("started");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// The quickstart's run.
pub fn quickstart() -> &'static Quickstart {
    static ONE: OnceLock<Quickstart> = OnceLock::new();
    ONE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("quickstart");
        if folder.exists() {
            fs::remove_dir_all(&folder).expect("ours");
        }
        for file in [
            "pipelines/quickstart.toml",
            "pipelines/robots/kr210-r2700-extra.toml",
            "tests/recordings/quickstart/controller.mcap",
            "tests/recordings/quickstart/tracker.mcap",
        ] {
            let to = folder.join(file);
            fs::create_dir_all(to.parent().expect("in a folder")).expect("writable");
            fs::copy(file, to).expect("part of the project");
        }
        let mut one = Quickstart { folder, printed: String::new() };
        one.printed = one.sh("posegrid run pipelines/quickstart.toml");
        one
    })
}
