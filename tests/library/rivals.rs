//! Rivals of the full error model on stations that took no part in their training.

use crate::common;

use std::sync::Arc;

use common::NOISE;
use common::trained::random_sessions;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use posegrid::figures::{CHI_SQUARED_3_95, Figures, clustered_mean};
use posegrid::fit::full::{FullModel, FullSettings};
use posegrid::fit::model::{At, Query};
use posegrid::fit::models::{Models, train_all};
use posegrid::fit::rivals::idw::{Idw, Space};
use posegrid::fit::rivals::kriging::Kriging;
use posegrid::fit::rivals::{Rival, Sample, samples, slides};
use posegrid::fit::{
    Blocks, FitSettings, IdentifiedGeometry, Model, Observation, PoseModel, Purpose,
    TrainingSettings,
};
use posegrid::geometry::align;
use posegrid::kinematics::Arm;

/// The models of a training; with `rivals`, those on top of the identified geometry too.
fn models(arm: &Arm, observations: &[Observation], rivals: bool) -> Models {
    let settings = TrainingSettings {
        fit: &FitSettings::default(),
        full: &FullSettings::default(),
        up: Some(Vector3::z_axis()),
        carrying: None,
        purpose: Purpose::Published,
        rivals,
    };
    train_all(arm, observations, 1, &settings).expect("a fit")
}

/// Stations 0, s, 2s, … of a session.
fn every(observations: &[Observation], stride: usize, count: usize) -> Vec<Observation> {
    let is_used = |o: &&Observation| o.station.is_multiple_of(stride) && o.station < stride * count;
    observations.iter().filter(is_used).cloned().collect()
}

/// What a model leaves of a session: error norms, the share inside the 95 % ellipsoids, and their mean radius (that of a ball of their volume).
struct Left {
    figures: Figures,
    inside: f64,
    radius_mm: f64,
}

/// Residuals with their covariances, where the model states them.
type Residuals = Vec<(Vector3<f64>, Option<Matrix3<f64>>)>;

/// Residuals and their covariances, in the tracker's frame; `own` of a session that the model knows.
fn residuals(model: &dyn PoseModel, test: &[Observation], own: bool) -> Residuals {
    let predict = |o: &Observation| {
        let query = Query { session: 0, own, ..Query::of(o) };
        model.predict(&At::Joints(query)).expect("joint angles")
    };
    let predicted: Vec<_> = test.iter().map(predict).collect();
    let points: Vec<Point3<f64>> = predicted.iter().map(|own| own.position).collect();
    let measured: Vec<Point3<f64>> = test.iter().map(common::position).collect();
    let base = if own {
        Isometry3::identity()
    } else {
        align(&points, &measured, &vec![1.0; test.len()]).expect("stations in space")
    };
    let turn = base.rotation.to_rotation_matrix();
    let each = predicted.iter().zip(test).zip(&measured);
    each.map(|((predicted, o), measured)| {
        let covariance = predicted.open.as_ref().map(|open| {
            let shared = model.covariances(&open.rows)[0];
            shared + open.alone + turn * model.noise(o, o.session) * turn.transpose()
        });
        (base * measured - predicted.position, covariance)
    })
    .collect()
}

fn left(residuals: &Residuals) -> Left {
    let norms: Vec<f64> = residuals.iter().map(|(own, _)| own.norm()).collect();
    let distance = |(own, covariance): &(Vector3<f64>, Option<Matrix3<f64>>)| {
        Some(own.dot(&(covariance.as_ref()?.try_inverse()? * own)))
    };
    let distances: Vec<f64> = residuals.iter().filter_map(distance).collect();
    let inside = distances.iter().filter(|own| **own <= CHI_SQUARED_3_95).count();
    let radius = |(_, covariance): &(_, Option<Matrix3<f64>>)| {
        Some(CHI_SQUARED_3_95.sqrt() * covariance.as_ref()?.determinant().powf(1.0 / 6.0))
    };
    let radii: Vec<f64> = residuals.iter().filter_map(radius).collect();
    Left {
        figures: Figures::of(&norms).expect("stations"),
        inside: inside as f64 / distances.len() as f64,
        radius_mm: radii.iter().sum::<f64>() / radii.len() as f64,
    }
}

/// The rivals that learn these errors, on top of a model.
fn rivals(
    arm: &Arm,
    under: &Arc<dyn PoseModel>,
    samples: &[Sample<'_>],
) -> Vec<(&'static str, Arc<dyn PoseModel>)> {
    let slides = slides(arm);
    let on =
        |map: Option<Kriging>| map.map(|map| Arc::new(Rival::new(Arc::clone(under), map)) as _);
    let idw = |space| {
        let map = Idw::new(samples, space)?;
        Some(Arc::new(Rival::new(Arc::clone(under), map)) as _)
    };
    let all: Vec<(&str, Option<Arc<dyn PoseModel>>)> = vec![
        ("kriging of all joints", on(Kriging::new(samples, &slides))),
        ("inverse distances, joints", idw(Space::Joints(slides.clone()))),
        ("inverse distances, space", idw(Space::Position)),
        #[cfg(feature = "learned")]
        ("neural network", {
            let began = std::time::Instant::now();
            let map = posegrid::fit::rivals::network::Network::new(samples, &slides);
            println!(
                "network of {} stations: {:.1} s",
                samples.len(),
                began.elapsed().as_secs_f64()
            );
            map.map(|map| Arc::new(Rival::new(Arc::clone(under), map)) as _)
        }),
    ];
    let made = all.into_iter().filter_map(|(name, model)| Some((name, model?)));
    made.collect()
}

/// The errors that the full error model leaves of each station when it is trained without it.
fn left_out<'s>(full: &FullModel, train: &'s [Observation]) -> Vec<Sample<'s>> {
    let mut samples = samples(full, train);
    let base = full.frames()[0].sources()[0];
    for (own, left) in samples.iter_mut().zip(&full.left_out) {
        let left = Vector3::new(left[0], left[1], left[2]);
        own.error = base.isometry().inverse_transform_vector(&left);
    }
    samples
}

/// Every model of a training with its name: those of a run, and the rivals on top of base and target alone, of the geometry and of the
/// full error model. The full error model is the first.
fn all(arm: &Arm, train: &[Observation]) -> Vec<(String, Arc<dyn PoseModel>)> {
    let models = models(arm, train, false);
    let full = models.full.expect("a positive definite model");
    let of_full = left_out(&full, train);
    let base_target = IdentifiedGeometry::from(&models.base_target);
    let geometry = IdentifiedGeometry::from(&models.geometric);
    let (of_base_target, of_geometry) = (samples(&base_target, train), samples(&geometry, train));
    let unders: [(&str, Arc<dyn PoseModel>, Vec<Sample<'_>>); 3] = [
        ("full error model", Arc::new(full), of_full),
        ("base and target", Arc::new(base_target), of_base_target),
        ("geometry", Arc::new(geometry), of_geometry),
    ];
    let mut all = Vec::new();
    for (under_name, under, samples) in unders {
        all.push((under_name.to_owned(), Arc::clone(&under)));
        for (name, rival) in rivals(arm, &under, &samples) {
            all.push((format!("{under_name} + {name}"), rival));
        }
    }
    all
}

/// Mean difference of error norms from those of another model, and its standard error, stations of one of 64 blocks counted together, mm.
fn difference(own: &Residuals, other: &Residuals, test: &[Observation]) -> (f64, f64) {
    let positions: Vec<Point3<f64>> = test.iter().map(common::position).collect();
    let blocks = Blocks::default().cells(&positions).into_iter();
    let blocks: Vec<[u64; 3]> = blocks.map(|block| block.map(f64::to_bits)).collect();
    let differences = own.iter().zip(other);
    let differences: Vec<f64> = differences.map(|((a, _), (b, _))| a.norm() - b.norm()).collect();
    clustered_mean(&differences, &blocks).expect("several blocks")
}

#[test]
fn rivals_learn_more_than_geometry_and_less_than_the_full_error_model() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let models = models(&arm, &every(&a, 3, 200), true);
    let mean = |model: Model| {
        let model = models.get(model).expect("trained");
        left(&residuals(model, &b, false)).figures.mean
    };
    let (geometry, full) = (mean(Model::Geometric), mean(Model::Full));
    let kriging = mean(Model::KrigingJoints);
    println!("geometry {geometry:.4}, kriging {kriging:.4}, full {full:.4} mm");
    assert!(full < kriging && kriging < geometry);
    for idw in [Model::IdwJoints, Model::IdwSpace] {
        let idw = mean(idw);
        assert!(kriging < idw, "kriging {kriging:.4}, inverse distances {idw:.4} mm");
    }
}

/// The table of the guide: random-a predicts random-b, the base refitted.
#[test]
#[ignore = "a proof of minutes"]
fn every_model_at_100_200_and_700_stations() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    for (stride, count) in [(7, 100), (3, 200), (1, 700)] {
        let mut full: Option<Residuals> = None;
        for (name, model) in all(&arm, &every(&a, stride, count)) {
            let own = residuals(&*model, &b, false);
            let left = left(&own);
            let (more, se) = difference(&own, full.get_or_insert_with(|| own.clone()), &b);
            println!(
                "{count} stations, {name}: mean {:.4} p95 {:.3} max {:.3} mm, {:.1} % inside, radius {:.3} mm, {more:+.4} ± {se:.4} mm",
                left.figures.mean,
                left.figures.p95,
                left.figures.max,
                100.0 * left.inside,
                left.radius_mm
            );
        }
    }
}

/// The lowest and the highest quarter of each joint's measured range are left out of the training and judged, in the frames of the training.
#[test]
#[ignore = "a proof of minutes"]
fn left_out_joint_ranges() {
    let arm = common::arm("ur10");
    let Some((a, _)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let mut by_model: Vec<(Model, Residuals)> = Vec::new();
    for joint in 0..6 {
        let own = |o: &Observation| o.axes[joint];
        let low = a.iter().map(own).fold(f64::INFINITY, f64::min);
        let high = a.iter().map(own).fold(f64::NEG_INFINITY, f64::max);
        let quarter = 0.25 * (high - low);
        for is_out in [
            &(|o: &Observation| own(o) < low + quarter) as &dyn Fn(&Observation) -> bool,
            &|o: &Observation| own(o) > high - quarter,
        ] {
            let (test, train): (Vec<_>, Vec<_>) = a.iter().cloned().partition(is_out);
            println!("joint {}: {} left out of {}", joint + 1, test.len(), a.len());
            let models = models(&arm, &train, true);
            for &model in Model::ALL {
                let Some(trained) = models.get(model) else {
                    continue;
                };
                let own = residuals(trained, &test, true);
                match by_model.iter_mut().find(|(known, _)| *known == model) {
                    Some((_, all)) => all.extend(own),
                    None => by_model.push((model, own)),
                }
            }
        }
    }
    for (model, residuals) in by_model {
        let left = left(&residuals);
        println!(
            "{}: mean {:.4} mm, {:.1} % inside, radius {:.3} mm, n {}",
            model.about().name,
            left.figures.mean,
            100.0 * left.inside,
            left.radius_mm,
            residuals.len()
        );
    }
}
