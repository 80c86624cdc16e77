//! What each instrument would buy: the accuracy that a session's poses leave open, by the instruments that read them.
//!
//! Inputs: the nominal arm, poses to measure, instruments with their places and uncertainties. Output: a row for the tracker, for each
//! instrument of one length, and for them together ([`InstrumentRow`]). For each set of instruments the information of the fit at these
//! poses and the prior of the geometry give the covariance of arm and target, and that gives the covariance of predicted positions at
//! other poses, less the rigid motion of all of them that a base found anew takes out. It is the part of the geometry alone: joint
//! curves and other parts of the full error model are in the simulated robots of a plan, which a tracker measures.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

use super::PlanSettings;
use crate::fit::observation::MeasuredLength;
use crate::fit::{
    Anchor, Channel, Frames, Freedom, Gauge, Measured, MeasuredPoint, Observation, Owner, Plane,
    Prior, Problem, Sees, SourceId, Structure, TargetId,
};
use crate::geometry::Transform;
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

/// The rows for the tracker alone, each instrument alone, all instruments of one length, and the tracker with them; `poses` are
/// measured and `test` are predicted, both as reported angles. Empty without instruments.
pub fn rows(
    arm: &Arm,
    poses: &[Vec<f64>],
    test: &[Vec<f64>],
    settings: &PlanSettings,
) -> Vec<InstrumentRow> {
    let own = &settings.instruments;
    let lengths: Vec<Source> = own
        .iter()
        .map(|one| (Sees::Length(one.gauge()), one.sd_mm))
        .collect();
    if lengths.is_empty() {
        return Vec::new();
    }
    let tracker = [(Sees::Places, 0.0)];
    let names = |of: &[InstrumentSection]| {
        let names: Vec<&str> = of.iter().map(|one| one.name.as_str()).collect();
        names.join(" + ")
    };
    let mut sets = vec![("tracker".to_owned(), tracker.to_vec())];
    let each = own.iter().zip(&lengths);
    sets.extend(each.map(|(one, source)| (one.name.clone(), vec![*source])));
    if own.len() > 1 {
        sets.push((names(own), lengths.clone()));
    }
    let together = [&tracker[..], &lengths].concat();
    sets.push((format!("tracker + {}", names(own)), together));
    let row = |(instruments, sources): (String, Vec<Source>)| {
        let set = Set::new(arm, poses, &sources, settings);
        Some(InstrumentRow {
            instruments,
            numbers: set.numbers(),
            rank: set.rank(),
            open_mm: set.open_mm(test)?,
        })
    };
    sets.into_iter().filter_map(row).collect()
}

/// A set of instruments at the poses of a session.
struct Set<'s> {
    arm: &'s Arm,
    frames: [Frames; 1],
    observations: Vec<Observation>,
    settings: &'s PlanSettings,
}

impl<'s> Set<'s> {
    fn new(
        arm: &'s Arm,
        poses: &[Vec<f64>],
        sources: &[Source],
        settings: &'s PlanSettings,
    ) -> Self {
        let cell = &settings.population.cell;
        let base: Isometry3<f64> = crate::geometry::isometry_from_rpy(
            cell.tracker_from_base_mm,
            cell.tracker_from_base_rpy,
        );
        let target = settings.flange_from_target.translation.vector;
        let target = Isometry3::translation(target.x, target.y, target.z);
        let sees: Vec<Sees> = sources.iter().map(|source| source.0).collect();
        let bases = vec![Transform::claim(base); sources.len()];
        let frames = Frames::new(bases, vec![Transform::claim(target)]);
        let frames = frames.expect("some of each").seeing(&sees);
        let mut observations = Vec::new();
        for (station, joints) in poses.iter().enumerate() {
            for (number, source) in sources.iter().enumerate() {
                let pair = frames.pair(SourceId(number), TargetId::ONLY);
                let flange = arm.chain().nominal(&arm.axes(joints));
                let end = pair.tracker_from_base.isometry() * flange * target;
                let place = Point3::from(end.translation.vector);
                observations.push(observation(
                    arm,
                    joints,
                    station,
                    (number, *source),
                    &place,
                    settings,
                ));
            }
        }
        Self {
            arm,
            frames: [frames],
            observations,
            settings,
        }
    }

    fn problem(&self) -> Problem<'_> {
        let prior = Prior {
            geometry: self.settings.fit.prior().geometry,
            ..Prior::default()
        };
        let chain = self.arm.chain();
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
        let at = DVector::zeros(problem.unknowns().len());
        let weights = vec![1.0; self.observations.len()];
        let mut information = problem.normal(&at, &weights).information;
        let (length_mm, angle_rad) = self.settings.fit.prior().geometry.unwrap_or((3.0, 3e-3));
        for (place, unknown) in problem.unknowns().iter().enumerate() {
            let is_angle = unknown.parameter.is_angle();
            // Frames, targets and instruments are free, but for what keeps the matrix positive.
            let sd = match unknown.owner {
                Owner::Arm if is_angle => angle_rad,
                Owner::Arm => length_mm,
                _ if is_angle => 1.0,
                _ => 1e3,
            };
            information[(place, place)] += sd.powi(-2);
        }
        let scales = information.diagonal().map(|own| own.sqrt().recip());
        let size = scales.len();
        let scaled = DMatrix::from_fn(size, size, |i, j| {
            information[(i, j)] * scales[i] * scales[j]
        });
        let mut half = Cholesky::new(scaled)?.inverse_lower().transpose();
        for (mut row, scale) in half.row_iter_mut().zip(&scales) {
            row *= *scale;
        }
        let (rows, rigid) = self.moved(&problem, test);
        let open = rows * half;
        let along = rigid.transpose() * &open;
        let left = open - rigid * along;
        let squares = gram(&left.as_view()).trace();
        Some((squares / test.len().max(1) as f64).sqrt())
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
            let view = chains.of(channel).view(&self.arm.axes(joints));
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

/// A reading of one source at a pose; its value is what the nominal arm has there.
fn observation(
    arm: &Arm,
    joints: &[f64],
    station: usize,
    (number, (sees, sd_mm)): (usize, Source),
    place: &Point3<f64>,
    settings: &PlanSettings,
) -> Observation {
    let repeatability_mm = settings.noise.repeatability_mm;
    let tracker = settings.noise.sources.first();
    let instrument = tracker.map(|own| own.uncertainty.covariance(place));
    let instrument = instrument.unwrap_or_else(nalgebra::Matrix3::identity);
    let whole = instrument + nalgebra::Matrix3::identity() * repeatability_mm.powi(2);
    let measured = match sees {
        Sees::Length(gauge) => {
            let length = MeasuredLength {
                mm: gauge.reading_mm(place),
                instrument_mm: sd_mm,
                sd_mm: sd_mm.hypot(repeatability_mm),
            };
            match gauge {
                Gauge::Distance(_) => Measured::Distance(length),
                Gauge::Height(_) => Measured::Height(length),
            }
        }
        Sees::Places | Sees::Nothing => Measured::Point(MeasuredPoint {
            position: *place,
            instrument,
            factor: whole
                .cholesky()
                .map_or_else(nalgebra::Matrix3::identity, |factor| factor.l()),
        }),
    };
    Observation {
        source: SourceId(number),
        station,
        pose: station,
        measured,
        ..Observation::planned(arm.axes(joints), *place, instrument)
    }
}
