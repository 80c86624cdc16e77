//! Base and target of a session that no model learnt from: which stations find them, and whether its target is its own.
//!
//! Stations are picked by their place in time or by their poses, never by their readings: those that find the base do not judge, and a
//! pick by readings would flatter the others. They alone also test whether the target is the one that is known: where its displacement
//! by them is significant (1 %, by the joint covariance of what they find and of what is known), it is the session's own.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3};
use serde::{Deserialize, Serialize};

use super::BaseRefit;
use super::evaluate::{axes_at, known_at, placed, predictions, turned};
use super::refit::{self, Placed, Refit};
use crate::figures::CHI_SQUARED_3_99;
use crate::fit::full::elsewhere::Elsewhere;
use crate::fit::full::{Known, Query};
use crate::fit::locate::Poses;
use crate::fit::{Angles, Frames, Model, Models, Observation, TrainingSettings};
use crate::kinematics::Arm;
use crate::units::MM_PER_M;

/// `[report] locate`: how base and target of a session that the model did not learn from are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Locate {
    pub by: LocateBy,
    /// Number of stations that find the base, the others judge; `None`: as many as suit the session.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stations: Option<usize>,
    /// Whether the session's target is the one that is known.
    #[serde(default)]
    pub target: LocateTarget,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LocateBy {
    First,
    /// Those whose poses fix base and target best for the identified arm.
    #[default]
    Chosen,
}

/// The measured target of a session that the model did not learn from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LocateTarget {
    /// The target in its place as the model knows it: it was not taken off.
    Known,
    /// A target of the session's own, as after a remount: found with the base.
    Own,
    /// The known one, unless the stations that find the base contradict it: then one of the session's own.
    #[default]
    Tested,
}

/// How base and target of one session are found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Located {
    pub finders: Vec<usize>,
    /// Standard deviation of the session's own target from the known one, per axis, mm; `None` where the target is the known one.
    pub target_sd_mm: Option<f64>,
    /// The displacement that contradicts the known target; `None` where none does.
    pub contradicted: Option<Displacement>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Displacement {
    pub mm: f64,
    /// The size in its direction that one session in a hundred shows of a target that was not taken off, mm.
    pub allowed_mm: f64,
}

impl Located {
    pub const fn with_target(&self) -> bool {
        self.target_sd_mm.is_some()
    }
}

/// The stations that base and target of a session were found from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finders {
    pub by: LocateBy,
    pub stations: usize,
    pub with_target: bool,
}

impl Finders {
    /// What was found from which stations.
    pub fn words(&self) -> String {
        let what = if self.with_target { "base and target" } else { "base" };
        let stations = self.stations;
        match self.by {
            LocateBy::First => format!("{what} from its first {stations} stations"),
            LocateBy::Chosen => {
                format!("{what} from {stations} stations chosen by their poses")
            }
        }
    }
}

pub const LEAST_STATIONS: usize = 4;
/// First stations where the pipeline file states no number: neighbours, which tell less than chosen ones.
const FIRST_STATIONS: usize = 50;
/// Most chosen stations where the pipeline file states no number: four times as many coordinates as base and target have.
const CHOSEN_STATIONS: usize = 12;
/// Share of a session's stations that are chosen where the pipeline file states no number: one in so many, as the others are to judge.
const CHOSEN_OF: usize = 5;

impl Locate {
    /// The source of a base that is found so.
    pub const fn base_refit(&self) -> BaseRefit {
        match self.by {
            LocateBy::First => BaseRefit::First,
            LocateBy::Chosen => BaseRefit::Chosen,
        }
    }

    /// So many stations that were picked in this way.
    pub const fn finders(&self, stations: usize, with_target: bool) -> Finders {
        Finders { by: self.by, stations, with_target }
    }

    /// Number of stations that find the base of a session of so many.
    fn count(&self, all: usize) -> usize {
        let usual = match self.by {
            LocateBy::First => FIRST_STATIONS,
            LocateBy::Chosen => (all / CHOSEN_OF).clamp(LEAST_STATIONS, CHOSEN_STATIONS),
        };
        self.stations.unwrap_or(usual).min(all)
    }

    /// First stations that find the base of a session which a table drove: its targets are not chosen for that.
    pub fn first(&self) -> usize {
        self.stations.filter(|_| self.by == LocateBy::First).unwrap_or(FIRST_STATIONS)
    }
}

/// Standard deviation of base and target before they are found, mm and, for turns, mm at 1 m: wider than any that stations leave.
const ANYWHERE_MM: f64 = 300.0;
/// Most stations that are compared while some are chosen; of more, every second, third, … is.
const MOST_COMPARED: usize = 1000;
/// Deviation of a measured position while stations are chosen where the model states none, mm: they count alike at any size.
const ALIKE_MM: f64 = 0.05;

/// Finds base and target of sessions that some models did not learn from.
#[derive(Debug)]
pub struct Locator {
    pub locate: Locate,
    /// The arm in such a session; `None` without a full error model, where all stations count alike.
    elsewhere: Option<Elsewhere>,
    /// Standard deviation of the session's target from that of the training, per axis, mm.
    target_sd_mm: f64,
    scale_sd: f64,
}

impl Locator {
    pub fn new(
        models: &Models,
        arm: &Arm,
        locate: Locate,
        settings: &TrainingSettings<'_>,
    ) -> Self {
        let full = models.full.as_ref();
        let elsewhere =
            full.and_then(|full| full.elsewhere(arm, models.latest(), settings.full, settings.up));
        // Both mountings may be off.
        let apart = |sd_mm: f64| sd_mm * 2.0_f64.sqrt();
        Self {
            locate,
            elsewhere,
            target_sd_mm: settings.fit.target.map_or(ANYWHERE_MM, |target| apart(target.sd_mm)),
            scale_sd: full.map_or(0.0, |full| full.trained.scale_sd),
        }
    }

    /// For no session at all: nothing of the arm is worked out.
    pub const fn of_none(locate: Locate) -> Self {
        Self { locate, elsewhere: None, target_sd_mm: ANYWHERE_MM, scale_sd: 0.0 }
    }

    /// How base and target of a session are found: from which stations, and whether its target is the known one by these.
    pub fn located(&self, models: &Models, observations: &[Observation]) -> Located {
        // Of several targets, each in a place of its own, one displacement tells nothing.
        let mut frames = models.base_target.frames.iter();
        let are_several = frames.any(Frames::has_several_targets);
        let target = match self.locate.target {
            LocateTarget::Tested if are_several => LocateTarget::Known,
            target => target,
        };
        let own = Some(self.target_sd_mm).filter(|_| target != LocateTarget::Known);
        let finders = self.finders(models, observations, own);
        let contradicted = (target != LocateTarget::Own && !are_several)
            .then(|| self.contradiction(models, observations, &finders))
            .flatten();
        let target_sd_mm = match (target, contradicted) {
            (LocateTarget::Tested, None) | (LocateTarget::Known, _) => None,
            (LocateTarget::Own, _) => own,
            (LocateTarget::Tested, Some(away)) => Some(self.target_sd_mm(&away)),
        };
        Located { finders, target_sd_mm, contradicted }
    }

    /// Standard deviation of a target of the session's own that was found so far away, which is not drawn back.
    pub const fn target_sd_mm(&self, away: &Displacement) -> f64 {
        self.target_sd_mm.max(away.mm)
    }

    /// The displacement of the target by the stations at `finders`, where one that was not taken off rarely shows it: their errors have
    /// the covariance of the arm with the known target.
    fn contradiction(
        &self,
        models: &Models,
        observations: &[Observation],
        finders: &[usize],
    ) -> Option<Displacement> {
        let own: Vec<Observation> = finders.iter().map(|&f| observations[f].clone()).collect();
        let (poses, placed) = self.predicted(models, Angles::Weighted, &own, None)?;
        let measured = own.iter().map(|o| Some(o.point()?.position));
        let measured: Vec<Point3<f64>> = measured.collect::<Option<_>>()?;
        let base = refit::refit(&measured, &placed, false)?;
        let pairs = measured.iter().zip(&placed);
        let left = refit::stacked(pairs.map(|(m, p)| base.base_from_tracker * m - p.position));
        let (columns, precision) = frame_columns(&placed, Some(ANYWHERE_MM), self.scale_sd);
        let free = Poses { columns, precision, ..poses };
        let (found, covariance) = free.unknowns(&left)?;
        let target = refit::columns_of_frames(false);
        let shift = found.fixed_rows::<3>(target).into_owned();
        let covariance = covariance.fixed_view::<3, 3>(target, target).into_owned();
        let squared = shift.dot(&covariance.cholesky()?.solve(&shift));
        (squared > CHI_SQUARED_3_99).then(|| Displacement {
            mm: shift.norm(),
            allowed_mm: shift.norm() * (CHI_SQUARED_3_99 / squared).sqrt(),
        })
    }

    /// The stations that find the frames of a session, by the places of their observations; in time, or by their commanded poses,
    /// never by readings. A station is taken with its readings of all targets.
    fn finders(
        &self,
        models: &Models,
        observations: &[Observation],
        own_target: Option<f64>,
    ) -> Vec<usize> {
        // The first observation of each station.
        let is_first = |&place: &usize| {
            place == 0 || observations[place - 1].station != observations[place].station
        };
        let firsts: Vec<usize> = (0..observations.len()).filter(is_first).collect();
        let count = self.locate.count(firsts.len());
        let taken: Vec<usize> = match self.locate.by {
            LocateBy::First => (0..count).collect(),
            LocateBy::Chosen => {
                let poses: Vec<Observation> =
                    firsts.iter().map(|&place| observations[place].clone()).collect();
                self.chosen(models, &poses, count, own_target).unwrap_or_default()
            }
        };
        let all = taken.into_iter().flat_map(|station| {
            let end = firsts.get(station + 1).copied();
            firsts[station]..end.unwrap_or(observations.len())
        });
        all.collect()
    }

    /// The stations whose poses fix the frames best for the arm over all poses of the session.
    fn chosen(
        &self,
        models: &Models,
        observations: &[Observation],
        count: usize,
        own_target: Option<f64>,
    ) -> Option<Vec<usize>> {
        let every = observations.len().div_ceil(MOST_COMPARED).max(1);
        // All at one time, so that the order in which they were measured does not matter.
        let poses = observations.iter().step_by(every).map(|o| Observation {
            axes: axes_at(o, Angles::Commanded).unwrap_or_else(|| o.axes.clone()),
            settling_error: None,
            station: 0,
            ..o.clone()
        });
        let poses: Vec<Observation> = poses.collect();
        let (model, _) = models.best();
        let (it, predictions) = predictions(models, model, Angles::Reported, &poses, false)?;
        let base = it.frames()[models.latest()].tracker_from_base(poses.first()?.source);
        let to_base = base.isometry().inverse();
        let placed: Vec<Placed> = predictions.iter().map(|p| placed(&p.target, &to_base)).collect();
        let alone = alone(models, &poses, &to_base);
        let poses = self.errors_at(&poses, Angles::Reported, &placed, own_target, alone);
        let all: Vec<usize> = (0..placed.len()).collect();
        let chosen = poses.choose(&all, &all, count).stations;
        Some(chosen.into_iter().map(|place| place * every).collect())
    }

    /// The poses of a session as far as its frames concern them, with the errors that the arm may make there; `None` where the
    /// models state none.
    pub(super) fn poses(
        &self,
        observations: &[Observation],
        angles: Angles,
        placed: &[Placed],
        own_target: Option<f64>,
        alone: Vec<Matrix3<f64>>,
    ) -> Option<Poses> {
        self.elsewhere.as_ref()?;
        Some(self.errors_at(observations, angles, placed, own_target, alone))
    }

    fn errors_at(
        &self,
        observations: &[Observation],
        angles: Angles,
        placed: &[Placed],
        own_target: Option<f64>,
        alone: Vec<Matrix3<f64>>,
    ) -> Poses {
        let (columns, precision) = frame_columns(placed, own_target, self.scale_sd);
        let axes =
            observations.iter().map(|o| axes_at(o, angles).unwrap_or_else(|| o.axes.clone()));
        let axes: Vec<Vec<f64>> = axes.collect();
        let queries = observations.iter().zip(&axes);
        let queries: Vec<Query<'_>> =
            queries.map(|(o, axes)| query(o, axes, known_at(o, angles))).collect();
        let none = || DMatrix::zeros(0, 3 * queries.len());
        let half = self.elsewhere.as_ref().map(|own| own.half(&queries, own_target.is_some()));
        let poses = Poses { half: half.unwrap_or_else(none), columns, precision, alone };
        poses.relative()
    }

    /// The frames of a session from those of its stations at `finders`, which are predicted at `placed` at their commands; `None`
    /// where they do not span space. `own_target` is of a target of the session's own ([`Located::target_sd_mm`]).
    pub fn refit(
        &self,
        models: &Models,
        observations: &[Observation],
        finders: &[usize],
        own_target: Option<f64>,
        placed: &[Placed],
    ) -> Option<Refit> {
        let measured = finders.iter().map(|&own| Some(observations[own].point()?.position));
        let measured: Vec<Point3<f64>> = measured.collect::<Option<_>>()?;
        let with_target = own_target.is_some();
        let by = self
            .predicted(models, Angles::Commanded, observations, own_target)
            .and_then(|(poses, all)| Some((poses.estimator(finders)?, all)));
        match by {
            Some((by, all)) => {
                let (middle, sd) = (refit::middle(&all), self.scale_sd);
                refit::generalised(&measured, placed, with_target, middle, sd, &by)
            }
            None => refit::refit(&measured, placed, with_target),
        }
    }

    /// Poses of a session by the full error model, and where it predicts them; `None` without such a model or these angles.
    fn predicted(
        &self,
        models: &Models,
        angles: Angles,
        observations: &[Observation],
        own_target: Option<f64>,
    ) -> Option<(Poses, Vec<Placed>)> {
        let full = models.full.as_ref()?;
        let (_, predictions) = predictions(models, Model::Full, angles, observations, false)?;
        let source = observations.first()?.source;
        let latest = models.latest();
        let to_tracker = *full.frames[latest].tracker_from_base(source).isometry();
        let alone = predictions.iter().zip(observations);
        let alone = alone.map(|(p, o)| turned(&(full.noise(o, latest) + p.alone()), &to_tracker));
        let to_base = to_tracker.inverse();
        let placed: Vec<Placed> = predictions.iter().map(|p| placed(&p.target, &to_base)).collect();
        let poses = self.poses(observations, angles, &placed, own_target, alone.collect())?;
        Some((poses, placed))
    }
}

/// Covariance of a visit at each pose, in the axes of the base, mm².
fn alone(models: &Models, poses: &[Observation], to_base: &Isometry3<f64>) -> Vec<Matrix3<f64>> {
    let alike = Matrix3::identity() * (ALIKE_MM * ALIKE_MM);
    let Some(full) = models.full.as_ref() else {
        return vec![alike; poses.len()];
    };
    let to_tracker = to_base.inverse();
    let of = |o: &Observation| {
        let own = full.visit_covariance(&query(o, &o.axes, Known::Reported));
        turned(&own, &to_tracker) + Matrix3::identity() * LEAST_MM.powi(2)
    };
    poses.iter().map(of).collect()
}

/// The motions of points by base, target and scale of their session: three rows each. And what is known of these before, as the
/// inverse of a variance around those of the training. `target_sd_mm` is of a target of the session's own; `None` for the known one.
pub fn frame_columns(
    placed: &[Placed],
    target_sd_mm: Option<f64>,
    scale_sd: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let positions: Vec<Point3<f64>> = placed.iter().map(|p| p.position).collect();
    let flanges: Vec<_> = placed.iter().map(|p| p.flange).collect();
    let mut columns = refit::columns(&positions, &flanges, target_sd_mm.is_some());
    let mut sizes = vec![ANYWHERE_MM; 6];
    sizes.extend(target_sd_mm.map_or(Vec::new(), |sd_mm| vec![sd_mm.max(LEAST_MM); 3]));
    if scale_sd > 0.0 {
        let last = columns.ncols();
        columns = columns.insert_column(last, 0.0);
        columns.set_column(last, &refit::levers(&positions, &refit::middle(placed)));
        sizes.push(scale_sd * MM_PER_M);
    }
    let precision = sizes.into_iter().map(|sd: f64| sd.powi(-2));
    let precision = DVector::from_iterator(columns.ncols(), precision);
    (columns, precision)
}

/// Standard deviation of an instrument's reading while stations are chosen, mm, per axis: that of laser trackers at a few metres.
const LEAST_MM: f64 = 0.01;

fn query<'q>(observation: &'q Observation, axes: &'q [f64], known: Known<'q>) -> Query<'q> {
    Query { axes, known, session: 0, own: false, ..Query::of(observation) }
}
