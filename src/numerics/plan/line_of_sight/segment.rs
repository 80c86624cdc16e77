//! Straight lines between two points: intersection with a box, and the distance between two.

use nalgebra::Point3;

/// The segment from one point to another, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    pub from: Point3<f64>,
    pub to: Point3<f64>,
}

impl Segment {
    pub const fn new(from: Point3<f64>, to: Point3<f64>) -> Self {
        Self { from, to }
    }

    /// Whether any point of the segment lies in the box, its sides included: the shares of the way between the two
    /// planes of each axis must have one in common.
    pub(super) fn meets_box(&self, least: [f64; 3], most: [f64; 3]) -> bool {
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (from, to) = (self.from[axis], self.to[axis]);
            let way = to - from;
            if way == 0.0 {
                if from < least[axis] || from > most[axis] {
                    return false;
                }
                continue;
            }
            let (one, other) = ((least[axis] - from) / way, (most[axis] - from) / way);
            enters = enters.max(one.min(other));
            leaves = leaves.min(one.max(other));
        }
        enters <= leaves
    }

    pub(super) fn distance_to(&self, point: &Point3<f64>) -> f64 {
        let way = self.to - self.from;
        let share = share((point - self.from).dot(&way), way.norm_squared());
        (self.from + way * share - point).norm()
    }

    /// Least distance between two segments, mm.
    ///
    /// Where both lines' nearest points lie inside, it is the distance of the lines; otherwise one end of one of the two is
    /// nearest to the other.
    pub fn distance(&self, other: &Self) -> f64 {
        let ends = [
            other.distance_to(&self.from),
            other.distance_to(&self.to),
            self.distance_to(&other.from),
            self.distance_to(&other.to),
        ];
        let of_ends = ends.into_iter().fold(f64::INFINITY, f64::min);
        self.inner_distance(other).map_or(of_ends, |inner| inner.min(of_ends))
    }

    /// Distance of the two lines, where their nearest points lie inside both segments.
    fn inner_distance(&self, other: &Self) -> Option<f64> {
        let (u, v) = (self.to - self.from, other.to - other.from);
        let normal = u.cross(&v);
        let squared = normal.norm_squared();
        // Parallel lines are nearest at an end too.
        if squared <= 1e-18 * u.norm_squared() * v.norm_squared() {
            return None;
        }
        let between = other.from - self.from;
        let along_u = between.cross(&v).dot(&normal) / squared;
        let along_v = between.cross(&u).dot(&normal) / squared;
        let inside = (0.0..=1.0).contains(&along_u) && (0.0..=1.0).contains(&along_v);
        inside.then(|| between.dot(&normal).abs() / squared.sqrt())
    }
}

/// `along / whole` kept between 0 and 1; 0 for a segment that is a point.
fn share(along: f64, whole: f64) -> f64 {
    if whole > 0.0 { (along / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(from: [f64; 3], to: [f64; 3]) -> Segment {
        Segment::new(from.into(), to.into())
    }

    #[test]
    fn a_segment_meets_a_box_it_only_passes_through() {
        let (least, most) = ([0.0; 3], [10.0; 3]);
        let meets = |from, to| segment(from, to).meets_box(least, most);
        // Both ends outside, the middle inside.
        assert!(meets([-5.0, 5.0, 5.0], [15.0, 5.0, 5.0]));
        // Wholly inside, and a point.
        assert!(meets([1.0; 3], [2.0; 3]) && meets([3.0; 3], [3.0; 3]));
        // Its line meets the box, the segment ends before.
        assert!(!meets([-5.0, 5.0, 5.0], [-1.0, 5.0, 5.0]));
        // Past a corner: at x = 5 it is at y = 11.
        assert!(!meets([0.0, 16.0, 5.0], [10.0, 6.0 + 1e-9, 20.0]));
        assert!(!meets([-3.0, 8.0, 5.0], [3.0, 14.0, 5.0]));
        // Along a side.
        assert!(meets([-5.0, 10.0, 10.0], [15.0, 10.0, 10.0]));
    }

    #[test]
    fn distances_of_crossing_parallel_and_distant_segments() {
        let x = segment([0.0; 3], [10.0, 0.0, 0.0]);
        // Crossing 3 above.
        assert!((x.distance(&segment([5.0, -4.0, 3.0], [5.0, 4.0, 3.0])) - 3.0).abs() < 1e-12);
        // Parallel, at a distance of 2, with only 5 of it alongside.
        assert!((x.distance(&segment([5.0, 2.0, 0.0], [20.0, 2.0, 0.0])) - 2.0).abs() < 1e-12);
        // In line, 4 apart.
        assert!((x.distance(&segment([14.0, 0.0, 0.0], [20.0, 0.0, 0.0])) - 4.0).abs() < 1e-12);
        // End to end askew: from (10, 0, 0) to (13, 4, 0).
        assert!((x.distance(&segment([13.0, 4.0, 0.0], [13.0, 9.0, 7.0])) - 5.0).abs() < 1e-12);
        // A point.
        assert!((x.distance(&segment([5.0, 6.0, 8.0], [5.0, 6.0, 8.0])) - 10.0).abs() < 1e-12);
    }

    /// Compared with the least distance over a fine lattice of both segments: never above it, and below it by at most its
    /// step.
    #[test]
    fn distance_is_the_least_over_all_pairs_of_points() {
        let value = |k: usize| 100.0 * ((k * 37) as f64 * 0.618).sin();
        for case in 0..200 {
            let point = |k: usize| {
                [value(case * 12 + k), value(case * 12 + k + 1), value(case * 12 + k + 2)]
            };
            let (a, b) = (segment(point(0), point(3)), segment(point(6), point(9)));
            let mut least = f64::INFINITY;
            for i in 0..=100 {
                let p = a.from + (a.to - a.from) * (f64::from(i) / 100.0);
                least = least.min(b.distance_to(&p));
            }
            let step = (a.to - a.from).norm() / 100.0;
            let found = a.distance(&b);
            assert!(found <= least + 1e-9 && found >= least - step, "{found} {least}");
        }
    }
}
