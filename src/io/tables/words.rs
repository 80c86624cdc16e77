//! Enumerations ↔ the words that the schemas allow, each pair once; and the columns of frames and covariances.

use std::sync::Arc;

use nalgebra::UnitQuaternion;

use crate::fit::Identifiability;
use crate::fit::scale::ScaleVerdict;
use crate::geometry::TurnCovariance;
use crate::grid::{Interpolation, Judgement, Refusal, Source, Verdict};
use crate::ingest::SpanClock;
use crate::kinematics::Joint;
use crate::report::verdict::Applied;
use crate::report::{Angles, BaseRefit, Model, Moment, Point, Split};
use crate::rows::{Word, words};
use crate::similarity::{Alikeness, Quantity, Shape, Space};
use crate::units::SLIDE_MM_PER_RAD;

words! {
    /// Whether a tolerance is met; where that is not shown, the reason is in a column of its own.
    #[derive(Default)]
    pub enum TableVerdict {
        Met: "met",
        NotMet: "not_met",
        #[default]
        NotShown: "not_shown",
    }

    pub enum VerdictOf {
        /// The nodes of the chosen table.
        Compensation: "compensation",
        /// The arm as the best model identified it.
        Calibrations: "calibrations",
        /// None, as no correction helps: the nominal arm on its fitted base.
        Nothing: "nothing",
        SamplingPlan: "sampling_plan",
    }

    /// What part the stations of a split had in the fit.
    pub enum Role {
        Training: "training",
        /// They took no part.
        HeldOut: "held_out",
    }

    /// Tables that commands are corrected by.
    pub enum CorrectingTable {
        /// Nodes with an error each.
        Compensation: "compensation",
        Calibrations: "calibrations",
    }

    /// Forms of the files that `posegrid compensate` writes.
    pub enum CorrectedForm {
        Csv: "csv",
        Parquet: "parquet",
        Json: "json",
        /// A file of a program in KRL; of versions before 0.3.0 a data list of KUKA.
        Krl: "krl",
        Rapid: "rapid",
        /// A listing of FANUC's teach pendant.
        Fanuc: "fanuc",
        UrScript: "urscript",
    }

    pub enum Unit {
        Mm: "mm",
        Rad: "rad",
        /// None: a ratio.
        One: "1",
    }
}

impl VerdictOf {
    /// The table's name for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Compensation => Applied::Table.words(),
            Self::Calibrations => Applied::IdentifiedArm.words(),
            Self::Nothing => Applied::Nothing.words(),
            Self::SamplingPlan => "plan",
        }
    }
}

impl From<Applied> for VerdictOf {
    fn from(applied: Applied) -> Self {
        match applied {
            Applied::Table => Self::Compensation,
            Applied::IdentifiedArm => Self::Calibrations,
            Applied::Nothing => Self::Nothing,
        }
    }
}

impl Word for Model {
    fn word(self) -> &'static str {
        self.about().word
    }

    fn of_word(word: &str) -> Option<Self> {
        Self::of_word(word)
    }
}

words! {
    Angles { Reported: "reported", Weighted: "weighted", Commanded: "commanded" }
    Split { None: "none", Blocks: "blocks", Session: "session" }
    BaseRefit { None: "none", First: "first", Chosen: "chosen", All: "all" }
    Moment { Before: "measured", After: "predicted", MeasuredAfter: "measured_after" }
    Point { Measured: "measured_point", Tool: "tool_point", Tip: "tool_tip" }
    ScaleVerdict { Named: "named", NotNamed: "not_named", NotShown: "not_shown" }
    Identifiability {
        Identifiable: "identifiable",
        MovesNothing: "moves_nothing",
        StructurallyDependent: "structurally_dependent",
        Weak: "weak",
        Confounded: "confounded",
        ByConvention: "by_convention",
    }
    Judgement { LocalCell: "local_cell", Table: "table" }
    Space { Joint: "joint", Cartesian: "cartesian" }
    Quantity { X: "x", Y: "y", Z: "z", Norm: "norm" }
    Shape { Spherical: "spherical", Exponential: "exponential", Gaussian: "gaussian" }
    Alikeness { Rising: "similar", Flat: "flat", TooFewPairs: "not_shown" }
}

/// Enumerations that know their names themselves.
macro_rules! named {
    ($($enumeration:ident { $($value:ident),+ })+) => {$(
        impl Word for $enumeration {
            fn word(self) -> &'static str {
                self.name()
            }

            fn of_word(word: &str) -> Option<Self> {
                [$(Self::$value),+].into_iter().find(|own| own.name() == word)
            }
        }
    )+};
}
named! {
    Source { Measured, Model }
    Interpolation { Idw, Trilinear }
    Refusal { OutOfReach, Singularity, OtherConfiguration, Unmeasured, Branches }
    SpanClock { Controller, Tracker, Log }
}

impl From<&Verdict> for TableVerdict {
    fn from(verdict: &Verdict) -> Self {
        match verdict {
            Verdict::Meets => Self::Met,
            Verdict::DoesNotMeet => Self::NotMet,
            Verdict::NotShown(_) => Self::NotShown,
        }
    }
}

impl From<Split> for Role {
    fn from(split: Split) -> Self {
        match split {
            Split::None => Self::Training,
            Split::Blocks | Split::Session => Self::HeldOut,
        }
    }
}

impl Unit {
    /// The unit with this name; without a name it is 1.
    pub(super) fn named(name: &str) -> Self {
        Self::of_word(name).unwrap_or(Self::One)
    }
}

pub(super) fn reason(verdict: &Verdict) -> Option<&str> {
    match verdict {
        Verdict::NotShown(reason) => Some(reason),
        Verdict::Meets | Verdict::DoesNotMeet => None,
    }
}

/// The unit of each joint's variable; `None` where all turn.
pub(crate) fn joint_units(joints: &[Joint]) -> Option<Arc<[String]>> {
    let unit = |joint: &Joint| if joint.slides { Unit::Mm } else { Unit::Rad };
    let slides = joints.iter().any(|joint| joint.slides);
    let units = joints.iter().map(|joint| unit(joint).word().to_owned());
    slides.then(|| units.collect())
}

/// Radians that one unit of each joint's variable counts as, from the units of [`joint_units`]; empty without them.
pub(crate) fn counted(units: Option<&[String]>) -> Vec<f64> {
    let of_unit = |unit: &String| {
        if unit == Unit::Mm.word() { 1.0 / SLIDE_MM_PER_RAD } else { 1.0 }
    };
    units.unwrap_or_default().iter().map(of_unit).collect()
}

pub(crate) fn xyzw(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    rotation.coords.into()
}

/// The orientation's own covariance that a reading states, rad²: three rows of three.
pub(super) fn orientation_rows(stated: TurnCovariance) -> Vec<f64> {
    let own = stated.matrix();
    own.transpose().iter().copied().collect()
}
