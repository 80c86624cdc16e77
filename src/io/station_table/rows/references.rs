//! Readings of reference reflectors, in the row of a station or in a row of their own. A blank cell is no missing
//! reading; zeros or a number that stands for a missing one was tried and is listed.

use super::super::columns::Sum;
use super::super::name;
use super::{Fault, Long, Reader};
use crate::ingest::LengthUnit;
use crate::join::references::ReferenceId;
use crate::join::tabled::{ApartRow, RowItem, RowReference, can_be_read};
use crate::measured_table::Cell;

impl Reader<'_> {
    /// The references that a row of a wide table has readings of.
    pub(super) fn references(&mut self, row: usize) -> Vec<RowReference> {
        let (columns, settings) = (self.columns, self.settings);
        let all = columns.references.iter().zip(&settings.references);
        let mut found = Vec::new();
        for (place, (sums, own)) in all.enumerate() {
            if sums.iter().all(|sum| self.is_blank(sum, row)) {
                continue;
            }
            let unit = own.unit.unwrap_or(LengthUnit::Mm);
            let read = self.reference(ReferenceId(place), sums, row, unit);
            found.extend(self.kept(read, row));
        }
        found
    }

    /// The reference that a row of a long table names; `None` where it names something else.
    pub(super) fn named_reference(&self, row: usize, column: usize) -> Option<ReferenceId> {
        let named = name(self.table.cell(row, column))?;
        let mut all = self.settings.references.iter();
        all.position(|own| own.name == named).map(ReferenceId)
    }

    /// Adds the reading of a reference in a row of a long table to its station, or to the rows that are none.
    pub(super) fn add_reference(&mut self, reference: ReferenceId, row: usize, long: &mut Long) {
        let (columns, settings) = (self.columns, self.settings);
        let ([measured, ..], [own, ..]) = (&columns.measured[..], &settings.measured[..]) else {
            return;
        };
        let read = self.reference(reference, &measured.pose.position, row, own.unit);
        let Some(read) = self.kept(read, row) else { return };
        match self.station_of(row, long) {
            Ok(place) => long.rows[place].references.push(read),
            Err(fault) if fault.is_missing => self.add_apart(row, vec![read]),
            Err(fault) => self.reject(RowItem::Row, self.table.line(row), fault),
        }
    }

    pub(super) fn add_apart(&mut self, row: usize, references: Vec<RowReference>) {
        let line = self.table.line(row);
        match self.time_ns(row) {
            Ok(time_ns) => self.apart.push(ApartRow { line, time_ns, references }),
            Err(fault) => self.reject(RowItem::Row, line, fault),
        }
    }

    fn reference(
        &self,
        reference: ReferenceId,
        sums: &[Sum],
        row: usize,
        unit: LengthUnit,
    ) -> Result<RowReference, Fault> {
        let position = self.place(sums, row, unit)?;
        if !can_be_read(&position) {
            return Err(Fault::of(format!(
                "at ({}, {}, {}) mm no instrument reads anything: is the unit right?",
                position.x, position.y, position.z
            )));
        }
        Ok(RowReference { reference, line: self.table.line(row), position })
    }

    fn kept(&mut self, read: Result<RowReference, Fault>, row: usize) -> Option<RowReference> {
        let line = self.table.line(row);
        read.map_err(|fault| self.reject(RowItem::Reference, line, fault)).ok()
    }

    fn is_blank(&self, sum: &Sum, row: usize) -> bool {
        let mut columns = sum.columns();
        columns.all(|column| matches!(self.table.cell(row, column), Cell::Blank))
    }
}
