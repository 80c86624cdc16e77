//! A session that a table drove: the accuracy that the table achieved, how it was applied, whether its promise is kept.
//!
//! Inputs: the corrected targets that were driven ([`CorrectedTarget`]), the session's commands, and the attained positions
//! of its tool point. Outputs are figures *measured after* ([`crate::method::accuracy`]), compared with the promise of the
//! table's own run. Steps:
//! 1. each station's command is matched with the target near it ([`matched`]): nearer than any other by half, so that a
//!    command corrected wrongly is still assigned to its target;
//! 2. the base is found from the session's first stations and their targets, the others judge ([`measured`]);
//! 3. [`application()`] tells from the errors how the corrections were applied;
//! 4. the promised bound is held against the stations that judge ([`PromiseKept`]).

mod application;
mod base_motion;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::promise::{Promise, PromiseKept};
use super::tip::{Turn, without_constant};
use super::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::figures::Figures;
use crate::geometry::align;

pub use application::{Application, application};
pub use base_motion::{BaseMotion, base_motion};

/// A target and the command that a table computed for it, in the frame of commands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CorrectedTarget {
    pub name: String,
    pub target: Point3<f64>,
    pub command: Point3<f64>,
    /// Sum of the correction's variances along three axes, mm²; without a surveyed frame's, as that moves the whole program alike.
    pub variance_mm2: f64,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Matched {
    pub of_command: Vec<Option<usize>>,
    pub far: usize,
    pub between: usize,
}

/// Largest distance of a command from its target, mm: several times the error of an arm.
const FAR_MM: f64 = 10.0;
/// Smallest ratio of the distances to the next target and to the nearest.
const CLEARLY: f64 = 2.0;

/// Matches commands with targets, both in the frame of commands.
pub fn matched(commands: &[Option<Point3<f64>>], targets: &[CorrectedTarget]) -> Matched {
    let mut matched = Matched::default();
    for command in commands {
        let found = command.map(|command| nearest(&command, targets));
        matched.far += usize::from(found == Some(Near::Far));
        matched.between += usize::from(found == Some(Near::Between));
        matched.of_command.push(match found {
            Some(Near::At(place)) => Some(place),
            Some(Near::Far | Near::Between) | None => None,
        });
    }
    matched
}

#[derive(PartialEq)]
enum Near {
    At(usize),
    Between,
    Far,
}

fn nearest(command: &Point3<f64>, targets: &[CorrectedTarget]) -> Near {
    let (mut first, mut second) = ((f64::INFINITY, 0), f64::INFINITY);
    for (place, target) in targets.iter().enumerate() {
        let away = (command - target.target).norm();
        if away < first.0 {
            (first, second) = ((away, place), first.0);
        } else {
            second = second.min(away);
        }
    }
    if first.0 > FAR_MM {
        Near::Far
    } else if second < CLEARLY * first.0 {
        Near::Between
    } else {
        Near::At(first.1)
    }
}

/// One station of a session that a table drove; everything in the base frame of the session's own base + target fit.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivenStation {
    pub station: usize,
    /// Number of the station that names its pose; all visits of one pose share it.
    pub pose: usize,
    pub target: Point3<f64>,
    pub command: Point3<f64>,
    pub attained: Point3<f64>,
    pub stated: Vector3<f64>,
    /// Sum of the correction's variances along three axes, mm²; without a surveyed frame's, as that moves the whole program alike.
    pub variance_mm2: f64,
    /// Attained and commanded orientation of the flange; `None` where one of them is not known.
    pub turn: Option<Turn>,
}

/// The errors of a session that a table drove, both of the tool point and at the same stations.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Attained minus commanded: the errors that the arm would have had at its targets.
    pub before: ResidualSet,
    /// Attained minus target: the errors that the table left.
    pub after: ResidualSet,
}

/// The errors before and after. The base is found from the first `first` stations and their targets, or from half of all
/// stations where there are fewer than twice as many. `None` where these do not span space.
pub fn measured(stations: &[DrivenStation], session: &str, first: usize) -> Option<Measured> {
    let first = first.min(stations.len() / 2);
    let points = |of: fn(&DrivenStation) -> Point3<f64>| {
        stations[..first].iter().map(of).collect::<Vec<_>>()
    };
    let base = align(&points(|s| s.target), &points(|s| s.attained), &vec![1.0; first])?;
    let turns = turns(stations, &base.rotation, first);
    let set = |model, wanted: fn(&DrivenStation) -> Point3<f64>| {
        let residual = |(place, station): (usize, &DrivenStation)| Residual {
            station: station.station,
            pose: station.pose,
            used_for_refit: place < first,
            attained: base * station.attained,
            residual: base * station.attained - wanted(station),
            turn: turns[place],
            ..Residual::default()
        };
        let of = (Split::Session, session);
        ResidualSet {
            subject: Subject::new(of, model, Angles::Commanded, BaseRefit::First),
            residuals: stations.iter().enumerate().map(residual).collect(),
        }
    };
    Some(Measured {
        before: set(Model::RawCommand, |station| station.command),
        after: set(Model::Table, |station| station.target),
    })
}

/// The attained orientations of the flange in the base that was found from the first stations, and the commanded ones.
fn turns(
    stations: &[DrivenStation],
    base: &UnitQuaternion<f64>,
    first: usize,
) -> Vec<Option<Turn>> {
    let turn = |turn: Turn| Turn { attained: base * turn.attained, ..turn };
    let turns: Vec<_> = stations.iter().map(|s| s.turn.map(turn)).collect();
    without_constant(&turns, |place| place < first)
}

/// Holds a promise against the stations that judge; `None` without any. A pose is one of them however often it was visited, and
/// is within the promised bound where its worst visit is.
pub fn kept(promise: Promise, after: &ResidualSet) -> Option<PromiseKept> {
    let norms: Vec<f64> = after.judged().map(|r| r.residual.norm()).collect();
    let figures = Figures::of(&norms)?;
    Some(PromiseKept::new(promise, &after.by_pose(|r| [r.residual.norm()]), Some(figures)))
}

/// The promise of a table held against a session that it drove, in a line that a person reads; `None` without a figure.
pub fn promise_words(kept: &PromiseKept) -> Option<String> {
    let (promise, figures) = (&kept.promise, kept.figures?);
    Some(format!(
        "predicted mean {:.3} mm, {} % below {:.3} mm; measured, noise included: mean {:.3}, largest {:.3} mm, {} of {} within \
         the bound ({}): {}",
        promise.mean_mm?,
        100.0 * promise.share,
        promise.bound_mm?,
        figures.mean,
        figures.max,
        kept.within,
        kept.counted,
        kept.possible(),
        kept.verdict()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::tip::at_tip;

    fn target(x: f64) -> CorrectedTarget {
        CorrectedTarget {
            name: format!("{x}"),
            target: Point3::new(x, 0.0, 0.0),
            command: Point3::new(x + 1.0, 0.0, 0.0),
            variance_mm2: 3.0,
        }
    }

    #[test]
    fn a_command_is_matched_with_the_target_it_is_clearly_nearest_to() {
        let targets = [target(0.0), target(20.0), target(500.0)];
        let commands = [Some(-1.0), Some(9.0), Some(22.0), None, Some(300.0), Some(1.0)];
        let commands = commands.map(|x| x.map(|x| Point3::new(x, 0.0, 0.0)));
        let found = matched(&commands, &targets);
        // 9 mm from one and 11 mm from the next is between both; 200 mm from all belongs to none; a visit may be repeated.
        assert_eq!(found.of_command, [Some(0), None, Some(1), None, None, Some(0)]);
        assert_eq!((found.far, found.between), (1, 1));
    }

    /// Stations whose errors after compensation are `norms`, the base moved by 3 mm.
    fn stations(norms: &[f64]) -> Vec<DrivenStation> {
        let station = |(i, norm): (usize, &f64)| {
            let target = Point3::new(
                (i % 3) as f64 * 300.0,
                (i / 3 % 3) as f64 * 300.0,
                (i / 9) as f64 * 300.0,
            );
            DrivenStation {
                station: i,
                pose: i,
                target,
                command: target,
                attained: target + Vector3::new(3.0, 0.0, *norm),
                stated: Vector3::zeros(),
                variance_mm2: 3.0,
                turn: None,
            }
        };
        norms.iter().enumerate().map(station).collect()
    }

    #[test]
    fn the_first_stations_find_the_base_and_the_others_judge() {
        let mut norms = vec![0.0; 10];
        norms.extend([0.1; 18]);
        norms.extend([0.4; 2]);
        let after = measured(&stations(&norms), "tuesday", 10).expect("stations span space").after;
        let promise =
            Promise { mean_mm: Some(0.1), bound_mm: Some(0.2), share: 0.95, confidence: 0.95 };
        let kept = kept(promise, &after).expect("stations that judge");
        let figures = kept.figures.expect("stations that judge");
        assert_eq!((figures.n, kept.within), (20, 18));
        assert!((figures.max - 0.4).abs() < 1e-9, "{kept:?}");
        // 18 of 20 leave 68 to 99 % possible (Clopper and Pearson): 95 % are not contradicted.
        assert!((kept.interval.0 - 0.683).abs() < 1e-3 && (kept.interval.1 - 0.988).abs() < 1e-3);
        let told = promise_words(&kept).expect("figures");
        assert!(!kept.is_broken() && told.ends_with("not contradicted"));
    }

    #[test]
    fn the_tip_of_a_driven_session_is_seen_from_the_base_as_it_was_found() {
        // The base has turned by 2 mrad since and the target is mounted at an angle: neither is an error of the tip. At the
        // last station the flange is 1 mrad off.
        let base = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 2e-3, 0.0));
        let mounted = UnitQuaternion::from_scaled_axis(Vector3::new(0.01, 0.02, -0.01));
        let mut all = stations(&[0.0; 28]);
        for (i, station) in all.iter_mut().enumerate() {
            let wanted = UnitQuaternion::from_euler_angles(0.1 * i as f64, 0.5, -0.3);
            let off = Vector3::x() * if i == 27 { 1e-3 } else { 0.0 };
            let attained = wanted * UnitQuaternion::from_scaled_axis(off) * mounted;
            station.attained = base * station.target;
            station.turn = Some(Turn { attained: base * attained, wanted });
        }
        let after = measured(&all, "tuesday", 10).expect("stations span space").after;
        let tip = at_tip(&after, &Vector3::new(0.0, 0.0, 200.0));
        let norms: Vec<f64> = tip.residuals.iter().map(|r| r.residual.norm()).collect();
        assert!(norms[..27].iter().all(|norm| *norm < 1e-6), "{norms:?}");
        // 1 mrad at 200 mm.
        assert!((norms[27] - 0.2).abs() < 1e-4, "{norms:?}");
    }

    #[test]
    fn a_session_of_few_stations_judges_with_half_of_them() {
        let both = measured(&stations(&[0.0; 12]), "tuesday", 50).expect("stations span space");
        assert_eq!(both.after.residuals.iter().filter(|r| r.used_for_refit).count(), 6);
    }
}
