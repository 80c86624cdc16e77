//! Residuals as an MCAP file that Foxglove opens without conversion: for each model, way of judging and session, named
//! `/before/…` or `/after/…`,
//!
//! - `…/vectors`, `foxglove.SceneUpdate`: one arrow per station, from the predicted towards the measured position, all in
//!   one message at the first station;
//! - `…/error`, `posegrid.Residual`: the numbers of each row, at its station's time.
//!
//! Times are the controller's. The same tables give the same bytes.

mod rows;
mod scene;
mod times;

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde::Serialize;

use super::{ExportError, ExportErrorKind};
use crate::common;
use crate::lake::read_given;
use crate::manifest::RunKey;
use crate::report::{BaseRefit, Split};
use crate::schema;
use crate::tables::residuals::ResidualRow;
use rows::{Numbers, Of, rows};
use scene::{Arrow, SceneUpdate};
use times::Times;

/// Length of arrows divided by that of the errors: 1 mm is 200 mm in a work space of metres.
pub const ARROW_SCALE: f64 = 200.0;

const CHUNK_BYTES: u64 = 1 << 20;
/// Characters that stay unchanged in a topic's name; names of sessions may hold any.
const TOPIC: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.');

const NUMBERS: &str = include_str!("residuals_mcap/residual.json");

/// Writes the residuals of a file; times come from the files `stations`, or without any from the lake that holds the
/// file.
pub fn write(path: &Path, stations: &[PathBuf], mut sink: impl Write) -> Result<(), ExportError> {
    let table = read_given(path, schema::find("residuals")?)?;
    if table.rows() == 0 {
        return Err(ExportErrorKind::Empty.at(path));
    }
    let key = common::key(path, &table)?;
    let rows = rows(&table);
    let times = Times::read(
        path,
        stations,
        &key,
        rows.iter().map(|(of, _)| of.subject.of_session.as_str()),
    )?;
    let mut log = Log::create(&key, table.rows())?;
    for (of, rows) in &rows {
        log.add(of, rows, &times)?;
    }
    Ok(sink.write_all(&log.finish()?)?)
}

/// A message before it is written: time, channel, body.
struct Message {
    ns: u64,
    channel: u16,
    body: Vec<u8>,
}

struct Log {
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    messages: Vec<Message>,
}

impl Log {
    fn create(key: &RunKey, rows: usize) -> Result<Self, ExportError> {
        let mut writer = WriteOptions::new()
            .library("posegrid")
            .chunk_size(Some(CHUNK_BYTES))
            .compression_threads(0)
            .compression_level(9)
            .create(Cursor::new(Vec::new()))?;
        writer.write_metadata(&Metadata {
            name: "posegrid".to_owned(),
            metadata: about(key, rows),
        })?;
        Ok(Self { writer, messages: Vec::new() })
    }

    fn add(&mut self, of: &Of, rows: &[ResidualRow], times: &Times) -> Result<(), ExportError> {
        let topic = topic(of);
        let vectors = self.channel(&topic, "vectors", "foxglove.SceneUpdate", scene::SCHEMA)?;
        let error = self.channel(&topic, "error", "posegrid.Residual", NUMBERS)?;
        let mut entities = Vec::with_capacity(rows.len());
        let mut first = u64::MAX;
        for row in rows {
            let ns = times.of(&of.subject.of_session, row.station)?;
            first = first.min(ns);
            entities.push(Arrow { of, row, ns }.entity());
            self.push(error, ns, &Numbers::new(row, of, ns))?;
        }
        self.push(vectors, first, &SceneUpdate::of(entities))
    }

    fn channel(
        &mut self,
        topic: &str,
        last: &str,
        schema: &str,
        text: &str,
    ) -> Result<u16, ExportError> {
        let schema = self.writer.add_schema(schema, "jsonschema", text.as_bytes())?;
        let topic = format!("{topic}/{last}");
        Ok(self.writer.add_channel(schema, &topic, "json", &BTreeMap::new())?)
    }

    fn push(&mut self, channel: u16, ns: u64, message: &impl Serialize) -> Result<(), ExportError> {
        let body = serde_json::to_vec(message)?;
        self.messages.push(Message { ns, channel, body });
        Ok(())
    }

    /// Writes the messages in time order; where times are equal, the earlier channel comes first.
    fn finish(mut self) -> Result<Vec<u8>, ExportError> {
        self.messages.sort_by_key(|message| (message.ns, message.channel));
        for message in &self.messages {
            let header = MessageHeader {
                channel_id: message.channel,
                sequence: 0,
                log_time: message.ns,
                publish_time: message.ns,
            };
            self.writer.write_to_known_channel(&header, &message.body)?;
        }
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}

fn about(key: &RunKey, rows: usize) -> BTreeMap<String, String> {
    [
        ("format", "posegrid residuals 1".to_owned()),
        ("robot", key.robot.clone()),
        ("session", key.session.clone()),
        ("run", key.run.clone()),
        ("residuals", rows.to_string()),
        ("arrow_scale", ARROW_SCALE.to_string()),
        ("frame", "base".to_owned()),
        ("clock", "controller, first stationary moment of each station".to_owned()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

fn topic(of: &Of) -> String {
    let judged = match of.subject.split {
        Split::None => "training",
        Split::Blocks => "held_out_blocks",
        Split::Session => "held_out_session",
    };
    let base = match of.subject.base_refit {
        BaseRefit::First => "_base_from_first",
        BaseRefit::Chosen => "_base_from_chosen",
        BaseRefit::All => "_base_from_all",
        BaseRefit::None => "",
    };
    let words = of.words();
    format!(
        "/{}/{}_{}/{judged}{base}/{}",
        of.moment(),
        words.model,
        words.angles,
        utf8_percent_encode(&of.subject.of_session, TOPIC)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Angles, Model, Subject};
    use crate::tables::words::Role;

    #[test]
    fn a_session_of_any_name_is_the_last_part_of_its_topic() {
        let of = |session: &str, split, base_refit, model| Of {
            subject: Subject {
                split,
                of_session: session.to_owned(),
                model,
                angles: Angles::Commanded,
                base_refit,
            },
            role: Role::HeldOut,
        };
        assert_eq!(
            topic(&of("a/../b\n", Split::Blocks, BaseRefit::None, Model::Full)),
            "/after/full_commanded/held_out_blocks/a%2F..%2Fb%0A"
        );
        assert_eq!(
            topic(&of("mon", Split::Session, BaseRefit::First, Model::RawCommand)),
            "/before/raw_command_commanded/held_out_session_base_from_first/mon"
        );
    }

    #[test]
    fn schemas_are_json_and_name_what_they_are_of() {
        for (text, name) in
            [(scene::SCHEMA, "foxglove.SceneUpdate"), (NUMBERS, "posegrid.Residual")]
        {
            let schema: serde_json::Value = serde_json::from_str(text).unwrap();
            assert_eq!(
                (schema["title"].as_str(), schema["type"].as_str()),
                (Some(name), Some("object"))
            );
        }
    }
}
