//! Motions between corrected positions → how far the arm leaves the wanted path there.
//!
//! The controller moves straight, on a circle or by joints from command to command, and the arm's errors on the way are others than at
//! the ends. For each motion between two corrected positions:
//! 1. the wanted path and the commanded one are taken at the same shares of the way;
//! 2. the controller's joints at each commanded pose are those of the nominal arm, and there the identified arm stands elsewhere;
//! 3. its distance from the wanted pose across the path counts; along the path it is a matter of time.

use std::f64::consts::{FRAC_PI_2, PI};
use std::iter;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::solve::Solver;
use crate::programs::write::Command;
use crate::programs::{Asked, Path, Wanted, Way};

/// Places on the way at which a motion is looked at; the ends are corrected.
const PLACES: u32 = 9;
/// The share of the way over which the direction of the path is taken.
const STEP: f64 = 1e-3;
/// Paths and circles that are shorter have no direction, mm.
const NO_LENGTH_MM: f64 = 1e-9;
/// The least of a circle that is written: ABB asks for 0.1 mm up to its helper and, at its begin, for 1° from helper to end, a quarter of
/// its angle.
const PART_MM: f64 = 1.0;
const PART_RAD: f64 = 0.14;
/// How far the orientation of a helper point may be off, rad: 90° make a millimetre, and this some 0.03 mm.
const HELPER_RAD: f64 = 0.05;
/// Orientations nearer than this are alike, rad.
const ALIKE_RAD: f64 = 0.01;

/// Why the way of a motion is not known.
const NO_COURSE: NotStated =
    "it is a spline, a circle with an angle, or its points are in line, or the arm holds the part";

/// Why nothing is stated of a motion.
pub(super) type NotStated = &'static str;

/// A position with what it asks for, and its command.
pub(super) type Stop<'p> = (&'p Asked, &'p Command);

/// The way of the program's tool in the arm's base, mm.
pub(super) enum Course {
    /// Joint values at the ends, and the tool in the flange frame.
    Joints([Vec<f64>; 2], Isometry3<f64>),
    Tool([Isometry3<f64>; 2], Option<Circle>),
}

pub(super) struct Circle {
    centre: Point3<f64>,
    axis: Unit<Vector3<f64>>,
    angle: f64,
}

struct Place {
    /// Joint values of the command, rad; mm where one slides.
    joints: Vec<f64>,
    /// The program's tool in the calibrated one.
    own_from_tool: Isometry3<f64>,
    wanted: Point3<f64>,
    along: Option<Unit<Vector3<f64>>>,
}

impl Solver<'_> {
    /// The largest distance of each motion from its wanted path, mm, by what each position asks for and its command.
    pub(super) fn deviations(
        &self,
        paths: &[Path],
        asked: &[Result<Asked, String>],
        commands: &[Option<Command>],
    ) -> Vec<Result<f64, NotStated>> {
        let stop =
            |position: usize| Some((asked[position].as_ref().ok()?, commands[position].as_ref()?));
        let sampled = paths.par_iter().map(|path| self.sampled(path, stop));
        let sampled: Vec<Result<Vec<Place>, NotStated>> = sampled.collect();
        let joints = sampled.iter().flatten().flatten().map(|place| place.joints.as_slice());
        let mut attained = self.arm.attained(&joints.collect::<Vec<_>>(), self.allow).into_iter();
        let mut deviation = |places: Vec<Place>| {
            let here: Vec<_> = attained.by_ref().take(places.len()).collect();
            here.into_iter().zip(places).try_fold(0.0_f64, |largest, (attained, place)| {
                let own = attained.map_err(|_| "the model does not know the arm on its way")?;
                Ok::<_, NotStated>(
                    largest.max(place.across(&(own * place.own_from_tool).translation.vector)),
                )
            })
        };
        sampled.into_iter().map(|places| deviation(places?)).collect()
    }

    /// Refuses helper points of circles with another orientation than that in which the arm passes them: controllers take the place alone,
    /// and turn the tool evenly from end to end, or as it stands to the path.
    pub(super) fn refuse_helpers(&self, paths: &[Path], asked: &mut [Result<Asked, String>]) {
        let tool = |place: usize, asked: &[Result<Asked, String>]| {
            self.programmed_tool(asked[place].as_ref().ok()?)
        };
        for path in paths {
            let Some(&[helper, end]) = path.through.as_deref() else { continue };
            let stops = [path.from.unwrap_or(end), helper, end].map(|place| tool(place, asked));
            let [Some(from), Some(by), Some(to)] = stops else { continue };
            let passing =
                match Circle::through([from, by, to].map(|own| own.translation.vector.into())) {
                    Some(circle) => circle.turned(&from, &by, &to),
                    None => vec![from.rotation, to.rotation],
                };
            let angles = passing.iter().map(|own| own.angle_to(&by.rotation));
            let least = angles.fold(f64::INFINITY, f64::min);
            if least > HELPER_RAD {
                asked[helper] = Err(format!(
                    "it is the helper point of a circle, of which the controller takes the place alone, and its orientation is {:.0}° off that of \
                     the tool there; write that",
                    least.min(PI).to_degrees()
                ));
            }
        }
    }

    /// The program's tool in the arm's base where the controller has a position now, mm.
    fn programmed_tool(&self, asked: &Asked) -> Option<Isometry3<f64>> {
        match &asked.wanted {
            Wanted::Pose { programmed, .. } => Some(*programmed),
            Wanted::Joints(joints) => {
                let joints = self.joints(joints).ok()?.angles;
                Some(self.arm.arm.flange(&joints).isometry() * asked.stated_tool)
            }
        }
    }

    fn sampled<'p>(
        &self,
        path: &Path,
        stop: impl Fn(usize) -> Option<Stop<'p>>,
    ) -> Result<Vec<Place>, NotStated> {
        let through = path.through.as_ref().ok_or("it leads to a point that is computed")?;
        let from = path.from.ok_or("where it begins is not known")?;
        let stops: Option<Vec<_>> = iter::once(from).chain(through.clone()).map(stop).collect();
        let stops = stops.ok_or("one of its positions is not corrected")?;
        let course = |is_command| self.course(path.way, &stops, is_command);
        let courses = course(false).zip(course(true));
        let (wanted, commanded) = courses.ok_or(NO_COURSE)?;
        let places = self.places(&wanted, &commanded, &stops);
        places.ok_or("the nominal arm does not reach all of its way")
    }

    /// The wanted way, or the commanded one; `None` where it is neither by joints nor straight nor a circle.
    pub(super) fn course(&self, way: Way, stops: &[Stop<'_>], is_command: bool) -> Option<Course> {
        let stands = stops.iter().map(|stop| self.stand(stop, is_command));
        let stands: Vec<_> = stands.collect::<Option<_>>()?;
        let last = stops.last()?.0;
        let tool = if is_command { last.stated_tool } else { last.flange_from_tool };
        match (way, stands.as_slice()) {
            (Way::Joints, [(_, from), (_, to)]) => {
                Some(Course::Joints([from.clone(), to.clone()], tool))
            }
            (Way::Straight, [(from, _), (to, _)]) => {
                Some(Course::Tool([from * tool, to * tool], None))
            }
            (Way::Circle, [(from, _), (helper, _), (to, _)]) => {
                let poses = [from, helper, to].map(|own| own * tool);
                let circle = Circle::through(poses.map(|own| own.translation.vector.into()))?;
                Some(Course::Tool([poses[0], poses[2]], Some(circle)))
            }
            _ => None,
        }
    }

    /// The flange in the arm's base, mm, and the joint values at a position as it is wanted, or commanded.
    fn stand(
        &self,
        (asked, command): &Stop<'_>,
        is_command: bool,
    ) -> Option<(Isometry3<f64>, Vec<f64>)> {
        let shown = &command.joints.as_ref()?[usize::from(is_command)];
        let joints = self.joints(shown).ok()?.angles;
        let tool = if is_command { &asked.stated_tool } else { &asked.flange_from_tool };
        let base_from_tool = match &asked.wanted {
            Wanted::Pose { base_from_tool, .. } if !is_command => Some(*base_from_tool),
            _ => command.base_from_tool.filter(|_| is_command),
        };
        let Some(base_from_tool) = base_from_tool else {
            return Some((*self.arm.arm.flange(&joints).isometry(), joints));
        };
        let pose = base_from_tool * self.own_tool_in(tool);
        let joints = if is_command { joints } else { self.inverse.joints(&pose, &joints).ok()? };
        Some((base_from_tool * tool.inverse(), joints))
    }

    fn places(
        &self,
        wanted: &Course,
        commanded: &Course,
        stops: &[Stop<'_>],
    ) -> Option<Vec<Place>> {
        let [first, .., last] = stops else { return None };
        let own_from_tool = self.own_tool_in(&last.0.flange_from_tool).inverse();
        let tool_from_own = self.own_tool_in(&last.0.stated_tool);
        let mut joints = self.stand(first, true)?.1;
        let mut place = |number: u32| {
            let share = f64::from(number) / f64::from(PLACES + 1);
            joints = match commanded {
                Course::Joints(ends, _) => between(ends, share),
                Course::Tool(..) => {
                    let pose = self.on(commanded, share)? * tool_from_own;
                    self.inverse.joints(&pose, &joints).ok()?
                }
            };
            let point = |share| Some(Point3::from(self.on(wanted, share)?.translation.vector));
            let along = Unit::try_new(point(share + STEP)? - point(share - STEP)?, NO_LENGTH_MM);
            Some(Place { joints: joints.clone(), own_from_tool, wanted: point(share)?, along })
        };
        (1..=PLACES).map(&mut place).collect()
    }

    /// The tool in the arm's base at a share of the way; `None` where its orientation may turn either way.
    pub(super) fn on(&self, course: &Course, share: f64) -> Option<Isometry3<f64>> {
        let (from, to, circle) = match course {
            Course::Joints(ends, tool) => {
                return Some(self.arm.arm.flange(&between(ends, share)).isometry() * tool);
            }
            Course::Tool([from, to], circle) => (from, to, circle),
        };
        let mut pose = from.try_lerp_slerp(to, share, 1e-9)?;
        if let Some(circle) = circle {
            let at = circle.at(&Point3::from(from.translation.vector), share);
            pose.translation = Translation3::from(at.coords);
        }
        Some(pose)
    }
}

impl Place {
    /// The distance of a point from the wanted one across the path, mm.
    fn across(&self, attained: &Vector3<f64>) -> f64 {
        let apart = attained - self.wanted.coords;
        let along = self.along.map_or_else(Vector3::zeros, |along| along.scale(along.dot(&apart)));
        (apart - along).norm()
    }
}

impl Circle {
    /// The circle from the first point through the second to the third; `None` where they are in line.
    fn through([from, by, to]: [Point3<f64>; 3]) -> Option<Self> {
        let (first, second) = (by - from, to - from);
        let normal = first.cross(&second);
        let axis = Unit::try_new(normal, NO_LENGTH_MM * first.norm().max(second.norm()))?;
        let to_centre =
            (first.norm_squared() * second - second.norm_squared() * first).cross(&normal);
        let centre = from + to_centre / (2.0 * normal.norm_squared());
        let circle = Self { centre, axis, angle: 0.0 };
        Some(Self { angle: circle.angle_between(&from, &to), ..circle })
    }

    /// From one of its points on to another, rad.
    fn angle_between(&self, from: &Point3<f64>, to: &Point3<f64>) -> f64 {
        let (start, end) = (from - self.centre, to - self.centre);
        let angle = self.axis.dot(&start.cross(&end)).atan2(start.dot(&end));
        angle.rem_euclid(std::f64::consts::TAU)
    }

    /// The orientations at its helper, turned evenly in the base and as it stands to the path.
    fn turned(
        &self,
        from: &Isometry3<f64>,
        by: &Isometry3<f64>,
        to: &Isometry3<f64>,
    ) -> Vec<UnitQuaternion<f64>> {
        let [start, helper] = [from, by].map(|own| Point3::from(own.translation.vector));
        let share = self.angle_between(&start, &helper) / self.angle;
        self.turns(&from.rotation, &to.rotation, share).into_iter().flatten().collect()
    }

    /// The orientation at a share of the way: evenly in the base, and as it stands to the path; `None` where it may turn either way.
    fn turns(
        &self,
        from: &UnitQuaternion<f64>,
        to: &UnitQuaternion<f64>,
        share: f64,
    ) -> [Option<UnitQuaternion<f64>>; 2] {
        let by = |share: f64| UnitQuaternion::from_axis_angle(&self.axis, share * self.angle);
        let to_path = by(1.0).inverse() * to;
        let with_path = from.try_slerp(&to_path, share, 1e-9);
        [from.try_slerp(to, share, 1e-9), with_path.map(|own| by(share) * own)]
    }

    /// How many circles it may be cut into.
    pub(super) fn most_parts(&self, from: &Isometry3<f64>) -> f64 {
        let radius_mm = (Point3::from(from.translation.vector) - self.centre).norm();
        (self.angle / PART_RAD).min(self.angle * radius_mm / PART_MM).floor()
    }

    /// Whether the tool turns alike in every mode: evenly in the base (`$CIRC_TYPE` #BASE), or as it stands to the path (`#PATH`, `MoveC`),
    /// where the helper says which way round.
    pub(super) fn turns_alike(&self, stops: [&UnitQuaternion<f64>; 3]) -> bool {
        let [from, helper, to] = stops;
        let is_alike = |share: f64| {
            let [even, with_path] = self.turns(from, to, share);
            let is_near = helper.angle_to(&even?) < FRAC_PI_2;
            Some(is_near && even?.angle_to(&with_path?) < ALIKE_RAD)
        };
        [0.25, 0.5, 0.75].into_iter().all(|share| is_alike(share).unwrap_or(false))
    }

    fn at(&self, from: &Point3<f64>, share: f64) -> Point3<f64> {
        self.centre
            + Rotation3::from_axis_angle(&self.axis, share * self.angle) * (from - self.centre)
    }
}

/// Joint values at a share of the way.
fn between([from, to]: &[Vec<f64>; 2], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(from, to)| from + share * (to - from)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_leads_through_its_helper_the_long_way_too() {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Point3::new(500.0 + 200.0 * cos, 200.0 * sin, 300.0)
        };
        for (by, to) in [(40.0, 90.0), (-40.0, -90.0), (180.0, 270.0)] {
            let circle = Circle::through([at(0.0), at(by), at(to)]).unwrap();
            for share in [0.25, 0.5, 1.0] {
                let found = circle.at(&at(0.0), share);
                assert!((found - at(share * to)).norm() < 1e-9, "{by} {to}: {found}");
            }
        }
        assert!(Circle::through([at(0.0), at(0.0), at(90.0)]).is_none());
    }

    #[test]
    fn a_tool_turns_alike_where_it_stays_or_follows_a_circle_of_less_than_half_a_turn() {
        let at = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Point3::new(500.0 + 200.0 * cos, 200.0 * sin, 300.0)
        };
        let about = |axis: Vector3<f64>, degrees: f64| {
            UnitQuaternion::from_scaled_axis(axis.scale(degrees.to_radians()))
        };
        let [x, z] = [Vector3::x(), Vector3::z()];
        let alike = |to: f64, helper: UnitQuaternion<f64>, end: UnitQuaternion<f64>| {
            let circle = Circle::through([at(0.0), at(to / 2.0), at(to)]).unwrap();
            circle.turns_alike([&UnitQuaternion::identity(), &helper, &end])
        };
        let same = UnitQuaternion::identity();
        assert!(alike(150.0, same, same) && alike(150.0, about(z, 75.0), about(z, 150.0)));
        assert!(!alike(200.0, same, same), "either way round");
        assert!(!alike(90.0, same, about(x, 20.0)), "the base or the path");
        assert!(!alike(90.0, about(z, 170.0), about(z, 1.0)), "the long way round");
        let circle = Circle::through([at(0.0), at(10.0), at(20.0)]).unwrap();
        let from = Isometry3::from_parts(at(0.0).coords.into(), same);
        assert!((circle.most_parts(&from) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_lies_along_the_path_does_not_count() {
        let along = Unit::try_new(Vector3::x(), 0.0);
        let place = Place {
            joints: Vec::new(),
            own_from_tool: Isometry3::identity(),
            wanted: Point3::new(1.0, 2.0, 3.0),
            along,
        };
        assert!((place.across(&Vector3::new(9.0, 2.3, 3.4)) - 0.5).abs() < 1e-12);
        let turning = Place { along: None, ..place };
        assert!((turning.across(&Vector3::new(1.0, 2.0, 3.5)) - 0.5).abs() < 1e-12);
    }
}
