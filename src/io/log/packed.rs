//! Whole logs in zstd (`log.mcap.zst`), decompressed in bounded memory into a file without a name that disappears with
//! the process: a log is read by position. Bytes before damage are kept.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, Write};

use mcap::MAGIC;
use zstd::stream::read::Decoder;

use super::{FileError, FileFault, Limits};
use crate::progress::Progress;

/// Largest window that is decompressed, as a power of two: 128 MiB, the limit of the `zstd` command.
const WINDOW_LOG: u32 = 27;
const PIECE: usize = 256 * 1024;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Packed {
    pub bytes: u64,
    /// The fault that ended decompression early; `None` where the file is sound.
    pub fault: Option<PackedFault>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedFault {
    pub at: u64,
    pub why: String,
    /// Whether a checksum was wrong: then the damage is somewhere in the decompressed bytes.
    pub anywhere: bool,
}

/// Whether a file with these first bytes is in zstd: a frame, or one that decompressors skip.
pub(super) fn is_zstd(start: &[u8]) -> bool {
    matches!(start, [0x28, 0xb5, 0x2f, 0xfd, ..] | [0x50..=0x5f, 0x2a, 0x4d, 0x18, ..])
}

/// Decompresses `file`, which errors call `name`.
pub(super) fn unpack(
    file: File,
    name: &str,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<(File, Packed), FileError> {
    let at_fault = |source: io::Error| FileError::new(name, source);
    let no_room = |source| {
        let folder = std::env::temp_dir().display().to_string();
        FileError::new(name, FileFault::NoRoom { folder, source })
    };
    let bytes = file.metadata().map_err(at_fault)?.len();
    let mut from = Decoder::with_buffer(BufReader::new(file)).map_err(at_fault)?;
    from.window_log_max(WINDOW_LOG).map_err(at_fault)?;
    let mut to = tempfile::tempfile().map_err(no_room)?;
    let mut piece = vec![0; PIECE];
    let (mut length, mut reported) = (0, 0);
    progress.begin(name, bytes);
    let fault = loop {
        let (count, ended) = fill(&mut from, &mut piece);
        check(name, &piece[..count], length, limits)?;
        length += count as u64;
        to.write_all(&piece[..count]).map_err(no_room)?;
        let at = from.get_mut().stream_position().map_err(at_fault)?;
        progress.advance(at - reported);
        reported = at;
        match ended {
            None if count < PIECE => break None,
            None => {}
            // Errors of the disk have a number, those of the format have none.
            Some(error) if error.raw_os_error().is_some() => return Err(at_fault(error)),
            Some(error) => break Some(PackedFault::new(&error, at)),
        }
    };
    progress.end();
    if length == 0 {
        let unpacked = fault.map_or(FileFault::Empty, |fault| FileFault::NotUnpacked(fault.why));
        return Err(FileError::new(name, unpacked));
    }
    Ok((to, Packed { bytes, fault }))
}

/// Fills `piece` as far as the input goes; an error comes after the bytes before it.
fn fill(from: &mut impl Read, piece: &mut [u8]) -> (usize, Option<io::Error>) {
    let mut count = 0;
    while count < piece.len() {
        match from.read(&mut piece[count..]) {
            Ok(0) => break,
            Ok(more) => count += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return (count, Some(error)),
        }
    }
    (count, None)
}

/// Refuses a file that is no log before any of it is written, and a log above the limit.
fn check(name: &str, piece: &[u8], before: u64, limits: Limits) -> Result<(), FileError> {
    if before == 0 && !piece.is_empty() && !piece.starts_with(MAGIC) {
        let start = piece[..piece.len().min(8)].to_vec();
        return Err(FileError::new(format!("{name}, decompressed"), FileFault::NotMcap(start)));
    }
    let limit = limits.unpacked_bytes;
    if before + piece.len() as u64 > limit {
        return Err(FileError::new(name, FileFault::TooLarge(limit)));
    }
    Ok(())
}

impl PackedFault {
    fn new(error: &io::Error, at: u64) -> Self {
        let why = error.to_string();
        let advice = match &*why {
            long if long.contains("too much memory") => {
                " (it needs a window above 128 MiB; decompress it with `zstd -d --long=31`)"
            }
            _ if error.kind() == io::ErrorKind::UnexpectedEof => {
                " (it was cut, or its writer was stopped hard)"
            }
            _ => "",
        };
        Self { at, anywhere: why.contains("checksum"), why: why + advice }
    }
}

#[cfg(test)]
mod tests {
    use std::io::SeekFrom;

    use super::*;
    use crate::progress::Quiet;

    fn unpacked(bytes: &[u8], limits: Limits) -> Result<(Vec<u8>, Packed), FileError> {
        let mut file = tempfile::tempfile().expect("a temporary file");
        file.write_all(bytes).expect("writable");
        file.seek(SeekFrom::Start(0)).expect("a file");
        let (mut file, packed) = unpack(file, "log.mcap.zst", limits, &Quiet)?;
        let mut found = Vec::new();
        file.seek(SeekFrom::Start(0)).expect("a file");
        file.read_to_end(&mut found).expect("readable");
        Ok((found, packed))
    }

    /// Magic and a megabyte that does not compress well: splitmix64.
    fn log() -> Vec<u8> {
        let mut state = 7_u64;
        let noise = std::iter::repeat_with(|| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            ((state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40).to_le_bytes()
        });
        MAGIC.iter().copied().chain(noise.flatten().take(1 << 20)).collect()
    }

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = zstd::stream::write::Encoder::new(Vec::new(), 1).expect("memory");
        encoder.include_checksum(true).expect("memory");
        encoder.write_all(bytes).expect("memory");
        encoder.finish().expect("memory")
    }

    #[test]
    fn a_whole_file_and_several_frames_come_back() {
        let log = log();
        let skipped = [&[0x50, 0x2a, 0x4d, 0x18, 3, 0, 0, 0][..], b"abc"].concat();
        let (head, tail) = log.split_at(300_000);
        for stored in [packed(&log), [skipped, packed(head), packed(tail)].concat()] {
            assert!(is_zstd(&stored));
            let (found, packed) = unpacked(&stored, Limits::default()).expect("sound");
            assert_eq!((found == log, packed.fault), (true, None));
        }
    }

    #[test]
    fn what_stands_before_damage_is_kept() {
        let (log, stored) = (log(), packed(&log()));
        let (found, cut) =
            unpacked(&stored[..stored.len() / 2], Limits::default()).expect("half of it");
        assert!(found.len() > 300_000 && log.starts_with(&found));
        let fault = cut.fault.expect("it was cut");
        assert!(fault.why.contains("cut") && !fault.anywhere, "{fault:?}");
        let mut wrong = stored.clone();
        let last = wrong.len() - 1;
        wrong[last] ^= 1;
        let fault = unpacked(&wrong, Limits::default()).expect("all of it").1.fault;
        assert!(fault.expect("the checksum is wrong").anywhere);
    }

    #[test]
    fn what_is_no_log_or_too_large_is_refused() {
        let refused = unpacked(
            &packed(
                b"time,x,y,z
",
            ),
            Limits::default(),
        )
        .expect_err("text");
        assert!(refused.to_string().contains("log.mcap.zst, decompressed: not an MCAP log"));
        let limits = Limits { unpacked_bytes: 1 << 20, ..Limits::default() };
        // The eight bytes of magic are too many.
        let refused = unpacked(&packed(&log()), limits).expect_err("too large");
        assert!(refused.to_string().contains("unpacked_bytes"), "{refused}");
    }
}
