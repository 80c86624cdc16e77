//! A prefix of a bucket on S3-compatible storage as a store. A file is written to a local temporary and then uploaded,
//! from [`PART_BYTES`] on in parts. A key is created by a conditional put (`If-None-Match: *`), which storage grants to
//! exactly one; the object names the attempt, to know whether a put whose answer was lost was granted. An object is
//! fetched in blocks, each under the tag of the first. One worker of a runtime that all buckets share does the
//! asynchronous work; failed requests are retried (`patience`).

mod environment;
mod patience;
mod trouble;
mod whole;

use std::borrow::Cow;
use std::fmt;
use std::fs::File;
use std::future::Future;
use std::io::{self, Read as _, Seek as _, Write as _};
use std::ops::RangeInclusive;
use std::sync::OnceLock;
use std::time::SystemTime;

use futures_util::{StreamExt as _, TryStreamExt as _, future, stream};
use object_store::path::Path as Key;
use object_store::{
    Attribute, Error, GetOptions, GetRange, MultipartUpload, ObjectMeta, ObjectStore as _,
    ObjectStoreExt as _, PutMode, PutOptions, PutPayload, PutResult,
};
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};

use super::{Listed, Place, Store, StoreError, Tag, by_parts};
use crate::temporary::{self, Temporary};
use patience::{Clients, RETRIES, noted};
use trouble::Secrets;
use whole::Digest;

/// Part of an upload, block of a download: S3 requires at least 5 MiB, and each has to be sent within a request's time
/// limit (30 s unless `AWS_TIMEOUT` sets another).
const PART_BYTES: u64 = 8 << 20;
const MOST_PARTS: u64 = 10_000;
const PARTS_AT_ONCE: usize = 4;
const FILES_AT_ONCE: usize = 16;
/// The metadata of a created object that names the attempt that created it.
const ATTEMPT: Attribute = Attribute::Metadata(Cow::Borrowed("posegrid-attempt"));
const SCRATCH: &str = "posegrid-upload";

pub struct Bucket {
    place: Place,
    prefix: String,
    clients: Clients,
    secrets: Secrets,
    runtime: &'static Runtime,
    scratch: OnceLock<TempDir>,
}

impl fmt::Debug for Bucket {
    /// Not derived: the client holds credentials.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Bucket").field(&self.place).finish()
    }
}

impl Bucket {
    /// The prefix at an address, with credentials from the environment. No request is sent yet.
    pub(super) fn from_environment(place: &Place) -> Result<Self, StoreError> {
        let (clients, secrets) = environment::clients(place)?;
        let (_, prefix) = place.bucket().expect("an address, as a client was made");
        let system =
            StoreError::folder("start a runtime for", std::path::Path::new("AWS requests"));
        Ok(Self {
            place: place.clone(),
            prefix: prefix.to_owned(),
            clients,
            secrets,
            runtime: runtime().map_err(system)?,
            scratch: OnceLock::new(),
        })
    }

    fn object(&self, key: &str) -> Result<Key, StoreError> {
        let parts = [self.prefix.as_str(), key];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        Key::parse(parts.join("/")).map_err(|_| StoreError::Address {
            place: self.place(key),
            problem: "its parts may neither be empty nor `.` or `..`, nor hold control characters",
        })
    }

    fn objects(&self, folder: &str) -> Result<Vec<ObjectMeta>, StoreError> {
        let prefix = self.object(folder)?;
        self.wait("list", folder, self.clients.now().list(Some(&prefix)).try_collect())
    }

    fn wait<T>(
        &self,
        doing: &'static str,
        key: &str,
        answer: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, StoreError> {
        noted(self.runtime.block_on(answer)).map_err(|error| self.failure(doing, key, &error))
    }

    fn failure(&self, doing: &'static str, key: &str, error: &Error) -> StoreError {
        trouble::failure(doing, self.place(key), error, &self.secrets)
    }

    /// Metadata of an object; `None` where there is none.
    fn head(&self, key: &str) -> Result<Option<Listed>, StoreError> {
        let object = self.object(key)?;
        match noted(self.runtime.block_on(self.clients.now().head(&object))) {
            Ok(found) => Ok(Some(Listed {
                key: key.to_owned(),
                tag: found.e_tag,
                bytes: found.size,
                modified: Some(found.last_modified.into()),
            })),
            Err(Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(self.failure("look for", key, &error)),
        }
    }

    fn key_of<'f>(&self, found: &'f ObjectMeta) -> Option<&'f str> {
        let whole = found.location.as_ref();
        match self.prefix.as_str() {
            "" => Some(whole),
            prefix => whole.strip_prefix(prefix)?.strip_prefix('/'),
        }
    }

    /// An object as a listed file of this store; `None` if it is at another depth, or hidden.
    fn listed(
        &self,
        found: ObjectMeta,
        below: &str,
        levels: &RangeInclusive<usize>,
    ) -> Option<Listed> {
        let key = self.key_of(&found)?.to_owned();
        let rest = match below {
            "" => key.as_str(),
            below => key.strip_prefix(below)?.strip_prefix('/')?,
        };
        let name = rest.rsplit('/').next().unwrap_or(rest);
        let is_wanted = levels.contains(&rest.matches('/').count()) && !name.starts_with('.');
        let (bytes, modified) = (found.size, Some(found.last_modified.into()));
        is_wanted.then_some(Listed { tag: found.e_tag, bytes, modified, key })
    }

    async fn fetch(&self, listed: &Listed) -> Result<File, StoreError> {
        let mut file = tempfile::tempfile().map_err(no_temporary)?;
        self.fetch_into(listed, &mut file).await?;
        file.rewind().map_err(no_temporary)?;
        Ok(file)
    }

    /// Fetches an object as it was listed. What its tag does not show to be as it was put is fetched until it comes alike twice.
    async fn fetch_into(&self, listed: &Listed, file: &mut File) -> Result<(), StoreError> {
        let mut before = None;
        for _ in 0..=RETRIES {
            file.set_len(0).and_then(|()| file.rewind()).map_err(no_temporary)?;
            let digest = Some(self.fetch_once(listed, file).await?.text());
            let tag = listed.tag.as_deref().map(|tag| tag.trim_matches('"'));
            if digest.as_deref() == tag || digest == before {
                return Ok(());
            }
            if let Some(tag) = tag
                && whole::is_of_parts(file, listed.bytes, tag).map_err(no_temporary)?
            {
                return Ok(());
            }
            before = digest;
        }
        Err(trouble::changed("read", self.place(&listed.key)))
    }

    /// Fetches an object once, a few blocks at once.
    async fn fetch_once(&self, listed: &Listed, file: &mut File) -> Result<Digest, StoreError> {
        let object = self.object(&listed.key)?;
        let starts = (0..listed.bytes).step_by(usize_of(PART_BYTES));
        let block = |start: u64| {
            let range = Some(GetRange::Bounded(start..(start + PART_BYTES).min(listed.bytes)));
            let options =
                GetOptions { if_match: listed.tag.clone(), range, ..GetOptions::default() };
            async { self.clients.now().get_opts(&object, options).await?.bytes().await }
        };
        let mut blocks = stream::iter(starts.map(block)).buffered(PARTS_AT_ONCE);
        let (mut fetched, mut digest) = (0, Digest::like(listed.tag.as_deref()));
        while let Some(block) = blocks.next().await {
            let block = noted(block).map_err(|error| self.failure("read", &listed.key, &error))?;
            file.write_all(&block).map_err(no_temporary)?;
            digest.add(&block);
            fetched += block.len() as u64;
        }
        // This storage has no tags, or ignores them.
        if fetched != listed.bytes {
            return Err(trouble::changed("read", self.place(&listed.key)));
        }
        Ok(digest)
    }

    fn scratch(&self) -> io::Result<&TempDir> {
        if let Some(scratch) = self.scratch.get() {
            return Ok(scratch);
        }
        temporary::clean_folders(SCRATCH);
        let made = temporary::folder(SCRATCH)?;
        Ok(self.scratch.get_or_init(|| made))
    }

    /// Marked with this attempt. Where the answer is lost the request is sent again; the client takes it for one that
    /// must not be repeated.
    fn put_if_none(&self, object: &Key, payload: &PutPayload, attempt: &str) -> Result<(), Error> {
        let options = || PutOptions {
            mode: PutMode::Create,
            attributes: [(ATTEMPT, attempt.to_owned())].into_iter().collect(),
            ..PutOptions::default()
        };
        let put = || self.clients.now().put_opts(object, payload.clone(), options());
        let mut left = RETRIES;
        loop {
            match noted(self.runtime.block_on(put())) {
                Err(error) if left > 0 && trouble::is_answer_lost(&error) => left -= 1,
                done => return done.map(drop),
            }
        }
    }

    /// The attempt that created an object; `None` where the object does not name it.
    fn attempt_of(&self, object: &Key) -> Result<Option<String>, Error> {
        let options = GetOptions { head: true, ..GetOptions::default() };
        let found = self.runtime.block_on(self.clients.now().get_opts(object, options))?;
        let by = found.attributes.get(&ATTEMPT);
        Ok(by.map(|by| by.to_string()))
    }

    /// Uploads in parts, a few at once.
    async fn upload(&self, object: &Key, mut file: File, bytes: u64) -> Result<PutResult, Error> {
        let mut upload = self.clients.now().put_multipart(object).await?;
        let parts = parts(&mut upload, &mut file, bytes).await;
        let done = match parts {
            Ok(()) => upload.complete().await,
            Err(error) => Err(error),
        };
        if done.is_err() {
            // Parts that are left are not visible; storage can be set up to remove them after a time.
            let _ = upload.abort().await;
        }
        done
    }
}

impl Store for Bucket {
    fn place(&self, key: &str) -> Place {
        self.place.join(key)
    }

    fn check(&self) -> Result<(), StoreError> {
        let prefix = self.object("")?;
        let listed = self.clients.now().list_with_delimiter(Some(&prefix));
        self.wait("list", "", listed).map(drop)
    }

    fn exists(&self, key: &str) -> Result<bool, StoreError> {
        Ok(self.head(key)?.is_some())
    }

    fn open(&self, key: &str) -> Result<File, StoreError> {
        let missing = || trouble::missing("read", self.place(key));
        let found = self.head(key)?.ok_or_else(missing)?;
        self.open_listed(&found)
    }

    fn open_listed(&self, listed: &Listed) -> Result<File, StoreError> {
        self.runtime.block_on(self.fetch(listed))
    }

    fn copy_to(&self, listed: &Listed, mut to: File) -> Result<(), StoreError> {
        self.runtime.block_on(self.fetch_into(listed, &mut to))
    }

    fn open_all(&self, listed: &[Listed]) -> Vec<Result<File, StoreError>> {
        let files = stream::iter(listed.iter().map(|listed| self.fetch(listed)));
        let files = files.buffered(FILES_AT_ONCE).collect();
        self.runtime.block_on(files)
    }

    fn list(&self, folder: &str, levels: RangeInclusive<usize>) -> Result<Vec<Listed>, StoreError> {
        let found = self.objects(folder)?;
        let listed = found.into_iter().filter_map(|found| self.listed(found, folder, &levels));
        let mut listed: Vec<Listed> = listed.collect();
        listed.sort_by(|a, b| by_parts(&a.key, &b.key));
        Ok(listed)
    }

    fn all(&self, folder: &str) -> Result<Vec<String>, StoreError> {
        let found = self.objects(folder)?;
        let keys = found.iter().filter_map(|found| self.key_of(found));
        let mut keys: Vec<String> = keys.map(str::to_owned).collect();
        keys.sort_by(|a, b| by_parts(a, b));
        Ok(keys)
    }

    fn temporary(&self, _key: &str) -> Result<Temporary, StoreError> {
        let made =
            self.scratch().and_then(|scratch| Temporary::beside(&scratch.path().join("upload")));
        made.map_err(no_temporary)
    }

    fn put(&self, key: &str, written: Temporary) -> Result<Tag, StoreError> {
        let object = self.object(key)?;
        let (file, bytes) = opened(&written)?;
        if bytes <= PART_BYTES {
            let payload = payload(&written)?;
            let put = self.wait("write", key, self.clients.now().put(&object, payload))?;
            return Ok(put.e_tag);
        }
        match noted(self.runtime.block_on(self.upload(&object, file, bytes))) {
            Ok(put) => Ok(put.e_tag),
            // The upload does not exist where it is complete and the answer was lost. The digest has to show whether the
            // object is the one that was written.
            Err(Error::NotFound { .. }) if self.exists(key)? => Ok(None),
            Err(error) => Err(self.failure("write", key, &error)),
        }
    }

    fn create(&self, key: &str, written: Temporary) -> Result<bool, StoreError> {
        let object = self.object(key)?;
        let payload = payload(&written)?;
        let attempt = attempt(&written);
        match self.put_if_none(&object, &payload, &attempt) {
            Ok(()) => Ok(true),
            Err(error @ Error::AlreadyExists { .. }) => match self.attempt_of(&object) {
                // It may be ours, put before an answer was lost.
                Ok(by) => Ok(by.as_ref() == Some(&attempt)),
                // Storage also gives this answer for a conflict with another attempt that did not succeed.
                Err(Error::NotFound { .. }) => Err(self.failure("create", key, &error)),
                Err(error) => Err(self.failure("look for", key, &error)),
            },
            Err(error) => Err(self.failure("create", key, &error)),
        }
    }

    fn tag(&self, key: &str) -> Result<Tag, StoreError> {
        Ok(self.head(key)?.and_then(|found| found.tag))
    }

    fn remove(&self, key: &str) -> Result<(), StoreError> {
        let object = self.object(key)?;
        match self.runtime.block_on(self.clients.now().delete(&object)) {
            Ok(()) | Err(Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(self.failure("remove", key, &error)),
        }
    }
}

async fn parts(
    upload: &mut Box<dyn MultipartUpload>,
    file: &mut File,
    bytes: u64,
) -> Result<(), Error> {
    let part_bytes = PART_BYTES.max(bytes.div_ceil(MOST_PARTS));
    let mut left = bytes;
    while left > 0 {
        let mut under_way = Vec::new();
        while left > 0 && under_way.len() < PARTS_AT_ONCE {
            let count = part_bytes.min(left);
            let mut part = vec![0; usize_of(count)];
            file.read_exact(&mut part)
                .map_err(|error| Error::Generic { store: "temporary", source: Box::new(error) })?;
            under_way.push(upload.put_part(PutPayload::from(part)));
            left -= count;
        }
        future::try_join_all(under_way).await?;
    }
    Ok(())
}

fn opened(written: &Temporary) -> Result<(File, u64), StoreError> {
    let opened = || {
        let file = File::open(written.path())?;
        let bytes = file.metadata()?.len();
        Ok((file, bytes))
    };
    opened().map_err(StoreError::folder("read the temporary", written.path()))
}

/// A unique name for an attempt to create an object: from the temporary, this process and the time.
fn attempt(written: &Temporary) -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let words = (written.path(), std::process::id(), now.unwrap_or_default());
    blake3::hash(format!("{words:?}").as_bytes()).to_hex().to_string()
}

fn payload(written: &Temporary) -> Result<PutPayload, StoreError> {
    let bytes = std::fs::read(written.path());
    let bytes = bytes.map_err(StoreError::folder("read the temporary", written.path()))?;
    Ok(PutPayload::from(bytes))
}

fn no_temporary(source: io::Error) -> StoreError {
    StoreError::folder("write a temporary in", &std::env::temp_dir())(source)
}

fn usize_of(bytes: u64) -> usize {
    usize::try_from(bytes).expect("parts fit into memory")
}

fn runtime() -> io::Result<&'static Runtime> {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    if let Some(runtime) = RUNTIME.get() {
        return Ok(runtime);
    }
    let made = Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("object-storage")
        .enable_all()
        .build()?;
    Ok(RUNTIME.get_or_init(|| made))
}
