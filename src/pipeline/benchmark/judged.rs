//! One split: models trained, programs entered, all judged by the same code, as rows of the table.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::data::ArmData;
use super::entered::Program;
use super::error::{BenchmarkError, PredictionsFault};
use crate::benchmark::suite::{NamedBase, Published, SplitBase, Suite, SuiteArm, SuiteSplit};
use crate::benchmark::{
    Compared, Draws, Figure, FigureName, Mixed, Numbers, PredictionError, References, SuiteError,
    bootstrap, figures, mixed, placed, unlike,
};
use crate::figures::Figures;
use crate::fit::{Blocks, Observation};
use crate::io::tables::benchmark::{BenchmarkRow, Entrant, TableBase};
use crate::io::tables::words::Unit;
use crate::manifest::{Input, RunKey, Work, canonical};
use crate::pipeline::stages::split::{Divided, Parts, Tested, divide};
use crate::progress::Progress;
use crate::report::{Angles, Model, ResidualSet};
use crate::units::SLIDE_MM_PER_RAD;

/// A split of an arm, with its stations divided.
pub(super) struct Opened<'a> {
    pub(super) suite: &'a Suite,
    pub(super) path: &'a PathBuf,
    pub(super) arm: &'a SuiteArm,
    pub(super) split: &'a SuiteSplit,
    pub(super) data: &'a ArmData,
    pub(super) divided: Divided,
}

/// A model or program with its predictions.
struct Entry {
    entrant: Entrant,
    model: String,
    angles: Option<Angles>,
    compared: Vec<Compared>,
}

impl<'a> Opened<'a> {
    pub(super) fn new(
        (suite, path): (&'a Suite, &'a PathBuf),
        (arm, split): (&'a SuiteArm, &'a SuiteSplit),
        data: &'a ArmData,
    ) -> Result<Self, BenchmarkError> {
        let mut test = parts(&split.test);
        for (session, numbers) in parts_of_base(split) {
            test.entry(session).or_default().extend(numbers);
        }
        let settings = &data.configuration.stages;
        let divided = divide(
            &data.configuration.arm,
            &data.sessions,
            (&parts(&split.train), &test),
            settings,
        );
        let divided =
            divided.map_err(|error| BenchmarkError::stage(&arm.name, &split.name, &error))?;
        let own = Self { suite, path, arm, split, data, divided };
        own.check()?;
        Ok(own)
    }

    /// Checks that stations are of one target, and that those listed exist.
    fn check(&self) -> Result<(), BenchmarkError> {
        for (part, lists) in self.split.lists() {
            for (session, numbers) in lists {
                let stations =
                    self.data.session(session).map_or(0, |own| own.joined.stations.len());
                if let Some(last) = numbers.all().last().filter(|last| **last >= stations) {
                    return Err(self.suite_fault(SuiteError {
                        place: format!("arm {:?}, split {:?}, {part}", self.arm.name, self.split.name),
                        fault: format!("station {last} of session {session:?} does not exist: it has {stations}, from 0"),
                    }));
                }
            }
        }
        if !self.divided.is_of_one_target() {
            return Err(self.fault(
                "a benchmark compares positions of one target by one instrument; these sessions have several, or lengths alone",
            ));
        }
        if self.judging().is_empty() {
            return Err(self.fault("none of the test stations has a reading"));
        }
        Ok(())
    }

    fn fault(&self, fault: &str) -> BenchmarkError {
        BenchmarkError::Split {
            arm: self.arm.name.clone(),
            split: self.split.name.clone(),
            fault: fault.to_owned(),
        }
    }

    fn suite_fault(&self, source: SuiteError) -> BenchmarkError {
        BenchmarkError::Suite { path: self.path.clone(), source }
    }

    /// Whether a station finds the base and judges nothing.
    pub(super) fn finds_base(&self, tested: &Tested) -> bool {
        match &self.split.base {
            SplitBase::Found(lists) => {
                let own = lists.get(&tested.session);
                own.is_some_and(|own| own.all().contains(&tested.observation.station))
            }
            SplitBase::Named(_) => false,
        }
    }

    /// Places of the stations that judge.
    fn judging(&self) -> Vec<usize> {
        let tested = self.divided.test.iter().enumerate();
        tested.filter(|(_, own)| !self.finds_base(own)).map(|(place, _)| place).collect()
    }

    /// Places of the stations that predictions are aligned with; `None` where the base is that of the training.
    fn finders(&self) -> Option<Vec<usize>> {
        let tested = self.divided.test.iter().enumerate();
        match &self.split.base {
            SplitBase::Named(NamedBase::Training) => None,
            SplitBase::Named(NamedBase::Test) => Some(self.judging()),
            SplitBase::Found(_) => Some(
                tested.filter(|(_, own)| self.finds_base(own)).map(|(place, _)| place).collect(),
            ),
        }
    }

    /// How the test stations stand to the training stations.
    pub(super) fn mixed(&self) -> Result<Mixed, BenchmarkError> {
        let slides = self.data.configuration.arm.chain().slides();
        let axes = |own: &Observation| in_rad(&own.axes, &slides);
        let train: Vec<Vec<f64>> = self.divided.train.iter().map(axes).collect();
        let judging = self.judging().into_iter();
        let test: Vec<Vec<f64>> =
            judging.map(|place| axes(&self.divided.test[place].observation)).collect();
        let mixed = mixed(&train, &test, self.split.kind);
        let mixed =
            mixed.ok_or_else(|| self.fault("none of the training stations has a reading"))?;
        if mixed.leaks() && self.split.beside.is_none() {
            return Err(self.suite_fault(SuiteError {
                place: format!("arm {:?}, split {:?}", self.arm.name, self.split.name),
                fault: format!(
                    "its test stations stand among its training stations ({:.0} % of their neighbours train), so it leaks: name the split by \
                     region or session that its figures stand beside (beside = …)",
                    100.0 * mixed.share
                ),
            }));
        }
        Ok(mixed)
    }

    /// The rows of the split.
    pub(super) fn rows(
        &self,
        programs: &[Program],
        progress: &dyn Progress,
    ) -> Result<Vec<BenchmarkRow>, BenchmarkError> {
        let mixed = self.mixed()?;
        let mut entries = self.models(progress)?;
        let of = |model: Model| {
            let own = entries.iter().find(|own| own.model == model.about().word);
            own.map(|own| self.errors(&own.compared)).transpose()
        };
        let (base_target, full) = (of(Model::BaseTarget)?, of(Model::Full)?);
        let mut inputs = self.data.inputs.clone();
        for program in programs {
            if let Some(path) = program.file(self.arm, self.split) {
                let (entry, input) = self.entered(program, path, base_target.as_deref())?;
                entries.push(entry);
                inputs.push(input);
            }
        }
        let blocks = self.blocks();
        let common = self.row(&self.key(inputs)?, &mixed, &blocks);
        let draws = Draws::new(&blocks, &self.suite.bootstrap);
        let references = References { base_target: base_target.as_deref(), full: full.as_deref() };
        let mut rows = self.published(&common);
        for entry in entries {
            let errors = self.errors(&entry.compared)?;
            for figure in figures(&errors, references, draws.as_ref()) {
                rows.push(self.figure(&common, &entry, &figure));
            }
        }
        Ok(rows)
    }

    /// The models of posegrid, trained on the training stations.
    fn models(&self, progress: &dyn Progress) -> Result<Vec<Entry>, BenchmarkError> {
        let sets = self.divided.compared(&self.data.configuration.arm, progress);
        let sets =
            sets.map_err(|error| BenchmarkError::stage(&self.arm.name, &self.split.name, &error))?;
        let entry = |(model, angles, set): &(Model, Angles, ResidualSet)| Entry {
            entrant: Entrant::Posegrid,
            model: model.about().word.to_owned(),
            angles: Some(*angles),
            compared: set.residuals.iter().map(Compared::from).collect(),
        };
        Ok(sets.iter().map(entry).collect())
    }

    /// The row of a figure.
    fn figure(&self, common: &BenchmarkRow, entry: &Entry, figure: &Figure) -> BenchmarkRow {
        BenchmarkRow {
            entrant: entry.entrant,
            model: entry.model.clone(),
            angles: entry.angles,
            figure: figure.name,
            value: figure.value,
            unit: unit(figure.name),
            low: figure.interval.map(|[low, _]| low),
            high: figure.interval.map(|[_, high]| high),
            confidence: figure.interval.map(|_| self.suite.bootstrap.confidence),
            ..common.clone()
        }
    }

    /// The rows of figures that others published.
    fn published(&self, common: &BenchmarkRow) -> Vec<BenchmarkRow> {
        let row = |own: &Published| BenchmarkRow {
            entrant: Entrant::Published,
            model: own.model.clone(),
            figure: own.figure,
            value: own.value,
            unit: unit(own.figure),
            source: Some(own.source.clone()),
            ..common.clone()
        };
        self.split.published.iter().map(row).collect()
    }

    /// Predictions of a program, which are refused in another unit or frame.
    fn entered(
        &self,
        program: &Program,
        path: PathBuf,
        reference: Option<&[PredictionError]>,
    ) -> Result<(Entry, Input), BenchmarkError> {
        let own = (self.arm, self.split);
        let (compared, input) = program.predictions(own, &self.divided.test, &path)?;
        let reference = reference.and_then(|errors| {
            let distances = errors.iter().map(|own| own.distance_mm);
            Some(Figures::of(&distances.collect::<Vec<_>>())?.rms)
        });
        let found = reference.and_then(|mm| unlike(&compared, mm, self.finders().is_some()));
        if let Some(unlike) = found {
            let fault = PredictionsFault::Unlike { path, unlike };
            return Err(program.fault(self.arm, self.split, fault));
        }
        let entry = Entry {
            entrant: Entrant::Program,
            model: program.name.clone(),
            angles: None,
            compared,
        };
        Ok((entry, input))
    }

    /// Errors of the stations that judge, in the split's base.
    fn errors(&self, compared: &[Compared]) -> Result<Vec<PredictionError>, BenchmarkError> {
        let moved = match self.finders() {
            None => None,
            Some(finders) => {
                let moved = placed(compared, &finders);
                Some(moved.ok_or_else(|| {
                    self.fault("the stations that find the base do not span space")
                })?)
            }
        };
        let compared = moved.as_deref().unwrap_or(compared);
        let judging = self.judging().into_iter();
        Ok(judging.map(|place| compared[place].error()).collect())
    }

    /// The block of each station that judges: of its session's work space.
    fn blocks(&self) -> Vec<usize> {
        let judging = self.judging();
        let own: Vec<&Tested> = judging.iter().map(|&place| &self.divided.test[place]).collect();
        let positions: Vec<_> = own.iter().map(|own| own.flange).collect();
        let cells = Blocks::default().cells(&positions);
        let mut known: BTreeMap<(&str, [i64; 3]), usize> = BTreeMap::new();
        let named = own.iter().zip(cells).map(|(own, cell)| {
            // Whole numbers of a few blocks along each axis.
            #[expect(clippy::cast_possible_truncation, reason = "whole and small")]
            let cell = cell.map(|index| index as i64);
            let next = known.len();
            *known.entry((&own.session, cell)).or_insert(next)
        });
        named.collect()
    }

    fn key(&self, inputs: Vec<Input>) -> Result<RunKey, BenchmarkError> {
        let settings = (&self.split, &self.suite.bootstrap, &self.data.configuration.settings);
        let work = Work {
            robot: self.arm.name.clone(),
            session: names(self.split.test.keys()),
            pipeline: self.suite.name.clone(),
            sessions: self.split.train.keys().cloned().collect(),
            test_sessions: self.split.test.keys().cloned().collect(),
            inputs,
            settings: canonical(&settings)?,
        };
        Ok(work.key())
    }

    /// A row without entrant and figure.
    fn row(&self, key: &RunKey, mixed: &Mixed, blocks: &[usize]) -> BenchmarkRow {
        let lists = self.split.lists().flat_map(|(_, own)| own.values());
        let listed: usize = lists.map(|own| own.all().len()).sum();
        let used = self.divided.train.len() + self.divided.test.len();
        BenchmarkRow {
            robot: key.robot.clone(),
            session: key.session.clone(),
            run: key.run.clone(),
            suite: self.suite.name.clone(),
            split: self.split.name.clone(),
            split_kind: self.split.kind,
            train_stations: self.divided.train.len(),
            test_stations: blocks.len(),
            left_out: listed.saturating_sub(used),
            blocks: bootstrap::count(blocks),
            base: match &self.split.base {
                SplitBase::Named(NamedBase::Training) => TableBase::Training,
                SplitBase::Named(NamedBase::Test) => TableBase::Test,
                SplitBase::Found(_) => TableBase::Stations,
            },
            leaks: mixed.leaks(),
            neighbour_share: mixed.share,
            nearest_rad: mixed.nearest_rad,
            same_poses: mixed.same_poses,
            beside: self.split.beside.clone(),
            entrant: Entrant::Posegrid,
            model: String::new(),
            angles: None,
            figure: FigureName::Mean,
            value: 0.0,
            unit: Unit::Mm,
            low: None,
            high: None,
            confidence: None,
            source: None,
        }
    }
}

/// Axis variables, those that slide in the length that counts as 1 rad.
fn in_rad(axes: &[f64], slides: &[bool]) -> Vec<f64> {
    let each = axes.iter().zip(slides);
    each.map(|(own, slides)| if *slides { own / SLIDE_MM_PER_RAD } else { *own }).collect()
}

const fn unit(figure: FigureName) -> Unit {
    if figure.is_length() { Unit::Mm } else { Unit::One }
}

fn names<'n>(names: impl Iterator<Item = &'n String>) -> String {
    names.map(String::as_str).collect::<Vec<_>>().join("+")
}

fn parts(lists: &BTreeMap<String, Numbers>) -> Parts {
    let lists = lists.iter();
    lists.map(|(session, own)| (session.clone(), own.all().clone())).collect()
}

fn parts_of_base(split: &SuiteSplit) -> Parts {
    match &split.base {
        SplitBase::Found(lists) => parts(lists),
        SplitBase::Named(_) => Parts::new(),
    }
}
