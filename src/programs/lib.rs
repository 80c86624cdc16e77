//! Robot programs as they lie on controllers → what their motions' positions are, and the same programs with corrected numbers.
//!
//! ```text
//! files ─→ lex ─→ dialects ──→ flow ─→ positions ─→ asked ─→ (corrections) ─→ write ─→ files
//!         tokens  statements   frames   Programs    poses in              numbers
//!                              at each              the arm's base        in place
//! ```
//! 1. [`read`] gives every position that a motion uses, with the frames that hold at the motion.
//! 2. [`Programs::ask`] makes a pose in the arm's base of a position, or says why it is not corrected.
//!    A frame that was touched with an arm holds its errors: [`taught`] finds where it really is.
//! 3. [`write::edits`] puts corrected poses back: every byte but the numbers of positions stays, and but marks. [`record`] says what
//!    was there, and gives the original back.
//!
//! A position is one of three: asked for, refused by name, or computed while the program runs. Nothing is guessed: where
//! a frame, a tool or a way through the program is not known, the position is refused.

mod ask;
mod edit;
mod fanuc;
mod flow;
mod frame;
mod further;
mod krl;
mod lex;
mod names;
mod postures;
mod program;
mod rapid;
mod reading;
pub mod record;
mod refusal;
pub mod taught;
mod urscript;
mod value;
pub mod write;

// Names of the crates below, as if they were modules here.
use posegrid_arm::{geometry, kinematics};

pub use ask::{Asked, Branch, Wanted};
pub use edit::Edit;
pub use frame::{Cell, CellError, CellFrame, ExternalAxes, Found, TaughtPoint, TruePlace};
pub use further::{ADDED, Further};
pub use postures::Postures;
use program::DIALECTS;
pub use program::{Computed, File, Path, Position, Programs, Split, Way};
use reading::Used;
pub use refusal::{Place, Refusal};
pub use value::Letters;

/// Whether a file belongs to a program or says something of its frames.
pub fn is_program(file: &File) -> bool {
    file.dialect().is_some() || rapid::is_configuration(file)
}

/// Everything that motions of these files use.
pub fn read(files: Vec<File>, cell: &Cell) -> Programs {
    let mut found = Used::default();
    let mut roots = vec![frame::Chain::default(); files.len()];
    for dialect in DIALECTS {
        let root;
        (found, root) = (dialect.read)(&files, cell, found);
        dialect.files(&files).for_each(|(place, _)| roots[place].clone_from(&root));
    }
    let marks = files.iter().map(write::mark).collect();
    let Used { positions, computed, paths } = found;
    Programs { files, positions, computed, paths, marks, roots }
}

impl Programs {
    /// Refuses positions that the controller of a calibrated arm reads in another way than this crate.
    pub fn hold(&mut self, arm: &kinematics::Arm) {
        self.hold_joints(arm);
        self.hold_poses(arm);
    }
}

#[cfg(test)]
mod tests;
