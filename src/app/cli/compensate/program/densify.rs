//! Straight motions that leave their wanted path by too much → further points before their ends, corrected like any other.
//!
//! The way is cut into equal shares; what is left goes with the square of their length, so their number follows from the first look, and is
//! doubled where that was not enough. Points hold the motion's base and tool, and its arm configuration.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::path::{Course, NotStated, Stop};
use super::solve::Solver;
use crate::programs::write::{Command, Edit};
use crate::programs::{Asked, Branch, Further, Path, Programs, Wanted, Way};

/// Shares that a way is cut into at most.
const MOST: u32 = 128;

/// Positions of a program and what became of them.
pub(super) struct Corrections<'p> {
    pub(super) programs: &'p Programs,
    pub(super) asked: &'p [Result<Asked, String>],
    pub(super) commands: &'p [Option<Command>],
}

/// A motion with further points.
pub(super) struct Densified {
    /// Its index among the motions.
    pub(super) path: usize,
    /// How many points, and the largest distance from the wanted path with them, mm; otherwise why there are none.
    pub(super) points: Result<(usize, f64), String>,
    pub(super) lines: Option<Edit>,
}

impl Solver<'_> {
    /// The motions that leave their path by more than a limit, each with its further points.
    pub(super) fn further(
        &self,
        limit_mm: f64,
        known: &Corrections<'_>,
        deviations: &[Result<f64, NotStated>],
    ) -> Vec<Densified> {
        let beyond = deviations.par_iter().enumerate().filter_map(|(path, own)| {
            let deviation_mm = (*own).ok().filter(|deviation_mm| *deviation_mm > limit_mm)?;
            let found = self.split(limit_mm, known, path, deviation_mm);
            let (points, lines) = match found {
                Ok((count, deviation_mm, lines)) => (Ok((count, deviation_mm)), Some(lines)),
                Err(why) => (Err(why), None),
            };
            Some(Densified { path, points, lines })
        });
        beyond.collect()
    }

    fn split(
        &self,
        limit_mm: f64,
        known: &Corrections<'_>,
        path: usize,
        deviation_mm: f64,
    ) -> Result<(usize, f64, Edit), String> {
        let path = &known.programs.paths[path];
        known.programs.may_split(path)?;
        let stop = |place: usize| {
            Some((known.asked[place].as_ref().ok()?, known.commands[place].as_ref()?))
        };
        let ends = path.from.zip(path.through.as_ref().and_then(|own| own.last().copied()));
        let stops = ends.and_then(|(from, to)| Some([stop(from)?, stop(to)?]));
        let stops = stops.ok_or("one of its positions is not corrected")?;
        let mut shares = (deviation_mm / limit_mm).sqrt().ceil().clamp(2.0, f64::from(MOST));
        loop {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "2 to MOST"
            )]
            let (left_mm, further) = self.cut(&stops, shares as u32)?;
            if left_mm <= limit_mm || shares * 2.0 > f64::from(MOST) {
                let lines = known.programs.added(path, &further);
                let lines = lines.ok_or("its text is not understood")?;
                return Ok((further.len(), left_mm, lines));
            }
            shares *= 2.0;
        }
    }

    /// The points between the ends of a straight motion that cut it into equal shares, and what is left between them, mm.
    fn cut(&self, stops: &[Stop<'_>; 2], shares: u32) -> Result<(f64, Vec<Further>), String> {
        let course = self.course(Way::Straight, stops, false).ok_or("its way is not known")?;
        let asked = (1..shares).map(|number| self.between(&course, stops, number, shares));
        let asked: Vec<Asked> = asked.collect::<Option<_>>().ok_or("its way is not known")?;
        let solved = self.solve(&asked.iter().collect::<Vec<_>>());
        let mut commands = vec![Some(stops[0].1.clone())];
        for own in solved {
            commands.push(Some(own?.command));
        }
        commands.push(Some(stops[1].1.clone()));
        let further = self.numbers(stops[0].1, &asked, &mut commands)?;
        let mut all = vec![Ok(stops[0].0.clone())];
        all.extend(asked.into_iter().map(Ok));
        all.push(Ok(stops[1].0.clone()));
        let paths: Vec<Path> = (1..all.len()).map(step).collect();
        let mut left = self.deviations(&paths, &all, &commands).into_iter();
        let left_mm = left.try_fold(0.0_f64, |largest, own| Ok::<_, NotStated>(largest.max(own?)));
        Ok((left_mm?, further))
    }

    fn between(
        &self,
        course: &Course,
        [from, to]: &[Stop<'_>; 2],
        number: u32,
        shares: u32,
    ) -> Option<Asked> {
        let Wanted::Pose { base_from_frame, .. } = to.0.wanted else {
            return None;
        };
        let pose = self.on(course, f64::from(number) / f64::from(shares))?;
        let branches = vec![Branch::Joints(from.1.joints.as_ref()?[0].clone())];
        let wanted =
            Wanted::Pose { base_from_frame, programmed: pose, base_from_tool: pose, branches };
        Some(Asked { wanted, ..to.0.clone() })
    }

    /// The numbers of further points, their joints on the turns on which the motion comes to them.
    fn numbers(
        &self,
        from: &Command,
        asked: &[Asked],
        commands: &mut [Option<Command>],
    ) -> Result<Vec<Further>, String> {
        let [_, joints] = from.joints.as_ref().ok_or("it has no joint angles")?;
        let mut joints = self.joints(joints)?.angles;
        let mut further = Vec::new();
        for (asked, command) in asked.iter().zip(&mut commands[1..]) {
            let to = command.as_ref().and_then(|own| own.base_from_tool);
            let (Some(to), Wanted::Pose { base_from_frame, .. }) = (to, &asked.wanted) else {
                return Err("a point has no command".to_owned());
            };
            let pose: Isometry3<f64> = to * self.own_tool_in(&asked.stated_tool);
            joints = self.inverse.joints(&pose, &joints).map_err(|why| why.to_string())?;
            let shown = self.shown(&joints);
            *command = Some(Command {
                base_from_tool: Some(to),
                joints: Some([shown.clone(), shown.clone()]),
            });
            further
                .push(Further { frame_from_tool: base_from_frame.inverse() * to, joints: shown });
        }
        Ok(further)
    }
}

/// The straight way from the point before to a point.
fn step(to: usize) -> Path {
    Path {
        file: 0,
        line: 0,
        word: String::new(),
        way: Way::Straight,
        is_blended: false,
        from: Some(to - 1),
        through: Some(vec![to]),
        split: Err("it is one already"),
    }
}
