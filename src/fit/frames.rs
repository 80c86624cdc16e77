//! The frames of a session: one for each of its sources, one place at the flange for each of its targets.

use crate::geometry::{Base, Flange, Target, Tracker, Transform};
use crate::join::Several;

pub use crate::join::{SourceId, TargetId};

/// One source of a session seeing one target: both ends of a measurement chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Which of the fit's sessions, from 0.
    pub session: usize,
    /// Which of its sources.
    pub source: SourceId,
    /// Which of its targets.
    pub target: TargetId,
}

/// The frames of one session that a fit finds.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    sources: Vec<Transform<Tracker, Base>>,
    targets: Vec<Transform<Flange, Target>>,
}

/// The two frames of one channel, and which source and target they are of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePair {
    /// The source whose frame it is.
    pub source: SourceId,
    /// The target whose place it is.
    pub target: TargetId,
    /// Where the base stands in the source's frame.
    pub tracker_from_base: Transform<Tracker, Base>,
    /// Where the target sits at the flange; turned only where orientations are measured.
    pub flange_from_target: Transform<Flange, Target>,
}

impl FramePair {
    /// Of a session with one source and one target.
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

impl From<FramePair> for Frames {
    /// The frames of a session in which the pair's source and target are the only ones.
    fn from(pair: FramePair) -> Self {
        Self {
            sources: vec![pair.tracker_from_base],
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
        whole.then_some(Self { sources, targets })
    }

    /// Where the base stands in the frame of each source.
    pub fn sources(&self) -> &[Transform<Tracker, Base>] {
        &self.sources
    }

    /// Where each target sits at the flange; turned only where orientations are measured.
    pub fn targets(&self) -> &[Transform<Flange, Target>] {
        &self.targets
    }

    /// Where the base stands in the frame of a source.
    ///
    /// # Panics
    /// When the session has no such source.
    pub fn tracker_from_base(&self, source: SourceId) -> &Transform<Tracker, Base> {
        &self.sources[source.0]
    }

    /// Where a target sits at the flange.
    ///
    /// # Panics
    /// When the session has no such target.
    pub fn flange_from_target(&self, target: TargetId) -> &Transform<Flange, Target> {
        &self.targets[target.0]
    }

    /// The frames between which `source` sees `target`.
    ///
    /// # Panics
    /// When the session has no such source or target.
    pub fn pair(&self, source: SourceId, target: TargetId) -> FramePair {
        FramePair {
            source,
            target,
            tracker_from_base: *self.tracker_from_base(source),
            flange_from_target: *self.flange_from_target(target),
        }
    }

    /// The one source's and the one target's frames, for work that is for one tool point seen by one instrument; refused where the
    /// session has several.
    pub fn one(&self) -> Result<FramePair, Several> {
        match (&self.sources[..], &self.targets[..]) {
            ([source], [target]) => Ok(FramePair::only(*source, *target)),
            (sources, targets) => Err(Several {
                sources: sources.len(),
                targets: targets.len(),
            }),
        }
    }

    /// Every source with every target, sources first.
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

/// Something for each channel of several sessions: session by session, source by source, target by target.
#[derive(Debug, Clone)]
pub struct PerChannel<T> {
    each: Vec<T>,
    /// Where each session's first channel stands, and how many targets the session has.
    sessions: Vec<(usize, usize)>,
}

impl<T> PerChannel<T> {
    /// What `of` makes of each channel of the sessions with these frames.
    pub(super) fn new(frames: &[Frames], of: impl FnMut(Channel) -> T) -> Self {
        let channels = frames.iter().enumerate();
        let channels = channels.flat_map(|(session, frames)| frames.channels(session));
        let mut first = 0;
        let sessions = frames.iter().map(|frames| {
            let own = (first, frames.targets.len());
            first += frames.sources.len() * frames.targets.len();
            own
        });
        Self {
            sessions: sessions.collect(),
            each: channels.map(of).collect(),
        }
    }

    /// What there is for a channel.
    ///
    /// # Panics
    /// When there is no such session, source or target.
    pub fn of(&self, channel: Channel) -> &T {
        let (first, targets) = self.sessions[channel.session];
        &self.each[first + channel.source.0 * targets + channel.target.0]
    }

    /// All, in the order of channels.
    pub(super) fn each(&self) -> &[T] {
        &self.each
    }
}
