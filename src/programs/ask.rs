//! A position under the frames of its motions → a pose in the arm's base, or why it is not corrected.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::flow::{Known, Setting};
use crate::frame::{Cell, Chain};
use crate::krl::abc;
use crate::program::{Position, Programs, Shape, Stated, Turn, Use};
use crate::rapid::{RAPID, quaternion};
use crate::refusal::Refusal;
use crate::taught::{Taught, TaughtFrame};
use crate::value::{Letters, Number};

#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// Its index among the positions.
    pub position: usize,
    /// The tool in the flange frame, where it really is, mm.
    pub flange_from_tool: Isometry3<f64>,
    pub stated_tool: Isometry3<f64>,
    /// Whether the arm holds the part: the "tool" is the part's frame then, and the numbers are those of a tool in the cell, seen from it.
    pub holds_part: bool,
    pub wanted: Wanted,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Wanted {
    Pose {
        /// The frame that the position's numbers are in as the controller has it, in the arm's base, mm.
        base_from_frame: Isometry3<f64>,
        /// The tool in the arm's base as the controller has the position now, mm.
        programmed: Isometry3<f64>,
        /// Where the tool is wanted in the arm's base, mm: by the frame where that really is.
        base_from_tool: Isometry3<f64>,
        /// Of each of its motions one; all have to agree.
        branches: Vec<Branch>,
    },
    /// Degrees; mm of a joint that slides.
    Joints(Vec<f64>),
}

/// The arm configuration that a motion reaches its position in.
#[derive(Debug, Clone, PartialEq)]
pub enum Branch {
    /// S of KUKA, with T where the motion reads the position's own.
    Status { status: u8, turn: Option<u8> },
    /// cf1, cf4 and cf6 of ABB with cfx: the quarter turns of joints 1, 4 and 6.
    Quadrants([i32; 4]),
    /// That of another position, by its index: quarter turns hold at their own alone.
    Of(usize),
    /// Letters of FANUC, with the turns of joints 1, 4 and 6 where the motion reads the position's own.
    Config { letters: Letters, turns: Option<[i32; 3]> },
    /// That of joint angles, degrees.
    Joints(Vec<f64>),
}

impl Branch {
    /// The other position whose arm configuration it is.
    pub const fn other(&self) -> Option<usize> {
        match self {
            Self::Of(other) => Some(*other),
            _ => None,
        }
    }
}

impl Asked {
    /// What the numbers of the position say where the tool stands at a pose in the arm's base, mm; `None` of joint angles.
    pub fn numbers(&self, base_from_tool: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let Wanted::Pose { base_from_frame, .. } = &self.wanted else { return None };
        let own = base_from_frame.inverse() * base_from_tool;
        Some(if self.holds_part { own.inverse() } else { own })
    }

    /// By how much a command moves what the numbers say, mm; `None` of joint angles.
    pub fn correction(&self, base_from_tool: &Isometry3<f64>) -> Option<Vector3<f64>> {
        let Wanted::Pose { programmed, .. } = &self.wanted else { return None };
        let [to, from] = [base_from_tool, programmed].map(|pose| self.numbers(pose));
        Some(to?.translation.vector - from?.translation.vector)
    }

    /// None of a position in joint angles.
    pub fn branches(&self) -> &[Branch] {
        match &self.wanted {
            Wanted::Pose { branches, .. } => branches,
            Wanted::Joints(_) => &[],
        }
    }
}

impl Programs {
    pub fn ask(&self, index: usize, cell: &Cell) -> Result<Asked, Refusal> {
        let position = &self.positions[index];
        if let Some(line) = self.marks[position.file] {
            return Err(Refusal::Corrected { at: self.files[position.file].at(line) });
        }
        if let Some(why) = &position.obstacle {
            return Err(why.clone());
        }
        let shape = position.shape.as_ref().map_err(Clone::clone)?;
        if let (Some((name, value)), None) = (&position.external, cell.external_axes) {
            return Err(Refusal::ExternalAxis { name: name.clone(), value: value.clone() });
        }
        let first = agreed(position, shape)?;
        let tool = chain(&first.tool)?.on_flange(cell)?;
        let wanted = match shape {
            Shape::Joints(joints) => Wanted::Joints(values(joints)),
            Shape::Pose { xyz, turn, .. } => {
                let base = chain(&first.base)?.in_arm(&self.roots[position.file], cell)?;
                let pose = pose(xyz, turn)?;
                let pose = if first.holds_part { pose.inverse() } else { pose };
                Wanted::Pose {
                    base_from_frame: base.stated,
                    programmed: base.stated * pose,
                    base_from_tool: base.actual * pose,
                    branches: self.branches(index)?,
                }
            }
        };
        let (flange_from_tool, stated_tool) = (tool.actual, tool.stated);
        let holds_part = first.holds_part;
        Ok(Asked { position: index, flange_from_tool, stated_tool, holds_part, wanted })
    }

    /// The frames of motions that the cell says were taught, each once.
    pub fn taught(&self, cell: &Cell) -> Vec<TaughtFrame> {
        let mut found: Vec<TaughtFrame> = Vec::new();
        if !cell.frames.values().any(|frame| frame.taught_with.is_some()) {
            return found;
        }
        let mut add = |frame: TaughtFrame| {
            let is_one = |own: &TaughtFrame| own.name == frame.name && own.stated == frame.stated;
            if !found.iter().any(is_one) {
                found.push(frame);
            }
        };
        let uses = self.positions.iter().flat_map(|position| &position.uses);
        // A part that is held is not touched as a tool is.
        for own in uses.filter(|own| !own.holds_part) {
            let is_rapid = self.files[own.file].is_of(&RAPID);
            let mut of = |known: &Known, from: Isometry3<f64>, kind: Taught| {
                let Ok(chain) = chain(known) else { return };
                chain.each_taught(cell, from, |name, stated| {
                    add(TaughtFrame { name: name.to_owned(), stated: *stated, kind });
                });
            };
            of(&own.tool, Isometry3::identity(), Taught::Tool);
            if let Ok(world_from_base) = self.roots[own.file].stated(cell) {
                let kind = Taught::Base { world_from_base, is_rapid };
                of(&own.base, world_from_base.inverse(), kind);
            }
        }
        found
    }

    /// The arm configurations in which its motions reach a position, each once.
    fn branches(&self, index: usize) -> Result<Vec<Branch>, Refusal> {
        let mut branches = Vec::new();
        for own in &self.positions[index].uses {
            let branch = self.branch(index, &own.branch)?;
            if !branches.contains(&branch) {
                branches.push(branch);
            }
        }
        Ok(branches)
    }

    fn branch(&self, index: usize, stated_by: &Known) -> Result<Branch, Refusal> {
        let by = match &**stated_by.as_ref().map_err(|why| (**why).clone())? {
            Setting::Position(by) => *by,
            Setting::Config(letters) => {
                return Ok(Branch::Config { letters: *letters, turns: None });
            }
            Setting::Status(status) => return Ok(Branch::Status { status: *status, turn: None }),
            _ => index,
        };
        let wrong = |number: &Number| {
            let form = number.value.to_string();
            Refusal::Form { what: "arm configuration", form }
        };
        #[expect(clippy::cast_possible_truncation, reason = "whole numbers below 128")]
        let small = |number: &Number| {
            let is_whole = number.value.fract() == 0.0 && number.value.abs() < 128.0;
            is_whole.then_some(number.value as i32).ok_or_else(|| wrong(number))
        };
        let byte = |number: &Number| number.byte().ok_or_else(|| wrong(number));
        let other = &self.positions[by];
        let told = |why: &Refusal| match by {
            by if by == index => why.clone(),
            _ => Refusal::Other(format!(
                "its arm configuration is that of {other} ({}), which is not known: {why}",
                self.files[other.file].at(other.line)
            )),
        };
        match other.shape.as_ref().map_err(told)? {
            Shape::Joints(joints) => Ok(Branch::Joints(values(joints))),
            Shape::Pose { stated: Some(Stated::Status { status, turn }), .. } => {
                let turn = turn.as_ref().filter(|_| by == index).map(byte).transpose()?;
                Ok(Branch::Status { status: byte(status)?, turn })
            }
            Shape::Pose { stated: Some(Stated::Quadrants(_)), .. } if by != index => {
                Ok(Branch::Of(by))
            }
            Shape::Pose { stated: Some(Stated::Quadrants(quadrants)), .. } => {
                let [one, four, six, x] = quadrants;
                Ok(Branch::Quadrants([small(one)?, small(four)?, small(six)?, small(x)?]))
            }
            Shape::Pose { stated: Some(Stated::Config { letters, turns }), .. } => {
                let [one, four, six] = turns;
                let all = || Ok([small(one)?, small(four)?, small(six)?]);
                let turns = (by == index).then(all).transpose()?;
                Ok(Branch::Config { letters: *letters, turns })
            }
            Shape::Pose { stated: Some(Stated::Near(joints)), .. } => {
                Ok(Branch::Joints(joints.clone()))
            }
            Shape::Pose { stated: None, .. } => {
                Err(Refusal::Partial { what: "arm configuration that its motion reads" })
            }
        }
    }
}

/// The first of a position's uses, if the others are under the same frames.
fn agreed<'p>(position: &'p Position, shape: &Shape) -> Result<&'p Use, Refusal> {
    let twice = || {
        Refusal::Other("its routine stands twice in the files given; give one of them".to_owned())
    };
    let (first, others) = position.uses.split_first().ok_or_else(twice)?;
    for own in &position.uses {
        chain(&own.tool)?;
        if matches!(shape, Shape::Pose { .. }) {
            chain(&own.base)?;
        }
    }
    let is_pose = matches!(shape, Shape::Pose { .. });
    let differs = |own: &&Use| {
        let is_other = own.base != first.base || own.holds_part != first.holds_part;
        own.tool != first.tool || (is_pose && is_other)
    };
    if let Some(other) = others.iter().find(differs) {
        let frames = |own: &Use| {
            let named = |known| chain(known).map_or_else(|_| String::new(), Chain::to_string);
            format!("base {} with tool {}", named(&own.base), named(&own.tool))
        };
        return Err(Refusal::TwoFrames {
            first: frames(first),
            first_line: first.line,
            second: frames(other),
            second_line: other.line,
        });
    }
    Ok(first)
}

fn chain(known: &Known) -> Result<&Chain, Refusal> {
    match known.as_ref().map(|setting| &**setting) {
        Ok(Setting::Frames(chain)) => Ok(chain),
        Ok(_) => Err(Refusal::Other("its frame is no frame".to_owned())),
        Err(why) => Err(Refusal::clone(why as &Arc<Refusal>)),
    }
}

fn values(numbers: &[Number]) -> Vec<f64> {
    numbers.iter().map(|number| number.value).collect()
}

/// The pose that numbers write out, in their frame.
pub(crate) fn pose(xyz: &[Number; 3], turn: &Turn) -> Result<Isometry3<f64>, Refusal> {
    let at = Point3::from(xyz.each_ref().map(|number| number.value));
    let turn = match turn {
        Turn::Abc(angles) => abc(angles.each_ref().map(|number| number.value)),
        Turn::Quaternion(parts) => quaternion(parts.each_ref().map(|number| number.value))
            .ok_or_else(|| {
                Refusal::Other("its four numbers of orientation are no unit quaternion".to_owned())
            })?,
        Turn::Vector(parts) => UnitQuaternion::from_scaled_axis(Vector3::from(
            parts.each_ref().map(|number| number.value),
        )),
    };
    Ok(Isometry3::from_parts(Translation3::from(at.coords), turn))
}
