//! What each instrument would buy: the accuracy that a session's poses leave open, by the instruments that read them.
//!
//! Inputs: the nominal arm, poses to measure, instruments with their places and uncertainties. Output: a row for the tracker, for each
//! instrument of one length, and for them together ([`InstrumentRow`]). For each set of instruments the information of the fit at these
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
    /// What it reads.
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
    /// Root mean square over the test poses of the error of a predicted position that they leave open, mm.
    pub open_mm: f64,
}

impl InstrumentSection {
    fn gauge(&self) -> Gauge {
        let place = Point3::from(self.xyz_mm);
        match self.reads {
            LengthRead::Distance => Gauge::Distance(Anchor {
                place,
                offset_mm: 0.0,
            }),
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

/// The cell that instruments are compared in.
#[derive(Debug, Clone)]
struct Around<'s> {
    arm: &'s Arm,
    /// The base in the tracker's frame.
    tracker_from_base: Isometry3<f64>,
    /// The target's place on the flange, mm.
    target: Vector3<f64>,
    uncertainty: Uncertainty,
    repeatability_mm: f64,
    /// Standard deviations of the geometry's lengths, mm, and angles, rad.
    prior: (f64, f64),
}

/// Standard deviations of the geometry where the settings state no prior, mm and rad.
const PRIOR: (f64, f64) = (3.0, 3e-3);
/// Standard deviations of frames, targets and instruments, which are free but for what keeps a matrix positive, mm and rad.
const FREE: (f64, f64) = (1e3, 1.0);

/// The rows for the tracker alone, each instrument alone, all instruments of one length, and the tracker with them; `poses` are
/// measured and `test` are predicted, both as reported angles. Empty without instruments.
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
    let around = Around {
        arm,
        tracker_from_base: isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy),
        target: settings.flange_from_target.translation.vector,
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
    let row = |(instruments, sources): (String, Vec<Source>)| {
        let set = Set::new(around, poses, &sources);
        Some(InstrumentRow {
            instruments,
            numbers: set.numbers(),
            rank: set.rank(),
            open_mm: set.open_mm(test)?,
        })
    };
    sets(instruments).into_iter().filter_map(row).collect()
}

/// The sets of instruments that are compared, with their names; none without an instrument of one length.
fn sets(instruments: &[InstrumentSection]) -> Vec<(String, Vec<Source>)> {
    let source = |one: &InstrumentSection| (Sees::Length(one.gauge()), one.sd_mm);
    let lengths: Vec<Source> = instruments.iter().map(source).collect();
    if lengths.is_empty() {
        return Vec::new();
    }
    let names: Vec<&str> = instruments.iter().map(|one| one.name.as_str()).collect();
    let names = names.join(" + ");
    let tracker = [(Sees::Places, 0.0)];
    let together = [&tracker[..], &lengths].concat();
    let mut sets = vec![("tracker".to_owned(), tracker.to_vec())];
    let each = instruments.iter().zip(&lengths);
    sets.extend(each.map(|(one, source)| (one.name.clone(), vec![*source])));
    sets.push((format!("tracker + {names}"), together));
    if instruments.len() > 1 {
        sets.push((names, lengths));
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
    fn new(around: &'s Around<'s>, poses: &[Vec<f64>], sources: &[Source]) -> Self {
        let sees: Vec<Sees> = sources.iter().map(|source| source.0).collect();
        let bases = vec![Transform::claim(around.tracker_from_base); sources.len()];
        let target = Isometry3::from_parts(around.target.into(), UnitQuaternion::identity());
        let frames = Frames::new(bases, vec![Transform::claim(target)]);
        let frames = frames.expect("some of each").seeing(&sees);
        let numbered = sources.iter().enumerate();
        let observations = poses.iter().enumerate().flat_map(|(station, joints)| {
            let at =
                |(number, source)| around.observation(&frames, station, joints, number, source);
            numbered.clone().map(at).collect::<Vec<Observation>>()
        });
        Self {
            observations: observations.collect(),
            around,
            frames: [frames],
        }
    }

    fn problem(&self) -> Problem<'_> {
        let prior = Prior {
            geometry: Some(self.around.prior),
            ..Prior::default()
        };
        let chain = self.around.arm.chain();
        Problem::new(
            &self.observations,
            chain,
            &self.frames,
            Freedom::Geometry,
            &prior,
        )
    }

    fn numbers(&self) -> usize {
        let rows = self.observations.iter().map(|o| o.measured.kind().rows());
        rows.sum()
    }

    fn rank(&self) -> usize {
        let problem = self.problem();
        Structure::of(&problem, &DVector::zeros(problem.unknowns().len())).rank
    }

    /// Root mean square of the open error of predicted positions at these angles, mm; `None` where the covariance has no factor.
    fn open_mm(&self, test: &[Vec<f64>]) -> Option<f64> {
        let problem = self.problem();
        let half = self.half(&problem)?;
        let (rows, rigid) = self.moved(&problem, test);
        let open = rows * half;
        let along = rigid.transpose() * &open;
        let left = open - rigid * along;
        let squares = gram(&left.as_view()).trace();
        Some((squares / test.len().max(1) as f64).sqrt())
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
        let channel = Channel {
            session: 0,
            source: SourceId::ONLY,
            target: TargetId::ONLY,
        };
        let mut rows = DMatrix::zeros(3 * test.len(), at.len());
        let mut rigid = DMatrix::zeros(3 * test.len(), 6);
        for (place, joints) in test.iter().enumerate() {
            let view = chains.of(channel).view(&self.around.arm.axes(joints));
            for (unknown, twist) in &view.unknowns {
                if !matches!(problem.unknowns()[*unknown].owner, Owner::Source { .. }) {
                    rows.fixed_view_mut::<3, 1>(3 * place, *unknown)
                        .copy_from(&twist.linear);
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
    /// A reading of one source at a pose; its value is what the nominal arm has there.
    fn observation(
        &self,
        frames: &Frames,
        station: usize,
        joints: &[f64],
        number: usize,
        (sees, sd_mm): &Source,
    ) -> Observation {
        let axes = self.arm.axes(joints);
        let pair = frames.pair(SourceId(number), TargetId::ONLY);
        let flange = pair.tracker_from_base.isometry() * self.arm.chain().nominal(&axes);
        let place = flange * Point3::from(self.target);
        let own = Observation::planned(axes, place, self.uncertainty.covariance(&place));
        let measured = match sees {
            Sees::Length(gauge) => self.length(gauge, &place, *sd_mm),
            Sees::Places | Sees::Nothing => self.point(&place),
        };
        Observation {
            source: SourceId(number),
            station,
            pose: station,
            measured,
            ..own
        }
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
            factor: whole
                .cholesky()
                .map_or_else(Matrix3::identity, |factor| factor.l()),
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

    #[test]
    fn more_and_better_instruments_leave_less_open() {
        let text = include_str!("../../pipelines/robots/ur10.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        let arm = file.arm().expect("a valid arm");
        let around = Around {
            arm: &arm,
            tracker_from_base: isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]),
            target: Vector3::new(60.0, 20.0, 80.0),
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
        };
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
            rows.find(|own| own.instruments == name)
                .unwrap_or_else(|| panic!("{name} in {rows:?}"))
        };
        let ranks = ["tracker", "a", "face"].map(|name| row(name).rank);
        assert_eq!(ranks, [27, 25, 22]);
        assert_eq!(row("tracker").numbers, 180);
        let all = row("a + b + c + face");
        let together = row("tracker + a + b + c + face");
        assert_eq!((all.numbers, together.numbers), (240, 420));
        let open = |name: &str| row(name).open_mm;
        assert!(together.open_mm < open("tracker"), "{rows:?}");
        assert!(together.open_mm < all.open_mm, "{rows:?}");
        assert!(
            all.open_mm < open("a") && open("a") < open("face"),
            "{rows:?}"
        );
        // A tracker is worth more than one bar, and less than infinitely more: the prior holds what the bar does not see.
        assert!(open("tracker") < open("a") && open("a") < 3.0, "{rows:?}");
        assert_eq!(compared(&around, &poses(0, 60), &poses(500, 80), &[]), []);
    }
}
