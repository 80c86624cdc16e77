//! The size of the values in a channel's messages, from which their unit is guessed.

use std::f64::consts::PI;

use crate::log::Layout;
use crate::message::{FieldReader, Row};

/// One message in this many is looked at, and the first one of each block.
const EVERY: u64 = 64;
/// Larger angles are degrees: no joint turns more than twice in either direction and is reported in radians.
const LARGEST_RAD: f64 = 4.0 * PI;
/// Larger distances are millimetres: no laser tracker reaches further in metres, and none measures nearer in
/// millimetres.
const LARGEST_M: f64 = 80.0;

#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sizes {
    pub messages: u64,
    /// Largest absolute angle, or largest distance from the frame's origin, in the message's own unit.
    pub largest: f64,
}

impl Sizes {
    /// Looks at a message, the `number`th of its block from 0; messages that cannot be read are left out.
    pub(super) fn add(&mut self, number: u64, reader: &FieldReader, payload: &[u8], row: &mut Row) {
        if !number.is_multiple_of(EVERY) || reader.read(payload, row).is_err() {
            return;
        }
        let size = if let Some(angles) = row.value(payload, 0).numbers() {
            let angles = (0..angles.len()).filter_map(|index| angles.get(index));
            angles.map(f64::abs).fold(0.0, f64::max)
        } else {
            let axes = [0, 1, 2].map(|slot| row.number(slot).unwrap_or(0.0));
            axes.iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        if size.is_finite() {
            self.messages += 1;
            self.largest = self.largest.max(size);
        }
    }

    pub(super) fn append(&mut self, later: Self) {
        self.messages += later.messages;
        self.largest = self.largest.max(later.largest);
    }

    /// The unit that values of this size are in; `None` where none was read, or all are zero.
    pub fn unit(&self, layout: Layout) -> Option<&'static str> {
        let is_read = self.messages > 0 && self.largest > 0.0;
        let unit = match layout {
            Layout::Joints if self.largest > LARGEST_RAD => "deg",
            Layout::Joints => "rad",
            Layout::Pose | Layout::Point | Layout::PoseWithCovariance
                if self.largest > LARGEST_M =>
            {
                "mm"
            }
            Layout::Pose | Layout::Point | Layout::PoseWithCovariance => "m",
            Layout::Markers
            | Layout::MarkersWithCovariance
            | Layout::Temperature
            | Layout::Length => return None,
        };
        is_read.then_some(unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_follow_from_sizes() {
        let of = |largest: f64, layout| Sizes { messages: 3, largest }.unit(layout);
        assert_eq!(of(3.1, Layout::Joints), Some("rad"));
        assert_eq!(of(178.0, Layout::Joints), Some("deg"));
        assert_eq!(of(4.5, Layout::Point), Some("m"));
        assert_eq!(of(4500.0, Layout::Pose), Some("mm"));
        assert_eq!(of(0.0, Layout::Pose), None);
        assert_eq!(of(22.0, Layout::Temperature), None);
    }
}
