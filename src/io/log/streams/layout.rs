//! The fields of a message that a stream is made from: those of the common types ([`super::common`]), or those that the
//! pipeline file names.

use super::common::{Common, Layout, common};
use super::{Stream, Wanted};
use crate::ingest::{
    AngleFields, JointFields, LoggedLength, Mapping, PoseFields, StampField, TimeSource, TimeUnit,
    TrackerSettings,
};
use crate::message::{FieldPath, FieldReader, MessageSchema, SchemaError};

/// Usual paths of the stamp in messages of other types, where the pipeline file names none.
const STAMPS: [&str; 2] = ["header.stamp", "timestamp"];
const ENTRIES: usize = 36;
/// Fields of a time, in ROS 2, in protobuf, and in ROS 1 and JSON.
const TIME: [&str; 2] = ["sec|seconds|secs", "nanosec|nanos|nsec|nsecs"];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StampValues {
    /// None: the record's time is used.
    Record,
    Time,
    /// Seconds and nanoseconds or, in JSON, a date-time as text.
    TimeOrText,
    Number(TimeUnit),
}

/// The values of a row after stamp and frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    NamedAngles,
    /// The angle of each joint of the arm.
    Angles,
    /// x, y, z; a quaternion where there is one; an array of covariances where there is one.
    Pose(PoseParts),
    /// Lists of x, y, z, of a quaternion and of the 36 entries of a covariance where there are: an element for each
    /// pose of an array.
    Poses(PoseParts),
    Temperature,
    Lengths,
}

/// Parts that a pose has besides its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PoseParts {
    pub(super) orientation: bool,
    pub(super) covariance: bool,
}

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

#[derive(Default)]
struct Statements<'m> {
    stamp: Option<&'m StampField>,
    frame: Option<&'m str>,
    frame_field: Option<&'m str>,
    named: Option<(Meaning, Vec<String>)>,
    target: Option<&'m str>,
    ignore_orientation: bool,
}

#[derive(Debug)]
pub struct Glance {
    /// Seconds and nanoseconds of the message's own stamp or, in JSON, its text in the third place.
    pub stamp: Option<FieldReader>,
    /// The array of joint names, of the common types.
    pub joint_names: Option<FieldReader>,
    /// The array of joint angles or the three coordinates, of the common types.
    pub values: Option<FieldReader>,
}

impl Glance {
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
            schema.reader(&[FieldPath::parse(joints.fields().first()?).ok()?]).ok()
        };
        let values = |schema: &MessageSchema| {
            let common = common?;
            let wanted = match common.layout {
                Layout::Joints => 1..2,
                Layout::Pose | Layout::Point | Layout::PoseWithCovariance => 0..3,
                Layout::Markers
                | Layout::MarkersWithCovariance
                | Layout::Temperature
                | Layout::Length => return None,
            };
            let fields = common.fields();
            let paths = fields.get(wanted)?.iter().map(|field| FieldPath::parse(field));
            schema.reader(&paths.collect::<Result<Vec<_>, _>>().ok()?).ok()
        };
        let schema = schema.as_ref();
        let (values, stamp) = (schema.and_then(values), schema.and_then(stamp));
        Self { values, stamp, joint_names: schema.and_then(names) }
    }
}

/// Whether there is a time at this path, as far as the schema shows.
fn has_time(schema: &MessageSchema, path: &str) -> bool {
    let paths = FieldPath::parse(path).and_then(|path| time_at(&path, schema));
    paths.is_ok_and(|(_, paths)| paths.iter().any(|path| schema.has(path)))
}

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
    /// `None` where neither the type nor the pipeline file gives a recipe.
    pub(super) fn resolve(
        wanted: &Wanted,
        mapping: &Mapping,
        name: &str,
        schema: &MessageSchema,
    ) -> Result<Option<Self>, SchemaError> {
        let said = Statements::of(wanted, mapping);
        let common = common(name).filter(|common| common.layout.suits(wanted.stream));
        let Some(asked) = said.asked(common, wanted, mapping) else { return Ok(None) };
        let stamp_path = said.stamp_path(common, schema)?;
        let (stamp, mut paths) = said.stamp(wanted.time, &stamp_path, schema)?;
        if said.frame.is_some() {
            paths.push(match said.frame_field {
                Some(field) => FieldPath::parse(field)?,
                None => beside(&stamp_path, "frame_id")?,
            });
        }
        let fields = asked.fields.iter().map(String::as_str);
        for field in asked.target.into_iter().chain(fields) {
            paths.push(FieldPath::parse(field)?);
        }
        if let Some(covariance) = asked.entries {
            let entry = |place| FieldPath::parse(&format!("{covariance}[{place}]"));
            let entries = (0..ENTRIES).map(entry);
            paths.extend(entries.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(Some(Self {
            has_target: asked.target.is_some(),
            stamp,
            frame: said.frame.map(str::to_owned),
            meaning: asked.meaning,
            reader: schema.reader(&paths)?,
            paths,
        }))
    }
}

struct Asked<'m> {
    meaning: Meaning,
    /// Path of the target's name, where messages name their targets.
    target: Option<&'m str>,
    fields: Vec<String>,
    /// Path of the covariance of each pose of an array, whose entries are read one by one.
    entries: Option<String>,
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
            (Stream::Temperatures, _) => Self::of_temperatures(tracker),
        }
    }

    /// Values by the pipeline file or by the common type; `None` where neither says them, or where nothing says which
    /// pose of an array is the target's.
    fn asked(
        &self,
        common: Option<&Common>,
        wanted: &Wanted,
        mapping: &'m Mapping,
    ) -> Option<Asked<'m>> {
        let is_named = mapping.tracker.names_on(&wanted.topic);
        let said = self.target.filter(|_| is_named);
        let (mut meaning, mut fields, target) = match (&self.named, common) {
            (Some((meaning, fields)), _) => (*meaning, fields.clone(), said),
            (None, Some(common)) => {
                let (target, fields) = common.target_and_fields();
                (common.layout.meaning(), fields, target.or(said))
            }
            (None, None) => return None,
        };
        let is_array = matches!(meaning, Meaning::Poses(_));
        if is_array && (!is_named || target.is_none()) {
            return None;
        }
        if let Meaning::Pose(parts) | Meaning::Poses(parts) = &mut meaning
            && self.ignore_orientation
            && parts.orientation
        {
            parts.orientation = false;
            fields.drain(3..7);
        }
        let entries = match meaning {
            Meaning::Poses(PoseParts { covariance: true, .. }) => fields.pop(),
            _ => None,
        };
        Some(Asked { meaning, target, fields, entries })
    }

    fn stamp(
        &self,
        time: TimeSource,
        path: &FieldPath,
        schema: &MessageSchema,
    ) -> Result<(StampValues, Vec<FieldPath>), SchemaError> {
        match (time, self.stamp) {
            (TimeSource::Publish | TimeSource::Log, _) => Ok((StampValues::Record, Vec::new())),
            (TimeSource::Header, Some(StampField::Number(number))) => {
                let field = FieldPath::parse(&number.field)?;
                Ok((StampValues::Number(number.unit), vec![field]))
            }
            (TimeSource::Header, _) => time_at(path, schema),
        }
    }

    fn of_temperatures(tracker: &'m TrackerSettings) -> Self {
        let field = tracker.fields.temperature.clone();
        Self {
            stamp: tracker.fields.stamp.as_ref(),
            named: field.map(|field| (Meaning::Temperature, vec![field])),
            ..Self::default()
        }
    }

    fn of_lengths(tracker: &'m TrackerSettings, topic: &str) -> Self {
        let own = tracker.lengths.iter().filter(|own| own.topic == topic);
        let own: Vec<&LoggedLength> = own.collect();
        let fields: Vec<String> = own.iter().filter_map(|own| own.field.clone()).collect();
        Self {
            stamp: own.first().and_then(|own| own.stamp.as_ref()),
            named: (fields.len() == own.len()).then_some((Meaning::Lengths, fields)),
            ..Self::default()
        }
    }

    fn of_joints(fields: &'m JointFields) -> Self {
        let named = match (&fields.names, &fields.angles) {
            (Some(names), Some(AngleFields::Array(angles))) => {
                Some((Meaning::NamedAngles, vec![names.clone(), angles.clone()]))
            }
            (None, Some(AngleFields::Each(angles))) => Some((Meaning::Angles, angles.clone())),
            _ => None,
        };
        Self { stamp: fields.stamp.as_ref(), named, ..Self::default() }
    }

    fn of_poses(fields: &'m PoseFields, frame: Option<&'m str>, ignore_orientation: bool) -> Self {
        let named = fields.position().map(|position| {
            let orientation = fields.orientation();
            let covariance = fields.covariance.as_deref();
            let parts =
                PoseParts { orientation: orientation.is_some(), covariance: covariance.is_some() };
            let meaning =
                if fields.is_of_each() { Meaning::Poses(parts) } else { Meaning::Pose(parts) };
            let rest = orientation.into_iter().flatten().chain(covariance);
            (meaning, position.into_iter().chain(rest).map(str::to_owned).collect())
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

    /// As the pipeline file names it, or of the common type, or else one of the usual paths.
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

fn beside(path: &FieldPath, name: &str) -> Result<FieldPath, SchemaError> {
    let path = path.to_string();
    let inside = path.rsplit_once('.').map(|(inside, _)| inside);
    FieldPath::parse(&inside.map_or_else(|| name.to_owned(), |inside| format!("{inside}.{name}")))
}
