//! An S3 server in memory, on loopback: each answer takes its time, and requests are counted by their kind.
//!
//! It knows what posegrid asks for: listings, reads of ranges, conditional puts and uploads in parts. Signatures are not checked.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread::{self, sleep};
use std::time::Duration;

use md5::{Digest as _, Md5};
use percent_encoding::percent_decode_str;

use crate::server::BUCKET;

/// Most keys of a listing, as S3 has it.
const PAGE: usize = 1000;

/// A server for as long as this process.
pub struct Memory {
    /// Where it answers.
    pub url: String,
    held: Arc<Held>,
}

#[derive(Default)]
struct Held {
    delay: Duration,
    objects: Mutex<BTreeMap<String, Vec<u8>>>,
    parts: Mutex<BTreeMap<String, BTreeMap<u32, Vec<u8>>>>,
    asked: Mutex<Vec<String>>,
}

struct Request {
    method: String,
    key: String,
    query: BTreeMap<String, String>,
    headers: BTreeMap<String, String>,
    body: Vec<u8>,
}

struct Answer {
    status: &'static str,
    headers: String,
    body: Vec<u8>,
}

impl Memory {
    /// An empty bucket of which every answer takes so long.
    pub fn answering_after(delay: Duration) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("http://{}", listener.local_addr().expect("bound"));
        let held = Arc::new(Held { delay, ..Held::default() });
        let shared = Arc::clone(&held);
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let held = Arc::clone(&shared);
                // A connection that ends is the client's to tell.
                thread::spawn(move || held.served(stream));
            }
        });
        Self { url, held }
    }

    /// Puts bytes at a key.
    pub fn put(&self, key: &str, bytes: Vec<u8>) {
        self.held.objects().insert(key.to_owned(), bytes);
    }

    /// The requests since the last call: method and address of each.
    pub fn asked(&self) -> Vec<String> {
        std::mem::take(&mut *self.held.asked.lock().expect("nobody panics with it"))
    }

    /// What a process has to know to use the server.
    pub fn environment(&self) -> [(&'static str, &str); 5] {
        [
            ("AWS_ENDPOINT_URL", &self.url),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", "any"),
            ("AWS_SECRET_ACCESS_KEY", "any"),
            ("NO_PROXY", "127.0.0.1"),
        ]
    }
}

impl Held {
    fn objects(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.objects.lock().expect("nobody panics with it")
    }

    fn served(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let mut reader = BufReader::new(stream.try_clone()?);
        let mut writer = stream;
        while let Some(request) = self.request(&mut reader)? {
            sleep(self.delay);
            let Answer { status, headers, body } = self.answer(&request);
            let length = format!("Content-Length: {}\r\n", body.len());
            // The answer to HEAD states the length of what is not sent.
            let (length, body) = match request.method.as_str() {
                "HEAD" if headers.contains("Content-Length") => (String::new(), Vec::new()),
                _ => (length, body),
            };
            let head = format!("HTTP/1.1 {status}\r\n{headers}{length}\r\n");
            writer.write_all(&[head.as_bytes(), &body].concat())?;
        }
        Ok(())
    }

    fn request(&self, reader: &mut BufReader<TcpStream>) -> io::Result<Option<Request>> {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let mut words = line.split_whitespace();
        let (method, address) = (words.next(), words.next());
        let (method, address) = (method.unwrap_or_default(), address.unwrap_or_default());
        let mut asked = self.asked.lock().expect("nobody panics with it");
        asked.push(format!("{method} {address}"));
        drop(asked);
        let (path, query) = address.split_once('?').unwrap_or((address, ""));
        let pairs = query.split('&').filter(|pair| !pair.is_empty());
        let pair = |pair: &str| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            (decoded(name), decoded(value))
        };
        let query = pairs.map(pair).collect();
        let path = path.trim_start_matches('/');
        let key = path.strip_prefix(BUCKET).unwrap_or(path);
        let key = decoded(key.trim_start_matches('/'));
        let mut headers = BTreeMap::new();
        loop {
            let mut line = String::new();
            reader.read_line(&mut line)?;
            let Some((name, value)) = line.trim().split_once(':') else {
                break;
            };
            headers.insert(name.to_ascii_lowercase(), value.trim().to_owned());
        }
        let length = headers.get("content-length");
        let length = length.map_or(0, |text| text.parse().expect("a length"));
        let mut body = vec![0; length];
        reader.read_exact(&mut body)?;
        Ok(Some(Request { method: method.to_owned(), key, query, headers, body }))
    }

    fn answer(&self, request: &Request) -> Answer {
        let is_of_parts =
            request.query.contains_key("uploads") || request.query.contains_key("uploadId");
        match request.method.as_str() {
            "GET" if request.query.contains_key("list-type") => self.list(&request.query),
            _ if is_of_parts => self.in_parts(request),
            "GET" | "HEAD" => self.read(request),
            "PUT" => self.write(request),
            _ => plain("501 Not Implemented"),
        }
    }

    fn list(&self, query: &BTreeMap<String, String>) -> Answer {
        let text = |name: &str| query.get(name).map_or("", String::as_str);
        let (prefix, delimiter) = (text("prefix"), text("delimiter"));
        let after = text("continuation-token");
        let objects = self.objects();
        let (mut found, mut folders, mut last) = (String::new(), Vec::new(), None);
        let from = prefix.max(after).to_owned();
        let mut keys = objects.range(from..).filter(|(key, _)| key.as_str() > after);
        let mut count = 0;
        let mut is_more = false;
        for (key, bytes) in keys.by_ref().take_while(|(key, _)| key.starts_with(prefix)) {
            if count == PAGE {
                is_more = true;
                break;
            }
            last = Some(key.clone());
            match key[prefix.len()..].split_once(delimiter) {
                Some((folder, _)) if !delimiter.is_empty() => {
                    let folder = format!("{prefix}{folder}{delimiter}");
                    if folders.last() != Some(&folder) {
                        folders.push(folder);
                        count += 1;
                    }
                }
                _ => {
                    count += 1;
                    let _ = write!(
                        found,
                        "<Contents><Key>{key}</Key><LastModified>2026-01-01T00:00:00.000Z</LastModified>\
                         <ETag>\"{}\"</ETag><Size>{}</Size></Contents>",
                        tag(bytes),
                        bytes.len()
                    );
                }
            }
        }
        let folders = folders
            .iter()
            .map(|folder| format!("<CommonPrefixes><Prefix>{folder}</Prefix></CommonPrefixes>"));
        let next = last.filter(|_| is_more);
        let next = next.map(|key| format!("<NextContinuationToken>{key}</NextContinuationToken>"));
        let body = format!(
            "<?xml version=\"1.0\"?><ListBucketResult><Name>{BUCKET}</Name><IsTruncated>{is_more}</IsTruncated>{}{found}{}</ListBucketResult>",
            next.unwrap_or_default(),
            folders.collect::<String>()
        );
        Answer {
            status: "200 OK",
            headers: "Content-Type: application/xml\r\n".to_owned(),
            body: body.into_bytes(),
        }
    }

    fn read(&self, request: &Request) -> Answer {
        let objects = self.objects();
        let Some(bytes) = objects.get(&request.key) else {
            return plain("404 Not Found");
        };
        let tag = tag(bytes);
        let wanted = request.headers.get("if-match");
        if wanted.is_some_and(|wanted| wanted.trim_matches('"') != tag) {
            return plain("412 Precondition Failed");
        }
        let common = format!("ETag: \"{tag}\"\r\nLast-Modified: Thu, 01 Jan 2026 00:00:00 GMT\r\n");
        if request.method == "HEAD" {
            return Answer {
                status: "200 OK",
                headers: format!("{common}Content-Length: {}\r\n", bytes.len()),
                body: Vec::new(),
            };
        }
        let range = request.headers.get("range");
        let range = range.and_then(|range| range.strip_prefix("bytes=")?.split_once('-'));
        let Some((first, last)) = range else {
            return Answer { status: "200 OK", headers: common, body: bytes.clone() };
        };
        let first: usize = first.parse().expect("a number");
        let last: usize = last.parse().unwrap_or(usize::MAX).min(bytes.len() - 1);
        Answer {
            status: "206 Partial Content",
            headers: format!("{common}Content-Range: bytes {first}-{last}/{}\r\n", bytes.len()),
            body: bytes[first..=last].to_vec(),
        }
    }

    fn write(&self, request: &Request) -> Answer {
        let mut objects = self.objects();
        let is_conditional = request.headers.contains_key("if-none-match");
        if is_conditional && objects.contains_key(&request.key) {
            return plain("412 Precondition Failed");
        }
        objects.insert(request.key.clone(), request.body.clone());
        tagged(&request.body)
    }

    /// An upload in parts: begun, a part, or complete.
    fn in_parts(&self, request: &Request) -> Answer {
        let mut parts = self.parts.lock().expect("nobody panics with it");
        let number = request.query.get("partNumber");
        if let Some(number) = number.and_then(|text| text.parse().ok()) {
            let own = parts.entry(request.key.clone()).or_default();
            own.insert(number, request.body.clone());
            return tagged(&request.body);
        }
        let body = if request.query.contains_key("uploads") {
            parts.remove(&request.key);
            "<InitiateMultipartUploadResult><UploadId>one</UploadId></InitiateMultipartUploadResult>"
                .to_owned()
        } else {
            let whole = parts.remove(&request.key).unwrap_or_default();
            let whole = whole.into_values().collect::<Vec<_>>().concat();
            let tag = tag(&whole);
            self.objects().insert(request.key.clone(), whole);
            format!(
                "<CompleteMultipartUploadResult><ETag>\"{tag}\"</ETag></CompleteMultipartUploadResult>"
            )
        };
        Answer {
            status: "200 OK",
            headers: "Content-Type: application/xml\r\n".to_owned(),
            body: body.into_bytes(),
        }
    }
}

fn tagged(bytes: &[u8]) -> Answer {
    Answer { headers: format!("ETag: \"{}\"\r\n", tag(bytes)), ..plain("200 OK") }
}

fn plain(status: &'static str) -> Answer {
    Answer { status, headers: String::new(), body: Vec::new() }
}

/// The name of a content: its MD5, as object stores have it of what was put in one piece.
fn tag(bytes: &[u8]) -> String {
    Md5::digest(bytes).iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string");
        text
    })
}

fn decoded(text: &str) -> String {
    percent_decode_str(text).decode_utf8_lossy().into_owned()
}
