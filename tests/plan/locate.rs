//! After a remount: few chosen poses find base and target of an arm that is identified already.

use nalgebra::Isometry3;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::{self, Models, Observation, TrainingSettings};
use posegrid::pipeline::planning::Planning;
use posegrid::plan::Placer;
use posegrid::plan::locate::{Identified, LocatePlan, locate};
use posegrid::plan::robots::{Robot, stations};
use posegrid::report::evaluate::Stations;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget, Locator};
use posegrid::report::unseen::unseen_session;
use posegrid::report::{Angles, Model, Residual, accuracy::accuracy};
use posegrid::simulate::Commanded;

use super::known::{few_harmonics, random};

/// A robot that is identified from 60 poses, and can be measured again.
struct Remounted<'a> {
    planning: &'a Planning,
    robot: Robot<'a>,
    models: Models,
}

impl<'a> Remounted<'a> {
    fn new(planning: &'a Planning) -> Self {
        let Planning { arm, settings, .. } = planning;
        let placer = Placer::new(arm, settings).expect("a box in reach");
        let mut robot = Robot::draw(arm, settings, 1000);
        let fitted = robot
            .fitted(&random(&placer, settings, 60), settings, &settings.full)
            .expect("enough poses");
        Self {
            models: fitted.models,
            planning,
            robot,
        }
    }

    /// The plan of `count` poses for it.
    fn planned(&self, count: usize) -> LocatePlan {
        let identified = Identified {
            model: self.models.full.as_ref().expect("a full error model"),
            session: 0,
            target_sd_mm: Some(0.1),
        };
        let Planning { arm, settings, .. } = self.planning;
        let plan = locate(arm, &identified, count, settings).expect("poses in reach");
        plan.expect("a positive covariance")
    }

    /// A new session at these poses.
    fn measured(&mut self, poses: &[Commanded]) -> Vec<Observation> {
        let Planning { arm, settings, .. } = self.planning;
        let stations = stations(self.robot.session(poses));
        let frames = CommandFrames {
            base_from_command: Isometry3::identity(),
            flange_from_tool: Some(settings.flange_from_target),
        };
        let mut observations = fit::observations(0, &stations, arm, &settings.noise);
        fit::add_commands(
            &mut observations,
            &stations,
            &commanded(&stations, arm, &frames),
        );
        observations
    }

    /// What the full error model from commands alone leaves at the stations that do not find base and target: mean, and the share in
    /// its ellipsoids.
    fn judged(&self, session: &[Observation], by: LocateBy) -> (f64, f64) {
        let Planning { arm, settings, .. } = self.planning;
        let train = TrainingSettings {
            fit: &settings.fit,
            full: &settings.full,
            up: settings.up,
        };
        let locate = Locate {
            by,
            stations: 12,
            target: LocateTarget::Own,
        };
        let locator = Locator::new(&self.models, arm, locate, &train);
        let finders = locator.finders(&self.models, session);
        assert_eq!(finders.len(), 12);
        let stations = Stations {
            session: "tuesday",
            observations: session,
        };
        let sets = unseen_session(&self.models, stations, &locator, &finders).expect("one of each");
        let set = sets.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles) == (Model::Full, Angles::Commanded)
                && subject.base_refit == locate.base_refit()
        });
        let set = set.expect("stations span space");
        let taken = set.residuals.iter().filter(|r| r.used_for_refit);
        assert_eq!(taken.count(), 12);
        assert!(
            set.residuals
                .iter()
                .all(|r: &Residual| r.covariance.is_some())
        );
        let of = accuracy(set, &settings.tolerance, 0.0);
        let mean = of.figures.expect("stations judge").mean;
        (mean, of.coverage.expect("covariances").inside)
    }
}

#[test]
fn chosen_poses_find_a_remounted_base_and_neighbours_do_not() {
    let lake = tempfile::tempdir().expect("a folder");
    let planning = few_harmonics(lake.path());
    let mut remounted = Remounted::new(&planning);
    let plan = remounted.planned(12);
    assert_eq!(plan.poses.len(), 12);
    let (arm, settings) = (&planning.arm, &planning.settings);
    for pose in &plan.poses {
        let suits =
            posegrid::plan::line_of_sight::verdict(arm, &pose.joints, &settings.constraints);
        assert!(suits.is_ok(), "{suits:?}");
    }
    // More poses leave less, and never less than the arm alone.
    let by_number: Vec<f64> = plan.others.iter().map(|(_, own)| own.mean_mm).collect();
    assert!(by_number[0] > plan.promise.mean_mm && by_number[1] < plan.promise.mean_mm);
    assert!(plan.arm_alone.mean_mm < by_number[1]);
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let tests = random(&placer, settings, 150);
    let mut corner = tests.clone();
    let at = |pose: &Commanded| pose.base_from_target.translation.vector;
    let first = at(&corner[0]);
    corner.sort_by(|a, b| (at(a) - first).norm().total_cmp(&(at(b) - first).norm()));
    let all = |first: &[Commanded]| [first, &tests[..]].concat();
    let planned = remounted.measured(&all(&plan.poses));
    let (mean, inside) = remounted.judged(&planned, LocateBy::First);
    let neighbours = remounted.measured(&all(&corner[..12]));
    let (of_neighbours, _) = remounted.judged(&neighbours, LocateBy::First);
    println!(
        "promise {:?}, planned {mean}, inside {inside}, neighbours {of_neighbours}",
        plan.promise
    );
    assert!(mean < of_neighbours, "{mean} {of_neighbours}");
    assert!(
        mean < 1.5 * plan.promise.mean_mm,
        "{mean} {:?}",
        plan.promise
    );
    assert!(inside >= 0.9, "{inside}");
    // Chosen among all stations of a session they are about as good.
    let session = remounted.measured(&tests);
    let (chosen, inside) = remounted.judged(&session, LocateBy::Chosen);
    assert!(
        chosen < 1.3 * mean && inside >= 0.9,
        "{chosen} {mean} {inside}"
    );
}
