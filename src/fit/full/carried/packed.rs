//! What was carried over as bytes, to be kept beside a lake: lengths, a text of all but the sums, the lower triangle of the sums, a digest.

use nalgebra::DMatrix;

use super::Carried;
use crate::fit::full::regression::Sums;

/// Bytes of a number.
const NUMBER: usize = 8;
/// Bytes of a digest.
const DIGEST: usize = 32;

impl Carried {
    /// These as bytes, equal to the last bit when they are read back.
    ///
    /// # Errors
    /// Where a number cannot be written as text, which only one that is not finite could cause.
    pub fn packed(&self) -> serde_json::Result<Vec<u8>> {
        let Sums { information, moment, .. } = &self.sums;
        let head = serde_json::to_vec(self)?;
        let size = moment.len();
        let mut bytes = (head.len() as u64).to_le_bytes().to_vec();
        bytes.reserve(head.len() + triangle(size) * NUMBER + DIGEST);
        bytes.extend(head);
        for column in 0..size {
            for row in column..size {
                bytes.extend(information[(row, column)].to_le_bytes());
            }
        }
        let digest = blake3::hash(&bytes);
        bytes.extend(digest.as_bytes());
        Ok(bytes)
    }

    /// What was packed; `None` of bytes that are not, or were changed.
    pub fn unpacked(bytes: &[u8]) -> Option<Self> {
        let (bytes, digest) = bytes.split_at_checked(bytes.len().checked_sub(DIGEST)?)?;
        if blake3::hash(bytes).as_bytes() != digest {
            return None;
        }
        let (length, rest) = bytes.split_first_chunk::<NUMBER>()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (head, numbers) = rest.split_at_checked(length)?;
        let mut carried: Self = serde_json::from_slice(head).ok()?;
        let size = carried.columns.len();
        let lengths = [carried.sums.moment.len(), carried.at.len(), carried.variances.len()];
        if lengths != [size; 3] || numbers.len() != triangle(size) * NUMBER {
            return None;
        }
        let (numbers, _) = numbers.as_chunks::<NUMBER>();
        let mut numbers = numbers.iter().map(|own| f64::from_le_bytes(*own));
        let mut information = DMatrix::zeros(size, size);
        for column in 0..size {
            for row in column..size {
                let number = numbers.next()?;
                information[(row, column)] = number;
                information[(column, row)] = number;
            }
        }
        carried.sums.information = information;
        Some(carried)
    }
}

/// Number of entries on and below the diagonal.
const fn triangle(size: usize) -> usize {
    size * (size + 1) / 2
}
