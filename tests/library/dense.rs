//! The joint curves' Fourier features against the dense Gaussian process that they stand for.

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};
use posegrid::fit::full::FullSettings;
use posegrid::fit::full::components::Components;
use posegrid::fit::full::design::PoseView;
use posegrid::fit::full::layout::{Block, Layout};
use posegrid::fit::full::regression::Sums;
use posegrid::fit::full::spectrum::Kernel;
use posegrid::fit::observation::measured::Shown;
use posegrid::kinematics::{Axes, Twist};

use crate::common;

const JOINTS: usize = 6;
const NOISE_MM: f64 = 0.03;

/// Joint angles that fill ±1.2 rad about a bent arm: fractions of multiples of irrational numbers.
fn angles(station: usize) -> Vec<f64> {
    let middle = [0.0, -1.2, 1.5, -1.9, -1.6, 0.0];
    let place = |joint: usize| {
        let share =
            ((station + 1) as f64 * [0.414, 0.732, 0.236, 0.646, 0.317, 0.606][joint]).fract();
        middle[joint] + 2.4 * (share - 0.5)
    };
    (0..JOINTS).map(place).collect()
}

/// How the flange moves with each joint, mm/rad.
fn twists(arm: &posegrid::kinematics::Arm, angles: &[f64]) -> Vec<Twist> {
    let chain = arm.chain();
    chain.differential(angles, &vec![0.0; chain.parameters().len()]).joints
}

fn rows(twists: &[Twist], angles: &[f64], layout: &Layout) -> DMatrix<f64> {
    let view = PoseView {
        unknowns: &[],
        joints: twists,
        axes: &Axes::default(),
        end: Point3::origin(),
        up: None,
        base: Matrix3::identity(),
        angles,
        settling_error: None,
        session: None,
        time: None,
        middle: Point3::origin(),
    };
    view.rows(layout, &Shown::Point)
}

/// `Σ_j J_j k(q_j − q'_j) J'_jᵀ`, the kernels without their constant, which the joint offsets own.
fn dense(left: &[(Vec<f64>, Vec<Twist>)], right: &[(Vec<f64>, Vec<Twist>)]) -> DMatrix<f64> {
    let settings = FullSettings::default();
    let (short, long) =
        (settings.short_length_deg.to_radians(), settings.long_length_deg.to_radians());
    let constant =
        Kernel::Matern52(short).variances(0)[0] + Kernel::SquaredExponential(long).variances(0)[0];
    let kernel = |difference: f64| {
        let chord = 2.0 * (0.5 * difference).sin().abs();
        let a = 5.0_f64.sqrt() * chord / short;
        let near = (1.0 + a + a * a / 3.0) * (-a).exp();
        let far = (-0.5 * (chord / long).powi(2)).exp();
        settings.curve_sd_rad.powi(2) * (near + far - constant)
    };
    let mut covariance = DMatrix::zeros(3 * left.len(), 3 * right.len());
    for (i, (q, j)) in left.iter().enumerate() {
        for (k, (p, l)) in right.iter().enumerate() {
            let block = (0..JOINTS).fold(Matrix3::zeros(), |sum, joint| {
                sum + j[joint].linear * l[joint].linear.transpose() * kernel(q[joint] - p[joint])
            });
            covariance.fixed_view_mut::<3, 3>(3 * i, 3 * k).copy_from(&block);
        }
    }
    covariance
}

/// The largest distance between predictions by features of so many harmonics and by the dense process, mm.
fn apart(harmonics: usize, period_turns: u32) -> f64 {
    let arm = common::arm("ur10");
    let pose = |station: usize| {
        let angles = angles(station);
        let twists = twists(&arm, &angles);
        (angles, twists)
    };
    let train: Vec<_> = (0..120).map(pose).collect();
    let test: Vec<_> = (200..260).map(pose).collect();
    // Errors of about 0.5 mm that change with every joint.
    let error = |(q, j): &(Vec<f64>, Vec<Twist>)| {
        (0..JOINTS).fold(Vector3::zeros(), |sum, joint| {
            sum + j[joint].linear * 3e-4 * ((2.0 * q[joint]).sin() + 0.3 * (17.0 * q[joint]).cos())
        })
    };
    let values = DVector::from_iterator(
        3 * train.len(),
        train.iter().flat_map(|pose| <[f64; 3]>::from(error(pose))),
    );

    let settings =
        FullSettings { harmonics, curve_period_turns: period_turns, ..FullSettings::default() };
    let mut layout = Layout::new(period_turns);
    for joint in 0..JOINTS {
        layout.push(Block::Curve(joint), 2 * harmonics * period_turns as usize);
    }
    let stacked = |poses: &[(Vec<f64>, Vec<Twist>)]| {
        let mut all = DMatrix::zeros(3 * poses.len(), layout.size());
        for (place, (angles, twists)) in poses.iter().enumerate() {
            all.rows_mut(3 * place, 3).copy_from(&rows(twists, angles, &layout));
        }
        all
    };
    let variances = Components::new(&layout, &[], &settings, 1.0).variances();
    let sums = Sums::new(&(stacked(&train) / NOISE_MM), &(&values / NOISE_MM), 0.0);
    let mean = sums.posterior_at(variances.map(f64::sqrt)).expect("positive definite").mean();
    let by_features = stacked(&test) * mean;

    let noise = DMatrix::identity(values.len(), values.len()) * NOISE_MM.powi(2);
    let factor = (dense(&train, &train) + noise).cholesky().expect("positive definite");
    let by_process = dense(&test, &train) * factor.solve(&values);
    (by_features - by_process).amax()
}

#[test]
fn two_hundred_harmonics_are_the_dense_process() {
    let (all, default) = (apart(200, 1), apart(FullSettings::default().harmonics, 1));
    println!(
        "200 harmonics within {all:.6} mm of the dense process, the default within {default:.4} mm"
    );
    assert!(all < 1e-3, "{all} mm");
    assert!(default < 1e-3, "{default} mm");
}

#[test]
fn a_longer_period_is_nearly_the_same_process_within_a_turn() {
    // Two turns away a curve need not come back; within ±1.2 rad both know the same.
    let (one, two) = (apart(90, 1), apart(90, 2));
    println!(
        "period of one turn {one:.4} mm, of two {two:.4} mm from the dense process of one turn"
    );
    assert!(two < 5e-3, "{two} mm");
}
