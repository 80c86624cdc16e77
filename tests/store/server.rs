//! The server, and cells that keep their sessions and lake on it.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use futures_util::TryStreamExt as _;
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::path::Path as Key;
use object_store::{ObjectStore as _, ObjectStoreExt as _};
use tokio::runtime::Runtime;

use crate::cell::{Cell, Ended, ended};

/// The server's only bucket.
pub const BUCKET: &str = "bucket";

/// A server that ends with this process: its standard input is closed then.
pub struct Server {
    /// Where it answers.
    pub url: String,
    /// The only key that it takes.
    pub key: String,
    /// What belongs to that key.
    pub secret: String,
    runtime: Runtime,
    client: AmazonS3,
    _process: Child,
    _until_closed: ChildStdin,
}

/// The server of this process that lets everybody in.
fn open() -> Option<&'static Server> {
    static SERVER: OnceLock<Option<Server>> = OnceLock::new();
    told(SERVER.get_or_init(|| Server::start(&["serve"])).as_ref())
}

/// The one that lets in its own key only.
fn strict() -> Option<&'static Server> {
    static SERVER: OnceLock<Option<Server>> = OnceLock::new();
    told(SERVER.get_or_init(|| Server::start(&["serve", "strict"])).as_ref())
}

/// Says loudly where there is no Python that has the server; on a CI machine that is a failure.
fn told(server: Option<&'static Server>) -> Option<&'static Server> {
    if server.is_none() {
        let what = "no moto (`pip install 'moto[server]' boto3 pyarrow`) in POSEGRID_PYTHON or target/ci-venv";
        assert!(std::env::var_os("CI").is_none(), "{what}: CI must have it");
        eprintln!("SKIPPED: {what}, so this test has shown nothing");
    }
    server
}

/// `server.py` with these arguments.
fn script(arguments: &[&str]) -> Command {
    let python = std::env::var_os("POSEGRID_PYTHON").map(PathBuf::from);
    let mut command = Command::new(python.unwrap_or_else(|| "target/ci-venv/bin/python".into()));
    command.arg("tests/store/server.py").args(arguments);
    for name in ["HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"] {
        command.env_remove(name);
    }
    command
}

impl Server {
    fn start(arguments: &[&str]) -> Option<Self> {
        let mut process = script(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut line = String::new();
        let told = process.stdout.take().expect("piped");
        BufReader::new(told).read_line(&mut line).expect("told");
        let mut words = line.split_whitespace().map(str::to_owned);
        let (port, key, secret) = (words.next()?, words.next()?, words.next()?);
        let url = format!("http://127.0.0.1:{port}");
        // TLS by ring, as in the program itself.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let client = AmazonS3Builder::new()
            .with_endpoint(&url)
            .with_allow_http(true)
            .with_bucket_name(BUCKET)
            .with_access_key_id(&key)
            .with_secret_access_key(&secret);
        Some(Self {
            client: client.build().expect("a client"),
            runtime: tokio::runtime::Builder::new_multi_thread()
                .worker_threads(1)
                .enable_all()
                .build()
                .expect("a runtime"),
            url,
            key,
            secret,
            _until_closed: process.stdin.take().expect("piped"),
            _process: process,
        })
    }

    /// What a process has to know to use the server.
    pub fn environment(&self) -> [(&'static str, &str); 5] {
        [
            ("AWS_ENDPOINT_URL", &self.url),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", &self.key),
            ("AWS_SECRET_ACCESS_KEY", &self.secret),
            ("NO_PROXY", "127.0.0.1"),
        ]
    }

    /// Puts bytes at a key.
    pub fn put(&self, key: &str, bytes: Vec<u8>) {
        let key = Key::parse(key).expect("a key");
        let put = self.client.put(&key, bytes.into());
        self.runtime.block_on(put).expect("put");
    }

    /// Puts an object at a key as it is written, through another client.
    pub fn put_raw(&self, key: &str, bytes: &[u8]) {
        let mut put = script(&["put", &self.url, key])
            .envs(self.environment())
            .stdin(Stdio::piped())
            .spawn()
            .expect("started");
        let mut stdin = put.stdin.take().expect("piped");
        stdin.write_all(bytes).expect("taken");
        drop(stdin);
        assert!(put.wait().expect("our own child").success());
    }

    /// Rows of every table of a lake, by a reader that has nothing of ours.
    pub fn rows_by_table(&self, lake: &str) -> BTreeMap<String, usize> {
        let mut read = script(&["read", &self.url, lake]);
        let read = read.envs(self.environment()).output().expect("started");
        assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
        serde_json::from_slice(&read.stdout).expect("rows as JSON")
    }

    /// Every object below a prefix, by its key there.
    pub fn objects(&self, prefix: &str) -> BTreeMap<String, Vec<u8>> {
        let get = async |key: &Key| self.client.get(key).await?.bytes().await;
        let keys = self.keys(prefix).into_iter();
        keys.map(|(key, _)| {
            let whole = Key::parse(format!("{prefix}/{key}")).expect("a key");
            let bytes = self.runtime.block_on(get(&whole)).expect("an object");
            (key, bytes.to_vec())
        })
        .collect()
    }

    /// The keys below a prefix, and when each was last written.
    pub fn keys(&self, prefix: &str) -> BTreeMap<String, String> {
        let below = Key::parse(prefix).expect("a key");
        let listed = self.client.list(Some(&below)).try_collect::<Vec<_>>();
        let listed = self.runtime.block_on(listed).expect("listed");
        let key = |whole: &Key| {
            let key = whole.as_ref().strip_prefix(prefix);
            key.expect("below").trim_start_matches('/').to_owned()
        };
        let named = |found: object_store::ObjectMeta| {
            (key(&found.location), found.last_modified.to_string())
        };
        listed.into_iter().map(named).collect()
    }
}

/// A cell whose sessions and lake stand on the server, under a prefix of their own; its temporaries stand, and have to
/// go, in the cell's folder.
pub struct Remote {
    /// The server.
    pub server: &'static Server,
    /// The folder with the pipeline file.
    pub cell: Cell,
    prefix: String,
}

impl Remote {
    /// A new one with the quickstart's logs as sessions of these names; `None` where there is no server.
    pub fn new(sessions: &[&str]) -> Option<Self> {
        Some(Self::on(open()?, sessions))
    }

    /// The same on the server that is strict about keys.
    pub fn strict(sessions: &[&str]) -> Option<Self> {
        Some(Self::on(strict()?, sessions))
    }

    fn on(server: &'static Server, sessions: &[&str]) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let prefix = format!("cell-{}", NEXT.fetch_add(1, Ordering::Relaxed));
        let cell = Cell::new()
            .with("\"sessions\"", &format!("\"s3://{BUCKET}/{prefix}/sessions\""))
            .with("\"lake\"", &format!("\"s3://{BUCKET}/{prefix}/lake\""));
        fs::create_dir(cell.path("tmp")).expect("writable");
        let remote = Self { server, cell, prefix };
        for session in sessions {
            remote.put_session(session);
        }
        remote
    }

    /// The same with a text of its pipeline file replaced.
    pub fn with(self, from: &str, to: &str) -> Self {
        let cell = self.cell.with(from, to);
        Self { cell, ..self }
    }

    /// Puts the quickstart's logs as a session of this name.
    pub fn put_session(&self, name: &str) {
        for log in ["controller.mcap", "tracker.mcap"] {
            let from = Path::new("tests/recordings/quickstart").join(log);
            let bytes = fs::read(from).expect("a log");
            self.server.put(&self.key(&format!("sessions/{name}/{log}")), bytes);
        }
    }

    /// The key of a name below the cell's prefix.
    pub fn key(&self, name: &str) -> String {
        format!("{}/{name}", self.prefix)
    }

    /// The address of a name below the cell's prefix.
    pub fn address(&self, name: &str) -> String {
        format!("s3://{BUCKET}/{}", self.key(name))
    }

    /// Any command of posegrid that knows how to reach the server.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
        command
            .args(arguments)
            .envs(self.server.environment())
            .env("TMPDIR", self.cell.path("tmp"));
        command
    }

    /// `posegrid run` on the pipeline file, not started yet.
    pub fn run_command(&self) -> Command {
        self.command(&["run", &self.cell.pipeline().display().to_string()])
    }

    /// Runs the pipeline; no temporary may stay behind, whatever comes of it.
    pub fn run(&self, arguments: &[&str]) -> Ended {
        let mut command = self.run_command();
        command.args(arguments);
        let ended = Ended::from(command.output().expect("started"));
        self.no_temporaries();
        ended
    }

    /// Asserts that nothing is left among the temporaries.
    pub fn no_temporaries(&self) {
        let left: Vec<_> = fs::read_dir(self.cell.path("tmp")).expect("readable").collect();
        assert!(left.is_empty(), "{left:?}");
    }

    /// The requests of the lake, by their keys in it.
    pub fn requests(&self) -> BTreeMap<String, Vec<u8>> {
        let mut objects = self.server.objects(&self.key("lake"));
        objects.retain(|key, _| key.starts_with("asked/"));
        objects
    }

    /// Every object of the lake but the index, which has the tags of logs, and `asked`, which has a clock.
    pub fn lake(&self) -> BTreeMap<String, Vec<u8>> {
        let mut objects = self.server.objects(&self.key("lake"));
        objects.remove(".index/runs.jsonl.zst");
        objects.retain(|key, _| !key.starts_with("asked/"));
        objects
    }
}

/// The lake that an undisturbed run in folders makes of one session with the quickstart's logs.
pub fn in_folders() -> &'static BTreeMap<String, Vec<u8>> {
    static LAKE: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    LAKE.get_or_init(|| {
        let cell = Cell::new().with_quickstart("mon");
        ended(&mut cell.command()).expect(0, &["1 of 1 within 0.5 mm"]);
        cell.lake()
    })
}
