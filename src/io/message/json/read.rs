//! A message's bytes → the wanted values.

use super::scan::{MOST_LEVELS, Scan};
use super::{JsonPlan, Node, unescaped};
use crate::io::message::row::{Cell, Span};
use crate::io::message::{MessageFault, Row};

/// Some writers put it before a text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

impl JsonPlan {
    /// Takes the wanted values of one message into the row, in the order they were asked for.
    ///
    /// What was taken before a fault was met must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Result<(), MessageFault> {
        row.begin(message, self.wanted)?;
        let mut scan = Scan {
            bytes: message,
            at: if message.starts_with(BYTE_ORDER_MARK) {
                BYTE_ORDER_MARK.len()
            } else {
                0
            },
        };
        self.value(&self.nodes[0], &mut scan, row, MOST_LEVELS)?;
        scan.finish()
    }

    /// Reads the value that comes next, of which something is wanted.
    fn value(
        &self,
        node: &Node,
        scan: &mut Scan<'_>,
        row: &mut Row,
        levels: usize,
    ) -> Result<(), MessageFault> {
        let levels = levels.checked_sub(1).ok_or(MessageFault::Deep)?;
        match scan.peek()? {
            b'{' => scan.members(|scan, name| match self.member(node, scan.bytes, name) {
                Some(child) => {
                    child.forget(row);
                    self.value(child, scan, row, levels)
                }
                None => scan.skip(levels),
            }),
            b'[' => self.array(node, scan, row, levels),
            _ => {
                let cell = scan.scalar()?;
                for &(slot, each) in &node.slots {
                    if each {
                        row.list(slot).set_last(cell);
                    } else {
                        row.set(slot, cell);
                    }
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

    fn array(
        &self,
        node: &Node,
        scan: &mut Scan<'_>,
        row: &mut Row,
        levels: usize,
    ) -> Result<(), MessageFault> {
        // An array inside an element of another one is no single value.
        let whole = node.slots.iter().find(|(_, each)| !each);
        let lists = node.each.iter().flat_map(|(_, lists)| lists);
        for &slot in lists.chain(whole.map(|(slot, _)| slot)) {
            row.list(slot);
        }
        scan.elements(|scan, index| {
            if let Some(&(slot, _)) = whole {
                if !matches!(scan.peek()?, b'{' | b'[') {
                    let cell = scan.scalar()?;
                    return row.list(slot).push(cell);
                }
                row.list(slot).begin_element()?;
            }
            let start = scan.at;
            let mut read = false;
            if let Some((child, lists)) = &node.each {
                for &slot in lists {
                    row.list(slot).begin_element()?;
                }
                self.value(&self.nodes[*child], scan, row, levels)?;
                read = true;
            }
            if let Some((_, child)) = node.elements.iter().find(|(known, _)| *known == index) {
                // Read once more where each element is wanted too.
                scan.at = start;
                self.value(&self.nodes[*child], scan, row, levels)?;
                read = true;
            }
            if read { Ok(()) } else { scan.skip(levels) }
        })
    }
}

impl Node {
    /// Takes out what was read before under the same name: the last counts.
    fn forget(&self, row: &mut Row) {
        for &(slot, each) in &self.below {
            if each {
                row.list(slot).set_last(Cell::Absent);
            } else if row.cell(slot) != Cell::Absent {
                row.forget(slot);
            }
        }
    }
}
