//! Several reflectors on one flange, read as points by one instrument: what they identify, and what known distances add.

use nalgebra::{DMatrix, DVector, Vector3};

use super::full::{FullModel, FullSettings, Purpose};
use super::*;
use crate::geometry::{Base, Flange, Target, Tracker, Transform, isometry_from_rpy};
use crate::join::ReadingKind;
use crate::kinematics::RobotFile;

const STATIONS: usize = 60;
/// Places of the reflectors on the flange, mm.
const PLACES: [[f64; 3]; 3] = [[60.0, 20.0, 80.0], [-40.0, 70.0, 60.0], [-10.0, -60.0, 120.0]];

fn arm() -> Arm {
    let text = include_str!("../../../pipelines/robots/ur10.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

fn truth(targets: usize) -> Frames {
    let base = isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
    let target = |place: &[f64; 3]| Transform::claim(isometry_from_rpy(*place, [0.0; 3]));
    let targets: Vec<Transform<Flange, Target>> = PLACES[..targets].iter().map(target).collect();
    let base: Transform<Tracker, Base> = Transform::claim(base);
    Frames::new(vec![base], targets).expect("some of each")
}

fn axes(place: usize) -> Vec<f64> {
    let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
    let angle = |joint: usize| {
        let turn = (place + 1) as f64 * [2.0, 3.0, 5.0, 7.0, 11.0, 13.0_f64][joint].sqrt();
        middle[joint] + 2.4 * (turn.fract() - 0.5)
    };
    (0..6).map(angle).collect()
}

/// Each reflector at each station, without noise.
fn seen(arm: &Arm, targets: usize) -> Vec<Observation> {
    let (frames, noise) = (truth(targets), noise());
    let observation = |(station, target): (usize, usize)| {
        let pair = frames.pair(SourceId::ONLY, TargetId(target));
        let flange = arm.chain().nominal(&axes(station));
        let pose = pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry();
        let position = pose.translation.vector.into();
        let instrument = noise.sources[0].uncertainty.covariance(&position);
        Observation {
            target: TargetId(target),
            ..Observation::planned(station, axes(station), position, instrument)
        }
    };
    let each = (0..STATIONS).flat_map(|station| (0..targets).map(move |target| (station, target)));
    each.map(observation).collect()
}

fn noise() -> Noise {
    let uncertainty = TrackerUncertainty {
        range_um: 10.0,
        range_um_per_m: 0.3,
        transverse_um: 15.0,
        transverse_um_per_m: 6.0,
        divisor: 2.0,
        orientation_rad: None,
    };
    let reads = ReadingKind::Point;
    Noise::of_one(Source { reads, uncertainty: uncertainty.into() }, 0.03)
}

/// Names of the reflectors, and the distances among them.
fn settings(sd_mm: f64) -> FitSettings {
    let names = ["a", "b", "c"];
    let distance = |(one, other): (usize, usize)| {
        let away = Vector3::from(PLACES[one]) - Vector3::from(PLACES[other]);
        KnownDistance {
            between: [names[one], names[other]].map(str::to_owned),
            mm: away.norm(),
            sd_mm,
        }
    };
    FitSettings {
        target_names: names.map(str::to_owned).to_vec(),
        target_distances: [(0, 1), (0, 2), (1, 2)].map(distance).to_vec(),
        ..FitSettings::default()
    }
}

/// Whitened rows of all readings below each other, one column for each unknown.
fn jacobian(problem: &Problem<'_>, at: &DVector<f64>) -> DMatrix<f64> {
    let mut columns = vec![Vec::new(); at.len()];
    problem.each_block(at, |block| {
        for (unknown, column) in columns.iter_mut().enumerate() {
            match block.unknowns.iter().position(|own| *own == unknown) {
                Some(place) => column.extend_from_slice(block.column(place)),
                None => column.extend(vec![0.0; block.column(0).len()]),
            }
        }
    });
    DMatrix::from_fn(columns[0].len(), at.len(), |row, column| columns[column][row])
}

/// Number of singular values of the column-scaled matrix that are not zeros to rounding.
fn rank(matrix: &DMatrix<f64>) -> usize {
    let norms: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
    let kept: Vec<usize> = (0..norms.len()).filter(|&k| norms[k] > 1e-9).collect();
    let scaled = DMatrix::from_fn(matrix.nrows(), kept.len(), |row, place| {
        matrix[(row, kept[place])] / norms[kept[place]]
    });
    let values = scaled.singular_values();
    let floor = 1e-10 * values.max();
    values.iter().filter(|&&value| value > floor).count()
}

/// Directions that the readings of so many free reflectors identify, of base, arm and places together.
fn free_directions(targets: usize) -> usize {
    let (arm, starts) = (arm(), [truth(targets)]);
    let observed = seen(&arm, targets);
    let prior = Prior::default();
    let problem = Problem::new(&observed, arm.chain(), &starts, Freedom::Geometry, &prior);
    Structure::of(&problem, &DVector::zeros(problem.unknowns.len())).rank
}

/// Directions that are left to the readings where distances among the reflectors are known exactly: those along which no distance
/// changes.
fn directions_at_known_distances(targets: usize) -> usize {
    let (arm, starts) = (arm(), [truth(targets)]);
    let observed = seen(&arm, targets);
    let prior = settings(0.01).prior();
    let problem = Problem::new(&observed, arm.chain(), &starts, Freedom::Geometry, &prior);
    let at = DVector::zeros(problem.unknowns.len());
    let mut distances = DMatrix::<f64>::zeros(3, at.len());
    for (row, distance) in problem.distances(&at).enumerate() {
        for (unknown, by) in distance.entries {
            distances[(row, unknown)] += by;
        }
    }
    // Rows of the distances are orthogonal to what they leave: I − Dᵀ (D Dᵀ)⁺ D.
    let gram: DMatrix<f64> = &distances * distances.transpose();
    let inverse: DMatrix<f64> = gram.pseudo_inverse(1e-9).expect("a small matrix");
    let along: DMatrix<f64> = distances.transpose() * inverse * &distances;
    let left: DMatrix<f64> = DMatrix::<f64>::identity(at.len(), at.len()) - along;
    rank(&(jacobian(&problem, &at) * left))
}

#[test]
fn three_reflectors_identify_what_one_cannot() {
    // Base, arm and places together: 4 · 6 joints + 6 of a flange whose pose is seen, less the three turns that one point does not
    // show, or the one about the line through two. Each free distance among them is a direction of its own.
    assert_eq!(free_directions(1), 27);
    assert_eq!(free_directions(2), 29 + 1);
    assert_eq!(free_directions(3), 30 + 3);
    // At known distances the reflectors are one rigid target: three show what a 6-DoF target shows, two lack the turn about their
    // line, so that the 30 of two are with a free distance.
    assert_eq!(directions_at_known_distances(1), 27);
    assert_eq!(directions_at_known_distances(2), 29);
    assert_eq!(directions_at_known_distances(3), 30);
}

#[test]
fn the_rows_of_known_distances_are_the_numerical_ones() {
    let (arm, starts) = (arm(), [truth(3), truth(3)]);
    let prior = settings(0.02).prior();
    let problem = Problem::new(&[], arm.chain(), &starts, Freedom::Geometry, &prior);
    // Away from the starts, so that no residual is zero.
    let at = DVector::from_fn(problem.unknowns.len(), |i, _| (i as f64 * 0.7).sin());
    let rows: Vec<_> = problem.distances(&at).collect();
    assert_eq!(rows.len(), 2 * 3, "three distances in each of two sessions");
    let residual = |row: usize, unknown: usize, by: f64| {
        let mut moved = at.clone();
        moved[unknown] += by;
        problem.distances(&moved).nth(row).expect("a row").residual
    };
    for (place, row) in rows.iter().enumerate() {
        assert!(row.residual.abs() > 1.0, "{}", row.residual);
        let mut analytic = vec![0.0; at.len()];
        for (unknown, by) in row.entries {
            analytic[unknown] += by;
        }
        let moving = analytic.iter().filter(|by| **by != 0.0).count();
        assert_eq!(moving, 6, "two places of three coordinates");
        for (unknown, analytic) in analytic.iter().enumerate() {
            let ahead = residual(place, unknown, 1e-4);
            let numerical = (residual(place, unknown, -1e-4) - ahead) / 2e-4;
            assert!((numerical - analytic).abs() < 1e-4, "{unknown}: {numerical} for {analytic}");
        }
    }
}

/// Distance between the first two targets of a session, mm.
fn apart(frames: &Frames) -> f64 {
    let place = |target: usize| frames.targets()[target].isometry().translation.vector;
    (place(0) - place(1)).norm()
}

#[test]
fn a_known_distance_holds_against_readings_of_a_wrong_one() {
    let arm = arm();
    let mut observed = seen(&arm, 3);
    // The second reflector is read 0.1 mm off along the first station's line from the first one, in the flange's axes: every
    // reading says that the two are further apart than they are.
    let line = (Vector3::from(PLACES[1]) - Vector3::from(PLACES[0])).normalize() * 0.1;
    for observation in &mut observed {
        let flange = arm.chain().nominal(&observation.axes).rotation;
        let turn = truth(3).sources()[0].isometry().rotation * flange;
        if observation.target == TargetId(1) {
            let point = observation.measured.point_mut().expect("a position");
            point.position += turn * line;
        }
    }
    let known_mm = (Vector3::from(PLACES[1]) - Vector3::from(PLACES[0])).norm();
    let found = |settings: &FitSettings| {
        identify(&arm, &observed, 1, Freedom::Geometry, settings).expect("a fit")
    };
    let full = |settings: &FitSettings, start: &Calibration| {
        let sizes = FullSettings { harmonics: 2, gear_lines: false, ..FullSettings::default() };
        let (frames, geometry) = (&start.frames, &start.geometry);
        let prior = settings.prior();
        let model = FullModel::train(
            &arm,
            &observed,
            (&frames[..], &geometry[..]),
            &prior,
            &sizes,
            Purpose::Published,
            None,
        );
        apart(&model.expect("a model").fitted_frames()[0]) - known_mm
    };
    let free = found(&FitSettings::default());
    assert!((apart(&free.frames[0]) - known_mm - 0.1).abs() < 1e-3);
    assert!((full(&FitSettings::default(), &free) - 0.1).abs() < 1e-2);
    // At 1 µm the distances decide, at 10 mm the readings.
    let (firm, loose) = (settings(1e-3), settings(10.0));
    let held = found(&firm);
    assert!((apart(&held.frames[0]) - known_mm).abs() < 1e-2);
    assert!(full(&firm, &held).abs() < 1e-2);
    let mild = found(&loose);
    assert!((apart(&mild.frames[0]) - known_mm - 0.1).abs() < 1e-3);
}

#[test]
fn places_are_stated_by_name_and_strange_names_are_refused() {
    let arm = arm();
    let observed = seen(&arm, 3);
    let place = |target: usize, sd_mm| KnownTarget { xyz_mm: PLACES[target], sd_mm };
    let mut settings = settings(0.01);
    settings.targets.insert("c".to_owned(), place(2, 1e-3));
    let prior = settings.prior();
    assert_eq!(prior.targets, [None, None, Some(place(2, 1e-3))]);
    let pairs: Vec<_> = prior.distances.iter().map(|own| own.between).collect();
    let pair = |a, b| [TargetId(a), TargetId(b)];
    assert_eq!(pairs, [pair(0, 1), pair(0, 2), pair(1, 2)]);
    let found = identify(&arm, &observed, 1, Freedom::BaseAndTarget, &settings).expect("a fit");
    let off = found.frames[0].targets()[2]
        .isometry()
        .translation
        .vector
        .metric_distance(&Vector3::from(PLACES[2]));
    assert!(off < 1e-3, "{off} mm");

    settings.targets.insert("d".to_owned(), place(0, 1.0));
    let refused = identify(&arm, &observed, 1, Freedom::BaseAndTarget, &settings);
    let said = refused.map(|_| ()).expect_err("no such target").to_string();
    assert!(said.contains("\"d\"") && said.contains("a, b, c"), "{said}");
}
