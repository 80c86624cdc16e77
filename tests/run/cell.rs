//! A measuring cell in a temporary folder: sessions, a pipeline file that reads them, a lake.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, OnceLock};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant, SystemTime};

use posegrid::files::schema;
use posegrid::files::table::{self, Table};

/// The quickstart's pipeline file, made quick: three steps, and joint curves of a tenth of the harmonics.
const CHANGES: [(&str, &str); 5] = [
    ("\"../tests/recordings\"", "\"sessions\""),
    ("sessions = [\"quickstart\"]", "# sessions"),
    ("steps_mm = [60, 90, 120, 180, 240, 360, 720]", "steps_mm = [180, 240, 360]"),
    ("[grid]", "[fit.full]\nharmonics = 12\n\n[grid]"),
    ("lake = \"../lake\"", "lake = \"lake\""),
];

/// Far more than any of these commands takes: one that is not over by then hangs.
const HANGS: Duration = Duration::from_mins(3);
/// A cell whose folder goes with it.
pub struct Cell {
    root: tempfile::TempDir,
    text: String,
}

/// How a command ended.
pub struct Ended {
    /// Its exit code.
    pub code: i32,
    /// Its results.
    pub results: String,
    /// Its messages.
    pub messages: String,
}

impl Cell {
    /// A cell with the quickstart's pipeline file and robot, and no session yet.
    pub fn new() -> Self {
        let root = tempfile::tempdir().expect("a temporary folder");
        let text = read("pipelines/quickstart.toml");
        let cell = Self { root, text };
        let robots = cell.path("robots");
        fs::create_dir(&robots).expect("writable");
        let robot = "kr210-r2700-extra.toml";
        fs::copy(Path::new("pipelines/robots").join(robot), robots.join(robot)).expect("copied");
        CHANGES.iter().fold(cell, |cell, (from, to)| cell.with(from, to))
    }

    /// The same cell with a text of its pipeline file replaced.
    pub fn with(mut self, from: &str, to: &str) -> Self {
        assert!(self.text.contains(from), "{from:?} is not in {}", self.text);
        self.text = self.text.replacen(from, to, 1);
        fs::write(self.pipeline(), &self.text).expect("writable");
        self
    }

    /// The same cell with the quickstart's logs as a session of this name.
    pub fn with_quickstart(self, name: &str) -> Self {
        let folder = self.session(name);
        fs::create_dir_all(&folder).expect("writable");
        for log in ["controller.mcap", "tracker.mcap"] {
            let from = Path::new("tests/recordings/quickstart").join(log);
            fs::copy(from, folder.join(log)).expect("copied");
        }
        self
    }

    /// The same cell with a session of this name that `posegrid simulate` made of the poses that the flags say.
    pub fn with_simulated(self, name: &str, flags: &[&str]) -> Self {
        let made = ended(
            posegrid()
                .args(["simulate", "pipelines/robots/kr210-r2700-extra.toml"])
                .args(["--seed", "3", "--home", "0,-75,100,25,55,-15", "--session", name])
                .arg("--out")
                .arg(self.session(name))
                .args(flags),
        );
        assert_eq!(made.code, 0, "{}", made.messages);
        self
    }

    /// The same cell with a session of this name at so many random poses, in the box and near the orientation of the quickstart's grid, by
    /// the arm of a seed; the quickstart's has 18.
    pub fn with_judge(self, name: &str, arm: &str, count: &str) -> Self {
        let (size, cone) = ("600,1200,600", "3");
        let flags = ["--arm", arm, "--size", size, "--cone-deg", cone];
        self.with_simulated(name, &[&flags[..], &["--random", count]].concat())
    }

    /// The same cell with a log of a session replaced by what `change` makes of it, an hour ago.
    pub fn with_log(
        self,
        session: &str,
        log: &str,
        change: impl FnOnce(Vec<u8>) -> Vec<u8>,
    ) -> Self {
        let path = self.session(session).join(log);
        let bytes = fs::read(&path).expect("a log");
        fs::write(&path, change(bytes)).expect("writable");
        let file = fs::File::options().write(true).open(&path).expect("written");
        let hour_ago = SystemTime::now() - Duration::from_hours(1);
        file.set_modified(hour_ago).expect("writable");
        self
    }

    /// How many items of each kind a session's run read and kept.
    pub fn counts(&self, session: &str) -> BTreeMap<String, [u64; 2]> {
        let runs = self.table("runs", session);
        let counts: Vec<serde_json::Value> =
            serde_json::from_str(runs.text("counts").value(0)).expect("JSON");
        let count = |own: &serde_json::Value| {
            let number = |key: &str| own[key].as_u64().expect("a count");
            let of = own["of"].as_str().expect("a kind").to_owned();
            (of, [number("read"), number("kept")])
        };
        counts.iter().map(count).collect()
    }

    /// Asserts that the join has a class for every reading that the logs of a session give it.
    pub fn assert_every_reading_has_a_class(&self, session: &str) {
        let counts = self.counts(session);
        let kept = |of: &str| counts.get(of).map_or(0, |[_, kept]| *kept);
        let [read, _] = counts["readings"];
        let given = kept("reading messages") + kept("length messages");
        assert_eq!(read, given, "{counts:?}");
    }

    /// A path in the cell's folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    /// The folder of a session.
    pub fn session(&self, name: &str) -> PathBuf {
        self.path("sessions").join(name)
    }

    /// The pipeline file.
    pub fn pipeline(&self) -> PathBuf {
        self.path("pipeline.toml")
    }

    /// `posegrid run` on the pipeline file, not started yet.
    pub fn command(&self) -> Command {
        let mut command = posegrid();
        command.arg("run").arg(self.pipeline());
        command
    }

    /// Runs the pipeline with more arguments.
    pub fn run(&self, arguments: &[&str]) -> Ended {
        ended(self.command().args(arguments))
    }

    /// The only file of a table of a session in the cell's lake.
    pub fn table_file(&self, table: &str, session: &str) -> PathBuf {
        let folder = self.path("lake").join(table).join("kr210-demo").join(session);
        let files: Vec<_> = files(&folder).into_keys().collect();
        assert_eq!(files.len(), 1, "{files:?} in {}", folder.display());
        folder.join(&files[0])
    }

    /// The only table of its kind of a session in the cell's lake.
    pub fn table(&self, table: &str, session: &str) -> Table {
        let schema = schema::find(table).expect("a published table");
        table::read(&self.table_file(table, session), schema).expect("a table by its schema")
    }

    /// Every file of the cell's lake, by path in it.
    pub fn lake(&self) -> BTreeMap<String, Vec<u8>> {
        published(&self.path("lake"))
    }
}

impl Ended {
    /// Asserts the exit code, and that the results or messages hold all these texts.
    pub fn expect(&self, code: i32, texts: &[&str]) {
        let told = format!("{}{}", self.results, self.messages);
        assert_eq!(self.code, code, "{told}");
        for text in texts {
            assert!(told.contains(text), "{text:?} is not in:\n{told}");
        }
        self.no_defect();
    }

    /// Asserts that nothing panicked: a panic of a session is caught and told.
    pub fn no_defect(&self) {
        for word in ["panicked", "defect of posegrid"] {
            assert!(!self.messages.contains(word), "{}", self.messages);
        }
    }
}

/// Two sessions with the same logs, and the lake that one undisturbed run made of them.
pub fn undisturbed() -> &'static Cell {
    static CELL: OnceLock<Cell> = OnceLock::new();
    CELL.get_or_init(|| {
        let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
        cell.run(&[]).expect(0, &["2 of 2 within 0.5 mm"]);
        cell
    })
}

/// A copy of a table of Monday's undisturbed run outside its lake: what is corrected with it is recorded nowhere.
pub fn alone(table: &str) -> PathBuf {
    static COPIES: Mutex<BTreeMap<String, PathBuf>> = Mutex::new(BTreeMap::new());
    let cell = undisturbed();
    let mut copies = COPIES.lock().expect("no test panics here");
    let copy = copies.entry(table.to_owned()).or_insert_with(|| {
        let copy = cell.path(&format!("{table}-alone.parquet"));
        fs::copy(cell.table_file(table, "mon"), &copy).expect("writable");
        copy
    });
    copy.clone()
}

/// The command, not started yet.
pub fn posegrid() -> Command {
    Command::new(env!("CARGO_BIN_EXE_posegrid"))
}

/// Runs a command to its end.
pub fn ended(command: &mut Command) -> Ended {
    Ended::from(command.output().expect("started"))
}

/// Runs a command that reads a text from standard input to its end.
pub fn ended_with(command: &mut Command, input: &str) -> Ended {
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().expect("started");
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(input.as_bytes()).expect("read");
    drop(stdin);
    Ended::from(child.wait_with_output().expect("our own child"))
}

/// Waits for the end of a command, which has to come, and reads what it tells.
pub fn in_time(mut child: Child) -> Output {
    let (stdout, stderr) = (all_of(child.stdout.take()), all_of(child.stderr.take()));
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("our own child") {
            break status;
        }
        if begun.elapsed() > HANGS {
            child.kill().expect("our own child");
            panic!("it hangs");
        }
        sleep(Duration::from_millis(5));
    };
    let joined = |read: JoinHandle<Vec<u8>>| read.join().expect("read");
    let (stdout, stderr) = (joined(stdout), joined(stderr));
    Output { status, stdout, stderr }
}

fn all_of(stream: Option<impl Read + Send + 'static>) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut stream) = stream {
            stream.read_to_end(&mut bytes).expect("readable");
        }
        bytes
    })
}

impl From<Output> for Ended {
    fn from(output: Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("UTF-8");
        let messages = text(&output.stderr);
        Self {
            code: output.status.code().unwrap_or_else(|| panic!("ended by a signal: {messages}")),
            results: text(&output.stdout),
            messages,
        }
    }
}

/// Every file of a lake, by path in it, but for the lock, which says who ran last, the index, which has times of files, `asked`, which has a
/// clock, and the pages of all nights with what they are made of, which a batch writes that made a run current.
pub fn published(lake: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = files(lake);
    files.remove(".lock");
    files.remove(".index/runs.jsonl.zst");
    let is_of_all = |path: &str| {
        path.starts_with("pages/") || path.starts_with(".history/") && !path.contains("/figures/")
    };
    files.retain(|path, _| !path.starts_with("asked/") && !is_of_all(path));
    files
}

/// Every file under a folder that need not exist, by its path there.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let Ok(entries) = fs::read_dir(folder) else {
        return found;
    };
    for entry in entries {
        let path = entry.expect("readable").path();
        let name = path.file_name().expect("named").to_string_lossy().into_owned();
        if path.is_dir() {
            let below = files(&path).into_iter();
            found.extend(below.map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            // A temporary may be renamed between listing and reading.
            found.extend(fs::read(&path).ok().map(|bytes| (name, bytes)));
        }
    }
    found
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"))
}
