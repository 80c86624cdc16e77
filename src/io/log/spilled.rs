//! Poses that are spilled to disk while the log is read, except the last rows. A row is the stamp, the position and,
//! where there are any, orientation and covariance: numbers of eight bytes, the least significant first.

use std::fmt::Debug;
use std::fs::File;
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::marker::PhantomData;
use std::ops::Range;

use super::LogError;
use crate::geometry::{PoseCovariance, TurnCovariance};
use crate::ingest::{PoseSamples, Poses, PosesError};
use crate::system;
use crate::units::Stamp;

const IN_MEMORY: usize = 4 << 20;
/// Numbers of a covariance: six of the position, six of the orientation, nine of both together.
const COVARIANCE: usize = 21;
const NUMBER: usize = 8;

#[derive(Debug)]
pub struct SpilledPoses<C> {
    clock: PhantomData<C>,
    form: Form,
    file: Option<File>,
    in_file: usize,
    latest: Vec<u8>,
    /// Size of `latest`, bytes, at which it is written to the file.
    most: usize,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Form {
    orientations: bool,
    covariances: bool,
}

impl Form {
    const fn row_bytes(self) -> usize {
        let numbers = 4 + 4 * self.orientations as usize + COVARIANCE * self.covariances as usize;
        numbers * NUMBER
    }
}

impl<C: Copy> Default for SpilledPoses<C> {
    fn default() -> Self {
        Self::keeping(IN_MEMORY)
    }
}

impl<C: Copy> SpilledPoses<C> {
    /// No poses yet; `most` bytes of rows are kept in memory.
    fn keeping(most: usize) -> Self {
        Self {
            clock: PhantomData,
            form: Form::default(),
            file: None,
            in_file: 0,
            latest: Vec::new(),
            most,
        }
    }

    /// Adds further poses; all have the same columns.
    fn append(&mut self, poses: &PoseSamples<C>) -> io::Result<()> {
        let form = Form {
            orientations: poses.orientations.is_some(),
            covariances: poses.covariances.is_some(),
        };
        if self.rows() == 0 {
            self.form = form;
        }
        debug_assert_eq!(form, self.form, "of one kind");
        for (row, stamp) in poses.stamps.iter().enumerate() {
            self.latest.extend_from_slice(&stamp.ns().to_le_bytes());
            let orientation = poses.orientations.iter().flat_map(|all| all[row]);
            let covariance = poses.covariances.iter().flat_map(|all| numbers(&all[row]));
            let position = poses.positions[row].into_iter();
            for number in position.chain(orientation).chain(covariance) {
                self.latest.extend_from_slice(&number.to_le_bytes());
            }
        }
        if self.latest.len() >= self.most { self.spill() } else { Ok(()) }
    }

    fn spill(&mut self) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile()?),
        };
        file.seek(SeekFrom::End(0))?;
        file.write_all(&self.latest)?;
        self.in_file += self.latest.len() / self.form.row_bytes();
        self.latest.clear();
        Ok(())
    }

    fn rows(&self) -> usize {
        self.in_file + self.latest.len() / self.form.row_bytes()
    }

    fn bytes(&self, rows: &Range<usize>) -> io::Result<Vec<u8>> {
        let row_bytes = self.form.row_bytes();
        let from_file = rows.start.min(self.in_file)..rows.end.min(self.in_file);
        let mut bytes = vec![0; from_file.len() * row_bytes];
        if let Some(file) = &self.file {
            system::read_exact_at(file, &mut bytes, (from_file.start * row_bytes) as u64)?;
        }
        let place = |row: usize| row.saturating_sub(self.in_file) * row_bytes;
        let latest = self.latest.get(place(rows.start)..place(rows.end));
        bytes.extend_from_slice(latest.ok_or_else(|| io::Error::other("there is no such row"))?);
        Ok(bytes)
    }
}

impl<C: Copy + Debug + Send + Sync> Poses<C> for SpilledPoses<C> {
    fn count(&self) -> usize {
        self.rows()
    }

    fn read(&self, rows: Range<usize>) -> Result<PoseSamples<C>, PosesError> {
        let bytes = self.bytes(&rows)?;
        let (numbers, _) = bytes.as_chunks::<NUMBER>();
        let mut found = PoseSamples::default();
        for row in numbers.chunks_exact(self.form.row_bytes() / NUMBER) {
            let number = |place: usize| f64::from_le_bytes(row[place]);
            found.stamps.push(Stamp::from_ns(i64::from_le_bytes(row[0])));
            found.positions.push([1, 2, 3].map(number));
            if self.form.orientations {
                let orientations = found.orientations.get_or_insert_default();
                orientations.push([4, 5, 6, 7].map(number));
            }
            if self.form.covariances {
                let first = if self.form.orientations { 8 } else { 4 };
                let covariances = found.covariances.get_or_insert_default();
                let own = std::array::from_fn(|term| number(first + term));
                covariances.push(covariance(&own));
            }
        }
        Ok(found)
    }

    fn stamp(&self, row: usize) -> Result<Stamp<C>, PosesError> {
        Ok(self.read(row..row + 1)?.stamps[0])
    }
}

/// The numbers of a covariance as a row has them: of a part that is not known no numbers.
fn numbers(own: &PoseCovariance) -> [f64; COVARIANCE] {
    let mut numbers = [f64::NAN; COVARIANCE];
    if let Some(position) = own.position {
        numbers[..6].copy_from_slice(&position);
    }
    if let Some(turn) = own.turn {
        numbers[6..12].copy_from_slice(&turn.own);
        numbers[12..].copy_from_slice(&turn.with_position);
    }
    numbers
}

fn covariance(numbers: &[f64; COVARIANCE]) -> PoseCovariance {
    fn part<const N: usize>(of: &[f64]) -> Option<[f64; N]> {
        of.try_into().ok().filter(|own: &[f64; N]| !own[0].is_nan())
    }
    let turn = |own| Some(TurnCovariance { own, with_position: part(&numbers[12..])? });
    PoseCovariance { position: part(&numbers[..6]), turn: part(&numbers[6..12]).and_then(turn) }
}

/// Poses that are being spilled; a disk without room is reported at the end.
#[derive(Debug)]
pub struct SpillingPoses<C> {
    poses: SpilledPoses<C>,
    room: io::Result<()>,
}

impl<C: Copy> Default for SpillingPoses<C> {
    fn default() -> Self {
        Self { poses: SpilledPoses::default(), room: Ok(()) }
    }
}

impl<C: Copy> SpillingPoses<C> {
    /// Adds further poses; all have the same columns.
    pub fn append(&mut self, poses: &PoseSamples<C>) {
        if self.room.is_ok() {
            self.room = self.poses.append(poses);
        }
    }

    pub fn finish(self) -> Result<SpilledPoses<C>, LogError> {
        self.room.map_err(|source| LogError::NoRoom {
            folder: std::env::temp_dir().display().to_string(),
            source,
        })?;
        Ok(self.poses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::TargetReadings;

    /// Readings in which every number is different.
    fn readings(rows: Range<i32>, orientations: bool, covariances: bool) -> TargetReadings {
        fn column<const N: usize>(rows: &Range<i32>, first: usize) -> Vec<[f64; N]> {
            let number = |row: i32, place: usize| f64::from(row).mul_add(40.0, place as f64) / 7.0;
            let row = |row| std::array::from_fn(|place| number(row, first + place));
            rows.clone().map(row).collect()
        }
        TargetReadings {
            stamps: rows.clone().map(|row| Stamp::from_ns(i64::from(row) - 3)).collect(),
            positions: column(&rows, 1),
            orientations: orientations.then(|| column(&rows, 4)),
            covariances: covariances.then(|| {
                let all = column::<COVARIANCE>(&rows, 8);
                let own = rows.clone().zip(&all).map(|(row, all)| {
                    let own = super::covariance(all);
                    // Some without a part.
                    PoseCovariance {
                        position: own.position.filter(|_| row % 3 > 0),
                        turn: own.turn.filter(|_| row % 5 > 0),
                    }
                });
                own.collect()
            }),
        }
    }

    #[test]
    fn what_was_spilled_comes_back_from_memory_from_the_file_and_from_both() {
        for (orientations, covariances) in
            [(false, false), (true, false), (false, true), (true, true)]
        {
            let of = |rows| readings(rows, orientations, covariances);
            // In memory; three times to the file, some left; all in the file.
            for most in [IN_MEMORY, 700, 1] {
                let mut spilled = SpilledPoses::keeping(most);
                for first in (0..60).step_by(5) {
                    spilled.append(&of(first..first + 5)).expect("room");
                }
                assert_eq!(spilled.count(), 60);
                for (first, end) in [(0, 60), (0, 1), (59, 60), (20, 20), (7, 51), (40, 60)] {
                    let rows = usize::try_from(first).unwrap()..usize::try_from(end).unwrap();
                    let mut expected = of(first..end);
                    if rows.is_empty() {
                        (expected.orientations, expected.covariances) = (None, None);
                    }
                    assert_eq!(spilled.read(rows.clone()).expect("there"), expected);
                    assert!(of(0..60).read(rows).is_ok());
                }
                assert!(spilled.read(59..61).is_err());
                assert_eq!(spilled.stamp(59).expect("there").ns(), 56);
            }
        }
    }
}
