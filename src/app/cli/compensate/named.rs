//! TABLE → the file of a table: the file itself, or of a robot in a lake the table of its current run.

use std::path::{Path, PathBuf};

use super::{CompensateArgs, CompensateCommandError, Result};
use crate::cli::folder_given::{FolderGiven, entries};
use crate::files::store::Place;
use crate::io::lake::Lake;
use crate::io::rows::Word as _;
use crate::io::tables::words::CorrectingTable;
use crate::io::targets::{self, Form, Targets};
use crate::manifest::RunKey;
use crate::pipeline::history;

#[derive(Debug)]
pub(super) struct Named {
    pub(super) path: PathBuf,
    /// Which run and table of a robot it is, in words; `None` where the file itself was given.
    pub(super) words: Option<String>,
}

impl CompensateArgs {
    pub(super) fn check_folders(&self) -> Result<()> {
        if self.lake.is_none() && self.table.is_dir() {
            return Err(table_folder(&self.table));
        }
        if self.targets.is_dir() {
            let is_targets = |path: &Path| Form::of(path).is_ok();
            let wanted = "a file of targets: .csv, .parquet or .json";
            return Err(FolderGiven::new(&self.targets, wanted, 0, &is_targets).into());
        }
        if let Some(out) = self.out.as_deref().filter(|out| out.is_dir()) {
            let wanted = "a new file in it as --out, such as corrected.csv";
            return Err(FolderGiven::for_new_file(out, wanted).into());
        }
        Ok(())
    }

    pub(super) fn named(&self) -> Result<Named> {
        let path = self.table.clone();
        match &self.lake {
            Some(lake) => self.of_robot(lake),
            None if path.exists() => Ok(Named { path, words: None }),
            None => Err(CompensateCommandError::NoTable(path)),
        }
    }

    fn of_robot(&self, lake: &Path) -> Result<Named> {
        let lake = Lake::at(&Place::of(lake))?;
        let robot = self.table.to_string_lossy();
        let key = match &self.session {
            None => history::newest(&lake, &robot)?,
            Some(session) => current(&lake, &robot, session)?,
        };
        let table = self.table_of(&lake, &key)?;
        let place = lake.place(table.word(), &key)?;
        Ok(Named {
            words: Some(format!(
                "current run of robot {:?}: {}, of session {:?}; corrected by its table {}, {}",
                key.robot,
                key.run,
                key.session,
                table.word(),
                place.display()
            )),
            path: place.named(),
        })
    }

    /// The table asked for; without a wish the identified arm where every target states what it needs, otherwise the nodes.
    fn table_of(&self, lake: &Lake, key: &RunKey) -> Result<CorrectingTable> {
        let wanted = match self.by {
            Some(by) => vec![by],
            None if self.is_of_program() => vec![CorrectingTable::Calibrations],
            None if is_for_the_arm(&targets::read(&self.targets)?) => {
                vec![CorrectingTable::Calibrations, CorrectingTable::Compensation]
            }
            None => vec![CorrectingTable::Compensation, CorrectingTable::Calibrations],
        };
        for table in &wanted {
            if lake.has(table.word(), key)? {
                return Ok(*table);
            }
        }
        Err(CompensateCommandError::NoTableOfRun { key: key.clone(), table: wanted[0].word() })
    }
}

fn current(lake: &Lake, robot: &str, session: &str) -> Result<RunKey> {
    let current = lake.current(&RunKey::new(robot, session, ""))?;
    let run = current.ok_or_else(|| CompensateCommandError::NoRun {
        lake: lake.root(),
        robot: robot.to_owned(),
        session: session.to_owned(),
    })?;
    Ok(RunKey::new(robot, session, &run.run))
}

/// Whether every target states joint angles, or an orientation and an arm configuration.
fn is_for_the_arm(targets: &Targets) -> bool {
    targets.targets.iter().all(|target| {
        let is_whole_pose = target.orientation.is_some() && target.configuration.is_some();
        target.joints.is_some() || is_whole_pose
    })
}

fn table_folder(path: &Path) -> CompensateCommandError {
    let robots = folders_in(&path.join("runs"));
    if !robots.is_empty() {
        return CompensateCommandError::IsLake { path: path.to_owned(), robots };
    }
    FolderGiven::for_table(path, "a file of table compensation or calibrations").into()
}

/// The names of the folders in a folder, in order; none where it cannot be read.
fn folders_in(folder: &Path) -> Vec<String> {
    let folders = entries(folder).into_iter().filter(|path| path.is_dir());
    folders.filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned())).collect()
}
