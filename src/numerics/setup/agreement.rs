//! How far the logs and a set-up disagree, relation by relation, as median distances.
//!
//! Medians are used because a wrong reflector or a lost beam is not a wrong set-up. What the set-up leaves open is found first:
//! base and target beside the readings, the tool beside the commands where none is stated.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::evidence::{Evidence, point};
use super::set_up::SetUp;
use crate::figures::median;
use crate::geometry::align;
use crate::join::placement::{Placement, ReadingAtFlange};

/// Two statements of one thing that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// Readings against the nominal arm at the reported angles, base and target found from the same readings.
    Arm,
    /// Readings against the nominal arm with the target where the pipeline file states it: the base alone is found.
    Target,
    /// The stated tool against the stated target, where they are meant to be one point.
    OnePoint,
    /// Readings against the nominal arm in the surveyed base.
    Survey,
    /// Commanded positions against the nominal arm at the reported angles.
    Commands,
    /// Commanded orientations against the nominal arm at the reported angles, rad.
    Turns,
    /// Measured orientations against the nominal arm in the fitted base, the target's found from the same readings, rad.
    Orientations,
}

impl Relation {
    pub const ALL: [Self; 7] = [
        Self::Arm,
        Self::Target,
        Self::OnePoint,
        Self::Survey,
        Self::Commands,
        Self::Turns,
        Self::Orientations,
    ];

    /// A disagreement that says nothing yet. Millimetres, for orientations radians: nominal arms leave about a millimetre where
    /// base and target are fitted; in a surveyed base their angles' errors count over the whole reach; and no controller turns
    /// its tool more exactly than its tool is stated. Cameras measure turns to a degree or two.
    pub(super) const fn usual(self) -> f64 {
        match self {
            Self::Turns => 0.02,
            Self::Orientations => 0.05,
            Self::Survey => 6.0,
            Self::Arm | Self::Target | Self::OnePoint | Self::Commands => 1.0,
        }
    }

    /// What a mistake may leave that is named, mm or rad: sound arms leave 2.5 to 7 mm.
    pub(super) const fn most_left(self) -> f64 {
        match self {
            Self::Turns | Self::Orientations => 0.2,
            Self::Survey => 18.0,
            Self::Arm | Self::Target | Self::OnePoint | Self::Commands => 10.0,
        }
    }

    /// Whether base and target are found from the readings, or the base is surveyed: it grows with them.
    const fn is_of_readings(self) -> bool {
        matches!(self, Self::Arm | Self::Target | Self::Survey)
    }

    /// Whether it is of orientations, rad.
    pub(super) const fn is_of_turns(self) -> bool {
        matches!(self, Self::Turns | Self::Orientations)
    }

    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Arm => "readings and nominal arm (base and target fitted)",
            Self::Target => "readings and nominal arm with the target as stated (base fitted)",
            Self::OnePoint => "stated tool and stated target, which are meant to be one point",
            Self::Survey => "readings and nominal arm in the surveyed base",
            Self::Commands => "commanded and reported position",
            Self::Turns => "commanded and reported orientation",
            Self::Orientations => "measured orientation and nominal arm (base and target fitted)",
        }
    }
}

/// The median disagreement of each relation, in the order of [`Relation::ALL`]: mm, for orientations rad; `None` where the
/// set-up or the logs state too little. With them the spread of the readings, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement([Option<f64>; 7], f64);

impl Agreement {
    /// The disagreement of `set_up` with the logs.
    pub fn of(set_up: &SetUp, evidence: &Evidence) -> Self {
        Self::by(&Seen::of(set_up, evidence), set_up, evidence)
    }

    /// The disagreement of the set-up that is stated, whose target may sit far from the flange. Mistakes are not looked for with such
    /// a target: it would make many of them agree better than they are.
    pub(super) fn of_stated(stated: &SetUp, evidence: &Evidence) -> Self {
        Self::by(&Seen::placed_by(Placement::fit_far, stated, evidence), stated, evidence)
    }

    pub(super) fn by(seen: &Seen, set_up: &SetUp, evidence: &Evidence) -> Self {
        let of = |relation| match relation {
            Relation::Arm => Some(seen.arm()),
            Relation::Target => set_up.stated_target().map(|target| seen.target(&target)),
            Relation::OnePoint => set_up.one_point().map(|[tool, target]| (tool - target).norm()),
            Relation::Survey => set_up.tracker_from_base.map(|base| seen.survey(set_up, &base)),
            Relation::Commands => seen.commands(set_up, evidence),
            Relation::Turns => seen.turns(set_up, evidence),
            Relation::Orientations => seen.orientations(set_up, evidence),
        };
        Self(Relation::ALL.map(of), spread(&seen.measured))
    }

    /// Whether a disagreement is a share of what it was against the spread of the readings too: units that make everything small leave as
    /// little of readings that belong to other stations.
    pub(super) fn is_less(&self, relation: Relation, stated: &Self, share: f64) -> bool {
        let [own, was] = [self, stated].map(|of| of.get(relation).unwrap_or(f64::INFINITY));
        own <= share * was && (!relation.is_of_readings() || own * stated.1 <= share * was * self.1)
    }

    pub fn get(&self, relation: Relation) -> Option<f64> {
        self.0[relation as usize]
    }

    pub fn iter(&self) -> impl Iterator<Item = (Relation, f64)> + '_ {
        let stated = Relation::ALL.into_iter().zip(self.0);
        stated.filter_map(|(relation, disagreement)| Some((relation, disagreement?)))
    }

    /// The relation that disagrees most for its kind, with its disagreement.
    pub fn worst(&self) -> (Relation, f64) {
        let beyond = |own: &(Relation, f64)| self.beyond(own.0, own.1);
        let largest = self.iter().max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
        largest.unwrap_or((Relation::Arm, f64::INFINITY))
    }

    /// The relation that disagrees most for its kind, of those that `other` states too, with its disagreement.
    pub(super) fn worst_beside(&self, other: &Self) -> (Relation, f64) {
        let stated = |relation: Relation| other.get(relation).and(self.get(relation));
        Self(Relation::ALL.map(stated), self.1).worst()
    }

    /// One number to compare set-ups by: Σ ln(1 + (s/usual)²), the negative log-likelihood of medians under Cauchy's
    /// distribution, whose heavy tails let one relation be mended without the others.
    pub(super) fn cost(&self) -> f64 {
        let cost =
            |(relation, s): (Relation, f64)| self.beyond(relation, s).powi(2).min(1e30).ln_1p();
        self.iter().map(cost).sum()
    }

    /// A disagreement in units of what is usual.
    pub(super) fn beyond(&self, relation: Relation, disagreement: f64) -> f64 {
        self.weight(relation) * disagreement / relation.usual()
    }

    /// How many times a disagreement counts: more than once where readings hardly spread, for metres that are read as mm agree with any arm.
    pub(super) fn weight(&self, relation: Relation) -> f64 {
        if relation.is_of_readings() { (LEAST_SPREAD_MM / self.1).max(1.0) } else { 1.0 }
    }
}

/// The nominal arm at the reported angles of each station, and the readings.
pub(super) struct Seen {
    pub(super) flanges: Vec<Isometry3<f64>>,
    pub(super) measured: Vec<Vector3<f64>>,
    pub(super) placement: Option<Placement>,
}

impl Seen {
    pub(super) fn of(set_up: &SetUp, evidence: &Evidence) -> Self {
        Self::placed_by(Placement::fit, set_up, evidence)
    }

    /// With base and target found by `fit`.
    fn placed_by(
        fit: fn(&[ReadingAtFlange]) -> Option<Placement>,
        set_up: &SetUp,
        evidence: &Evidence,
    ) -> Self {
        let unplaced = Self::unplaced(set_up, evidence);
        Self { placement: fit(&readings(&unplaced.flanges, &unplaced.measured)), ..unplaced }
    }

    /// Without base and target found.
    pub(super) fn unplaced(set_up: &SetUp, evidence: &Evidence) -> Self {
        let measured = evidence.of_row(set_up.rows[1]).into_iter();
        Self {
            flanges: set_up.flanges(evidence),
            measured: measured.map(|own| set_up.reading_map * own.measured).collect(),
            placement: None,
        }
    }

    fn arm(&self) -> f64 {
        let Some(placement) = &self.placement else { return f64::INFINITY };
        let readings = readings(&self.flanges, &self.measured);
        let distances: Vec<f64> = readings.iter().map(|r| placement.distance_mm(r)).collect();
        let predicted: Vec<Vector3<f64>> =
            self.flanges.iter().map(|flange| placement.predict(flange)).collect();
        let spreads = [spread(&predicted), spread(&self.measured)];
        let (least, most) = (spreads[0].min(spreads[1]), spreads[0].max(spreads[1]));
        // Points that hardly move agree with anything: then the disagreement is the motion that one side lacks.
        if most > SPREAD_RATIO * least {
            return most;
        }
        median(&distances).unwrap_or(f64::INFINITY)
    }

    fn target(&self, target: &Vector3<f64>) -> f64 {
        let points = self.at_flange(target);
        let measured: Vec<Point3<f64>> = self.measured.iter().map(point).collect();
        let base = robust_align(&measured, &points);
        base.map_or(f64::INFINITY, |base| median_apart(&measured, &points, &base))
    }

    fn survey(&self, set_up: &SetUp, base: &Isometry3<f64>) -> f64 {
        let target = set_up.stated_target().or_else(|| self.target_in(base));
        let Some(target) = target else { return f64::INFINITY };
        let measured: Vec<Point3<f64>> = self.measured.iter().map(point).collect();
        median_apart(&measured, &self.at_flange(&target), base)
    }

    fn commands(&self, set_up: &SetUp, evidence: &Evidence) -> Option<f64> {
        let commanded = self.commanded(set_up, evidence);
        let tool = set_up.flange_from_tool.map(|tool| tool.translation.vector);
        let tool = tool.or_else(|| in_flange(&commanded))?;
        let apart =
            |(flange, at): &(Isometry3<f64>, Point3<f64>)| (flange * point(&tool) - at).norm();
        median(&commanded.iter().map(apart).collect::<Vec<_>>())
    }

    fn turns(&self, set_up: &SetUp, evidence: &Evidence) -> Option<f64> {
        let tool = set_up.flange_from_tool?.rotation;
        let turn = |(place, command): (usize, &crate::join::Command)| {
            let commanded = set_up.commanded_turn(command)?;
            Some((self.flanges[place].rotation * tool).angle_to(&commanded))
        };
        median(&evidence.commands(set_up.rows[3]).filter_map(turn).collect::<Vec<_>>())
    }

    /// `None` of reflected readings too, which state no orientation.
    fn orientations(&self, set_up: &SetUp, evidence: &Evidence) -> Option<f64> {
        let base = self.placement?.tracker_from_base.rotation;
        let measured = evidence.of_row(set_up.rows[2]).into_iter().zip(&self.flanges);
        let targets = measured.filter_map(|(own, flange)| {
            let measured = set_up.reading_turns.of(&own.orientation?);
            Some(flange.rotation.inverse() * base.inverse() * measured)
        });
        let targets: Vec<UnitQuaternion<f64>> = targets.collect();
        let target = middle(&targets).filter(|_| set_up.reading_map.determinant() > 0.0)?;
        median(&targets.iter().map(|own| own.angle_to(&target)).collect::<Vec<_>>())
    }

    /// The tool's orientation at the flange as the commands have it; `None` where they have none.
    pub(super) fn tool_turn(
        &self,
        set_up: &SetUp,
        evidence: &Evidence,
    ) -> Option<UnitQuaternion<f64>> {
        let tool = |(place, command): (usize, &crate::join::Command)| {
            Some(self.flanges[place].rotation.inverse() * set_up.commanded_turn(command)?)
        };
        middle(&evidence.commands(set_up.rows[3]).filter_map(tool).collect::<Vec<_>>())
    }

    /// Flange and commanded position in the base frame of each station with a command.
    pub(super) fn commanded(
        &self,
        set_up: &SetUp,
        evidence: &Evidence,
    ) -> Vec<(Isometry3<f64>, Point3<f64>)> {
        let placed = |(place, command): (usize, &crate::join::Command)| {
            let position = Point3::from(command.position.coords * set_up.command_scale);
            (self.flanges[place], set_up.base_from_command * position)
        };
        evidence.commands(set_up.rows[3]).map(placed).collect()
    }

    /// The target at each flange, in the base frame.
    pub(super) fn at_flange(&self, target: &Vector3<f64>) -> Vec<Point3<f64>> {
        self.flanges.iter().map(|flange| flange * point(target)).collect()
    }

    /// The target in the flange frame, seen from a given base.
    fn target_in(&self, base: &Isometry3<f64>) -> Option<Vector3<f64>> {
        let seen = self.flanges.iter().zip(&self.measured);
        let seen: Vec<(Isometry3<f64>, Point3<f64>)> =
            seen.map(|(flange, at)| (*flange, base.inverse_transform_point(&point(at)))).collect();
        in_flange(&seen)
    }
}

fn readings(flanges: &[Isometry3<f64>], measured: &[Vector3<f64>]) -> Vec<ReadingAtFlange> {
    let pairs = flanges.iter().zip(measured);
    pairs.map(|(&flange, &attained)| ReadingAtFlange { flange, attained }).collect()
}

/// Predicted and measured positions whose spreads differ by more than this factor are not of the same moves.
const SPREAD_RATIO: f64 = 5.0;
/// Readings of a session spread by at least this, mm.
const LEAST_SPREAD_MM: f64 = 100.0;

/// Median distance from the median position, mm; 0 of nothing.
fn spread(points: &[Vector3<f64>]) -> f64 {
    let axis =
        |axis: usize| median(&points.iter().map(|p| p[axis]).collect::<Vec<_>>()).unwrap_or(0.0);
    let middle = Vector3::new(axis(0), axis(1), axis(2));
    let distances: Vec<f64> = points.iter().map(|p| (p - middle).norm()).collect();
    median(&distances).unwrap_or(0.0)
}

/// Where points (in the base frame) lie in their flanges' frames: the median per axis; `None` of nothing.
pub(super) fn in_flange(seen: &[(Isometry3<f64>, Point3<f64>)]) -> Option<Vector3<f64>> {
    let local: Vec<Point3<f64>> =
        seen.iter().map(|(flange, at)| flange.inverse_transform_point(at)).collect();
    let axis = |axis: usize| median(&local.iter().map(|p| p[axis]).collect::<Vec<_>>());
    Some(Vector3::new(axis(0)?, axis(1)?, axis(2)?))
}

/// The most orientations that are tried as the middle of all.
const MOST_MIDDLES: usize = 20;

/// The orientation that most are near to; `None` of nothing.
fn middle(turns: &[UnitQuaternion<f64>]) -> Option<UnitQuaternion<f64>> {
    let spread = |middle: &UnitQuaternion<f64>| {
        median(&turns.iter().map(|turn| turn.angle_to(middle)).collect::<Vec<_>>())
    };
    let tried = turns.iter().step_by(turns.len().div_ceil(MOST_MIDDLES).max(1));
    let tried = tried.filter_map(|turn| Some((*turn, spread(turn)?)));
    tried.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(middle, _)| middle)
}

/// Rounds of reweighting, and the least scale of the weights, mm.
const ROUNDS: usize = 8;
const LEAST_SCALE_MM: f64 = 0.01;

/// The rigid transform from `from` to `to` that most points agree with: closed form with Cauchy weights on the distances.
pub(super) fn robust_align(to: &[Point3<f64>], from: &[Point3<f64>]) -> Option<Isometry3<f64>> {
    let mut found = align(to, from, &vec![1.0; to.len()])?;
    for _ in 0..ROUNDS {
        let apart = apart(to, from, &found);
        let scale = median(&apart)?.max(LEAST_SCALE_MM);
        let weights: Vec<f64> =
            apart.iter().map(|d| 1.0 / (1.0 + (d / (2.0 * scale)).powi(2))).collect();
        found = align(to, from, &weights)?;
    }
    Some(found)
}

fn median_apart(to: &[Point3<f64>], from: &[Point3<f64>], placed: &Isometry3<f64>) -> f64 {
    median(&apart(to, from, placed)).unwrap_or(f64::INFINITY)
}

fn apart(to: &[Point3<f64>], from: &[Point3<f64>], placed: &Isometry3<f64>) -> Vec<f64> {
    to.iter().zip(from).map(|(to, from)| (to - placed * from).norm()).collect()
}
