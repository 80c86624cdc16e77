//! What was carried over as bytes, to be kept beside a lake: lengths, a text of all but the sums, the lower triangle of the sums, a digest.

use serde::{Deserialize, Serialize};

use nalgebra::DVector;

use super::column::Column;
use super::{Carried, Sizes};
use crate::fit::full::regression::Sums;

/// Bytes of a number.
const NUMBER: usize = 8;
/// Bytes of a digest.
const DIGEST: usize = 32;

/// All but the information.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    columns: Vec<Column>,
    moment: DVector<f64>,
    square: f64,
    ln_noise: f64,
    at: DVector<f64>,
    variances: DVector<f64>,
    sizes: Sizes,
    made_with: Sizes,
    slide_periods_mm: Vec<Option<f64>>,
    span: f64,
    day: Option<f64>,
    sessions: usize,
}

impl Carried {
    /// These as bytes, equal to the last bit when they are read back.
    ///
    /// # Errors
    /// Where a number cannot be written as text, which only one that is not finite could cause.
    pub fn packed(&self) -> serde_json::Result<Vec<u8>> {
        let Sums {
            information,
            moment,
            square,
            ln_noise,
        } = &self.sums;
        let head = serde_json::to_vec(&Head {
            columns: self.columns.clone(),
            moment: moment.clone(),
            square: *square,
            ln_noise: *ln_noise,
            at: self.at.clone(),
            variances: self.variances.clone(),
            sizes: self.sizes.clone(),
            made_with: self.made_with.clone(),
            slide_periods_mm: self.slide_periods_mm.clone(),
            span: self.span,
            day: self.day,
            sessions: self.sessions,
        })?;
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
        let head: Head = serde_json::from_slice(head).ok()?;
        let size = head.columns.len();
        let all = [head.moment.len(), head.at.len(), head.variances.len()];
        if all != [size; 3] || numbers.len() != triangle(size) * NUMBER {
            return None;
        }
        let (numbers, _) = numbers.as_chunks::<NUMBER>();
        let mut numbers = numbers.iter().map(|own| f64::from_le_bytes(*own));
        let mut sums = Sums::zero(size);
        for column in 0..size {
            for row in column..size {
                let number = numbers.next()?;
                sums.information[(row, column)] = number;
                sums.information[(column, row)] = number;
            }
        }
        sums.moment = head.moment;
        sums.square = head.square;
        sums.ln_noise = head.ln_noise;
        Some(Self {
            columns: head.columns,
            sums,
            at: head.at,
            variances: head.variances,
            sizes: head.sizes,
            made_with: head.made_with,
            slide_periods_mm: head.slide_periods_mm,
            span: head.span,
            day: head.day,
            sessions: head.sessions,
        })
    }
}

/// Number of entries on and below the diagonal.
const fn triangle(size: usize) -> usize {
    size * (size + 1) / 2
}
