//! ISO 9283's figures of every session: of its own stations, and of residuals relative to the command.
//!
//! Commands and attained positions are compared in one frame, with the base of the subject:
//! - base + target of a training session: its own fit, on all its stations; of another session: found from those of its
//!   stations that find its base for every verdict, which take no part;
//! - raw command, and a session that a table drove: the base of their residuals;
//! - the full error model from commands alone, on stations that took no part: the error that it would leave, which is
//!   predicted. Errors from reported angles are relative to the controller's own feedback, which is no command.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use super::judged::{Judges, TestSession};
use super::{Driven, JoinedSession};
use crate::fit::commanded::CommandedPose;
use crate::fit::{Corrects, ErrorFrame, FramePair};
use crate::geometry::Transform;
use crate::join::{Reading, Station};
use crate::report::iso_9283::{self, Iso9283, Orientation, Says, Visit, Visited};
use crate::report::refit::{self, Placed};
use crate::report::{
    Angles, BaseRefit, Model, Moment, Point, Residual, ResidualSet, Split, Subject,
};

/// The figures of all sessions; `driven` is the judgement of the last on the table that drove it.
pub(super) fn figures(
    judges: Judges<'_>,
    residuals: &[ResidualSet],
    driven: Option<&Driven>,
    guard_mm: f64,
) -> Vec<Iso9283> {
    Sources { judges, residuals, driven, guard_mm }.figures()
}

struct Sources<'s> {
    judges: Judges<'s>,
    residuals: &'s [ResidualSet],
    driven: Option<&'s Driven>,
    guard_mm: f64,
}

impl Sources<'_> {
    fn figures(&self) -> Vec<Iso9283> {
        let training: Vec<Visits<'_>> = self.judges.training.iter().map(Visits::of).collect();
        let test: Vec<_> = self.judges.test.iter().map(|test| Visits::of(test.session)).collect();
        let mut figures = Vec::new();
        for (place, visits) in training.iter().enumerate() {
            let error_frame = self.error_frame(self.judges.frames[place]);
            figures.push(self.base_target(visits, &error_frame, None));
        }
        let unseen = test.iter().zip(self.judges.test);
        figures.extend(unseen.filter_map(|(visits, test)| self.unseen(visits, test)));
        for visits in training.iter().chain(&test) {
            let sets = self.residuals.iter();
            let own = sets.filter(|set| set.subject.of_session == visits.session.name);
            figures.extend(own.filter_map(|set| self.of_residuals(set, visits, None)));
        }
        if let Some((driven, visits)) = self.driven.zip(training.last()) {
            let by = Some(driven.key.run.as_str());
            figures.extend(driven.sets().filter_map(|set| self.of_residuals(set, visits, by)));
        }
        figures
    }

    fn error_frame(&self, frames: FramePair) -> ErrorFrame<'_> {
        let Judges { arm, settings, .. } = self.judges;
        ErrorFrame::new(arm, frames, settings.flange_from_tool, settings.noise.takes_orientations())
    }

    /// The commands compared with the tool point, at all stations or, of a session that took no part, at those which did not find
    /// its base (`finders`).
    fn base_target(
        &self,
        visits: &Visits<'_>,
        error_frame: &ErrorFrame<'_>,
        finders: Option<&BTreeSet<usize>>,
    ) -> Iso9283 {
        let session = visits.session;
        let finds = |station: &Station| finders.is_some_and(|own| own.contains(&station.number));
        let judged = paired(session).filter(|(station, _, _)| !finds(station));
        let attained = judged.filter_map(|(station, command, reading)| {
            let commanded = match command {
                Some(command) => command.position,
                None if visits.says == Says::Repeatability => {
                    error_frame.nominal_tool(&station.joints).translation.vector.into()
                }
                None => return None,
            };
            let position = error_frame.attained_tool(&station.joints, reading)?;
            let turn = command.and_then(|command| command.orientation);
            let orientation = error_frame.measured_flange(reading).map(|flange| Orientation {
                commanded: turn.filter(|_| session.commanded.trust.agrees()),
                attained: flange * error_frame.flange_from_tool.rotation,
            });
            Some((station.number, (commanded, position, orientation)))
        });
        let attained: BTreeMap<usize, At> = attained.collect();
        let visited = visits.visited(&attained);
        let figures = if visited.is_empty() {
            iso_9283::none(&visits.why_none())
        } else {
            iso_9283::figures(&visited, visits.says)
        };
        let (split, base_refit) = match finders {
            Some(_) => (Split::Session, self.judges.settings.locate.base_refit()),
            None => (Split::None, BaseRefit::None),
        };
        let angles = match visits.says {
            Says::Repeatability => Angles::Reported,
            _ => Angles::Commanded,
        };
        Iso9283 {
            subject: Subject::new((split, &session.name), Model::BaseTarget, angles, base_refit),
            point: Point::Tool,
            moment: Moment::Before,
            driven_by: None,
            expanded_uncertainty_mm: self.guard_mm,
            figures,
        }
    }

    /// The figures of a session that took no part in the training: the base, and the target where it has one of its own,
    /// are found from its stations `finders`. `None` where they do not span space.
    fn unseen(&self, visits: &Visits<'_>, test: &TestSession<'_>) -> Option<Iso9283> {
        let (finders, with_target) = (test.numbers(), test.located.with_target());
        let trained = *self.judges.frames.last()?;
        let error_frame = self.error_frame(trained);
        let first: Vec<(&Station, Point3<f64>)> = paired(visits.session)
            .filter(|(station, _, _)| finders.contains(&station.number))
            .filter_map(|(station, _, reading)| Some((station, reading.position()?)))
            .collect();
        let measured: Vec<Point3<f64>> = first.iter().map(|(_, position)| *position).collect();
        let placed = first.iter().map(|(station, _)| Placed {
            position: error_frame.nominal_target(&station.joints),
            flange: self.judges.arm.flange(&station.joints).isometry().rotation,
        });
        let placed: Vec<Placed> = placed.collect();
        let found = refit::refit(&measured, &placed, with_target)?;
        let mut target = *trained.flange_from_target.isometry();
        target.translation.vector += found.target_shift;
        let frames = FramePair {
            tracker_from_base: Transform::claim(found.base_from_tracker.inverse()),
            flange_from_target: Transform::claim(target),
            ..trained
        };
        // The orientation of a target of its own is not known: measured orientations do not show the tool's.
        let mut error_frame = self.error_frame(frames);
        error_frame.oriented &= !with_target;
        Some(self.base_target(visits, &error_frame, Some(&finders)))
    }

    /// The figures of residuals relative to a command, where they are evidence and poses were repeated.
    fn of_residuals(
        &self,
        set: &ResidualSet,
        visits: &Visits<'_>,
        driven_by: Option<&str>,
    ) -> Option<Iso9283> {
        let subject = &set.subject;
        let (says, moment) = match subject.model.about().corrects {
            Corrects::Nothing => (Says::Everything, Moment::Before),
            Corrects::Commands => (Says::Everything, Moment::MeasuredAfter),
            Corrects::Frames | Corrects::Predicted => (Says::Accuracy, Moment::After),
        };
        let is_evidence = says == Says::Everything || subject.split != Split::None;
        if !is_evidence
            || subject.angles != Angles::Commanded
            || subject.base_refit == BaseRefit::All
        {
            return None;
        }
        let judged = set
            .residuals
            .iter()
            .filter(|residual| !residual.used_for_refit && residual.is_of_main());
        let at = |r: &Residual| (r.station, (r.predicted(), r.attained, None));
        let figures = iso_9283::figures(&visits.visited(&judged.map(at).collect()), says);
        (!figures.is_empty()).then(|| Iso9283 {
            subject: subject.clone(),
            // A session that a table drove is judged at the point that the table is for.
            point: if driven_by.is_some() { Point::Tool } else { Point::Measured },
            moment,
            driven_by: driven_by.map(str::to_owned),
            expanded_uncertainty_mm: self.guard_mm,
            figures,
        })
    }
}

/// Commanded and attained position, and orientation.
type At = (Point3<f64>, Point3<f64>, Option<Orientation>);

/// Stations with a measurement of their own, with their commands.
fn paired(
    session: &JoinedSession,
) -> impl Iterator<Item = (&Station, Option<&CommandedPose>, &Reading)> {
    let stations = session.joined.stations.iter().zip(&session.commanded.poses);
    stations
        .filter_map(|(station, command)| Some((station, command.as_ref(), station.one_reading()?)))
}

/// The dwells of a session with the poses they went to.
struct Visits<'s> {
    session: &'s JoinedSession,
    /// For each station with a command, in a session without any for each, the index of the first one at its pose.
    poses: Vec<Option<usize>>,
    /// What they can show: repeatability alone where no station has a command.
    says: Says,
}

impl<'s> Visits<'s> {
    fn of(session: &'s JoinedSession) -> Self {
        let commanded = &session.commanded;
        let has_commands = commanded.poses.iter().any(Option::is_some);
        let visits = commanded.poses.iter().zip(&commanded.visits);
        let poses = visits.map(|(own, &pose)| (own.is_some() || !has_commands).then_some(pose));
        let says = if has_commands { Says::Everything } else { Says::Repeatability };
        Self { session, poses: poses.collect(), says }
    }

    /// The poses with two or more of these stations, each by its number.
    fn visited(&self, attained: &BTreeMap<usize, At>) -> Vec<Visited> {
        let stations = &self.session.joined.stations;
        let mut visited: BTreeMap<usize, Vec<Visit>> = BTreeMap::new();
        for (place, (station, pose)) in stations.iter().zip(&self.poses).enumerate() {
            let at = attained.get(&station.number).copied();
            let Some((pose, (commanded, position, orientation))) = pose.zip(at) else { continue };
            let before = place.checked_sub(1).and_then(|before| self.poses[before]);
            visited.entry(pose).or_default().push(Visit {
                station: station.number,
                start: station.start,
                from: before.map(|before| stations[before].number),
                commanded,
                attained: position,
                orientation,
            });
        }
        visited.retain(|_, visits| visits.len() > 1);
        let visited = visited.into_iter();
        visited.map(|(pose, visits)| Visited { pose: stations[pose].number, visits }).collect()
    }

    /// The reason why there is no pose with two visits.
    fn why_none(&self) -> String {
        let commanded = self.poses.iter().flatten().count();
        if self.says == Says::Repeatability {
            return "no station has a command, and no pose was measured twice: no two stations have joints within 0.1°".to_owned();
        }
        let firsts = self.poses.iter().enumerate();
        let poses = firsts.filter(|(place, pose)| Some(*place) == **pose).count();
        if poses == commanded {
            format!("no pose was commanded twice: {commanded} stations went to as many poses")
        } else {
            format!("no pose was measured twice: {commanded} stations went to {poses} poses")
        }
    }
}
