//! Designs compared: accuracy of the full error model against the number of poses, for grid, random and chosen poses.
//!
//! Inputs: the nominal arm and the expected robots. Output: a row for each design and number of poses.
//! 1. Candidates are random poses of the region that suit the constraints; each design takes its own, the grid its nodes.
//! 2. Each robot measures each design at each number of poses; the full error model is trained on it.
//! 3. Its predictions from commands alone are compared with the robot's true errors at fresh poses of the region: the
//!    difference is the error that compensation by the identified arm leaves.

use nalgebra::{Matrix3, Point3, Vector3};

use super::design::{Candidate, Choice, Design};
use super::outcomes::{Outcomes, RobotOutcome};
use super::place::{Drawn, Placer};
use super::robots::{Fitted, Robot};
use super::settings::{PlanSettings, Region};
use super::steps::{Grid, test_poses};
use super::{PlanError, Trial, line_of_sight};
use crate::figures::Figures;
use crate::fit::full::{FullModel, Known, Query};
use crate::fit::{FramePair, Observation, SourceId, ToolErrors};
use crate::geometry::Transform;
use crate::grid::Lattice;
use crate::kinematics::Arm;
use crate::simulate::{Commanded, Ingredient, Stream};
use crate::units::whole;

/// Number of poses that represent the region while a design is chosen.
const REGION_POSES: usize = 300;
/// Number of errors drawn from each pose's covariance for the expectation of a design.
const DRAWS: usize = 32;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    UniformGrid,
    Random,
    /// One after another, each lowering the summed variance over the region the most.
    GreedyVariance,
    /// One after another, each adding the most information on geometry and frames: D-optimal, which at a given number of
    /// poses is the largest O1.
    DOptimal,
}

impl Kind {
    pub const ALL: [Self; 4] =
        [Self::UniformGrid, Self::Random, Self::GreedyVariance, Self::DOptimal];
}

#[derive(Debug, Clone, PartialEq)]
pub struct DesignRow {
    pub kind: Kind,
    pub poses: usize,
    /// Errors that the model expects to remain, mm; `None` for designs that were not chosen by it.
    pub expected: Option<Expected>,
    pub outcomes: Outcomes,
}

/// The model's expectation of errors over the region, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    pub mean_mm: f64,
    /// Bound of the tolerance's share of errors.
    pub share_mm: f64,
}

#[derive(Debug, Clone)]
pub struct Designs {
    /// The candidates, and the number of poses drawn with the reasons why some were not taken.
    pub candidates: (Vec<Commanded>, Drawn),
    /// Candidates in the order in which the variance design takes them, with the variance after each.
    pub by_variance: Vec<Choice>,
    pub expected: Vec<Expected>,
    /// Candidates in the order the D-optimal design takes them.
    pub by_information: Vec<usize>,
}

impl Designs {
    /// Draws candidates and orders them, as many as the plan may have poses.
    pub fn new(trial: &Trial<'_>) -> Result<Self, PlanError> {
        let Trial { arm, placer, settings, progress } = *trial;
        let most = settings.poses.iter().copied().max().unwrap_or(0);
        if settings.candidates < most {
            return Err(PlanError::FewCandidates { candidates: settings.candidates, poses: most });
        }
        let candidates = candidates(arm, placer, settings)?;
        let region = region_axes(arm, placer, settings)?;
        let unknown = expected_model(arm, settings, &region, most);
        let model = settings.known.as_ref().map_or(&unknown, |known| &known.model);
        let measured = measurements(arm, &candidates.0, model, settings);
        progress.begin("choosing poses", 2 * most as u64);
        let visit = |axes: &Vec<f64>| model.visit_covariance(&Query::at(axes, 0, Known::Reported));
        let visit: Vec<_> = region.iter().map(visit).collect();
        let mut design = Design::new(model, &measured, &region);
        let (mut by_variance, mut expected) = (Vec::new(), Vec::new());
        while by_variance.len() < most
            && let Some(choice) = design.choose()
        {
            by_variance.push(choice);
            expected.push(Expected::of(&design.region, &visit, settings));
            progress.advance(1);
        }
        // The information on geometry is computed for an arm that is not known, even where this one is.
        let geometric = unknown.geometry_alone();
        let mut design = Design::new(&geometric, &measured, &[]);
        let mut by_information = Vec::new();
        while by_information.len() < most
            && let Some(choice) = design.choose_informative()
        {
            by_information.push(choice.candidate);
            progress.advance(1);
        }
        progress.end();
        Ok(Self { candidates, by_variance, expected, by_information })
    }

    /// The poses of a design, at most `count` of them; the grid has the most nodes that are not more.
    pub fn poses(
        &self,
        kind: Kind,
        count: usize,
        placer: &Placer<'_>,
        settings: &PlanSettings,
    ) -> Vec<Commanded> {
        let taken = |order: &mut dyn Iterator<Item = usize>| {
            order.take(count).map(|c| self.candidates.0[c].clone()).collect()
        };
        match kind {
            Kind::UniformGrid => {
                finest_grid(count, placer, settings).map(|grid| grid.commands).unwrap_or_default()
            }
            Kind::Random => taken(&mut (0..self.candidates.0.len())),
            Kind::GreedyVariance => taken(&mut self.by_variance.iter().map(|c| c.candidate)),
            Kind::DOptimal => taken(&mut self.by_information.iter().copied()),
        }
    }
}

impl Expected {
    /// From covariances over the region (mm²) and those of single visits: errors are drawn from them, seeded.
    pub fn of(region: &[Matrix3<f64>], visit: &[Matrix3<f64>], settings: &PlanSettings) -> Self {
        let mut stream = Stream::new(settings.seed, Ingredient::Errors);
        let mut norms = Vec::with_capacity(DRAWS * region.len());
        for (open, visit) in region.iter().zip(visit) {
            let eigen = (open + visit).symmetric_eigen();
            let sizes = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
            norms.extend((0..DRAWS).map(|_| stream.normal3().component_mul(&sizes).norm()));
        }
        norms.sort_by(f64::total_cmp);
        let place = ((norms.len() as f64 * settings.tolerance.share).ceil().max(1.0)) - 1.0;
        let share_mm = norms.get(whole(place)).copied().unwrap_or(f64::INFINITY);
        Self {
            mean_mm: Figures::of(&norms).map_or(f64::INFINITY, |figures| figures.mean),
            share_mm,
        }
    }
}

/// The uniform grid with the most nodes in reach that are no more than `count`; `None` if eight are too many.
fn finest_grid(count: usize, placer: &Placer<'_>, settings: &PlanSettings) -> Option<Grid> {
    let bounds = &settings.region.bounds;
    let shortest = (0..3).map(|axis| bounds.size(axis)).fold(f64::INFINITY, f64::min);
    let of = |cells: u32| {
        let step_mm = shortest / f64::from(cells);
        let lattice = Lattice::new(bounds, step_mm).ok()?;
        (lattice.node_count() <= count).then_some((step_mm, lattice))
    };
    let (step_mm, lattice) = (1..).map_while(of).last()?;
    Some(Grid::of(placer, settings, step_mm, lattice))
}

/// Random poses that may be measured: in the box, turned further than the region needs, and suiting the constraints.
pub(super) fn candidates(
    arm: &Arm,
    placer: &Placer<'_>,
    settings: &PlanSettings,
) -> Result<(Vec<Commanded>, Drawn), PlanError> {
    let region = Region { cone_rad: settings.candidate_cone_rad, ..settings.region };
    let mut stream = Stream::new(settings.seed, Ingredient::Candidates);
    let suits = |joints: &[f64]| line_of_sight::verdict(arm, joints, &settings.constraints);
    placer.random(&region, settings.candidates, &mut stream, &suits)
}

/// The full error model of a robot that is not known yet, in the plan's cell.
fn expected_model(
    arm: &Arm,
    settings: &PlanSettings,
    region: &[Vec<f64>],
    stations: usize,
) -> FullModel {
    FullModel::expected(
        arm,
        &frames(settings).into(),
        region,
        stations,
        &settings.fit.prior(),
        &settings.full,
        settings.up,
    )
}

fn frames(settings: &PlanSettings) -> FramePair {
    let cell = &settings.population.cell;
    let tracker_from_base =
        crate::geometry::isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    FramePair::only(
        Transform::claim(tracker_from_base),
        Transform::claim(settings.flange_from_target),
    )
}

/// Axis variables of poses that represent the region.
pub fn region_axes(
    arm: &Arm,
    placer: &Placer<'_>,
    settings: &PlanSettings,
) -> Result<Vec<Vec<f64>>, PlanError> {
    let mut stream = Stream::new(settings.seed, Ingredient::Region);
    let (region, _) = placer.random(&settings.region, REGION_POSES, &mut stream, &|_| Ok(()))?;
    Ok(region.iter().map(|pose| arm.axes(&pose.joints)).collect())
}

/// A pose with the covariance of a measurement there; `position` is the target's in the tracker's frame, mm.
pub fn candidate(
    arm: &Arm,
    joints: &[f64],
    position: Point3<f64>,
    model: &FullModel,
    settings: &PlanSettings,
) -> Candidate {
    let instrument = settings.noise.source(SourceId::ONLY).uncertainty.covariance(&position);
    let observation = Observation::planned(0, arm.axes(joints), position, instrument);
    Candidate { noise: model.noise(&observation, 0), axes: observation.axes }
}

fn measurements(
    arm: &Arm,
    poses: &[Commanded],
    model: &FullModel,
    settings: &PlanSettings,
) -> Vec<Candidate> {
    let tracker_from_base = frames(settings).tracker_from_base;
    let of = |pose: &Commanded| {
        let position =
            tracker_from_base.isometry() * Point3::from(pose.base_from_target.translation.vector);
        candidate(arm, &pose.joints, position, model, settings)
    };
    poses.iter().map(of).collect()
}

/// Judges every design at every number of poses of the settings on the plan's robots.
pub fn judge(trial: &Trial<'_>, designs: &Designs, pool: &[Commanded]) -> Vec<DesignRow> {
    let counts = &trial.settings.poses;
    let sizes: Vec<(Kind, usize)> = Kind::ALL
        .into_iter()
        .flat_map(|kind| counts.iter().map(move |&count| (kind, count)))
        .collect();
    judge_sizes(trial, designs, pool, &sizes)
}

/// Judges designs at these numbers of poses on the plan's robots.
pub fn judge_sizes(
    trial: &Trial<'_>,
    designs: &Designs,
    pool: &[Commanded],
    sizes: &[(Kind, usize)],
) -> Vec<DesignRow> {
    let (placer, settings) = (trial.placer, trial.settings);
    let mut asked: Vec<(Kind, Vec<Commanded>)> = Vec::new();
    for &(kind, count) in sizes {
        let poses = designs.poses(kind, count, placer, settings);
        // Several sizes may ask for the same grid, and a size below eight has none.
        let is_new = !asked.iter().any(|(k, p)| (*k, p.len()) == (kind, poses.len()));
        if is_new && !poses.is_empty() {
            asked.push((kind, poses));
        }
    }
    let numbers = 0..settings.whole_model_robots;
    let robots = trial.each_robot("robots × designs", numbers, |robot, number| {
        let tests = test_poses(pool, settings, number);
        let outcome =
            |(_, poses): &(Kind, Vec<Commanded>)| on_robot(robot, poses, &tests, settings);
        asked.iter().map(outcome).collect::<Vec<_>>()
    });
    let row = |(place, (kind, poses)): (usize, &(Kind, Vec<Commanded>))| DesignRow {
        kind: *kind,
        poses: poses.len(),
        expected: (*kind == Kind::GreedyVariance)
            .then(|| designs.expected.get(poses.len().checked_sub(1)?).copied())
            .flatten(),
        outcomes: Outcomes::of(robots.iter().map(|robot| &robot[place]), settings.robots_meet),
    };
    asked.iter().enumerate().map(row).collect()
}

/// The errors that the full error model trained on `poses` leaves at `tests`.
pub(super) fn on_robot(
    robot: &mut Robot<'_>,
    poses: &[Commanded],
    tests: &[Commanded],
    settings: &PlanSettings,
) -> RobotOutcome {
    match robot.fitted(poses, settings, &settings.full) {
        Ok(fitted) => left_at(robot, &fitted, tests, settings),
        Err(error) => RobotOutcome::NoFit(error),
    }
}

/// The errors that a fitted robot has at `tests`, each commanded in another session and predicted from its command alone.
pub fn left_at(
    robot: &mut Robot<'_>,
    fitted: &Fitted<'_>,
    tests: &[Commanded],
    settings: &PlanSettings,
) -> RobotOutcome {
    let errors = fitted.true_errors(&robot.session(tests), settings);
    let model = ToolErrors::new(fitted.models.best().1, 0, &fitted.error_frame);
    let left = |(test, error): (&Commanded, &Vector3<f64>)| {
        let predicted = model.error(&test.joints).map_err(|gap| gap.refusal());
        Some(predicted.map(|predicted| (error - predicted).norm()))
    };
    RobotOutcome::of(tests.iter().zip(&errors).map(left), &settings.tolerance)
}
