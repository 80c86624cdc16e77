//! Motions: `movel(p[…], a=1.2, v=0.25, r=0.01)`, `movej(get_inverse_kin(P_p, qnear=P_q))`, `movel(pose_trans(feature, P_p))`.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::{Reading, URSCRIPT};
use crate::ask::pose;
use crate::flow::{Known, Setting, Slot, Step, known};
use crate::frame::Chain;
use crate::names::Written;
use crate::program::{Motion, Path, Reads, Shape, Split, Stated, Target, Turn, Way};
use crate::reading::{Common, Here, NOT_SPLIT, has, one, split};
use crate::refusal::Refusal;
use crate::value::{Cursor, Number, Value};

/// Why motions with a blend radius get no further points, nor those behind one: the controller passes over a position whose blend meets another.
pub(super) const BLENDED: &str = "blends with a radius would meet between further points";
const MM: f64 = 1000.0;
const DEGREES: f64 = 180.0 / PI;

/// The way of a motion to a position; [`Way::Other`] of one that is refused.
pub(super) fn way(word: &str) -> Option<Way> {
    match word {
        "MOVEJ" | "OPTIMOVEJ" => Some(Way::Joints),
        "MOVEL" | "MOVEP" | "OPTIMOVEL" => Some(Way::Straight),
        "MOVEC" => Some(Way::Circle),
        "SERVOJ" | "SERVOC" | "SERVOL" | "MOVE_THROUGH" => Some(Way::Other),
        _ => None,
    }
}

/// `p[…]` as a list behind its name; any other value as it is.
pub(super) fn value(part: Cursor<'_>) -> Value {
    let mut rest = part;
    let is_pose = rest.take_word("P") && rest.first().is_some_and(|own| own.is(b'['));
    match (is_pose, rest.value()) {
        (true, list @ Value::List(_)) => {
            Value::Fields { kind: Some("P".to_owned()), fields: vec![(String::new(), list)] }
        }
        (true, _) => Value::Expression,
        (false, _) => part.value(),
    }
}

fn six(value: &Value) -> Option<[Number; 6]> {
    let Value::List(all) = value else { return None };
    let all: Vec<Number> = all.iter().map(|own| own.number().cloned()).collect::<Option<_>>()?;
    all.try_into().ok()
}

/// The numbers of a position: of a pose those of its rotation vector are rad.
pub(super) fn shape(value: &Value) -> Option<Shape> {
    let in_unit =
        |unit: f64| move |number: Number| Number { value: number.value * unit, unit, ..number };
    match value {
        Value::List(_) => {
            Some(Shape::Joints(six(value)?.into_iter().map(in_unit(DEGREES)).collect()))
        }
        Value::Fields { fields, .. } => {
            let [x, y, z, a, b, c] = six(&fields.first()?.1)?;
            let (xyz, turn) = ([x, y, z].map(in_unit(MM)), Turn::Vector([a, b, c]));
            Some(Shape::Pose { xyz, turn, stated: None })
        }
        _ => None,
    }
}

/// A target, the feature that it stands in, and the list of joint angles near which it is reached.
struct Read<'t> {
    target: Cursor<'t>,
    feature: Option<Cursor<'t>>,
    near: Option<Cursor<'t>>,
}

/// The arguments of a call of a function, without their names; `None` where more stands there.
fn arguments<'t>(part: Cursor<'t>, function: &str) -> Option<Vec<(String, Cursor<'t>)>> {
    let mut rest = part;
    if !(rest.take_word(function) && rest.take_sign(b'(')) {
        return None;
    }
    let inside = rest.take_part(b')')?;
    rest.is_empty().then(|| named(inside))
}

/// Arguments with their names, which are empty for those without one.
pub(super) fn named(mut inside: Cursor<'_>) -> Vec<(String, Cursor<'_>)> {
    let mut all = Vec::new();
    while let Some(part) = inside.take_part(b',') {
        let mut rest = part;
        let name = rest.take_name().filter(|_| rest.take_sign(b'='));
        all.push(name.map_or((String::new(), part), |name| (name, rest)));
    }
    all
}

/// An argument by its name, or by its place where it has none.
fn argument<'t>(all: &[(String, Cursor<'t>)], names: &str, place: usize) -> Option<Cursor<'t>> {
    let own = all.iter().find(|(own, _)| has(names, own));
    let own = own.or_else(|| all.get(place).filter(|(own, _)| own.is_empty()))?;
    Some(own.1)
}

/// Whether an argument, by its name or its place, is other than 0.
fn is_given(all: &[(String, Cursor<'_>)], name: &str, place: usize) -> bool {
    argument(all, name, place)
        .is_some_and(|mut own| own.take_number().is_none_or(|own| own.value != 0.0))
}

/// Motions that begin where one before is blended get no further points.
pub(super) fn keep_behind_blends(common: &mut Common<'_>) {
    let (files, paths) = (common.files, &mut common.found.paths);
    let of_scripts = |path: &&mut Path| files[path.file].is_of(&URSCRIPT);
    let blended = paths.iter().filter(|path| path.is_blended);
    let ends: BTreeSet<usize> =
        blended.filter_map(|path| path.through.as_ref()?.last().copied()).collect();
    for path in paths.iter_mut().filter(of_scripts) {
        if path.split.is_ok() && path.from.is_some_and(|from| ends.contains(&from)) {
            path.split = Err(BLENDED);
        }
    }
}

fn is_blended(word: &str, all: &[(String, Cursor<'_>)]) -> bool {
    is_given(all, "R", if word == "MOVEP" { 3 } else { 4 })
}

/// Where further points may be written before a motion.
fn place(
    word: &str,
    whole: Cursor<'_>,
    all: &[(String, Cursor<'_>)],
    reads: &[Option<Read<'_>>],
) -> Result<Split, &'static str> {
    if !matches!(word, "MOVEL" | "MOVEC") {
        return Err(NOT_SPLIT);
    }
    if is_blended(word, all) {
        return Err(BLENDED);
    }
    if word == "MOVEL" && is_given(all, "T", 3) {
        return Err("its time is for the whole of it");
    }
    let own = reads.iter().map(|read| read.as_ref().filter(|read| read.near.is_none()));
    let own = own.map(|read| read.map(|read| read.target));
    let targets: Vec<Cursor<'_>> =
        own.collect::<Option<_>>().ok_or("it states joint angles near it")?;
    let rest = whole.tokens.get(1..).unwrap_or_default();
    split(word, Cursor { tokens: rest, ..whole }, &targets)
}

/// What the pose of a motion stands in.
#[derive(PartialEq)]
enum Frame {
    /// The controller's base, or a feature that is always the same.
    Of(Known),
    /// The one feature that the walk follows.
    Followed,
}

impl<'t> Read<'t> {
    fn of(part: Cursor<'t>) -> Option<Self> {
        let Some(own) = arguments(part, "GET_INVERSE_KIN") else { return Self::pose(part) };
        let target = Self::pose(argument(&own, "X", 0)?)?;
        match own.len() {
            1 => Some(target),
            2 => Some(Self { near: Some(argument(&own, "QNEAR", 1)?), ..target }),
            _ => None,
        }
    }

    fn pose(part: Cursor<'t>) -> Option<Self> {
        let Some(own) = arguments(part, "POSE_TRANS") else {
            return Some(Self { target: part, feature: None, near: None });
        };
        let feature = argument(&own, "P_FROM", 0)?;
        let target = argument(&own, "P_FROM_TO", 1).filter(|_| own.len() == 2)?;
        Some(Self { target, feature: Some(feature), near: None })
    }
}

impl Reading<'_> {
    pub(super) fn motion(
        &mut self,
        here: &Here<'_>,
        word: &str,
        [whole, inside]: [Cursor<'_>; 2],
        steps: &mut Vec<Step>,
    ) {
        let way = way(word).unwrap_or(Way::Other);
        let all = named(inside);
        let places: &[&str] =
            if way == Way::Circle { &["POSE_VIA", "POSE_TO"] } else { &["Q POSE POSE_TO"] };
        let parts = places.iter().zip(0..).filter_map(|(own, place)| argument(&all, own, place));
        let parts: Vec<Cursor<'_>> = parts.collect();
        let (mut targets, mut features, mut states) = (Vec::new(), Vec::new(), false);
        let reads: Vec<_> = parts.iter().map(|part| Read::of(*part)).collect();
        for (part, read) in parts.iter().zip(&reads) {
            let (target, feature, is_near) = self.target(here, word, *part, read.as_ref());
            // By joints the arm may be led into any arm configuration, but for a pose into the nearest.
            let is_led =
                matches!(word, "MOVEJ" | "OPTIMOVEJ" | "SERVOJ") && !self.is_pose(&target, *part);
            states =
                is_near || is_led || self.is_all(&target, |own| matches!(own, Shape::Joints(_)));
            features.push(feature);
            targets.push(target);
        }
        let differs = features.windows(2).any(|own| own[0] != own[1]);
        let keeps_to_path = way == Way::Circle && is_given(&all, "MODE", 5);
        let obstacle = if way == Way::Other || keeps_to_path {
            let mode = if keeps_to_path { " with mode 1" } else { "" };
            let (word, at) = (word.to_ascii_lowercase() + mode, self.common.at(here));
            Some(Refusal::Instruction { word, at })
        } else {
            let words = "the positions of its motion stand in two features; give them one";
            differs.then(|| Refusal::Other(words.to_owned()))
        };
        let own = features.pop().and_then(|frame| match frame {
            Frame::Of(frame) => Some((Slot::Base, frame)),
            Frame::Followed => None,
        });
        steps.push(self.common.moves(Motion {
            file: here.file,
            line: here.line,
            word: word.to_ascii_lowercase(),
            targets,
            own: own.into_iter().collect(),
            is_held: false,
            reads: if states { Reads::Always } else { Reads::Never },
            way,
            is_blended: is_blended(word, &all),
            split: place(word, whole, &all, &reads),
            obstacle: obstacle.map(Arc::new),
            holds_part: false,
        }));
    }

    /// Whether a target is a pose, be it worked out.
    fn is_pose(&self, target: &Target, part: Cursor<'_>) -> bool {
        let is = |word: &str| part.peek_name().is_some_and(|own| has(word, &own));
        let is_solved = || arguments(part, "GET_INVERSE_KIN").is_some_and(|own| own.len() == 1);
        let is_written = || is("P") && part.tokens.get(1).is_some_and(|own| own.is(b'['));
        match target {
            Target::Literal { .. } => self.is_all(target, |own| matches!(own, Shape::Pose { .. })),
            Target::Computed(_) => {
                is("INTERPOLATE_POSE POSE_ADD POSE_TRANS") || is_solved() || is_written()
            }
        }
    }

    /// Whether the shapes of a target's positions are all of a kind.
    fn is_all(&self, target: &Target, is: impl Fn(&Shape) -> bool) -> bool {
        let Target::Literal { positions, .. } = target else { return false };
        let mut shapes = positions.iter().map(|own| &self.common.found.positions[*own].shape);
        shapes.all(|shape| shape.as_ref().is_ok_and(&is))
    }

    fn target(
        &mut self,
        here: &Here<'_>,
        word: &str,
        part: Cursor<'_>,
        read: Option<&Read<'_>>,
    ) -> (Target, Frame, bool) {
        let is_near = read.is_some_and(|read| read.near.is_some());
        let feature = read.and_then(|read| read.feature);
        let base = || Frame::Of(known(Setting::Frames(Chain::default())));
        let frame = feature.map_or_else(|| Some(base()), |own| self.feature(here, own));
        let found = match (read, &frame) {
            (None, _) | (_, None) => None,
            (Some(read), _) => self.literal(here, word, read),
        };
        if let Some(feature) = feature {
            // A position that another stands in moves that one too.
            self.common.reads(here, feature);
        }
        (self.common.target(here, part, found), frame.unwrap_or_else(base), is_near)
    }

    /// What `pose_trans` has a pose in; `None` where it is worked out.
    fn feature(&self, here: &Here<'_>, part: Cursor<'_>) -> Option<Frame> {
        let is_followed = match (value(part), &self.feature) {
            (Value::Name(name), Some(own)) => {
                let variable = self.common.names.find(here.scopes, &name);
                *own == name && !variable.is_some_and(|own| own.is_parameter)
            }
            _ => false,
        };
        if is_followed {
            return Some(Frame::Followed);
        }
        self.frame(here, part, "pose_trans").map(Frame::Of)
    }

    fn literal(&mut self, here: &Here<'_>, word: &str, read: &Read<'_>) -> Option<Target> {
        let near = match read.near.map(|near| self.constant(here, near).and_then(|own| shape(&own)))
        {
            Some(Some(Shape::Joints(near))) => Some(near.iter().map(|own| own.value).collect()),
            // From a place that nothing here knows the controller may reach another arm configuration.
            Some(_) => return None,
            None => None::<Vec<f64>>,
        };
        let target = match value(read.target) {
            // Elements of a list are not followed.
            Value::Name(name) if !name.contains('[') => self.common.declared(here, &name)?,
            own @ (Value::List(_) | Value::Fields { .. }) => {
                let span = read.target.span();
                let written = Written { file: here.file, line: here.line, value: own, span };
                one(self.common.add(here, &word.to_ascii_lowercase(), &written, ""))
            }
            _ => return None,
        };
        if let (Some(near), Target::Literal { positions, .. }) = (near, &target) {
            for position in positions {
                let shape = &mut self.common.found.positions[*position].shape;
                if let Ok(Shape::Pose { stated, .. }) = shape {
                    *stated = Some(Stated::Near(near.clone()));
                }
            }
        }
        Some(target)
    }

    /// The value of a constant, or as it is written out.
    fn constant(&self, here: &Here<'_>, part: Cursor<'_>) -> Option<Value> {
        match value(part) {
            Value::Name(name) => Some(self.common.constant(here.scopes, &name).ok()?.value.clone()),
            own => Some(own),
        }
    }

    /// A feature or a tool by its constant; `None` where it is worked out.
    pub(super) fn frame(&self, here: &Here<'_>, part: Cursor<'_>, or: &str) -> Option<Known> {
        let name = match value(part) {
            Value::Name(name) => name,
            _ => or.to_owned(),
        };
        let Some(Shape::Pose { xyz, turn, .. }) = shape(&self.constant(here, part)?) else {
            return None;
        };
        let value = pose(&xyz, &turn);
        Some(known(Setting::Frames(Chain::one(name, value))))
    }
}

/// A rotation vector, rad: of all that make a rotation, the one nearest to another.
pub(crate) fn vector_near(to: &UnitQuaternion<f64>, near: [f64; 3]) -> [f64; 3] {
    let (own, near) = (to.scaled_axis(), Vector3::from(near));
    // Without a turn any axis makes none: whole turns about the other's.
    let axis = own.try_normalize(1e-9).or_else(|| near.try_normalize(1e-9));
    let turns = axis.map_or(0.0, |axis| ((near - own).dot(&axis) / (2.0 * PI)).round());
    let nearest = own + axis.unwrap_or_default() * (2.0 * PI * turns);
    nearest.into()
}
