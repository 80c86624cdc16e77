//! The figures of a run that the history compares, kept when it is published ([`Kept::of_run`]): some ten kilobytes, where the tables
//! `calibrations` and `accuracy` that they follow from have megabytes. They name the digests of both files, so they count only where the
//! row of `runs` has these. [`super::Asked::fresh`] reads the tables themselves.

use serde::{Deserialize, Serialize};

use super::rows::Fact;
use super::session::{estimate, figures, noticed};
use crate::history::AccuracyFigure;
use crate::history::estimate::Estimate;
use crate::history::notice::Noticed;
use crate::io::lake::{Lake, LakeError, figures_key};
use crate::io::table::{Row as _, Table, Word as _};
use crate::io::tables::clocks::ClockRow;
use crate::manifest::{RunKey, Work, Written};

/// The tables that figures are of.
pub(super) const OF: [&str; 2] = ["calibrations", "accuracy"];

/// The figures of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::pipeline) struct Kept {
    /// Digests of the files that they are of, in the order of [`OF`].
    of: [String; 2],
    /// First stamp of the controller's log.
    pub(super) measured_at_ns: i64,
    /// The model that identified the arm.
    pub(super) model: String,
    /// The identified offsets.
    pub(super) estimate: Estimate,
    /// The accuracy figures that are charted.
    pub(super) accuracy: Vec<AccuracyFigure>,
    /// The size from which a change counts.
    pub(super) noticed: Option<Noticed>,
}

impl Kept {
    /// The figures in a session's tables; or, as text, why there are none.
    pub(super) fn of(
        [calibrations, accuracy]: [&Table; 2],
        of: [String; 2],
        measured_at_ns: i64,
        session: &str,
    ) -> Result<Self, String> {
        let (model, estimate) = estimate(calibrations)
            .map_err(|reason| format!("table calibrations of {session}: {reason}"))?;
        Ok(Self {
            of,
            measured_at_ns,
            model: model.word().to_owned(),
            noticed: noticed(calibrations, accuracy, session, &estimate),
            accuracy: figures(accuracy, session),
            estimate,
        })
    }

    /// The figures of a run that writes these tables; `None` of one that learnt from several sessions, or has none.
    pub(in crate::pipeline) fn of_run<'t>(
        work: &Work,
        tables: impl Iterator<Item = &'t Table>,
        written: &[Written],
    ) -> Option<Self> {
        let key = work.key();
        if work.sessions != [key.session.as_str()] {
            return None;
        }
        let own: Vec<&Table> = tables.filter(|table| table.key() == Some(&key)).collect();
        let named = |name: &str| own.iter().copied().find(|table| table.schema().table == name);
        let digest = |name: &str| {
            let is_own = |file: &&Written| file.table == name && file.session == key.session;
            Some(written.iter().find(is_own)?.digest.clone())
        };
        let clock = ClockRow::read(named("clocks")?).into_iter().next()?;
        let tables = [named(OF[0])?, named(OF[1])?];
        let of = [digest(OF[0])?, digest(OF[1])?];
        Self::of(tables, of, clock.origin_ns, &key.session).ok()
    }

    /// Reads the kept figures of a run whose row states these digests of its files; `None` where there are none or they are of others.
    pub(super) fn read(lake: &Lake, key: &RunKey, of: &[String; 2]) -> Option<Self> {
        let kept: Self = serde_json::from_str(&lake.kept(&figures_key(key).ok()?)?).ok()?;
        (kept.of == *of).then_some(kept)
    }

    /// Keeps them.
    pub(in crate::pipeline) fn write(&self, lake: &Lake, key: &RunKey) -> Result<(), LakeError> {
        let text = serde_json::to_string(self).expect("texts and numbers");
        lake.keep(&figures_key(key)?, &text)
    }

    /// Those of a session whose row states these facts.
    pub(super) fn of_fact(lake: &Lake, fact: &Fact) -> Option<Self> {
        Self::read(lake, &fact.key, &fact.tables)
    }
}
