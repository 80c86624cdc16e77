//! The fields of a message that a stream is made from: those of the common types, or those that the pipeline file names.

use super::{Stream, Wanted};
use crate::ingest::{
    AngleFields, JointFields, LoggedLength, Mapping, PoseFields, StampField, TimeSource, TimeUnit,
    TrackerSettings,
};
use crate::io::message::{FieldPath, FieldReader, MessageSchema, SchemaError, ros2msg};

/// The values that a type of message is decoded into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Names and positions of joints: `sensor_msgs/JointState` and its like.
    Joints,
    /// Position and orientation: `geometry_msgs/PoseStamped` and its like.
    Pose,
    /// Position: `geometry_msgs/PointStamped` and its like.
    Point,
    /// `geometry_msgs/PoseWithCovarianceStamped`.
    PoseWithCovariance,
    /// An array of poses with names or numbers: markers that a camera sees.
    Markers,
    /// Such an array with covariances.
    MarkersWithCovariance,
    /// An array of positions without names: `geometry_msgs/PoseArray` and its like.
    Points,
    /// `sensor_msgs/Temperature`.
    Temperature,
    /// One length: `sensor_msgs/Range`, or a number alone.
    Length,
}

/// A message type that needs no field paths.
struct Common {
    names: &'static [&'static str],
    layout: Layout,
    stamp: &'static str,
    fields: &'static [&'static str],
}

/// The common types, each by its ROS 2 name and its protobuf or JSON name.
const COMMON: [Common; 15] = [
    Common {
        names: &["sensor_msgs/JointState"],
        layout: Layout::Joints,
        stamp: "header.stamp",
        fields: &["name", "position"],
    },
    Common {
        names: &["control_msgs/JointTrajectoryControllerState"],
        layout: Layout::Joints,
        stamp: "header.stamp",
        // ROS 2 Jazzy calls it feedback, Humble actual.
        fields: &["joint_names", "feedback|actual.positions"],
    },
    Common {
        names: &["foxglove.JointStates", "foxglove_msgs/JointStates"],
        layout: Layout::Joints,
        stamp: "timestamp",
        fields: &["joints[].name", "joints[].position"],
    },
    Common {
        names: &["geometry_msgs/PoseStamped"],
        layout: Layout::Pose,
        stamp: "header.stamp",
        fields: &POSE,
    },
    Common {
        names: &["foxglove.PoseInFrame", "foxglove_msgs/PoseInFrame"],
        layout: Layout::Pose,
        stamp: "timestamp",
        fields: &POSE,
    },
    Common {
        names: &["geometry_msgs/TransformStamped"],
        layout: Layout::Pose,
        stamp: "header.stamp",
        fields: &[
            "transform.translation.x",
            "transform.translation.y",
            "transform.translation.z",
            "transform.rotation.x",
            "transform.rotation.y",
            "transform.rotation.z",
            "transform.rotation.w",
        ],
    },
    Common {
        names: &["geometry_msgs/PointStamped"],
        layout: Layout::Point,
        stamp: "header.stamp",
        fields: &["point.x", "point.y", "point.z"],
    },
    Common {
        names: &["foxglove.Point3InFrame", "foxglove_msgs/Point3InFrame"],
        layout: Layout::Point,
        stamp: "timestamp",
        fields: &["point.x", "point.y", "point.z"],
    },
    Common {
        names: &["geometry_msgs/PoseWithCovarianceStamped"],
        layout: Layout::PoseWithCovariance,
        stamp: "header.stamp",
        fields: &[
            "pose.pose.position.x",
            "pose.pose.position.y",
            "pose.pose.position.z",
            "pose.pose.orientation.x",
            "pose.pose.orientation.y",
            "pose.pose.orientation.z",
            "pose.pose.orientation.w",
            "pose.covariance",
        ],
    },
    Common {
        names: &["tf2_msgs/TFMessage"],
        layout: Layout::Markers,
        stamp: "transforms[0].header.stamp",
        fields: &[
            "transforms[].child_frame_id",
            "transforms[].transform.translation.x",
            "transforms[].transform.translation.y",
            "transforms[].transform.translation.z",
            "transforms[].transform.rotation.x",
            "transforms[].transform.rotation.y",
            "transforms[].transform.rotation.z",
            "transforms[].transform.rotation.w",
        ],
    },
    Common {
        names: &["aruco_msgs/MarkerArray"],
        layout: Layout::MarkersWithCovariance,
        stamp: "header.stamp",
        fields: &[
            "markers[].id",
            "markers[].pose.pose.position.x",
            "markers[].pose.pose.position.y",
            "markers[].pose.pose.position.z",
            "markers[].pose.pose.orientation.x",
            "markers[].pose.pose.orientation.y",
            "markers[].pose.pose.orientation.z",
            "markers[].pose.pose.orientation.w",
            "markers[].pose.covariance",
        ],
    },
    Common {
        names: &["isaac_ros_apriltag_interfaces/AprilTagDetectionArray"],
        layout: Layout::MarkersWithCovariance,
        stamp: "header.stamp",
        fields: &[
            "detections[].id",
            "detections[].pose.pose.pose.position.x",
            "detections[].pose.pose.pose.position.y",
            "detections[].pose.pose.pose.position.z",
            "detections[].pose.pose.pose.orientation.x",
            "detections[].pose.pose.pose.orientation.y",
            "detections[].pose.pose.pose.orientation.z",
            "detections[].pose.pose.pose.orientation.w",
            "detections[].pose.pose.covariance",
        ],
    },
    Common {
        names: &["ros2_aruco_interfaces/ArucoMarkers"],
        layout: Layout::Markers,
        stamp: "header.stamp",
        fields: &[
            "marker_ids",
            "poses[].position.x",
            "poses[].position.y",
            "poses[].position.z",
            "poses[].orientation.x",
            "poses[].orientation.y",
            "poses[].orientation.z",
            "poses[].orientation.w",
        ],
    },
    Common {
        names: &["geometry_msgs/PoseArray"],
        layout: Layout::Points,
        stamp: "header.stamp",
        fields: &[
            "poses[].position.x",
            "poses[].position.y",
            "poses[].position.z",
        ],
    },
    Common {
        names: &["sensor_msgs/PointCloud"],
        layout: Layout::Points,
        stamp: "header.stamp",
        fields: &["points[].x", "points[].y", "points[].z"],
    },
];

const POSE: [&str; 7] = [
    "pose.position.x",
    "pose.position.y",
    "pose.position.z",
    "pose.orientation.x",
    "pose.orientation.y",
    "pose.orientation.z",
    "pose.orientation.w",
];

const TEMPERATURE: Common = Common {
    names: &["sensor_msgs/Temperature"],
    layout: Layout::Temperature,
    stamp: "header.stamp",
    fields: &["temperature"],
};

const LENGTHS: [Common; 2] = [
    Common {
        names: &["sensor_msgs/Range"],
        layout: Layout::Length,
        stamp: "header.stamp",
        fields: &["range"],
    },
    // They have no stamp: their time is that of publication or recording.
    Common {
        names: &["std_msgs/Float64", "std_msgs/Float32"],
        layout: Layout::Length,
        stamp: "header.stamp",
        fields: &["data"],
    },
];

/// Usual paths of the stamp in messages of other types, where the pipeline file names none.
const STAMPS: [&str; 2] = ["header.stamp", "timestamp"];
/// Entries of the covariance of each pose of an array.
const ENTRIES: usize = 36;
/// Fields of a time, in ROS 2, in protobuf, and in ROS 1 and JSON.
const TIME: [&str; 2] = ["sec|seconds|secs", "nanosec|nanos|nsec|nsecs"];

/// The first values of a row: the message's stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StampValues {
    /// None: the record's time is used.
    Record,
    /// Seconds and nanoseconds.
    Time,
    /// Seconds and nanoseconds or, in JSON, a date-time as text.
    TimeOrText,
    /// One number.
    Number(TimeUnit),
}

/// The values of a row after stamp and frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// An array of names, and an array of as many angles.
    NamedAngles,
    /// The angle of each joint of the arm.
    Angles,
    /// x, y, z; a quaternion where there is one; an array of covariances where there is one.
    Pose { orientation: bool, covariance: bool },
    /// Lists of x, y, z, of a quaternion where there is one, and of the 36 entries of a covariance where there is one: an element for each
    /// pose of an array.
    Poses { orientation: bool, covariance: bool },
    /// The temperature, °C.
    Temperature,
    /// The length of each instrument of the topic.
    Lengths,
}

/// The values that a stream takes from one channel's messages.
#[derive(Debug)]
pub(super) struct Recipe {
    pub(super) stamp: StampValues,
    /// The frame that the value after the stamp must name; `None` where it is not checked.
    pub(super) frame: Option<String>,
    /// Whether the value after the frame is the name or number of the target, or the array of those of each pose.
    pub(super) has_target: bool,
    pub(super) meaning: Meaning,
    pub(super) paths: Vec<FieldPath>,
    pub(super) reader: FieldReader,
}

/// The statements of the pipeline file about a stream's messages.
struct Statements<'m> {
    stamp: Option<&'m StampField>,
    frame: Option<&'m str>,
    frame_field: Option<&'m str>,
    named: Option<(Meaning, Vec<&'m str>)>,
    /// Path of the target's name.
    target: Option<&'m str>,
    ignore_orientation: bool,
}

impl Layout {
    /// The layout of a common type, named `pkg/msg/T` or `pkg/T` or as in protobuf; `None` for other types.
    pub(super) fn of_type(name: &str) -> Option<Self> {
        common(name).map(|common| common.layout)
    }

    /// Whether a stream can be made of it.
    pub const fn suits(self, stream: Stream) -> bool {
        match stream {
            Stream::Joints => matches!(self, Self::Joints),
            Stream::Readings
                if matches!(
                    self,
                    Self::Markers | Self::MarkersWithCovariance | Self::Points
                ) =>
            {
                true
            }
            Stream::Commands | Stream::Readings => {
                matches!(self, Self::Pose | Self::Point | Self::PoseWithCovariance)
            }
            Stream::Temperatures => matches!(self, Self::Temperature),
            Stream::Lengths => matches!(self, Self::Length),
        }
    }

    const fn meaning(self) -> Meaning {
        match self {
            Self::Joints => Meaning::NamedAngles,
            Self::Temperature => Meaning::Temperature,
            Self::Length => Meaning::Lengths,
            Self::Markers | Self::MarkersWithCovariance => Meaning::Poses {
                orientation: true,
                covariance: matches!(self, Self::MarkersWithCovariance),
            },
            Self::Points => Meaning::Poses {
                orientation: false,
                covariance: false,
            },
            Self::Pose | Self::Point | Self::PoseWithCovariance => Meaning::Pose {
                orientation: !matches!(self, Self::Point),
                covariance: matches!(self, Self::PoseWithCovariance),
            },
        }
    }
}

impl Common {
    /// The path of the targets' names, of an array of poses, and those of the other values.
    fn target_and_fields(&self) -> (Option<&'static str>, &'static [&'static str]) {
        match (self.layout, self.fields) {
            (Layout::Markers | Layout::MarkersWithCovariance, [target, fields @ ..]) => {
                (Some(target), fields)
            }
            (_, fields) => (None, fields),
        }
    }
}

fn common(name: &str) -> Option<&'static Common> {
    let name = ros2msg::short_name(name);
    let mut all = COMMON.iter().chain([&TEMPERATURE]).chain(&LENGTHS);
    all.find(|common| common.names.contains(&name.as_str()))
}

/// The values that can be read from messages without a pipeline file.
#[derive(Debug)]
pub struct Glance {
    /// Seconds and nanoseconds of the message's own stamp or, in JSON, its text in the third place; where it is in one of the
    /// usual places.
    pub stamp: Option<FieldReader>,
    /// The array of joint names, of the common types.
    pub joint_names: Option<FieldReader>,
    /// The array of joint angles or the three coordinates, of the common types.
    pub values: Option<FieldReader>,
}

impl Glance {
    /// The values that can be read from a channel's messages.
    pub fn of(encoding: &str, type_name: &str, language: &str, definition: &[u8]) -> Self {
        let schema = MessageSchema::read(encoding, type_name, language, definition);
        let schema = schema.and_then(Result::ok);
        let common = schema.as_ref().and_then(|_| common(type_name));
        let stamp = |schema: &MessageSchema| {
            let usual = STAMPS.into_iter().find(|stamp| has_time(schema, stamp));
            let path = FieldPath::parse(common.map(|common| common.stamp).or(usual)?).ok()?;
            let (_, paths) = time_at(&path, schema).ok()?;
            schema.reader(&paths).ok()
        };
        let names = |schema: &MessageSchema| {
            let joints = common.filter(|common| common.layout == Layout::Joints)?;
            schema
                .reader(&[FieldPath::parse(joints.fields[0]).ok()?])
                .ok()
        };
        let values = |schema: &MessageSchema| {
            let common = common?;
            let fields = match common.layout {
                Layout::Joints => common.fields.get(1..2)?,
                Layout::Pose | Layout::Point | Layout::PoseWithCovariance => {
                    common.fields.get(..3)?
                }
                Layout::Markers
                | Layout::MarkersWithCovariance
                | Layout::Points
                | Layout::Temperature
                | Layout::Length => {
                    return None;
                }
            };
            let paths = fields.iter().map(|field| FieldPath::parse(field));
            schema
                .reader(&paths.collect::<Result<Vec<_>, _>>().ok()?)
                .ok()
        };
        Self {
            values: schema.as_ref().and_then(values),
            stamp: schema.as_ref().and_then(stamp),
            joint_names: schema.as_ref().and_then(names),
        }
    }
}

/// Whether there is a time at this path, as far as the schema shows.
fn has_time(schema: &MessageSchema, path: &str) -> bool {
    let paths = FieldPath::parse(path).and_then(|path| time_at(&path, schema));
    paths.is_ok_and(|(_, paths)| paths.iter().any(|path| schema.has(path)))
}

/// The form of a time at this path, and the paths of its values.
fn time_at(
    path: &FieldPath,
    schema: &MessageSchema,
) -> Result<(StampValues, Vec<FieldPath>), SchemaError> {
    let mut paths = vec![path.join(TIME[0])?, path.join(TIME[1])?];
    if !matches!(schema, MessageSchema::Json(_)) {
        return Ok((StampValues::Time, paths));
    }
    paths.push(path.clone());
    Ok((StampValues::TimeOrText, paths))
}

impl Recipe {
    /// The recipe for a stream from messages of the type `name`; `None` where neither the type nor the pipeline file gives
    /// one.
    pub(super) fn resolve(
        wanted: &Wanted,
        mapping: &Mapping,
        name: &str,
        schema: &MessageSchema,
    ) -> Result<Option<Self>, SchemaError> {
        let (stream, time) = (wanted.stream, wanted.time);
        let is_named = mapping.tracker.names_on(&wanted.topic);
        let mut said = Statements::of(wanted, mapping);
        said.target = said.target.filter(|_| is_named);
        let common = common(name).filter(|common| common.layout.suits(stream));
        let (meaning, fields, target) = match (&said.named, common) {
            (Some((meaning, fields)), _) => (*meaning, fields.clone(), said.target),
            (None, Some(common)) => {
                let (target, fields) = common.target_and_fields();
                (
                    common.layout.meaning(),
                    fields.to_vec(),
                    target.or(said.target),
                )
            }
            (None, None) => return Ok(None),
        };
        let is_array = matches!(meaning, Meaning::Poses { .. });
        let by_geometry = is_array && !mapping.tracker.targets_by_geometry.is_empty();
        let target = target.filter(|_| !by_geometry);
        if is_array && !by_geometry && (!is_named || target.is_none()) {
            // Nothing says which of the poses is the target's.
            return Ok(None);
        }
        let positions_alone = said.ignore_orientation || by_geometry;
        let (meaning, mut fields) = without_orientation(meaning, fields, positions_alone);
        let stamp_path = said.stamp_path(common, schema)?;
        let mut paths = Vec::new();
        let stamp = match (time, said.stamp) {
            (TimeSource::Publish | TimeSource::Log, _) => StampValues::Record,
            (TimeSource::Header, Some(StampField::Number(number))) => {
                paths.push(FieldPath::parse(&number.field)?);
                StampValues::Number(number.unit)
            }
            (TimeSource::Header, _) => {
                let (stamp, parts) = time_at(&stamp_path, schema)?;
                paths.extend(parts);
                stamp
            }
        };
        if said.frame.is_some() {
            paths.push(match said.frame_field {
                Some(field) => FieldPath::parse(field)?,
                None => beside(&stamp_path, "frame_id")?,
            });
        }
        if let Some(field) = target {
            paths.push(FieldPath::parse(field)?);
        }
        let entries = fields.split_off(match meaning {
            Meaning::Poses {
                covariance: true, ..
            } => fields.len() - 1,
            _ => fields.len(),
        });
        for field in fields {
            paths.push(FieldPath::parse(field)?);
        }
        for covariance in entries {
            let entry = |place| FieldPath::parse(&format!("{covariance}[{place}]"));
            let entries = (0..ENTRIES).map(entry);
            paths.extend(entries.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(Some(Self {
            has_target: target.is_some(),
            stamp,
            frame: said.frame.map(str::to_owned),
            meaning,
            reader: schema.reader(&paths)?,
            paths,
        }))
    }
}

impl<'m> Statements<'m> {
    fn of(wanted: &Wanted, mapping: &'m Mapping) -> Self {
        let tracker = &mapping.tracker;
        match (wanted.stream, &mapping.commanded) {
            (Stream::Commands, Some(commanded)) => {
                Self::of_poses(&commanded.fields, commanded.frame.as_deref(), false)
            }
            // Commands are wanted only where the pipeline file has them.
            (Stream::Joints, _) | (Stream::Commands, None) => {
                Self::of_joints(&mapping.controller.fields)
            }
            (Stream::Readings, _) => Self::of_poses(
                &tracker.fields,
                tracker.frame.as_deref(),
                tracker.ignore_orientation,
            ),
            (Stream::Lengths, _) => Self::of_lengths(tracker, &wanted.topic),
            (Stream::Temperatures, _) => {
                let field = tracker.fields.temperature.as_deref();
                Self {
                    stamp: tracker.fields.stamp.as_ref(),
                    frame: None,
                    frame_field: None,
                    named: field.map(|field| (Meaning::Temperature, vec![field])),
                    target: None,
                    ignore_orientation: false,
                }
            }
        }
    }

    /// Those about the lengths on a topic.
    fn of_lengths(tracker: &'m TrackerSettings, topic: &str) -> Self {
        let own = tracker.lengths.iter().filter(|own| own.topic == topic);
        let own: Vec<&LoggedLength> = own.collect();
        let fields = own.iter().filter_map(|own| own.field.as_deref());
        let fields: Vec<&str> = fields.collect();
        Self {
            stamp: own.first().and_then(|own| own.stamp.as_ref()),
            frame: None,
            frame_field: None,
            named: (fields.len() == own.len()).then_some((Meaning::Lengths, fields)),
            target: None,
            ignore_orientation: false,
        }
    }

    fn of_joints(fields: &'m JointFields) -> Self {
        let names = fields.names.as_deref();
        let named = match (names, &fields.angles) {
            (Some(names), Some(AngleFields::Array(angles))) => {
                Some((Meaning::NamedAngles, vec![names, angles.as_str()]))
            }
            (None, Some(AngleFields::Each(angles))) => {
                Some((Meaning::Angles, angles.iter().map(String::as_str).collect()))
            }
            _ => None,
        };
        Self {
            stamp: fields.stamp.as_ref(),
            frame: None,
            frame_field: None,
            named,
            target: None,
            ignore_orientation: false,
        }
    }

    fn of_poses(fields: &'m PoseFields, frame: Option<&'m str>, ignore_orientation: bool) -> Self {
        let named = fields.position().map(|position| {
            let orientation = fields.orientation();
            let covariance = fields.covariance.as_deref();
            let (orientation_is, covariance_is) = (orientation.is_some(), covariance.is_some());
            let meaning = if fields.is_of_each() {
                Meaning::Poses {
                    orientation: orientation_is,
                    covariance: covariance_is,
                }
            } else {
                Meaning::Pose {
                    orientation: orientation_is,
                    covariance: covariance_is,
                }
            };
            let rest = orientation.into_iter().flatten().chain(covariance);
            (meaning, position.into_iter().chain(rest).collect())
        });
        Self {
            stamp: fields.stamp.as_ref(),
            frame,
            frame_field: fields.frame.as_deref(),
            named,
            target: fields.target.as_deref(),
            ignore_orientation,
        }
    }

    /// The path of the message's own stamp: the one that the pipeline file names, or that of the common type, or else one
    /// of the usual paths.
    fn stamp_path(
        &self,
        common: Option<&Common>,
        schema: &MessageSchema,
    ) -> Result<FieldPath, SchemaError> {
        if let Some(StampField::Time(path)) = self.stamp {
            return FieldPath::parse(path);
        }
        if let Some(common) = common {
            return FieldPath::parse(common.stamp);
        }
        let usual = STAMPS.into_iter().find(|stamp| has_time(schema, stamp));
        FieldPath::parse(usual.unwrap_or(STAMPS[0]))
    }
}

/// The path of another field in the same message.
fn beside(path: &FieldPath, name: &str) -> Result<FieldPath, SchemaError> {
    let path = path.to_string();
    let inside = path.rsplit_once('.').map(|(inside, _)| inside);
    FieldPath::parse(&inside.map_or_else(|| name.to_owned(), |inside| format!("{inside}.{name}")))
}

fn without_orientation(
    meaning: Meaning,
    mut fields: Vec<&str>,
    ignore: bool,
) -> (Meaning, Vec<&str>) {
    match meaning {
        Meaning::Pose {
            orientation: true,
            covariance,
        } if ignore => {
            fields.drain(3..7);
            let meaning = Meaning::Pose {
                orientation: false,
                covariance,
            };
            (meaning, fields)
        }
        Meaning::Poses {
            orientation: true,
            covariance,
        } if ignore => {
            fields.drain(3..7);
            let meaning = Meaning::Poses {
                orientation: false,
                covariance,
            };
            (meaning, fields)
        }
        other => (other, fields),
    }
}

/// The names of message types that suit a stream, for an error.
pub(super) const fn suitable_types(stream: Stream) -> &'static str {
    match stream {
        Stream::Joints => {
            "sensor_msgs/msg/JointState, control_msgs/msg/JointTrajectoryControllerState and foxglove.JointStates"
        }
        Stream::Commands | Stream::Readings => {
            "geometry_msgs/msg/PoseStamped, PointStamped, PoseWithCovarianceStamped and TransformStamped, \
             foxglove.PoseInFrame and Point3InFrame; of markers, with [[tracker.targets]], tf2_msgs/msg/TFMessage, \
             aruco_msgs/msg/MarkerArray, ros2_aruco_interfaces/msg/ArucoMarkers and \
             isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray; of targets_by_geometry, geometry_msgs/msg/PoseArray and \
             sensor_msgs/msg/PointCloud too"
        }
        Stream::Temperatures => "sensor_msgs/msg/Temperature",
        Stream::Lengths => "sensor_msgs/msg/Range, std_msgs/msg/Float64 and Float32",
    }
}
