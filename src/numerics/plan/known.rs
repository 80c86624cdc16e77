//! An arm that was identified before: the posterior of a past session replaces the prior.
//!
//! Inputs: the full error model of a past run, and the parts that the new session shares with it. Robots are drawn from its
//! posterior with all its covariance (geometry, curves, gravity, gear lines, approach-direction offsets, the target; and
//! the between-session variation), designs start from it, and a session's own fit continues from it.

use nalgebra::{DVector, Vector3};

use crate::fit::full::design::saturation;
use crate::fit::full::layout::Block;
use crate::fit::full::next::{Mounted, Mounting, Placed};
use crate::fit::full::{FullModel, FullSettings};
use crate::fit::{
    Anchor, Frames, Gauge, KnownGauge, Observation, Sees, SourceId, TargetId, TrainingSettings,
};
use crate::geometry::rpy;
use crate::kinematics::Arm;
use crate::simulate::{
    ApproachOffset, ArmErrors, AxisError, AxisErrors, GearLine, Ingredient, JointCurve,
    SimulateSettings, Stream, Visit,
};

/// Standard deviation per axis of a target's place that nothing is known of, mm.
const ANYWHERE_MM: f64 = 300.0;

/// A known arm in a session that is still to come, with one tracker and the main target.
#[derive(Debug)]
pub struct KnownArm {
    mounting: Mounting,
    pub model: FullModel,
    knows_approach: bool,
}

impl KnownArm {
    /// The arm from the model of a past run, for a session of `stations` stations; `None` where a factorisation fails.
    pub fn new(
        arm: &Arm,
        past: &FullModel,
        mounting: Mounting,
        stations: usize,
        settings: &FullSettings,
        up: Option<nalgebra::UnitVector3<f64>>,
    ) -> Option<Self> {
        Some(Self {
            model: past.next(arm, &mounting, stations, settings, up)?,
            mounting,
            knows_approach: past.knows_approach(),
        })
    }

    /// The model after stations of the session are measured; `found` are the frames that the nominal arm finds from them.
    pub fn learned(
        &self,
        arm: &Arm,
        observations: &[Observation],
        found: &Frames,
    ) -> Option<FullModel> {
        self.model.learned(arm, observations, self.mounting.starts(&self.model.starts()[0], found))
    }

    /// The model after stations of the session are measured, where it has further targets and instruments of one length than were
    /// planned; `found` are the frames that the nominal arm finds from them. `None` where a factorisation fails.
    pub fn learned_from_all(
        &self,
        arm: &Arm,
        observations: &[Observation],
        found: &Frames,
        settings: &TrainingSettings<'_>,
    ) -> Option<FullModel> {
        let mounting = mounted_as_planned(found, &settings.fit.gauges);
        let stations = self.model.span_stations();
        let (full, up) = (settings.full, settings.up);
        let model = self.model.next(arm, &mounting, stations, full, up)?;
        let moved = self.mounting.starts(&self.model.starts()[0], found);
        model.learned(arm, observations, mounting.starts(&moved, found))
    }

    /// Arm number `cell.seed` drawn from the posterior, with its base put into the cell where it was not moved.
    pub fn draw(&self, cell: &mut SimulateSettings) -> ArmErrors {
        let mut stream = Stream::new(cell.seed, Ingredient::Posterior);
        let z = DVector::from_vec(stream.normals(self.model.trained.layout.size(), 1.0));
        let drawn = self.model.drawn(z);
        let (offsets, frames) = self.model.geometry_of(&drawn, 0);
        let frames = frames.pair(SourceId::ONLY, TargetId::ONLY);
        if self.mounting.sources[frames.source.0] == Placed::Same {
            let base = frames.tracker_from_base.isometry();
            cell.cell.tracker_from_base_mm = base.translation.vector.into();
            cell.cell.tracker_from_base_rpy = rpy(&base.rotation);
        }
        ArmErrors::of_identified(
            offsets,
            self.axes(&drawn),
            frames.flange_from_target.isometry(),
            cell.gravity.up,
        )
    }

    /// Adds to visits the error that the arm as a whole does not repeat.
    pub fn scatter(&self, visits: &mut [Visit], seed: u64) {
        let (sd_mm, _) = self.model.visit_deviations();
        let mut stream = Stream::new(seed, Ingredient::Scatter);
        for visit in visits {
            let away: Vector3<f64> = stream.normal3() * sd_mm;
            visit.truth.tracker_from_target.translation.vector += away;
            for reading in &mut visit.station.readings {
                if let Some(point) = reading.value.point_mut() {
                    point.position += away;
                }
            }
        }
    }

    fn axes(&self, drawn: &DVector<f64>) -> AxisErrors {
        let (_, joints_rad) = self.model.visit_deviations();
        let count = joints_rad.len();
        AxisErrors {
            axes: (0..count).map(|joint| self.axis(joint, count, drawn)).collect(),
            approach: self.approach(count, drawn),
            repeatability_rad: joints_rad,
        }
    }

    fn axis(&self, joint: usize, joints: usize, drawn: &DVector<f64>) -> AxisError {
        let of = |block| self.coefficients(block, drawn);
        let own = of(Block::SessionCurve { session: 0, joint });
        let (constant_rad, own) = own.split_first().map_or((0.0, &[][..]), |(c, rest)| (*c, rest));
        let line = |cycles: f64| match of(Block::Line { joint, cycles })[..] {
            [cos, sin] => Some(GearLine::of(cycles, cos, sin)),
            _ => None,
        };
        // The gravity columns of a joint come after those of the joints before it, one for each later mass.
        let before: usize = (0..joint).map(|earlier| joints - earlier).sum();
        AxisError {
            constant_rad,
            curve_unit: self.model.trained.layout.curve_unit(joint),
            curves: vec![curve(&of(Block::Curve(joint))), curve(own)],
            lines: self.model.trained.layout.lines(joint).into_iter().filter_map(line).collect(),
            gives_way: of(Block::Gravity).into_iter().skip(before).take(joints - joint).collect(),
        }
    }

    fn approach(&self, joints: usize, drawn: &DVector<f64>) -> Option<Vec<ApproachOffset>> {
        let of = |block| self.coefficients(block, drawn);
        let (command_weight, own, short) = (
            of(Block::CommandWeight),
            of(Block::SessionCommandWeight(0)),
            of(Block::ApproachOffset),
        );
        let at = |list: &[f64], joint: usize| list.get(joint).copied().unwrap_or(0.0);
        let stand = |joint| ApproachOffset {
            nearer_command: at(&command_weight, joint) + at(&own, joint),
            beyond_rad: at(&short, joint),
            within_rad: saturation(self.model.trained.layout.slide_period_mm(joint).is_some()),
        };
        self.knows_approach.then(|| (0..joints).map(stand).collect())
    }

    /// The coefficients of a block; empty where the model has no such part.
    fn coefficients(&self, block: Block, drawn: &DVector<f64>) -> Vec<f64> {
        drawn.as_slice()[self.model.trained.layout.columns(block).unwrap_or(0..0)].to_vec()
    }
}

/// The mounting of a session as it was planned, with the further targets and instruments of `found`; `known` are the stated places and
/// offsets of instruments, in the order of sources.
fn mounted_as_planned(found: &Frames, known: &[KnownGauge]) -> Mounting {
    let further = found.sees().iter().enumerate().skip(1).map(|(source, sees)| match sees {
        Sees::Length(gauge) => {
            let known = known.get(source).copied().unwrap_or_default();
            let gauge = as_stated(*gauge, &known);
            Placed::Length { gauge, known }
        }
        Sees::Places | Sees::Nothing => Placed::Moved(*found.tracker_from_base(SourceId(source))),
    });
    let beside = found
        .targets()
        .iter()
        .skip(1)
        .map(|place| Mounted::Other { flange_from_target: *place, sd_mm: ANYWHERE_MM });
    Mounting {
        session: 0,
        sources: std::iter::once(Placed::Same).chain(further).collect(),
        targets: std::iter::once(Mounted::Same).chain(beside).collect(),
    }
}

/// An anchor in its stated place, with its stated offset, as far as they are stated.
fn as_stated(gauge: Gauge, known: &KnownGauge) -> Gauge {
    match gauge {
        Gauge::Distance(found) => Gauge::Distance(Anchor {
            place: known.place.map_or(found.place, |own| own.xyz_mm.into()),
            offset_mm: known.offset.map_or(found.offset_mm, |own| own.0),
        }),
        Gauge::Height(_) => gauge,
    }
}

/// A curve from pairs `cos, sin`.
fn curve(pairs: &[f64]) -> JointCurve {
    let (pairs, _) = pairs.as_chunks::<2>();
    JointCurve {
        cosines: pairs.iter().map(|pair| pair[0]).collect(),
        sines: pairs.iter().map(|pair| pair[1]).collect(),
    }
}
