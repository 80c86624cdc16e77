//! Figures of ISO 9283: the accuracy and repeatability that repeated visits of a pose show.
//!
//! Inputs: poses and their visits ([`Visited`]), commanded and attained in one frame. Output: [`Figure`]s under the
//! standard's names, lengths mm, angles rad (ISO 9283:1998, clause 7; [`crate::method::accuracy`]). Steps:
//! 1. dwells that went to one pose are its visits ([`crate::fit::visits`]);
//! 2. of each pose: accuracy AP, the barycentre of the attained positions against the command, and repeatability RP,
//!    `l̄ + 3 S_l` of the distances to the barycentre (`pose`);
//! 3. of a pair of poses visited in turn: distance accuracy AD and repeatability RD (`distance`);
//! 4. of poses approached from several others: multi-directional variation vAP; over time: drift dAP (`variation`).
//!
//! A figure that the visits do not allow is a row without a value and with the reason. The error of a single visit is no
//! AP. The standard's requirements on load, speed and positions of the poses are not checked; the number of visits is.

mod distance;
mod pose;
mod variation;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::{Moment, Point, Subject};
use crate::figures::median;
use crate::units::{Controller, Stamp};

/// Number of visits of a pose that the standard asks for.
pub const VISITS: usize = 30;
/// Most poses whose figures are given one by one: those that were visited most.
const ONE_BY_ONE: usize = 500;

/// One visit of a pose; positions in one frame, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    pub station: usize,
    pub start: Stamp<Controller>,
    /// The pose that the arm was at before, by the station of its first visit; `None` where it is not known.
    pub from: Option<usize>,
    pub commanded: Point3<f64>,
    pub attained: Point3<f64>,
    /// Orientation of the tool; `None` where orientations were not measured.
    pub orientation: Option<Orientation>,
}

/// Orientation of the tool at a visit, in the frame of its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orientation {
    pub commanded: Option<UnitQuaternion<f64>>,
    pub attained: UnitQuaternion<f64>,
}

impl Visit {
    fn error(&self) -> Vector3<f64> {
        self.attained - self.commanded
    }
}

/// A pose with its measured visits, in time order.
#[derive(Debug, Clone, PartialEq)]
pub struct Visited {
    pub pose: usize,
    /// The visits, two or more.
    pub visits: Vec<Visit>,
}

/// Figures of the same visits, in the same frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Iso9283 {
    pub subject: Subject,
    pub point: Point,
    pub moment: Moment,
    /// The run whose table drove the stations; `None` where none did.
    pub driven_by: Option<String>,
    pub expanded_uncertainty_mm: f64,
    pub figures: Vec<Figure>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    pub characteristic: Characteristic,
    /// The pose, by the station of its first visit; `None` over all poses.
    pub pose: Option<usize>,
    /// Value, mm or rad; `None` where the visits do not allow it.
    pub value: Option<f64>,
    pub n: usize,
    pub n_needed: usize,
    /// Limitations of the figure, as text; `None` without any.
    pub remark: Option<String>,
}

impl Figure {
    fn missing(characteristic: Characteristic, n_needed: usize, remark: &str) -> Self {
        let remark = Some(remark.to_owned());
        Self { characteristic, pose: None, value: None, n: 0, n_needed, remark }
    }
}

/// The characteristics of ISO 9283, with the standard's symbols.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Characteristic {
    /// `AP_p`: distance of the barycentre from the command.
    ApP,
    ApX,
    ApY,
    ApZ,
    /// `AP_a`: mean minus commanded angle about x.
    ApA,
    /// `AP_b`, about y.
    ApB,
    /// `AP_c`, about z.
    ApC,
    /// `RP_l`: mean distance to the barycentre and three times its standard deviation.
    RpL,
    /// `RP_a`: three standard deviations of the angle about x.
    RpA,
    /// `RP_b`, about y.
    RpB,
    /// `RP_c`, about z.
    RpC,
    /// `AD_p`: mean attained minus commanded distance.
    AdP,
    AdX,
    AdY,
    AdZ,
    /// `RD`: three standard deviations of the distance.
    Rd,
    /// `vAP_p`: largest distance between barycentres by approach.
    VapP,
    /// `dAP_p`: change of `AP_p` over time.
    DapP,
}

impl Characteristic {
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::ApA | Self::ApB | Self::ApC | Self::RpA | Self::RpB | Self::RpC)
    }

    /// Whether it compares visits with one another, and none with its command.
    const fn is_of_visits(self) -> bool {
        matches!(self, Self::RpL | Self::RpA | Self::RpB | Self::RpC | Self::Rd | Self::VapP)
    }
}

/// The characteristics that visits can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Says {
    Everything,
    /// Accuracy alone: positions are predictions of a model, and no model repeats better or worse than its arm.
    Accuracy,
    /// Repeatability alone: the stations have no commands, and `commanded` is where the nominal arm is at the reported joints.
    Repeatability,
}

/// The figures of poses with two visits or more, in the order of the first; empty without any.
pub fn figures(visited: &[Visited], says: Says) -> Vec<Figure> {
    if visited.is_empty() {
        return Vec::new();
    }
    let everything = says != Says::Accuracy;
    let of_poses = visited.iter().flat_map(|own| {
        let repeats = everything.then(|| pose::repeatability(own));
        let varies = everything.then(|| variation::of_pose(own));
        let further = repeats.into_iter().chain(varies).flatten();
        pose::accuracy(own).into_iter().chain(further)
    });
    let of_poses: Vec<Figure> = of_poses.collect();
    let mut figures = over_all(&of_poses, visited.len());
    if everything {
        figures.extend(pose::missing(visited));
        figures.extend(variation::missing(&of_poses));
    }
    figures.extend(distance::figures(visited, says));
    let told = most_visited(visited);
    let is_told = |figure: &Figure| figure.pose.is_some_and(|pose| told.contains(&pose));
    figures.extend(of_poses.into_iter().filter(is_told));
    if says == Says::Repeatability {
        figures.retain(|figure| figure.characteristic.is_of_visits());
        figures.insert(0, Figure::missing(Characteristic::ApP, VISITS, UNCOMMANDED));
    }
    figures
}

const UNCOMMANDED: &str = "no station has a command to compare the attained positions with; visits of a pose are stations whose joints agree \
                           within 0.1°";

pub fn none(remark: &str) -> Vec<Figure> {
    [Characteristic::ApP, Characteristic::RpL]
        .map(|characteristic| Figure::missing(characteristic, VISITS, remark))
        .into()
}

fn most_visited(visited: &[Visited]) -> Vec<usize> {
    let mut most: Vec<&Visited> = visited.iter().collect();
    most.sort_by_key(|own| (std::cmp::Reverse(own.visits.len()), own.pose));
    most.iter().take(ONE_BY_ONE).map(|own| own.pose).collect()
}

/// The characteristics whose largest value over all poses is given; the others have signs.
const LARGEST: [Characteristic; 7] = [
    Characteristic::ApP,
    Characteristic::RpL,
    Characteristic::RpA,
    Characteristic::RpB,
    Characteristic::RpC,
    Characteristic::VapP,
    Characteristic::DapP,
];

fn over_all(of_poses: &[Figure], poses: usize) -> Vec<Figure> {
    let largest = |characteristic| {
        let own = of_poses.iter().filter(move |figure| figure.characteristic == characteristic);
        let values: Vec<f64> = own.clone().filter_map(|figure| figure.value).collect();
        let middle = median(&values)?;
        // If several are equal, the first is kept.
        let worst =
            own.reduce(|worst, next| if next.value > worst.value { next } else { worst })?;
        Some(Figure {
            pose: None,
            remark: Some(remark_of_largest(worst, values.len(), poses, middle)),
            ..worst.clone()
        })
    };
    LARGEST.into_iter().filter_map(largest).collect()
}

fn remark_of_largest(worst: &Figure, of: usize, poses: usize, middle: f64) -> String {
    let pose = worst.pose.expect("figures of poses have one");
    let unit = if worst.characteristic.is_angle() {
        format!("{:.1} µrad", 1e6 * middle)
    } else {
        format!("{middle:.4} mm")
    };
    let limit = worst.remark.as_ref().map_or_else(String::new, |remark| format!("; {remark}"));
    let more = if of < poses || of <= ONE_BY_ONE {
        String::new()
    } else {
        format!("; the {ONE_BY_ONE} visited most are given one by one")
    };
    format!("largest of {of} poses, pose {pose}; their median is {unit}{limit}{more}")
}

fn too_few(n: usize, needed: usize) -> Option<String> {
    (n < needed).then(|| format!("{n} visits, the standard asks for {needed}"))
}

fn mean(vectors: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let n = vectors.len().max(1) as f64;
    vectors.sum::<Vector3<f64>>() / n
}

fn barycentre(visits: &[Visit]) -> Point3<f64> {
    mean(visits.iter().map(|visit| visit.attained.coords)).into()
}

fn positioning_accuracy(visits: &[Visit]) -> f64 {
    mean(visits.iter().map(Visit::error)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visits_without_a_command_show_how_they_repeat_and_nothing_else() {
        let visit = |(station, x): (usize, f64)| Visit {
            station,
            start: Stamp::from_ns(0),
            from: None,
            commanded: Point3::origin(),
            attained: Point3::new(x, 0.0, 0.0),
            orientation: None,
        };
        let visits = [(0, 1.0), (1, 1.2), (2, 1.1), (3, 1.1)].map(visit).to_vec();
        let figures = figures(&[Visited { pose: 0, visits }], Says::Repeatability);
        // The distances to 1.1 are 0.1, 0.1, 0, 0: their mean is 0.05 and S_l = √(4 · 0.05² / 3).
        let expected = 0.05 + 3.0 * (4.0 * 0.05_f64.powi(2) / 3.0).sqrt();
        for pose in [None, Some(0)] {
            let own = figures.iter().find(|own| own.pose == pose && own.value.is_some());
            let own = own.expect("of the pose, and over all");
            assert_eq!(own.characteristic, Characteristic::RpL);
            assert!((own.value.unwrap() - expected).abs() < 1e-12);
        }
        let first = &figures[0];
        assert_eq!((first.characteristic, first.value), (Characteristic::ApP, None));
        assert!(figures[1..].iter().all(|own| own.characteristic.is_of_visits()));
    }
}
