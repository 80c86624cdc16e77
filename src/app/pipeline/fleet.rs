//! A fleet: the robots of one pipeline file, each with its configuration.
//!
//! Input is the path of a pipeline file and the options of the command line; output is a [`Fleet`]. A file of one robot is a fleet of one.
//! 1. The robots are read from `[[robots]]`, or from the table that `[input] robots` names ([`Robots`]).
//! 2. The file of each robot is the common one with the robot's settings put into it; it makes a [`Configuration`] as a file of its own
//!    does, with the same names of runs.
//! 3. Sessions belong to robots by folder, by file name, by the logs' metadata or by a column of tables; those of no robot wait, with the
//!    reason (`recorded`).
//! 4. What is wrong with one robot stays with it.

mod recorded;

use std::collections::BTreeMap;
use std::path::Path;

use super::configuration::files::Source;
use super::configuration::{
    Configuration, ConfigurationError, LeftOut, Overrides, Result, Robots, SetAside, StatedRobot,
    Tree, Why, WorkPiece,
};
use super::file::ToldBy;
use crate::files::store::Place;

use recorded::{ByRobot, Within};

/// The robots of a pipeline file, and the sessions of all of them.
#[derive(Debug, Clone)]
pub struct Fleet {
    /// Whether the pipeline file is of several robots, so that sessions are named with theirs.
    pub is_of_several: bool,
    /// Each robot with sessions, in the order of the file.
    pub robots: Vec<Configuration>,
    /// Sessions that there is no piece of work for, and robots without sessions; counted in the pieces of all robots.
    pub set_aside: Vec<SetAside>,
    /// Folders and files among the sessions that are no session.
    pub left_out: Vec<LeftOut>,
    /// Remarks on allowed settings that a person should know.
    pub remarks: Vec<String>,
    pub lake: Place,
}

#[derive(Debug, Clone, Copy)]
pub struct FleetPiece<'a> {
    pub configuration: &'a Configuration,
    pub piece: &'a WorkPiece,
    /// Whether its session is named with its robot.
    pub is_of_several: bool,
}

impl FleetPiece<'_> {
    /// The name of its session, with its robot's where the pipeline file has several.
    pub fn label(&self) -> String {
        label(self.configuration, &self.piece.session, self.is_of_several)
    }

    pub fn label_of(&self, session: &str) -> String {
        label(self.configuration, session, self.is_of_several)
    }
}

fn label(configuration: &Configuration, session: &str, is_of_several: bool) -> String {
    match &configuration.robot {
        Some(robot) if is_of_several => format!("{robot}/{session}"),
        _ => session.to_owned(),
    }
}

impl Fleet {
    /// Reads and checks the pipeline file at `path`: all its robots, or those of these names.
    pub fn load(path: &Path, robots: &[String], overrides: &Overrides) -> Result<Self> {
        let source = Source::read(path)?;
        let Some(known) = &source.robots else {
            let files = source.alone()?;
            source.is_of(&files, robots)?;
            let tree = files.tree()?;
            let configuration = Configuration::of(path, files, tree, None, overrides)?;
            return Ok(Self {
                is_of_several: false,
                set_aside: configuration.set_aside.clone(),
                left_out: configuration.left_out.clone(),
                remarks: configuration.remarks.clone(),
                lake: configuration.lake.clone(),
                robots: vec![configuration],
            });
        };
        let chosen: Vec<&StatedRobot> = if robots.is_empty() {
            known.stated.iter().collect()
        } else {
            robots.iter().map(|name| known.named(path, name)).collect::<Result<_, _>>()?
        };
        Loader { source: &source, robots: known, overrides }.fleet(&chosen, robots.is_empty())
    }

    pub fn pieces(&self) -> Vec<FleetPiece<'_>> {
        let of_one = |configuration| {
            let piece =
                move |piece| FleetPiece { configuration, piece, is_of_several: self.is_of_several };
            configuration.pieces.iter().map(piece)
        };
        self.robots.iter().flat_map(of_one).collect()
    }

    #[must_use]
    pub fn each_session(mut self) -> Self {
        let before: Vec<usize> = starts(&self.robots);
        for robot in &mut self.robots {
            robot.pieces = WorkPiece::each_session(&robot.pieces);
        }
        let after = starts(&self.robots);
        for aside in &mut self.set_aside {
            let robot = before.partition_point(|start| *start <= aside.before) - 1;
            aside.before = after[robot.min(after.len() - 1)] + (aside.before - before[robot]);
        }
        self
    }

    /// The robots' tolerance, mm; `None` where it differs.
    pub fn tolerance_mm(&self) -> Option<f64> {
        let mut all = self.robots.iter().map(|own| own.stages.tolerance.mm);
        let first = all.next()?;
        all.all(|own| own.total_cmp(&first).is_eq()).then_some(first)
    }
}

/// Number of pieces before each robot's, and of all of them.
fn starts(robots: &[Configuration]) -> Vec<usize> {
    let mut starts = vec![0];
    for robot in robots {
        starts.push(starts[starts.len() - 1] + robot.pieces.len());
    }
    starts
}

struct Loader<'a> {
    source: &'a Source,
    robots: &'a Robots,
    overrides: &'a Overrides,
}

enum Searched {
    Joined,
    /// In a tree of each robot's own.
    Own,
    /// In this tree, to be searched robot by robot.
    Tree(Tree),
    /// Found in this tree by the robots that their logs or tables name.
    Recorded(Tree, ByRobot),
}

impl Loader<'_> {
    fn fleet(&self, chosen: &[&StatedRobot], are_all: bool) -> Result<Fleet> {
        let (searched, strangers) = match self.robots.by {
            // Of few robots the folders of the others need not be listed.
            ToldBy::Folder if !are_all && !self.overrides.from_joined => {
                (Searched::Own, Vec::new())
            }
            _ => self.search(chosen)?,
        };
        let strangers = if are_all { strangers } else { Vec::new() };
        let mut gathered = Gathered::default();
        for stated in chosen {
            match self.configuration(stated, &searched) {
                Ok(configuration) => gathered.add(configuration),
                Err(error) => gathered.add_fault(&stated.entry.name, error),
            }
        }
        if let Searched::Recorded(_, by_robot) = &searched {
            gathered.left_out.extend_from_slice(&by_robot.found.left_out);
        }
        let before = gathered.pieces;
        let strangers =
            strangers.into_iter().map(|(session, why)| SetAside { session, why, before });
        gathered.set_aside.extend(strangers);
        gathered.fleet()
    }

    /// Looks for the sessions of all robots, and for those of robots that are not known.
    fn search(&self, chosen: &[&StatedRobot]) -> Result<(Searched, Vec<(String, Why)>)> {
        if self.overrides.from_joined {
            return Ok((Searched::Joined, Vec::new()));
        }
        let any = chosen.iter().map(|own| self.source.of_any(self.robots, own)).reduce(Result::or);
        let file =
            any.unwrap_or_else(|| self.source.of_any(self.robots, &self.robots.stated[0]))?;
        let place = self.source.sessions(&file);
        let tree = Tree::at(&place)?;
        let (path, folder, robots) = (&self.source.path, place.named(), self.robots);
        let within = Within { path, tree: &tree, folder: &folder, file: &file, robots };
        let told = match self.robots.by {
            ToldBy::Folder => within.folders_of_no_robot()?,
            ToldBy::FileName => within.files_of_no_robot()?,
            ToldBy::Metadata | ToldBy::Column => {
                let (by_robot, told) = ByRobot::found(&within)?;
                return Ok((Searched::Recorded(tree, by_robot), told));
            }
        };
        Ok((Searched::Tree(tree), told))
    }

    fn configuration(&self, stated: &StatedRobot, searched: &Searched) -> Result<Configuration> {
        let files = self.source.of(self.robots, stated)?;
        let (tree, found) = match searched {
            Searched::Joined => (Tree::Folder, None),
            Searched::Own => (files.tree()?, None),
            Searched::Tree(tree) => (tree.clone(), None),
            Searched::Recorded(tree, by_robot) => {
                (tree.clone(), Some(by_robot.of(&stated.entry.name)))
            }
        };
        let folder = files.sessions().named();
        if matches!(searched, Searched::Tree(_) | Searched::Own) && !tree.is_dir(&folder) {
            return Err(ConfigurationError::NoFolder(folder));
        }
        let path = &self.source.path;
        let mut configuration = Configuration::of(path, files, tree, found, self.overrides)?;
        if self.robots.by == ToldBy::FileName {
            // A folder without files of this robot has those of others.
            configuration.left_out.clear();
        }
        Ok(configuration)
    }
}

#[derive(Default)]
struct Gathered {
    robots: Vec<Configuration>,
    set_aside: Vec<SetAside>,
    left_out: Vec<LeftOut>,
    faults: Vec<ConfigurationError>,
    pieces: usize,
}

impl Gathered {
    fn add(&mut self, configuration: Configuration) {
        let own = configuration.set_aside.iter().map(|aside| SetAside {
            session: label(&configuration, &aside.session, true),
            why: aside.why.clone(),
            before: self.pieces + aside.before,
        });
        self.set_aside.extend(own);
        let own = configuration.left_out.iter().map(|left| LeftOut {
            name: label(&configuration, &left.name, true),
            reason: left.reason.clone(),
        });
        self.left_out.extend(own);
        self.pieces += configuration.pieces.len();
        self.robots.push(configuration);
    }

    /// A robot without a configuration: it waits where only its sessions are missing.
    fn add_fault(&mut self, robot: &str, error: ConfigurationError) {
        let why = match &error {
            ConfigurationError::NoSessions { .. } | ConfigurationError::NoFolder(_) => {
                Why::Waits(error.to_string())
            }
            _ => Why::Bad(error.to_string()),
        };
        self.set_aside.push(SetAside { session: robot.to_owned(), why, before: self.pieces });
        self.faults.push(error);
    }

    /// The fleet; the first fault where no robot has a session and none waits.
    fn fleet(self) -> Result<Fleet> {
        let Self { robots, set_aside, left_out, mut faults, .. } = self;
        let Some(first) = robots.first() else { return Err(faults.swap_remove(0)) };
        let (remarks, lake) = (remarks(&robots), first.lake.clone());
        Ok(Fleet { is_of_several: true, robots, set_aside, left_out, remarks, lake })
    }
}

/// The robots' remarks, each once; with the robot's name where not all of them have it.
fn remarks(robots: &[Configuration]) -> Vec<String> {
    let mut of: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for robot in robots {
        for remark in &robot.remarks {
            let name = robot.robot.as_deref().unwrap_or_default();
            of.entry(remark).or_default().push(name);
        }
    }
    let told = of.into_iter().map(|(remark, names)| {
        if names.len() == robots.len() {
            remark.to_owned()
        } else {
            format!("{}: {remark}", names.join(", "))
        }
    });
    told.collect()
}
