//! The number of messages in a chunk, from the message indexes after it.

use std::collections::BTreeMap;
use std::io;

use crate::log::record::{FRAME_HEADER, frame_header, indexed_messages, op};
use crate::log::source::Source;

/// Counts by channel, for a chunk that cannot be read; `None` where there are no indexes.
pub fn indexed_behind(source: &mut Source, mut at: u64) -> io::Result<Option<BTreeMap<u16, u64>>> {
    let mut found = BTreeMap::new();
    loop {
        let header = source.probe(at, 15)?;
        let Some((op::MESSAGE_INDEX, length)) = frame_header(header) else { break };
        let Some((channel, messages)) = header.get(9..).and_then(|b| indexed_messages(b, length))
        else {
            break;
        };
        let end = at.saturating_add(FRAME_HEADER).saturating_add(length);
        if end > source.length() {
            break;
        }
        *found.entry(channel).or_default() += messages;
        at = end;
    }
    Ok((!found.is_empty()).then_some(found))
}
