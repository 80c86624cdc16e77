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
pub use further::ADDED;
use lex::Dialect;
pub use postures::Postures;
pub use program::{Added, Computed, File, Further, Path, Position, Programs, Split, Way};
pub use rapid::is_motion;
use reading::Used;
pub use refusal::{Place, Refusal};
pub use value::Letters;

/// Reads positions and motions of a dialect's files, behind those that are found already, and the arm's base.
type Read = fn(&[File], &Cell, Used) -> (Used, frame::Chain);
/// Marks a file as corrected, by words and the name of the table, beside its other edits.
type Mark = fn(&File, &str, &str, &[Edit]) -> Vec<Edit>;

const DIALECTS: [(&Dialect, Read, Mark); 4] = [
    (&krl::KRL, krl::read, write::behind_head_marks),
    (&rapid::RAPID, rapid::read, write::behind_head_marks),
    (&fanuc::FANUC, fanuc::read, fanuc::mark::marks),
    (&urscript::URSCRIPT, urscript::read, write::first_comment),
];

impl File {
    /// Its dialect by its ending; `None` for a file of no program.
    fn dialect(&self) -> Option<&'static Dialect> {
        let ending = self.ending();
        DIALECTS.into_iter().map(|(own, ..)| own).find(|own| own.endings.contains(&ending.as_str()))
    }

    /// Its dialect as records name it: `krl`.
    pub fn dialect_name(&self) -> Option<&'static str> {
        self.dialect().map(|own| own.name)
    }

    fn is_of(&self, dialect: &Dialect) -> bool {
        self.dialect_name() == Some(dialect.name)
    }
}

impl Dialect {
    /// Its files with their places among all.
    fn files<'f>(&'static self, files: &'f [File]) -> impl Iterator<Item = (usize, &'f File)> {
        files.iter().enumerate().filter(|(_, file)| file.is_of(self))
    }
}

/// Whether a file belongs to a program or says something of its frames.
pub fn is_program(file: &File) -> bool {
    file.dialect().is_some() || rapid::is_configuration(file)
}

/// Everything that motions of these files use.
pub fn read(files: Vec<File>, cell: &Cell) -> Programs {
    let mut found = Used::default();
    let mut roots = vec![frame::Chain::default(); files.len()];
    for (dialect, read, _) in DIALECTS {
        let root;
        (found, root) = read(&files, cell, found);
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
