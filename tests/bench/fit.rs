//! What the fits cost: geometry alone, the full error model, its predictions, beside a dense Gaussian process.
//!
//! `cargo bench --bench fit` simulates sessions of a UR10 at random joint angles and prints wall times from one run:
//! the identification of 1000 stations in every convention, with three reflectors, one more fit at the same poses, the training of the full error model on 800, on 200
//! and on 5000, one evaluation of the evidence (covariance matrix, Cholesky factor, solve) by a dense Gaussian process of
//! the same short and long kernels on 200, of which a search of hyper-parameters needs tens, and predictions a second.
//! Without `--bench` (as `cargo test` calls it) small sessions show that it works.

#[path = "../common/mod.rs"]
mod common;

use std::time::Instant;

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::{FullModel, FullSettings, Purpose, Query};
use posegrid::fit::{
    self, At, Calibration, FitSettings, Freedom, Observation, PoseModel as _, TargetId,
};
use posegrid::geometry::isometry_from_rpy;
use posegrid::join::{JoinSettings, join};
use posegrid::kinematics::{Arm, Convention, RobotFile};
use posegrid::simulate::{Poses, SimulateSettings, simulate};

/// Reported joint angles about which poses are drawn, and how far to either side, degrees.
const HOME_DEG: [f64; 6] = [0.0, -70.0, 90.0, -110.0, -90.0, 0.0];
const SPREAD_DEG: f64 = 40.0;

fn main() {
    let full_size = std::env::args().any(|arg| arg == "--bench");
    let [most_of_all, many, most, few] =
        if full_size { [5000, 1000, 800, 200] } else { [60, 60, 50, 40] };
    let arm = ur10();
    let all = observed(&arm, most_of_all);
    let stations = &all[..many];
    println!("{:<58} {:>12} {:>10}", "step", "wall ms", "ratio");

    let repeats = if full_size { 9 } else { 1 };
    let calibration = identified(&arm, stations);
    let unknowns = calibration.unknowns.len();
    let base = median_ms(repeats, || identified(&arm, stations).frames.len());
    let what = format!("identify: {} stations, {unknowns} unknowns", stations.len());
    row(&what, base, base);
    for (convention, arm) in restated() {
        let median = median_ms(repeats, || identified(&arm, stations).frames.len());
        let unknowns = identified(&arm, stations).unknowns.len();
        row(&format!("the same, {convention}, {unknowns} unknowns"), median, base);
    }

    let three = reflectors(stations, &calibration);
    let median = median_ms(repeats, || identified(&arm, &three).frames.len());
    row("the same stations, three reflectors", median, base);

    let (model, large) = timed_ms(|| trained(&arm, &stations[..most], &calibration));
    row(&format!("full error model: {most} stations"), large, base);
    let (_, median) = timed_ms(|| {
        let three = reflectors(&stations[..most], &calibration);
        trained(&arm, &three, &identified(&arm, &three))
    });
    row("the same stations, three reflectors, with its start", median, base);
    let (_, small) = timed_ms(|| trained(&arm, &stations[..few], &calibration));
    row(&format!("full error model: {few} stations"), small, base);
    let (_, largest) = timed_ms(|| trained(&arm, &all, &calibration));
    row(&format!("full error model: {} stations", all.len()), largest, base);
    let jacobians: Vec<DMatrix<f64>> = stations[..few].iter().map(|o| jacobian(&arm, o)).collect();
    let dense = median_ms(repeats.min(3), || dense_evidence(&stations[..few], &jacobians));
    row(&format!("one evidence of a dense process: {few} stations"), dense, base);

    let (_, mean) =
        timed_ms(|| stations.iter().map(|o| model.position(&Query::of(o)).x).sum::<f64>());
    per_second("predictions, mean, one core", stations.len(), mean);
    let queries: Vec<Query<'_>> =
        (0..if full_size { 200 } else { 1 }).flat_map(|_| stations.iter().map(Query::of)).collect();
    let at: Vec<At<'_>> = queries.into_iter().map(At::Joints).collect();
    let (_, mean) = timed_ms(|| model.positions(&at).len());
    per_second("predictions, mean, all cores", at.len(), mean);
    let (rows, mean) = timed_ms(|| predicted(&model, stations));
    let (_, covariance) =
        timed_ms(|| rows.iter().map(|rows| model.covariances(rows).len()).sum::<usize>());
    per_second("predictions, mean and covariance", stations.len(), mean + covariance);
}

fn ur10_file() -> RobotFile {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/robots/ur10.toml");
    let text = std::fs::read_to_string(path).expect("part of the project");
    toml::from_str(&text).expect("a robot file")
}

fn ur10() -> Arm {
    ur10_file().arm().expect("an arm")
}

/// The bench's arm in every other convention, with the convention's word.
fn restated() -> Vec<(&'static str, Arm)> {
    let others = Convention::ALL.into_iter().filter(|own| *own != Convention::StandardDh);
    let arm = |convention: Convention| {
        let file = ur10_file().restated(convention).expect("the same arm");
        (convention.word(), file.arm().expect("an arm"))
    };
    others.map(arm).collect()
}

/// A simulated session, joined: observations with what their commands fell short of.
fn observed(arm: &Arm, count: usize) -> Vec<Observation> {
    let home = HOME_DEG.map(f64::to_radians);
    let spread = SPREAD_DEG.to_radians();
    let poses = Poses::Joints {
        count,
        lower: home.iter().map(|q| q - spread).collect(),
        upper: home.iter().map(|q| q + spread).collect(),
    };
    let mut settings = SimulateSettings::realistic(7, home.to_vec(), poses);
    settings.tracker.lost_share = 0.0;
    let cell = settings.cell;
    let simulated = simulate(arm, &settings).expect("reachable poses");
    let read = common::read_back(arm, &simulated.recording);
    let joined = join(&read.input, arm, &JoinSettings::default()).expect("one session");
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0; 3]),
        flange_from_tool: Some(isometry_from_rpy(
            cell.flange_from_target_mm,
            cell.flange_from_target_rpy,
        )),
    };
    let mut observations = fit::observations(0, &joined.stations, arm, &common::NOISE);
    let commanded = commanded(&joined.stations, arm, &frames);
    fit::add_commands(&mut observations, &joined.stations, &commanded);
    assert_eq!(observations.len(), count, "no station is lost");
    observations
}

/// The stations with two more reflectors, 130 mm from the first on a flange that is where `by` predicts it.
fn reflectors(stations: &[Observation], by: &Calibration) -> Vec<Observation> {
    const PLACES: [[f64; 3]; 3] = [[0.0; 3], [130.0, 0.0, 0.0], [40.0, 120.0, 10.0]];
    let base = *by.frames[0].sources()[0].isometry();
    let readings = stations.iter().flat_map(|own| {
        let flange = base.rotation * by.chain.nominal(&own.axes).rotation;
        let reading = move |(target, place): (usize, [f64; 3])| {
            let mut read = Observation { target: TargetId(target), ..own.clone() };
            let point = read.measured.point_mut().expect("positions are read");
            point.position += flange * Vector3::from(place);
            read
        };
        PLACES.into_iter().enumerate().map(reading)
    });
    readings.collect()
}

fn identified(arm: &Arm, stations: &[Observation]) -> Calibration {
    let settings = FitSettings::default();
    fit::identify(arm, stations, 1, Freedom::Geometry, &settings).expect("a fit")
}

fn trained(arm: &Arm, stations: &[Observation], start: &Calibration) -> FullModel {
    FullModel::train(
        arm,
        stations,
        (&start.frames[..], &start.geometry[..]),
        &FitSettings::default().prior(),
        &FullSettings::default(),
        Purpose::Published,
        Some(Vector3::z_axis()),
    )
    .expect("a positive definite model")
}

/// Predicts every station; gives the rows of a hundred at a time, stacked.
fn predicted(model: &FullModel, stations: &[Observation]) -> Vec<DMatrix<f64>> {
    let rows = |o: &Observation| model.predict(&Query::of(o)).rows;
    let rows: Vec<DMatrix<f64>> = stations.iter().map(rows).collect();
    let stacked = |rows: &[DMatrix<f64>]| {
        let columns = rows[0].ncols();
        let row = |row: usize, column: usize| rows[row / 3][(row % 3, column)];
        DMatrix::from_fn(3 * rows.len(), columns, row)
    };
    rows.chunks(100).map(stacked).collect()
}

/// How the flange moves with each joint, mm/rad, by central differences.
fn jacobian(arm: &Arm, station: &Observation) -> DMatrix<f64> {
    const STEP_RAD: f64 = 1e-6;
    let chain = arm.chain();
    let at = |joint: usize, step: f64| {
        let mut axes = station.axes.clone();
        axes[joint] += step;
        chain.nominal(&axes).translation.vector
    };
    let column = |joint| (at(joint, STEP_RAD) - at(joint, -STEP_RAD)) / (2.0 * STEP_RAD);
    let columns: Vec<Vector3<f64>> = (0..station.axes.len()).map(column).collect();
    DMatrix::from_fn(3, columns.len(), |row, joint| columns[joint][row])
}

/// One evaluation of the evidence of `cov(e, e') = Σ_j J_j k_j(q_j, q'_j) J'_jᵀ`: Matérn 3/2 and squared exponential, on
/// chords.
fn dense_evidence(stations: &[Observation], jacobians: &[DMatrix<f64>]) -> usize {
    let settings = FullSettings::default();
    let short = 3.0_f64.sqrt() / settings.short_length_deg.to_radians();
    let long = settings.long_length_deg.to_radians().recip();
    let kernel = |difference: f64| {
        let chord = 2.0 * (difference / 2.0).sin().abs();
        let near = (1.0 + short * chord) * (-short * chord).exp();
        let far = (-0.5 * (long * chord).powi(2)).exp();
        settings.curve_sd_rad.powi(2) * (near + far)
    };
    let size = 3 * stations.len();
    let mut covariance = DMatrix::identity(size, size) * settings.noise_mm.powi(2);
    for (a, (one, left)) in stations.iter().zip(jacobians).enumerate() {
        for (b, (other, right)) in stations.iter().zip(jacobians).enumerate() {
            let kernels = one.axes.iter().zip(&other.axes).map(|(p, q)| kernel(p - q));
            let kernels = DMatrix::from_diagonal(&DVector::from_iterator(one.axes.len(), kernels));
            let mut block = covariance.view_mut((3 * a, 3 * b), (3, 3));
            block += left * kernels * right.transpose();
        }
    }
    let factor = Cholesky::new(covariance).expect("a positive definite kernel");
    factor.solve(&DVector::from_element(size, 1.0)).len()
}

fn timed_ms<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

/// Median wall time of `repeats` runs of work that has a result to show.
fn median_ms(repeats: usize, work: impl Fn() -> usize) -> f64 {
    let mut times: Vec<f64> = (0..repeats)
        .map(|_| {
            let (result, time) = timed_ms(&work);
            assert!(result > 0, "the work was done");
            time
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[repeats / 2]
}

fn row(step: &str, wall_ms: f64, base_ms: f64) {
    println!("{step:<58} {wall_ms:>12.2} {:>10.1}", wall_ms / base_ms);
}

fn per_second(step: &str, count: usize, wall_ms: f64) {
    let rate = count as f64 / wall_ms * 1e3;
    println!("{step:<58} {wall_ms:>12.2} {rate:>10.0} a second");
}
