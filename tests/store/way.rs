//! A way to the server on which requests go wrong, and which remembers what was asked for.

use std::io::{self, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

/// What may happen to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It is not served: this status is the answer.
    Refused(&'static str),
    /// It is served, and this status is the answer all the same.
    Denied(&'static str),
    /// It never arrives: the line is cut.
    Lost,
    /// It is served, and the line is cut before the answer.
    Unanswered,
    /// It is served, and the line is cut in the middle of the answer.
    Cut,
    /// It is served, and the answer comes when nobody waits for it any more: after [`LATE`].
    Late,
}

/// How long a request may take (`AWS_TIMEOUT`) on a way with late answers, and how late those are.
pub const PATIENT: &str = "3s";
const LATE: Duration = Duration::from_secs(4);

/// A way for as long as this process.
pub struct Way {
    /// Where it begins.
    pub url: String,
    asked: Arc<Mutex<Vec<String>>>,
}

impl Way {
    /// A way to the server at an address, on which requests go wrong from one number on, counted from 0, so many in a row.
    pub fn to(server: &str, fault: Fault, from: usize, count: usize) -> Self {
        let gone_wrong = from..from + count;
        Self::with(server, move |number| gone_wrong.contains(&number).then_some(fault))
    }

    /// A way to a server that has no time for anybody from the request with this number on, for so long.
    pub fn out(server: &str, from: usize, length: Duration) -> Self {
        let begun = OnceLock::new();
        Self::with(server, move |number| {
            let is_out = number >= from && begun.get_or_init(Instant::now).elapsed() < length;
            is_out.then_some(Fault::Refused("503 Slow Down"))
        })
    }

    fn with(server: &str, fault: impl Fn(usize) -> Option<Fault> + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("http://{}", listener.local_addr().expect("bound"));
        let server = server.trim_start_matches("http://").to_owned();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let remembered = Arc::clone(&asked);
        let fault = Arc::new(fault);
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (server, asked) = (server.clone(), Arc::clone(&remembered));
                let fault = Arc::clone(&fault);
                thread::spawn(move || {
                    // What went wrong on the way is the client's to tell.
                    let _ = passed(stream, &server, &asked, &*fault);
                });
            }
        });
        Self { url, asked }
    }

    /// The first lines of all requests so far.
    pub fn asked(&self) -> Vec<String> {
        self.asked.lock().expect("nobody panics with it").clone()
    }
}

/// Passes one request on and its answer back, or what the fault leaves of that.
fn passed(
    mut client: TcpStream,
    server: &str,
    asked: &Mutex<Vec<String>>,
    fault: impl Fn(usize) -> Option<Fault>,
) -> io::Result<()> {
    let (head, body) = request(&mut client)?;
    let fault = {
        let mut asked = asked.lock().expect("nobody panics with it");
        asked.push(head.lines().next().unwrap_or_default().to_owned());
        fault(asked.len() - 1)
    };
    let refusal =
        |status| format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    match fault {
        Some(Fault::Lost) => return Ok(()),
        Some(Fault::Refused(status)) => return client.write_all(refusal(status).as_bytes()),
        _ => {}
    }
    let answer = served(server, &head, &body)?;
    match fault {
        None => client.write_all(&answer),
        Some(Fault::Denied(status)) => client.write_all(refusal(status).as_bytes()),
        Some(Fault::Cut) => client.write_all(&answer[..answer.len() / 2]),
        Some(Fault::Late) => {
            sleep(LATE);
            client.write_all(&answer)
        }
        Some(_) => Ok(()),
    }
}

/// Head and body of a request.
fn request(client: &mut TcpStream) -> io::Result<(String, Vec<u8>)> {
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        client.read_exact(&mut byte)?;
        head.push(byte[0]);
    }
    let head = String::from_utf8_lossy(&head).into_owned();
    let length = head.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("content-length").then_some(value)
    });
    let length = length.map_or(0, |text| text.trim().parse().expect("a length"));
    let mut body = vec![0; length];
    client.read_exact(&mut body)?;
    Ok((head, body))
}

/// What the server answers, its connection closed afterwards as ours is.
fn served(server: &str, head: &str, body: &[u8]) -> io::Result<Vec<u8>> {
    let closing = |head: &str| head.replacen("\r\n", "\r\nConnection: close\r\n", 1);
    let mut stream = TcpStream::connect(server)?;
    stream.write_all(closing(head).as_bytes())?;
    stream.write_all(body)?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    // The client has to know that this connection ends too.
    let line = answer.windows(2).position(|bytes| bytes == b"\r\n");
    let line = line.map_or(answer.len(), |at| at + 2);
    Ok([&answer[..line], b"Connection: close\r\n", &answer[line..]].concat())
}
