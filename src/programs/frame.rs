//! Frames of a program by their names: where each has its value, and how the cell says it was found.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::PathBuf;

use crate::geometry::{Placement, PlacementError};
use nalgebra::Isometry3;
use serde::Deserialize;
use thiserror::Error;

use crate::lex::capitals;
use crate::refusal::Refusal;

/// A frame that a program names, or writes out.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// As the cell names it: `BASE_DATA[5]`, `wobj1.uframe`.
    pub name: String,
    /// Its value in the files; otherwise why there is none.
    pub value: Result<Isometry3<f64>, Refusal>,
}

/// Frames one behind the other; none is the identity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chain(pub Vec<Frame>);

impl Chain {
    pub fn one(name: impl Into<String>, value: Result<Isometry3<f64>, Refusal>) -> Self {
        Self(vec![Frame { name: name.into(), value }])
    }

    /// The last of its frames in the arm's base, whose own place in the world `root` has.
    pub(crate) fn in_arm(&self, root: &Self, cell: &Cell) -> Result<Placed, Refusal> {
        let stated = root.stated(cell)?.inverse();
        let actual = root.placed(cell, Isometry3::identity(), Ok(Isometry3::identity()));
        self.placed(cell, stated, actual.map(|root| root.actual.inverse()))
    }

    /// A tool in the flange frame.
    pub(crate) fn on_flange(&self, cell: &Cell) -> Result<Placed, Refusal> {
        self.placed(cell, Isometry3::identity(), Ok(Isometry3::identity()))
    }

    /// The product of its frames as the controller has them.
    pub(crate) fn stated(&self, cell: &Cell) -> Result<Isometry3<f64>, Refusal> {
        let mut frames = self.0.iter().map(|frame| cell.value(frame));
        frames.try_fold(Isometry3::identity(), |chain, frame| Ok(chain * frame?))
    }

    /// The last of its frames behind one that stands at `stated`, and really at `actual`. Where a taught frame stands was touched, so that
    /// nothing has to be known of those before it.
    fn placed(
        &self,
        cell: &Cell,
        mut stated: Isometry3<f64>,
        mut actual: Result<Isometry3<f64>, Refusal>,
    ) -> Result<Placed, Refusal> {
        for frame in &self.0 {
            let value = cell.value(frame)?;
            stated *= value;
            let name = || frame.name.clone();
            actual = match cell.frame(&frame.name) {
                Some(own) if own.is_taught() => cell.true_place(&frame.name, &stated),
                Some(own) if own.found.is_some() => actual.map(|before| before * value),
                _ if value == Isometry3::identity() => actual,
                _ => Err(Refusal::NotFound { name: name() }),
            };
        }
        Ok(Placed { stated, actual: actual? })
    }

    /// Calls `each` with the taught frames of the chain and where the controller has them behind `from`.
    pub(crate) fn each_taught(
        &self,
        cell: &Cell,
        from: Isometry3<f64>,
        mut each: impl FnMut(&str, &Isometry3<f64>),
    ) {
        let mut stated = from;
        for frame in &self.0 {
            let Ok(value) = cell.value(frame) else { return };
            stated *= value;
            if cell.frame(&frame.name).is_some_and(CellFrame::is_taught) {
                each(&frame.name, &stated);
            }
        }
    }
}

/// A frame as the controller has it, and where it really is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placed {
    pub(crate) stated: Isometry3<f64>,
    pub(crate) actual: Isometry3<f64>,
}

impl fmt::Display for Chain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("none");
        }
        let names: Vec<&str> = self.0.iter().map(|frame| frame.name.as_str()).collect();
        f.write_str(&names.join(" : "))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// With an instrument: it is where it is.
    Surveyed,
    /// By touching with the arm: it holds the arm's errors.
    Taught,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CellFrame {
    pub found: Option<Found>,
    /// Of a taught frame the file of table `calibrations` of the arm that touched it, as the arm was then.
    pub taught_with: Option<PathBuf>,
    /// The tool that touched a base, in the flange frame.
    pub tool: Option<Placement>,
    /// The points that were touched: of a base two on its x-axis and one of its xy-plane, of a tool four poses or more with its tip at one
    /// point.
    pub points: Vec<TaughtPoint>,
    /// Its value, where no file of the program has it.
    pub place: Option<Placement>,
}

impl CellFrame {
    fn is_taught(&self) -> bool {
        self.found == Some(Found::Taught) || self.taught_with.is_some()
    }
}

/// Where the controller stood while a point was touched: its joints, or the tool in the world with the arm configuration.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TaughtPoint {
    /// mm of a joint that slides.
    pub joints_deg: Option<Vec<f64>>,
    pub pose: Option<Placement>,
    /// S of KUKA.
    pub status: Option<u8>,
    /// cf1, cf4, cf6 and cfx of ABB.
    pub cf: Option<[i32; 4]>,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum CellError {
    #[error(transparent)]
    Placement(#[from] PlacementError),
    #[error("[frames.{name:?}] is found = \"surveyed\" and taught_with an arm; one of them holds")]
    Both { name: String },
    #[error(
        "[frames] has {name:?} twice: in names of frames capitals do not count; keep one of the two"
    )]
    Twice { name: String },
    #[error(
        "[motions] {name} = {like:?}: no motion instruction of ABB's that is followed; write the one whose arguments it has, as MoveL or ArcL"
    )]
    Motion { name: String, like: String },
    #[error(
        "[frames.{name:?}]: a point is stated by joints_deg, or by pose with status (S of KUKA) or cf (cf1, cf4, cf6, cfx of ABB)"
    )]
    Point { name: String },
}

/// Where a taught frame really is.
#[derive(Debug, Clone, PartialEq)]
pub struct TruePlace {
    pub name: String,
    /// Where the controller has it: a base in the arm's, a tool in the flange frame.
    pub stated: Isometry3<f64>,
    /// Likewise; otherwise why that is not known.
    pub actual: Result<Isometry3<f64>, String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExternalAxes {
    /// They carry neither the arm nor what it works at.
    Apart,
}

/// What the files of a program do not say: how its frames were found.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    #[serde(default)]
    pub external_axes: Option<ExternalAxes>,
    /// Routines of no file that move nothing, and set no frame, tool, displacement or mode.
    #[serde(default)]
    pub harmless: Vec<String>,
    /// By their names in capitals or not, as the program has them.
    #[serde(default)]
    pub frames: BTreeMap<String, CellFrame>,
    /// Motion instructions of one's own, each like one of the controller's.
    #[serde(default)]
    pub motions: BTreeMap<String, String>,
    /// Where each taught frame really is: worked out from its points, never read from a file.
    #[serde(skip)]
    pub true_places: Vec<TruePlace>,
}

impl Cell {
    /// `is_motion` tells the controller's instructions that others may be like.
    pub fn check(&self, is_motion: impl Fn(&str) -> bool) -> Result<(), CellError> {
        if let Some((name, like)) = self.motions.iter().find(|(_, like)| !is_motion(like)) {
            return Err(CellError::Motion { name: name.clone(), like: like.clone() });
        }
        let mut names = BTreeSet::new();
        for (name, frame) in &self.frames {
            if !names.insert(capitals(name.as_bytes())) {
                return Err(CellError::Twice { name: name.clone() });
            }
            let poses = frame.points.iter().filter_map(|point| point.pose.as_ref());
            for place in frame.place.iter().chain(&frame.tool).chain(poses) {
                place.isometry()?;
            }
            if frame.found == Some(Found::Surveyed) && frame.taught_with.is_some() {
                return Err(CellError::Both { name: name.clone() });
            }
            if !frame.points.iter().all(TaughtPoint::is_stated_once) {
                return Err(CellError::Point { name: name.clone() });
            }
        }
        Ok(())
    }

    pub fn frame(&self, name: &str) -> Option<&CellFrame> {
        let name = capitals(name.as_bytes());
        self.frames.iter().find(|(own, _)| capitals(own.as_bytes()) == name).map(|(_, frame)| frame)
    }

    /// A frame's value as the controller has it: that of the files where they have one.
    fn value(&self, frame: &Frame) -> Result<Isometry3<f64>, Refusal> {
        let stated = || self.frame(&frame.name)?.place.as_ref()?.isometry().ok();
        match &frame.value {
            Err(why @ Refusal::NotGiven { .. }) => stated().ok_or_else(|| why.clone()),
            Err(_) => frame.value.clone(),
            Ok(value) => {
                // Each set_tcp of a script gives that name another one.
                let away =
                    stated().filter(|_| frame.name != "tcp").map(|own| own.inverse() * value);
                let differs = |own: Isometry3<f64>| {
                    own.translation.vector.norm() > 1e-3 || own.rotation.angle() > 1e-5
                };
                if away.is_some_and(differs) {
                    return Err(Refusal::Other(format!(
                        "{} has another place in the file of the cell than in the program's files; take one of the two out",
                        frame.name
                    )));
                }
                Ok(*value)
            }
        }
    }

    fn true_place(&self, name: &str, stated: &Isometry3<f64>) -> Result<Isometry3<f64>, Refusal> {
        let taught = || Refusal::Taught { name: name.to_owned() };
        let place = self.true_places.iter().find(|own| own.name == name && own.stated == *stated);
        let told = |why| Refusal::Other(format!("{name} is taught with an arm: {why}"));
        place.ok_or_else(taught)?.actual.clone().map_err(told)
    }
}

impl TaughtPoint {
    const fn is_stated_once(&self) -> bool {
        match (&self.joints_deg, &self.pose, &self.status, &self.cf) {
            (Some(_), None, None, None) => true,
            (None, Some(_), status, cf) => status.is_some() != cf.is_some(),
            _ => false,
        }
    }
}

/// A frame without a value in the files.
pub fn not_given(name: &str, give: &str) -> Result<Isometry3<f64>, Refusal> {
    Err(Refusal::NotGiven { name: name.to_owned(), give: give.to_owned() })
}
