use clap::Args;

use super::flags::{finite, numbers};
use crate::simulate::settings::{CameraSettings, Instrument, ScannerSettings, SimulateSettings};

/// The instrument.
#[derive(Debug, Clone, Args)]
#[group(skip)]
#[command(next_help_heading = "Instrument (a laser tracker where none is given)")]
pub(super) struct InstrumentFlags {
    /// A stationary scanner (structured light, a laser line) that reads points and states their covariances: standard deviations along and
    /// across the line of sight at 1 m, mm; the first grows with the square of the distance, the other with the distance
    #[arg(long, value_name = "ALONG,ACROSS", value_parser = |text: &str| numbers::<2>(text, "2"), group = "instrument", conflicts_with_all = OF_TRACKERS)]
    scanner: Option<[f64; 2]>,
    /// A camera that sees a flat, square target and states its pose's covariance: focal length and noise of a corner, pixels, edge of the
    /// target, mm, and corners along it
    #[arg(long, value_name = "FOCAL,NOISE,EDGE,CORNERS", value_parser = camera, group = "instrument", conflicts_with_all = OF_TRACKERS)]
    camera: Option<([f64; 3], u32)>,
    /// The camera is on the flange and the target in the cell
    #[arg(long, requires = "camera")]
    on_flange: bool,
    /// Share of stations at which the camera takes the second solution that a small flat target has
    #[arg(long, value_name = "SHARE", value_parser = finite, requires = "camera", default_value_t = 0.0)]
    flipped_share: f64,
    /// Distance of scanner or camera from the middle of the poses, mm
    #[arg(long, value_name = "MM", value_parser = finite, requires = "instrument", default_value_t = 1500.0)]
    instrument_distance_mm: f64,
    /// Factor by which the standard deviations that scanner or camera state are too small
    #[arg(long, value_name = "FACTOR", value_parser = finite, requires = "instrument", default_value_t = 1.0)]
    understated: f64,
}

/// Flags that mean nothing of other instruments.
const OF_TRACKERS: [&str; 6] =
    ["six_dof", "beside", "reference", "no_tracker_noise", "tracker_scale_ppm", "outlier_share"];

impl InstrumentFlags {
    pub(super) fn change(&self, settings: &mut SimulateSettings) {
        let distance_mm = self.instrument_distance_mm;
        settings.instrument = match (self.scanner, self.camera) {
            (Some([along_mm, across_mm]), _) => {
                Instrument::Scanner(ScannerSettings { along_mm, across_mm, distance_mm })
            }
            (None, Some(([focal_px, noise_px, target_mm], corners))) => {
                let (on_flange, flipped_share) = (self.on_flange, self.flipped_share);
                Instrument::Camera(CameraSettings {
                    focal_px,
                    noise_px,
                    target_mm,
                    corners,
                    on_flange,
                    distance_mm,
                    flipped_share,
                })
            }
            (None, None) => return,
        };
        settings.understated = self.understated;
        settings.cell.six_dof = self.camera.is_some();
        settings.tracker.outlier_share = 0.0;
    }
}

/// Focal length, noise and edge of a camera, px, px and mm, and the corners along the edge.
fn camera(text: &str) -> Result<([f64; 3], u32), String> {
    let [focal_px, noise_px, edge_mm, _] = numbers(text, "4")?;
    let corners = text.rsplit(',').next().unwrap_or_default().trim();
    let corners = corners.parse().map_err(|_| format!("{corners} corners: give a whole number"))?;
    Ok(([focal_px, noise_px, edge_mm], corners))
}
