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
";
const QUATERNION: &str = "\
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

/// The topic of messages of a header and these fields, whose types are defined in this order.
fn topic(name: &str, schema: &'static str, fields: &str, types: &str) -> Topic {
    let definition = format!("std_msgs/Header header\n{fields}{HEADER}{types}");
    Topic { name: name.to_owned(), schema, definition }
}

pub(super) fn joint_topic() -> Topic {
    let fields = "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
    topic("/joint_states", "sensor_msgs/msg/JointState", fields, "")
}

pub(super) fn pose_topic(name: &str) -> Topic {
    let types = format!("{POSE}{QUATERNION}{POINT}");
    topic(name, "geometry_msgs/msg/PoseStamped", "geometry_msgs/Pose pose\n", &types)
}

/// Poses that state their covariance; positions alone have no rotation, and `ignore_orientation` leaves it out.
pub(super) fn covariance_topic() -> Topic {
    let covariance = "\
================================================================================
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
";
    let schema = "geometry_msgs/msg/PoseWithCovarianceStamped";
    let fields = "geometry_msgs/PoseWithCovariance pose\n";
    let types = format!("{covariance}{POSE}{QUATERNION}{POINT}");
    topic("/tracker/pose_with_covariance", schema, fields, &types)
}

pub(super) fn point_topic() -> Topic {
    let fields = "geometry_msgs/Point point\n";
    topic("/tracker/point", "geometry_msgs/msg/PointStamped", fields, POINT)
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
    let fields = "string child_frame_id\ngeometry_msgs/Transform transform\n";
    let types = format!("{transform}{QUATERNION}");
    topic("/tracker/targets", "geometry_msgs/msg/TransformStamped", fields, &types)
}

pub(super) fn temperature_topic() -> Topic {
    let fields = "float64 temperature\nfloat64 variance\n";
    topic("/tracker/temperature", "sensor_msgs/msg/Temperature", fields, "")
}

pub(super) fn length_topic(name: &str) -> Topic {
    let fields = "uint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\n";
    topic(&format!("/lengths/{name}"), "sensor_msgs/msg/Range", fields, "")
}
