//! The sections of a pipeline file that would read the logs; values that no log states are comments to fill in.

use std::path::Path;

use super::{Form, escaped, shown, toml_text};
use crate::io::inspect::{ChannelSummary, Inspection};
use crate::io::log::Layout;

/// Most topics that are named where none fits.
const MOST_TOPICS: usize = 100;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Section {
    Controller,
    Commanded,
    Tracker,
}

impl Section {
    const fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::Commanded => "commanded",
            Self::Tracker => "tracker",
        }
    }

    /// The usual unit in ROS, and the choices.
    const fn unit(self) -> (&'static str, &'static str) {
        match self {
            Self::Controller => ("rad", "rad or deg"),
            Self::Commanded | Self::Tracker => ("m", "m or mm"),
        }
    }

    /// Commands are in logs with joint states; poses in a log without are a tracker's, whatever their topic is called.
    fn suits(self, beside_joints: bool, channel: &ChannelSummary) -> bool {
        let is_pose = matches!(
            layout(channel),
            Some(Layout::Pose | Layout::Point | Layout::PoseWithCovariance)
        );
        let is_command = beside_joints && sounds_like_a_command(&channel.topic);
        match self {
            Self::Controller => is_joints(channel),
            Self::Commanded => is_pose && is_command,
            Self::Tracker => is_pose && !is_command || names_targets(channel) && !beside_joints,
        }
    }

    fn to_fill_in(self, form: Form) -> String {
        match self {
            Self::Controller => {
                "# length_unit = \"m\"  # m or mm: only for an arm with a joint that slides\n"
                    .to_owned()
            }
            Self::Commanded => {
                "# base_from_command = { xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }  # where the frame of the \
                 commands lies in the robot file's base frame\n\
                 # target_is_tool = true  # whether the commanded point is the measured target\n\
                 # flange_from_tool = { … }  # the controller's tool, where it is not\n"
                    .to_owned()
            }
            Self::Tracker => form.uncertainty(),
        }
    }
}

fn layout(channel: &ChannelSummary) -> Option<Layout> {
    channel.suggestion.as_ref().map(|found| found.layout)
}

fn is_joints(channel: &ChannelSummary) -> bool {
    layout(channel) == Some(Layout::Joints) && channel.traffic.messages > 0
}

/// Whether messages state poses by name: those of links of an arm too, so that other poses go first.
fn names_targets(channel: &ChannelSummary) -> bool {
    matches!(layout(channel), Some(Layout::Markers | Layout::MarkersWithCovariance))
}

const SECTIONS: [Section; 3] = [Section::Controller, Section::Commanded, Section::Tracker];

/// The sections of a pipeline file that would read the logs, with what to check; `None` where no log was read.
pub fn snippet(found: &[Inspection]) -> Option<String> {
    let head = "# A pipeline file would read this with (units are guessed: check them; fill in what follows #):\n\n\
                [input]\n# folder = \"…\"  # the folder with one sub-folder per session\n";
    let of_logs = || format!("{head}{}{}", files(found), sections(found, Form::Shown));
    (!found.is_empty()).then(of_logs)
}

/// The sections behind `[input]`.
pub fn sections(found: &[Inspection], form: Form) -> String {
    let mut text = String::new();
    let mut missing = Vec::new();
    for section in SECTIONS {
        match most(found, &|beside_joints, channel| section.suits(beside_joints, channel)) {
            Some(channel) => text += &of_section(section, channel, found, form),
            None if section == Section::Commanded => {}
            None => missing.push(section),
        }
    }
    for section in missing {
        text += &of_missing(section, found);
    }
    text
}

/// The channel with the most messages among those that suit, of a log with joint states or without.
fn most<'f>(
    found: &'f [Inspection],
    suits: &dyn Fn(bool, &ChannelSummary) -> bool,
) -> Option<&'f ChannelSummary> {
    let of_log = |log: &'f Inspection| {
        let beside_joints = log.channels.iter().any(is_joints);
        let channels = log.channels.iter();
        channels
            .filter(move |channel| channel.traffic.messages > 0 && suits(beside_joints, channel))
    };
    let key = |channel: &&ChannelSummary| (!names_targets(channel), channel.traffic.messages);
    found.iter().flat_map(of_log).max_by_key(key)
}

fn of_section(
    section: Section,
    channel: &ChannelSummary,
    found: &[Inspection],
    form: Form,
) -> String {
    let (usual, choices) = section.unit();
    let (unit, guessed) = match channel.unit() {
        Some(unit) => (unit, format!("by values up to {:.4}", channel.traffic.sizes.largest)),
        None => (usual, "by ROS convention".to_owned()),
    };
    let mut lines = vec![format!("[{}]", section.name())];
    lines.push(format!(
        "topic = {}\ntime = \"{}\"",
        toml_text(&channel.topic),
        channel.best_time()
    ));
    lines.push(format!("unit = \"{unit}\"  # {choices}: guessed {guessed}"));
    let fields = channel.suggestion.as_ref().and_then(|found| found.fields.as_ref());
    lines.extend(fields.map(|fields| format!("{fields}  # guessed by their names: check them")));
    let joints = &channel.traffic.joints;
    if section == Section::Controller && !joints.is_empty() {
        let names: Vec<_> = joints.iter().map(|name| escaped(name)).collect();
        let names = names.join(", ");
        lines.push(format!("# the robot file has to name these joints: {names}"));
    }
    let temperature = most(found, &|_, channel| layout(channel) == Some(Layout::Temperature));
    if let (Some(temperature), Section::Tracker) = (temperature, section) {
        lines.push(format!("temperature = {}", toml_text(&temperature.topic)));
    }
    let mut text = lines.join("\n") + "\n";
    text += &section.to_fill_in(form);
    if names_targets(channel) {
        text += "\n[[tracker.targets]]\nname = \"tool\"\n# is = \"…\"  # the reflector's name in the messages\n";
    }
    if form == Form::File && section == Section::Commanded {
        text = left_out(&text);
    }
    text + "\n"
}

/// The section of the commands as comments: no log states their frame, nor the controller's tool.
fn left_out(section: &str) -> String {
    let commented = section.lines().map(|line| {
        let comment = if line.starts_with('#') { "" } else { "# " };
        [comment, line, "\n"].concat()
    });
    let why = "# Commands are left out until their frame and the controller's tool are stated, which no log does:\n";
    [why.to_owned()].into_iter().chain(commented).collect()
}

/// The keys of `[input]` that say which files belong to which side, in the order of the times in them.
pub fn files(found: &[Inspection]) -> String {
    let mut text = String::new();
    for (key, section) in [("controller", Section::Controller), ("tracker", Section::Tracker)] {
        let suits = |beside_joints, channel: &_| section.suits(beside_joints, channel);
        let Some(channel) = most(found, &suits) else { continue };
        let parts = parts(found, &channel.topic);
        let names: Vec<_> = parts.iter().map(|part| toml_text(&part.name)).collect();
        let names = match &names[..] {
            [one] => one.clone(),
            several => format!("[{}]", several.join(", ")),
        };
        text.extend([key, " = ", &names, "\n", &joints_of(&parts)]);
    }
    text + "\n"
}

/// A file with messages of a topic, and the log times of the first and the last of them.
struct Part {
    name: String,
    first: i64,
    last: i64,
}

fn parts(found: &[Inspection], topic: &str) -> Vec<Part> {
    let part = |log: &Inspection| {
        let own = log.channels.iter().filter(|channel| channel.topic == topic);
        let read = own.filter(|channel| channel.traffic.messages > 0);
        let mut clocks = read.map(|channel| channel.traffic.log);
        let first = clocks.next()?;
        let whole = clocks.fold(first, |mut whole, clock| {
            whole.append(&clock);
            whole
        });
        let name = Path::new(&log.read_summary.file).file_name().unwrap_or_default();
        let name = name.to_string_lossy().into_owned();
        Some(Part { name, first: whole.first, last: whole.last })
    };
    let mut parts: Vec<Part> = found.iter().filter_map(part).collect();
    parts.sort_by_key(|part| (part.first, part.last));
    parts
}

/// Comments on how each file of a split recording follows the one before.
fn joints_of(parts: &[Part]) -> String {
    let between = |pair: &[Part]| {
        let gap = pair[1].first.saturating_sub(pair[0].last) as f64 * 1e-9;
        let (one, next) = (escaped(&pair[0].name), escaped(&pair[1].name));
        if gap < 0.0 {
            format!("# {next} begins {:.3} s before {one} ends: are they of one recording?\n", -gap)
        } else {
            format!("# {next} follows {one} after {gap:.3} s\n")
        }
    };
    parts.windows(2).map(between).collect()
}

/// A comment on why a section is missing, and which topics might serve.
fn of_missing(section: Section, found: &[Inspection]) -> String {
    let what = match section {
        Section::Controller => "joint states",
        Section::Commanded | Section::Tracker => "poses or points of a target",
    };
    let channels = || found.iter().flat_map(|log| &log.channels);
    let kind = |channel: &ChannelSummary| {
        let (topic, encoding) = (shown(&channel.topic), shown(&channel.encoding));
        format!("{topic} ({}, {encoding})", shown(channel.type_name()))
    };
    let mut kinds: Vec<String> = channels().take(MOST_TOPICS).map(kind).collect();
    let more = channels().count() - kinds.len();
    if more > 0 {
        kinds.push(format!("and {more} more"));
    }
    let kinds = if kinds.is_empty() { "none".to_owned() } else { kinds.join(", ") };
    format!(
        "# no [{}]: no topic here has {what} of a type that is known; topics: {kinds}\n",
        section.name()
    )
}

fn sounds_like_a_command(topic: &str) -> bool {
    let topic = topic.to_lowercase();
    ["command", "cmd", "target", "goal", "desired", "setpoint"]
        .iter()
        .any(|word| topic.contains(word))
}
