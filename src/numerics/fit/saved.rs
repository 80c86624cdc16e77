//! Saved models: an identified arm as JSON, and back, so that a later program predicts with the same covariance.
//!
//! Numbers are written so that reading them gives them back to the last digit or the one before. A text may come
//! from anywhere: every length is compared with the others before it is used.

use nalgebra::{DMatrix, DVector, Unit, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::conversion::Errors;
use super::{Anchor, Calibration, Frames, Gauge, Owner, Plane, Sees, Unknown};
use crate::geometry::saved::SavedPlacement;
use crate::geometry::{PlacementError, Transform};
use crate::join::SeveralSources;
use crate::kinematics::{Arm, Chain, Parameter, named};

/// Version of the JSON texts; raised by every change that an older reader would not understand.
pub const VERSION: u32 = 3;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum SavedError {
    #[error("the saved model cannot be read: {0}; was it written by another program?")]
    Json(String),
    #[error(
        "the saved model has version {found}, this program reads {VERSION}: use a matching version of posegrid"
    )]
    Version { found: u32 },
    #[error("the saved model is damaged: {found} {what}, but the rest of it needs {expected}")]
    Length { what: &'static str, expected: usize, found: usize },
    #[error("the saved model is damaged: {what}: {source}")]
    Placement { what: &'static str, source: PlacementError },
    #[error("the saved model is damaged: its arm has no unknown {0} there")]
    Unknown(Parameter),
    #[error("the saved model is damaged: the factor of its covariance {problem}")]
    Factor { problem: &'static str },
    #[error(
        "the saved model has no covariance of its own, and no misfit (misfit_mm) is stored beside it"
    )]
    NoMisfit,
    #[error("the saved model has {0}")]
    SeveralSources(#[from] SeveralSources),
}

/// The first fields of every saved model: its arm and sessions.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct SavedHead {
    pub arm: Arm,
    pub sessions: Vec<SavedSession>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedSession {
    pub session: String,
    pub tracker_from_base: SavedPlacements,
    pub flange_from_target: SavedPlacements,
    /// What each source reads; absent where each reads places.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sees: Vec<SavedSees>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum SavedSees {
    Places,
    Nothing,
    Distance {
        xyz_mm: [f64; 3],
        offset_mm: f64,
    },
    Height {
        /// The plane's normal in the base's frame, of length 1.
        normal: [f64; 3],
        /// Its distance from the base's origin along the normal, mm.
        height_mm: f64,
    },
}

impl SavedSees {
    /// The saved form of what sources read; empty where each reads places.
    fn all(sees: &[Sees]) -> Vec<Self> {
        if sees.iter().all(|own| *own == Sees::Places) {
            return Vec::new();
        }
        sees.iter().map(Self::of).collect()
    }

    fn of(sees: &Sees) -> Self {
        match sees {
            Sees::Places => Self::Places,
            Sees::Nothing => Self::Nothing,
            Sees::Length(Gauge::Distance(anchor)) => {
                Self::Distance { xyz_mm: anchor.place.coords.into(), offset_mm: anchor.offset_mm }
            }
            Sees::Length(Gauge::Height(plane)) => Self::Height {
                normal: plane.normal.into_inner().into(),
                height_mm: plane.height_mm,
            },
        }
    }

    fn sees(&self) -> Sees {
        match *self {
            Self::Places => Sees::Places,
            Self::Nothing => Sees::Nothing,
            Self::Distance { xyz_mm, offset_mm } => {
                Sees::Length(Gauge::Distance(Anchor { place: xyz_mm.into(), offset_mm }))
            }
            Self::Height { normal, height_mm } => {
                let normal = Unit::new_normalize(Vector3::from(normal));
                Sees::Length(Gauge::Height(Plane::new(normal, height_mm)))
            }
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SavedPlacements {
    One(SavedPlacement),
    /// The placements of each source or target, in their order.
    Several(Vec<SavedPlacement>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedUnknown {
    /// Index of its session among the saved ones; `None` for the arm's geometry.
    pub session: Option<usize>,
    /// Place of the source or target that it is of among those of its session; the first where it is absent.
    #[serde(default, skip_serializing_if = "is_first")]
    pub of: usize,
    #[serde(with = "named")]
    pub parameter: Parameter,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
const fn is_first(place: &usize) -> bool {
    *place == 0
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedCalibration {
    pub version: u32,
    pub arm: Arm,
    /// Offsets of the arm's free parameters, in its order; zeros where geometry was fixed.
    pub geometry: Vec<f64>,
    pub sessions: Vec<SavedSession>,
    pub unknowns: Vec<SavedUnknown>,
    pub prior_sd: Vec<Option<f64>>,
    /// Covariance of the unknowns' offsets: row i has its first i + 1 columns.
    pub covariance: Vec<Vec<f64>>,
}

impl SavedSession {
    pub fn all(names: &[&str], frames: &[Frames]) -> Vec<Self> {
        let session = |(name, frames): (&&str, &Frames)| Self {
            session: (*name).to_owned(),
            tracker_from_base: SavedPlacements::of(frames.sources()),
            flange_from_target: SavedPlacements::of(frames.targets()),
            sees: SavedSees::all(frames.sees()),
        };
        names.iter().zip(frames).map(session).collect()
    }

    pub fn frames(&self) -> Result<Frames, SavedError> {
        let sources = self.tracker_from_base.frames("tracker_from_base")?;
        let targets = self.flange_from_target.frames("flange_from_target")?;
        let (counts, frames) =
            ((sources.len().min(targets.len()), sources.len()), Frames::new(sources, targets));
        if !self.sees.is_empty() {
            same_length("sources and what they read", counts.1, self.sees.len())?;
        }
        let sees: Vec<Sees> = self.sees.iter().map(SavedSees::sees).collect();
        frames.map(|frames| frames.seeing(&sees)).ok_or(SavedError::Length {
            what: "frames of sources or targets in a session",
            expected: 1,
            found: counts.0,
        })
    }
}

impl SavedPlacements {
    fn of<A, B>(frames: &[Transform<A, B>]) -> Self {
        let saved = |frame: &Transform<A, B>| SavedPlacement::from(frame.isometry());
        match frames {
            [one] => Self::One(saved(one)),
            several => Self::Several(several.iter().map(saved).collect()),
        }
    }

    /// The frames; `what` is placed.
    fn frames<A, B>(&self, what: &'static str) -> Result<Vec<Transform<A, B>>, SavedError> {
        let all = match self {
            Self::One(one) => std::slice::from_ref(one),
            Self::Several(several) => several,
        };
        let wrong = |source| SavedError::Placement { what, source };
        let frame = |saved: &SavedPlacement| Ok(Transform::claim((*saved).try_into()?));
        let frames = all.iter().map(frame).collect::<Result<_, _>>();
        frames.map_err(wrong)
    }
}

impl SavedUnknown {
    pub fn of(unknown: &Unknown) -> Self {
        Self {
            session: unknown.session(),
            of: match unknown.owner {
                Owner::Arm => 0,
                Owner::Source { source, .. } => source.0,
                Owner::Target { target, .. } => target.0,
            },
            parameter: unknown.parameter,
        }
    }
}

impl SavedCalibration {
    /// The saved form of a calibration of `arm` on the sessions `names`.
    pub fn of(calibration: &Calibration, arm: &Arm, names: &[&str]) -> Self {
        let covariance = &calibration.covariance;
        let row = |i: usize| (0..=i).map(|j| covariance[(i, j)]).collect();
        Self {
            version: VERSION,
            arm: arm.clone(),
            geometry: calibration.geometry.clone(),
            sessions: SavedSession::all(names, &calibration.frames),
            unknowns: calibration.unknowns.iter().map(SavedUnknown::of).collect(),
            prior_sd: calibration.prior_sd.clone(),
            covariance: (0..covariance.nrows()).map(row).collect(),
        }
    }

    pub fn read(text: &str) -> Result<Self, SavedError> {
        let saved: Self = read(text)?;
        same_length("prior deviations", saved.unknowns.len(), saved.prior_sd.len())?;
        same_length("rows of the covariance", saved.unknowns.len(), saved.covariance.len())?;
        for (row, columns) in saved.covariance.iter().enumerate() {
            same_length("columns in a row of the covariance", row + 1, columns.len())?;
        }
        let of_arm = saved.arm.chain().parameters();
        same_length("geometry offsets", of_arm.len(), saved.geometry.len())?;
        let is_absent =
            |own: &Parameter| matches!(own, Parameter::Link { .. }) && !of_arm.contains(own);
        let mut unknowns = saved.unknowns.iter().map(|own| own.parameter);
        unknowns.find(is_absent).map_or(Ok(saved), |own| Err(SavedError::Unknown(own)))
    }

    /// The offset of a parameter of the arm's; zero of another, which the frames have applied.
    pub fn offset(&self, parameter: Parameter) -> f64 {
        let place = self.arm.chain().parameters().into_iter().position(|own| own == parameter);
        place.map_or(0.0, |place| self.geometry[place])
    }

    /// The offsets of the arm's parameters and their covariance, with those of the first source and target of the last session, which
    /// are zero: its frames have them applied.
    pub fn errors(&self) -> Errors {
        let last = self.sessions.len().checked_sub(1);
        let is_of_arm = |own: &SavedUnknown| own.session.is_none();
        let kept = self.unknowns.iter().enumerate();
        let kept = kept.filter(|(_, own)| is_of_arm(own) || (own.session == last && own.of == 0));
        let kept: Vec<usize> = kept.map(|(place, _)| place).collect();
        let parameters = kept.iter().map(|&place| self.unknowns[place].parameter);
        let offsets = parameters.clone().map(|own| self.offset(own));
        let entry = |row: usize, column: usize| {
            let (row, column) = (kept[row], kept[column]);
            self.covariance[row.max(column)][row.min(column)]
        };
        Errors {
            offsets: DVector::from_iterator(kept.len(), offsets),
            covariance: DMatrix::from_fn(kept.len(), kept.len(), entry),
            parameters: parameters.collect(),
        }
    }

    pub fn chain(&self) -> Chain {
        self.arm.chain().with_offsets(&self.geometry)
    }
}

/// Reads a saved model from its JSON text, or the [`SavedHead`] of any.
pub fn read<T: for<'de> Deserialize<'de>>(text: &str) -> Result<T, SavedError> {
    /// The version alone: another version's text has another shape.
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
    }
    let json = |error: serde_json::Error| SavedError::Json(error.to_string());
    let found = serde_json::from_str::<Versioned>(text).map_err(json)?.version;
    if found != VERSION {
        return Err(SavedError::Version { found });
    }
    serde_json::from_str(text).map_err(json)
}

pub(super) const fn same_length(
    what: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), SavedError> {
    if expected == found { Ok(()) } else { Err(SavedError::Length { what, expected, found }) }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::kinematics::RobotFile;

    fn ur10() -> Arm {
        let file: RobotFile = toml::from_str(include_str!("../../../pipelines/robots/ur10.toml"))
            .expect("a robot file");
        // A saved arm predicts; where its home is matters to who sets up the cell.
        let file = RobotFile { home_deg: None, ..file };
        file.arm().expect("a valid arm")
    }

    #[test]
    fn an_arm_read_back_equals_the_arm_saved() {
        let arm = ur10();
        let text = serde_json::to_string(&arm).expect("JSON");
        let saved: Arm = serde_json::from_str(&text).expect("the same shape");
        let joints = [0.3, -1.2, 1.5, -0.4, 0.9, 2.0];
        let (there, back) = (arm.chain().nominal(&joints), saved.chain().nominal(&joints));
        assert!((there.to_homogeneous() - back.to_homogeneous()).abs().max() < 1e-12);
        assert_eq!(saved, arm);
    }

    #[test]
    fn a_damaged_arm_is_refused() {
        let sound = serde_json::to_string(&ur10()).expect("JSON");
        let cases = [
            (r#""joint":5"#, r#""joint":18446744073709551615"#, "has 6 joints"),
            ("theta_1", "theta_99", "theta_99"),
            (r#""rz""#, r#""rw""#, "rw"),
            ("[1.0,0.0", "[0.0,0.0", "invertible"),
        ];
        for (part, damaged, expected) in cases {
            let text = sound.replacen(part, damaged, 1);
            let error = serde_json::from_str::<Arm>(&text).expect_err("damaged").to_string();
            assert!(error.contains(expected), "{expected}: {error}");
        }
        let turned = SavedPlacement { xyz_mm: [0.0; 3], quaternion_xyzw: [0.0; 4] };
        let error = Isometry3::try_from(turned).expect_err("no rotation");
        assert_eq!(error, PlacementError::NotUnit { norm: 0.0 });
        let found = VERSION + 1;
        let text = format!(r#"{{"version": {found}}}"#);
        let later = read::<SavedCalibration>(&text).expect_err("later");
        assert_eq!(later, SavedError::Version { found });
    }
}
