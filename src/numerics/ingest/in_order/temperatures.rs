//! The buffer of temperatures.

use std::ops::Range;

use super::super::rows::{CELSIUS, Place, RowFault, Rows};
use super::super::{DecodedTemperatures, SpanClock};
use super::{Buffer, reordered};

#[derive(Debug, Default)]
pub struct TemperatureBuffer {
    stamps: Vec<i64>,
    celsius: Vec<f64>,
}

impl TemperatureBuffer {
    /// Stamps (ns) of some samples, and their temperatures (°C).
    pub fn rows(&self, rows: Range<usize>) -> (&[i64], &[f64]) {
        (&self.stamps[rows.clone()], &self.celsius[rows])
    }
}

impl Buffer for TemperatureBuffer {
    type Block = DecodedTemperatures;
    const JUMP: f64 = 50.0;

    fn times_of(block: &mut DecodedTemperatures) -> (&mut [i64], &[i64]) {
        (&mut block.stamps, &block.logged)
    }

    fn clock(&self) -> SpanClock {
        SpanClock::Tracker
    }

    fn judge(&self, block: &DecodedTemperatures, place: &Place<'_>) -> Rows {
        Rows::judge(&block.stamps, place, SpanClock::Tracker, |row| {
            (!CELSIUS.contains(&block.celsius[row])).then_some(RowFault::Temperature)
        })
    }

    fn take(&mut self, rows: &Rows, block: &DecodedTemperatures) -> bool {
        rows.append(&block.stamps, &mut self.stamps);
        rows.append(&block.celsius, &mut self.celsius);
        true
    }

    fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    fn content(&self, row: usize) -> &[f64] {
        &self.celsius[row..=row]
    }

    fn reorder(&mut self, order: &[usize]) {
        self.stamps = reordered(&self.stamps, order);
        self.celsius = reordered(&self.celsius, order);
    }

    fn evict(&mut self, count: usize) {
        self.stamps.drain(..count);
        self.celsius.drain(..count);
    }
}
