//! The message types that need no field paths, and the streams that can be made of them.

use super::Stream;
use super::layout::{Meaning, PoseParts};
use crate::message::rosmsg;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Names and positions of joints: `sensor_msgs/JointState` and its like.
    Joints,
    /// Position and orientation: `geometry_msgs/PoseStamped` and its like.
    Pose,
    /// Position: `geometry_msgs/PointStamped` and its like.
    Point,
    PoseWithCovariance,
    /// An array of poses with names or numbers: markers that a camera sees.
    Markers,
    /// Such an array with covariances.
    MarkersWithCovariance,
    Temperature,
    /// One length: `sensor_msgs/Range`, or a number alone.
    Length,
}

pub(super) struct Common {
    names: &'static [&'static str],
    pub(super) layout: Layout,
    pub(super) stamp: &'static str,
    /// Paths of the values; one that ends in `.xyz` or `.xyzw` stands for a path to each letter.
    fields: &'static [&'static str],
}

const HEADER: &str = "header.stamp";

const fn of(
    names: &'static [&'static str],
    layout: Layout,
    stamp: &'static str,
    fields: &'static [&'static str],
) -> Common {
    Common { names, layout, stamp, fields }
}

/// The common types, each by its ROS 2 name and its protobuf or JSON name.
const COMMON: [Common; 13] = [
    of(&["sensor_msgs/JointState"], Layout::Joints, HEADER, &["name", "position"]),
    // ROS 2 Jazzy calls it feedback, Humble actual.
    of(
        &["control_msgs/JointTrajectoryControllerState"],
        Layout::Joints,
        HEADER,
        &["joint_names", "feedback|actual.positions"],
    ),
    of(
        &["foxglove.JointStates", "foxglove_msgs/JointStates"],
        Layout::Joints,
        "timestamp",
        &["joints[].name", "joints[].position"],
    ),
    of(
        &["geometry_msgs/PoseStamped"],
        Layout::Pose,
        HEADER,
        &["pose.position.xyz", "pose.orientation.xyzw"],
    ),
    of(
        &["foxglove.PoseInFrame", "foxglove_msgs/PoseInFrame"],
        Layout::Pose,
        "timestamp",
        &["pose.position.xyz", "pose.orientation.xyzw"],
    ),
    of(
        &["geometry_msgs/TransformStamped"],
        Layout::Pose,
        HEADER,
        &["transform.translation.xyz", "transform.rotation.xyzw"],
    ),
    of(&["geometry_msgs/PointStamped"], Layout::Point, HEADER, &["point.xyz"]),
    of(
        &["foxglove.Point3InFrame", "foxglove_msgs/Point3InFrame"],
        Layout::Point,
        "timestamp",
        &["point.xyz"],
    ),
    of(
        &["geometry_msgs/PoseWithCovarianceStamped"],
        Layout::PoseWithCovariance,
        HEADER,
        &["pose.pose.position.xyz", "pose.pose.orientation.xyzw", "pose.covariance"],
    ),
    of(
        &["tf2_msgs/TFMessage", "tf/tfMessage"],
        Layout::Markers,
        "transforms[0].header.stamp",
        &[
            "transforms[].child_frame_id",
            "transforms[].transform.translation.xyz",
            "transforms[].transform.rotation.xyzw",
        ],
    ),
    of(
        &["aruco_msgs/MarkerArray"],
        Layout::MarkersWithCovariance,
        HEADER,
        &[
            "markers[].id",
            "markers[].pose.pose.position.xyz",
            "markers[].pose.pose.orientation.xyzw",
            "markers[].pose.covariance",
        ],
    ),
    of(
        &["isaac_ros_apriltag_interfaces/AprilTagDetectionArray"],
        Layout::MarkersWithCovariance,
        HEADER,
        &[
            "detections[].id",
            "detections[].pose.pose.pose.position.xyz",
            "detections[].pose.pose.pose.orientation.xyzw",
            "detections[].pose.pose.covariance",
        ],
    ),
    of(
        &["ros2_aruco_interfaces/ArucoMarkers"],
        Layout::Markers,
        HEADER,
        &["marker_ids", "poses[].position.xyz", "poses[].orientation.xyzw"],
    ),
];

const TEMPERATURE: Common =
    of(&["sensor_msgs/Temperature"], Layout::Temperature, HEADER, &["temperature"]);

const LENGTHS: [Common; 2] = [
    of(&["sensor_msgs/Range"], Layout::Length, HEADER, &["range"]),
    // They have no stamp: their time is that of publication or recording.
    of(&["std_msgs/Float64", "std_msgs/Float32"], Layout::Length, HEADER, &["data"]),
];

impl Layout {
    /// The layout of a common type, named `pkg/msg/T` or `pkg/T` or as in protobuf; `None` for other types.
    pub(super) fn of_type(name: &str) -> Option<Self> {
        common(name).map(|common| common.layout)
    }

    pub const fn suits(self, stream: Stream) -> bool {
        match stream {
            Stream::Joints => matches!(self, Self::Joints),
            Stream::Readings if matches!(self, Self::Markers | Self::MarkersWithCovariance) => true,
            Stream::Commands | Stream::Readings => {
                matches!(self, Self::Pose | Self::Point | Self::PoseWithCovariance)
            }
            Stream::Temperatures => matches!(self, Self::Temperature),
            Stream::Lengths => matches!(self, Self::Length),
        }
    }

    pub(super) const fn meaning(self) -> Meaning {
        let has_covariance = matches!(self, Self::PoseWithCovariance | Self::MarkersWithCovariance);
        let parts =
            PoseParts { orientation: !matches!(self, Self::Point), covariance: has_covariance };
        match self {
            Self::Joints => Meaning::NamedAngles,
            Self::Temperature => Meaning::Temperature,
            Self::Length => Meaning::Lengths,
            Self::Markers | Self::MarkersWithCovariance => Meaning::Poses(parts),
            Self::Pose | Self::Point | Self::PoseWithCovariance => Meaning::Pose(parts),
        }
    }
}

impl Common {
    /// The path of each value.
    pub(super) fn fields(&self) -> Vec<String> {
        let each = |path: &&str| match path.rsplit_once('.') {
            Some((place, letters @ ("xyz" | "xyzw"))) => {
                letters.chars().map(|letter| format!("{place}.{letter}")).collect()
            }
            _ => vec![(*path).to_owned()],
        };
        self.fields.iter().flat_map(each).collect()
    }

    /// The path of the targets' names, of an array of poses, and those of the other values.
    pub(super) fn target_and_fields(&self) -> (Option<&'static str>, Vec<String>) {
        let is_array = matches!(self.layout, Layout::Markers | Layout::MarkersWithCovariance);
        let target = self.fields.first().copied().filter(|_| is_array);
        (target, self.fields().split_off(usize::from(is_array)))
    }
}

pub(super) fn common(name: &str) -> Option<&'static Common> {
    let name = rosmsg::short_name(name);
    let mut all = COMMON.iter().chain([&TEMPERATURE]).chain(&LENGTHS);
    all.find(|common| common.names.contains(&name.as_str()))
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
             isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray. Arrays without names, such as geometry_msgs/msg/PoseArray of \
             motion capture, do not say which element is which reflector: log each on a topic of its own or with its name, and list \
             them in [[tracker.targets]]"
        }
        Stream::Temperatures => "sensor_msgs/msg/Temperature",
        Stream::Lengths => "sensor_msgs/msg/Range, std_msgs/msg/Float64 and Float32",
    }
}
