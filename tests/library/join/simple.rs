//! The simplest reader of the real recordings: every message of the `mcap` crate's own stream, its bytes taken apart by hand,
//! all in memory and sorted by stamp.

use std::convert::Infallible;
use std::fs;
use std::path::PathBuf;

use mcap::MessageStream;
use posegrid::ingest::{Mapping, PoseSamples, TemperatureSamples};
use posegrid::io::log::SessionLogs;
use posegrid::join::JoinInput;
use posegrid::join::stationary::{StationaryRule, stationary_of};
use posegrid::units::Stamp;

/// What the join is given of a session of six joints.
pub fn input(logs: &SessionLogs, mapping: &Mapping, rule: &StationaryRule) -> JoinInput {
    let joints = messages(&logs.controller, &mapping.controller.topic, |cdr| {
        let names: Vec<String> = (0..cdr.word()).map(|_| cdr.text()).collect();
        let angles: Vec<f64> = (0..cdr.word()).map(|_| cdr.number()).collect();
        let of_joint = |joint: &String| {
            let place = names.iter().position(|name| name == joint);
            angles[place.expect("in each message")]
        };
        mapping.joints.iter().map(of_joint).collect::<Vec<f64>>()
    });
    let (stamps_ns, angles): (Vec<i64>, Vec<Vec<f64>>) = joints.into_iter().unzip();
    let commanded = mapping.commanded.as_ref().expect("a topic of commands");
    let temperatures = mapping.tracker.temperature.as_ref().expect("a topic");
    let temperatures = messages(&logs.tracker, temperatures, Cdr::number).into_iter();
    let temperatures = temperatures.map(|(stamp_ns, celsius)| (Stamp::from_ns(stamp_ns), celsius));
    let (stamps, celsius) = temperatures.unzip();
    let joints = stationary_of(mapping.joints.len(), rule, |finder| {
        finder.push(&stamps_ns, &angles.concat());
        Ok::<_, Infallible>(())
    });
    JoinInput {
        joints: joints.expect("no error").0,
        commands: Box::new(poses(&logs.controller, &commanded.topic)),
        readings: Box::new(poses(&logs.tracker, &mapping.tracker.topic)),
        others: Vec::new(),
        references: Vec::new(),
        lengths: Vec::new(),
        temperatures: TemperatureSamples { stamps, celsius },
    }
}

/// Metres, and quaternions that are divided by their norm; scaled first by their largest number, as they come.
fn poses<C: Copy>(logs: &[PathBuf], topic: &str) -> PoseSamples<C> {
    let read = messages(logs, topic, |cdr| {
        let position: [f64; 3] = std::array::from_fn(|_| cdr.number() * 1000.0);
        let quaternion: [f64; 4] = std::array::from_fn(|_| cdr.number());
        let largest = quaternion.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        let squares = quaternion.iter().map(|x| (x / largest).powi(2)).sum::<f64>();
        (position, quaternion.map(|x| x / (largest * squares.sqrt())))
    });
    let (stamps, poses): (Vec<i64>, Vec<_>) = read.into_iter().unzip();
    let (positions, orientations) = poses.into_iter().unzip();
    PoseSamples {
        stamps: stamps.into_iter().map(Stamp::from_ns).collect(),
        positions,
        orientations: Some(orientations),
        covariances: None,
    }
}

/// Header stamp (ns) and content of the messages of a topic, by stamp.
fn messages<T>(logs: &[PathBuf], topic: &str, content: impl Fn(&mut Cdr) -> T) -> Vec<(i64, T)> {
    let mut found = Vec::new();
    for log in logs {
        let bytes = fs::read(log).expect("a recording");
        let all = MessageStream::new(&bytes).expect("a log");
        let all = all.map(|message| message.expect("a sound recording"));
        for message in all.filter(|message| message.channel.topic == topic) {
            let mut cdr = Cdr { bytes: message.data[4..].to_vec(), at: 0 };
            let (seconds, nanoseconds) = (cdr.word(), cdr.word());
            let _frame = cdr.text();
            let stamp_ns = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
            found.push((stamp_ns, content(&mut cdr)));
        }
    }
    found.sort_by_key(|message| message.0);
    found
}

/// A message in little-endian CDR, without its first four bytes: each number stands at a multiple of its size.
struct Cdr {
    bytes: Vec<u8>,
    at: usize,
}

impl Cdr {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let start = self.at.next_multiple_of(N);
        self.at = start + N;
        self.bytes[start..self.at].try_into().expect("N bytes")
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn number(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let length = self.word() as usize;
        let text = &self.bytes[self.at..self.at + length - 1];
        self.at += length;
        String::from_utf8(text.to_vec()).expect("a name")
    }
}
