//! Answers of the storage that came whole: listings up to their last element, and objects by the digest in their tag.
//!
//! A listing that is cut, or a web page in its place, would be read as an empty one; it is asked for again, as if no answer had come.

use std::fmt::Write as _;
use std::fs::File;
use std::future::Future;
use std::io::{self, Read as _, Seek as _};
use std::pin::Pin;

use md5::{Digest as _, Md5};
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpService,
    ReqwestConnector,
};

/// Connects to storage whose listings come whole.
#[derive(Debug)]
pub(super) struct Whole;

impl HttpConnector for Whole {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        Ok(HttpClient::new(Listings(ReqwestConnector::default().connect(options)?)))
    }
}

#[derive(Debug)]
struct Listings(HttpClient);

impl HttpService for Listings {
    fn call<'s, 'f>(
        &'s self,
        request: HttpRequest,
    ) -> Pin<Box<dyn Future<Output = Result<HttpResponse, HttpError>> + Send + 'f>>
    where
        's: 'f,
        Self: 'f,
    {
        let query = request.uri().query().unwrap_or_default();
        let is_listing = query.split('&').any(|part| part == "list-type=2");
        Box::pin(async move {
            let response = self.0.execute(request).await?;
            if !is_listing || !response.status().is_success() {
                return Ok(response);
            }
            let (head, body) = response.into_parts();
            let interrupted = |error| HttpError::new(HttpErrorKind::Interrupted, error);
            let bytes = body.bytes().await.map_err(|error| interrupted(io::Error::other(error)))?;
            if is_whole_listing(&bytes) {
                return Ok(HttpResponse::from_parts(head, bytes.into()));
            }
            Err(interrupted(io::Error::other(
                "the answer is cut, or is no listing of a bucket; is AWS_ENDPOINT_URL the address of the storage?",
            )))
        })
    }
}

fn is_whole_listing(answer: &[u8]) -> bool {
    let end = answer.trim_ascii_end();
    end.ends_with(b"ListBucketResult>") || end.ends_with(b"ListBucketResult/>")
}

/// The digest of an object while its blocks come, in the form that its tag has: MD5 of the whole where it was put in one piece, otherwise
/// MD5 of the MD5s of its parts, which are blocks, and their number.
pub(super) struct Digest {
    md5: Md5,
    parts: Option<usize>,
}

impl Digest {
    pub(super) fn like(tag: Option<&str>) -> Self {
        let counts_parts = tag.is_some_and(|tag| tag.contains('-'));
        Self { md5: Md5::default(), parts: counts_parts.then_some(0) }
    }

    pub(super) fn add(&mut self, block: &[u8]) {
        match &mut self.parts {
            None => self.md5.update(block),
            Some(parts) => {
                self.md5.update(Md5::digest(block));
                *parts += 1;
            }
        }
    }

    pub(super) fn text(self) -> String {
        let mut text = String::new();
        for byte in self.md5.finalize() {
            write!(text, "{byte:02x}").expect("a string");
        }
        if let Some(parts) = self.parts {
            write!(text, "-{parts}").expect("a string");
        }
        text
    }
}

/// Parts that other programs upload in, MiB.
const USUAL_PARTS_MIB: [u64; 12] = [5, 8, 10, 15, 16, 20, 25, 32, 50, 64, 100, 128];

/// Whether `tag` is that of an object of these bytes that was put in parts of a usual size, of which it states the number.
pub(super) fn is_of_parts(file: &mut File, bytes: u64, tag: &str) -> io::Result<bool> {
    let Some(number) = tag.rsplit_once('-').and_then(|(_, number)| number.parse::<u64>().ok())
    else {
        return Ok(false);
    };
    let usual = USUAL_PARTS_MIB.map(|mib| mib << 20).into_iter();
    for part in usual.filter(|part| bytes.div_ceil(*part) == number) {
        if of_parts(file, part)?.text() == tag {
            return Ok(true);
        }
    }
    Ok(false)
}

fn of_parts(file: &mut File, part: u64) -> io::Result<Digest> {
    let mut digest = Digest { md5: Md5::default(), parts: Some(0) };
    let mut block = Vec::new();
    file.rewind()?;
    while file.by_ref().take(part).read_to_end(&mut block)? > 0 {
        digest.add(&block);
        block.clear();
    }
    Ok(digest)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn a_listing_is_whole_up_to_its_last_element() {
        assert!(is_whole_listing(b"<?xml?><ListBucketResult><Name>b</Name></ListBucketResult>\n"));
        assert!(!is_whole_listing(b"<?xml?><ListBucketResult><Contents><Key>a</Ke"));
        assert!(!is_whole_listing(b"<html><body>Sign in</body></html>"));
        assert!(!is_whole_listing(b""));
    }

    #[test]
    fn a_tag_is_known_as_the_digest_of_an_object_or_of_its_parts() {
        let judged = |blocks: &[&[u8]], tag: &str| {
            let mut digest = Digest::like(Some(tag));
            for block in blocks {
                digest.add(block);
            }
            digest.text() == tag.trim_matches('"')
        };
        // MD5 of "ab", and of the MD5s of "a" and "b", as S3 states them.
        assert!(judged(&[b"a", b"b"], "\"187ef4436122d1cc2f40dc2b92f0eba0\""));
        assert!(!judged(&[b"a", b"c"], "\"187ef4436122d1cc2f40dc2b92f0eba0\""));
        assert!(judged(&[b"a", b"b"], "\"96e024ba2074fe77e8e965ba43a704be-2\""));
    }

    #[test]
    fn an_object_in_parts_of_another_program_is_known_by_its_tag() {
        let bytes = vec![7; 11 << 20];
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        let mut parts = Digest::like(Some("a-3"));
        bytes.chunks(5 << 20).for_each(|part| parts.add(part));
        let tag = parts.text();
        let mut known = |tag: &str| is_of_parts(&mut file, 11 << 20, tag).unwrap();
        assert!(tag.ends_with("-3") && known(&tag));
        assert!(!known(&tag.replace("-3", "-2")) && !known("96e024ba2074fe77e8e965ba43a704be"));
        file.rewind().unwrap();
        file.write_all(b"8").unwrap();
        assert!(!is_of_parts(&mut file, 11 << 20, &tag).unwrap());
    }
}
