use super::descriptor::Kind;
use super::reader::{Action, Entry, Messages, Node, ProtobufReader};
use super::wire::{Wire, wire_type};
use crate::message::cell::{Cell, Span};
use crate::message::{Decoded, MessageFault, Row, template};

impl ProtobufReader {
    /// The wanted values of one message go into the row, in their order; after a fault they must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Decoded<()> {
        if !row.fill_as_worded_before(&self.identity, message) {
            row.begin(message, self.slots)?;
            self.message(0, None, &mut Wire::new(message), row)?;
            row.template.keep(&self.identity, message);
        }
        for &(list, index, slot) in &self.picks {
            let picked = row.list(list).element(index);
            row.set(slot, picked);
        }
        Ok(())
    }

    /// Reads a message up to the end of its bytes, or a group of that number up to its own end.
    fn message(
        &self,
        node: usize,
        group: Option<u32>,
        wire: &mut Wire<'_>,
        row: &mut Row,
    ) -> Decoded<()> {
        let node = &self.nodes[node];
        node.begin(row);
        while let Some((number, wire_type)) = wire.tag()? {
            match node.entry(number) {
                _ if wire_type == wire_type::GROUP_END && group == Some(number) => return Ok(()),
                Some(entry) => self.field(entry, wire_type, wire, row)?,
                None => skip(number, wire_type, wire, row)?,
            }
        }
        if group.is_some() { Err(MessageFault::Short) } else { Ok(()) }
    }

    fn field(
        &self,
        entry: &Entry,
        wire_type: u8,
        wire: &mut Wire<'_>,
        row: &mut Row,
    ) -> Decoded<()> {
        match &entry.action {
            Action::Value(target, kind) if kind.wire_type() == wire_type => {
                row.oust(&entry.ousts);
                target.set(kind.take(wire, row)?, row);
                row.taken(target.slot(), wire.at);
                Ok(())
            }
            Action::Values(slot, kind) if kind.wire_type() == wire_type => {
                kind.push(wire, *slot, row)
            }
            // Packed: the values one after another.
            Action::Values(slot, kind) if wire_type == wire_type::LENGTH => inside(wire, |wire| {
                while wire.at < wire.bytes.len() {
                    kind.push(wire, *slot, row)?;
                }
                Ok(())
            }),
            Action::Message(node) if is_message(wire_type) => {
                row.oust(&entry.ousts);
                self.nested(*node, entry.number, wire_type, wire, row)
            }
            Action::Messages(messages) if is_message(wire_type) => {
                let node = messages.begin_element(row)?;
                self.nested(node, entry.number, wire_type, wire, row)
            }
            Action::Skip => {
                row.oust(&entry.ousts);
                skip(entry.number, wire_type, wire, row)
            }
            _ => skip(entry.number, wire_type, wire, row),
        }
    }

    fn nested(
        &self,
        node: usize,
        number: u32,
        wire_type: u8,
        wire: &mut Wire<'_>,
        row: &mut Row,
    ) -> Decoded<()> {
        if wire_type == wire_type::GROUP {
            return self.message(node, Some(number), wire, row);
        }
        inside(wire, |wire| self.message(node, None, wire, row))
    }
}

const fn is_message(wire_type: u8) -> bool {
    matches!(wire_type, wire_type::LENGTH | wire_type::GROUP)
}

fn inside<'m>(wire: &mut Wire<'m>, read: impl FnOnce(&mut Wire<'m>) -> Decoded<()>) -> Decoded<()> {
    let end = wire.length()?;
    let whole = wire.bytes;
    wire.bytes = &whole[..end];
    read(wire)?;
    (wire.bytes, wire.at) = (whole, end);
    Ok(())
}

#[inline]
fn skip(number: u32, wire_type: u8, wire: &mut Wire<'_>, row: &mut Row) -> Decoded<()> {
    let start = wire.at;
    wire.skip(number, wire_type)?;
    note(Stored::Unwanted { number, wire_type }, start, wire, row);
    Ok(())
}

#[inline]
fn note(stored: Stored, start: usize, wire: &Wire<'_>, row: &mut Row) {
    let size = wire.at - start;
    let slot = template::NumberSlot::Protobuf(NumberSlot { stored, size });
    row.template.slot(wire.bytes, start, wire.at, slot);
}

/// A part that differs between messages with the same template. Its size is fixed.
#[derive(Debug, Clone, Copy)]
pub(in crate::message) struct NumberSlot {
    stored: Stored,
    size: usize,
}

#[derive(Debug, Clone, Copy)]
enum Stored {
    Number(Kind),
    Unwanted { number: u32, wire_type: u8 },
}

impl NumberSlot {
    /// Puts the number at this place into the cell, if it is wanted; returns the end of the slot.
    #[inline]
    pub fn take(self, message: &[u8], at: usize, cell: &mut Cell) -> Decoded<usize> {
        let mut wire = Wire { bytes: message, at };
        match self.stored {
            Stored::Number(kind) => kind.put(&mut wire, cell)?,
            Stored::Unwanted { number, wire_type } => wire.skip(number, wire_type)?,
        }
        if wire.at - at == self.size { Ok(wire.at) } else { Err(MessageFault::Wire) }
    }
}

impl Node {
    /// Sets the initial values before any field is read; a message given twice keeps the values read before.
    fn begin(&self, row: &mut Row) {
        for &slot in &self.lists {
            row.list(slot);
        }
        for &(target, default) in &self.defaults {
            if target.is_absent(row) {
                target.set(default, row);
            }
        }
    }

    #[inline]
    fn entry(&self, number: u32) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.number == number)
    }
}

impl Messages {
    /// Adds an element to the lists; returns its node.
    fn begin_element(&self, row: &mut Row) -> Decoded<usize> {
        let index = match row.cell(self.counter) {
            Cell::Integer(index) => index,
            _ => 0,
        };
        row.set(self.counter, Cell::Integer(index + 1));
        for &slot in &self.lists {
            row.list(slot).begin_element()?;
        }
        let mut picked = self.picked.iter();
        let here = picked.find(|(picked, _)| i64::try_from(*picked) == Ok(index));
        Ok(here.map_or(self.each, |(_, node)| *node))
    }
}

impl Kind {
    const fn wire_type(self) -> u8 {
        match self {
            Self::Double | Self::Fixed64 | Self::Sfixed64 => wire_type::FIXED_64,
            Self::Float | Self::Fixed32 | Self::Sfixed32 => wire_type::FIXED_32,
            Self::Text | Self::Message(_) => wire_type::LENGTH,
            _ => wire_type::VARINT,
        }
    }

    #[inline]
    fn push(self, wire: &mut Wire<'_>, slot: usize, row: &mut Row) -> Decoded<()> {
        let value = self.take(wire, row)?;
        row.list(slot).push(value)?;
        row.taken(slot, wire.at);
        Ok(())
    }

    #[inline]
    fn take(self, wire: &mut Wire<'_>, row: &mut Row) -> Decoded<Cell> {
        let (start, mut cell) = (wire.at, Cell::Absent);
        self.put(wire, &mut cell)?;
        if self.wire_type() != wire_type::LENGTH {
            note(Stored::Number(self), start, wire, row);
        }
        Ok(cell)
    }

    #[inline]
    fn put(self, wire: &mut Wire<'_>, cell: &mut Cell) -> Decoded<()> {
        *cell = match self {
            Self::Double => Cell::Number(f64::from_le_bytes(wire.fixed()?)),
            Self::Float => Cell::Number(f32::from_le_bytes(wire.fixed()?).into()),
            Self::Fixed64 => Cell::unsigned(u64::from_le_bytes(wire.fixed()?)),
            Self::Sfixed64 => Cell::Integer(i64::from_le_bytes(wire.fixed()?)),
            Self::Fixed32 => Cell::Integer(u32::from_le_bytes(wire.fixed()?).into()),
            Self::Sfixed32 => Cell::Integer(i32::from_le_bytes(wire.fixed()?).into()),
            Self::Uint64 => Cell::unsigned(wire.varint()?),
            Self::Int64 => Cell::Integer(wire.varint()?.cast_signed()),
            Self::Uint32 => Cell::Integer(lower_half(wire.varint()?).into()),
            Self::Int32 => Cell::Integer(lower_half(wire.varint()?).cast_signed().into()),
            Self::Sint64 => {
                let stored = wire.varint()?;
                Cell::Integer((stored >> 1).cast_signed() ^ -(stored & 1).cast_signed())
            }
            Self::Sint32 => {
                let stored = lower_half(wire.varint()?);
                Cell::Integer(((stored >> 1).cast_signed() ^ -(stored & 1).cast_signed()).into())
            }
            Self::Bool => Cell::Integer(i64::from(wire.varint()? != 0)),
            Self::Text | Self::Message(_) => {
                let end = wire.length()?;
                let start = std::mem::replace(&mut wire.at, end);
                Cell::Text(Span::new(start, end, false))
            }
        };
        Ok(())
    }
}

/// A number of 32 bits is stored in up to 64.
#[expect(clippy::cast_possible_truncation, reason = "the lower half is meant")]
const fn lower_half(stored: u64) -> u32 {
    stored as u32
}
