//! What each instrument would buy: the accuracy that a session's poses leave open, by the instruments that read them.
//!
//! Inputs: the nominal arm, poses to measure, instruments with their places and uncertainties, and further reflectors. Output: a row
//! for the tracker, for the tracker with these reflectors, for each instrument of one length, and for them together
//! ([`InstrumentRow`]). For each set of instruments the information of the fit at these
//! poses and the prior of the geometry give the covariance of arm and target, and that gives the covariance of predicted positions at
//! other poses, less the rigid motion of all of them that a base found anew takes out. It is the part of the geometry alone: joint
//! curves and other parts of the full error model are in the simulated robots of a plan, which a tracker measures.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::PlanSettings;
use crate::fit::observation::MeasuredLength;
use crate::fit::{
    Anchor, Channel, Frames, Freedom, Gauge, Measured, MeasuredPoint, Observation, Owner, Plane,
    Prior, Problem, Sees, SourceId, Structure, TargetId, Uncertainty,
};
use crate::geometry::{Transform, isometry_from_rpy};
use crate::ingest::LengthRead;
use crate::kinematics::Arm;
use crate::linalg::{Cholesky, gram};

/// An instrument of one length that a session could have: `[[plan.instruments]]`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct InstrumentSection {
    /// Its name.
    pub name: String,
    /// Kind of its readings.
    pub reads: LengthRead,
    /// Its anchor, or a point of its plane, in the base's frame, mm.
    pub xyz_mm: [f64; 3],
    /// The plane's normal in the base's frame; of distances without meaning.
    #[serde(default = "upright")]
    pub normal: [f64; 3],
    /// Standard deviation of its readings, mm.
    pub sd_mm: f64,
}

const fn upright() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// The accuracy that a set of instruments leaves open.
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentRow {
    /// The instruments.
    pub instruments: String,
    /// Numbers that they read at all poses.
    pub numbers: usize,
    /// Independent directions of instruments, arm and target together.
    pub rank: usize,
    /// Root mean square over the test poses of the error of a predicted position that they leave open, mm; `None` with fewer than three
    /// test poses, whose errors a base found anew takes out.
    pub open_mm: Option<f64>,
}

impl InstrumentSection {
    fn gauge(&self) -> Gauge {
        let place = Point3::from(self.xyz_mm);
        match self.reads {
            LengthRead::Distance => Gauge::Distance(Anchor { place, offset_mm: 0.0 }),
            LengthRead::Height => {
                let normal = Unit::try_new(Vector3::from(self.normal), 0.0);
                let normal = normal.unwrap_or_else(Vector3::z_axis);
                Gauge::Height(Plane::new(normal, normal.dot(&place.coords)))
            }
        }
    }
}

/// A source of a set of instruments, with the standard deviation of a length, mm.
type Source = (Sees, f64);

/// Fewest test poses that show an error: a rigid motion takes out that of one, and of two all but that of their distance.
const LEAST_TEST_POSES: usize = 3;

/// The cell that instruments are compared in.
#[derive(Debug, Clone)]
struct Around<'s> {
    arm: &'s Arm,
    /// The base in the tracker's frame.
    tracker_from_base: Isometry3<f64>,
    /// The target's place on the flange, mm.
    target: Vector3<f64>,
    /// Places of further reflectors on the flange, mm.
    beside: Vec<Vector3<f64>>,
    uncertainty: Uncertainty,
    repeatability_mm: f64,
    /// Standard deviations of the geometry's lengths, mm, and angles, rad.
    prior: (f64, f64),
}

/// Standard deviations of the geometry where the settings state no prior, mm and rad.
const PRIOR: (f64, f64) = (3.0, 3e-3);
/// Standard deviations of frames, targets and instruments, which are free but for what keeps a matrix positive, mm and rad.
const FREE: (f64, f64) = (1e3, 1.0);

/// The rows for the tracker alone, the tracker with further reflectors, each instrument alone, all instruments of one length, and the
/// tracker with them; `poses` are measured and `test` are predicted, both as reported angles. Empty without instruments and further
/// reflectors.
pub fn rows(
    arm: &Arm,
    poses: &[Vec<f64>],
    test: &[Vec<f64>],
    settings: &PlanSettings,
) -> Vec<InstrumentRow> {
    let Some(tracker) = settings.noise.sources.first() else {
        return Vec::new();
    };
    let cell = &settings.population.cell;
    let target = &settings.flange_from_target;
    let beside = settings.reflectors_mm.iter();
    let around = Around {
        arm,
        tracker_from_base: isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy),
        target: target.translation.vector,
        beside: beside.map(|place| (target * Point3::from(*place)).coords).collect(),
        uncertainty: tracker.uncertainty,
        repeatability_mm: settings.noise.repeatability_mm,
        prior: settings.fit.prior().geometry.unwrap_or(PRIOR),
    };
    compared(&around, poses, test, &settings.instruments)
}

fn compared(
    around: &Around<'_>,
    poses: &[Vec<f64>],
    test: &[Vec<f64>],
    instruments: &[InstrumentSection],
) -> Vec<InstrumentRow> {
    let row = |(instruments, sources, reflectors): (String, Vec<Source>, usize)| {
        let set = Set::new(around, poses, &sources, reflectors);
        let problem = set.problem();
        let at = DVector::zeros(problem.unknowns().len());
        InstrumentRow {
            instruments,
            numbers: set.numbers(),
            rank: Structure::of(&problem, &at).rank,
            open_mm: set.open_mm(&problem, test),
        }
    };
    let sets = sets(instruments, around.beside.len());
    sets.into_iter().map(row).collect()
}

/// The sets of instruments that are compared: their names, their sources, and the number of reflectors that the tracker reads; none
/// without an instrument of one length and without reflectors `beside` the target.
fn sets(instruments: &[InstrumentSection], beside: usize) -> Vec<(String, Vec<Source>, usize)> {
    let source = |one: &InstrumentSection| (Sees::Length(one.gauge()), one.sd_mm);
    let lengths: Vec<Source> = instruments.iter().map(source).collect();
    if lengths.is_empty() && beside == 0 {
        return Vec::new();
    }
    let names: Vec<&str> = instruments.iter().map(|one| one.name.as_str()).collect();
    let names = names.join(" + ");
    let mut trackers = vec![("tracker".to_owned(), 1)];
    if beside > 0 {
        trackers.push((format!("tracker, {} reflectors", beside + 1), beside + 1));
    }
    let tracker = [(Sees::Places, 0.0)];
    let alone = trackers.iter();
    let mut sets: Vec<_> =
        alone.map(|(name, reflectors)| (name.clone(), tracker.to_vec(), *reflectors)).collect();
    let each = instruments.iter().zip(&lengths);
    sets.extend(each.map(|(one, source)| (one.name.clone(), vec![*source], 1)));
    if !lengths.is_empty() {
        let together = [&tracker[..], &lengths].concat();
        let both = trackers.iter();
        sets.extend(both.map(|(name, reflectors)| {
            (format!("{name} + {names}"), together.clone(), *reflectors)
        }));
    }
    if instruments.len() > 1 {
        sets.push((names, lengths, 1));
    }
    sets
}

/// A set of instruments at the poses of a session.
struct Set<'s> {
    around: &'s Around<'s>,
    frames: [Frames; 1],
    observations: Vec<Observation>,
}

impl<'s> Set<'s> {
    fn new(
        around: &'s Around<'s>,
        poses: &[Vec<f64>],
        sources: &[Source],
        reflectors: usize,
    ) -> Self {
        let sees: Vec<Sees> = sources.iter().map(|source| source.0).collect();
        let bases = vec![Transform::claim(around.tracker_from_base); sources.len()];
        let places = std::iter::once(&around.target).chain(&around.beside);
        let target = |place: &Vector3<f64>| {
            Transform::claim(Isometry3::from_parts((*place).into(), UnitQuaternion::identity()))
        };
        let targets = places.take(reflectors).map(target);
        let frames = Frames::new(bases, targets.collect());
        let frames = frames.expect("some of each").seeing(&sees);
        let channels = sources.iter().enumerate().flat_map(|(number, source)| {
            // An instrument of one length reads the main target.
            let targets = if source.0 == Sees::Places { reflectors } else { 1 };
            (0..targets).map(move |target| ((number, source), TargetId(target)))
        });
        let observations = poses.iter().enumerate().flat_map(|(station, joints)| {
            let at =
                |(source, target)| around.observation(&frames, (station, joints), source, target);
            channels.clone().map(at).collect::<Vec<Observation>>()
        });
        Self { observations: observations.collect(), around, frames: [frames] }
    }

    fn problem(&self) -> Problem<'_> {
        let prior = Prior { geometry: Some(self.around.prior), ..Prior::default() };
        let chain = self.around.arm.chain();
        Problem::new(&self.observations, chain, &self.frames, Freedom::Geometry, &prior)
    }

    fn numbers(&self) -> usize {
        let rows = self.observations.iter().map(|o| o.measured.kind().rows());
        rows.sum()
    }

    /// Root mean square of the open error of predicted positions of the target at these angles, mm; `None` where too few poses show one,
    /// and where the covariance has no factor.
    fn open_mm(&self, problem: &Problem<'_>, test: &[Vec<f64>]) -> Option<f64> {
        if test.len() < LEAST_TEST_POSES {
            return None;
        }
        let half = self.half(problem)?;
        let (rows, rigid) = self.moved(problem, test);
        let open = rows * half;
        let along = rigid.transpose() * &open;
        let left = open - rigid * along;
        let squares = gram(&left.as_view()).trace();
        Some((squares / test.len() as f64).sqrt())
    }

    /// A square root H of the unknowns' covariance `H Hᵀ`.
    fn half(&self, problem: &Problem<'_>) -> Option<DMatrix<f64>> {
        let at = DVector::zeros(problem.unknowns().len());
        let weights = vec![1.0; self.observations.len()];
        let mut information = problem.normal(&at, &weights).information;
        for (place, unknown) in problem.unknowns().iter().enumerate() {
            let (length_mm, angle_rad) = match unknown.owner {
                Owner::Arm => self.around.prior,
                Owner::Source { .. } | Owner::Target { .. } => FREE,
            };
            let is_angle = unknown.parameter.is_angle();
            let sd = if is_angle { angle_rad } else { length_mm };
            information[(place, place)] += sd.powi(-2);
        }
        let scales = information.diagonal().map(|own| own.sqrt().recip());
        let size = scales.len();
        let entry = |i: usize, j: usize| information[(i, j)] * scales[i] * scales[j];
        let scaled = DMatrix::from_fn(size, size, entry);
        let mut half = Cholesky::new(scaled)?.inverse_lower().transpose();
        for (mut row, scale) in half.row_iter_mut().zip(&scales) {
            row *= *scale;
        }
        Some(half)
    }

    /// The motion of each test position by every unknown of arm and target, three rows each, and an orthonormal basis of the rigid motions
    /// of all of them.
    fn moved(&self, problem: &Problem<'_>, test: &[Vec<f64>]) -> (DMatrix<f64>, DMatrix<f64>) {
        let at = DVector::zeros(problem.unknowns().len());
        let chains = problem.held(&at);
        let channel = Channel { session: 0, source: SourceId::ONLY, target: TargetId::ONLY };
        let mut rows = DMatrix::zeros(3 * test.len(), at.len());
        let mut rigid = DMatrix::zeros(3 * test.len(), 6);
        for (place, joints) in test.iter().enumerate() {
            let view = chains.of(channel).view(&self.around.arm.axes(joints));
            for (unknown, twist) in &view.unknowns {
                if !matches!(problem.unknowns()[*unknown].owner, Owner::Source { .. }) {
                    rows.fixed_view_mut::<3, 1>(3 * place, *unknown).copy_from(&twist.linear);
                }
            }
            let end = view.end.translation.vector;
            for axis in 0..3 {
                let along = Vector3::ith(axis, 1.0);
                rigid[(3 * place + axis, axis)] = 1.0;
                rigid
                    .fixed_view_mut::<3, 1>(3 * place, 3 + axis)
                    .copy_from(&(along.cross(&end) * 1e-3));
            }
        }
        (rows, rigid.qr().q())
    }
}

impl Around<'_> {
    /// A reading of one source on one target at a pose; its value is what the nominal arm has there.
    fn observation(
        &self,
        frames: &Frames,
        (station, joints): (usize, &[f64]),
        (number, (sees, sd_mm)): (usize, &Source),
        target: TargetId,
    ) -> Observation {
        let axes = self.arm.axes(joints);
        let pair = frames.pair(SourceId(number), target);
        let flange = pair.tracker_from_base.isometry() * self.arm.chain().nominal(&axes);
        let place = flange * Point3::from(pair.flange_from_target.isometry().translation.vector);
        let own = Observation::planned(station, axes, place, self.uncertainty.covariance(&place));
        let measured = match sees {
            Sees::Length(gauge) => self.length(gauge, &place, *sd_mm),
            Sees::Places | Sees::Nothing => self.point(&place),
        };
        Observation { source: SourceId(number), target, measured, ..own }
    }

    fn length(&self, gauge: &Gauge, place: &Point3<f64>, sd_mm: f64) -> Measured {
        let length = MeasuredLength {
            mm: gauge.reading_mm(place),
            instrument_mm: sd_mm,
            sd_mm: sd_mm.hypot(self.repeatability_mm),
        };
        match gauge {
            Gauge::Distance(_) => Measured::Distance(length),
            Gauge::Height(_) => Measured::Height(length),
        }
    }

    fn point(&self, place: &Point3<f64>) -> Measured {
        let instrument = self.uncertainty.covariance(place);
        let whole = instrument + Matrix3::identity() * self.repeatability_mm.powi(2);
        Measured::Point(MeasuredPoint {
            position: *place,
            instrument,
            factor: whole.cholesky().map_or_else(Matrix3::identity, |factor| factor.l()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::TrackerUncertainty;
    use crate::kinematics::RobotFile;

    fn poses(from: usize, count: usize) -> Vec<Vec<f64>> {
        let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
        let angle = |place: usize, joint: usize| {
            let turn = (place + 1) as f64 * [2.0, 3.0, 5.0, 7.0, 11.0, 13.0_f64][joint].sqrt();
            middle[joint] + 2.4 * (turn.fract() - 0.5)
        };
        let pose = |place: usize| (0..6).map(|joint| angle(place, joint)).collect();
        (from..from + count).map(pose).collect()
    }

    fn bar(name: &str, xyz_mm: [f64; 3], sd_mm: f64) -> InstrumentSection {
        InstrumentSection {
            name: name.to_owned(),
            reads: LengthRead::Distance,
            xyz_mm,
            normal: upright(),
            sd_mm,
        }
    }

    fn ur10() -> Arm {
        let text = include_str!("../../pipelines/robots/ur10.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        file.arm().expect("a valid arm")
    }

    fn around(arm: &Arm) -> Around<'_> {
        Around {
            arm,
            tracker_from_base: isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]),
            target: Vector3::new(60.0, 20.0, 80.0),
            beside: Vec::new(),
            uncertainty: Uncertainty::Tracker(TrackerUncertainty {
                range_um: 10.0,
                range_um_per_m: 0.3,
                transverse_um: 15.0,
                transverse_um_per_m: 6.0,
                divisor: 2.0,
                orientation_rad: None,
            }),
            repeatability_mm: 0.03,
            prior: (0.5, 0.5e-3),
        }
    }

    #[test]
    fn more_and_better_instruments_leave_less_open() {
        let arm = ur10();
        let around = around(&arm);
        let face = InstrumentSection {
            reads: LengthRead::Height,
            ..bar("face", [0.0, 0.0, -200.0], 0.01)
        };
        let instruments = [
            bar("a", [1400.0, 300.0, -200.0], 0.01),
            bar("b", [-300.0, 1500.0, 900.0], 0.01),
            bar("c", [200.0, -1300.0, 1600.0], 0.01),
            face,
        ];
        let rows = compared(&around, &poses(0, 60), &poses(500, 80), &instruments);
        let row = |name: &str| {
            let mut rows = rows.iter();
            rows.find(|own| own.instruments == name).unwrap_or_else(|| panic!("{name} in {rows:?}"))
        };
        let ranks = ["tracker", "a", "face"].map(|name| row(name).rank);
        assert_eq!(ranks, [27, 25, 22]);
        assert_eq!(row("tracker").numbers, 180);
        let all = row("a + b + c + face");
        let together = row("tracker + a + b + c + face");
        assert_eq!((all.numbers, together.numbers), (240, 420));
        let open = |name: &str| row(name).open_mm.expect("80 poses show it");
        let (of_all, of_both) = (open("a + b + c + face"), open("tracker + a + b + c + face"));
        assert!(of_both < open("tracker") && of_both < of_all, "{rows:?}");
        assert!(of_all < open("a") && open("a") < open("face"), "{rows:?}");
        // A tracker is worth more than one bar, and less than infinitely more: the prior holds what the bar does not see.
        assert!(open("tracker") < open("a") && open("a") < 3.0, "{rows:?}");
        assert_eq!(compared(&around, &poses(0, 60), &poses(500, 80), &[]), []);
        // Two poses show nothing of a position: a base found anew takes their errors out.
        let two = compared(&around, &poses(0, 60), &poses(500, 2), &instruments);
        assert!(two.iter().all(|row| row.open_mm.is_none()), "{two:?}");
    }

    #[test]
    fn three_reflectors_identify_more_and_leave_less_open() {
        let arm = ur10();
        let around = Around {
            beside: vec![Vector3::new(-40.0, 70.0, 60.0), Vector3::new(-10.0, -60.0, 120.0)],
            ..around(&arm)
        };
        let of = |instruments: &[InstrumentSection]| {
            compared(&around, &poses(0, 60), &poses(500, 80), instruments)
        };
        let [one, three] = &of(&[])[..] else { panic!("the tracker with one and with three") };
        assert_eq!(three.instruments, "tracker, 3 reflectors");
        assert_eq!([one.numbers, three.numbers], [180, 540]);
        assert_eq!([one.rank, three.rank], [27, 33]);
        assert!(three.open_mm < one.open_mm, "{one:?} {three:?}");
        let names = of(&[bar("a", [1400.0, 300.0, -200.0], 0.01)]);
        let names: Vec<&str> = names.iter().map(|row| row.instruments.as_str()).collect();
        let expected =
            ["tracker", "tracker, 3 reflectors", "a", "tracker + a", "tracker, 3 reflectors + a"];
        assert_eq!(names, expected);
    }
}
