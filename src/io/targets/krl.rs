//! Targets in KUKA data lists (`.dat`): POS, E6POS and FRAME aggregates of a program's points (KUKA System Software,
//! Operating and Programming Instructions for System Integrators). A list is written back byte for byte, except the
//! numbers of X, Y and Z and lines that begin with `; corrected by posegrid` or `; refused by posegrid`.
//!
//! 1. A statement between DEFDAT and ENDDAT that the language forbids is an error with its line: a controller would not
//!    run it.
//! 2. A position is a target: X, Y, Z in mm, A, B, C as `Rz(A) Ry(B) Rx(C)` in degrees, S for the arm configuration
//!    ([`status`]).
//! 3. There is one pair of `TOOL_NO` and `BASE_NO`, and no tool that is fixed in the cell.
//! 4. [`DataList::write`] puts commands in place of targets; a refused target becomes a comment, so that a program that
//!    uses it does not start rather than run half corrected. [`MARK`] with the table's id is before ENDDAT: a variable
//!    that stays where comments are removed.

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
use crate::input::Bound;

#[derive(Debug, Clone, PartialEq)]
pub struct DataList {
    text: Vec<u8>,
    /// First byte after the line of DEFDAT.
    head: usize,
    /// First byte of the line of ENDDAT.
    end: usize,
    points: Vec<Point>,
    /// Tool and base of the points; `None` where no FDAT states them.
    frames: Option<FdatFrames>,
    others: BTreeMap<String, usize>,
}

#[derive(Debug, Clone, PartialEq)]
struct Point {
    line: Range<usize>,
    xyz: [Range<usize>; 3],
    /// Its S; `None` where it has none.
    status: Option<Status>,
    /// Whether an external axis is not at 0.
    external: bool,
    /// Number of its line, where its type is FRAME; otherwise `None`.
    frame_in: Option<u64>,
}

const EXTERNAL: [&str; 6] = ["E1", "E2", "E3", "E4", "E5", "E6"];

impl DataList {
    /// Tool and base of the points, by their numbers at the controller.
    pub fn frames(&self) -> Option<FdatFrames> {
        self.frames
    }

    pub fn statuses(&self) -> impl Iterator<Item = Option<Status>> + '_ {
        self.points.iter().map(|point| point.status)
    }
}

const POSITIONS: [&str; 4] = ["POS", "E3POS", "E6POS", "FRAME"];

/// The variable that marks a list as corrected, and holds the table's id.
pub const MARK: &str = "POSEGRID_CORRECTED";

/// The components of a position: a FRAME has the first six, a POS the first eight.
const COMPONENTS: [&str; 14] =
    ["X", "Y", "Z", "A", "B", "C", "S", "T", "E1", "E2", "E3", "E4", "E5", "E6"];

fn components_of(kind: &str) -> &'static [&'static str] {
    match kind {
        "FRAME" => &COMPONENTS[..6],
        "POS" => &COMPONENTS[..8],
        "E3POS" => &COMPONENTS[..11],
        _ => &COMPONENTS,
    }
}

fn is_position(kind: &str) -> bool {
    POSITIONS.contains(&kind)
}

pub(super) fn rows(path: &Path, bound: Bound) -> Result<Rows, TargetsError> {
    let text = bounded::read(path, bound)?;
    let (rows, list) = read(text).map_err(|error| error.at(path))?;
    Ok(Rows { placed: rows, unused: Vec::new(), units: AngleUnit::Deg.into(), list: Some(list) })
}

/// A fault and its line, from 1; 0 for the file as a whole.
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

pub(super) fn read(text: Vec<u8>) -> Result<(Vec<(Place, Row)>, DataList), InLine> {
    let lines = lines::all(&text)?;
    let inside = lines::of_list(&text, &lines)?;
    let mut reading = Reading { text: &text, ..Reading::default() };
    for line in inside.lines {
        let read = reading.line(line);
        read.map_err(|problem| InLine { line: line.number, problem })?;
    }
    let Reading { rows, points, frames, others, .. } = reading;
    let list = DataList {
        head: inside.head,
        end: inside.end,
        points,
        frames: frames.map(|(frames, _)| frames),
        others,
        text,
    };
    Ok((rows, list))
}

#[derive(Default)]
struct Reading<'t> {
    text: &'t [u8],
    /// The type of each name declared so far, both in capitals, and the line.
    kinds: BTreeMap<String, (String, u64)>,
    rows: Vec<(Place, Row)>,
    points: Vec<Point>,
    /// Tool and base, with the line of the FDAT that first stated them.
    frames: Option<(FdatFrames, u64)>,
    others: BTreeMap<String, usize>,
}

impl Reading<'_> {
    fn line(&mut self, line: &Line) -> Result<(), RowProblem> {
        match statement::parse(self.text, &line.code)? {
            None => Ok(()),
            Some(Statement::Declared(Declaration { kind, names })) => {
                let mut names = names.into_iter();
                names.try_for_each(|name| self.declare(name, &kind, line))
            }
            Some(Statement::Valued { kind, name, value }) => {
                self.mark(&name, value.clone())?;
                if let Some(kind) = &kind {
                    self.declare(name.variable.clone(), kind, line)?;
                }
                self.valued(line, &name, value)
            }
        }
    }

    /// Refuses a list with the mark of a corrected list: it is no list of targets.
    fn mark(&self, name: &statement::Name, value: Range<usize>) -> Result<(), RowProblem> {
        if name.variable != MARK {
            return Ok(());
        }
        let table = String::from_utf8_lossy(&self.text[value]);
        Err(KrlProblem::Marked {
            name: name.variable.clone(),
            table: table.trim_matches('"').to_owned(),
        }
        .into())
    }

    fn declare(&mut self, name: String, kind: &str, line: &Line) -> Result<(), RowProblem> {
        if name == MARK {
            self.mark(&statement::Name::of(&name), 0..0)?;
        }
        let own = (kind.to_owned(), line.number);
        match self.kinds.insert(name.clone(), own) {
            None => Ok(()),
            Some((_, first_line)) => Err(KrlProblem::DeclaredTwice { name, first_line }.into()),
        }
    }

    fn valued(
        &mut self,
        line: &Line,
        name: &statement::Name,
        value: Range<usize>,
    ) -> Result<(), RowProblem> {
        let declared = self.kinds.get(&name.variable);
        let declared = declared.map(|(kind, _)| kind.clone());
        let shown = || name.shown.clone();
        if name.is_part {
            let may_be_position = declared.as_deref().is_none_or(is_position);
            let wrong = || Err(KrlProblem::Component { name: shown() }.into());
            return if may_be_position { wrong() } else { Ok(()) };
        }
        let aggregate = aggregate::parse(self.text, value)?;
        let Some(aggregate) = aggregate else {
            let is_position = declared.as_deref().is_some_and(is_position);
            let wrong = || Err(KrlProblem::NoAggregate { name: shown() }.into());
            return if is_position { wrong() } else { Ok(()) };
        };
        if let (Some(kind), Some(own)) = (&declared, &aggregate.kind)
            && kind != own
            && is_position(kind) != is_position(own)
        {
            return Err(KrlProblem::OtherKind {
                name: shown(),
                kind: kind.clone(),
                own: own.clone(),
            }
            .into());
        }
        let known = aggregate.kind.clone().or(declared);
        let places = aggregate.has(&["X", "Y", "Z"]);
        match known.as_deref() {
            Some(kind) if is_position(kind) => {
                self.check_position(kind, name, &aggregate)?;
                if places == 0 {
                    *self.others.entry(kind.to_owned()).or_default() += 1;
                    return Ok(());
                }
                self.target(line, kind, shown(), &aggregate)
            }
            None if places > 0 => Err(KrlProblem::NoKind { name: shown() }.into()),
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

    /// Checks that a position has only components of its type, with numbers.
    fn check_position(
        &self,
        kind: &str,
        name: &statement::Name,
        at: &Aggregate,
    ) -> Result<(), RowProblem> {
        if !name.is_counted {
            let name = name.shown.clone();
            return Err(KrlProblem::NoIndex { name }.into());
        }
        if let Some(other) = at.other_than(components_of(kind)) {
            return Err(KrlProblem::OtherComponent {
                component: other.to_owned(),
                kind: kind.to_owned(),
            }
            .into());
        }
        at.whole(self.text, "T").map(drop)
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
        let [Some(x), Some(y), Some(z)] = ranges else { return Err(RowProblem::PartOfPosition) };
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
        Err(KrlProblem::SeveralFrames { first, first_line, other: found }.into())
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
