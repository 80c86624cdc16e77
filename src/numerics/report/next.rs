//! What a user does with a run's result: the command that corrects targets by it, or what to do before it corrects any.
//!
//! Inputs are the verdict of the run, the base frame that it holds in, the tolerance, and whether its logs disagree with the stated
//! set-up; the output is shown by summary and page.

use super::frame::StatedFrame;
use super::verdict::{Applied, ProductVerdict, RunVerdict};
use crate::figures::least_count;
use crate::grid::{Tolerance, Verdict};
use crate::kinematics::{Arm, Configuration};

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Next {
    pub by: Applied,
    /// The statement that targets need where the identified arm corrects them.
    pub stated: Stated,
    /// What has to be done before anything else, in words that end before what follows; empty where nothing has.
    pub first: &'static str,
    /// Whether the program's base has to be set to the fitted one before.
    pub sets_base: bool,
    /// What to do before any target is corrected; `None` where the tolerance is met.
    pub instead: Option<Instead>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instead {
    pub words: String,
    /// The exception with which `compensate` corrects all the same.
    pub allow: &'static str,
}

/// The way of an arm into a target, as the target has to state it for its correction by the identified arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stated {
    /// Joint angles: the arm reaches a pose in infinitely many ways, or has no other orientation at a position than its own.
    Joints,
    /// Joint angles, or an orientation: an arm with six joints and without configurations.
    JointsOrOrientation,
    JointsOrConfiguration,
}

impl Stated {
    pub fn of(arm: &Arm) -> Self {
        let joints = arm.joints().len();
        let nominal = arm.no_offsets();
        if joints != 6 {
            Self::Joints
        } else if Configuration::of(arm, &nominal, &vec![0.0; joints]).is_some() {
            Self::JointsOrConfiguration
        } else {
            Self::JointsOrOrientation
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Joints => "joint angles",
            Self::JointsOrOrientation => "joint angles, or an orientation",
            Self::JointsOrConfiguration => "joint angles, or orientation and configuration",
        }
    }
}

impl Next {
    /// What to do with a result of this verdict, which holds in `frame`, for an arm whose targets are `stated`; `checks_set_up` where
    /// its logs disagree with the set-up.
    pub fn of(
        verdict: &RunVerdict,
        frame: &StatedFrame,
        tolerance: &Tolerance,
        stated: Stated,
        checks_set_up: bool,
    ) -> Self {
        let first = if frame.open_mm.is_some() {
            "state [fit] target or measure poses of other tool orientations, and run again; once the base is fixed: "
        } else if checks_set_up {
            "check the set-up first, as the warning says, and run again; once it is sound: "
        } else {
            ""
        };
        Self {
            by: verdict.applied,
            stated,
            first,
            sets_base: !frame.is_surveyed && frame.open_mm.is_none(),
            instead: instead(verdict, tolerance),
        }
    }

    pub const fn table(&self) -> &'static str {
        match self.by {
            Applied::Table => "compensation",
            Applied::IdentifiedArm | Applied::Nothing => "calibrations",
        }
    }

    /// The command to type, with `file` of [`Self::table`]; `None` where nothing is corrected.
    pub fn command(&self, file: &str) -> Option<String> {
        if self.by == Applied::Nothing {
            return None;
        }
        let allow = self.instead.as_ref();
        let allow = allow.map_or_else(String::new, |own| format!(" --allow {}", own.allow));
        Some(format!("posegrid compensate {file} targets.csv --out corrected.csv{allow}"))
    }

    /// What to do, in words that end before the command where there is one; it is only for whoever corrects all the same where there is
    /// something to do before.
    pub fn words(&self) -> String {
        self.steps().join("; ")
    }

    /// A sentence for each step: what to do before, where anything is, then how targets are corrected.
    pub fn steps(&self) -> Vec<String> {
        let first = self.first;
        let base =
            if self.sets_base { "set the program's base to the fitted one, then " } else { "" };
        let instead = self.instead.as_ref().map(|own| own.words.clone());
        let targets = match self.by {
            Applied::Table => "correct targets".to_owned(),
            Applied::IdentifiedArm => format!("correct targets that state {}", self.stated.words()),
            Applied::Nothing => {
                let nothing = format!("{first}{base}correct nothing, as no correction helps");
                return [nothing].into_iter().chain(instead).collect();
            }
        };
        match instead {
            None => vec![format!("{first}{base}{targets}")],
            Some(instead) => {
                vec![format!("{first}{instead}"), format!("to {base}{targets} all the same")]
            }
        }
    }
}

/// What to do where the tolerance is not met, or not shown to be; `None` where it is met.
fn instead(verdict: &RunVerdict, tolerance: &Tolerance) -> Option<Instead> {
    let (words, allow) = match verdict.verdict() {
        Verdict::Meets => return None,
        Verdict::NotShown(_) => (to_show(verdict.headline(), tolerance), "not-shown"),
        Verdict::DoesNotMeet => (to_meet(verdict, tolerance), "not-met"),
    };
    Some(Instead { words, allow })
}

/// What shows that the tolerance is met, where nothing shows it yet.
fn to_show(verdict: &ProductVerdict, tolerance: &Tolerance) -> String {
    let needed = least_count(tolerance.coverage());
    let decides = verdict.decides();
    let figure = decides.and_then(|judge| judge.figure.as_ref());
    match (decides, figure) {
        (Some(judge), Some(figure)) if figure.bound.is_none() && needed.is_finite() => {
            let poses = figure.counted.poses;
            format!(
                "measure {:.0} poses more, at least, for {} to judge ({poses} do, {needed:.0} are needed); `posegrid plan` chooses them",
                (needed - poses as f64).max(1.0),
                judge.stations.words(),
            )
        }
        _ => "clear up what the verdict names, then measure again".to_owned(),
    }
}

/// What brings the errors within the tolerance, by what keeps them from it.
fn to_meet(verdict: &RunVerdict, tolerance: &Tolerance) -> String {
    let judge = verdict.headline().decides();
    let figure = judge.and_then(|judge| judge.figure.as_ref());
    let guard_mm = figure.map_or(0.0, |figure| figure.expanded_uncertainty_mm);
    let bound = figure.and_then(|figure| figure.bound);
    if guard_mm >= tolerance.mm {
        format!(
            "the measurement's own uncertainty of {guard_mm:.3} mm is more than the tolerance: measure points and base more accurately"
        )
    } else if bound.is_some_and(|bound| bound <= tolerance.mm) {
        format!(
            "the bound is within the tolerance, the measurement's own uncertainty of {guard_mm:.3} mm is too much beside it: measure \
             points and base more accurately"
        )
    } else if let Some(judge) = judge.filter(|judge| judge.may_be_of_another_arm()) {
        let stations = judge.stations.words();
        format!("find out whether {stations} is of this arm, and learn from it too if it is")
    } else {
        verdict.limit.clone().unwrap_or_else(|| "see on the page where the errors are".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::Counted;
    use crate::fit::{Angles, Model};
    use crate::kinematics::RobotFile;
    use crate::report::verdict::{Judge, Judging};
    use crate::report::{Accuracy, BaseRefit, Moment, Point, Split, Subject};
    use nalgebra::Isometry3;

    const TOLERANCE: Tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };

    fn next(bound_mm: Option<f64>, poses: usize, guard_mm: f64, is_surveyed: bool) -> Next {
        doubted(bound_mm, poses, guard_mm, (is_surveyed, None, false))
    }

    /// In a frame that is surveyed or that the poses do not fix, by logs that may disagree with the set-up.
    fn doubted(
        bound_mm: Option<f64>,
        poses: usize,
        guard_mm: f64,
        (is_surveyed, open_mm, checks_set_up): (bool, Option<f64>, bool),
    ) -> Next {
        let counted = Counted::once(poses);
        let verdict = TOLERANCE.verdict(bound_mm, counted, guard_mm);
        let figure = Accuracy {
            subject: Subject {
                split: Split::Blocks,
                of_session: "mon".to_owned(),
                model: Model::Full,
                angles: Angles::Commanded,
                base_refit: BaseRefit::None,
            },
            point: Point::Measured,
            moment: Moment::After,
            driven_by: None,
            figures: None,
            bound: bound_mm,
            counted,
            finders: None,
            blocks: Some(8),
            coverage: None,
            expanded_uncertainty_mm: guard_mm,
            verdict: verdict.clone(),
        };
        let judge = Judge {
            stations: Judging::Blocks("mon".to_owned()),
            verdict,
            words: String::new(),
            remark: None,
            harms: false,
            figure: Some(figure),
            covered: None,
        };
        let arm = vec![(Model::Full, ProductVerdict::of(vec![judge]))];
        let mut verdict = RunVerdict::of(ProductVerdict::of(Vec::new()), arm, Model::Full);
        verdict.limit = Some("repeatability limits".to_owned());
        let frame = StatedFrame {
            is_surveyed,
            tracker_from_base: Isometry3::identity(),
            sd_mm: None,
            sd_deg: None,
            lever_sd_mm: None,
            open_mm,
        };
        let stated = Stated::JointsOrConfiguration;
        Next::of(&verdict, &frame, &TOLERANCE, stated, checks_set_up)
    }

    #[test]
    fn targets_state_what_their_arm_needs() {
        let arm = |text: &str| {
            let file: RobotFile = toml::from_str(text).expect("a robot file");
            file.arm().expect("an arm")
        };
        let track = arm(include_str!("../../../tests/robots/track.toml"));
        let positioner = arm(include_str!("../../../tests/robots/turn_and_tilt.toml"));
        let kr210 = arm(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"));
        for (arm, expected) in [
            (track, "correct targets that state joint angles"),
            (positioner, "correct targets that state joint angles"),
            (kr210, "correct targets that state joint angles, or orientation and configuration"),
        ] {
            let met = Next { stated: Stated::of(&arm), ..next(Some(0.2), 80, 0.05, true) };
            assert_eq!(met.words(), expected);
        }
    }

    #[test]
    fn a_result_that_is_met_is_applied() {
        let met = next(Some(0.2), 80, 0.05, true);
        assert_eq!((met.table(), &met.instead), ("calibrations", &None));
        assert_eq!(
            met.command("lake/calibrations/r/mon/00ff.parquet").as_deref(),
            Some(
                "posegrid compensate lake/calibrations/r/mon/00ff.parquet targets.csv --out corrected.csv"
            )
        );
        assert!(met.words().starts_with("correct targets that state joint"));
        let fitted = next(Some(0.2), 80, 0.05, false);
        assert!(
            fitted.words().starts_with("set the program's base to the fitted one, then correct")
        );
    }

    #[test]
    fn a_set_up_that_is_doubted_is_checked_before_anything_else() {
        for (bound_mm, sound) in [(0.2, "correct targets"), (0.9, "repeatability limits")] {
            let doubted = doubted(Some(bound_mm), 80, 0.05, (true, None, true));
            let words = doubted.words();
            let (first, then) = words.split_once(": ").expect("two parts");
            assert!(first.starts_with("check the set-up first"), "{words}");
            assert!(then.starts_with(sound), "{words}");
        }
    }

    #[test]
    fn a_frame_that_the_poses_do_not_fix_is_fixed_first_and_what_harms_is_not_applied() {
        let open = doubted(Some(0.2), 80, 0.05, (false, Some(38.0), true));
        let words = open.words();
        assert!(
            words.starts_with(
                "state [fit] target or measure poses of other tool orientations, and run again"
            ),
            "{words}"
        );
        assert!(words.ends_with("once the base is fixed: correct targets that state joint angles, or orientation and configuration"), "{words}");
        let none = Next { by: Applied::Nothing, ..next(Some(0.9), 80, 0.05, false) };
        assert_eq!(none.command("f"), None);
        assert_eq!(
            none.words(),
            "set the program's base to the fitted one, then correct nothing, as no correction helps; repeatability limits"
        );
    }

    #[test]
    fn a_result_that_is_not_says_what_keeps_it_from_the_tolerance() {
        let of = |bound_mm, poses, guard_mm| next(bound_mm, poses, guard_mm, true);
        let words = |next: &Next| next.words();
        let few = of(None, 9, 0.05);
        // 59 poses show 95 % with 95 % confidence.
        assert!(words(&few).starts_with("measure 50 poses more"), "{}", words(&few));
        assert!(few.command("f").is_some_and(|own| own.ends_with(" --allow not-shown")));
        let far = of(Some(0.9), 80, 0.05);
        assert!(words(&far).starts_with("repeatability limits"), "{}", words(&far));
        assert!(far.command("f").is_some_and(|own| own.ends_with(" --allow not-met")));
        let near = of(Some(0.48), 80, 0.05);
        assert!(words(&near).starts_with("the bound is within"), "{}", words(&near));
        let rough = of(Some(0.2), 80, 0.6);
        assert!(words(&rough).contains("0.600 mm is more than the tolerance"), "{}", words(&rough));
    }
}
