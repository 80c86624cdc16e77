//! Suggestions of how to read a channel, for `posegrid inspect`, which prints a pipeline snippet. Fields of other than
//! common types are guessed by their names: x, y and z in one message are a position, with w a quaternion; an array of
//! names belongs to one of positions or angles.

use super::common::Layout;
use crate::message::{FieldPath, JsonSchema, MessageSchema, Row, Value};

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Suggestion {
    pub layout: Layout,
    /// The line `fields = { … }` that the section also needs, a guess; `None` for a common type.
    pub fields: Option<String>,
    /// Whether messages have a stamp of their own in a place that was found.
    pub stamped: bool,
}

/// The longest path that is offered: nobody would write a longer one into a pipeline file.
const LONGEST_PATH: usize = 200;

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Suggestible {
    Nothing,
    Common(Layout),
    /// The paths of its fields, of CDR and protobuf.
    Fields(Vec<String>),
    /// The paths of its fields, of JSON, whose messages may show more.
    Json(Vec<String>),
}

impl Suggestible {
    pub fn of(encoding: &str, type_name: &str, language: &str, definition: &[u8]) -> Self {
        let schema = MessageSchema::read(encoding, type_name, language, definition);
        let Some(Ok(schema)) = schema else { return Self::Nothing };
        if let Some(layout) = Layout::of_type(type_name) {
            return Self::Common(layout);
        }
        match schema {
            MessageSchema::Json(schema) => Self::Json(offered(schema.leaves)),
            schema => Self::Fields(offered(schema.leaves())),
        }
    }

    /// `None` where nothing fits or the messages cannot be read. `first_message` helps where JSON has no schema.
    pub fn suggestion(&self, first_message: Option<&[u8]>) -> Option<Suggestion> {
        match self {
            Self::Nothing => None,
            Self::Common(layout) => {
                Some(Suggestion { layout: *layout, fields: None, stamped: true })
            }
            Self::Fields(leaves) => Leaves(leaves).suggestion(None),
            Self::Json(leaves) => match first_message {
                Some(message) if leaves.is_empty() => {
                    let leaves = offered(JsonSchema::of_message(message).leaves);
                    Leaves(&leaves).suggestion(first_message)
                }
                _ => Leaves(leaves).suggestion(first_message),
            },
        }
    }
}

/// Words in the names of fields x, y and z that are no place.
const NO_PLACES: [&str; 8] =
    ["velocity", "acceleration", "twist", "force", "torque", "scale", "linear", "angular"];

const MOST_FIELDS: usize = 40;
const LONGEST_VALUE: usize = 40;

/// The fields of a JSON message, each as `path = value`.
pub fn json_fields(message: &[u8]) -> Vec<String> {
    let leaves = offered(JsonSchema::of_message(message).leaves);
    let leaves = Leaves(&leaves);
    let schema = MessageSchema::Json(JsonSchema::default());
    let field = |path: &str| {
        let reader = schema.reader(&[FieldPath::parse(path).ok()?]).ok()?;
        let mut row = Row::default();
        reader.read(message, &mut row).ok()?;
        Some(format!("{path} = {}", brief(row.value(message, 0))))
    };
    leaves.sound().take(MOST_FIELDS).filter_map(field).collect()
}

fn brief(value: Value<'_>) -> String {
    let text = match (value, value.number(), value.numbers()) {
        (Value::Text(text), ..) => format!("{:?}", text.to_text()),
        (_, Some(number), _) => number.to_string(),
        (_, _, Some(numbers)) => {
            let first = (0..numbers.len().min(3)).filter_map(|index| numbers.get(index));
            let numbers = first.map(|number| number.to_string());
            format!("[{}, …]", numbers.collect::<Vec<_>>().join(", "))
        }
        _ => "…".to_owned(),
    };
    text.chars().take(LONGEST_VALUE).collect()
}

fn offered(mut leaves: Vec<String>) -> Vec<String> {
    leaves.retain(|leaf| leaf.len() <= LONGEST_PATH);
    leaves
}

struct Leaves<'l>(&'l [String]);

type Named = Vec<(&'static str, String)>;

impl Leaves<'_> {
    /// A guess by the names; in JSON the first message may show where its stamp is.
    fn suggestion(&self, json_message: Option<&[u8]>) -> Option<Suggestion> {
        let (layout, mut named) = self.joints().or_else(|| self.pose())?;
        let stamp = self.stamp().or_else(|| self.date_time(json_message?));
        let usual = ["header.stamp", "timestamp"];
        if let Some(path) = stamp.as_ref().filter(|path| !usual.contains(&path.as_str())) {
            named.insert(0, ("stamp", path.clone()));
        }
        let named = named.iter().map(|(key, path)| format!("{key} = {path:?}"));
        let fields = format!("fields = {{ {} }}", named.collect::<Vec<_>>().join(", "));
        let fields = if fields.contains("interface_values") {
            fields + "  # the place of \"position\" among interface_names, from 0"
        } else {
            fields
        };
        Some(Suggestion { layout, fields: Some(fields), stamped: stamp.is_some() })
    }

    /// The paths that a pipeline file can name: a message type may have field names that it cannot.
    fn sound(&self) -> impl Iterator<Item = &str> {
        let plain = |leaf: &&str| leaf.chars().all(|c| c.is_alphanumeric() || "_.[]-".contains(c));
        let leaves = self.0.iter().map(String::as_str).filter(plain);
        leaves.filter(|leaf| FieldPath::parse(leaf).is_ok())
    }

    fn has(&self, prefix: &str, name: &str) -> Option<String> {
        let path = format!("{prefix}{name}");
        self.sound().any(|leaf| leaf == path).then_some(path)
    }

    /// The prefixes of paths that end in one of these names, each with its dot.
    fn before(&self, name: &str) -> Vec<&str> {
        let before = self.sound().filter_map(|leaf| leaf.strip_suffix(name));
        before.filter(|before| before.is_empty() || before.ends_with('.')).collect()
    }

    fn joints(&self) -> Option<(Layout, Named)> {
        for names in ["name", "names", "joint_name", "joint_names"] {
            for prefix in self.before(names) {
                let angles = ["position", "positions", "angle", "angles", "q"];
                let angles = angles.iter().find_map(|angles| self.has(prefix, angles));
                let angles = angles.or_else(|| self.has(prefix, "actual.positions"));
                // Single values are arrays only where they are in each element of one.
                let many = prefix.contains("[]") || names != "name";
                // Of interfaces by their names, as controllers under ROS state them, the first.
                let of_interface =
                    || self.has(prefix, "interface_values[].values").map(|own| own + "[0]");
                if let Some(angles) = angles.filter(|_| many).or_else(of_interface) {
                    let named = vec![("names", format!("{prefix}{names}")), ("angles", angles)];
                    return Some((Layout::Joints, named));
                }
            }
        }
        None
    }

    fn pose(&self) -> Option<(Layout, Named)> {
        let axes = |prefix: &str, names: &[&str]| -> Option<Vec<String>> {
            names.iter().map(|name| self.has(prefix, name)).collect()
        };
        let single = |prefix: &&str| !prefix.contains("[]");
        let prefixes: Vec<_> = self.before("x").into_iter().filter(single).collect();
        let is_place = |prefix: &str| {
            axes(prefix, &["w"]).is_none() && !NO_PLACES.iter().any(|word| prefix.contains(word))
        };
        let mut position = prefixes.iter().filter(|prefix| is_place(prefix));
        let position = position.find_map(|prefix| axes(prefix, &["x", "y", "z"]))?;
        let mut named: Named = ["x", "y", "z"].into_iter().zip(position).collect();
        let quaternion = prefixes.iter().find_map(|prefix| axes(prefix, &["x", "y", "z", "w"]));
        let layout = if quaternion.is_some() { Layout::Pose } else { Layout::Point };
        named.extend(["qx", "qy", "qz", "qw"].into_iter().zip(quaternion.into_iter().flatten()));
        Some((layout, named))
    }

    /// The path of the time among the fields: seconds and nanoseconds.
    fn stamp(&self) -> Option<String> {
        let parts = [("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs")];
        parts.iter().find_map(|(sec, nanosec)| {
            let mut before = self.before(sec).into_iter();
            let found = before.find(|prefix| {
                !prefix.is_empty() && !prefix.contains("[]") && self.has(prefix, nanosec).is_some()
            });
            found.map(|prefix| prefix.trim_end_matches('.').to_owned())
        })
    }

    /// The path of the first text in a JSON message that is a date-time.
    fn date_time(&self, message: &[u8]) -> Option<String> {
        let single: Vec<_> = self.sound().filter(|path| !path.contains("[]")).collect();
        let paths = single.iter().map(|path| FieldPath::parse(path));
        let schema = MessageSchema::Json(JsonSchema::default());
        let reader = schema.reader(&paths.collect::<Result<Vec<_>, _>>().ok()?);
        let mut row = Row::default();
        reader.ok()?.read(message, &mut row).ok()?;
        let is_date_time = |slot: &usize| match row.value(message, *slot) {
            Value::Text(text) => text.date_time_ns().is_some(),
            _ => false,
        };
        let found = (0..single.len()).find(is_date_time)?;
        Some(single[found].to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_json(message: &str) -> Option<Suggestion> {
        Suggestible::of("json", "", "", b"").suggestion(Some(message.as_bytes()))
    }

    #[test]
    fn common_types_need_no_fields() {
        let common = Suggestible::of("json", "foxglove.PoseInFrame", "jsonschema", b"{}");
        let found = common.suggestion(None).expect("a common type");
        assert_eq!((found.layout, found.fields), (Layout::Pose, None));
        let unread = Suggestible::of("cbor", "foxglove.PoseInFrame", "", b"");
        assert_eq!(unread.suggestion(None), None);
    }

    #[test]
    fn fields_of_a_json_message_are_shown_with_their_values() {
        let fields = json_fields(b"{\"a\": {\"b\": 1.5}, \"q\": [1, 2, 3, 4], \"t\": \"x\"}");
        assert_eq!(fields, ["a.b = 1.5", "q = [1, 2, 3, …]", "t = \"x\""]);
        assert!(json_fields(b"no JSON").is_empty());
    }

    #[test]
    fn fields_of_other_types_are_guessed() {
        let found = of_json(
            "{\"t\": {\"secs\": 1, \"nsecs\": 2}, \"v\": {\"twist\": {\"x\": 0, \"y\": 0, \"z\": 0}},
              \"w\": {\"p\": {\"x\": 0, \"y\": 0, \"z\": 0}, \"q\": {\"x\": 0, \"y\": 0, \"z\": 0, \"w\": 1}}}",
        );
        let found = found.expect("a pose");
        assert_eq!((found.layout, found.stamped), (Layout::Pose, true));
        assert_eq!(
            found.fields.as_deref(),
            Some(
                "fields = { stamp = \"t\", x = \"w.p.x\", y = \"w.p.y\", z = \"w.p.z\", qx = \"w.q.x\", \
                 qy = \"w.q.y\", qz = \"w.q.z\", qw = \"w.q.w\" }"
            )
        );
        let found = of_json("{\"axes\": [{\"name\": \"a\", \"angle\": 1}]}").expect("joints");
        assert_eq!(found.layout, Layout::Joints);
        assert!(!found.stamped);
        assert_eq!(
            found.fields.as_deref(),
            Some("fields = { names = \"axes[].name\", angles = \"axes[].angle\" }")
        );
        let found = of_json(
            "{\"id\": \"x\", \"taken\": \"2026-11-22T08:30:00Z\", \"at\": {\"x\": 0, \"y\": 0, \"z\": 0}}",
        );
        let found = found.expect("a point");
        assert!(found.stamped);
        assert_eq!(
            found.fields.as_deref(),
            Some("fields = { stamp = \"taken\", x = \"at.x\", y = \"at.y\", z = \"at.z\" }")
        );
        assert_eq!(of_json("{\"text\": \"x\"}"), None);
        // A name from a log that is no plain one is not offered.
        assert_eq!(of_json("{\"\\u001b\": {\"x\": 0, \"y\": 0, \"z\": 0}}"), None);
    }
}
