//! Whole files in memory, up to a limit.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::TargetsError;

/// A text of this many bytes has about a million targets, and takes less than a gigabyte to read.
const LARGEST: u64 = 64 << 20;

/// The bytes of a file that is not too large, whatever the file system says of its size.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, TargetsError> {
    let failed = |source| TargetsError::Read {
        path: path.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    let read = file.take(LARGEST + 1).read_to_end(&mut bytes);
    if read.map_err(failed)? as u64 > LARGEST {
        return Err(TargetsError::TooLarge {
            path: path.to_owned(),
            largest: LARGEST >> 20,
        });
    }
    Ok(bytes)
}
