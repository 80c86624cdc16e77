//! Accuracy and repeatability of one pose.
//!
//! Angles are components of rotation vectors about the frame's axes: from the commanded to the mean attained orientation, and
//! from the mean to each attained one, means on SO(3). For errors of an arm they are the standard's differences of the angles
//! a, b, c to their square, without the singularities of Euler angles.

use nalgebra::{UnitQuaternion, Vector3};

use super::{
    Characteristic, Figure, Orientation, VISITS, Visited, barycentre, mean, positioning_accuracy,
    too_few,
};
use crate::figures::Figures;
use crate::join::average::mean_orientation;

/// `AP_p` and its components, and those of the orientation where it was measured and commanded.
pub(super) fn accuracy(own: &Visited) -> Vec<Figure> {
    let error = mean(own.visits.iter().map(super::Visit::error));
    let mut figures = vec![figure(own, Characteristic::ApP, positioning_accuracy(&own.visits))];
    let axes = [Characteristic::ApX, Characteristic::ApY, Characteristic::ApZ];
    figures.extend(along(own, axes, error));
    let axes = [Characteristic::ApA, Characteristic::ApB, Characteristic::ApC];
    let turn = orientations(own).and_then(|all| turn(&all));
    figures.extend(turn.into_iter().flat_map(|turn| along(own, axes, turn)));
    figures
}

/// `RP_l`, and the repeatability of the orientation where it was measured.
pub(super) fn repeatability(own: &Visited) -> Vec<Figure> {
    let middle = barycentre(&own.visits);
    let away: Vec<f64> = own.visits.iter().map(|visit| (visit.attained - middle).norm()).collect();
    let repeatability = Figures::of(&away).map(|l| l.mean_plus_3_sd());
    let mut figures: Vec<Figure> =
        repeatability.map(|rp| of_two(figure(own, Characteristic::RpL, rp))).into_iter().collect();
    let axes = [Characteristic::RpA, Characteristic::RpB, Characteristic::RpC];
    let spread = orientations(own).and_then(|all| spread(&all));
    figures.extend(spread.into_iter().flat_map(|sd| along(own, axes, 3.0 * sd)));
    figures
}

/// A row without a value where orientations were measured, but none was commanded to compare them with.
pub(super) fn missing(visited: &[Visited]) -> Option<Figure> {
    let all = visited.iter().flat_map(|own| &own.visits);
    let mut measured = all.filter_map(|visit| visit.orientation).peekable();
    let is_missing = measured.peek().is_some() && measured.all(|o| o.commanded.is_none());
    is_missing.then(|| {
        let remark = "no commanded orientation to compare the attained ones with: the log has none, or not those that were sent";
        Figure::missing(Characteristic::ApA, VISITS, remark)
    })
}

/// Two visits are equally far from their barycentre: then `l̄ + 3 S_l` is half their distance.
fn of_two(figure: Figure) -> Figure {
    let remark = match figure.remark {
        Some(remark) if figure.n == 2 => {
            Some(format!("{remark}; with two visits, S_l is zero whatever the arm does"))
        }
        other => other,
    };
    Figure { remark, ..figure }
}

fn figure(own: &Visited, characteristic: Characteristic, value: f64) -> Figure {
    let n = own.visits.len();
    let (pose, remark) = (Some(own.pose), too_few(n, VISITS));
    Figure { characteristic, pose, value: Some(value), n, n_needed: VISITS, remark }
}

fn along(
    own: &Visited,
    axes: [Characteristic; 3],
    vector: Vector3<f64>,
) -> impl Iterator<Item = Figure> {
    let components: [f64; 3] = vector.into();
    axes.into_iter().zip(components).map(|(axis, value)| figure(own, axis, value))
}

fn orientations(own: &Visited) -> Option<Vec<Orientation>> {
    own.visits.iter().map(|visit| visit.orientation).collect()
}

fn mean_attained(all: &[Orientation]) -> Option<UnitQuaternion<f64>> {
    let attained: Vec<[f64; 4]> = all.iter().map(|o| o.attained.coords.into()).collect();
    mean_orientation(&attained).map(|(mean, _)| mean)
}

/// Rotation from the commanded to the mean attained orientation, rad.
fn turn(all: &[Orientation]) -> Option<Vector3<f64>> {
    let commanded = all.first()?.commanded?;
    Some((mean_attained(all)? * commanded.inverse()).scaled_axis())
}

/// Standard deviation (n − 1) of the attained orientation about each axis, rad.
fn spread(all: &[Orientation]) -> Option<Vector3<f64>> {
    let mean = mean_attained(all)?;
    let squares: Vector3<f64> = all
        .iter()
        .map(|o| (o.attained * mean.inverse()).scaled_axis())
        .map(|turn| turn.component_mul(&turn))
        .sum();
    Some((squares / (all.len() - 1) as f64).map(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::super::Visit;
    use super::*;
    use crate::units::Stamp;

    fn visited(errors: &[[f64; 3]], turns: Option<&[[f64; 3]]>) -> Visited {
        let commanded = Point3::new(1000.0, -200.0, 300.0);
        let upright = UnitQuaternion::from_euler_angles(0.3, 1.2, -2.0);
        let visit = |(place, error): (usize, &[f64; 3])| Visit {
            station: 10 + place,
            start: Stamp::from_ns(0),
            from: None,
            commanded,
            attained: commanded + Vector3::from(*error),
            orientation: turns.map(|turns| Orientation {
                commanded: Some(upright),
                attained: UnitQuaternion::from_scaled_axis(Vector3::from(turns[place])) * upright,
            }),
        };
        Visited { pose: 10, visits: errors.iter().enumerate().map(visit).collect() }
    }

    fn value(figures: &[Figure], characteristic: Characteristic) -> f64 {
        let mut own = figures.iter().filter(|figure| figure.characteristic == characteristic);
        own.next()
            .and_then(|figure| figure.value)
            .unwrap_or_else(|| panic!("{characteristic:?} in {figures:?}"))
    }

    #[test]
    fn accuracy_and_repeatability_are_those_of_a_hand_calculation() {
        // Barycentre (1, 2, 2) off the command: AP_p = 3. Distances to it 2, 2, 1, 1: l̄ = 1.5, S_l = √(4 · 0.25 / 3).
        let own =
            visited(&[[3.0, 2.0, 2.0], [-1.0, 2.0, 2.0], [1.0, 3.0, 2.0], [1.0, 1.0, 2.0]], None);
        let accuracy = accuracy(&own);
        let axes = [Characteristic::ApX, Characteristic::ApY, Characteristic::ApZ];
        for (characteristic, expected) in
            [Characteristic::ApP].iter().chain(&axes).zip([3.0, 1.0, 2.0, 2.0])
        {
            assert!((value(&accuracy, *characteristic) - expected).abs() < 1e-12);
        }
        assert_eq!(accuracy.len(), 4, "no orientation, no angles");
        let repeatability = repeatability(&own);
        let expected = 1.5 + 3.0 * (1.0_f64 / 3.0).sqrt();
        assert!((value(&repeatability, Characteristic::RpL) - expected).abs() < 1e-12);
        let remark = repeatability[0].remark.as_deref();
        assert_eq!(remark, Some("4 visits, the standard asks for 30"));
    }

    #[test]
    fn angles_are_about_the_frames_own_axes() {
        // Mean turn (0.2, 0, −0.1) mrad; about x ±0.1 mrad around it: S = √(2 · 0.1² / 1) mrad.
        let turns = [[3e-4, 0.0, -1e-4], [1e-4, 0.0, -1e-4]];
        let own = visited(&[[0.0; 3]; 2], Some(&turns));
        let accuracy = accuracy(&own);
        let expected =
            [(Characteristic::ApA, 2e-4), (Characteristic::ApB, 0.0), (Characteristic::ApC, -1e-4)];
        for (characteristic, expected) in expected {
            // Rotation vectors add up to their products: 1e-8.
            assert!((value(&accuracy, characteristic) - expected).abs() < 3e-8);
        }
        let repeatability = repeatability(&own);
        let three_sd = 3.0 * 2.0_f64.sqrt() * 1e-4;
        assert!((value(&repeatability, Characteristic::RpA) - three_sd).abs() < 3e-8);
        assert!(value(&repeatability, Characteristic::RpC).abs() < 3e-8);
    }

    #[test]
    fn orientations_that_were_not_commanded_are_reported() {
        let mut own = visited(&[[0.0; 3]; 2], Some(&[[0.0; 3]; 2]));
        assert_eq!(missing(std::slice::from_ref(&own)), None);
        for visit in &mut own.visits {
            visit.orientation = visit.orientation.map(|o| Orientation { commanded: None, ..o });
        }
        assert_eq!(accuracy(&own).len(), 4, "positions alone");
        let told = missing(&[own]).expect("measured, and not commanded");
        assert!(told.value.is_none() && told.characteristic == Characteristic::ApA);
        assert_eq!(missing(&[visited(&[[0.0; 3]; 2], None)]), None);
    }

    #[test]
    fn thirty_visits_carry_no_remark_and_two_say_what_they_cannot_show() {
        let thirty = repeatability(&visited(&[[0.0; 3]; 30], None));
        assert_eq!((thirty[0].n, thirty[0].remark.as_deref()), (30, None));
        let two = repeatability(&visited(&[[0.0; 3], [0.0, 0.0, 0.1]], None));
        assert!((value(&two, Characteristic::RpL) - 0.05).abs() < 1e-12);
        assert!(two[0].remark.as_ref().is_some_and(|remark| remark.contains("S_l is zero")));
    }
}
