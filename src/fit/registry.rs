//! The registry: every model there is, a line each, and what the rest of the program has to know of it.
//!
//! A model's own file says all of it in one [`About`]: its word in tables, its name for people, at which joint angles it is held
//! against stations, what it serves for, how it is made and how it is read back. Everything else (evaluation, residuals,
//! similarity, figures, pages, `compensate`) asks here. To add one: its file, its line below, and its word in the allowed
//! values of the schemas' columns of models.

mod base_target;
mod full;
mod geometric;
mod raw_command;
mod table;

use super::model::{Angles, PoseModel};
use super::models::{Models, Training};
use super::saved::{SavedError, SavedHead};
pub use geometric::IdentifiedGeometry;

/// Makes [`Model`] of a line for each: the variant, and the file that says what it is.
macro_rules! registry {
    ($($(#[$doc:meta])* $model:ident: $file:ident,)+) => {
        /// The models that are held side by side.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Model {
            $($(#[$doc])* $model,)+
        }

        impl Model {
            /// All of them, in the order in which people are shown them.
            pub const ALL: &[Self] = &[$(Self::$model),+];

            /// What the program has to know of it.
            pub const fn about(self) -> &'static About {
                match self {
                    $(Self::$model => &$file::ABOUT,)+
                }
            }
        }
    };
}

registry! {
    /// The command as it is, where command and target are one point and the base is surveyed or said to be fitted.
    RawCommand: raw_command,
    /// The nominal arm, base and target fitted.
    BaseTarget: base_target,
    /// The identified geometry.
    Geometric: geometric,
    /// The full error model.
    Full: full,
    /// The chosen compensation table.
    Table: table,
}

/// What the program has to know of a model.
#[derive(Debug)]
pub struct About {
    /// Its word in tables.
    pub word: &'static str,
    /// Its name on pages and in summaries.
    pub name: &'static str,
    /// The place of its colour and marks among those of charts.
    pub look: usize,
    /// The errors that it corrects.
    pub corrects: Corrects,
    /// The joint angles that it is held against stations at: for similarity the first, for a verdict the last that there is; none
    /// of a model that has no prediction at joint angles.
    pub angles: &'static [Angles],
    /// Whether grids, `compensate` and verdicts go by it where no later model of the registry serves.
    pub serves: bool,
    /// How it comes from stations.
    pub made: Made,
    /// Reads what [`PoseModel::saved`] wrote; `None` of a model that is not saved as text.
    pub load: Option<Load>,
}

/// What a model does about the errors of an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corrects {
    /// Nothing: its residuals are errors against commands.
    Nothing,
    /// Where base and target stand: its residuals are the errors of the arm.
    Frames,
    /// Errors, by prediction: its residuals are what it would leave.
    Predicted,
    /// Commands that were sent: its residuals are what is left.
    Commands,
}

/// How a model comes from stations.
#[derive(Debug, Clone, Copy)]
pub enum Made {
    /// It does not: the log has it, or the grid stage chooses it.
    Elsewhere,
    /// With every training: others build on it.
    Always(fn(&Models) -> Option<&dyn PoseModel>),
    /// From the stations and the models that every training makes, where figures are asked of it.
    OnTop(fn(&Training<'_>) -> Option<Box<dyn PoseModel>>),
}

/// Reads a saved model; its misfit per axis (mm) stands beside the text, where it has one.
pub type Load = fn(&str, Option<f64>) -> Result<Loaded, SavedError>;

/// A model that was read back.
pub struct Loaded {
    /// The arm and the sessions that it is of.
    pub head: SavedHead,
    /// The model.
    pub model: Box<dyn PoseModel>,
}

impl Model {
    /// The model of a table's word.
    pub fn of_word(word: &str) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|model| model.about().word == word)
    }

    /// Those that grids, `compensate` and verdicts go by, the best first.
    pub fn serving() -> impl Iterator<Item = Self> {
        let all = Self::ALL.iter().rev().copied();
        all.filter(|model| model.about().serves)
    }

    /// Those that verdicts go by, at the angles that say most of a program first: commanded ones, all that it has.
    pub fn judging() -> impl Iterator<Item = (Self, Angles)> {
        Self::serving().flat_map(|model| {
            let angles = model.about().angles.iter().rev();
            angles.map(move |angles| (model, *angles))
        })
    }

    /// Those that are held against stations, with the angles each is given.
    pub fn compared() -> impl Iterator<Item = (Self, Angles)> {
        let of = |model: &Self| {
            let model = *model;
            let angles = model.about().angles.iter();
            angles.map(move |angles| (model, *angles))
        };
        Self::ALL.iter().flat_map(of)
    }

    /// The name, with the angles where they make a difference.
    pub fn name_at(self, angles: Angles) -> String {
        let About {
            name,
            angles: several,
            ..
        } = self.about();
        if several.len() > 1 && angles == Angles::Commanded {
            format!("{name} from commands alone")
        } else {
            (*name).to_owned()
        }
    }

    /// Whether its residuals are against what was commanded.
    pub const fn is_against_commands(self) -> bool {
        matches!(
            self.about().corrects,
            Corrects::Nothing | Corrects::Commands
        )
    }
}
