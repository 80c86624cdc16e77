//! The channels and schemas that a log has defined so far. Ids are valid within one log; limits are those of the file.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::record::{ChannelRecord, SchemaRecord};

pub const MOST_DEFINITIONS: usize = 16 * 1024 * 1024;
/// Most channels of one file: as many as a log has ids for.
const MOST_CHANNELS: usize = 1 << 16;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Schema {
    pub name: String,
    pub encoding: String,
    pub definition: Vec<u8>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Id of the channel, valid in this log only.
    pub id: u16,
    /// Id of the schema; 0: none.
    pub schema_id: u16,
    pub topic: String,
    pub encoding: String,
}

/// Channels with their decoders `D`, and schemas.
#[derive(Debug)]
pub struct Registry<D> {
    schemas: BTreeMap<u16, Arc<Schema>>,
    channels: BTreeMap<u16, (Channel, D)>,
    /// Every schema of the file; one that is repeated, under another id or in another log, is stored once.
    known: BTreeSet<Arc<Schema>>,
    /// Number of channels of the logs before this one.
    before: usize,
    size: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    Redefined,
    TooMuch,
}

impl<D> Default for Registry<D> {
    fn default() -> Self {
        Self {
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            known: BTreeSet::new(),
            before: 0,
            size: 0,
        }
    }
}

impl<D> Registry<D> {
    pub(super) fn has_schema(&self, record: &SchemaRecord<'_>) -> bool {
        self.schemas.get(&record.id).is_some_and(|schema| schema.is(record))
    }

    pub(super) fn has_channel(&self, record: &ChannelRecord<'_>) -> bool {
        self.channels.get(&record.id).is_some_and(|(channel, _)| channel.is(record))
    }

    pub(super) fn decoder(&self, channel_id: u16) -> Option<&D> {
        self.channels.get(&channel_id).map(|(_, decoder)| decoder)
    }

    pub fn channel(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id).map(|(channel, _)| channel)
    }

    /// Ends the log: returns its channels, by id, and forgets its ids, which the next log in the file may define anew.
    pub(super) fn end_log(&mut self) -> impl Iterator<Item = Channel> {
        self.before += self.channels.len();
        self.schemas.clear();
        let channels = std::mem::take(&mut self.channels);
        channels.into_values().map(|(channel, _)| channel)
    }

    pub fn add_schema(&mut self, record: &SchemaRecord<'_>) -> Result<(), Refused> {
        if self.has_schema(record) {
            return Ok(());
        }
        if self.schemas.contains_key(&record.id) {
            return Err(Refused::Redefined);
        }
        let [name, encoding] = [record.name, record.encoding].map(str::to_owned);
        let schema = Schema { name, encoding, definition: record.definition.to_owned() };
        let schema = if let Some(known) = self.known.get(&schema) {
            Arc::clone(known)
        } else {
            self.grow(schema.definition.len() + schema.name.len() + schema.encoding.len())?;
            let schema = Arc::new(schema);
            self.known.insert(Arc::clone(&schema));
            schema
        };
        self.schemas.insert(record.id, schema);
        Ok(())
    }

    pub fn add_channel<E>(
        &mut self,
        record: &ChannelRecord<'_>,
        decoder: impl FnOnce(&Channel, Option<&Arc<Schema>>) -> Result<D, E>,
    ) -> Result<Result<(), Refused>, E> {
        if self.has_channel(record) {
            return Ok(Ok(()));
        }
        if self.channels.contains_key(&record.id) {
            return Ok(Err(Refused::Redefined));
        }
        if self.before + self.channels.len() >= MOST_CHANNELS {
            return Ok(Err(Refused::TooMuch));
        }
        if let Err(refused) = self.grow(record.topic.len() + record.encoding.len()) {
            return Ok(Err(refused));
        }
        let ChannelRecord { id, schema_id, topic, encoding } = *record;
        let (topic, encoding) = (topic.to_owned(), encoding.to_owned());
        let channel = Channel { id, schema_id, topic, encoding };
        let decoder = decoder(&channel, self.schemas.get(&record.schema_id))?;
        self.channels.insert(record.id, (channel, decoder));
        Ok(Ok(()))
    }

    fn grow(&mut self, bytes: usize) -> Result<(), Refused> {
        let size = self.size + bytes;
        if size > MOST_DEFINITIONS {
            return Err(Refused::TooMuch);
        }
        self.size = size;
        Ok(())
    }
}

impl Schema {
    fn is(&self, record: &SchemaRecord<'_>) -> bool {
        self.name == record.name
            && self.encoding == record.encoding
            && self.definition == record.definition
    }
}

impl Channel {
    fn is(&self, record: &ChannelRecord<'_>) -> bool {
        self.schema_id == record.schema_id
            && self.topic == record.topic
            && self.encoding == record.encoding
    }
}
