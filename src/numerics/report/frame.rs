//! The base frame that a run's errors, table and verdict hold in, in words.

use nalgebra::Isometry3;

use crate::fit::{FrameUncertainty, SurveyedBase};
use crate::geometry::typed::{self, Typed};

/// The base frame that a run's results hold in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedFrame {
    /// Whether the base was surveyed; fitted otherwise.
    pub is_surveyed: bool,
    pub tracker_from_base: Isometry3<f64>,
    /// Standard deviation of its origin's coordinates, mm: as stated of a surveyed base, by fit of a fitted one; `None` where not stated.
    pub sd_mm: Option<f64>,
    /// Standard deviation of its rotation about each axis, degrees, likewise.
    pub sd_deg: Option<f64>,
    /// Standard deviation of each coordinate of the tool's place beside the measured target, mm, as stated; `None` where the two are one
    /// point, where it is not stated, and where the base was fitted.
    pub lever_sd_mm: Option<f64>,
    /// Standard error of a coordinate of the measured target's place at the flange, mm, where the poses tell it from the base's by less
    /// than the tolerance asks; `None` where they do, where nothing hangs on it, and of a frame that was read from a table.
    pub open_mm: Option<f64>,
}

impl StatedFrame {
    /// The uncertainty that it leaves at every point; zero where the base was fitted, and for what is not stated.
    pub fn uncertainty(&self) -> FrameUncertainty {
        if !self.is_surveyed {
            return FrameUncertainty::default();
        }
        let base = SurveyedBase {
            tracker_from_base: self.tracker_from_base,
            sd_mm: self.sd_mm,
            sd_rad: self.sd_deg.map(f64::to_radians),
        };
        base.uncertainty(self.lever_sd_mm)
    }

    /// What the results hold in, in a sentence.
    pub fn words(&self) -> String {
        let uncertainty = self.uncertainty_words();
        if !self.is_surveyed {
            let holds = if self.open_mm.is_some() {
                "the poses do not fix it, so set no program's base to it"
            } else {
                "corrected commands are right only where the program's base is set to it"
            };
            return format!("frame: the base as fitted ({uncertainty}): {holds}");
        }
        let lever = self.lever_sd_mm.map_or_else(String::new, |mm| {
            format!(", {mm:.3} mm of the tool beside the measured target")
        });
        if self.sd_mm.is_none() && self.sd_deg.is_none() {
            format!(
                "frame: the surveyed base; {uncertainty}, and not counted in U and corrections ([tracker] tracker_from_base.surveyed \
                 sd_mm, sd_deg){lever}"
            )
        } else {
            format!("frame: the surveyed base ({uncertainty}{lever}, counted in U and corrections)")
        }
    }

    /// That the poses do not fix the frame, and what does; `None` where they do.
    pub fn open_words(&self) -> Option<String> {
        let mm = self.open_mm?;
        Some(format!(
            "the poses do not fix the base: of nearly one tool orientation, they tell it from the target's place at the flange to {mm:.1} mm \
             only (standard deviation); state [fit] target, or measure poses of other tool orientations"
        ))
    }

    fn uncertainty_words(&self) -> String {
        match (self.sd_mm, self.sd_deg) {
            (Some(mm), Some(deg)) => format!("{mm:.3} mm and {deg:.4}° as standard deviations"),
            (Some(mm), None) => {
                format!("{mm:.3} mm as standard deviation, its rotation's is not stated")
            }
            (None, Some(deg)) => {
                format!("{deg:.4}° as standard deviation, its origin's is not stated")
            }
            (None, None) => "its uncertainty is not stated".to_owned(),
        }
    }

    /// What to set the program's base to, where it was fitted and the poses fix it: for each of two ways to state it, what is typed.
    pub fn to_set(&self) -> Vec<(&'static str, [Typed; 4])> {
        if self.is_surveyed || self.open_mm.is_some() {
            return Vec::new();
        }
        vec![
            (
                "the tracker's frame in the robot's base ($BASE of points that are given in the tracker's frame)",
                typed::forms(&self.tracker_from_base.inverse()),
            ),
            ("the robot's base in the tracker's frame", typed::forms(&self.tracker_from_base)),
        ]
    }

    /// [`Self::words`], and where the base was fitted the frame as it is typed, a line for each of three forms.
    pub fn lines(&self) -> Vec<String> {
        let Some((what, forms)) = self.to_set().into_iter().next() else {
            return vec![self.words()];
        };
        let typed = forms.into_iter().take(3);
        let line = |(form, text): Typed| format!("  {form}: {text}");
        let words = format!("{}, which is {what}", self.words());
        std::iter::once(words).chain(typed.map(line)).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;

    #[test]
    fn a_fitted_base_is_told_as_it_is_typed_and_a_surveyed_one_is_not() {
        let mut frame = StatedFrame {
            is_surveyed: false,
            tracker_from_base: Isometry3::from_parts(
                Translation3::new(4200.0, -900.0, -650.0),
                UnitQuaternion::identity(),
            ),
            sd_mm: Some(0.02),
            sd_deg: Some(0.0003),
            lever_sd_mm: None,
            open_mm: None,
        };
        let lines = frame.lines();
        assert!(lines[0].contains("right only where the program's base is set to it"), "{lines:?}");
        assert_eq!(lines.len(), 4, "{lines:?}");
        for (line, form) in lines[1..].iter().zip(["KUKA", "UR pose", "ABB pose"]) {
            assert!(line.contains(form) && line.contains("4200") | line.contains("4.2"), "{line}");
        }
        assert_eq!(frame.uncertainty(), FrameUncertainty::default());
        assert_eq!(frame.open_words(), None);
        // One tool orientation: no base is stated for a program, and the key that fixes it is.
        frame.open_mm = Some(38.0);
        assert!(
            frame
                .open_words()
                .is_some_and(|words| words.contains("38.0 mm") && words.contains("[fit] target"))
        );
        assert_eq!(frame.lines().len(), 1);
        assert!(frame.words().ends_with("set no program's base to it"));
        (frame.is_surveyed, frame.open_mm) = (true, None);
        assert_eq!(
            frame.lines(),
            [
                "frame: the surveyed base (0.020 mm and 0.0003° as standard deviations, counted in U and corrections)"
            ]
        );
    }

    #[test]
    fn a_survey_counts_as_it_is_stated_and_says_where_it_is_not() {
        let mut frame = StatedFrame {
            is_surveyed: true,
            tracker_from_base: Isometry3::identity(),
            sd_mm: Some(0.02),
            sd_deg: Some(0.18),
            lever_sd_mm: Some(0.2),
            open_mm: None,
        };
        let own = frame.uncertainty();
        assert_eq!((own.origin_mm, own.lever_mm), (0.02, 0.2));
        assert!((own.rotation_rad - std::f64::consts::PI / 1000.0).abs() < 1e-15);
        assert!(frame.words().ends_with(
            "0.200 mm of the tool beside the measured target, counted in U and corrections)"
        ));
        (frame.sd_mm, frame.sd_deg, frame.lever_sd_mm) = (None, None, None);
        assert_eq!(frame.uncertainty(), FrameUncertainty::default());
        assert!(frame.words().contains("not counted in U and corrections"), "{}", frame.words());
    }
}
