//! The registry: the list of all models, a line each, with the properties that the program needs of them.
//!
//! A model's own file states all properties in one [`About`]: its name in tables, its display name, the joint angles at which
//! it is compared with stations, its use, and how it is made and read back. All other code (evaluation, residuals,
//! similarity, figures, pages, `compensate`) looks here. A new model needs its file, its line below, and its name in the
//! allowed values of the schemas' columns of models.

mod full;
mod geometric;

use super::model::{Angles, PoseModel};
use super::models::Models;
use super::saved::{SavedError, SavedHead};
pub use geometric::IdentifiedGeometry;
use serde::{Deserialize, Serialize};

/// Makes [`Model`] from one line per model: the variant, and its properties.
macro_rules! registry {
    ($($(#[$doc:meta])* $model:ident: $about:expr,)+) => {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum Model {
            $($(#[$doc])* $model,)+
        }

        impl Model {
            pub const ALL: &[Self] = &[$(Self::$model),+];

            pub const fn about(self) -> &'static About {
                match self {
                    $(Self::$model => &$about,)+
                }
            }
        }
    };
}

registry! {
    RawCommand: RAW_COMMAND,
    BaseTarget: BASE_TARGET,
    Geometric: geometric::ABOUT,
    Full: full::ABOUT,
    Table: TABLE,
}

const RAW_COMMAND: About = About {
    word: "raw_command",
    name: "raw command",
    look: 1,
    corrects: Corrects::Nothing,
    angles: &[],
    serves: false,
    of_training: None,
    load: None,
};

/// The nominal arm with the best fitting frames.
const BASE_TARGET: About = About {
    word: "base_target",
    name: "base and target fitted",
    look: 1,
    corrects: Corrects::Frames,
    angles: &[Angles::Reported],
    serves: false,
    of_training: Some(|models| Some(&models.base_target)),
    load: Some(geometric::load),
};

/// Only the table's names are here; its predictions are in [`crate::compensation::table`].
const TABLE: About = About {
    word: "table",
    name: "compensation table",
    look: 3,
    corrects: Corrects::Commands,
    angles: &[],
    serves: false,
    of_training: None,
    load: None,
};

#[derive(Debug)]
pub struct About {
    pub word: &'static str,
    pub name: &'static str,
    /// Index of its colour and marks among those of charts.
    pub look: usize,
    pub corrects: Corrects,
    /// The joint angles at which it is compared with stations: similarity uses the first, a verdict the last available; empty
    /// for a model without predictions at joint angles.
    pub angles: &'static [Angles],
    /// Whether grids, `compensate` and verdicts use it when no later model of the registry is available.
    pub serves: bool,
    /// The model of a training; `None` for one that is not made from stations: the log has it, or the grid stage chooses it.
    pub of_training: Option<OfTraining>,
    /// Reads the text of [`PoseModel::saved`]; `None` for a model that is not saved as text.
    pub load: Option<Load>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corrects {
    /// Nothing: its residuals are attained minus commanded positions.
    Nothing,
    /// The places of base and measured target: its residuals are the errors of the arm.
    Frames,
    /// Errors, by prediction: its residuals are the errors that would remain.
    Predicted,
    /// Commands that were sent: its residuals are the errors that remained.
    Commands,
}

pub type OfTraining = fn(&Models) -> Option<&dyn PoseModel>;

/// Reads a saved model from its text and its misfit per axis (mm), which is stored separately where it has one.
pub type Load = fn(&str, Option<f64>) -> Result<Loaded, SavedError>;

pub struct Loaded {
    pub head: SavedHead,
    pub model: Box<dyn PoseModel>,
}

impl Model {
    /// The model with this name in tables; `None` for another text.
    pub fn of_word(word: &str) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|model| model.about().word == word)
    }

    /// The models that grids, `compensate` and verdicts use, the best first.
    pub fn serving() -> impl Iterator<Item = Self> {
        Self::ALL.iter().rev().copied().filter(|model| model.about().serves)
    }

    /// The models that verdicts use with their angles, the most relevant for a program first: commanded angles, all it has.
    pub fn judging() -> impl Iterator<Item = (Self, Angles)> {
        Self::serving().flat_map(|model| model.with_angles().rev())
    }

    /// The models that are compared with stations, with the angles each is given.
    pub fn compared() -> impl Iterator<Item = (Self, Angles)> {
        Self::ALL.iter().flat_map(|model| model.with_angles())
    }

    fn with_angles(self) -> impl DoubleEndedIterator<Item = (Self, Angles)> {
        self.about().angles.iter().map(move |angles| (self, *angles))
    }

    pub fn name_at(self, angles: Angles) -> String {
        let About { name, angles: several, .. } = self.about();
        if several.len() > 1 && angles == Angles::Commanded {
            format!("{name} from commands alone")
        } else {
            (*name).to_owned()
        }
    }

    /// Whether its residuals are attained minus commanded positions.
    pub const fn is_against_commands(self) -> bool {
        matches!(self.about().corrects, Corrects::Nothing | Corrects::Commands)
    }
}

impl Models {
    /// The model of a registry entry; `None` where this training does not have it.
    pub fn get(&self, model: Model) -> Option<&dyn PoseModel> {
        (model.about().of_training?)(self)
    }

    /// The best model for grids and compensation: the full error model, or without it the geometry.
    pub fn best(&self) -> (Model, &dyn PoseModel) {
        let mut serving = Model::serving().filter_map(|model| Some((model, self.get(model)?)));
        serving.next().unwrap_or((Model::Geometric, &self.geometric))
    }
}
