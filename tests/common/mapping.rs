//! Mappings of logs that tests write.

use posegrid::ingest::{LengthUnit, PoseFields, TimeSource, TrackerSettings};

/// Readings of one target on a topic, without temperatures.
pub fn tracker(topic: &str, time: TimeSource, unit: LengthUnit) -> TrackerSettings {
    TrackerSettings {
        topic: topic.to_owned(),
        time,
        unit,
        temperature: None,
        ignore_orientation: false,
        fields: PoseFields::default(),
        frame: None,
        targets: Vec::new(),
        references: Vec::new(),
        lengths: Vec::new(),
        eye_in_hand: false,
    }
}
