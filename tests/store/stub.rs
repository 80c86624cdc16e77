//! A server that gives one answer to every request, and counts them.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// A server for as long as this process.
pub struct Stub {
    /// Where it answers.
    pub url: String,
    requests: Arc<AtomicUsize>,
}

impl Stub {
    /// A server that answers like this; where there is no answer it takes requests and says nothing.
    pub fn answering(answer: Option<&'static str>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("http://{}", listener.local_addr().expect("bound"));
        let requests = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&requests);
        thread::spawn(move || {
            let mut silent = Vec::new();
            for stream in listener.incoming().flatten() {
                counted.fetch_add(1, Ordering::Relaxed);
                match answer {
                    Some(answer) => answered(stream, answer),
                    None => silent.push(stream),
                }
            }
        });
        Self { url, requests }
    }

    /// How many requests came.
    pub fn requests(&self) -> usize {
        self.requests.load(Ordering::Relaxed)
    }
}

/// Reads a request without a body, and answers it; what went wrong is the client's to tell.
fn answered(mut stream: TcpStream, answer: &str) {
    let mut request = Vec::new();
    let mut byte = [0];
    while !request.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|count| count == 1) {
        request.push(byte[0]);
    }
    let _ = stream.write_all(answer.as_bytes());
}
