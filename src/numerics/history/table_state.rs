//! Whether a table still holds, decided by a session that it drove.
//!
//! Inputs: the promise of the table's run compared with the errors measured after ([`PromiseKept`]), the way the corrections were
//! applied, conditions of the session that the table is not valid for, and the arm as the table's run and the session
//! identified it. Output: a [`TableState`]. Steps:
//! 1. a table used outside its validity is reported as such, whatever was measured;
//! 2. corrections that were not applied as meant show nothing about the table, and neither do too few stations;
//! 3. a promise that the binomial interval contradicts has expired. The base of a driven session is found from its
//!    first stations, so its place does not matter; a motion since then is reported where a motion of the base at some
//!    station explains most of the remaining errors and removes the contradiction ([`base_motion`]);
//! 4. otherwise both estimates of the arm are compared with their covariances ([`super::between`]); so they are where the
//!    promise is kept, since a part may have moved by little compared with the promised bound.

use std::fmt;

use super::hypotheses::{Finding, Hypothesis};
use super::{FALSE_ALARM, Judged};
use crate::compensation::validity::Outside;
use crate::figures::{Coverage, least_count};
use crate::report::ResidualSet;
use crate::report::driven::{Application, BaseMotion, base_motion, kept};
use crate::report::promise::{Promise, PromiseKept};
use crate::units::whole;

#[derive(Debug, Clone, PartialEq)]
pub enum TableState {
    /// Enough stations were measured after, and they do not contradict the promise; it covers any part that moved.
    Holds(Drifted),
    /// Its promise is contradicted: something has drifted or was changed.
    Expired(Drifted),
    Outside {
        terms: Vec<Outside>,
        /// Whether its promise is contradicted; `None` where it could not be compared with the session.
        broken: Option<bool>,
    },
    NotShown(NotShown),
}

#[derive(Debug, Clone, PartialEq)]
pub enum Drifted {
    Base(BaseMotion),
    Parts(Box<Judged>),
    Nothing,
    Untold(String),
}

#[derive(Debug, Clone, PartialEq)]
pub enum NotShown {
    NoRun,
    Unreadable(String),
    NoPromise,
    NoBase,
    Misapplied,
    TooFew { judged: usize, needed: usize },
}

/// The evidence of a session about the table that drove it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown<'s> {
    pub application: &'s Application,
    /// The promise of the table's run, or the reason why there is none to compare.
    pub promise: Result<&'s Promise, NotShown>,
    /// Errors after compensation, attained minus target position; `None` where the stations do not span space.
    pub after: Option<&'s ResidualSet>,
    pub outside: Vec<Outside>,
}

impl Shown<'_> {
    /// The table's state; `compare` compares the two estimates of the arm, or returns the reason why it cannot.
    pub fn state(&self, compare: impl FnOnce() -> Result<Judged, String>) -> TableState {
        let kept = self.kept();
        if !self.outside.is_empty() {
            return TableState::Outside {
                terms: self.outside.clone(),
                broken: kept.ok().map(|kept| kept.is_broken()),
            };
        }
        let kept = match kept {
            Ok(kept) => kept,
            Err(why) => return TableState::NotShown(why),
        };
        if kept.is_broken() {
            return TableState::Expired(self.drifted(&kept.promise, compare));
        }
        let (judged, needed) = (kept.counted.poses, needed(&kept.promise));
        if judged < needed {
            return TableState::NotShown(NotShown::TooFew { judged, needed });
        }
        TableState::Holds(arm_drifted(compare()))
    }

    /// The promise compared with the stations that judge, or the reason why it is not.
    pub fn kept(&self) -> Result<PromiseKept, NotShown> {
        let promise = self.promise.clone()?;
        let misapplied = matches!(
            self.application,
            Application::Not
                | Application::WrongSign(_)
                | Application::Twice(_)
                | Application::Turned { .. }
        );
        if misapplied {
            return Err(NotShown::Misapplied);
        }
        kept(*promise, self.after.ok_or(NotShown::NoBase)?).ok_or(NotShown::NoBase)
    }

    fn drifted(
        &self,
        promise: &Promise,
        compare: impl FnOnce() -> Result<Judged, String>,
    ) -> Drifted {
        if let Some(motion) = self.after.and_then(|after| during_session(promise, after)) {
            return Drifted::Base(motion);
        }
        arm_drifted(compare())
    }
}

fn arm_drifted(compared: Result<Judged, String>) -> Drifted {
    match compared {
        Err(why) => Drifted::Untold(why),
        Ok(judged) if of_the_arm(&judged.finding) => Drifted::Parts(Box::new(judged)),
        Ok(_) => Drifted::Nothing,
    }
}

/// Whether parts other than the base moved. The base is found anew in every session, so a change of it alone does not count.
fn of_the_arm(finding: &Finding) -> bool {
    match finding {
        Finding::Nothing => false,
        Finding::Moved { surely, one_of } => {
            surely.iter().any(|part| *part != Hypothesis::Base)
                || !(one_of.is_empty() || one_of.contains(&Hypothesis::Base))
        }
    }
}

/// A motion of the base during the session has to explain this share of the sum of squared errors.
const MOST: f64 = 0.5;

/// The motion of the base during the session, if it explains the contradiction of the promise.
fn during_session(promise: &Promise, after: &ResidualSet) -> Option<BaseMotion> {
    let (own, motion) = base_motion(after)?;
    let squares = |set: &ResidualSet| -> f64 {
        set.residuals.iter().filter(|r| !r.used_for_refit).map(|r| r.residual.norm_squared()).sum()
    };
    let most = squares(&own) < (1.0 - MOST) * squares(after);
    (most && !kept(*promise, &own)?.is_broken()).then_some(motion)
}

/// The least number of poses that can show the promise's share with its confidence.
fn needed(promise: &Promise) -> usize {
    whole(least_count(Coverage { share: promise.share, confidence: promise.confidence }))
}

impl fmt::Display for TableState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Holds(drifted) => {
                f.write_str("the table HOLDS: its promise is not contradicted")?;
                match drifted {
                    Drifted::Nothing => Ok(()),
                    drifted => write!(f, ", {drifted}"),
                }
            }
            Self::Expired(drifted) => write!(
                f,
                "the table has EXPIRED by drift: its promise is contradicted, {drifted}; measure the arm and make a new table"
            ),
            Self::Outside { terms, broken } => {
                let terms: Vec<String> = terms.iter().map(ToString::to_string).collect();
                let promise = match broken {
                    None => "its promise was not compared with the session",
                    Some(true) => "its promise is contradicted",
                    Some(false) => "its promise is nevertheless not contradicted",
                };
                write!(
                    f,
                    "the table DOES NOT HOLD for the conditions of the session: {}; {promise}",
                    terms.join("; ")
                )
            }
            Self::NotShown(why) => write!(f, "whether the table holds is NOT SHOWN: {why}"),
        }
    }
}

impl fmt::Display for Drifted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Base(BaseMotion {
                from_station,
                mm,
                rad,
            }) => write!(
                f,
                "and the base or the tracker moved during the session, by {mm:.3} mm and {:.3} mrad from about station \
                 {from_station} on: with a base of their own later stations keep it",
                1e3 * rad
            ),
            Self::Parts(judged) if judged.finding.parts().contains(&Hypothesis::Anything) => f.write_str(
                "and more parts of the arm differ than can be distinguished: it was changed, or the table is another arm's",
            ),
            Self::Parts(judged) => {
                let moved = judged.in_words().unwrap_or_default();
                write!(f, "and since the table was made {moved}")
            }
            Self::Nothing => write!(
                f,
                "but no part of the arm shows a change (one false alarm in {:.0}): the table promised too much, or the change is \
                 smaller than one session shows",
                1.0 / FALSE_ALARM
            ),
            Self::Untold(why) => write!(f, "and the part that moved cannot be determined: {why}"),
        }
    }
}

impl fmt::Display for NotShown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRun => f.write_str(
                "the lake does not have the table's run, or not its tables with the promise",
            ),
            Self::Unreadable(why) => write!(f, "the table's run cannot be read: {why}"),
            Self::NoPromise => f.write_str("the table's run predicted no bound"),
            Self::NoBase => {
                f.write_str("the stations do not span space, so no error after can be given")
            }
            Self::Misapplied => f.write_str("its corrections were not applied as meant"),
            Self::TooFew { judged, needed } => {
                write!(f, "{judged} poses judge, {needed} are needed for its promise")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Rotation3, Vector3};

    use super::*;
    use crate::compensation::{UsedWith, Validity};
    use crate::report::driven::{DrivenStation, measured};

    const PROMISE: Promise =
        Promise { mean_mm: Some(0.1), bound_mm: Some(0.2), share: 0.95, confidence: 0.95 };
    const MEANT: Application = Application::AsMeant(0.9);

    /// Errors after compensation at `count` stations, the first 50 of which find the base; `left` gives each station's error.
    fn after(count: usize, left: impl Fn(usize, &Point3<f64>) -> Vector3<f64>) -> ResidualSet {
        let station = |station: usize| {
            let [x, y, z] = [station % 5, station / 5 % 5, station / 25].map(|k| 200.0 * k as f64);
            let target = Point3::new(1200.0 + x, y - 400.0, 500.0 + z);
            DrivenStation {
                station,
                pose: station,
                target,
                command: target,
                attained: target + left(station, &target),
                stated: Vector3::zeros(),
                variance_mm2: 3.0,
                turn: None,
            }
        };
        let stations: Vec<DrivenStation> = (0..count).map(station).collect();
        measured(&stations, "tuesday", 50).expect("stations span space").after
    }

    /// An error of 0.1 mm with alternating sign.
    fn small(station: usize) -> Vector3<f64> {
        Vector3::new(0.1, 0.0, 0.0) * if station.is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    fn shown<'s>(after: &'s ResidualSet, application: &'s Application) -> Shown<'s> {
        Shown { application, promise: Ok(&PROMISE), after: Some(after), outside: vec![] }
    }

    fn never() -> Result<Judged, String> {
        panic!("nothing is to be compared")
    }

    #[test]
    fn a_promise_that_is_kept_holds_at_any_place_of_the_base() {
        let moved = after(150, |station, _| small(station) + Vector3::new(3.0, -2.0, 1.0));
        let state = shown(&moved, &MEANT).state(|| Ok(Judged::default()));
        assert_eq!(state, TableState::Holds(Drifted::Nothing));
        let pooled = shown(&moved, &MEANT).state(|| Err("pooled".to_owned()));
        assert!(
            matches!(&pooled, TableState::Holds(Drifted::Untold(_)))
                && pooled.to_string().ends_with("determined: pooled"),
            "{pooled}"
        );
    }

    #[test]
    fn fewer_stations_than_a_promise_needs_show_nothing() {
        let few = after(108, |station, _| small(station));
        // 58 judge; 59 are the least that show 95 % with 95 % confidence.
        let expected = NotShown::TooFew { judged: 58, needed: 59 };
        assert_eq!(shown(&few, &MEANT).state(never), TableState::NotShown(expected));
    }

    #[test]
    fn a_base_that_moves_during_the_session_is_named_with_its_motion() {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 1e-3);
        let moved = after(150, |station, target| {
            let moved = turn * target - target + Vector3::new(0.4, 0.0, 0.0);
            small(station) + if station < 90 { Vector3::zeros() } else { moved }
        });
        let state = shown(&moved, &MEANT).state(never);
        let TableState::Expired(Drifted::Base(motion)) = &state else { panic!("{state}") };
        // The stations are 1.6 m from the base's axis on average, so a milliradian moves them by more than a millimetre.
        assert_eq!(motion.from_station, 90, "{state}");
        assert!((motion.rad - 1e-3).abs() < 1e-4 && motion.mm > 1.0, "{state}");
    }

    #[test]
    fn errors_that_no_motion_of_the_base_explains_are_compared_with_the_arm() {
        // Three times as large with alternating sign: a motion of the base explains nothing of it.
        let worse = after(150, |station, _| small(station) * 3.0);
        let found = |compare: Result<Judged, String>| shown(&worse, &MEANT).state(|| compare);
        let nothing = found(Ok(Judged::default()));
        assert_eq!(nothing, TableState::Expired(Drifted::Nothing));
        let of = |surely: Vec<Hypothesis>| Judged {
            finding: Finding::Moved { surely, one_of: vec![] },
            ..Judged::default()
        };
        // Another place of the base does not matter.
        let base = found(Ok(of(vec![Hypothesis::Base])));
        assert_eq!(base, TableState::Expired(Drifted::Nothing));
        let base_or_link = Judged {
            finding: Finding::Moved {
                surely: vec![],
                one_of: vec![Hypothesis::Base, Hypothesis::Link(1)],
            },
            ..Judged::default()
        };
        let maybe = found(Ok(base_or_link));
        assert_eq!(maybe, TableState::Expired(Drifted::Nothing));
        let joint = found(Ok(of(vec![Hypothesis::Base, Hypothesis::JointOffset(3)])));
        assert!(
            joint.to_string().contains("offset of joint 3")
                && joint.to_string().contains("EXPIRED"),
            "{joint}"
        );
        let untold = found(Err("pooled".to_owned()));
        assert!(untold.to_string().contains("cannot be determined: pooled"));
    }

    #[test]
    fn a_temperature_outside_is_reported_whether_or_not_the_promise_is_kept() {
        let table = Validity { temperature_c: Some([19.0, 21.0]), ..Validity::default() };
        let hot = UsedWith { temperature_c: Some(30.0), ..UsedWith::default() };
        let fine = after(150, |station, _| small(station));
        let shown = Shown { outside: table.hold(&hot).outside, ..shown(&fine, &MEANT) };
        let state = shown.state(never);
        assert!(matches!(&state, TableState::Outside { broken: Some(false), .. }));
        let words = state.to_string();
        assert!(
            words.contains("DOES NOT HOLD") && words.contains("temperature 30 °C, 9.00 °C above"),
            "{words}"
        );
    }

    #[test]
    fn corrections_that_were_not_made_as_meant_show_nothing() {
        let worse = after(150, |station, _| small(station) * 3.0);
        let twice = Application::Twice(0.9);
        assert_eq!(shown(&worse, &twice).state(never), TableState::NotShown(NotShown::Misapplied));
        let no_run = Shown { promise: Err(NotShown::NoRun), ..shown(&worse, &MEANT) };
        assert_eq!(no_run.state(never), TableState::NotShown(NotShown::NoRun));
    }
}
