//! The topics of the logs and their message definitions, as ROS 2 embeds them.

const HEADER: &str = "\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";
const POINT: &str = "\
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
";
const POSE: &str = "\
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";

pub(super) struct Topic {
    pub(super) name: String,
    pub(super) schema: &'static str,
    pub(super) definition: String,
}

pub(super) fn joint_topic() -> Topic {
    let fields = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
    Topic {
        name: "/joint_states".to_owned(),
        schema: "sensor_msgs/msg/JointState",
        definition: format!("{fields}{HEADER}"),
    }
}

pub(super) fn pose_topic(name: &str) -> Topic {
    Topic {
        name: name.to_owned(),
        schema: "geometry_msgs/msg/PoseStamped",
        definition: format!(
            "std_msgs/Header header\ngeometry_msgs/Pose pose\n{HEADER}{POSE}{POINT}"
        ),
    }
}

/// Poses that state their covariance; positions alone have no rotation, and `ignore_orientation` leaves it out.
pub(super) fn covariance_topic() -> Topic {
    let covariance = "\
================================================================================
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
";
    Topic {
        name: "/tracker/pose_with_covariance".to_owned(),
        schema: "geometry_msgs/msg/PoseWithCovarianceStamped",
        definition: format!(
            "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n{HEADER}{covariance}{POSE}{POINT}"
        ),
    }
}

pub(super) fn point_topic() -> Topic {
    Topic {
        name: "/tracker/point".to_owned(),
        schema: "geometry_msgs/msg/PointStamped",
        definition: format!("std_msgs/Header header\ngeometry_msgs/Point point\n{HEADER}{POINT}"),
    }
}

/// Transforms to targets that each message names.
pub(super) fn targets_topic() -> Topic {
    let transform = "\
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";
    let quaternion = "\
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";
    Topic {
        name: "/tracker/targets".to_owned(),
        schema: "geometry_msgs/msg/TransformStamped",
        definition: format!(
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n{HEADER}{transform}{quaternion}"
        ),
    }
}

pub(super) fn temperature_topic() -> Topic {
    Topic {
        name: "/tracker/temperature".to_owned(),
        schema: "sensor_msgs/msg/Temperature",
        definition: format!(
            "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n{HEADER}"
        ),
    }
}

/// Readings of an instrument of one length.
pub(super) fn length_topic(name: &str) -> Topic {
    Topic {
        name: format!("/lengths/{name}"),
        schema: "sensor_msgs/msg/Range",
        definition: format!(
            "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\n\
             float32 range\n{HEADER}"
        ),
    }
}
