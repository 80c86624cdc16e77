//! A path through all poses, shortened move by move.

use std::cmp::Ordering;

/// Number of other poses that a pose may be joined to.
const NEIGHBOURS: usize = 10;
/// Most poses moved elsewhere together.
const LONGEST_RUN: usize = 3;
/// A move has to save this share of the whole path, or rounding would keep the search going.
const WORTH_IT: f64 = 1e-12;

/// Poses to be visited from home, in units of time: angle over speed, joint by joint.
#[derive(Debug)]
pub struct Path {
    /// The poses, followed by home.
    points: Vec<Vec<f64>>,
}

/// A path under improvement: home, then the poses.
struct Tour<'a> {
    path: &'a Path,
    order: Vec<usize>,
    /// Index in `order` of each point.
    place: Vec<usize>,
    least_saving: f64,
}

impl Path {
    pub fn new(joints: &[Vec<f64>], home: &[f64], speeds: &[f64]) -> Self {
        let times = |pose: &[f64]| -> Vec<f64> {
            assert!(pose.len() >= speeds.len(), "an angle for each speed");
            let time = |(q, speed): (&f64, &f64)| if *speed > 0.0 { q / speed } else { 0.0 };
            pose.iter().zip(speeds).map(time).collect()
        };
        Self { points: joints.iter().map(|pose| times(pose)).chain([times(home)]).collect() }
    }

    pub fn seconds(&self, order: &[usize]) -> f64 {
        let from = std::iter::once(&self.home()).chain(order).copied().collect::<Vec<_>>();
        from.windows(2).map(|pair| self.between(pair[0], pair[1])).sum()
    }

    /// Always moves on to the nearest pose not yet visited.
    pub(super) fn nearest_neighbour(&self) -> Vec<usize> {
        let mut left: Vec<usize> = (0..self.home()).collect();
        let mut order = Vec::with_capacity(left.len());
        let mut here = self.home();
        while let Some(next) = self.nearest(here, &left) {
            here = left.remove(next);
            order.push(here);
        }
        order
    }

    pub(super) fn shortened(&self, order: Vec<usize>) -> Vec<usize> {
        let near = self.neighbours();
        let mut tour = Tour::new(self, order);
        loop {
            let mut better = false;
            for (point, near) in near.iter().enumerate() {
                while tour.improve(point, near) {
                    better = true;
                }
            }
            if !better {
                return tour.order.split_off(1);
            }
        }
    }

    fn home(&self) -> usize {
        self.points.len() - 1
    }

    fn between(&self, a: usize, b: usize) -> f64 {
        self.points[a].iter().zip(&self.points[b]).fold(0.0, |most, (a, b)| (a - b).abs().max(most))
    }

    /// Index in `left` of the pose nearest to `here`, the first of several.
    fn nearest(&self, here: usize, left: &[usize]) -> Option<usize> {
        let times = left.iter().map(|&pose| self.between(here, pose));
        times.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
    }

    /// For each point the poses nearest to it, nearest first.
    fn neighbours(&self) -> Vec<Vec<usize>> {
        let nearer = |a: &(f64, usize), b: &(f64, usize)| -> Ordering {
            a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
        };
        let of = |point: usize| {
            let others = (0..self.home()).filter(|&other| other != point);
            let mut others: Vec<_> =
                others.map(|other| (self.between(point, other), other)).collect();
            if others.len() > NEIGHBOURS {
                others.select_nth_unstable_by(NEIGHBOURS, nearer);
                others.truncate(NEIGHBOURS);
            }
            others.sort_unstable_by(nearer);
            others.into_iter().map(|(_, other)| other).collect()
        };
        (0..self.points.len()).map(of).collect()
    }
}

impl<'a> Tour<'a> {
    fn new(path: &'a Path, poses: Vec<usize>) -> Self {
        let least_saving = WORTH_IT * path.seconds(&poses);
        let mut order = vec![path.home()];
        order.extend(poses);
        let mut tour = Self { path, place: vec![0; order.len()], order, least_saving };
        tour.found_again(0, tour.order.len());
        tour
    }

    /// Makes the first move that joins `point` to one of its neighbours and saves time; returns whether there was one.
    fn improve(&mut self, point: usize, near: &[usize]) -> bool {
        near.iter().any(|&other| {
            let (at, to) = (self.place[point], self.place[other]);
            self.turn_round(at.min(to), at.max(to)) || self.move_run(at, to)
        })
    }

    /// Joins the points at `a` and `b` (`a < b`) by reversing the poses between: the stretch after `a` up to `b`, or the
    /// one from `a` to before `b`.
    fn turn_round(&mut self, a: usize, b: usize) -> bool {
        let ahead =
            self.gap(a, a + 1) + self.gap(b, b + 1) - self.gap(a, b) - self.gap(a + 1, b + 1);
        if ahead > self.least_saving {
            self.reverse(a + 1, b + 1);
            return true;
        }
        // Home stays first.
        if a == 0 {
            return false;
        }
        let back =
            self.gap(a - 1, a) + self.gap(b - 1, b) - self.gap(a, b) - self.gap(a - 1, b - 1);
        if back > self.least_saving {
            self.reverse(a, b);
            return true;
        }
        false
    }

    /// Moves a run of poses that begins or ends at `at` so that this pose is next to the one at `to`.
    fn move_run(&mut self, at: usize, to: usize) -> bool {
        (1..=LONGEST_RUN).any(|length| {
            let ends_here = at.checked_sub(length - 1).map(|first| (first, at + 1));
            let runs = [Some((at, at + length)), ends_here];
            runs.into_iter().flatten().any(|(first, end)| {
                let inside = (first..end).contains(&to);
                if first == 0 || end > self.order.len() || inside {
                    return false;
                }
                // After `to`, then before it; nothing comes before home.
                self.put(first, end, to, to + 1) || (to > 0 && self.put(first, end, to - 1, to))
            })
        })
    }

    /// Puts the run `first..end` between neighbours `left` and `right` outside it, the shorter way, if that saves time.
    fn put(&mut self, first: usize, end: usize, left: usize, right: usize) -> bool {
        // Where the run already touches one of the two there is no gap between them to go into.
        if left + 1 == first || right == first || left + 1 == end {
            return false;
        }
        let taken = self.gap(first - 1, first) + self.gap(end - 1, end) - self.gap(first - 1, end);
        let open = self.gap(left, right);
        let straight = self.gap(left, first) + self.gap(end - 1, right) - open;
        let turned = self.gap(left, end - 1) + self.gap(first, right) - open;
        if taken - straight.min(turned) <= self.least_saving {
            return false;
        }
        if turned < straight {
            self.order[first..end].reverse();
        }
        let length = end - first;
        if left < first {
            self.order[right..end].rotate_right(length);
            self.found_again(right, end);
        } else {
            self.order[first..right].rotate_left(length);
            self.found_again(first, right);
        }
        true
    }

    /// Seconds between the points at two places; zero after the last.
    fn gap(&self, a: usize, b: usize) -> f64 {
        match (self.order.get(a), self.order.get(b)) {
            (Some(&a), Some(&b)) => self.path.between(a, b),
            _ => 0.0,
        }
    }

    fn reverse(&mut self, first: usize, end: usize) {
        self.order[first..end].reverse();
        self.found_again(first, end);
    }

    fn found_again(&mut self, first: usize, end: usize) {
        for place in first..end {
            self.place[self.order[place]] = place;
        }
    }
}
