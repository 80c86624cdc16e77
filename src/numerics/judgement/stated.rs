//! The error reference frame of a session's errors, by the base that the pipeline file states.
//!
//! - Surveyed: the base is at its surveyed place, so a corrected command brings the tool to the place that the program
//!   wants in that frame.
//! - Fitted: the base is at the place found by base + target, so the program's base has to be set to it.
//!
//! Where the commanded point is the measured target, an error is that of the measured point: there is no lever between the
//! two, and no part of the tool's error is lost in a fitted target. Otherwise the lever comes from `[fit] target` in a
//! surveyed frame, where it is stated, and from the fitted target elsewhere.

use nalgebra::{Isometry3, Translation3, Vector3};

use super::StageSettings;
use crate::fit::{Calibration, ErrorFrame, FramePair, FrameUncertainty};
use crate::geometry::Transform;
use crate::kinematics::Arm;
use crate::report::frame::StatedFrame;

/// Standard errors of an expanded uncertainty.
const EXPANDED: f64 = 2.0;

/// The error reference frame of a session with the `fitted` frames of base + target.
pub(super) fn error_frame<'a>(
    arm: &'a Arm,
    fitted: &FramePair,
    settings: &StageSettings,
) -> ErrorFrame<'a> {
    let base = settings.surveyed();
    let frames = FramePair {
        tracker_from_base: base
            .map_or(fitted.tracker_from_base, |base| Transform::claim(base.tracker_from_base)),
        flange_from_target: Transform::claim(target(fitted, settings)),
        ..*fitted
    };
    ErrorFrame::new(arm, frames, settings.flange_from_tool, settings.noise.takes_orientations())
}

/// The measured target at the flange: its stated place where there is one, its orientation as fitted.
fn target(fitted: &FramePair, settings: &StageSettings) -> Isometry3<f64> {
    let fitted = fitted.flange_from_target.isometry();
    let is_tool = settings.target_is_tool == Some(true);
    let tool = settings.flange_from_tool.filter(|_| is_tool);
    let known = settings.fit.target.filter(|_| settings.surveyed().is_some());
    let place = tool
        .map(|tool| tool.translation.vector)
        .or_else(|| known.map(|known| Vector3::from(known.xyz_mm)))
        .unwrap_or(fitted.translation.vector);
    Isometry3::from_parts(Translation3::from(place), fitted.rotation)
}

/// The base frame that the results of a session hold in: `session` is its index in `base_target`, which found a fitted base.
pub(super) fn frame(
    error_frame: &ErrorFrame<'_>,
    base_target: &Calibration,
    session: usize,
    settings: &StageSettings,
) -> StatedFrame {
    let base = settings.surveyed();
    let (sd_mm, sd_rad) = if let Some(base) = base {
        (base.sd_mm, base.sd_rad)
    } else {
        let (sd_mm, sd_rad) = base_target.base_standard_errors(session);
        (Some(sd_mm), Some(sd_rad))
    };
    StatedFrame {
        is_surveyed: base.is_some(),
        tracker_from_base: *error_frame.frames.tracker_from_base.isometry(),
        sd_mm,
        sd_deg: sd_rad.map(f64::to_degrees),
        lever_sd_mm: lever_sd_mm(settings),
        open_mm: open_mm(base_target, session, settings),
    }
}

/// Standard error of the target's place that the poses tell from the base's by less than the tolerance asks, mm: in another orientation
/// everything is off by as much. `None` where they do, and where neither base nor lever is of the fit.
fn open_mm(base_target: &Calibration, session: usize, settings: &StageSettings) -> Option<f64> {
    let is_stated = settings.target_is_tool == Some(true) || settings.fit.target.is_some();
    let hangs_on_it = settings.surveyed().is_none() || !is_stated;
    let open = base_target.open_target_mm(session).filter(|_| hangs_on_it)?;
    (EXPANDED * open > settings.tolerance.mm).then_some(open)
}

/// The uncertainty that base survey and lever from measured target to tool leave at every point; zero of a fitted base.
pub(super) fn uncertainty(settings: &StageSettings) -> FrameUncertainty {
    let base = settings.surveyed();
    base.map_or_else(FrameUncertainty::default, |base| base.uncertainty(lever_sd_mm(settings)))
}

/// Standard deviation of each coordinate of the stated lever from measured target to tool, mm; `None` where they are one point, where it
/// is not stated, and where the base is fitted.
fn lever_sd_mm(settings: &StageSettings) -> Option<f64> {
    settings.surveyed()?;
    let is_tool = settings.target_is_tool == Some(true);
    Some(settings.fit.target.filter(|_| !is_tool)?.sd_mm)
}
