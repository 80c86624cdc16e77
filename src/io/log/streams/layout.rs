//! The common message types: which fields are read of each, and which stream it can be.

use super::Stream;
use crate::io::message::ros2msg;

/// What a type of message is decoded as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `sensor_msgs/JointState`.
    Joints,
    /// `geometry_msgs/PoseStamped`.
    Pose,
    /// `geometry_msgs/PointStamped`.
    Point,
    /// `geometry_msgs/PoseWithCovarianceStamped`.
    PoseWithCovariance,
    /// `sensor_msgs/Temperature`.
    Temperature,
}

impl Layout {
    /// The layout of a common type, named `pkg/msg/T` or `pkg/T`.
    pub fn of_type(name: &str) -> Option<Self> {
        Some(match ros2msg::short_name(name).as_str() {
            "sensor_msgs/JointState" => Self::Joints,
            "geometry_msgs/PoseStamped" => Self::Pose,
            "geometry_msgs/PointStamped" => Self::Point,
            "geometry_msgs/PoseWithCovarianceStamped" => Self::PoseWithCovariance,
            "sensor_msgs/Temperature" => Self::Temperature,
            _ => return None,
        })
    }

    /// Whether a stream can be made of it.
    pub const fn suits(self, stream: Stream) -> bool {
        match stream {
            Stream::Joints => matches!(self, Self::Joints),
            Stream::Commands | Stream::Readings => {
                matches!(self, Self::Pose | Self::Point | Self::PoseWithCovariance)
            }
            Stream::Temperatures => matches!(self, Self::Temperature),
        }
    }

    /// Paths of the fields that are read.
    pub const fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Joints => &["name", "position"],
            Self::Pose => &[
                "pose.position.x",
                "pose.position.y",
                "pose.position.z",
                "pose.orientation.x",
                "pose.orientation.y",
                "pose.orientation.z",
                "pose.orientation.w",
            ],
            Self::Point => &["point.x", "point.y", "point.z"],
            Self::PoseWithCovariance => &[
                "pose.pose.position.x",
                "pose.pose.position.y",
                "pose.pose.position.z",
                "pose.pose.orientation.x",
                "pose.pose.orientation.y",
                "pose.pose.orientation.z",
                "pose.pose.orientation.w",
                "pose.covariance",
            ],
            Self::Temperature => &["temperature"],
        }
    }
}

/// What a stream's message types are called, for an error.
pub const fn suitable_types(stream: Stream) -> &'static str {
    match stream {
        Stream::Joints => "sensor_msgs/msg/JointState",
        Stream::Commands | Stream::Readings => {
            "geometry_msgs/msg/PoseStamped, PointStamped and PoseWithCovarianceStamped"
        }
        Stream::Temperatures => "sensor_msgs/msg/Temperature",
    }
}
