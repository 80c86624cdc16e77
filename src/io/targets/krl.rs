//! Targets in KUKA data lists (`.dat`): POS, E6POS and FRAME aggregates of a program's points.
//!
//! A data list comes back as it was, byte for byte, but for the numbers of X, Y and Z and for lines that begin with
//! `; corrected by posegrid` or `; refused by posegrid`. Definitions are those of KUKA System Software, Operating and
//! Programming Instructions for System Integrators (*Positions and frames*, *Status and Turn*). Steps:
//! 1. `read` takes the statements between DEFDAT and ENDDAT (`statement`), each in a line of its own;
//! 2. a position is a target: X, Y, Z in mm, A, B, C as `Rz(A) Ry(B) Rx(C)` in degrees, S for the arm configuration
//!    ([`status`]); T, external axes and everything else stay as they are, other aggregates are counted;
//! 3. frames are held together: one pair of `TOOL_NO` and `BASE_NO`, and no tool that stands in the cell (`IPO_FRAME #TCP`);
//! 4. [`DataList::write`] puts commands in place of targets. A refused target becomes a comment, so that a program that
//!    uses it does not start rather than run half corrected.

mod aggregate;
mod lines;
mod notes;
mod problem;
mod statement;
pub mod status;
mod write;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use nalgebra::UnitQuaternion;

pub use problem::{FdatFrames, KrlProblem};
pub use status::{Postures, Status};

use self::aggregate::Aggregate;
use self::lines::Line;
use self::statement::{Declaration, Statement};
use super::{Place, Row, RowProblem, Rows, TargetsError, bounded};
use crate::ingest::AngleUnit;

/// A data list, with where its targets stand.
#[derive(Debug, Clone, PartialEq)]
pub struct DataList {
    text: Vec<u8>,
    /// After the line of DEFDAT.
    head: usize,
    points: Vec<Point>,
    /// Tool and base of the points, where FDATs say them.
    frames: Option<FdatFrames>,
    /// Aggregates that are no positions, by type.
    others: BTreeMap<String, usize>,
}

/// Where a target stands.
#[derive(Debug, Clone, PartialEq)]
struct Point {
    /// Its line, without its end.
    line: Range<usize>,
    /// The numbers of X, Y and Z.
    xyz: [Range<usize>; 3],
    /// Its S, where it has one.
    status: Option<Status>,
    /// Whether an external axis stands away from 0.
    external: bool,
    /// The line's number, where its type is FRAME.
    frame_in: Option<u64>,
}

/// External axes.
const EXTERNAL: [&str; 6] = ["E1", "E2", "E3", "E4", "E5", "E6"];

impl DataList {
    /// The S of each target, in their order.
    pub fn statuses(&self) -> impl Iterator<Item = Option<Status>> + '_ {
        self.points.iter().map(|point| point.status)
    }
}

/// Types that hold positions.
const POSITIONS: [&str; 3] = ["POS", "E6POS", "FRAME"];

/// Reads a data list.
pub(super) fn rows(path: &Path) -> Result<Rows, TargetsError> {
    let text = bounded::read(path)?;
    let (rows, list) = read(text).map_err(|error| error.at(path))?;
    Ok(Rows {
        placed: rows,
        unused: Vec::new(),
        angle_unit: AngleUnit::Deg,
        list: Some(list),
    })
}

/// What is wrong with which line, from 1; 0 for the file as a whole.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InLine {
    line: u64,
    problem: RowProblem,
}

impl InLine {
    fn at(self, path: &Path) -> TargetsError {
        self.problem.at(path, Place::Line(self.line))
    }
}

/// The targets of a text, each with its place.
pub(super) fn read(text: Vec<u8>) -> Result<(Vec<(Place, Row)>, DataList), InLine> {
    let lines = lines::all(&text)?;
    let (head, inside) = lines::of_list(&text, &lines)?;
    let mut reading = Reading {
        text: &text,
        kinds: BTreeMap::new(),
        rows: Vec::new(),
        points: Vec::new(),
        frames: None,
        others: BTreeMap::new(),
    };
    for line in inside {
        let read = reading.line(line);
        read.map_err(|problem| InLine {
            line: line.number,
            problem,
        })?;
    }
    let Reading {
        rows,
        points,
        frames,
        others,
        ..
    } = reading;
    let list = DataList {
        head,
        points,
        frames: frames.map(|(frames, _)| frames),
        others,
        text,
    };
    Ok((rows, list))
}

/// A data list as far as it was read.
struct Reading<'t> {
    text: &'t [u8],
    /// The type of each name declared so far, both in capitals.
    kinds: BTreeMap<String, String>,
    rows: Vec<(Place, Row)>,
    points: Vec<Point>,
    /// With the line of the FDAT that first said them.
    frames: Option<(FdatFrames, u64)>,
    others: BTreeMap<String, usize>,
}

impl Reading<'_> {
    fn line(&mut self, line: &Line) -> Result<(), RowProblem> {
        match statement::parse(self.text, &line.code)? {
            None => Ok(()),
            Some(Statement::Declared(Declaration { kind, names })) => {
                let names = names.into_iter();
                self.kinds.extend(names.map(|name| (name, kind.clone())));
                Ok(())
            }
            Some(Statement::Valued { kind, name, value }) => self.valued(line, kind, name, value),
        }
    }

    fn valued(
        &mut self,
        line: &Line,
        kind: Option<String>,
        name: statement::Name,
        value: Range<usize>,
    ) -> Result<(), RowProblem> {
        let aggregate = aggregate::parse(self.text, value)?;
        if let Some(kind) = &kind {
            self.kinds.insert(name.variable.clone(), kind.clone());
        }
        let Some(aggregate) = aggregate else {
            let is_position = kind.is_some_and(|kind| POSITIONS.contains(&kind.as_str()));
            let wrong = || Err(KrlProblem::NoAggregate { name: name.shown }.into());
            return if is_position { wrong() } else { Ok(()) };
        };
        let own = aggregate.kind.clone().or(kind);
        let known = own.or_else(|| self.kinds.get(&name.variable).cloned());
        let places = aggregate.has(&["X", "Y", "Z"]);
        match known.as_deref() {
            Some(kind) if places > 0 && POSITIONS.contains(&kind) => {
                self.target(line, kind, name.shown, &aggregate)
            }
            None if places == 3 => Err(KrlProblem::NoKind { name: name.shown }.into()),
            other => {
                if other == Some("FDAT") {
                    self.frames(line, &aggregate)?;
                }
                let kind = other.unwrap_or("of no declared type").to_owned();
                *self.others.entry(kind).or_default() += 1;
                Ok(())
            }
        }
    }

    fn target(
        &mut self,
        line: &Line,
        kind: &str,
        name: String,
        at: &Aggregate,
    ) -> Result<(), RowProblem> {
        let number = |component: &str| at.number(self.text, component);
        let position = [number("X")?, number("Y")?, number("Z")?];
        let ranges = ["X", "Y", "Z"].map(|component| at.range(component));
        let [Some(x), Some(y), Some(z)] = ranges else {
            return Err(RowProblem::PartOfPosition);
        };
        let mut external = false;
        for axis in EXTERNAL {
            external |= number(axis)?.is_some_and(|value| value != 0.0);
        }
        self.points.push(Point {
            external,
            frame_in: (kind == "FRAME").then_some(line.number),
            line: line.whole.clone(),
            xyz: [x, y, z],
            status: at.status(self.text)?,
        });
        let row = Row {
            target: name,
            position,
            joints: None,
            quaternion: orientation([number("A")?, number("B")?, number("C")?])?,
            configuration: None,
            tool: None,
            table_id: None,
        };
        self.rows.push((Place::Line(line.number), row));
        Ok(())
    }

    fn frames(&mut self, line: &Line, fdat: &Aggregate) -> Result<(), RowProblem> {
        if fdat.is_word(self.text, "IPO_FRAME", "#TCP") {
            return Err(KrlProblem::ToolInTheCell.into());
        }
        let whole = |component| fdat.whole(self.text, component);
        let (Some(tool), Some(base)) = (whole("TOOL_NO")?, whole("BASE_NO")?) else {
            return Ok(());
        };
        let found = FdatFrames { tool, base };
        let (first, first_line) = *self.frames.get_or_insert((found, line.number));
        if first == found {
            return Ok(());
        }
        Err(KrlProblem::SeveralFrames {
            first,
            first_line,
            other: found,
        }
        .into())
    }
}

/// `Rz(A) Ry(B) Rx(C)`, degrees, as a quaternion x y z w.
fn orientation(abc: [Option<f64>; 3]) -> Result<[Option<f64>; 4], RowProblem> {
    match abc {
        [None, None, None] => Ok([None; 4]),
        [Some(a), Some(b), Some(c)] => {
            let [a, b, c] = [a, b, c].map(f64::to_radians);
            // Roll, pitch and yaw about the fixed x, y and z are C, B and A about the moving x, y and z.
            let turn = UnitQuaternion::from_euler_angles(c, b, a);
            Ok(<[f64; 4]>::from(turn.coords).map(Some))
        }
        _ => Err(KrlProblem::PartOfOrientation.into()),
    }
}

#[cfg(test)]
mod tests;
