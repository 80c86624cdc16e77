//! `fields` of the pipeline file: paths of a stream's values in messages that are not of a common type.
//!
//! A path is a field's name, then the names inside it separated by dots, `[2]` for an element of an array (counted from 0),
//! `[]` for each element: `pose.position.x`, `joints[2].angle`, `joints[].name`.

use serde::{Deserialize, Serialize};

/// `fields` of `[controller]`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointFields {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stamp: Option<StampField>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub names: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angles: Option<AngleFields>,
}

/// Paths of the joint angles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "angles has to be the path of an array (with names), or a list with the path of each joint's angle"
)]
pub enum AngleFields {
    /// The path of an array in the order of the array of names.
    Array(String),
    /// A path for each joint of the arm, in the arm's order.
    Each(Vec<String>),
}

#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseFields {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stamp: Option<StampField>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub qx: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub qy: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub qz: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub qw: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<String>,
}

/// Path of a message's own stamp.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "stamp has to be the path of a time (seconds and nanoseconds), or of a number with its unit: { field = \
                 \"t\", unit = \"ns\" }, unit \"s\", \"ms\", \"us\" or \"ns\""
)]
pub enum StampField {
    Time(String),
    Number(NumberStamp),
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberStamp {
    pub field: String,
    pub unit: TimeUnit,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    S,
    Ms,
    Us,
    Ns,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrongFields {
    pub key: &'static str,
    pub found: String,
    pub wanted: String,
}

impl TimeUnit {
    pub const fn to_ns(self) -> i64 {
        match self {
            Self::S => 1_000_000_000,
            Self::Ms => 1_000_000,
            Self::Us => 1000,
            Self::Ns => 1,
        }
    }
}

impl StampField {
    pub fn path(&self) -> &str {
        match self {
            Self::Time(path) => path,
            Self::Number(number) => &number.field,
        }
    }
}

impl JointFields {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    pub fn paths(&self) -> Vec<&str> {
        let stamp = self.stamp.iter().map(StampField::path);
        let angles = match &self.angles {
            None => &[],
            Some(AngleFields::Array(path)) => std::slice::from_ref(path),
            Some(AngleFields::Each(paths)) => paths,
        };
        stamp.chain(self.names.iter().chain(angles).map(String::as_str)).collect()
    }

    /// Checks that the paths fit together and an arm of `joints` joints.
    pub fn check(&self, joints: usize) -> Result<(), WrongFields> {
        let wrong = |key, found: &str, wanted: String| {
            Err(WrongFields { key, found: found.to_owned(), wanted })
        };
        match (&self.names, &self.angles) {
            (Some(_), None) => {
                return wrong(
                    "fields.angles",
                    "nothing",
                    "the array that goes with names".to_owned(),
                );
            }
            (None, Some(AngleFields::Array(path))) => {
                let wanted = "a list with the path of each joint's angle, or `names` in addition: the order of joints in an \
                              array is not fixed"
                    .to_owned();
                return wrong("fields.angles", &format!("{path:?}"), wanted);
            }
            (Some(_), Some(AngleFields::Each(_))) => {
                let wanted = "left out where angles lists a path for each joint".to_owned();
                return wrong("fields.names", "given", wanted);
            }
            (None, Some(AngleFields::Each(paths))) if paths.len() != joints => {
                let wanted =
                    format!("one path for each of the arm's {joints} joints, in its order");
                return wrong("fields.angles", &format!("{} paths", paths.len()), wanted);
            }
            _ => {}
        }
        named_once(&self.paths())
    }
}

impl PoseFields {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The paths of x, y and z; `None` unless all are given.
    pub fn position(&self) -> Option<[&str; 3]> {
        Some([self.x.as_deref()?, self.y.as_deref()?, self.z.as_deref()?])
    }

    /// The paths of the quaternion's x, y, z and w; `None` unless all are given.
    pub fn orientation(&self) -> Option<[&str; 4]> {
        Some([self.qx.as_deref()?, self.qy.as_deref()?, self.qz.as_deref()?, self.qw.as_deref()?])
    }

    /// Whether the position is that of each element of an array.
    pub fn is_of_each(&self) -> bool {
        self.x.as_ref().is_some_and(|x| x.contains("[]"))
    }

    fn pose_paths(&self) -> Vec<&str> {
        let pose = [&self.x, &self.y, &self.z, &self.qx, &self.qy, &self.qz, &self.qw];
        let rest = [&self.frame, &self.target, &self.covariance];
        pose.into_iter().chain(rest).filter_map(Option::as_deref).collect()
    }

    pub fn paths(&self) -> Vec<&str> {
        let stamp = self.stamp.as_ref().map(StampField::path);
        self.pose_paths().into_iter().chain(stamp).chain(self.temperature.as_deref()).collect()
    }

    pub fn check(&self) -> Result<(), WrongFields> {
        let given =
            |fields: &[&Option<String>]| fields.iter().filter(|field| field.is_some()).count();
        let position = given(&[&self.x, &self.y, &self.z]);
        let orientation = given(&[&self.qx, &self.qy, &self.qz, &self.qw]);
        let wrong = |found: String, wanted: &str| {
            Err(WrongFields { key: "fields", found, wanted: wanted.to_owned() })
        };
        if !matches!(position, 0 | 3) {
            return wrong(
                format!("{position} of x, y, z"),
                "all of x, y and z, or none for a common type",
            );
        }
        if !matches!(orientation, 0 | 4) {
            return wrong(
                format!("{orientation} of qx, qy, qz, qw"),
                "all of qx, qy, qz and qw, or none where there is no orientation",
            );
        }
        if self.is_of_each() && self.target.is_none() {
            return wrong(
                "paths through an array of poses".to_owned(),
                "target, the path of the name or number by which [tracker] targets tells its elements",
            );
        }
        if position == 0 && (orientation > 0 || self.covariance.is_some()) {
            return wrong(
                "no x, y, z".to_owned(),
                "x, y and z where other fields of the pose are named",
            );
        }
        named_once(&self.pose_paths())
    }
}

/// Checks that no path is given for two values, which would be a mistake.
fn named_once(paths: &[&str]) -> Result<(), WrongFields> {
    let twice = (1..paths.len()).find(|&i| paths[..i].contains(&paths[i]));
    twice.map_or(Ok(()), |i| {
        Err(WrongFields {
            key: "fields",
            found: format!("{:?} twice", paths[i]),
            wanted: "a field of its own for each".to_owned(),
        })
    })
}
