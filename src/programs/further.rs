//! Further points of straight motions and circles: lines of posegrid's own before the motion, each with all that the motion has but its
//! positions.
//!
//! Speed, zone, tool and base are those of the motion's own text, and of whatever stands before it. An added line ends with a comment that
//! says whose it is; in a listing its positions do. Only plain straight motions and circles get points: a process instruction would begin its
//! process at each. The motion itself leads over the last part of its way, so the helper of a circle moves onto that.

use crate::edit::{Edit, line_end};
use crate::fanuc::{self, FANUC};
use crate::geometry::typed::number as decimal;
use crate::lex::Dialect;
use crate::program::{Added, Further, Path, Position, Programs, Shape, Split, Stated, Turn};
use crate::urscript::vector_near;
use crate::value::{DEGREE_DECIMALS, MM_DECIMALS};
use crate::write::{QUATERNION_DECIMALS, abc_near, listed, quaternion_near};

/// Decimals of m and rad.
const METRE_DECIMALS: usize = MM_DECIMALS + 3;
/// The comment behind each added line.
pub const ADDED: &str = "added by posegrid";

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

    /// Further points before a motion, as its dialect writes them; `None` where its text is not understood.
    pub fn added(&self, path: &Path, points: &[Further]) -> Option<Added> {
        let split = path.split.clone().ok()?;
        let [_, end] = self.ends(path)?;
        let line = |points: &[Further]| points.iter().map(|own| self.literal(end, own)).collect();
        let points = points.chunks(split.targets.len()).map(line).collect::<Option<_>>()?;
        std::str::from_utf8(&self.files[path.file].bytes[split.line_start..split.statement.end])
            .ok()?;
        Some(Added { file: path.file, split, points })
    }

    /// The lines of further points in each file.
    pub fn lines<'a>(&self, added: impl Iterator<Item = &'a Added>) -> Vec<Vec<Edit>> {
        let mut of_files = vec![Vec::new(); self.files.len()];
        added.for_each(|own| of_files[own.file].push(own));
        let edits = self.files.iter().zip(of_files).map(|(file, mut added)| {
            added.sort_by_key(|own| own.split.line_start);
            match file.dialect() {
                _ if file.is_of(&FANUC) => fanuc::further::lines(&file.bytes, &added),
                Some(own) => added.iter().map(|added| added.before(&file.bytes, own)).collect(),
                None => Vec::new(),
            }
        });
        edits.collect()
    }

    /// A point as the dialect of a position writes it out.
    fn literal(&self, end: &Position, point: &Further) -> Option<String> {
        let Ok(Shape::Pose { turn, stated, .. }) = &end.shape else { return None };
        let pose = &point.frame_from_tool;
        let xyz = pose.translation.vector.iter().map(|own| decimal(*own, MM_DECIMALS));
        let xyz: Vec<String> = xyz.collect();
        match turn {
            Turn::Abc(_) if self.files[end.file].is_of(&FANUC) => {
                listed(end, &self.files[end.file].bytes, point)
            }
            Turn::Abc(near) => {
                let abc = abc_near(&pose.rotation, near.each_ref().map(|own| own.value));
                let [a, b, c] = abc.map(|own| decimal(own, DEGREE_DECIMALS));
                let [x, y, z] = xyz.as_slice() else { return None };
                Some(format!("{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"))
            }
            Turn::Vector(near) => {
                let [x, y, z] = pose.translation.vector.scale(1e-3).into();
                let vector = vector_near(&pose.rotation, near.each_ref().map(|own| own.value));
                let numbers = [[x, y, z], vector].concat();
                let numbers: Vec<String> =
                    numbers.iter().map(|own| decimal(*own, METRE_DECIMALS)).collect();
                Some(format!("p[{}]", numbers.join(", ")))
            }
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

impl Added {
    /// Its lines before the motion.
    fn before(&self, bytes: &[u8], dialect: &Dialect) -> Edit {
        let Self { split: Split { line_start, statement, .. }, points, .. } = self;
        let Dialect { statement_end, comment, .. } = dialect;
        let indent = String::from_utf8_lossy(&bytes[*line_start..statement.start]);
        let end = format!("{statement_end} {comment} {ADDED}{}", line_end(bytes));
        let lines =
            points.iter().map(|own| format!("{indent}{}{end}", self.split.with(bytes, own)));
        Edit { span: *line_start..*line_start, text: lines.collect() }
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
