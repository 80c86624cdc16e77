//! The same joint states in protobuf and JSON: messages per CPU second, decompression included.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::{Compression, WriteOptions, Writer};
use posegrid::io::log::{Limits, SessionLogs, read_session};
use posegrid::join::JoinSettings;
use posegrid::progress::Quiet;

use super::proto::{self, Proto};
use super::{JOINTS, cpu_seconds, decompress, mapping, measure, median, write};

/// How joint states are stored besides CDR.
#[derive(Debug, Clone, Copy)]
enum Form {
    Protobuf,
    Json,
}

/// How often each is read; the median counts.
const ROUNDS: usize = 5;

/// Reads a log of so many joint states in each form.
pub fn measure_all(folder: &Path, joint_states: u64) {
    for form in [Form::Protobuf, Form::Json] {
        let path = folder.join(format!("{form:?}.mcap"));
        write_log(&path, form, joint_states);
        let mut mapping = mapping();
        mapping.commanded = None;
        let rounds = (0..ROUNDS).map(|_| {
            let floor = measure(&format!("{form:?}: zstd decompression alone"), None, || {
                decompress(&path, 1)
            });
            let before = cpu_seconds();
            measure(&format!("{form:?}: streaming into dwells"), Some(floor), || {
                let logs = SessionLogs::of_two(&path, &path);
                let (rule, limits) = (JoinSettings::default().arm_rule(), Limits::default());
                let read = read_session(&logs, &mapping, limits, &rule, &mut (), &Quiet);
                let kept = read.expect("a sound log").counts["joints.kept"];
                assert_eq!(kept, joint_states, "all are decoded");
                joint_states
            });
            let after = cpu_seconds();
            (after.0 - before.0) + (after.1 - before.1)
        });
        let seconds = median(rounds);
        let millions = joint_states as f64 * 1e-6;
        println!("{form:?}: {:.2} million messages per CPU second", millions / seconds);
    }
}

fn write_log(path: &Path, form: Form, joint_states: u64) {
    let options = WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(1)
        .chunk_size(Some(1 << 20));
    let file = BufWriter::new(File::create(path).expect("a temporary file"));
    let mut log = options.create(file).expect("a temporary file");
    let joints = channel(&mut log, "/joint_states", "foxglove.JointStates", form);
    let pose = channel(&mut log, "/point", "foxglove.Point3InFrame", form);
    let mut noise = 1;
    for i in 0..joint_states {
        let ns = 1_600_000_000_000_000_000 + i * 2_000_000;
        let angles = JOINTS.map(|_| angle(i as f64 * 1e-4, &mut noise));
        let message = match form {
            Form::Protobuf => protobuf(ns, angles),
            Form::Json => json(ns, angles),
        };
        write(&mut log, joints, ns, &message);
    }
    let reading = match form {
        Form::Protobuf => {
            let time = proto::timestamp(1);
            Proto::default().message(1, &time).message(3, &Proto::default().double(1, 1.0)).0
        }
        Form::Json => {
            b"{\"timestamp\":{\"sec\":1,\"nsec\":1},\"point\":{\"x\":1,\"y\":1,\"z\":1}}".to_vec()
        }
    };
    write(&mut log, pose, 1, &reading);
    log.finish().expect("room in the temporary folder");
}

fn channel(log: &mut Writer<BufWriter<File>>, topic: &str, name: &str, form: Form) -> u16 {
    let (language, encoding, definition) = match form {
        Form::Protobuf => ("protobuf", "protobuf", proto::foxglove()),
        Form::Json => ("jsonschema", "json", b"{}".to_vec()),
    };
    let schema = log.add_schema(name, language, &definition).expect("few schemas");
    log.add_channel(schema, topic, encoding, &std::collections::BTreeMap::new())
        .expect("few channels")
}

/// As an encoder reads it: a slow motion with noise in the last digits.
fn angle(slow: f64, noise: &mut u64) -> f64 {
    *noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    slow.sin() + (*noise >> 40) as f64 * 1e-12
}

fn protobuf(ns: u64, angles: [f64; 6]) -> Vec<u8> {
    let time = proto::timestamp(i64::try_from(ns).expect("before 2262"));
    let joints = JOINTS.iter().zip(angles);
    let whole = joints.fold(Proto::default().message(1, &time), |message, (name, angle)| {
        let joint = Proto::default().bytes(1, name.as_bytes());
        message.message(2, &joint.double(2, angle).double(3, angle * 0.5))
    });
    whole.0
}

fn json(ns: u64, angles: [f64; 6]) -> Vec<u8> {
    let joints = JOINTS.iter().zip(angles).map(|(name, angle)| {
        format!("{{\"name\":\"{name}\",\"position\":{angle},\"velocity\":{}}}", angle * 0.5)
    });
    let joints = joints.collect::<Vec<_>>().join(",");
    let (sec, nsec) = (ns / 1_000_000_000, ns % 1_000_000_000);
    format!("{{\"timestamp\":{{\"sec\":{sec},\"nsec\":{nsec}}},\"joints\":[{joints}]}}")
        .into_bytes()
}
