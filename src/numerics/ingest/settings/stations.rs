//! `[stations]`: the columns of a table of stations, for sessions that were recorded as tables instead of logs.
//!
//! A row is a station, or in the long form (`station`, `target`) a reading of one target at a station. A column is named as in the
//! table's header; a value may be a sum or difference of columns and numbers, with blanks around `+` and `-`: `"x_t + x_dif"`.
//! Units and orders of angles have no default: few tables state them.

use std::fmt;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use super::{AngleUnit, LengthColumns, LengthUnit};
use nalgebra::{UnitQuaternion, Vector3};

use crate::geometry::{Placement, RotationOrder};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationsSettings {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separator: Option<char>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decimal: Option<char>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheet: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub header: Option<u64>,
    pub joints: Vec<String>,
    pub joint_unit: AngleUnit,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_unit: Option<LengthUnit>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// Names of the targets in the column `target`, the main one first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<String>,
    /// When a station was measured. Absent: stations are in the order of the rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeColumn>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<String>,
    #[serde(default = "missing")]
    pub missing: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commanded: Option<PoseColumns>,
    /// The controller's tool at the flange, where there are no commands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flange_from_tool: Option<Placement>,
    /// The reading of the target, or of each of several, the main one first; empty where lengths alone are read.
    #[serde(default, deserialize_with = "one_or_several", skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<ReadingColumns>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<ReferenceColumns>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lengths: Vec<LengthColumns>,
}

/// Numbers that instruments and spreadsheets write for a missing reading, where `missing` states none.
pub const MISSING: [f64; 2] = [9999.0, -9999.0];

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    pub column: String,
    pub unit: TableTime,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TableTime {
    S,
    Ms,
    Us,
    Ns,
    /// A date and a time as ISO 8601 writes them; without an offset in UTC.
    Iso8601,
    /// `month/day/year` of four digits or two, and a time, UTC.
    #[serde(rename = "mm/dd/yy")]
    MonthDay,
    /// `day.month.year`, and a time, UTC.
    #[serde(rename = "dd.mm.yy")]
    DayMonth,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseColumns {
    pub position: [String; 3],
    pub unit: LengthUnit,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<OrientationColumns>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadingColumns {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    pub position: [String; 3],
    pub unit: LengthUnit,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<[String; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceColumns>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<OrientationColumns>,
}

/// Columns of a covariance: the six on and above the diagonal of a position's, row by row; or the 21 of a pose's (x, y, z and the rotation
/// about the axes x, y, z of the instrument's frame), or all its 36.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>")]
pub struct CovarianceColumns(Vec<String>);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "a covariance has 6 columns (xx, xy, xz, yy, yz, zz of a position), or 21 (on and above the diagonal of x, y, z and three rotations, \
     row by row), or 36 (all of it); found {0}"
)]
pub struct CovarianceError(usize);

impl CovarianceColumns {
    pub fn columns(&self) -> &[String] {
        &self.0
    }
}

impl TryFrom<Vec<String>> for CovarianceColumns {
    type Error = CovarianceError;
    fn try_from(columns: Vec<String>) -> Result<Self, CovarianceError> {
        match columns.len() {
            6 | 21 | 36 => Ok(Self(columns)),
            other => Err(CovarianceError(other)),
        }
    }
}

/// A reference reflector: its name, what it stands on, and its columns.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceColumns {
    pub name: String,
    pub on: StandsOn,
    /// x, y and z in the instrument's frame; absent in a long table, whose rows have the columns of `measured`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[String; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<LengthUnit>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StandsOn {
    /// The robot's base: it shows where the base is in the instrument's frame.
    Base,
    /// The floor: it shows where the instrument is.
    Floor,
}

impl StandsOn {
    pub const fn word(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Floor => "floor",
        }
    }

    /// What moves where references on it do.
    pub const fn moves(self) -> &'static str {
        match self {
            Self::Base => "the base or the instrument",
            Self::Floor => "the instrument",
        }
    }
}

/// Columns of an orientation, in one of four forms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "OrientationKeys", into = "OrientationKeys")]
pub struct OrientationColumns {
    pub form: OrientationForm,
    /// Standard deviation about each axis, one column or three, in the unit of the angles (rad of a quaternion or matrix).
    pub sd: Vec<String>,
    /// Covariance xx, xy, xz, yy, yz, zz of the rotation about the axes of the instrument's frame, in the square of that unit; it replaces
    /// the instrument's uncertainty. Empty where there is none.
    pub covariance: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum OrientationForm {
    Quaternion([String; 4]),
    /// Three angles, with the order of their axes.
    Angles([String; 3], RotationOrder, AngleUnit),
    /// A rotation vector: the axis, as long as the angle.
    Vector([String; 3], AngleUnit),
    Matrix([String; 9]),
}

impl OrientationForm {
    /// The rotation of three numbers; `None` of a form with more.
    pub fn rotation(&self, numbers: [f64; 3]) -> Option<UnitQuaternion<f64>> {
        match self {
            Self::Angles(_, order, unit) => {
                Some(order.rotation(numbers.map(|number| unit.to_rad() * number)))
            }
            Self::Vector(_, unit) => {
                Some(UnitQuaternion::from_scaled_axis(unit.to_rad() * Vector3::from(numbers)))
            }
            Self::Quaternion(_) | Self::Matrix(_) => None,
        }
    }

    /// Three numbers that make a rotation; `None` of a form with more.
    pub fn numbers(&self, rotation: &UnitQuaternion<f64>) -> Option<[f64; 3]> {
        let (numbers, unit) = match self {
            Self::Angles(_, order, unit) => (order.angles(rotation), unit),
            Self::Vector(_, unit) => (rotation.scaled_axis().into(), unit),
            Self::Quaternion(_) | Self::Matrix(_) => return None,
        };
        Some(numbers.map(|number| number / unit.to_rad()))
    }

    /// The other forms that the same three columns may have, each with its words.
    pub fn others(&self) -> Vec<(Self, String)> {
        let (Self::Angles(columns, ..) | Self::Vector(columns, _)) = self else {
            return Vec::new();
        };
        let of_unit = |unit: AngleUnit| {
            let word = if unit == AngleUnit::Rad { "rad" } else { "deg" };
            let angles = RotationOrder::all().map(move |order| {
                let words = format!("order = \"{}\", unit = \"{word}\"", String::from(order));
                (Self::Angles(columns.clone(), order, unit), words)
            });
            let vector = format!("rotation_vector in place of angles, unit = \"{word}\"");
            angles.chain([(Self::Vector(columns.clone(), unit), vector)])
        };
        let all = [AngleUnit::Deg, AngleUnit::Rad].into_iter().flat_map(of_unit);
        all.filter(|(other, _)| other != self).collect()
    }

    pub fn columns(&self) -> &[String] {
        match self {
            Self::Quaternion(own) => own,
            Self::Angles(own, ..) | Self::Vector(own, _) => own,
            Self::Matrix(own) => own,
        }
    }
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct OrientationKeys {
    #[serde(skip_serializing_if = "Option::is_none")]
    quaternion_xyzw: Option<[String; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    angles: Option<[String; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    order: Option<RotationOrder>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rotation_vector: Option<[String; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    matrix: Option<[String; 9]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<AngleUnit>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    sd: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    covariance: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum OrientationError {
    #[error(
        "an orientation has one of quaternion_xyzw (4 columns), angles (3 columns, with order and unit), rotation_vector (3 columns, \
         with unit) or matrix (9 columns, row by row)"
    )]
    OneForm,
    #[error("sd of an orientation has one column, or three")]
    Deviations,
    #[error(
        "covariance of an orientation has six columns: xx, xy, xz, yy, yz, zz of the rotation about the axes of the instrument's frame"
    )]
    Covariance,
}

impl TryFrom<OrientationKeys> for OrientationColumns {
    type Error = OrientationError;
    fn try_from(keys: OrientationKeys) -> Result<Self, OrientationError> {
        let form = match (keys.quaternion_xyzw, keys.angles, keys.rotation_vector, keys.matrix) {
            (Some(columns), None, None, None) if keys.order.is_none() => {
                OrientationForm::Quaternion(columns)
            }
            (None, Some(columns), None, None) => match (keys.order, keys.unit) {
                (Some(order), Some(unit)) => OrientationForm::Angles(columns, order, unit),
                _ => return Err(OrientationError::OneForm),
            },
            (None, None, Some(columns), None) if keys.order.is_none() => {
                OrientationForm::Vector(columns, keys.unit.ok_or(OrientationError::OneForm)?)
            }
            (None, None, None, Some(columns)) if keys.order.is_none() => {
                OrientationForm::Matrix(columns)
            }
            _ => return Err(OrientationError::OneForm),
        };
        if !matches!(keys.sd.len(), 0 | 1 | 3) {
            return Err(OrientationError::Deviations);
        }
        if !matches!(keys.covariance.len(), 0 | 6) {
            return Err(OrientationError::Covariance);
        }
        Ok(Self { form, sd: keys.sd, covariance: keys.covariance })
    }
}

impl From<OrientationColumns> for OrientationKeys {
    fn from(columns: OrientationColumns) -> Self {
        let mut keys = Self { sd: columns.sd, covariance: columns.covariance, ..Self::default() };
        match columns.form {
            OrientationForm::Quaternion(own) => keys.quaternion_xyzw = Some(own),
            OrientationForm::Angles(own, order, unit) => {
                (keys.angles, keys.order, keys.unit) = (Some(own), Some(order), Some(unit));
            }
            OrientationForm::Vector(own, unit) => {
                (keys.rotation_vector, keys.unit) = (Some(own), Some(unit));
            }
            OrientationForm::Matrix(own) => keys.matrix = Some(own),
        }
        keys
    }
}

impl StationsSettings {
    /// Names of the targets, the main one first; a single one that has no name is `target`.
    pub fn target_names(&self) -> Vec<String> {
        if self.target.is_some() && !(self.targets.is_empty() && self.measured.is_empty()) {
            return self.targets.clone();
        }
        let named = self.measured.iter().enumerate();
        let usual = |place: usize| {
            if place == 0 { "target".to_owned() } else { format!("target {}", place + 1) }
        };
        let mut names: Vec<String> =
            named.map(|(place, own)| own.name.clone().unwrap_or_else(|| usual(place))).collect();
        if self.measured.is_empty() {
            for target in self.lengths.iter().filter_map(|own| own.target.as_ref()) {
                if !names.contains(target) {
                    names.push(target.clone());
                }
            }
            if names.is_empty() && !self.lengths.is_empty() {
                names.push(usual(0));
            }
        }
        names
    }

    /// Place among the targets of the one that an instrument of one length reads; `None` where there is no such target.
    pub fn target_of(&self, lengths: &LengthColumns) -> Option<usize> {
        lengths.source().target_among(&self.target_names())
    }

    /// Place among the sources of the first instrument of one length: behind that of places, where there is one.
    pub const fn first_length(&self) -> usize {
        if self.measured.is_empty() { 0 } else { 1 }
    }
}

fn missing() -> Vec<f64> {
    MISSING.into()
}

/// One table, or a list of them.
fn one_or_several<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<ReadingColumns>, D::Error> {
    struct OneOrSeveral;
    impl<'de> Visitor<'de> for OneOrSeveral {
        type Value = Vec<ReadingColumns>;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the columns of a reading, or a list of them")
        }
        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            ReadingColumns::deserialize(MapAccessDeserializer::new(map)).map(|one| vec![one])
        }
        fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(list))
        }
    }
    from.deserialize_any(OneOrSeveral)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = "joints = [\"a\"]\njoint_unit = \"deg\"\n";

    fn read(more: &str) -> Result<StationsSettings, String> {
        toml::from_str(&format!("{LEAST}{more}"))
            .map_err(|error: toml::de::Error| error.message().to_owned())
    }

    #[test]
    fn one_target_or_several_and_four_forms_of_orientation() {
        let one = read("[measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\n").unwrap();
        assert_eq!(one.target_names(), ["target"]);
        let two = "[[measured]]\nname = \"A\"\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\n\
                   [[measured]]\nname = \"B\"\nposition = [\"u\", \"v\", \"w\"]\nunit = \"m\"\n";
        assert_eq!(read(two).unwrap().target_names(), ["A", "B"]);
        for orientation in [
            "quaternion_xyzw = [\"a\", \"b\", \"c\", \"d\"]",
            "angles = [\"a\", \"b\", \"c\"], order = \"moving-xyz\", unit = \"deg\", sd = [\"e\"]",
            "rotation_vector = [\"a\", \"b\", \"c\"], unit = \"deg\", covariance = [\"e\", \"f\", \"g\", \"h\", \"i\", \"j\"]",
            "rotation_vector = [\"a\", \"b\", \"c\"], unit = \"rad\"",
            "matrix = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\", \"g\", \"h\", \"i\"]",
        ] {
            let text = format!(
                "[measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\norientation = {{ {orientation} }}\n"
            );
            let own = read(&text).unwrap();
            // What is written is read back: a run's name follows from it.
            let written = toml::to_string(&own).unwrap();
            assert_eq!(toml::from_str::<StationsSettings>(&written).unwrap(), own);
        }
    }

    #[test]
    fn an_orientation_states_its_convention() {
        let told = |orientation: &str| {
            let text = format!(
                "[measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\norientation = {{ {orientation} }}\n"
            );
            read(&text).unwrap_err()
        };
        assert!(
            told("angles = [\"a\", \"b\", \"c\"], unit = \"deg\"").contains("with order and unit")
        );
        assert!(
            told("angles = [\"a\", \"b\", \"c\"], order = \"xyz\", unit = \"deg\"")
                .contains("no order of axes")
        );
        assert!(told("rotation_vector = [\"a\", \"b\", \"c\"]").contains("with unit"));
        assert!(read("[measured]\nposition = [\"x\", \"y\"]\nunit = \"mm\"\n").is_err());
        assert!(
            told("rotation_vector = [\"a\", \"b\", \"c\"], unit = \"rad\", covariance = [\"d\"]")
                .contains("six columns")
        );
        let of = |columns: usize| {
            let names = vec!["\"c\""; columns].join(", ");
            read(&format!(
                "[measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\ncovariance = [{names}]\n"
            ))
        };
        assert!(of(6).is_ok() && of(21).is_ok() && of(36).is_ok());
        assert!(of(9).unwrap_err().contains("found 9"));
    }
}
