//! Readings under the name of another target: named with what they are, not fitted.
//!
//! Inputs: the observations of all sessions. Output: readings that are not of the target they name, or the swap that goes through a whole session ([`SwappedThroughout`]). Steps:
//! 1. base and targets are fitted with Cauchy's loss and without stated places, so that wrong readings do not pull them;
//! 2. a station's readings have a *shape*: their distances from where the fit predicts the targets, without the shift that all of them
//!    share, which is the arm's error. It is the comparison of the readings' mutual distances with those of the places, together with
//!    how they are turned. A station whose shape or place is far beyond the others' is looked at;
//! 3. of all assignments of its readings to targets the best is found. It is a swap where it takes the misfit to a third; otherwise
//!    single readings that are far from every target are left out;
//! 4. the fitted places of each session are compared with the stated ones, with the known distances, or with those of the first
//!    session, under every permutation.
//!
//! A reading's own target is believed unless another explains three times as much: what cannot be distinguished stays as it is named.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::frames::Frames;
use super::observation::{Noise, Observation};
use super::suspects::{Against, Suspect, Swap, SwappedThroughout};
use super::{FitSettings, Freedom, Loss, identify};
use crate::figures::median;
use crate::join::average::centred_rms;
use crate::join::{TargetId, Unmeasured};
use crate::kinematics::Arm;

/// Beyond this many medians of all stations a station is looked at: errors of an arm are within a few.
const FAR: f64 = 8.0;
/// Shapes within this are the arm's and the instrument's errors, mm.
const LEAST_SHAPE_MM: f64 = 0.5;
/// Distances from the prediction within this are a nominal arm's, mm.
const LEAST_AWAY_MM: f64 = 5.0;
/// An assignment explains the readings that leaves at most this share of the misfit under the stated names.
const EXPLAINS: f64 = 1.0 / 3.0;
/// Targets whose places are all permuted; of more, two are exchanged at a time.
const MOST_PERMUTED: usize = 6;

/// Readings not of the target they name, in order of sessions and stations; an error where targets are swapped throughout a session.
pub fn check(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
    _: &Noise,
) -> Result<Vec<Suspect>, SwappedThroughout> {
    let unstated = FitSettings {
        loss: Loss::Cauchy { tuning: 2.0 },
        targets: BTreeMap::new(),
        target_distances: Vec::new(),
        ..settings.clone()
    };
    let several = observations.iter().any(|o| o.target != TargetId::MAIN);
    let fitted =
        several.then(|| identify(arm, observations, sessions, Freedom::BaseAndTarget, &unstated));
    let Some(Ok(fitted)) = fitted else { return Ok(Vec::new()) };
    let stations = by_station(arm, observations, &fitted.frames);
    let gate = Gate::of(&stations);
    let wrong = stations.iter().flat_map(|own| own.wrong(&gate, &settings.target_names)).collect();
    throughout(&fitted.frames, settings).map_or(Ok(wrong), Err)
}

/// The readings of a station, and the predictions of all targets there.
struct Read {
    session: usize,
    station: usize,
    readings: Vec<(TargetId, Point3<f64>)>,
    predicted: Vec<Point3<f64>>,
}

fn by_station(arm: &Arm, observations: &[Observation], frames: &[Frames]) -> Vec<Read> {
    let mut stations: BTreeMap<(usize, usize), Read> = BTreeMap::new();
    for own in observations {
        let Some(point) = own.point() else { continue };
        let station = stations.entry((own.session, own.station)).or_insert_with(|| {
            let frames = &frames[own.session];
            let base = frames.tracker_from_base(own.source).isometry();
            let flange = base * arm.chain().nominal(&own.axes);
            let predicted = frames.places().iter().map(|place| flange * place).collect();
            let Observation { session, station, .. } = *own;
            Read { session, station, readings: Vec::new(), predicted }
        });
        station.readings.push((own.target, point.position));
    }
    stations.into_values().collect()
}

/// The misfits up to which a station is sound, mm.
struct Gate {
    shape_mm: f64,
    away_mm: f64,
}

impl Gate {
    fn of(stations: &[Read]) -> Self {
        let beyond = |misfits: Vec<f64>, least: f64| {
            median(&misfits).map_or(least, |median| (FAR * median).max(least))
        };
        let several = stations.iter().filter(|own| own.readings.len() > 1);
        let shapes = several.map(|own| own.shape_mm(&own.named()));
        let away = stations.iter().flat_map(|own| own.away_mm(&own.named()));
        Self {
            shape_mm: beyond(shapes.collect(), LEAST_SHAPE_MM),
            away_mm: beyond(away.collect(), LEAST_AWAY_MM),
        }
    }

    fn passes(&self, station: &Read, targets: &[usize]) -> bool {
        let away = station.away_mm(targets).into_iter().fold(0.0, f64::max);
        away <= self.away_mm && station.shape_mm(targets) <= self.shape_mm
    }
}

impl Read {
    fn named(&self) -> Vec<usize> {
        self.readings.iter().map(|(target, _)| target.0).collect()
    }

    /// Measured minus predicted positions, if the readings are of these targets, mm.
    fn off(&self, targets: &[usize]) -> Vec<Vector3<f64>> {
        let own = self.readings.iter().zip(targets);
        own.map(|((_, measured), &target)| measured - self.predicted[target]).collect()
    }

    fn away_mm(&self, targets: &[usize]) -> Vec<f64> {
        self.off(targets).iter().map(Vector3::norm).collect()
    }

    /// Root mean square distance from the predictions without their mean, mm; zero for one reading.
    fn shape_mm(&self, targets: &[usize]) -> f64 {
        centred_rms(&self.off(targets))
    }

    /// The misfit by which assignments are compared: the shape, or the distance of one reading, mm.
    fn misfit_mm(&self, targets: &[usize]) -> f64 {
        match &self.off(targets)[..] {
            [only] => only.norm(),
            off => centred_rms(off),
        }
    }

    /// The station's wrong readings, by the names of the targets; none where they pass.
    fn wrong(&self, gate: &Gate, names: &[String]) -> Vec<Suspect> {
        let (named, station) = (self.named(), self.station);
        if gate.passes(self, &named) {
            return Vec::new();
        }
        let all = assignments(&named, self.predicted.len());
        let misfit_mm = |targets: &[usize]| self.misfit_mm(targets);
        let swap = best(&named, all, misfit_mm, |own| gate.passes(self, own));
        if let Some(swap) = swap {
            let swap = swap.words(|target| target.name(names));
            return vec![self.suspect(None, format!(
                "swapped targets: the readings of station {station} are of other targets than they name: {swap}"
            ))];
        }
        let far: Vec<usize> = (0..self.readings.len())
            .filter(|&place| self.away_mm(&named)[place] > gate.away_mm)
            .collect();
        let left = self.without(&far);
        if far.is_empty() || !gate.passes(&left, &left.named()) {
            let given_mm = self.misfit_mm(&named);
            return vec![self.suspect(None, format!(
                "wrong target: the readings of station {station} disagree by {given_mm:.2} mm with the places of their targets, under any \
                 names"
            ))];
        }
        far.into_iter().map(|place| self.far(place, names)).collect()
    }

    fn without(&self, places: &[usize]) -> Self {
        let kept = self.readings.iter().enumerate().filter(|(place, _)| !places.contains(place));
        let readings = kept.map(|(_, own)| *own).collect();
        Self { readings, predicted: self.predicted.clone(), ..*self }
    }

    fn suspect(&self, target: Option<TargetId>, reason: String) -> Suspect {
        Suspect {
            session: self.session,
            station: self.station,
            source: None,
            target,
            reason,
            otherwise: Unmeasured::WrongTarget,
        }
    }

    /// The reading at `place`, which is far from where any target can be.
    fn far(&self, place: usize, names: &[String]) -> Suspect {
        let (target, measured) = self.readings[place];
        let away = |predicted: &Point3<f64>| (measured - predicted).norm();
        let nearest = self.predicted.iter().map(away).enumerate();
        let nearest = nearest.min_by(|a, b| a.1.total_cmp(&b.1));
        let away_mm = away(&self.predicted[target.0]);
        let (nearest, mm) = nearest.unwrap_or((target.0, away_mm));
        let reason = format!(
            "wrong target: a reading of station {} is {away_mm:.1} mm from where {} is, and {mm:.1} mm from the nearest, {}",
            self.station,
            target.name(names),
            TargetId(nearest).name(names)
        );
        self.suspect(Some(target), reason)
    }
}

/// The best of `assignments` by `misfit_mm` that `passes`, where it leaves a third of what the named one leaves.
fn best(
    named: &[usize],
    assignments: Vec<Vec<usize>>,
    misfit_mm: impl Fn(&[usize]) -> f64,
    passes: impl Fn(&[usize]) -> bool,
) -> Option<Swap> {
    let given_mm = misfit_mm(named);
    let others = assignments.into_iter().filter(|own| own != named);
    let mut others: Vec<(f64, Vec<usize>)> = others.map(|own| (misfit_mm(&own), own)).collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    let place = others.iter().position(|(_, own)| passes(own))?;
    let (swapped_mm, targets) = others.remove(place);
    let read = named.iter().zip(targets);
    let read = read.filter(|(named, read)| *named != read);
    let mut read: Vec<_> = read.map(|(named, read)| (TargetId(*named), TargetId(read))).collect();
    read.sort_unstable();
    (swapped_mm <= EXPLAINS * given_mm).then(|| Swap {
        read,
        given_mm,
        swapped_mm,
        runner_up_mm: others.first().map(|own| own.0),
    })
}

/// Ways in which readings that name the targets `named` can be of `targets` targets, each of another one.
fn assignments(named: &[usize], targets: usize) -> Vec<Vec<usize>> {
    if targets > MOST_PERMUTED {
        return exchanges(named, targets);
    }
    let mut all = vec![Vec::new()];
    for _ in named {
        let longer = all.iter().flat_map(|own: &Vec<usize>| {
            let free = (0..targets).filter(|target| !own.contains(target));
            free.map(|target| {
                let mut own = own.clone();
                own.push(target);
                own
            })
        });
        all = longer.collect();
    }
    all
}

/// The assignments in which one reading is of another target, and that target's reading, where there is one, of the first's.
fn exchanges(named: &[usize], targets: usize) -> Vec<Vec<usize>> {
    let with = |(place, target): (usize, usize)| {
        let own = named[place];
        let exchanged = named.iter().map(|&other| match other {
            other if other == own => target,
            other if other == target => own,
            other => other,
        });
        exchanged.collect()
    };
    let places = (0..named.len()).flat_map(|place| (0..targets).map(move |target| (place, target)));
    places.map(with).collect()
}

/// The first session whose fitted places are those of other targets than they are named, by what is stated of them.
fn throughout(frames: &[Frames], settings: &FitSettings) -> Option<SwappedThroughout> {
    let mut sessions = frames.iter().enumerate();
    sessions.find_map(|(session, own)| {
        let places = places(own);
        let found = |against| move |swap| SwappedThroughout { session, swap, against };
        let stated = settings.prior().targets.into_iter().enumerate().take(places.len());
        let stated = stated.filter_map(|(at, known)| Some((at, Vector3::from(known?.xyz_mm))));
        let stated: Vec<_> = stated.collect();
        if stated.len() > 1 {
            return by_places(&places, &stated).map(found(Against::Places));
        }
        if settings.target_distances.len() > 1 {
            return by_distances(&places, settings).map(found(Against::Distances));
        }
        let first: Vec<_> = self::places(&frames[0]).into_iter().enumerate().collect();
        let alike = session > 0 && first.len() == places.len();
        alike.then(|| by_places(&places, &first)).flatten().map(found(Against::FirstSession))
    })
}

fn places(frames: &Frames) -> Vec<Vector3<f64>> {
    frames.targets().iter().map(|target| target.isometry().translation.vector).collect()
}

/// The permutation of targets under which fitted places are those wanted, but for one shift of all.
fn by_places(fitted: &[Vector3<f64>], wanted: &[(usize, Vector3<f64>)]) -> Option<Swap> {
    let named: Vec<usize> = wanted.iter().map(|(target, _)| *target).collect();
    let misfit_mm = |targets: &[usize]| {
        let off = wanted.iter().zip(targets);
        let off: Vec<_> = off.map(|((_, at), &own)| fitted[own] - at).collect();
        centred_rms(&off)
    };
    swapped(&named, fitted.len(), misfit_mm)
}

/// The permutation of targets under which the distances of fitted places are the known ones.
fn by_distances(fitted: &[Vector3<f64>], settings: &FitSettings) -> Option<Swap> {
    let known = settings.prior().distances;
    let named: Vec<usize> = (0..fitted.len()).collect();
    let misfit_mm = |targets: &[usize]| {
        let off = known.iter().map(|own| {
            let [a, b] = own.between.map(|target| fitted[targets[target.0]]);
            (a.metric_distance(&b) - own.mm).powi(2)
        });
        (off.sum::<f64>() / known.len().max(1) as f64).sqrt()
    };
    let is_named = known.iter().flat_map(|own| own.between).all(|target| target.0 < fitted.len());
    is_named.then(|| swapped(&named, fitted.len(), misfit_mm)).flatten()
}

/// The best permutation, where the named one is further off than a nominal arm makes places. `read` is turned about: which target
/// stands under a name.
fn swapped(named: &[usize], targets: usize, misfit_mm: impl Fn(&[usize]) -> f64) -> Option<Swap> {
    let swap = best(named, assignments(named, targets), misfit_mm, |_| true)?;
    let mut read: Vec<_> = swap.read.iter().map(|(wanted, own)| (*own, *wanted)).collect();
    read.sort_unstable();
    (swap.given_mm > LEAST_AWAY_MM).then_some(Swap { read, ..swap })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_are_all_ways_to_give_readings_to_targets() {
        assert_eq!(assignments(&[0, 1], 3).len(), 6);
        assert_eq!(assignments(&[0, 1, 2], 3).len(), 6);
        let many = assignments(&[0, 1, 2, 3], 8);
        assert!(many.contains(&vec![1, 0, 2, 3]) && many.contains(&vec![0, 7, 2, 3]));
    }

    #[test]
    fn places_under_each_other_s_names_are_found() {
        let places = [
            Vector3::new(60.0, 20.0, 80.0),
            Vector3::new(-40.0, 70.0, 60.0),
            Vector3::new(-10.0, -60.0, 120.0),
        ];
        let stated: Vec<_> = places.iter().copied().enumerate().collect();
        // All in turn: under the name 0 is target 1, under 1 is 2, under 2 is 0; and the arm's 0.3 mm.
        let fitted = [places[1], places[2], places[0]].map(|at| at + Vector3::new(0.3, 0.0, 0.0));
        let swap = by_places(&fitted, &stated).expect("swapped");
        let turned = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (TargetId(a), TargetId(b)));
        assert_eq!(swap.read, turned);
        assert!(swap.given_mm > 50.0 && swap.swapped_mm < 1e-9);
        assert!(swap.runner_up_mm.is_some_and(|mm| mm > 20.0));
        assert_eq!(by_places(&places, &stated), None);
    }
}
