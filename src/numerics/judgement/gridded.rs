//! Stations and models in the form that the grid stage needs.

use nalgebra::{Point3, Vector3};

use super::JoinedSession;
use super::judged::Judges;
use super::lengths::{self, worst_sd_mm};
use super::stated;
use crate::figures::median;
use crate::fit::commanded::CommandedPose;
use crate::fit::observation::stated_of;
use crate::fit::{ErrorFrame, Models, Observation, ToolErrors};
use crate::grid::{self, GridError, GridInput, GridStation, Reach, StepAnswers};
use crate::join::{Reading, Station};
use crate::progress::Progress;

/// The session's paired stations for grids: commanded tool poses, and the errors relative to them. `fold` is the one of a station's
/// number; a station without has no part.
pub(super) fn grid_stations(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
    fold: impl Fn(usize) -> Option<usize>,
) -> Vec<GridStation> {
    let reach = Reach::new(error_frame.arm, error_frame.flange_from_tool);
    let (all, commanded) = (&session.joined.stations, &session.commanded);
    let commands = commanded.poses.iter().zip(&commanded.visits);
    let paired = all.iter().zip(commands).filter(|(station, _)| station.one_reading().is_some());
    let station = |(station, (pose, &visited)): Paired<'_>| {
        let fold = fold(station.number)?;
        let position = pose.map(|pose| pose.position);
        Some(GridStation {
            pose: all[visited].number,
            ..GridStation::of(station, position, error_frame, &reach, fold)?
        })
    };
    paired.filter_map(station).collect()
}

/// A station with its command and the index of the station that names its pose.
type Paired<'s> = (&'s Station, (&'s Option<CommandedPose>, &'s usize));

impl Judges<'_> {
    /// Judged steps and table, with node values of the best model; what steps answer is taken from `known` where that is of these stations.
    pub(super) fn grids(
        &self,
        folds: &[Option<Models>],
        known: Option<Vec<StepAnswers>>,
        progress: &dyn Progress,
    ) -> Result<grid::Grids, GridError> {
        let Self { models, stations, error_frame, settings, .. } = *self;
        if models.base_target.sources.iter().all(|own| own.kind.is_length()) {
            return Ok(lengths::no_grids(self.test, settings));
        }
        let best = models.best().0;
        // A fold that holds no station out is never used.
        let folds = folds.iter().map(|fold| fold.as_ref().unwrap_or(models)).chain([models]);
        let errors = folds.map(|own| {
            let model = own.get(best).unwrap_or_else(|| own.best().1);
            ToolErrors::new(model, self.last(), error_frame)
        });
        let mut folds: Vec<ToolErrors<'_>> = errors.collect();
        let model = folds.pop().expect("that of all stations");
        let guard_mm = self.guard_mm();
        let input = GridInput { stations, folds: &folds, model, guard_mm };
        let reach = Reach::new(error_frame.arm, error_frame.flange_from_tool);
        grid::grids(&input, &reach, &settings.grid, &settings.tolerance, known, progress)
    }

    /// Expanded uncertainty (k = 2) of a measured error, mm: along the instrument's worst direction, and by the scale of the session at the
    /// station furthest from the stations' middle. The base is found from the same stations, so in their middle a scale does
    /// nothing; at the edge of the work space it moves every position, and nothing that was measured in the same unit shows it. The survey
    /// of the base, where errors are stated in it, is joined at the station furthest from the base.
    fn guard_mm(&self) -> f64 {
        let middle = self.middle();
        let places = || self.stations.iter().map(|station| station.position);
        let furthest_mm = places().map(|place| (place - middle).norm()).fold(0.0, f64::max);
        let by_scale_mm = 1e-6 * self.settings.full.session_scale_ppm * furthest_mm;
        let reach_mm = places().map(|place| place.coords.norm()).fold(0.0, f64::max);
        let by_survey_mm = stated::uncertainty(self.settings).expanded_uncertainty_mm(reach_mm);
        (2.0 * self.of_instrument_mm(&middle).hypot(by_scale_mm)).hypot(by_survey_mm)
    }

    /// The middle of the stations in the base frame, mm.
    pub(super) fn middle(&self) -> Point3<f64> {
        let positions = self.stations.iter().map(|station| station.position.coords);
        Point3::from(positions.sum::<Vector3<f64>>() / self.stations.len().max(1) as f64)
    }

    /// Standard deviation of a reading along its worst direction, mm: of readings that state their covariances, and of a camera's, the
    /// median; of others that of the instrument at a place in the base frame.
    fn of_instrument_mm(&self, place: &Point3<f64>) -> f64 {
        let frames = &self.error_frame.frames;
        let source = self.settings.noise.source(frames.source);
        let states = |own: &Reading| {
            source.uncertainty.camera().is_some() || stated_of(own, source).is_some()
        };
        if !self.own().joined.stations.iter().flat_map(Station::measured).any(states) {
            let place = frames.tracker_from_base.isometry() * place;
            return worst_sd_mm(&source.uncertainty.covariance(&place));
        }
        let own = self.observed.of_session(self.last()).map(|(own, _)| own);
        let points = own.filter(|own| own.source == frames.source).filter_map(Observation::point);
        let worst: Vec<f64> = points.map(|point| worst_sd_mm(&point.instrument)).collect();
        median(&worst).unwrap_or_default()
    }
}
