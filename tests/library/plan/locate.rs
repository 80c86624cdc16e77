//! After a remount: few chosen poses find base and target of an arm that is identified already.

use nalgebra::Isometry3;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::{self, Models, Observation, Purpose, TrainingSettings};
use posegrid::pipeline::planning::Planning;
use posegrid::plan::locate::{Identified, LocatePlan, locate};
use posegrid::plan::robots::{Robot, stations};
use posegrid::plan::{Placer, PlanSettings, line_of_sight};
use posegrid::report::evaluate::Stations;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget, Locator};
use posegrid::report::unseen::unseen_session;
use posegrid::report::{Angles, Model, Residual, accuracy::accuracy};
use posegrid::simulate::{Commanded, Ingredient, Stream};

use super::known::{few_harmonics, random};

/// Number of robots that figures are means of: what the model has wrong at twelve poses of one of them is chance.
const ROBOTS: usize = 6;

/// A robot that is identified from 60 poses, and can be measured again.
struct Remounted<'a> {
    planning: &'a Planning,
    robot: Robot<'a>,
    models: Models,
}

impl<'a> Remounted<'a> {
    fn new(planning: &'a Planning, number: usize) -> Self {
        let Planning { arm, settings, .. } = planning;
        let placer = Placer::new(arm, settings).expect("a box in reach");
        let mut robot = Robot::draw(arm, settings, number);
        let fitted = robot
            .fitted(&random(&placer, settings, 60), settings, &settings.full)
            .expect("enough poses");
        Self { models: fitted.models, planning, robot }
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
        fit::add_commands(&mut observations, &stations, &commanded(&stations, arm, &frames));
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
            purpose: Purpose::Published,
        };
        let locate = Locate { by, stations: Some(12), target: LocateTarget::Own };
        let locator = Locator::new(&self.models, arm, locate, &train);
        let located = locator.located(&self.models, session);
        assert_eq!(located.finders.len(), 12);
        let stations = Stations { session: "tuesday", observations: session };
        let sets = unseen_session(&self.models, stations, &locator, &located).expect("one of each");
        let set = sets.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles) == (Model::Full, Angles::Commanded)
                && subject.base_refit == locate.base_refit()
        });
        let set = set.expect("stations span space");
        let taken = set.residuals.iter().filter(|r| r.used_for_refit);
        assert_eq!(taken.count(), 12);
        assert!(set.residuals.iter().all(|r: &Residual| r.covariance.is_some()));
        let of = accuracy(set, &settings.tolerance, 0.0);
        let mean = of.figures.expect("stations judge").mean;
        (mean, of.coverage.expect("covariances").inside)
    }
}

/// Poses of the box, as programs have them.
fn in_the_box(placer: &Placer<'_>, settings: &PlanSettings, count: usize) -> Vec<Commanded> {
    let mut stream = Stream::new(78, Ingredient::TestPoses);
    let found = placer.random(&settings.region, count, &mut stream, &|_| Ok(()));
    found.expect("poses in reach").0
}

/// The poses around the first of these, nearest first.
fn around_the_first(poses: &[Commanded]) -> Vec<Commanded> {
    let at = |pose: &Commanded| pose.base_from_target.translation.vector;
    let away = |pose: &Commanded| (at(pose) - at(&poses[0])).norm();
    let mut sorted = poses.to_vec();
    sorted.sort_by(|a, b| away(a).total_cmp(&away(b)));
    sorted
}

/// Means of means and shares.
fn mean(all: &[(f64, f64)]) -> (f64, f64) {
    let count = all.len() as f64;
    let sum = all.iter().fold((0.0, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
    (sum.0 / count, sum.1 / count)
}

#[test]
fn chosen_poses_find_a_remounted_base_and_neighbours_do_not() {
    let lake = tempfile::tempdir().expect("a folder");
    let planning = few_harmonics(lake.path());
    let (arm, settings) = (&planning.arm, &planning.settings);
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let tests = in_the_box(&placer, settings, 120);
    let corner = around_the_first(&tests);
    let (mut planned, mut neighbours, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
    let mut promised = 0.0;
    for number in 0..ROBOTS {
        let mut robot = Remounted::new(&planning, 1000 + number);
        let plan = robot.planned(12);
        assert_eq!(plan.poses.len(), 12);
        for pose in &plan.poses {
            let suits = line_of_sight::verdict(arm, &pose.joints, &settings.constraints);
            assert!(suits.is_ok(), "{suits:?}");
        }
        // More poses leave less, and the whole box less than six.
        let by_number: Vec<f64> = plan.others.iter().map(|(_, own)| own.mean_mm).collect();
        assert!(by_number[0] > plan.promise.mean_mm && by_number[1] < plan.promise.mean_mm);
        assert!(plan.arm_alone.mean_mm < by_number[0]);
        promised += plan.promise.mean_mm / ROBOTS as f64;
        let mut judged = |first: &[Commanded], by| {
            let session = robot.measured(&[first, &tests[..]].concat());
            robot.judged(&session, by)
        };
        planned.push(judged(&plan.poses, LocateBy::First));
        neighbours.push(judged(&corner[..12], LocateBy::First));
        chosen.push(judged(&[], LocateBy::Chosen));
    }
    let (planned, neighbours, chosen) = (mean(&planned), mean(&neighbours), mean(&chosen));
    println!(
        "promised {promised}, planned {planned:?}, neighbours {neighbours:?}, chosen {chosen:?}"
    );
    assert!(planned.0 < neighbours.0 && planned.0 < 1.2 * promised);
    // Ellipsoids hold with the drift that is still to come.
    assert!(planned.1 >= 0.9 && chosen.1 >= 0.9);
    // Chosen among all stations of a session they are about as good.
    assert!(chosen.0 < 1.1 * planned.0);
}
