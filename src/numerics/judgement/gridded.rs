//! Stations and models in the form that the grid stage needs.

use nalgebra::{Point3, Vector3};

use super::JoinedSession;
use super::judged::Judges;
use super::{StageSettings, lengths, stated};
use crate::fit::commanded::CommandedPose;
use crate::fit::{ErrorFrame, Models, ToolErrors};
use crate::grid::{self, GridError, GridInput, GridStation, Reach, StepAnswers};
use crate::join::Station;
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
        let guard_mm = guard_mm(stations, error_frame, settings);
        let input = GridInput { stations, folds: &folds, model, guard_mm };
        let reach = Reach::new(error_frame.arm, error_frame.flange_from_tool);
        grid::grids(&input, &reach, &settings.grid, &settings.tolerance, known, progress)
    }
}

/// Expanded uncertainty (k = 2) of a measured error, mm: along the instrument's worst direction at the stations' middle, and by the
/// scale of the session at the station furthest from there. The base is found from the same stations, so in their middle a scale does
/// nothing; at the edge of the work space it moves every position, and nothing that was measured in the same unit shows it. The survey
/// of the base, where errors are stated in it, is joined at the station furthest from the base.
fn guard_mm(
    stations: &[GridStation],
    error_frame: &ErrorFrame<'_>,
    settings: &StageSettings,
) -> f64 {
    let sum = stations.iter().fold(Vector3::zeros(), |sum, station| sum + station.position.coords);
    let middle = Point3::from(sum / stations.len().max(1) as f64);
    let in_tracker = error_frame.frames.tracker_from_base.isometry() * middle;
    let from_middle = |station: &GridStation| (station.position - middle).norm();
    let furthest_mm = stations.iter().map(from_middle).fold(0.0, f64::max);
    let by_scale_mm = 1e-6 * settings.full.session_scale_ppm * furthest_mm;
    let source = settings.noise.source(error_frame.frames.source);
    let tracker = source.uncertainty.covariance(&in_tracker);
    let by_tracker_mm = tracker.symmetric_eigenvalues().max().max(0.0).sqrt();
    let from_base = |station: &GridStation| station.position.coords.norm();
    let reach_mm = stations.iter().map(from_base).fold(0.0, f64::max);
    let by_survey_mm = stated::uncertainty(settings).expanded_uncertainty_mm(reach_mm);
    (2.0 * by_tracker_mm.hypot(by_scale_mm)).hypot(by_survey_mm)
}
