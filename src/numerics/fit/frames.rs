//! The frames of a session: one for each of its sources, one place at the flange for each of its targets.

use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::gauge::{Gauge, Sees};
use crate::geometry::{Base, Flange, Target, Tracker, Transform, align};
use crate::join::SeveralSources;

pub use crate::join::{SourceId, TargetId};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    pub session: usize,
    pub source: SourceId,
    pub target: TargetId,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    sources: Vec<Transform<Tracker, Base>>,
    /// What each source reads; of one that reads a length, or nothing, the frame is the base's.
    sees: Vec<Sees>,
    targets: Vec<Transform<Flange, Target>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePair {
    pub source: SourceId,
    pub target: TargetId,
    pub tracker_from_base: Transform<Tracker, Base>,
    /// Pose of the target on the flange, mm; rotated only where orientations are measured.
    pub flange_from_target: Transform<Flange, Target>,
}

impl FramePair {
    pub const fn only(
        tracker_from_base: Transform<Tracker, Base>,
        flange_from_target: Transform<Flange, Target>,
    ) -> Self {
        Self {
            source: SourceId::ONLY,
            target: TargetId::ONLY,
            tracker_from_base,
            flange_from_target,
        }
    }
}

/// The flange's orientation as several targets show it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFlange {
    /// The rotation from the flange's axes to the source's.
    pub orientation: UnitQuaternion<f64>,
    /// The places of all targets on the flange by which it holds, mm.
    pub places: Arc<[Point3<f64>]>,
}

impl MeasuredFlange {
    /// The orientation by other places of the targets, those of another model: what turns these places onto its own comes first.
    pub fn by_places(&self, frames: &Frames) -> UnitQuaternion<f64> {
        let others = frames.places();
        let own = align(&self.places, &others, &vec![1.0; others.len()]);
        own.map_or(self.orientation, |own| self.orientation * own.rotation)
    }
}

impl From<FramePair> for Frames {
    /// The frames of a session in which the pair's source and target are the only ones.
    fn from(pair: FramePair) -> Self {
        Self {
            sources: vec![pair.tracker_from_base],
            sees: vec![Sees::Places],
            targets: vec![pair.flange_from_target],
        }
    }
}

impl Frames {
    /// The base in the frame of each source and the place of each target, in their order; `None` where there is none of either.
    pub fn new(
        sources: Vec<Transform<Tracker, Base>>,
        targets: Vec<Transform<Flange, Target>>,
    ) -> Option<Self> {
        let whole = !sources.is_empty() && !targets.is_empty();
        let sees = vec![Sees::Places; sources.len()];
        whole.then_some(Self { sources, sees, targets })
    }

    /// The frames where each source reads what `sees` says, in their order. The frame of one that reads no places becomes the base's.
    #[must_use]
    pub fn seeing(mut self, sees: &[Sees]) -> Self {
        for ((own, frame), sees) in self.sees.iter_mut().zip(&mut self.sources).zip(sees) {
            *own = *sees;
            if *sees != Sees::Places {
                *frame = Transform::identity();
            }
        }
        self
    }

    pub fn sees(&self) -> &[Sees] {
        &self.sees
    }

    pub fn gauge(&self, source: SourceId) -> Option<&Gauge> {
        self.sees.get(source.0)?.gauge()
    }

    pub fn sources(&self) -> &[Transform<Tracker, Base>] {
        &self.sources
    }

    pub fn targets(&self) -> &[Transform<Flange, Target>] {
        &self.targets
    }

    pub fn tracker_from_base(&self, source: SourceId) -> &Transform<Tracker, Base> {
        &self.sources[source.0]
    }

    pub fn flange_from_target(&self, target: TargetId) -> &Transform<Flange, Target> {
        &self.targets[target.0]
    }

    pub fn pair(&self, source: SourceId, target: TargetId) -> FramePair {
        FramePair {
            source,
            target,
            tracker_from_base: *self.tracker_from_base(source),
            flange_from_target: *self.flange_from_target(target),
        }
    }

    /// The frames of the only source and the only target; `None` where the session has several, or its source reads one length.
    pub fn one(&self) -> Option<FramePair> {
        match (&self.sources[..], &self.targets[..]) {
            ([source], [target]) if self.sees[0] == Sees::Places => {
                Some(FramePair::only(*source, *target))
            }
            _ => None,
        }
    }

    /// The frames of the main source and the first target, by which errors of one tool point are stated; an error where several
    /// sources read places. The main source is the first: that of places, where there is one.
    pub fn main(&self) -> Result<FramePair, SeveralSources> {
        match self.sees.iter().filter(|own| **own == Sees::Places).count() {
            0 | 1 => Ok(self.pair(SourceId::ONLY, TargetId::MAIN)),
            sources => Err(SeveralSources { sources }),
        }
    }

    /// Places of the targets on the flange, mm.
    pub fn places(&self) -> Arc<[Point3<f64>]> {
        let places = self.targets.iter();
        places.map(|target| Point3::from(target.isometry().translation.vector)).collect()
    }

    pub fn has_several_targets(&self) -> bool {
        self.targets.len() > 1
    }

    pub(super) fn channels(&self, session: usize) -> impl Iterator<Item = Channel> + use<> {
        let (sources, targets) = (self.sources.len(), self.targets.len());
        (0..sources).flat_map(move |source| {
            (0..targets).map(move |target| Channel {
                session,
                source: SourceId(source),
                target: TargetId(target),
            })
        })
    }
}

/// A value for each channel of several sessions: session by session, source by source, target by target.
#[derive(Debug, Clone)]
pub struct PerChannel<T> {
    each: Vec<T>,
    /// Index of each session's first channel, and the session's number of targets.
    sessions: Vec<(usize, usize)>,
}

impl<T> PerChannel<T> {
    /// The values that `of` returns for each channel of the sessions with these frames.
    pub(super) fn new(frames: &[Frames], of: impl FnMut(Channel) -> T) -> Self {
        let channels = frames.iter().enumerate();
        let channels = channels.flat_map(|(session, frames)| frames.channels(session));
        let mut first = 0;
        let sessions = frames.iter().map(|frames| {
            let own = (first, frames.targets.len());
            first += frames.sources.len() * frames.targets.len();
            own
        });
        Self { sessions: sessions.collect(), each: channels.map(of).collect() }
    }

    pub fn of(&self, channel: Channel) -> &T {
        let (first, targets) = self.sessions[channel.session];
        &self.each[first + channel.source.0 * targets + channel.target.0]
    }

    pub(super) fn each(&self) -> &[T] {
        &self.each
    }
}
