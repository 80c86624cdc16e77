//! Every table of a small run written, read back, and compared with its source.

mod example;
mod models;

use std::collections::BTreeMap;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use nalgebra::{Matrix3, Point3, Quaternion, UnitQuaternion, Vector3};

use super::publish;
use crate::files::table::Table;
use crate::fit::full::saved::SavedFull;
use crate::fit::full::{FullModel, Known, Query};
use crate::fit::saved::{SavedCalibration, SavedError};
use crate::fit::{SourceId, TargetId, ToolErrors};
use crate::io::lake::Commit;
use crate::io::lake::Lake;
use crate::io::rows::Word as _;
use crate::io::rows::{Row, Rows};
use crate::io::tables::validity::learnt_from;
use crate::io::tables::words::TableVerdict;
use crate::io::tables::*;
use crate::manifest::RunKey;
use crate::manifest::{Work, canonical};
use crate::page::Statements;
use crate::report;
use crate::units::{Stamp, WallTime};
use example::{ARM, OUTCOME, SESSION, context};

fn work() -> Work {
    Work {
        robot: "kr210".to_owned(),
        session: SESSION.to_owned(),
        pipeline: "nightly".to_owned(),
        sessions: vec![SESSION.to_owned()],
        test_sessions: Vec::new(),
        inputs: Vec::new(),
        settings: canonical(&()).unwrap(),
    }
}

fn key() -> RunKey {
    work().key()
}

fn table<R: Row>(rows: Vec<R>) -> Table {
    R::table(rows, &key()).unwrap().table
}

/// Checks that rows read from the file of their table are those that made it.
fn assert_read_back<R: Row + PartialEq + std::fmt::Debug>(lake: &Lake, rows: &Rows<R>) {
    let table = lake.read(R::TABLE, &key()).unwrap();
    assert_eq!(R::read(&table), rows.rows, "{}", R::TABLE);
}

/// The rows where a text column has a word.
fn rows(table: &Table, column: &str, word: &str) -> Vec<usize> {
    let texts = table.text(column);
    (0..table.rows()).filter(|&row| texts.is_valid(row) && texts.value(row) == word).collect()
}

fn numbers(table: &Table, columns: [&str; 3], row: usize) -> Vector3<f64> {
    Vector3::from(columns.map(|column| table.f64(column).value(row)))
}

fn model_text(kind: &str) -> String {
    let rows = calibrations::rows(&OUTCOME, &context()).unwrap();
    let own = rows.into_iter().find(|row| row.model_kind.word() == kind);
    own.unwrap().model
}

#[test]
fn a_run_is_published_once_and_reads_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let lake = Lake::new(folder.path());
    // Two processes that begin the same run.
    let started = [(); 2].map(|()| lake.start(&key()).unwrap().expect("a new run"));
    let ends = started.map(|run| {
        let rows = RunRows::of(&OUTCOME, &context(), &key()).unwrap();
        publish(&OUTCOME, rows, &context(), run, &work(), &Statements::default()).unwrap()
    });
    assert_eq!(ends, [Commit::Done, Commit::AlreadyThere]);
    assert!(lake.start(&key()).unwrap().is_none());
    let session = SessionRows::of(&OUTCOME.training[0], &ARM, &key()).unwrap();
    let run = RunRows::of(&OUTCOME, &context(), &key()).unwrap();
    for table in session.tables().chain(run.tables()) {
        assert_eq!(&lake.read(&table.schema().table, &key()).unwrap(), table);
        assert!(table.rows() > 0, "{}", table.schema().table);
    }
    // Rows read back from a file are those that made it, in their table's order.
    assert_read_back(&lake, &session.stations);
    assert_read_back(&lake, &session.rejects);
    assert_read_back(&lake, &session.clocks);
    assert_read_back(&lake, &session.reference_motion);
    assert_read_back(&lake, &run.calibrations);
    assert_read_back(&lake, &run.parameters);
    assert_read_back(&lake, &run.scales);
    assert_read_back(&lake, &run.sources);
    assert_read_back(&lake, &run.references);
    assert_read_back(&lake, &run.joint_errors);
    assert_read_back(&lake, &run.residuals);
    assert_read_back(&lake, &run.length_residuals);
    assert_read_back(&lake, &run.semivariograms);
    assert_read_back(&lake, &run.steps);
    assert_read_back(&lake, &run.compensation);
    assert_read_back(&lake, &run.accuracy);
    let runs = lake.read("runs", &key()).unwrap();
    assert_eq!(runs.list("table_names").value_length(0), 17, "sixteen tables and the page");
    assert_eq!(
        runs.text("verdict").value(0),
        TableVerdict::from(&OUTCOME.verdict.verdict()).word()
    );
}

#[test]
fn the_identified_arm_comes_back_and_predicts_as_it_did() {
    let published = table(calibrations::rows(&OUTCOME, &context()).unwrap());
    let file = tempfile::NamedTempFile::new().unwrap();
    let bytes = crate::files::table::write(&published, Vec::new()).unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let back = crate::io::calibrations_table::read(file.path()).unwrap();
    assert_eq!(back.key, key());
    assert_eq!(back.arm.validity.conditions.tool.as_deref(), Some("drill"));
    let command_from_base = back.arm.command_from_base.isometry().to_homogeneous();
    let expected = example::command_from_base().to_homogeneous();
    assert!((command_from_base - expected).abs().max() < 1e-9);
    let (model, session) = (OUTCOME.full.as_ref().unwrap(), OUTCOME.training.len() - 1);
    let own = ToolErrors::new(model, session, &OUTCOME.error_frame);
    let error_frame = back.arm.error_frame();
    let read = ToolErrors::new(&*back.arm.model.predicts, back.arm.model.session, &error_frame);
    let station = learnt_from(&OUTCOME).next().unwrap();
    let (error, covariance) = own.errors_with_covariance(&[&station.joints]).remove(0).unwrap();
    let (read_error, read_covariance) =
        read.errors_with_covariance(&[&station.joints]).remove(0).unwrap();
    assert!(error.norm() > 0.1, "an error worth the name");
    assert!((error - read_error).norm() < 1e-9);
    assert!((covariance - read_covariance).abs().max() < 1e-12);
}

#[test]
fn the_same_outcome_gives_the_same_bytes() {
    let bytes = || -> Vec<Vec<u8>> {
        let session = SessionRows::of(&OUTCOME.training[0], &ARM, &key()).unwrap();
        let run = RunRows::of(&OUTCOME, &context(), &key()).unwrap();
        let all = session.tables().chain(run.tables());
        all.map(|table| crate::files::table::write(table, Vec::new()).unwrap()).collect()
    };
    assert_eq!(bytes(), bytes());
}

#[test]
fn what_came_in_was_kept_or_rejected() {
    let counts = counts::counts(&OUTCOME);
    for count in &counts {
        assert_eq!(count.read, count.kept + count.rejected.values().sum::<u64>(), "{count:?}");
    }
    let dwells = counts.iter().find(|count| count.of == "dwells").unwrap();
    assert_eq!(dwells.read, 45, "3 × 5 × 3 nodes");
    let lost = dwells.rejected["no_readings"];
    assert!(lost > 0);
    // The rejects name the counted items: 3 messages, 64 bytes, 5 readings (one of them in a table), and each lost dwell.
    let table = table(rejects::rows(&OUTCOME.training[0]));
    let sum = |kind: &str| -> i64 {
        rows(&table, "kind", kind).iter().map(|&row| table.i64("number").value(row)).sum()
    };
    assert_eq!([sum("messages"), sum("bytes"), sum("readings")], [3, 64, 5]);
    assert_eq!(sum("dwell"), i64::try_from(lost).unwrap());
    let fit = counts.iter().find(|count| count.stage == "fit").unwrap();
    assert_eq!((fit.read, fit.kept), (45 - lost, 45 - lost));
}

#[test]
fn stations_carry_their_verdict_and_their_command() {
    let table = table(stations::rows(&OUTCOME.training[0], &ARM));
    let lost = rows(&table, "verdict", "unmeasured")[0];
    assert_eq!(table.text("reason").value(lost), "no_readings");
    assert!(table.f64("x_mm").is_null(lost) && table.i64("readings").is_null(lost));
    let paired = rows(&table, "verdict", "paired")[0];
    assert!(table.text("reason").is_null(paired) && table.f64("x_mm").is_valid(paired));
    // The commanded angles bring the nominal tool to the command, as far as the regularised step goes.
    let joints = table.list("commanded_joints_rad").value(paired);
    let joints: Vec<f64> = joints.as_primitive::<Float64Type>().values().to_vec();
    let tool = ARM.flange(&joints).isometry() * Point3::new(25.0, -40.0, 100.0);
    let command = numbers(&table, ["command_x_mm", "command_y_mm", "command_z_mm"], paired);
    assert!((tool.coords - command).norm() < 0.02, "{tool} {command}");
}

#[test]
fn parameters_say_what_is_identifiable() {
    let table = table(parameters::rows(&OUTCOME, &context()));
    let d_4 = rows(&table, "parameter", "d_4");
    assert_eq!(d_4.len(), 2, "geometric and full");
    for row in d_4 {
        assert!(
            (table.f64("nominal").value(row) - 1200.0).abs() < 1e-9,
            "the nominal arm of pipelines/robots"
        );
        let parts = [table.f64("nominal").value(row), table.f64("offset").value(row)];
        assert!((table.f64("identified").value(row) - parts[0] - parts[1]).abs() < 1e-9);
    }
    // From 45 stations in one tool orientation some parameters stay at their prior: the last joint's length and the target
    // trade.
    let geometric = rows(&table, "model", "geometric");
    let weak =
        geometric.iter().filter(|&&row| table.text("identifiability").value(row) != "identifiable");
    assert!(weak.count() > 0);
    let full = rows(&table, "model", "full");
    let (_, geometric) = &OUTCOME.calibrations[1];
    let weights =
        full.iter().filter(|&&row| table.text("quantity").value(row) == "command_weight").count();
    assert_eq!(full.len(), geometric.unknowns.len() + weights);
    // Parameters of the full error model have the standard errors of its own covariance.
    let full_model = OUTCOME.full.as_ref().unwrap();
    let variance = full_model.posterior.covariance_of(&[3])[(0, 0)];
    assert!((table.f64("standard_error").value(full[3]) - variance.sqrt()).abs() < 1e-15);
}

fn query(joints: &[f64]) -> Query<'_> {
    Query {
        axes: joints,
        known: Known::Commanded,
        lever: Vector3::new(1.0, -2.0, 30.0),
        session: 0,
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        own: true,
        station: Some(7),
    }
}

#[test]
fn a_saved_full_model_predicts_as_the_model_did() {
    let saved = SavedFull::read(&model_text("full")).unwrap();
    let (model, again) = (OUTCOME.full.as_ref().unwrap(), FullModel::from_saved(&saved).unwrap());
    for station in &OUTCOME.training[0].joined.stations[..5] {
        let (there, back) =
            (model.predict(&query(&station.joints)), again.predict(&query(&station.joints)));
        assert!((there.position - back.position).norm() < 1e-11, "1e-12 of some metres");
        let (here, then) = (model.covariances(&there.rows)[0], again.covariances(&back.rows)[0]);
        assert!((here - then).norm() < 1e-12 * here.norm(), "{here} {then}");
    }
    // Text restores numbers to the last digit or the one before.
    for (back, there) in again.trained.parts.iter().zip(&model.trained.parts) {
        assert_eq!((back.name, back.kept), (there.name, there.kept));
        assert!((back.gain - there.gain).abs() <= 1e-12 * there.gain.abs());
    }
    assert_eq!(again.trained.parts.len(), model.trained.parts.len());
    assert_eq!(again.trained.layout, model.trained.layout);
    assert!((again.posterior.log_evidence - model.posterior.log_evidence).abs() < 1e-9);
}

/// A way to damage a saved model.
type Damage = fn(&mut SavedFull);

#[test]
fn a_damaged_full_model_is_refused() {
    let sound = SavedFull::read(&model_text("full")).unwrap();
    let error = |change: fn(&mut SavedFull)| {
        let mut saved = sound.clone();
        change(&mut saved);
        FullModel::from_saved(&saved).expect_err("damaged").to_string()
    };
    let cases: [(Damage, &str); 7] = [
        (|s| s.mean.truncate(3), "3 columns"),
        (|s| s.blocks[0].columns = usize::MAX, "columns"),
        (|s| s.blocks[0].columns += 1, "columns"),
        (|s| s.factor.truncate(32), "numbers in the factor"),
        (|s| s.factor.replace_range(..1, "!"), "is not base64"),
        (|s| s.sessions.clear(), "sessions"),
        (|s| s.unknowns[0].parameter = "theta_9".parse().expect("a name"), "theta_9"),
    ];
    for (change, expected) in cases {
        assert!(error(change).contains(expected), "{expected}: {}", error(change));
    }
    let text = model_text("full");
    assert!(matches!(SavedFull::read(&text[..text.len() / 2]), Err(SavedError::Json(_))));
    let unknown = text.replace(r#""parts":[{"name":"joint_curves""#, r#""parts":[{"name":"luck""#);
    let error = SavedFull::read(&unknown).expect_err("no such part").to_string();
    assert!(error.contains("luck"), "{error}");
}

#[test]
fn a_saved_calibration_is_the_arm_that_was_identified() {
    let saved = SavedCalibration::read(&model_text("geometric")).unwrap();
    let (_, calibration) = &OUTCOME.calibrations[1];
    let joints = &OUTCOME.training[0].joined.stations[0].joints;
    let (there, back) = (calibration.chain.nominal(joints), saved.chain().nominal(joints));
    assert!((there.translation.vector - back.translation.vector).norm() < 1e-11);
    let frames = saved.sessions[0].frames().unwrap().one().unwrap();
    let apart = frames.tracker_from_base.origin().coords()
        - calibration.frames[0].one().unwrap().tracker_from_base.origin().coords();
    assert!(apart.norm() < 1e-9);
    assert!((saved.covariance[5][2] - calibration.covariance[(5, 2)]).abs() < 1e-18);
}

#[test]
fn joint_errors_are_those_of_the_model() {
    let table = table(joint_errors::rows(&OUTCOME, &context()));
    let full = OUTCOME.full.as_ref().unwrap();
    let row = table.rows() / 2;
    let joint = usize::try_from(table.i64("joint").value(row)).unwrap() - 1;
    let angle = table.f64("angle_rad").value(row);
    // The error of joint j is the contribution of its curve to the rows of a pose there: by the columns' own coefficients.
    let coefficients = full.coefficients(crate::fit::full::layout::Block::Curve(joint)).unwrap();
    let curve: f64 = (0..coefficients.len() / 2)
        .map(|pair| {
            let (sin, cos) = ((pair + 1) as f64 * angle).sin_cos();
            coefficients[2 * pair] * cos + coefficients[2 * pair + 1] * sin
        })
        .sum();
    assert!((table.f64("curve_rad").value(row) - curve).abs() < 1e-15);
    let deviations = table.f64("sd_rad");
    assert!(deviations.values().iter().all(|&sd| sd > 0.0 && sd < 2e-3));
    assert!(table.bool("measured").true_count() < table.rows());
}

#[test]
fn compensation_is_stated_in_the_frame_of_commands() {
    let table = table(compensation::rows(&OUTCOME, &context(), &key()));
    let chosen = OUTCOME.grids.table.as_ref().expect("a table");
    let node = chosen.nodes.iter().position(|node| node.error.is_ok()).unwrap();
    let (error, covariance) = chosen.nodes[node].error.unwrap();
    let place = numbers(&table, ["x_mm", "y_mm", "z_mm"], node);
    let [x, y, z]: [f64; 3] = chosen.lattice.position(node).coords.into();
    // A quarter turn about z, then the shift: (100 − y, −20 + x, 5 + z).
    assert!((place - Vector3::new(100.0 - y, x - 20.0, 5.0 + z)).norm() < 1e-9);
    let found = numbers(&table, ["error_x_mm", "error_y_mm", "error_z_mm"], node);
    assert!((found - Vector3::new(-error.y, error.x, error.z)).norm() < 1e-12);
    assert!((table.f64("error_cov_xx_mm2").value(node) - covariance[(1, 1)]).abs() < 1e-15);
    assert!((table.f64("error_sd_mm").value(node) - covariance.trace().sqrt()).abs() < 1e-12);
    // As in the stations: the joint ranges, and the target of base and target alone.
    let lists =
        ["joint_lower_rad", "joint_upper_rad"].map(|column| table.list(column).value(node).len());
    assert_eq!(lists, [context().arm.joints().len(); 2]);
    let target = numbers(
        &table,
        ["flange_from_target_x_mm", "flange_from_target_y_mm", "flange_from_target_z_mm"],
        node,
    );
    let frames = OUTCOME.error_frame.frames;
    assert_eq!(target, frames.flange_from_target.origin().coords());
    // The base frame stated in the table brings the node back to its lattice.
    let origin =
        ["x", "y", "z"].map(|axis| table.f64(&format!("command_from_base_{axis}_mm")).value(node));
    let [qx, qy, qz, qw] = ["x", "y", "z", "w"]
        .map(|axis| table.f64(&format!("command_from_base_q{axis}")).value(node));
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    let back = turn.inverse() * (place - Vector3::from(origin));
    assert!((back - Vector3::new(x, y, z)).norm() < 1e-9);
    assert_eq!(table.text("tool").value(node), "drill");
    assert!(table.i64("stations_near").value(node) > 0);
}

#[test]
fn steps_account_for_every_station_that_judges() {
    let table = table(grid_steps::rows(&OUTCOME, &context()));
    assert_eq!(table.rows(), OUTCOME.grids.judged.len());
    assert_eq!(table.bool("chosen").true_count(), 1);
    let paired =
        OUTCOME.training[0].joined.stations.iter().filter(|s| s.one_reading().is_some()).count();
    for row in rows(&table, "source", "model") {
        let parts = ["held_out", "held_out_refused", "held_out_outside", "held_out_unlike"];
        let sum: i64 = parts.iter().map(|part| table.i64(part).value(row)).sum();
        assert_eq!(sum, i64::try_from(paired).unwrap(), "row {row}");
        assert_eq!(table.text("model").value(row), "full");
    }
    // 59 errors are needed for 95 % with 95 % confidence.
    assert_eq!(table.i64("held_out_needed").value(0), 59);
}

#[test]
fn residuals_add_up_and_know_their_distance() {
    let of = |sets: &[report::ResidualSet]| table(residuals::rows(sets, &[]));
    let table = of(&OUTCOME.residuals);
    let residual = &OUTCOME.residuals[0].residuals[0];
    let attained = numbers(&table, ["x_mm", "y_mm", "z_mm"], 0);
    assert!((attained - residual.predicted().coords - residual.residual).norm() < 1e-9);
    // The covariance is a quarter of the identity.
    let distance = table.f64("mahalanobis_squared").value(0);
    assert!((distance - 4.0 * residual.residual.norm_squared()).abs() < 1e-9);
    let mut flat = OUTCOME.residuals.clone();
    flat[0].residuals[0].covariance = Some(Matrix3::zeros());
    let table = of(&flat);
    assert!(
        table.f64("mahalanobis_squared").is_null(0),
        "no distance without a positive definite covariance"
    );
}

#[test]
fn semivariograms_have_bins_models_and_a_word() {
    let table = table(semivariograms::rows(&OUTCOME.semivariograms, Some(1e-3)));
    let (_, found) = &OUTCOME.semivariograms[0];
    let expected: usize = found.iter().map(|s| s.bins.len() + s.models.len()).sum();
    assert_eq!(table.rows(), expected);
    let fitted = rows(&table, "entry", "fitted");
    let best = fitted.iter().filter(|&&row| table.bool("best").value(row)).count();
    assert_eq!(best, found.iter().filter(|s| !s.models.is_empty()).count());
    let norm = rows(&table, "axis", "norm")[0];
    assert!((table.f64("noise_mm2").value(norm) - 3e-3).abs() < 1e-15, "three axes");
    assert!(semivariograms::rows(&[], None).is_empty());
}

#[test]
fn accuracy_says_what_is_not_shown() {
    let table = table(accuracy::rows(
        OUTCOME.accuracy.iter(),
        &OUTCOME.verdict,
        &[],
        &example::TOLERANCE,
        &key(),
        &OUTCOME.starts(),
    ));
    let bounds = rows(&table, "name", "bound");
    assert_eq!(bounds.len(), 2, "a verdict for each set, figures or not");
    for &row in &bounds {
        assert!(table.f64("value").is_null(row));
        assert_eq!(table.text("verdict").value(row), "not_shown");
        assert!(table.text("reason").value(row).contains("59"));
    }
    assert_eq!(rows(&table, "name", "mean").len(), 1, "no figure is made up");
    let of_table = rows(&table, "model", "table");
    assert_eq!(table.text("table_id").value(of_table[0]), key().run);
    assert!(
        rows(&table, "evidence", "measured").is_empty(),
        "a prediction is never called measured"
    );
}

#[test]
fn each_figure_has_the_start_of_its_session() {
    let day = WallTime::of_us(1_604_923_200_000_000);
    let started = |starts: &BTreeMap<&str, WallTime>| -> Vec<Option<WallTime>> {
        let figures = OUTCOME.accuracy.iter();
        let tolerance = &example::TOLERANCE;
        let rows = accuracy::rows(figures, &OUTCOME.verdict, &[], tolerance, &key(), starts);
        rows.iter().map(|row| row.session_started).collect()
    };
    let session = OUTCOME.accuracy[0].subject.of_session.as_str();
    assert!(started(&BTreeMap::from([(session, day)])).contains(&Some(day)));
    // The example's controller counts from its start.
    assert!(OUTCOME.starts().is_empty());
    assert!(started(&OUTCOME.starts()).iter().all(Option::is_none));
    // Its tracker may have an epoch: then that clock tells the day.
    let mut session = OUTCOME.training[0].clone();
    session.joined.clock.model.offset_ns = day.us() as f64 * 1e3 - 7.0;
    assert_eq!(session.started(), Some(day));
    session.joined.clock.model.origin = Stamp::from_ns((day.us() - 5) * 1000 + 999);
    assert_eq!(session.started(), Some(WallTime::of_us(day.us() - 5)));
}

#[test]
fn figures_of_iso_9283_stand_beside_the_others_under_its_names() {
    let table = table(accuracy::rows(
        OUTCOME.accuracy.iter(),
        &OUTCOME.verdict,
        &OUTCOME.iso_9283,
        &example::TOLERANCE,
        &key(),
        &OUTCOME.starts(),
    ));
    let own = rows(&table, "quantity", "iso_9283");
    let names: Vec<&str> = own.iter().map(|&row| table.text("name").value(row)).collect();
    // In the order of the schema's names.
    assert_eq!(names, ["AP_p", "AP_a", "vAP_p"]);
    let (accuracy, angle, missing) = (own[0], own[1], own[2]);
    assert_eq!(table.text("unit").value(angle), "rad");
    assert!(table.f64("expanded_uncertainty").is_null(angle), "of positions alone");
    assert_eq!(table.text("unit").value(accuracy), "mm");
    assert_eq!(table.i64("pose").value(accuracy), 4);
    assert_eq!([table.i64("n").value(accuracy), table.i64("n_needed").value(accuracy)], [2, 30]);
    assert!(table.text("verdict").is_null(accuracy), "the standard has no limit");
    assert!(table.f64("value").is_null(missing) && table.i64("pose").is_null(missing));
    assert!(table.text("reason").value(missing).contains("no pose"));
}
