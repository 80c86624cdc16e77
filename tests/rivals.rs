//! Rivals of the full error model on stations that took no part in their training.

mod common;

use std::sync::Arc;

use common::NOISE;
use common::trained::random_sessions;
use nalgebra::{Matrix3, Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::full::FullSettings;
use posegrid::fit::model::{At, Query};
use posegrid::fit::models::{Models, train_all};
use posegrid::fit::rivals::idw::{Idw, Space};
use posegrid::fit::rivals::kriging::Kriging;
use posegrid::fit::rivals::{Rival, slides};
use posegrid::fit::{
    FitSettings, IdentifiedGeometry, Model, Observation, PoseModel, TrainingSettings,
};
use posegrid::geometry::align;
use posegrid::kinematics::Arm;

/// The 95 % quantile of chi squared with three degrees of freedom.
const CHI_SQUARED_3_95: f64 = 7.814_727_903;

/// The models of a training, with their rivals on top of the identified geometry.
fn models(arm: &Arm, observations: &[Observation]) -> Models {
    let settings = TrainingSettings {
        fit: &FitSettings::default(),
        full: &FullSettings::default(),
        up: Some(Vector3::z_axis()),
        rivals: true,
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

/// Residuals with their covariances, in the tracker's frame; `own` of a session that the model knows.
fn residuals(
    model: &dyn PoseModel,
    test: &[Observation],
    own: bool,
) -> Vec<(Vector3<f64>, Option<Matrix3<f64>>)> {
    let predict = |o: &Observation| {
        let query = Query {
            session: 0,
            own,
            ..Query::of(o)
        };
        model.predict(&At::Joints(query)).expect("joint angles")
    };
    let predicted: Vec<_> = test.iter().map(predict).collect();
    let points: Vec<Point3<f64>> = predicted.iter().map(|own| own.position).collect();
    let measured: Vec<Point3<f64>> = test.iter().map(common::position).collect();
    let base = align(&points, &measured, &vec![1.0; test.len()]).expect("stations in space");
    let base = if own {
        nalgebra::Isometry3::identity()
    } else {
        base
    };
    let turn = base.rotation.to_rotation_matrix();
    let each = predicted.iter().zip(test).zip(&measured);
    each.map(|((predicted, o), measured)| {
        let covariance = predicted.open.as_ref().map(|open| {
            let shared = model.covariances(&open.rows)[0];
            shared + open.alone + turn * model.noise(o) * turn.transpose()
        });
        (base * measured - predicted.position, covariance)
    })
    .collect()
}

fn left(residuals: &[(Vector3<f64>, Option<Matrix3<f64>>)]) -> Left {
    let norms: Vec<f64> = residuals.iter().map(|(own, _)| own.norm()).collect();
    let distance = |(own, covariance): &(Vector3<f64>, Option<Matrix3<f64>>)| {
        Some(own.dot(&(covariance.as_ref()?.try_inverse()? * own)))
    };
    let distances: Vec<f64> = residuals.iter().filter_map(distance).collect();
    let inside = distances
        .iter()
        .filter(|own| **own <= CHI_SQUARED_3_95)
        .count();
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

/// A rival on top of a model, by its name.
fn rival(
    arm: &Arm,
    (name, under): (&str, &Arc<dyn PoseModel>),
    train: &[Observation],
) -> Option<Rival> {
    let (slides, under) = (slides(arm), Arc::clone(under));
    match name {
        "kriging of all joints" => Rival::learn(under, train, |own| Kriging::new(own, &slides)),
        "inverse distances, joints" => {
            Rival::learn(under, train, |own| Idw::new(own, Space::Joints(slides)))
        }
        _ => Rival::learn(under, train, |own| Idw::new(own, Space::Position)),
    }
}

const RIVALS: [&str; 3] = [
    "kriging of all joints",
    "inverse distances, joints",
    "inverse distances, space",
];

/// Every model of a training with its name: those of a run, and the rivals on top of base and target alone and of the full error model.
fn all(arm: &Arm, train: &[Observation]) -> Vec<(String, Arc<dyn PoseModel>)> {
    let models = models(arm, train);
    let base_target = Arc::new(IdentifiedGeometry::from(&models.base_target));
    let geometry = Arc::new(IdentifiedGeometry::from(&models.geometric));
    let full = Arc::new(models.full.expect("a positive definite model"));
    let unders: [(&str, Arc<dyn PoseModel>); 3] = [
        ("base and target", base_target),
        ("geometry", geometry),
        ("full error model", full),
    ];
    let mut all = Vec::new();
    for (under_name, under) in unders {
        all.push((under_name.to_owned(), Arc::clone(&under)));
        for name in RIVALS {
            let rival = rival(arm, (name, &under), train);
            let rival = rival.expect("errors to learn from");
            all.push((format!("{under_name} + {name}"), Arc::new(rival) as _));
        }
    }
    all
}

#[test]
fn rivals_learn_more_than_geometry_and_less_than_the_full_error_model() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let models = models(&arm, &every(&a, 3, 200));
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
        assert!(
            kriging < idw,
            "kriging {kriging:.4}, inverse distances {idw:.4} mm"
        );
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
        for (name, model) in all(&arm, &every(&a, stride, count)) {
            let left = left(&residuals(&*model, &b, false));
            println!(
                "{count} stations, {name}: mean {:.4} p95 {:.3} max {:.3} mm, {:.1} % inside, radius {:.3} mm",
                left.figures.mean,
                left.figures.p95,
                left.figures.max,
                100.0 * left.inside,
                left.radius_mm
            );
        }
    }
}

/// Quarters of a joint's measured range, lowest and highest, are left out of the training and judged.
#[test]
#[ignore = "a proof of minutes"]
fn left_out_joint_ranges() {
    let arm = common::arm("ur10");
    let Some((a, _)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let mut by_model: Vec<(Model, Vec<(Vector3<f64>, Option<Matrix3<f64>>)>)> = Vec::new();
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
            println!(
                "joint {}: {} left out of {}",
                joint + 1,
                test.len(),
                a.len()
            );
            let models = models(&arm, &train);
            for (model, _) in Model::compared() {
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
