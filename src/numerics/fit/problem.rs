//! The identification problem: residuals of all observations and their identification Jacobian.
//!
//! `p_tracker = tracker_from_base · A_1(q_1) … A_n(q_n) · flange_from_target` ([`crate::method::kinematics`]). Geometry is
//! shared by all sessions of an arm; each session has its own base in the frame of each of its sources and its own place of
//! each of its targets, all always fitted. An observation is predicted by its channel's chain, from source to target.

mod distances;
mod unknowns;

use nalgebra::{DMatrix, DVector, Isometry3, Point3};
use rayon::prelude::*;

use super::frames::{Channel, FramePair, Frames, PerChannel};
use super::gauge::{Gauge, Sees};
use super::observation::Observation;
use super::observation::measured::widest;
use super::observation::rows::{BlockRows, Stations};
use crate::geometry::Transform;
use crate::join::{ReadingKind, SourceId, TargetId};
use crate::kinematics::batch::BLOCK;
use crate::kinematics::{
    Arm, Axis, BatchChain, BatchColumns, Chain, Element, GaugePart, HeldChain, Motion, Parameter,
};

pub(in crate::fit) use distances::DistanceRow;
pub use unknowns::{
    Freedom, KnownDistance, KnownGauge, KnownTarget, Owner, Prior, TargetDistance, Unknown,
};

/// Observations and the chains that predict them, with a vector of unknown offsets.
#[derive(Debug)]
pub struct Problem<'a> {
    pub observations: &'a [Observation],
    channels: PerChannel<Measuring>,
    pub unknowns: Vec<Unknown>,
    pub starts: Vec<Frames>,
    /// Place of the channel and first station of each block; fixed, so that sums do not depend on the number of threads.
    blocks: Vec<(usize, usize)>,
    /// Prior means of the offsets, and their precision: `Σ precision (x − expected)²` is added to the cost.
    pub(super) expected: DVector<f64>,
    pub(super) precision: DVector<f64>,
    /// Known distances between targets, which are added to the cost like the prior.
    distances: Vec<distances::Row>,
}

#[derive(Debug)]
struct Measuring {
    chain: Chain,
    columns: Vec<Option<usize>>,
    stations: Stations,
    gauge: Option<Reads>,
}

/// A source that reads a length: what it starts from, and its parts among the unknowns.
#[derive(Debug)]
struct Reads {
    start: Gauge,
    /// Place of each part in the vector of unknowns; empty where they are fixed.
    parts: Vec<usize>,
}

#[derive(Debug, Clone)]
pub struct Normal {
    /// `Jᵀ W J`.
    pub information: DMatrix<f64>,
    /// `Jᵀ W r`.
    pub gradient: DVector<f64>,
}

impl<'a> Problem<'a> {
    /// A problem on `observations` of `starts.len()` sessions, around `arm` and the starting frames.
    pub fn new(
        observations: &'a [Observation],
        arm: &Chain,
        starts: &[Frames],
        freedom: Freedom,
        prior: &Prior,
    ) -> Self {
        Self::with_target_turn(observations, arm, starts, freedom, prior, is_turned(observations))
    }

    /// [`Self::new`] with the target's orientation free or fixed as stated, for predictions without observations.
    pub(super) fn with_target_turn(
        observations: &'a [Observation],
        arm: &Chain,
        starts: &[Frames],
        freedom: Freedom,
        prior: &Prior,
        turned: bool,
    ) -> Self {
        let unknowns = unknowns(arm, starts, freedom, turned);
        let channels = PerChannel::new(starts, |channel| {
            let pair = starts[channel.session].pair(channel.source, channel.target);
            let chain = measurement_chain(arm, &pair, turned);
            let place = |parameter: &Parameter| {
                let wanted = Unknown::of(channel, *parameter);
                unknowns.iter().position(|unknown| *unknown == wanted)
            };
            Measuring {
                gauge: Reads::of(channel, starts, &unknowns),
                columns: chain.parameters().iter().map(place).collect(),
                stations: Stations::of(channel, observations, arm.joint_count()),
                chain,
            }
        });
        let own = |unknown: &Unknown| {
            prior.of(*unknown, starts).map_or((0.0, 0.0), |(mean, sd)| (mean, sd.powi(-2)))
        };
        let priors: Vec<_> = unknowns.iter().map(own).collect();
        let column = |pick: fn(&(f64, f64)) -> f64| {
            DVector::from_iterator(priors.len(), priors.iter().map(pick))
        };
        let (expected, precision) = (column(|prior| prior.0), column(|prior| prior.1));
        let blocks = channels.each().iter().enumerate().flat_map(|(place, channel)| {
            let firsts = (0..channel.stations.places.len()).step_by(BLOCK);
            firsts.map(move |first| (place, first))
        });
        Self {
            distances: distances::Row::all(&prior.distances, &unknowns, starts),
            observations,
            starts: starts.to_vec(),
            blocks: blocks.collect(),
            channels,
            expected,
            precision,
            unknowns,
        }
    }

    /// [`Self::with_target_turn`] with free geometry, as the full error model has it.
    pub(super) fn of_geometry(
        observations: &'a [Observation],
        arm: &Arm,
        starts: &[Frames],
        prior: &Prior,
        turned: bool,
    ) -> Self {
        Self::with_target_turn(observations, arm.chain(), starts, Freedom::Geometry, prior, turned)
    }

    /// The rows of the known distances at `offsets`, whitened.
    pub(super) fn distances(&self, offsets: &DVector<f64>) -> impl Iterator<Item = DistanceRow> {
        self.distances.iter().map(|row| row.at(offsets))
    }

    /// Whether there is no prior, and no known distance.
    pub(super) fn is_free(&self) -> bool {
        self.precision.amax() == 0.0 && self.distances.is_empty()
    }

    /// The prior's part of the cost's gradient at `offsets`, halved: `P (expected − x)`, and `Jᵀ r` of the known distances.
    pub(super) fn prior_pull(&self, offsets: &DVector<f64>) -> DVector<f64> {
        let mut pull = self.precision.component_mul(&(&self.expected - offsets));
        self.distances(offsets).for_each(|row| row.add_gradient(&mut pull));
        pull
    }

    pub(super) fn prior_cost(&self, offsets: &DVector<f64>) -> f64 {
        let away = offsets - &self.expected;
        let distances: f64 = self.distances(offsets).map(|row| row.residual.powi(2)).sum();
        self.precision.dot(&away.component_mul(&away)) + distances
    }

    /// `s⁻² Jᵀ W J + P` at `offsets` from the readings' `Jᵀ W J` and the variance factor `s²`; P holds the known distances too.
    pub(super) fn posterior_information(
        &self,
        information: &DMatrix<f64>,
        offsets: &DVector<f64>,
        factor: f64,
    ) -> DMatrix<f64> {
        let mut matrix = information / factor;
        for i in 0..self.precision.len() {
            matrix[(i, i)] += self.precision[i];
        }
        self.distances(offsets).for_each(|row| row.add_information(&mut matrix));
        matrix
    }

    pub(super) fn row_count(&self) -> usize {
        self.observations.iter().map(|o| o.measured.kind().rows()).sum()
    }

    /// Whether each axis variable is the position of a joint that slides; empty without a session.
    pub(in crate::fit) fn slides(&self) -> Vec<bool> {
        let mut channels = self.channels.each().iter();
        channels.next().map_or_else(Vec::new, |own| own.chain.slides())
    }

    /// Each channel's measurement chain, from the source's frame to the target, at `offsets`.
    pub fn held(&self, offsets: &DVector<f64>) -> PerChannel<HeldChain> {
        PerChannel::new(&self.starts, |channel| {
            let own = self.channels.of(channel);
            HeldChain::new(&own.chain, &own.local(offsets), &own.columns)
        })
    }

    pub fn norms(&self, offsets: &DVector<f64>) -> Vec<f64> {
        let mut norms = vec![0.0; self.observations.len()];
        for own in self.channels.each() {
            let (chain, gauge) = (own.batch(offsets), own.gauge(offsets));
            let squared = own.stations.squared_norms(&chain, self.observations, gauge.as_ref());
            for (&place, squared) in own.stations.places.iter().zip(squared) {
                norms[place] = squared.sqrt();
            }
        }
        norms
    }

    /// Root mean square of measured minus predicted position over all observations of positions, per axis, mm; of measured minus
    /// predicted length where there are none.
    pub fn misfit_mm(&self, offsets: &DVector<f64>) -> f64 {
        let squares = |of_lengths: bool| {
            let (mut sum, mut count) = (0.0, 0);
            let channels = self.channels.each().iter();
            for own in channels.filter(|own| own.gauge.is_some() == of_lengths) {
                let gauge = own.gauge(offsets);
                own.stations.add_squares(&own.batch(offsets), gauge.as_ref(), &mut sum);
                count += if of_lengths { 1 } else { 3 } * own.stations.places.len();
            }
            (sum, count)
        };
        let of_places = squares(false);
        let (sum, count) = if of_places.1 == 0 { squares(true) } else { of_places };
        (sum / count.max(1) as f64).sqrt()
    }

    /// The instrument of a channel's source at `offsets`; `None` of a source that reads places.
    pub(super) fn gauge(&self, channel: Channel, offsets: &DVector<f64>) -> Option<Gauge> {
        self.channels.of(channel).gauge(offsets)
    }

    /// The parts of a channel's instrument of one length among the unknowns, and the change of its reading on a target at `place` by
    /// each; none of a source that reads places.
    pub(super) fn by_parts(
        &self,
        channel: Channel,
        gauge: Option<&Gauge>,
        place: &Point3<f64>,
    ) -> Vec<(usize, f64)> {
        let own = self.channels.of(channel).gauge.as_ref();
        let (Some(own), Some(gauge)) = (own, gauge) else { return Vec::new() };
        let parts = own.parts.iter().zip(gauge.parts());
        parts.map(|(unknown, part)| (*unknown, gauge.by_part(*part, place))).collect()
    }

    /// The weighted normal equations at `offsets`, one weight per observation.
    pub fn normal(&self, offsets: &DVector<f64>, weights: &[f64]) -> Normal {
        let chains = self.with_columns(offsets);
        let gram = |rows: &mut BlockRows, block: &(usize, usize)| {
            self.fill(rows, *block, &chains, weights);
            (rows.unknowns.clone(), rows.gram())
        };
        let grams: Vec<_> = self.blocks.par_iter().map_init(BlockRows::default, gram).collect();
        let size = self.unknowns.len();
        let mut information = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        for (unknowns, gram) in grams {
            let last = unknowns.len();
            for (column, &unknown) in unknowns.iter().enumerate() {
                gradient[unknown] += gram[(last, column)];
                for (row, &other) in unknowns.iter().enumerate().skip(column) {
                    let lower = (unknown.max(other), unknown.min(other));
                    information[lower] += gram[(row, column)];
                }
            }
        }
        information.fill_upper_triangle_with_lower_triangle();
        Normal { information, gradient }
    }

    /// Passes the whitened rows at `offsets` to `take`, block by block in a fixed order, without robust weights.
    pub(super) fn each_block(&self, offsets: &DVector<f64>, mut take: impl FnMut(&BlockRows)) {
        let chains = self.with_columns(offsets);
        let weights = vec![1.0; self.observations.len()];
        let mut rows = BlockRows::default();
        for block in &self.blocks {
            self.fill(&mut rows, *block, &chains, &weights);
            take(&rows);
        }
    }

    fn fill(
        &self,
        rows: &mut BlockRows,
        (place, first): (usize, usize),
        chains: &[Predicting],
        weights: &[f64],
    ) {
        let own = &self.channels.each()[place];
        let (chain, gauge) = &chains[place];
        match (gauge, &own.gauge) {
            (Some(gauge), Some(reads)) => {
                let gauge = (gauge, &reads.parts[..]);
                rows.fill_lengths(chain, weights, &own.stations, first, gauge);
            }
            _ => rows.fill(chain, self.observations, weights, &own.stations, first),
        }
    }

    fn with_columns(&self, offsets: &DVector<f64>) -> Vec<Predicting> {
        let at = |own: &Measuring| {
            let chain = BatchColumns::new(&own.chain, &own.local(offsets), &own.columns);
            (chain, own.gauge(offsets))
        };
        self.channels.each().iter().map(at).collect()
    }

    /// The frames of each session with `offsets` applied.
    pub fn frames(&self, offsets: &DVector<f64>) -> Vec<Frames> {
        (0..self.starts.len()).map(|session| self.session_frames(session, offsets)).collect()
    }

    /// The geometry's offsets in the order of the arm's own chain; zeros where geometry was fixed.
    pub fn geometry(&self, offsets: &DVector<f64>) -> Vec<f64> {
        let Some(any) = self.channels.each().first() else { return Vec::new() };
        let places = any.chain.parameters().into_iter().zip(&any.columns);
        let links = places.filter(|(parameter, _)| matches!(parameter, Parameter::Link { .. }));
        links.map(|(_, place)| place.map_or(0.0, |place| offsets[place])).collect()
    }

    fn session_frames(&self, session: usize, offsets: &DVector<f64>) -> Frames {
        let offset = |owner, parameter| {
            let unknown = Unknown { owner, parameter };
            let place = self.unknowns.iter().position(|u| *u == unknown);
            place.map_or(0.0, |place| offsets[place])
        };
        let moved = |owner, of: fn(Motion) -> Parameter, motions: fn(Axis) -> Motion| {
            Axis::ALL.iter().fold(Isometry3::identity(), |end, &axis| {
                end * motions(axis).by(offset(owner, of(motions(axis))))
            })
        };
        let start = &self.starts[session];
        let sources = start.sources().iter().enumerate().map(|(source, start)| {
            let source = SourceId(source);
            let owner = Owner::Source { session, source };
            let base = moved(owner, Parameter::Base, Motion::Translation)
                * moved(owner, Parameter::Base, Motion::Rotation);
            Transform::claim(start.isometry() * base)
        });
        let targets = start.targets().iter().enumerate().map(|(target, start)| {
            let target = TargetId(target);
            let owner = Owner::Target { session, target };
            let shift = moved(owner, Parameter::Target, Motion::Translation);
            let turn = moved(owner, Parameter::Target, Motion::Rotation);
            // The shift is along the flange's axes, the turn about the target's own.
            Transform::claim(shift * start.isometry() * turn)
        });
        let sees = start.sees().iter().enumerate().map(|(source, sees)| {
            let source = SourceId(source);
            let owner = Owner::Source { session, source };
            match sees {
                Sees::Length(gauge) => {
                    let moved = gauge.moved(|part| offset(owner, Parameter::Gauge(part)));
                    Sees::Length(moved.as_start())
                }
                Sees::Places | Sees::Nothing => *sees,
            }
        });
        let sees: Vec<Sees> = sees.collect();
        Frames::new(sources.collect(), targets.collect())
            .expect("as many of each as the frames it started from")
            .seeing(&sees)
    }
}

impl Reads {
    /// The instrument of a channel's source; `None` of a source that reads no length.
    fn of(channel: Channel, starts: &[Frames], unknowns: &[Unknown]) -> Option<Self> {
        let start = *starts[channel.session].gauge(channel.source)?;
        let place = |&part: &GaugePart| {
            let wanted = Unknown::of(channel, Parameter::Gauge(part));
            unknowns.iter().position(|unknown| *unknown == wanted)
        };
        Some(Self { parts: start.parts().iter().filter_map(place).collect(), start })
    }
}

/// The chain of a channel, and the instrument at its end where that reads a length.
type Predicting = (BatchColumns, Option<Gauge>);

impl Measuring {
    fn gauge(&self, offsets: &DVector<f64>) -> Option<Gauge> {
        let reads = self.gauge.as_ref()?;
        let place = |part| reads.start.parts().iter().position(|own| *own == part);
        let offset = |part| place(part).and_then(|place| reads.parts.get(place));
        Some(reads.start.moved(|part| offset(part).map_or(0.0, |&at| offsets[at])))
    }

    fn batch(&self, offsets: &DVector<f64>) -> BatchChain {
        BatchChain::new(&self.chain, &self.local(offsets))
    }

    /// The offsets of the chain's own free parameters.
    fn local(&self, offsets: &DVector<f64>) -> Vec<f64> {
        self.columns.iter().map(|place| place.map_or(0.0, |place| offsets[place])).collect()
    }
}

/// Whether any orientation is measured, so that a target's own orientation is looked for.
pub(super) fn is_turned(observations: &[Observation]) -> bool {
    widest(observations.iter().map(|o| &o.measured)) == ReadingKind::Pose
}

/// The unknowns in the vector's order: the arm's, then session by session base of each source and place of each target.
fn unknowns(arm: &Chain, starts: &[Frames], freedom: Freedom, turned: bool) -> Vec<Unknown> {
    let mut unknowns = Vec::new();
    if freedom == Freedom::Geometry {
        let links = arm.parameters().into_iter();
        unknowns.extend(links.map(|parameter| Unknown { owner: Owner::Arm, parameter }));
    }
    let shifts = Axis::ALL.map(Motion::Translation);
    let turns = Axis::ALL.map(Motion::Rotation);
    let of_target = if turned { &turns[..] } else { &[] };
    for (session, frames) in starts.iter().enumerate() {
        for source in (0..frames.sources().len()).map(SourceId) {
            let owner = Owner::Source { session, source };
            let own = |parameter| Unknown { owner, parameter };
            match &frames.sees()[source.0] {
                Sees::Places => {
                    let motions = shifts.iter().chain(&turns);
                    unknowns.extend(motions.map(|motion| own(Parameter::Base(*motion))));
                }
                Sees::Length(gauge) => {
                    unknowns.extend(gauge.parts().iter().map(|part| own(Parameter::Gauge(*part))));
                }
                Sees::Nothing => {}
            }
        }
        if freedom == Freedom::Base {
            continue;
        }
        for target in (0..frames.targets().len()).map(TargetId) {
            let owner = Owner::Target { session, target };
            let own = |motion: &Motion| Unknown { owner, parameter: Parameter::Target(*motion) };
            unknowns.extend(shifts.iter().chain(of_target).map(own));
        }
    }
    unknowns
}

/// `tracker_from_base · (six small motions) · arm · (three small shifts) · flange_from_target · (three small turns)`.
pub(super) fn measurement_chain(arm: &Chain, frames: &FramePair, turned: bool) -> Chain {
    let free = |of: fn(Motion) -> Parameter, motion| Element::Free {
        motion,
        nominal: 0.0,
        parameter: of(motion),
    };
    let shifts = |of| Axis::ALL.map(|axis| free(of, Motion::Translation(axis)));
    let turns = |of| Axis::ALL.map(|axis| free(of, Motion::Rotation(axis)));
    let mut before = vec![Element::Fixed(*frames.tracker_from_base.isometry())];
    before.extend(shifts(Parameter::Base));
    before.extend(turns(Parameter::Base));
    let mut after = Vec::from(shifts(Parameter::Target));
    after.push(Element::Fixed(*frames.flange_from_target.isometry()));
    if turned {
        after.extend(turns(Parameter::Target));
    }
    arm.extended(before, after)
}
