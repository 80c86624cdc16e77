//! The network on errors of known shape: what it learns, its bytes, its coverage, and what it says outside the measured ranges.

use super::*;
use crate::fit::rivals::test::sample_at;

/// Places and smooth errors of two joints, with noise of 0.02 mm; the work space is the joints, 500 mm a rad.
fn stations(count: u32, low: f64, high: f64, seed: f64) -> Vec<([f64; 2], Vector3<f64>)> {
    let own = |i: u32| {
        let part = |by: f64| (f64::from(i) * by + seed).fract();
        let q = [low + (high - low) * part(0.754_877_67), low + (high - low) * part(0.569_840_29)];
        // Numbers without order that are as good as noise here.
        let noise = |by: f64| 0.028 * (f64::from(i) * by + 31.0 * seed).sin();
        let error = Vector3::new(
            0.3 * (1.4 * q[0]).sin() + noise(127.1),
            0.2 * q[0].cos() * q[1].sin() + noise(311.7),
            0.1 * q[1] + noise(74.7),
        );
        (q, error)
    };
    (0..count).map(own).collect()
}

fn samples(stations: &[([f64; 2], Vector3<f64>)]) -> Vec<Sample<'_>> {
    let each = stations.iter();
    each.map(|(q, error)| sample_at(q, [500.0 * q[0], 500.0 * q[1], 0.0], *error, 1e-6)).collect()
}

fn inside(map: &Network, test: &[Sample<'_>]) -> f64 {
    let is_inside = |own: &&Sample<'_>| {
        let at = map.at(&own.place);
        let off = own.error - at.error;
        let total = at.variance.add_scalar(own.measured_variance);
        off.component_mul(&off).component_div(&total).sum() <= CHI_SQUARED_3_95
    };
    test.iter().filter(is_inside).count() as f64 / test.len() as f64
}

#[test]
fn it_learns_a_smooth_error_says_how_well_and_has_the_same_bytes() {
    let (known, unseen) = (stations(240, -1.5, 1.5, 0.1), stations(200, -1.4, 1.4, 0.7));
    let (known, unseen) = (samples(&known), samples(&unseen));
    let map = Network::new(&known, &[false, false]).expect("enough stations");
    let rms = |error: &dyn Fn(&Sample<'_>) -> Vector3<f64>| {
        let squares = unseen.iter().map(|own| error(own).norm_squared());
        (squares.sum::<f64>() / unseen.len() as f64).sqrt()
    };
    let (before, after) = (rms(&|own| own.error), rms(&|own| own.error - map.at(&own.place).error));
    println!("{before:.4} → {after:.4} mm, noise 0.034 mm; {:.3} inside", inside(&map, &unseen));
    assert!(after < 0.3 * before, "{before} → {after} mm");
    assert!(inside(&map, &unseen) > 0.88);
    let repeated = Network::new(&known, &[false, false]).expect("enough stations");
    for own in &unseen {
        assert_eq!(map.at(&own.place), repeated.at(&own.place));
    }
}

#[test]
fn outside_the_measured_range_it_says_that_it_does_not_know() {
    let (known, beyond) = (stations(240, -0.8, 0.8, 0.1), stations(200, 1.3, 2.0, 0.7));
    let (known, beyond) = (samples(&known), samples(&beyond));
    let map = Network::new(&known, &[false, false]).expect("enough stations");
    for own in &beyond {
        let at = map.at(&own.place);
        // Half a radian away nothing is left of the network.
        assert!(at.error.norm() < 1e-4, "{at:?}");
        assert!((at.variance - map.unknown.sup(&at.variance)).norm() < 1e-4);
    }
}

#[test]
fn few_stations_make_no_network() {
    let known = stations(45, -1.0, 1.0, 0.1);
    assert!(Network::new(&samples(&known), &[false, false]).is_none());
}

#[test]
fn of_nineteen_the_largest_is_the_conformal_quantile_and_of_a_hundred_the_96th() {
    assert_eq!((rank(19), rank(39), rank(100)), (19, 38, 96));
}

#[test]
fn it_learns_what_a_temperature_does_and_fades_outside_the_measured_ones() {
    let (known, unseen) = (stations(300, -1.5, 1.5, 0.1), stations(150, -1.4, 1.4, 0.7));
    // 0.03 mm a degree along y, from 18 to 26 °C without order.
    let celsius = |place: usize| 18.0 + 8.0 * (0.618_033_99 * place as f64).fract();
    let warm = |stations: &[([f64; 2], Vector3<f64>)]| {
        let each = stations.iter().enumerate();
        let error = |(place, (q, error)): (usize, &([f64; 2], Vector3<f64>))| {
            (*q, error + Vector3::y() * (0.03 * (celsius(place) - 22.0)))
        };
        each.map(error).collect::<Vec<_>>()
    };
    let (known, unseen) = (warm(&known), warm(&unseen));
    let [told_known, told_unseen] = [&known, &unseen].map(|stations| {
        let mut samples = samples(stations);
        for (place, own) in samples.iter_mut().enumerate() {
            own.place.temperature_c = Some(celsius(place));
        }
        samples
    });
    let rms_y = |map: &Network, test: &[Sample<'_>]| {
        let squares = test.iter().map(|own| (own.error - map.at(&own.place).error).y.powi(2));
        (squares.sum::<f64>() / test.len() as f64).sqrt()
    };
    let told = Network::new(&told_known, &[false, false]).expect("enough stations");
    let untold = Network::new(&samples(&known), &[false, false]).expect("enough stations");
    let (told_mm, untold_mm) = (rms_y(&told, &told_unseen), rms_y(&untold, &samples(&unseen)));
    println!("{told_mm:.4} mm with temperatures, {untold_mm:.4} mm without");
    assert!(told_mm < 0.6 * untold_mm, "{told_mm} {untold_mm}");
    let at = |celsius: f64| {
        let mut own = samples(&unseen[..1]).remove(0);
        own.place.temperature_c = Some(celsius);
        told.at(&own.place)
    };
    let (inside, outside) = (at(22.0), at(60.0));
    assert!(outside.error.norm() < 1e-9, "{outside:?}");
    assert!(outside.variance.y > inside.variance.y, "{inside:?} {outside:?}");
}
