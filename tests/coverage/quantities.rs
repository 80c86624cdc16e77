//! What is counted in one session: normalised errors of everything the model gives an interval for.

use nalgebra::{DMatrix, Vector3};
use posegrid::fit::Observation;
use posegrid::fit::full::layout::Block;
use posegrid::fit::full::{Known, Query};
use posegrid::geometry::Transform;
use posegrid::kinematics::{Motion, Parameter};

use super::session::Session;
use super::tally::{Count, Tally};

/// An interval counts as told apart when its standard deviation is below this share of its prior's (METHOD.md 3).
const TOLD_APART: f64 = 0.5;

pub fn of(session: &Session) -> Tally {
    let mut tally = Tally::default();
    parameters(session, &mut tally);
    curves(session, &mut tally);
    positions(session, &mut tally);
    tally
}

/// Geometry and target, with the truth as offsets from the model's own start.
fn parameters(session: &Session, tally: &mut Tally) {
    let model = &session.model;
    let start = model.starts()[0].flange_from_target;
    let target = Vector3::from(session.truth.arm.flange_from_target_mm)
        - start.isometry().translation.vector;
    let _: Transform<_, _> = start;
    let links = session.arm.chain().parameters();
    let mut apart = Vec::new();
    let mut all = Vec::new();
    for (place, unknown) in model.unknowns().iter().enumerate() {
        let truth = match unknown.parameter {
            Parameter::Link { .. } => {
                let at = links
                    .iter()
                    .position(|own| *own == unknown.parameter)
                    .expect("a parameter of the arm");
                session.truth.arm.offsets[at]
            }
            Parameter::Target(Motion::Translation(axis)) => axis.unit().dot(&target),
            _ => continue,
        };
        let sd = model.covariance_of(&[place])[(0, 0)].sqrt();
        let error = (model.offsets()[place] - truth) / sd;
        all.push(error);
        if sd < TOLD_APART * model.prior_sd()[place]
            && !matches!(unknown.parameter, Parameter::Target(_))
        {
            apart.push(error);
        }
        if std::env::var_os("SHOW").is_some() {
            println!(
                "{:<10} truth {truth:>10.6} found {:>10.6} sd {sd:>9.6} z {error:>6.2}",
                unknown.parameter.to_string(),
                model.offsets()[place]
            );
        }
    }
    tally.add("parameters, all", Count::of(all));
    tally.add("parameters told apart", Count::of(apart));
}

/// Angles of one joint at which its curve is held against the truth: every twentieth part of the visited ones.
fn visited(session: &Session, joint: usize) -> Vec<f64> {
    let mut angles: Vec<f64> = session.training.iter().map(|o| o.axes[joint]).collect();
    angles.sort_by(f64::total_cmp);
    (1..20).map(|i| angles[i * angles.len() / 20]).collect()
}

/// True error of an axis at axis angles: what curve and gear line add to it, in the sense of the axis.
fn true_curve(session: &Session, joint: usize, angles: &[f64]) -> Vec<f64> {
    let mut unit = vec![0.0; session.arm.joints().len()];
    unit[joint] = 1.0;
    let sign = session.arm.axes(&unit)[joint] - session.arm.axes(&vec![0.0; unit.len()])[joint];
    let arm = &session.truth.arm;
    angles
        .iter()
        .map(|q| sign * (arm.curves[joint].at(sign * q) + arm.gear_lines[joint].at(sign * q)))
        .collect()
}

fn curves(session: &Session, tally: &mut Tally) {
    let (mut published, mut shape, mut shape_apart) = (Vec::new(), Vec::new(), Vec::new());
    for joint in 0..session.arm.joints().len() {
        let angles = visited(session, joint);
        let truth = true_curve(session, joint, &angles);
        let errors = session.model.joint_errors(joint, &angles);
        published.extend(
            errors
                .iter()
                .zip(&truth)
                .map(|(error, truth)| (error.error() - truth) / error.sd),
        );
        for (error, told_apart) in centred(session, joint, &angles, &truth) {
            shape.push(error);
            if told_apart {
                shape_apart.push(error);
            }
        }
    }
    tally.add("curves as published", Count::of(published));
    tally.add("curves' shape, all", Count::of(shape));
    tally.add("curves' shape told apart", Count::of(shape_apart));
}

/// Normalised errors of the curve less its mean over `angles`, and whether each is told apart from its prior.
fn centred(session: &Session, joint: usize, angles: &[f64], truth: &[f64]) -> Vec<(f64, bool)> {
    let model = &session.model;
    let mut columns: Vec<(usize, f64, bool)> = Vec::new();
    for (block, own) in model.layout().blocks() {
        match block {
            Block::Curve(of) if of == joint => {
                for pair in 0..own.len() / 2 {
                    let cycles = (pair + 1) as f64;
                    columns.push((own.start + 2 * pair, cycles, true));
                    columns.push((own.start + 2 * pair + 1, cycles, false));
                }
            }
            Block::Line { joint: of, cycles } if of == joint => {
                columns.push((own.start, cycles, true));
                columns.push((own.start + 1, cycles, false));
            }
            _ => {}
        }
    }
    let mut rows = DMatrix::from_fn(angles.len(), columns.len(), |row, column| {
        let (_, cycles, cosine) = columns[column];
        let (sin, cos) = (cycles * angles[row]).sin_cos();
        if cosine { cos } else { sin }
    });
    let mean = rows.row_mean();
    for mut row in rows.row_iter_mut() {
        row -= &mean;
    }
    let places: Vec<usize> = columns.iter().map(|c| c.0).collect();
    let covariance = model.covariance_of(&places);
    let found = nalgebra::DVector::from_iterator(
        places.len(),
        places.iter().map(|&place| model.column_mean(place)),
    );
    let prior = nalgebra::DVector::from_iterator(
        places.len(),
        places.iter().map(|&place| model.prior_sd()[place].powi(2)),
    );
    let found = &rows * found;
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    (0..angles.len())
        .map(|i| {
            let row = rows.row(i);
            let variance = (row * &covariance * row.transpose())[(0, 0)];
            let before = row.component_mul(&row).transpose().dot(&prior);
            let error = (found[i] - (truth[i] - mean)) / variance.sqrt();
            (error, variance < TOLD_APART.powi(2) * before)
        })
        .collect()
}

fn positions(session: &Session, tally: &mut Tally) {
    let model = &session.model;
    let asked = |name: [&'static str; 3], tally: &mut Tally, known: Option<bool>| {
        let (mut mean, mut visit, mut ellipsoids) = (Vec::new(), Vec::new(), Vec::new());
        for o in &session.fresh {
            let station = session.true_station(o);
            let commanded = session.arm.axes(&station.commanded);
            let short = o.shortfall.as_deref().expect("commands have orientations");
            let (axes, known) = match known {
                Some(true) => (o.axes.as_slice(), Known::Both(short)),
                Some(false) => (o.axes.as_slice(), Known::Reported),
                None => (commanded.as_slice(), Known::Commanded),
            };
            let predicted = model.predict(&query(o, axes, known));
            let covariance = model.covariances(&predicted.rows)[0] + predicted.standing;
            let off = predicted.position.coords - session.attained(o, false);
            mean.extend((0..3).map(|axis| off[axis] / covariance[(axis, axis)].sqrt()));
            let covariance = covariance + model.visit_covariance(&query(o, axes, known));
            let off = predicted.position.coords - session.attained(o, true);
            visit.extend((0..3).map(|axis| off[axis] / covariance[(axis, axis)].sqrt()));
            let solved = covariance.cholesky().expect("positive").solve(&off);
            ellipsoids.push(off.dot(&solved));
        }
        tally.add(name[0], Count::of(mean));
        tally.add(name[1], Count::of(visit));
        tally.add(name[2], Count::of_ellipsoids(ellipsoids));
    };
    asked(
        [
            "position, both, mean",
            "position, both, visit",
            "position, both, visit, ellipsoid",
        ],
        tally,
        Some(true),
    );
    asked(
        [
            "position, reported, mean",
            "position, reported, visit",
            "position, reported, visit, ellipsoid",
        ],
        tally,
        Some(false),
    );
    asked(
        [
            "position, commanded, mean",
            "position, commanded, visit",
            "position, commanded, visit, ellipsoid",
        ],
        tally,
        None,
    );
    let measured = session.fresh.iter().map(|o| {
        let short = o.shortfall.as_deref().expect("commands have orientations");
        let predicted = model.predict(&query(o, &o.axes, Known::Both(short)));
        let covariance = model.covariances(&predicted.rows)[0] + model.noise(o);
        let off = predicted.position - o.position;
        off.dot(&covariance.cholesky().expect("positive").solve(&off))
    });
    tally.add("measured, both, ellipsoid", Count::of_ellipsoids(measured));
}

fn query<'q>(o: &Observation, axes: &'q [f64], known: Known<'q>) -> Query<'q> {
    Query {
        axes,
        known,
        lever: Vector3::zeros(),
        session: 0,
        own: true,
        station: Some(o.station),
    }
}
