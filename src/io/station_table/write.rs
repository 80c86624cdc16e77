use std::fmt::Write as _;

use nalgebra::Point3;

use crate::geometry::{pose_covariance, symmetric};
use crate::ingest::{LengthRead, StandsOn};
use crate::join::{MeanOrientation, Reading, SourceId, Station, TargetId};
use crate::kinematics::{Arm, Joint};

/// Decimals of angles in degrees, and of lengths in mm.
const DECIMALS: usize = 7;

const POSITION: [&str; 3] = ["x", "y", "z"];
const MEASURED: [&str; 7] = ["x", "y", "z", "sd_x", "sd_y", "sd_z", "samples"];

/// A target's orientation: quaternion, standard deviation of a sample about each axis.
const ORIENTATION: [&str; 5] = ["qx", "qy", "qz", "qw", "sd_turn"];

/// An instrument of one length of a table: its name, the word of what it reads, and its standard deviation, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct LengthColumn {
    pub name: String,
    pub reads: LengthRead,
    pub sd_mm: f64,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct Read<'a> {
    pub targets: &'a [String],
    pub lengths: &'a [LengthColumn],
    pub references: &'a [(String, StandsOn)],
    /// Positions of the references at each station, mm; empty without references.
    pub looks: &'a [Vec<Point3<f64>>],
}

/// Angles are in degrees, positions in mm; missing readings are blank. Comments above the header say how a pipeline
/// file reads it.
pub fn csv(stations: &[Station], arm: &Arm, read: Read<'_>) -> String {
    let Read { targets, lengths, references, looks } = read;
    let parts = parts(stations, targets.len());
    let mut text = section(arm, &read, &parts);
    let joints = arm.joints().iter().map(|joint| joint.name.clone());
    let commands = ["x", "y", "z", "qx", "qy", "qz", "qw"].map(|own| format!("command_{own}"));
    let readings = targets.iter().zip(&parts).flat_map(|(target, parts)| {
        let orientation = parts.turned.then(|| named(target, ORIENTATION));
        named(target, MEASURED)
            .into_iter()
            .chain(orientation.into_iter().flatten())
            .chain(parts.of_covariance(target))
    });
    let header: Vec<String> = ["station".to_owned()]
        .into_iter()
        .chain(joints)
        .chain(["temperature".to_owned()])
        .chain(commands)
        .chain(readings)
        .chain(lengths.iter().map(|own| own.name.clone()))
        .chain(references.iter().flat_map(|(name, _)| named(name, POSITION)))
        .collect();
    let named: Vec<String> = header.iter().map(|name| quoted(name)).collect();
    writeln!(text, "{}", named.join(",")).expect("a string");
    for (place, station) in stations.iter().enumerate() {
        let mut cells = row(station, arm, &parts, lengths.len());
        let own = looks.get(place).map_or(&[][..], |own| own);
        cells.extend(own.iter().flat_map(|at| at.iter().map(|x| number(*x)).collect::<Vec<_>>()));
        writeln!(text, "{}", cells.join(",")).expect("a string");
    }
    text
}

/// Names of the columns of a target or a reference.
fn named<const N: usize>(name: &str, columns: [&str; N]) -> [String; N] {
    columns.map(|own| format!("{name}_{own}"))
}

#[derive(Debug, Clone, Copy, Default)]
struct Parts {
    turned: bool,
    /// Number of entries of a covariance: 6 of a position, 36 of a pose, 0 without one.
    covariance: usize,
}

impl Parts {
    fn of_covariance(self, target: &str) -> impl Iterator<Item = String> {
        (1..=self.covariance).map(move |entry| format!("{target}_cov_{entry}"))
    }

    /// The cells of its covariance: xx xy xz yy yz zz, or all entries row by row; blank where none is stated.
    fn covariance(self, reading: Option<&Reading>) -> Vec<String> {
        let stated = reading.and_then(|own| Some((own.value.point()?.stated_covariance?, own)));
        let entries: Option<Vec<f64>> = stated.and_then(|(position, own)| {
            if self.covariance == 6 {
                return Some(position.to_vec());
            }
            let turn = own.value.turn()?.stated_covariance?;
            let whole = pose_covariance::joint(&symmetric(position), &turn);
            Some(whole.transpose().iter().copied().collect())
        });
        match entries {
            Some(entries) => entries.iter().map(|own| format!("{own:.9e}")).collect(),
            None => vec![String::new(); self.covariance],
        }
    }
}

fn parts(stations: &[Station], targets: usize) -> Vec<Parts> {
    let mut parts = vec![Parts::default(); targets];
    for reading in stations.iter().flat_map(Station::measured) {
        let Some(own) = parts.get_mut(reading.target.0) else { continue };
        let (point, turn) = (reading.value.point(), reading.value.turn());
        own.turned |= turn.is_some();
        let has_point = point.is_some_and(|point| point.stated_covariance.is_some());
        let has_turn = turn.is_some_and(|turn| turn.stated_covariance.is_some());
        own.covariance = own.covariance.max(match (has_point, has_turn) {
            (true, true) => 36,
            (true, false) => 6,
            (false, _) => 0,
        });
    }
    parts
}

/// The section that reads the table, as comments.
fn section(arm: &Arm, read: &Read<'_>, parts: &[Parts]) -> String {
    let (targets, lengths) = (read.targets, read.lengths);
    let list = |names: &[String]| {
        format!("[{}]", names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", "))
    };
    let joints: Vec<String> = arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let mut lines = vec![
        "Stations of a simulated session. A pipeline file reads them with".to_owned(),
        "[stations]".to_owned(),
        format!("joints = {}", list(&joints)),
        "joint_unit = \"deg\"".to_owned(),
    ];
    lines.extend(arm.has_slides().then(|| "length_unit = \"mm\"".to_owned()));
    lines.push("temperature = \"temperature\"".to_owned());
    lines.push(
        "commanded = { position = [\"command_x\", \"command_y\", \"command_z\"], unit = \"mm\", orientation = { quaternion_xyzw = \
         [\"command_qx\", \"command_qy\", \"command_qz\", \"command_qw\"] } }"
            .to_owned(),
    );
    for (place, target) in targets.iter().enumerate() {
        let columns = named(target, MEASURED);
        let several = targets.len() > 1;
        lines
            .push(if several { "[[stations.measured]]" } else { "[stations.measured]" }.to_owned());
        lines.extend(several.then(|| format!("name = {target:?}")));
        lines.push(format!("position = {}", list(&columns[..3])));
        lines.push("unit = \"mm\"".to_owned());
        lines.push(format!("sd = {}", list(&columns[3..6])));
        lines.push(format!("samples = {:?}", columns[6]));
        let parts = parts.get(place).copied().unwrap_or_default();
        let covariance: Vec<String> = parts.of_covariance(target).collect();
        if !covariance.is_empty() {
            lines.push(format!("covariance = {}", list(&covariance)));
        }
        lines.extend(parts.turned.then(|| {
            let [quaternion @ .., sd] = named(target, ORIENTATION);
            format!("orientation = {{ quaternion_xyzw = {}, sd = [{sd:?}] }}", list(&quaternion))
        }));
    }
    for own in lengths {
        lines.extend([
            "[[stations.lengths]]".to_owned(),
            format!("name = {:?}", own.name),
            format!("reads = {:?}", own.reads.word()),
            format!("column = {:?}", own.name),
            "unit = \"mm\"".to_owned(),
            format!("sd_mm = {}", own.sd_mm),
        ]);
    }
    for (name, on) in read.references {
        lines.extend([
            "[[stations.references]]".to_owned(),
            format!("name = {name:?}"),
            format!("on = {:?}", on.word()),
            format!("position = {}", list(&named(name, POSITION))),
            "unit = \"mm\"".to_owned(),
        ]);
    }
    lines.iter().fold(String::new(), |mut text, line| {
        writeln!(text, "# {line}").expect("a string");
        text
    })
}

fn row(station: &Station, arm: &Arm, parts: &[Parts], lengths: usize) -> Vec<String> {
    let joints = arm.joints().iter().zip(&station.joints);
    let joints = joints.map(|(joint, &value): (&Joint, &f64)| number(joint.shown(value)));
    let temperature = station.readings.first().and_then(|reading| reading.temperature_c);
    let mut cells = vec![station.number.to_string()];
    cells.extend(joints);
    cells.push(temperature.map_or_else(String::new, |celsius| celsius.to_string()));
    cells.extend(command(station));
    for (target, parts) in parts.iter().enumerate() {
        let target = TargetId(target);
        let reading = station
            .measured()
            .iter()
            .find(|reading| reading.target == target && reading.value.point().is_some());
        cells.extend(reading.map(measured).unwrap_or_default());
        if parts.turned {
            let turn = reading.and_then(|reading| reading.value.turn());
            cells.extend(turn.map(orientation).unwrap_or_default());
        }
        cells.extend(parts.covariance(reading));
    }
    for source in (1..=lengths).map(SourceId) {
        let mut own = station.measured().iter();
        let own = own.find(|reading| reading.source == source);
        let length = own.and_then(|reading| reading.value.length());
        cells.push(length.map_or_else(String::new, |length| number(length.mm)));
    }
    cells
}

/// Position and quaternion of the command; blank where there is none.
fn command(station: &Station) -> [String; 7] {
    let Some(command) = &station.command else { return Default::default() };
    let [x, y, z] = command.position.coords.into();
    let turn = command.orientation.map(|turn| <[f64; 4]>::from(turn.coords));
    let quaternion = turn.map(|turn| turn.map(|component| format!("{component:.9}")));
    let [qx, qy, qz, qw] = quaternion.unwrap_or_default();
    [number(x), number(y), number(z), qx, qy, qz, qw]
}

fn measured(reading: &Reading) -> [String; 7] {
    let Some(point) = reading.value.point() else { return Default::default() };
    let [x, y, z] = point.position.coords.into();
    let [sd_x, sd_y, sd_z] = point.scatter_mm.map(number);
    [number(x), number(y), number(z), sd_x, sd_y, sd_z, reading.kept.to_string()]
}

fn orientation(turn: &MeanOrientation) -> [String; 5] {
    let [x, y, z, w]: [f64; 4] = turn.orientation.coords.into();
    [x, y, z, w, turn.scatter_rad].map(|own| format!("{own:.9}"))
}

fn number(value: f64) -> String {
    format!("{value:.DECIMALS$}")
}

/// A name as a cell: in quotes where it holds a separator or a quote.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
