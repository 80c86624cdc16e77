//! Messages with an array of poses: names or numbers and poses of all markers, as arrays of structures or side by side.
//! The reader has gathered each value of the elements into a list ([`crate::message`]).

use super::layout::PoseParts;
use super::reader::{RowFault, Values};
use crate::ingest::{LoggedCovariance, TargetName};
use crate::message::{Numbers, Text, Value};

pub(super) type Element = ([f64; 3], Option<[f64; 4]>, Option<LoggedCovariance>);

pub(super) struct ElementColumns<'m> {
    pub(super) values: Values<'m>,
    pub(super) first: usize,
    pub(super) parts: PoseParts,
}

impl ElementColumns<'_> {
    /// Checks that there are as many poses as names.
    pub(super) fn check_length(&self, names: usize) -> Result<(), RowFault> {
        let list = self.list(self.first)?;
        if list.len() == names { Ok(()) } else { Err(RowFault::UnequalPoses) }
    }

    pub(super) fn element(&self, index: usize) -> Result<Element, RowFault> {
        let position = self.numbers(0, index)?;
        let orientation = self.parts.orientation.then(|| self.numbers(3, index));
        let behind = if self.parts.orientation { 7 } else { 3 };
        let covariance = self.parts.covariance.then(|| self.numbers(behind, index));
        let (orientation, covariance) = (orientation.transpose()?, covariance.transpose()?);
        Ok((position, orientation, covariance.map(LoggedCovariance::Pose)))
    }

    /// Zeros in every column that an element would have.
    pub(super) fn missing(&self) -> Element {
        let PoseParts { orientation, covariance } = self.parts;
        let unknown = LoggedCovariance::Pose([0.0; 36]);
        ([0.0; 3], orientation.then_some([0.0; 4]), covariance.then_some(unknown))
    }

    fn numbers<const N: usize>(&self, after: usize, index: usize) -> Result<[f64; N], RowFault> {
        let mut found = [0.0; N];
        for (place, number) in found.iter_mut().enumerate() {
            let slot = self.first + after + place;
            *number = self.list(slot)?.get(index).ok_or(RowFault::NoNumber(slot))?;
        }
        Ok(found)
    }

    fn list(&self, slot: usize) -> Result<Numbers<'_>, RowFault> {
        self.values.get(slot).numbers().ok_or(RowFault::NoArray(slot))
    }
}

pub(super) enum Names<'m> {
    Numbers(Numbers<'m>),
    Texts(Vec<Option<Text<'m>>>),
}

impl<'m> Names<'m> {
    /// The names in a value; `None` where it is no array.
    pub(super) fn of(value: Value<'m>) -> Option<Self> {
        // A list that was gathered may hold either.
        if let Some(numbers) = value.numbers()
            && (0..numbers.len()).all(|index| numbers.get(index).is_some())
        {
            return Some(Self::Numbers(numbers));
        }
        let texts = value.texts()?;
        Some(Self::Texts(texts.iter().collect()))
    }

    pub(super) const fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Texts(texts) => texts.len(),
        }
    }

    pub(super) fn is(&self, index: usize, wanted: &TargetName) -> bool {
        match (self, wanted) {
            (Self::Numbers(numbers), TargetName::Number(wanted)) => {
                numbers.get(index).is_some_and(|own| is_number(own, *wanted))
            }
            (Self::Texts(texts), wanted) => {
                let own = texts.get(index).copied().flatten();
                own.is_some_and(|own| is_text(own, wanted))
            }
            (Self::Numbers(_), TargetName::Text(_)) => false,
        }
    }
}

pub(super) fn is_named(value: Value<'_>, wanted: &TargetName) -> bool {
    match (value, wanted) {
        (Value::Integer(own), TargetName::Number(wanted)) => own == *wanted,
        (Value::Number(own), TargetName::Number(wanted)) => is_number(own, *wanted),
        (Value::Text(own), wanted) => is_text(own, wanted),
        _ => false,
    }
}

fn is_number(own: f64, wanted: i64) -> bool {
    (own - wanted as f64).abs() < 0.5
}

/// A number may be written as text.
fn is_text(own: Text<'_>, wanted: &TargetName) -> bool {
    match wanted {
        TargetName::Text(wanted) => own.is(wanted),
        TargetName::Number(wanted) => own.is(&wanted.to_string()),
    }
}
