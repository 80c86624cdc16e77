//! A message's bytes → the wanted values.

use super::scan::{MOST_LEVELS, Scan};
use super::{JsonReader, Node, number, unescaped};
use crate::message::cell::{Cell, Span};
use crate::message::row::Target;
use crate::message::{Decoded, MessageFault, Row, template};

/// Some writers put this byte order mark before a text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

impl JsonReader {
    /// The wanted values of one message go into the row, in their order; after a fault they must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Decoded<()> {
        if row.fill_as_worded_before(&self.identity, message) {
            return Ok(());
        }
        row.begin(message, self.wanted)?;
        let at = if message.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
        let mut scan = Scan { bytes: message, at };
        self.value(&self.nodes[0], &mut scan, row, MOST_LEVELS)?;
        scan.finish()?;
        row.template.keep(&self.identity, message);
        Ok(())
    }

    /// Reads the next value, which is wanted or contains wanted values.
    fn value(&self, node: &Node, scan: &mut Scan<'_>, row: &mut Row, levels: usize) -> Decoded<()> {
        let inner = levels.checked_sub(1).ok_or(MessageFault::Deep)?;
        match scan.peek()? {
            b'{' => scan.members(|scan, name| match self.member(node, scan.bytes, name) {
                Some(child) => {
                    // Of values with one name the last counts.
                    row.oust(&child.below);
                    self.value(child, scan, row, inner)
                }
                None => skip(scan, row, inner),
            }),
            b'[' => self.array(node, scan, row, inner),
            _ if node.targets.is_empty() => skip(scan, row, levels),
            _ => {
                let cell = single(scan, row)?;
                for &target in &node.targets {
                    target.set(cell, row);
                    row.taken(target.slot(), scan.at);
                }
                Ok(())
            }
        }
    }

    fn member(&self, node: &Node, bytes: &[u8], name: Span) -> Option<&Node> {
        let raw = name.bytes(bytes);
        let mut names = node.names.iter();
        let found = if name.escaped {
            let name = unescaped(raw)?;
            names.find(|(known, _)| *known == name)
        } else {
            names.find(|(known, _)| known.as_bytes() == raw)
        };
        found.map(|(_, child)| &self.nodes[*child])
    }

    fn array(&self, node: &Node, scan: &mut Scan<'_>, row: &mut Row, levels: usize) -> Decoded<()> {
        // An array inside an element of another array is no single value.
        let whole = || {
            node.targets.iter().filter_map(|target| match target {
                Target::Slot(slot) => Some(*slot),
                Target::Last(_) => None,
            })
        };
        let lists = node.each.iter().flat_map(|(_, lists)| lists);
        for slot in lists.copied().chain(whole()) {
            row.list(slot);
        }
        scan.elements(|scan, index| {
            let is_single = !matches!(scan.peek()?, b'{' | b'[');
            let start = scan.at;
            for slot in whole() {
                depends_on_more_from(start, scan, row);
                row.list(slot).begin_element()?;
                if is_single {
                    let cell = single(scan, row)?;
                    row.list(slot).set_last(cell);
                    row.taken(slot, scan.at);
                }
            }
            if let Some((child, lists)) = &node.each {
                depends_on_more_from(start, scan, row);
                for &slot in lists {
                    row.list(slot).begin_element()?;
                }
                self.value(&self.nodes[*child], scan, row, levels)?;
            }
            if let Some((_, child)) = node.elements.iter().find(|(known, _)| *known == index) {
                depends_on_more_from(start, scan, row);
                self.value(&self.nodes[*child], scan, row, levels)?;
            }
            if scan.at == start {
                skip(scan, row, levels)?;
            }
            Ok(())
        })
    }
}

#[inline]
fn single(scan: &mut Scan<'_>, row: &mut Row) -> Decoded<Cell> {
    let (start, is_number) = (scan.at, scan.is_number());
    let cell = scan.scalar()?;
    if is_number {
        let slot = template::NumberSlot::Json(NumberSlot::Number);
        row.template.slot(scan.bytes, start, scan.at, slot);
    }
    Ok(cell)
}

#[inline]
fn skip(scan: &mut Scan<'_>, row: &mut Row, levels: usize) -> Decoded<()> {
    let start = scan.at;
    scan.skip(levels)?;
    let slot = template::NumberSlot::Json(NumberSlot::Unwanted { levels });
    row.template.slot(scan.bytes, start, scan.at, slot);
    Ok(())
}

/// Goes back to the start of a value that is wanted in more than one way.
const fn depends_on_more_from(start: usize, scan: &mut Scan<'_>, row: &mut Row) {
    if scan.at != start {
        row.template.depends_on_more();
        scan.at = start;
    }
}

/// A part that differs between messages with the same template.
#[derive(Debug, Clone, Copy)]
pub(in crate::message) enum NumberSlot {
    Number,
    /// Any value that is not wanted, with objects and arrays nested up to this many levels.
    Unwanted {
        levels: usize,
    },
}

impl NumberSlot {
    /// Puts the number at this place into the cell, if it is wanted; returns the end of the slot.
    #[inline]
    pub fn take(self, bytes: &[u8], at: usize, cell: &mut Cell) -> Decoded<usize> {
        match self {
            Self::Number => number::take(bytes, at, cell),
            Self::Unwanted { levels } => {
                let mut scan = Scan { bytes, at };
                scan.skip(levels)?;
                Ok(scan.at)
            }
        }
    }
}
