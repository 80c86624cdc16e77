//! Further points of straight motions and circles: lines of posegrid's own before the motion, each with all that the motion has but its
//! positions.
//!
//! Speed, zone, tool and base are those of the motion's own text, and of whatever stands before it. An added line ends with a comment that
//! says whose it is. Only `LIN`, `CIRC`, `MoveL` and `MoveC` get points: a process instruction would begin its process at each. The motion
//! itself leads over the last part of its way, so the helper of a circle moves onto that.

use nalgebra::Isometry3;

use crate::edit::{Edit, line_end};
use crate::geometry::typed::number as decimal;
use crate::lex::Dialect;
use crate::program::{Path, Position, Programs, Shape, Stated, Turn};
use crate::value::{DEGREE_DECIMALS, MM_DECIMALS};
use crate::write::{QUATERNION_DECIMALS, abc_near, quaternion_near};

/// The comment behind each added line.
pub const ADDED: &str = "added by posegrid";

/// A further point before the end of a motion; of a circle each second one is a helper.
#[derive(Debug, Clone, PartialEq)]
pub struct Further {
    /// Its numbers: the tool in the frame of the motion's position, mm.
    pub frame_from_tool: Isometry3<f64>,
    /// Joint angles there, degrees.
    pub joints: Vec<f64>,
}

impl Programs {
    /// Why a motion gets no further points; `Ok` where it may.
    pub fn may_split(&self, path: &Path) -> Result<(), &'static str> {
        path.split.as_ref().map_err(|why| *why)?;
        let ends = self.ends(path).ok_or("where it begins is not known")?;
        let through = path.through.iter().flatten().map(|place| &self.positions[*place]);
        let through: Vec<&Position> = through.collect();
        if through.iter().chain(&ends[..1]).any(|own| own.external.is_some()) {
            return Err("an external axis moves with it");
        }
        if let [helper, _] = through[..]
            && helper.uses.len() > 1
        {
            return Err("its helper point is used by another motion too");
        }
        let cfx = ends.map(|end| match &end.shape {
            Ok(Shape::Pose { stated: Some(Stated::Quadrants(all)), .. }) => Some(all[3].value),
            _ => None,
        });
        if matches!(cfx, [Some(from), Some(to)] if from.to_bits() != to.to_bits()) {
            return Err("cfx is another at its begin");
        }
        Ok(())
    }

    fn ends(&self, path: &Path) -> Option<[&Position; 2]> {
        let end = path.through.as_deref()?.last()?;
        Some([&self.positions[path.from?], &self.positions[*end]])
    }

    /// The lines of further points before a motion; `None` where its text is not understood.
    pub fn added(&self, path: &Path, points: &[Further]) -> Option<Edit> {
        let split = path.split.as_ref().ok()?;
        let [_, end] = self.ends(path)?;
        let bytes = &self.files[path.file].bytes;
        let Dialect { statement_end, comment, .. } = self.files[path.file].dialect()?;
        let target = split.target.clone();
        let piece = |span| std::str::from_utf8(&bytes[span]).ok();
        let indent = piece(split.line_start..split.statement.start)?;
        let before = piece(split.statement.start..target.start)?;
        let behind = piece(target.end..split.statement.end)?;
        let line_end = line_end(bytes);
        let line = |points: &[Further]| {
            let values = points.iter().map(|point| self.literal(end, point));
            let value = values.collect::<Option<Vec<_>>>()?.join(",");
            Some(format!(
                "{indent}{before}{value}{behind}{statement_end} {comment} {ADDED}{line_end}"
            ))
        };
        let each = path.through.as_ref().map_or(1, Vec::len).max(1);
        let lines: Vec<String> = points.chunks(each).map(line).collect::<Option<_>>()?;
        let text = lines.concat();
        Some(Edit { span: split.line_start..split.line_start, text })
    }

    /// A point as the dialect of a position writes it out.
    fn literal(&self, end: &Position, point: &Further) -> Option<String> {
        let Ok(Shape::Pose { turn, stated, .. }) = &end.shape else {
            return None;
        };
        let pose = &point.frame_from_tool;
        let xyz = pose.translation.vector.iter().map(|own| decimal(*own, MM_DECIMALS));
        let xyz: Vec<String> = xyz.collect();
        match turn {
            Turn::Abc(near) => {
                let abc = abc_near(&pose.rotation, near.each_ref().map(|own| own.value));
                let [a, b, c] = abc.map(|own| decimal(own, DEGREE_DECIMALS));
                let [x, y, z] = xyz.as_slice() else { return None };
                Some(format!("{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"))
            }
            // Its motions are not split.
            Turn::Vector(_) => None,
            Turn::Quaternion(near) => {
                let parts = quaternion_near(&pose.rotation, near.each_ref().map(|own| own.value));
                let parts = parts.map(|part| decimal(part, QUATERNION_DECIMALS)).join(",");
                let Some(Stated::Quadrants(old)) = stated else { return None };
                let quarter =
                    |joint: usize| Some(decimal((point.joints.get(joint)? / 90.0).floor(), 0));
                let quarters = [quarter(0)?, quarter(3)?, quarter(5)?, decimal(old[3].value, 0)];
                let external = behind_list(&self.files[end.file].bytes, old[3].span.end)?;
                Some(format!("[[{}],[{parts}],[{}],{external}]", xyz.join(","), quarters.join(",")))
            }
        }
    }
}

/// The list behind the one that ends after a place: `],[9E9,9E9]`; `None` where other signs stand there.
fn behind_list(bytes: &[u8], place: usize) -> Option<&str> {
    let rest = std::str::from_utf8(bytes.get(place..(place + 400).min(bytes.len()))?).ok();
    let rest = rest.or_else(|| {
        let end = bytes[place..].iter().position(|byte| !byte.is_ascii())?;
        std::str::from_utf8(&bytes[place..place + end]).ok()
    })?;
    let rest = rest.trim_start().strip_prefix(']')?.trim_start().strip_prefix(',')?.trim_start();
    let list = &rest[..=rest.find(']')?];
    let is_list = list.starts_with('[')
        && list.bytes().skip(1).all(|byte| {
            byte.is_ascii_digit()
                || matches!(byte, b' ' | b',' | b'.' | b'+' | b'-' | b'E' | b'e' | b']')
        });
    is_list.then_some(list)
}
