//! Kriging against closed forms, against inverse matrices, and its gradient against differences.

use super::*;
use crate::fit::rivals::test::{place, sample};

fn kernel(lengths: &[f64], nugget: f64) -> Kernel {
    Kernel {
        shape: Shape::SquaredExponential,
        lengths: lengths.to_vec(),
        nugget,
        slides: vec![false; lengths.len()],
    }
}

/// Two joints at places without order, with a smooth error.
fn joints(count: u32) -> Vec<[f64; 2]> {
    (0..count)
        .map(|i| [(1.3 * f64::from(i)).sin() * 1.5, (2.9 * f64::from(i) + 0.4).cos()])
        .collect()
}

fn smooth(joints: &[[f64; 2]]) -> Vec<Sample<'_>> {
    joints
        .iter()
        .enumerate()
        .map(|(i, q)| {
            let mut of =
                sample(q, [0.0; 3], 0.3 * (1.5 * q[0]).sin() + 0.05 * (i as f64 * 7.7).sin());
            of.error.y = 0.2 * q[0].cos() * (0.7 * q[1]).sin() + 0.05 * (i as f64 * 3.1).cos();
            of.error.z = 0.1 * q[1] + 0.02 * (i as f64 * 5.3).sin();
            of
        })
        .collect()
}

#[test]
fn one_station_says_its_error_times_its_correlation() {
    // C = 1.25; σ² = e²/1.25 = 0.2; at a chord of one length r = e^{−1/2} = 0.60653.
    let samples = [sample(&[0.0], [0.0; 3], 0.5)];
    let map = Kriging::with_kernel(&samples, kernel(&[2.0 * 0.25_f64.sin()], 0.25)).expect("one");
    let at = map.at(&place(&[0.5], [0.0; 3]));
    assert!((at.error.x - 0.606_530_66 * 0.5 / 1.25).abs() < 1e-8, "{at:?}");
    // σ² (1 − r²/1.25) = 0.2 (1 − 0.36788/1.25) = 0.141139, and the nugget 0.05 beyond 0.01 mm² of measurement.
    assert!((at.variance.x - (0.141_139_29 + 0.04)).abs() < 1e-8, "{at:?}");
    // Half a turn away at this length nothing is known: chord 2 rad over 0.495 rad.
    let far = map.at(&place(&[std::f64::consts::PI], [0.0; 3]));
    assert!(far.error.x < 2e-4 && (far.variance.x - 0.24).abs() < 1e-4, "{far:?}");
}

#[test]
fn inverse_matrices_say_the_same() {
    let joints = joints(40);
    let samples = smooth(&joints);
    let kernel = kernel(&[0.8, 1.1], 0.05);
    let map = Kriging::with_kernel(&samples, kernel).expect("a positive definite matrix");
    let correlation = |a: &[f64; 2], b: &[f64; 2]| {
        let square = |axis: usize, length: f64| {
            let chord = 2.0 * ((a[axis] - b[axis]) / 2.0).sin();
            chord * chord / (length * length)
        };
        (-(square(0, 0.8) + square(1, 1.1)) / 2.0).exp()
    };
    let dense = DMatrix::from_fn(40, 40, |i, k| {
        correlation(&joints[i], &joints[k]) + if i == k { 0.05 } else { 0.0 }
    });
    let inverse = dense.try_inverse().expect("an inverse");
    let at = [0.3, -0.2];
    let row = DVector::from_fn(40, |i, _| correlation(&at, &joints[i]));
    let found = map.at(&place(&at, [0.0; 3]));
    for axis in 0..3 {
        let errors = DVector::from_fn(40, |i, _| samples[i].error[axis]);
        let mean = row.dot(&(&inverse * &errors));
        let size = errors.dot(&(&inverse * &errors)) / 40.0;
        let variance = size * (1.0 - row.dot(&(&inverse * &row))) + (0.05 * size - 0.01).max(0.0);
        assert!((found.error[axis] - mean).abs() < 1e-9, "{found:?} {mean}");
        assert!((found.variance[axis] - variance).abs() < 1e-9, "{found:?} {variance}");
    }
}

#[test]
fn the_gradient_is_that_of_differences() {
    let joints = joints(30);
    let samples = smooth(&joints);
    for shape in Shape::ALL {
        let likelihood = Likelihood::new(&samples, &[false, false], shape).expect("stations");
        let at = DVector::from_vec(vec![0.2, -0.3, -2.0]);
        let analytic = likelihood.at(&at).expect("positive definite").gradient;
        for own in 0..3 {
            let value = |by: f64| {
                let mut moved = at.clone();
                moved[own] += by;
                likelihood.at(&moved).expect("positive definite").value
            };
            let numerical = (value(1e-5) - value(-1e-5)) / 2e-5;
            let apart = (analytic[own] - numerical).abs();
            assert!(apart < 1e-5, "{shape:?} {own}: {analytic} {numerical}");
        }
    }
}

#[test]
fn shapes_are_the_textbook_s() {
    // At a separation of one length: e^{−1/2}, (1 + √3) e^{−√3}, e^{−1}.
    let expected = [0.606_530_66, 0.483_357_72, 0.367_879_44];
    for (shape, expected) in Shape::ALL.into_iter().zip(expected) {
        assert!((shape.at(1.0).0 - expected).abs() < 1e-8, "{shape:?}");
        assert!((shape.at(0.0).0 - 1.0).abs() < 1e-15, "{shape:?}");
    }
}

#[test]
fn the_most_likely_kernel_is_better_than_its_starts_and_stands_still() {
    let joints = joints(60);
    let samples = smooth(&joints);
    let map = Kriging::new(&samples, &[false, false]).expect("a kernel");
    let own = map.kernel();
    let logarithms = |kernel: &Kernel| {
        let all = kernel.lengths.iter().chain([&kernel.nugget]);
        DVector::from_iterator(3, all.map(|own| own.ln()))
    };
    let likelihood = Likelihood::new(&samples, &[false, false], own.shape).expect("stations");
    let best = likelihood.at(&logarithms(own)).expect("the optimum");
    for shape in Shape::ALL {
        let other = Likelihood::new(&samples, &[false, false], shape).expect("stations");
        for start in STARTS {
            let start = kernel(&[start, start], START_NUGGET);
            let start = other.at(&logarithms(&start)).expect("a start");
            assert!(best.value >= start.value, "{} {}", best.value, start.value);
        }
    }
    assert!(best.gradient.amax() < 0.5, "{own:?} {}", best.gradient);
}

#[test]
fn errors_of_nothing_make_no_kernel() {
    let joints = joints(5);
    let samples: Vec<_> = joints.iter().map(|q| sample(q, [0.0; 3], 0.0)).collect();
    assert!(Kriging::new(&samples, &[false, false]).is_none());
    assert!(Kriging::new(&samples[..1], &[false, false]).is_none());
}
