//! Frames of a program by their names: where each has its value, and how the cell says it was found.

use std::collections::BTreeMap;
use std::fmt;

use crate::geometry::{Placement, PlacementError};
use nalgebra::Isometry3;
use serde::Deserialize;

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

    /// The product of its frames, each of which the cell knows.
    pub fn resolved(&self, cell: &Cell) -> Result<Isometry3<f64>, Refusal> {
        let mut frames = self.0.iter().map(|frame| cell.resolved(frame));
        frames.try_fold(Isometry3::identity(), |chain, frame| Ok(chain * frame?))
    }
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

/// How a frame was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// With an instrument: it is where it is.
    Surveyed,
    /// By touching with the arm: it holds the arm's errors.
    Taught,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellFrame {
    pub found: Found,
    /// Its value, where no file of the program has it.
    #[serde(default)]
    pub place: Option<Placement>,
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
    /// By their names in capitals or not, as the program has them.
    #[serde(default)]
    pub frames: BTreeMap<String, CellFrame>,
    /// Motion instructions of one's own, each like one of the controller's.
    #[serde(default)]
    pub motions: BTreeMap<String, String>,
}

impl Cell {
    pub fn check(&self) -> Result<(), PlacementError> {
        let placed = self.frames.values().filter_map(|frame| frame.place.as_ref());
        placed.map(Placement::isometry).try_for_each(|place| place.map(|_| ()))
    }

    fn frame(&self, name: &str) -> Option<&CellFrame> {
        let mut frames = self.frames.iter();
        frames.find(|(own, _)| own.eq_ignore_ascii_case(name)).map(|(_, frame)| frame)
    }

    /// The frame's place: that of the files where they have one. A frame at its parent's place needs no survey.
    fn resolved(&self, frame: &Frame) -> Result<Isometry3<f64>, Refusal> {
        let cell = self.frame(&frame.name);
        let stated = cell.and_then(|cell| cell.place.as_ref()?.isometry().ok());
        let place = match (&frame.value, stated) {
            (Ok(place), _) => *place,
            (Err(Refusal::NotGiven { .. }), Some(place)) => place,
            (Err(why), _) => return Err(why.clone()),
        };
        let name = || frame.name.clone();
        match cell.map(|cell| cell.found) {
            Some(Found::Surveyed) => Ok(place),
            Some(Found::Taught) => Err(Refusal::Taught { name: name() }),
            None if place == Isometry3::identity() => Ok(place),
            None => Err(Refusal::NotFound { name: name() }),
        }
    }
}

/// A frame without a value in the files.
pub fn not_given(name: &str, give: &str) -> Result<Isometry3<f64>, Refusal> {
    Err(Refusal::NotGiven { name: name.to_owned(), give: give.to_owned() })
}
