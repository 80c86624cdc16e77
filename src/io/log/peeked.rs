//! Facts known without reading messages: whether a log may still be written to, and the metadata of its session.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use mcap::MAGIC;

use super::record::{FRAME_HEADER, MetadataRecord, frame_header, op};
use super::source::Source;
use super::{FileError, FileFault, Limits};
use crate::progress::Quiet;

const SESSION: &str = "session";

/// A metadata record longer than this is taken not to name the session.
const MOST_METADATA: u64 = 1 << 20;

/// The log lacks the closing magic bytes, and is sound up to its end. One in zstd is decompressed.
pub fn has_no_end(path: &Path, limits: Limits) -> Result<bool, FileError> {
    let name = path.display().to_string();
    let (mut source, packed) = match Source::open(path, &name, limits, &Quiet) {
        // Nothing is written yet, or no whole block of zstd.
        Err(FileError { kind: FileFault::Empty | FileFault::NotUnpacked(_), .. }) => {
            return Ok(true);
        }
        opened => opened?,
    };
    let at_fault = |source: io::Error| FileError::new(&name, source);
    let magic = MAGIC.len() as u64;
    let length = source.length();
    let start = source.peek(0, MAGIC.len()).map_err(at_fault)?;
    if !MAGIC.starts_with(start) {
        return Ok(false);
    }
    let cut = packed.is_some_and(|packed| packed.fault.is_some());
    let end = source.probe(length.saturating_sub(magic), MAGIC.len());
    Ok(cut || length < 2 * magic || end.map_err(at_fault)? != MAGIC)
}

/// The metadata record `session`; empty where there is none. Messages are skipped.
pub fn session_record(path: &Path, limits: Limits) -> Result<BTreeMap<String, String>, FileError> {
    let file = path.display().to_string();
    let at_fault = |source: io::Error| FileError::new(&file, source);
    let (mut source, _) = Source::open(path, &file, limits, &Quiet)?;
    let mut at = MAGIC.len() as u64;
    let mut body = Vec::new();
    while let Some((opcode, length)) = frame_header(source.probe(at, 9).map_err(at_fault)?) {
        at += FRAME_HEADER;
        if opcode == op::METADATA && length <= MOST_METADATA {
            source.read(at, length, &mut body).map_err(at_fault)?;
            if let Some(found) = MetadataRecord::read(&body).filter(|found| found.name == SESSION) {
                let pairs = found.pairs.map(|(key, value)| (key.to_owned(), value.to_owned()));
                return Ok(pairs.collect());
            }
        }
        at = at.saturating_add(length);
        if at >= source.length() {
            break;
        }
    }
    Ok(BTreeMap::new())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A log with its session record after a chunk of messages.
    fn log() -> Vec<u8> {
        let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
        let channel = writer.add_channel(0, "/t", "json", &BTreeMap::new()).unwrap();
        let header = |sequence| mcap::records::MessageHeader {
            channel_id: channel,
            sequence,
            log_time: u64::from(sequence),
            publish_time: 0,
        };
        for sequence in 0..100 {
            writer.write_to_known_channel(&header(sequence), b"{}").unwrap();
        }
        writer.flush().unwrap();
        for (name, value) in [("other", "x"), (SESSION, "mon")] {
            let metadata = BTreeMap::from([("session".to_owned(), value.to_owned())]);
            let name = name.to_owned();
            writer.write_metadata(&mcap::records::Metadata { name, metadata }).unwrap();
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    #[test]
    fn the_session_is_found_behind_messages_and_in_zstd() {
        let folder = tempfile::tempdir().unwrap();
        let (plain, packed) = (folder.path().join("a.mcap"), folder.path().join("b"));
        fs::write(&plain, log()).unwrap();
        fs::write(&packed, zstd::stream::encode_all(&log()[..], 1).unwrap()).unwrap();
        for path in [&plain, &packed] {
            let found = session_record(path, Limits::default()).unwrap();
            assert_eq!(found["session"], "mon");
        }
        // Cut anywhere, the record is found or missing, and no length that it states is trusted.
        for kept in 8..log().len() {
            fs::write(&plain, &log()[..kept]).unwrap();
            let found = session_record(&plain, Limits::default()).unwrap();
            assert!(found.is_empty() || found["session"] == "mon", "{kept}");
        }
    }

    #[test]
    fn a_log_without_its_last_bytes_has_no_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let no_end = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            has_no_end(&path, Limits::default()).unwrap()
        };
        let log = log();
        assert!(!no_end(&log));
        for kept in [0, 3, 8, 15, log.len() / 2, log.len() - 1] {
            assert!(no_end(&log[..kept]), "{kept}");
        }
        assert!(!no_end(b"time,x,y,z\n"), "no log: waiting would not help");
        let packed = zstd::stream::encode_all(&log[..], 1).unwrap();
        assert!(!no_end(&packed));
        assert!(no_end(&packed[..packed.len() / 2]) && no_end(&packed[..6]));
    }
}
