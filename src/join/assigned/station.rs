//! One station: positions at the flange and places of targets → the best assignment and its runner-up.
//!
//! Readings of a station are off their places by what they share, the arm's error there, and by what each has of its own:
//!
//! ```text
//! −2 log L = Σ |d − d̄|² / s² + m |d̄|² / (s² + m a²) + c · (readings of no target)
//! ```
//!
//! with `d` the m offsets from the places, `d̄` their mean, `a` the size of what is shared and `s` of what is not, per axis. It grows
//! with every reading added, so a search that leaves a branch worse than the best so far is exact.

use nalgebra::{Point3, Vector3};

use super::{Assigned, DECIDED, PointTarget, StationAssignment};

/// A reading that is further off its place than this many sizes of its own part is of no target.
const NONE_REACH: f64 = 10.0;
/// Least distance from which that holds, mm: single bad readings of an instrument are within it.
const NONE_LEAST_MM: f64 = 10.0;

/// Sizes of the offsets of readings from their places, per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    /// What each reading has of its own, mm.
    pub(super) own: f64,
    /// What the readings of a station share, mm.
    pub(super) shared: f64,
    /// Distance beyond which a reading is of no target, mm.
    pub(super) gate: f64,
}

impl Scale {
    /// `−2 log` of the likelihood of these offsets, but for a constant.
    fn cost(&self, off: &[Vector3<f64>]) -> f64 {
        if off.is_empty() {
            return 0.0;
        }
        let m = off.len() as f64;
        let mean = off.iter().sum::<Vector3<f64>>() / m;
        let squares: f64 = off.iter().map(|d| (d - mean).norm_squared()).sum();
        let (s2, a2) = (self.own.powi(2), self.shared.powi(2));
        squares / s2 + m * mean.norm_squared() / (s2 + m * a2)
    }

    /// The cost of a reading of no target: that of one of three readings which is further off than any reading of a target.
    fn none(&self) -> f64 {
        let reach = NONE_REACH.max(NONE_LEAST_MM / self.own);
        2.0 / 3.0 * reach * reach
    }
}

/// The search for an assignment.
struct Search<'a> {
    points: &'a [Point3<f64>],
    places: &'a [Point3<f64>],
    scale: &'a Scale,
    /// Whether readings may be of no target, and have to be within the gate of theirs.
    with_none: bool,
    /// An assignment that is not looked for.
    but: Option<&'a [Option<usize>]>,
    targets: Vec<Option<usize>>,
    off: Vec<Vector3<f64>>,
    best: Option<(f64, Vec<Option<usize>>)>,
}

impl Search<'_> {
    fn go(&mut self) {
        let nones = self.targets.iter().filter(|own| own.is_none()).count();
        let cost = self.scale.cost(&self.off) + nones as f64 * self.scale.none();
        if self.best.as_ref().is_some_and(|(best, _)| cost >= *best) {
            return;
        }
        let at = self.targets.len();
        if at == self.points.len() {
            if self.but != Some(&self.targets[..]) {
                self.best = Some((cost, self.targets.clone()));
            }
            return;
        }
        for target in 0..self.places.len() {
            let off = self.points[at] - self.places[target];
            let is_far = self.with_none && off.norm() > self.scale.gate;
            if is_far || self.targets.contains(&Some(target)) {
                continue;
            }
            self.targets.push(Some(target));
            self.off.push(off);
            self.go();
            self.off.pop();
            self.targets.pop();
        }
        if self.with_none {
            self.targets.push(None);
            self.go();
            self.targets.pop();
        }
    }
}

fn search(
    points: &[Point3<f64>],
    places: &[Point3<f64>],
    scale: &Scale,
    with_none: bool,
    but: Option<&[Option<usize>]>,
) -> Option<(f64, Vec<Option<usize>>)> {
    let mut search = Search {
        points,
        places,
        scale,
        with_none,
        but,
        targets: Vec::new(),
        off: Vec::new(),
        best: None,
    };
    search.go();
    search.best
}

/// The best assignment of a station's positions at the flange to places; `None` for a position of no target.
pub(super) fn best(
    points: &[Point3<f64>],
    places: &[Point3<f64>],
    scale: &Scale,
) -> Vec<Option<usize>> {
    let best = search(points, places, scale, true, None);
    best.map_or_else(|| vec![None; points.len()], |(_, targets)| targets)
}

/// The decision on a station.
pub(super) fn decided(
    points: &[Point3<f64>],
    places: &[Point3<f64>],
    scale: &Scale,
) -> StationAssignment {
    let best = best(points, places, scale);
    let kept = points.iter().zip(&best).filter(|(_, own)| own.is_some());
    let (kept, targets): (Vec<Point3<f64>>, Vec<Option<usize>>) =
        kept.map(|(point, own)| (*point, *own)).unzip();
    let runner_up = search(&kept, places, scale, false, Some(&targets));
    let off = |targets: &[Option<usize>]| offsets(&kept, places, targets);
    let assigned = runner_up.filter(|_| !kept.is_empty()).map(|(cost, other)| {
        let assigned = Assigned { misfit_mm: rms(&off(&targets)), runner_up_mm: rms(&off(&other)) };
        (cost - scale.cost(&off(&targets)) < DECIDED, assigned)
    });
    if let Some((true, assigned)) = assigned {
        return StationAssignment::Ambiguous(assigned);
    }
    let points = points.iter().zip(&best).map(|(point, own)| match own {
        Some(target) => PointTarget::Of(*target),
        None => PointTarget::OfNone(nearest_mm(point, places)),
    });
    StationAssignment::Decided(points.collect(), assigned.map(|(_, own)| own))
}

/// Offsets of positions from the places that they are assigned to, mm; none of a position of no target.
pub(super) fn offsets(
    points: &[Point3<f64>],
    places: &[Point3<f64>],
    targets: &[Option<usize>],
) -> Vec<Vector3<f64>> {
    let own = points.iter().zip(targets);
    own.filter_map(|(point, target)| Some(point - places[(*target)?])).collect()
}

fn rms(off: &[Vector3<f64>]) -> f64 {
    let squares: f64 = off.iter().map(Vector3::norm_squared).sum();
    (squares / off.len().max(1) as f64).sqrt()
}

fn nearest_mm(point: &Point3<f64>, places: &[Point3<f64>]) -> f64 {
    let away = places.iter().map(|place| (point - place).norm());
    away.fold(f64::INFINITY, f64::min)
}
