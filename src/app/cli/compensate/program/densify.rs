//! Straight motions and circles that leave their wanted path by too much → further points before their ends, corrected like any other.
//!
//! The way is cut into equal shares; what is left goes with the square of their length, so their number follows from the first look, and is
//! doubled where that was not enough. Points hold the motion's base and tool, and its arm configuration. A share of a circle is a circle
//! with a helper in its middle; the motion itself becomes the last, and its own helper moves there.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::path::{Course, NotStated, Stop};
use super::solve::Solver;
use crate::programs::write::Command;
use crate::programs::{Added, Asked, Branch, Further, Path, Programs, Wanted, Way};

/// Shares that a way is cut into at most.
const MOST: f64 = 128.0;

/// Positions of a program and what became of them.
pub(super) struct Known<'p> {
    pub(super) programs: &'p Programs,
    pub(super) asked: &'p [Result<Asked, String>],
    pub(super) commands: &'p [Option<Command>],
}

/// A motion that leaves its path by more than was asked.
pub(super) struct Densified {
    /// Its index among the motions.
    pub(super) path: usize,
    /// Its further points; otherwise why there are none.
    pub(super) points: Result<Points, String>,
}

pub(super) struct Points {
    /// How many there are, without helpers of circles.
    pub(super) count: usize,
    /// The largest distance from the wanted path with them, mm.
    pub(super) deviation_mm: f64,
    pub(super) added: Added,
    /// Of a circle its helper among the positions, and the command that it moves to.
    pub(super) helper: Option<(usize, Command)>,
}

/// A way in equal shares.
struct Cut {
    /// The largest distance from the wanted path, mm.
    left_mm: f64,
    /// The points between its ends; of a circle a helper before each.
    further: Vec<Further>,
    /// Of a circle the helper of the last share.
    helper: Option<Command>,
}

impl Solver<'_> {
    /// The motions that leave their path by more than a limit, each with its further points.
    pub(super) fn further(
        &self,
        limit_mm: f64,
        known: &Known<'_>,
        deviations: &[Result<f64, NotStated>],
    ) -> Vec<Densified> {
        let beyond = deviations.par_iter().enumerate().filter_map(|(path, own)| {
            let deviation_mm = (*own).ok().filter(|deviation_mm| *deviation_mm > limit_mm)?;
            Some(Densified { path, points: self.split(limit_mm, known, path, deviation_mm) })
        });
        beyond.collect()
    }

    fn split(
        &self,
        limit_mm: f64,
        known: &Known<'_>,
        path: usize,
        deviation_mm: f64,
    ) -> Result<Points, String> {
        let path = &known.programs.paths[path];
        known.programs.may_split(path)?;
        let stop = |place: usize| {
            Some((known.asked[place].as_ref().ok()?, known.commands[place].as_ref()?))
        };
        let through = path.through.iter().flatten();
        let stops = path.from.iter().chain(through).map(|place| stop(*place));
        let stops =
            stops.collect::<Option<Vec<_>>>().ok_or("one of its positions is not corrected")?;
        let course = self.course(path.way, &stops, false).ok_or("its way is not known")?;
        let most = most_shares(&course, &stops)?;
        let mut shares = (deviation_mm / limit_mm).sqrt().ceil().clamp(2.0, most);
        loop {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "2 to MOST"
            )]
            let cut = self.cut(&course, path.way, &stops, shares as u32)?;
            if cut.left_mm <= limit_mm || shares >= most {
                let added = known.programs.added(path, &cut.further);
                let helper = path.through.iter().flatten().copied().next().zip(cut.helper);
                return Ok(Points {
                    count: cut.further.len() / (stops.len() - 1),
                    deviation_mm: cut.left_mm,
                    added: added.ok_or("its text is not understood")?,
                    helper,
                });
            }
            shares = (shares * 2.0).min(most);
        }
    }

    /// The points that cut a motion into equal shares, and what is left between them.
    fn cut(
        &self,
        course: &Course,
        way: Way,
        stops: &[Stop<'_>],
        shares: u32,
    ) -> Result<Cut, String> {
        let (first, last) = stops.first().zip(stops.last()).ok_or("its way is not known")?;
        let each: u8 = if way == Way::Circle { 2 } else { 1 };
        let count = shares * u32::from(each);
        let asked = (1..count).map(|number| self.between(course, [first, last], number, count));
        let asked: Vec<Asked> = asked.collect::<Option<_>>().ok_or("its way is not known")?;
        let solved = self.solve(&asked.iter().collect::<Vec<_>>());
        let mut commands = vec![Some(first.1.clone())];
        for own in solved {
            commands.push(Some(own?.command));
        }
        commands.push(Some(last.1.clone()));
        let mut further = self.numbers(first.1, &asked, &mut commands)?;
        let helper = further.pop_if(|_| way == Way::Circle).and_then(|own| {
            let before = stops[1].1.joints.as_ref()?[0].clone();
            let base_from_tool = commands[commands.len() - 2].as_ref()?.base_from_tool;
            Some(Command { base_from_tool, joints: Some([before, own.joints]) })
        });
        let mut all = vec![Ok(first.0.clone())];
        all.extend(asked.into_iter().map(Ok));
        all.push(Ok(last.0.clone()));
        let each = usize::from(each);
        let paths = (0..all.len() - 1).step_by(each).map(|from| step(way, from, each));
        let mut left = self.deviations(&paths.collect::<Vec<_>>(), &all, &commands).into_iter();
        let left_mm = left.try_fold(0.0_f64, |largest, own| Ok::<_, NotStated>(largest.max(own?)));
        Ok(Cut { left_mm: left_mm?, further, helper })
    }

    fn between(
        &self,
        course: &Course,
        [from, to]: [&Stop<'_>; 2],
        number: u32,
        shares: u32,
    ) -> Option<Asked> {
        let Wanted::Pose { base_from_frame, .. } = to.0.wanted else { return None };
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

/// How many shares a way may be cut into.
fn most_shares(course: &Course, stops: &[Stop<'_>]) -> Result<f64, NotStated> {
    let Course::Tool([from, to], Some(circle)) = course else { return Ok(MOST) };
    let Wanted::Pose { base_from_tool: helper, .. } = &stops[1].0.wanted else {
        return Err("its helper point is in joint angles");
    };
    if !circle.turns_alike([from, helper, to].map(|own| &own.rotation)) {
        return Err("its mode says how the tool turns along it ($CIRC_TYPE, CirPathMode)");
    }
    let most = circle.most_parts(from).min(MOST);
    if most < 2.0 { Err("its parts would be too short for circles") } else { Ok(most) }
}

/// The way from a point over those behind it.
fn step(way: Way, from: usize, points: usize) -> Path {
    Path {
        file: 0,
        line: 0,
        word: String::new(),
        way,
        is_blended: false,
        from: Some(from),
        through: Some((from + 1..=from + points).collect()),
        split: Err("it is one already"),
    }
}
