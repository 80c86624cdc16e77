//! What a run published, in the forms that others read: the same numbers, read by readers of their own.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Matrix4, Vector3, Vector4};
use posegrid::fit::{Model, ToolErrors};
use posegrid::io::calibrations_table;
use posegrid::io::export::residuals_mcap::ARROW_SCALE;
use serde_json::Value;

use super::cell::{Ended, ended, posegrid, undisturbed};

fn file(table: &str) -> PathBuf {
    undisturbed().table_file(table, "mon")
}

fn export(table: &str, format: &str) -> Ended {
    ended(
        posegrid()
            .arg("export")
            .arg(file(table))
            .args(["--format", format]),
    )
}

#[test]
fn nodes_as_csv_are_the_table_to_the_nanometre() {
    let exported = export("compensation", "csv");
    exported.expect(0, &[]);
    let table = undisturbed().table("compensation", "mon");
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(exported.results.as_bytes());
    let headers = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), table.rows());
    for column in [
        "x_mm",
        "y_mm",
        "z_mm",
        "error_x_mm",
        "error_y_mm",
        "error_z_mm",
        "error_cov_xy_mm2",
    ] {
        let place = headers.iter().position(|name| name == column).unwrap();
        for (row, record) in rows.iter().enumerate() {
            let (was, is) = (
                table.f64(column).value(row),
                record[place].parse::<f64>().unwrap(),
            );
            assert!((was - is).abs() <= 0.5e-6, "{column} {row}: {was} {is}");
        }
    }
    assert!(headers.iter().any(|name| name == "q6_deg"));
    // What holds for all of it stands before, each value a JSON text: every column of the table is somewhere.
    let said: BTreeMap<&str, &str> = exported
        .results
        .lines()
        .filter_map(|line| line.strip_prefix("# ")?.split_once(": "))
        .collect();
    assert_eq!(
        said["table_id"],
        format!("{:?}", table.text("table_id").value(0))
    );
    assert_eq!(said["tool"], "\"reflector holder\"");
    assert_eq!(said["payload_kg"], "null");
    for column in &posegrid::io::schema::find("compensation").unwrap().columns {
        let of_nodes =
            headers.iter().any(|name| name == column.name) || column.name == "joints_rad";
        assert!(
            of_nodes != said.contains_key(column.name.as_str()),
            "{}",
            column.name
        );
    }
}

/// The numbers of an array.
fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_f64().unwrap())
        .collect()
}

#[test]
fn joint_curves_of_either_table_are_the_published_ones() {
    let table = undisturbed().table("joint_errors", "mon");
    // What is written is exact; this reader of JSON rounds the last digit.
    for (from, within) in [("joint_errors", 1e-15), ("calibrations", 1e-11)] {
        let exported = export(from, "json");
        exported.expect(0, &[]);
        let curves: Value = serde_json::from_str(&exported.results).unwrap();
        assert_eq!(curves["robot"], "kr210-demo");
        assert_eq!(curves["valid_for"].is_null(), from == "joint_errors");
        let mut row = 0;
        for joint in curves["joints"].as_array().unwrap() {
            for (key, column) in [
                ("angle_rad", "angle_rad"),
                ("error_rad", "error_rad"),
                ("sd_rad", "sd_rad"),
            ] {
                for (place, is) in numbers(&joint[key]).into_iter().enumerate() {
                    let was = table.f64(column).value(row + place);
                    assert!(
                        (was - is).abs() <= within,
                        "{from} {key} {row} {place}: {was} {is}"
                    );
                    let measured = joint["measured"][place].as_bool().unwrap();
                    assert_eq!(measured, table.bool("measured").value(row + place));
                    assert_eq!(joint["name"], table.text("joint_name").value(row + place));
                }
            }
            row += joint["angle_rad"].as_array().unwrap().len();
        }
        assert_eq!(row, table.rows());
    }
    let exported = export("calibrations", "json");
    let curves: Value = serde_json::from_str(&exported.results).unwrap();
    assert_eq!(curves["valid_for"]["tool"], "reflector holder");
}

/// One joint of a URDF, as its specification has it: the child stands at the origin, turned about the axis.
struct UrdfJoint {
    name: String,
    parent: String,
    child: String,
    origin: Matrix4<f64>,
    axis: Option<Vector3<f64>>,
    limits: Option<[f64; 2]>,
}

fn three(text: &str) -> Vector3<f64> {
    let numbers: Vec<f64> = text
        .split_whitespace()
        .map(|n| n.parse().unwrap())
        .collect();
    Vector3::from_column_slice(&numbers)
}

/// Rotation matrices written out, so that nothing of the program's own is used to read what it wrote.
fn turn(axis: usize, angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    match axis {
        0 => Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c),
        1 => Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c),
        _ => Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0),
    }
}

fn urdf_joints(text: &str) -> Vec<UrdfJoint> {
    let document = roxmltree::Document::parse(text).unwrap();
    let joints = document
        .root_element()
        .children()
        .filter(|node| node.has_tag_name("joint"));
    let joint = |node: roxmltree::Node<'_, '_>| {
        let of = |tag: &str, attribute: &str| {
            let child = node.children().find(|child| child.has_tag_name(tag))?;
            child.attribute(attribute).map(str::to_owned)
        };
        let rpy = three(&of("origin", "rpy").unwrap());
        let mut origin = Matrix4::identity();
        origin
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(turn(2, rpy.z) * turn(1, rpy.y) * turn(0, rpy.x)));
        origin
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&three(&of("origin", "xyz").unwrap()));
        let limit = |side| of("limit", side).map(|text| text.parse().unwrap());
        UrdfJoint {
            name: node.attribute("name").unwrap().to_owned(),
            parent: of("parent", "link").unwrap(),
            child: of("child", "link").unwrap(),
            origin,
            axis: of("axis", "xyz").map(|text| three(&text)),
            limits: limit("lower").zip(limit("upper")).map(<[f64; 2]>::from),
        }
    };
    joints.map(joint).collect()
}

/// Where a link stands in `base_link`, m.
fn forward(joints: &[UrdfJoint], link: &str, q: &BTreeMap<String, f64>) -> Matrix4<f64> {
    if link == "base_link" {
        return Matrix4::identity();
    }
    let joint = joints.iter().find(|joint| joint.child == link).unwrap();
    let mut turned = Matrix4::identity();
    if let Some(axis) = joint.axis {
        // All axes are along z, one way or the other.
        assert_eq!(axis.abs(), Vector3::z());
        turned
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&turn(2, axis.z * q[&joint.name]));
    }
    forward(joints, &joint.parent, q) * joint.origin * turned
}

#[test]
fn the_urdf_stands_where_the_identified_geometry_does() {
    let exported = export("calibrations", "urdf");
    exported.expect(0, &[]);
    let joints = urdf_joints(&exported.results);
    let published = calibrations_table::read_geometry(&file("calibrations")).unwrap();
    let arm = &published.arm;
    assert_eq!(arm.model.model, Model::Geometric);
    let error_frame = arm.error_frame();
    let errors = ToolErrors::new(&*arm.model.predicts, arm.model.session, &error_frame);
    let names: Vec<&str> = arm
        .arm
        .joints()
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    let mut largest: f64 = 0.0;
    for number in 1..500_u32 {
        // An irrational rotation per joint covers the limits evenly without randomness.
        let spread = (1_u32..).zip(arm.arm.joints()).map(|(joint, limits)| {
            let share = (f64::from(number) * f64::from(joint + 1).sqrt().sqrt()).fract();
            limits.lower + share * (limits.upper - limits.lower)
        });
        let q: Vec<f64> = spread.collect();
        let named = names
            .iter()
            .map(|name| (*name).to_owned())
            .zip(q.iter().copied())
            .collect();
        let tool = forward(&joints, "tool", &named) * Vector4::new(0.0, 0.0, 0.0, 1.0) * 1000.0;
        let nominal: Isometry3<f64> = error_frame.nominal_tool(&q);
        let error = errors.error(&q).unwrap();
        let expected = nominal.translation.vector + error;
        let apart = (tool.xyz() - expected).norm();
        assert!(apart < 1e-9, "{q:?}: {apart} mm");
        largest = largest.max(error.norm());
    }
    assert!(
        largest > 0.1,
        "the identified arm is not the nominal one: {largest} mm"
    );
    for (joint, own) in joints.iter().zip(arm.arm.joints()) {
        assert_eq!(
            (joint.name.as_str(), joint.limits),
            (own.name.as_str(), Some([own.lower, own.upper]))
        );
    }
    assert!(
        exported
            .results
            .contains(&format!("by posegrid run {}", published.key.run))
    );
}

#[test]
fn a_format_is_made_of_its_own_tables_and_nothing_is_written_over() {
    export("stations", "csv").expect(
        2,
        &["holds table \"stations\"; csv is made of table \"compensation\""],
    );
    export("compensation", "urdf").expect(2, &["urdf is made of table \"calibrations\""]);
    let out = undisturbed().path("nodes.csv");
    let once = || {
        let mut command = posegrid();
        let command = command
            .arg("export")
            .arg(file("compensation"))
            .args(["--format", "csv", "--out"]);
        ended(command.arg(&out))
    };
    once().expect(0, &[]);
    let written = fs::read_to_string(&out).unwrap();
    assert_eq!(written, export("compensation", "csv").results);
    once().expect(2, &["exists already"]);
    let missing = ended(posegrid().arg("export").arg(file("compensation")).args([
        "--format",
        "csv",
        "--out",
        "missing/nodes.csv",
    ]));
    missing.expect(1, &["missing/nodes.csv"]);
}

/// The messages of an exported file: topic, time and body, as the MCAP crate reads them.
fn messages(log: &[u8]) -> Vec<(String, u64, Value)> {
    let messages = mcap::MessageStream::new(log).unwrap();
    let message = |message: Result<mcap::Message<'_>, _>| {
        let message = message.unwrap();
        assert_eq!(message.channel.message_encoding, "json");
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "jsonschema");
        let body: Value = serde_json::from_slice(&message.data).unwrap();
        (message.channel.topic.clone(), message.log_time, body)
    };
    messages.map(message).collect()
}

fn ns(time: &Value) -> u64 {
    time["sec"].as_u64().unwrap() * 1_000_000_000 + time["nsec"].as_u64().unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    let of = |axis: &str| value[axis].as_f64().unwrap();
    Vector3::new(of("x"), of("y"), of("z"))
}

fn exported_residuals(name: &str) -> Vec<u8> {
    let out = undisturbed().path(name);
    let command = &mut posegrid();
    let command = command
        .arg("export")
        .arg(file("residuals"))
        .args(["--format", "mcap", "--out"]);
    ended(command.arg(&out)).expect(0, &[]);
    fs::read(&out).unwrap()
}

#[test]
fn residuals_as_mcap_have_every_row_at_its_stations_time() {
    let log = exported_residuals("residuals.mcap");
    assert_eq!(log, exported_residuals("again.mcap"), "the same bytes");
    let residuals = undisturbed().table("residuals", "mon");
    let stations = undisturbed().table("stations", "mon");
    let starts: BTreeMap<i64, i64> = (0..stations.rows())
        .map(|row| {
            (
                stations.i64("station").value(row),
                stations.i64("start_ns").value(row),
            )
        })
        .collect();
    let all = messages(&log);
    let rows: Vec<&(String, u64, Value)> = all.iter().filter(|m| m.0.ends_with("/error")).collect();
    assert_eq!(rows.len(), residuals.rows());
    let mut found = BTreeMap::new();
    for (topic, log_time, body) in &rows {
        let station = body["station"].as_i64().unwrap();
        assert_eq!(
            i64::try_from(*log_time).unwrap(),
            starts[&station],
            "{topic} {station}"
        );
        assert_eq!(ns(&body["timestamp"]), *log_time);
        let is_before = topic.starts_with("/before/");
        assert_eq!(body["moment"], if is_before { "before" } else { "after" });
        let of = ["split", "model", "angles", "base_refit"]
            .map(|key| body[key].as_str().unwrap().to_owned());
        found.insert((of, station), body);
    }
    for row in 0..residuals.rows() {
        let of = ["split", "model", "angles", "base_refit"]
            .map(|key| residuals.text(key).value(row).to_owned());
        let body = found[&(of, residuals.i64("station").value(row))];
        let was = ["residual_x_mm", "residual_y_mm", "residual_z_mm"]
            .map(|column| residuals.f64(column).value(row));
        // What is written is exact; this reader of JSON rounds the last digit.
        assert!((vector(&body["error_vector_mm"]) - Vector3::from(was)).norm() < 1e-12);
        let norm = residuals.f64("residual_mm").value(row);
        assert!((body["error_mm"].as_f64().unwrap() - norm).abs() < 1e-12);
    }
}

#[test]
fn arrows_of_residuals_are_the_errors_as_often_as_the_file_says() {
    let log = exported_residuals("arrows.mcap");
    let all = messages(&log);
    let rows = undisturbed().table("residuals", "mon").rows();
    let mut arrows = 0;
    let mut colours = BTreeMap::new();
    for (topic, _, scene) in all.iter().filter(|m| m.0.ends_with("/vectors")) {
        let errors: BTreeMap<String, &Value> = all
            .iter()
            .filter(|m| m.0.strip_suffix("/error") == topic.strip_suffix("/vectors"))
            .map(|m| (m.2["station"].to_string(), &m.2))
            .collect();
        for entity in scene["entities"].as_array().unwrap() {
            let row = errors[entity["id"].as_str().unwrap()];
            assert_eq!(entity["frame_id"], "base");
            assert_eq!(entity["timestamp"], row["timestamp"]);
            let arrow = &entity["arrows"][0];
            let at = |part: &str| arrow[part].as_f64().unwrap();
            let long = 1000.0 * (at("shaft_length") + at("head_length"));
            let error = row["error_mm"].as_f64().unwrap();
            assert!(
                (long - ARROW_SCALE * error).abs() < 1e-9,
                "{topic}: {long} of {error}"
            );
            // The arrow begins where the target was predicted.
            let start = 1000.0 * vector(&arrow["pose"]["position"]);
            let end = vector(&row["attained_mm"]) - vector(&row["error_vector_mm"]);
            assert!((start - end).norm() < 1e-9);
            let moment = topic.split('/').nth(1).unwrap().to_owned();
            colours
                .entry(moment)
                .or_insert_with(Vec::new)
                .push(arrow["color"].to_string());
            arrows += 1;
        }
    }
    assert_eq!(arrows, rows);
    for same in colours.values_mut() {
        same.dedup();
        assert_eq!(same.len(), 1, "one colour for before, one for after");
    }
    assert_ne!(colours["before"], colours["after"]);
    let summary = mcap::Summary::read(&log).unwrap().unwrap();
    let index = &summary.metadata_indexes[0];
    let metadata = mcap::read::metadata(&log, index).unwrap().metadata;
    assert_eq!(metadata["arrow_scale"], ARROW_SCALE.to_string());
    assert_eq!(metadata["residuals"], rows.to_string());
    assert_eq!(metadata["frame"], "base");
}

#[test]
fn residuals_outside_their_lake_ask_for_the_times_of_the_same_run() {
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("residuals.parquet");
    fs::copy(file("residuals"), &alone).unwrap();
    let export = |stations: &[PathBuf]| {
        let mut command = posegrid();
        command.arg("export").arg(&alone).args(["--format", "mcap"]);
        for path in stations {
            command.arg("--stations").arg(path);
        }
        // What is written is no text: only how it ends is looked at.
        let output = command.output().unwrap();
        (
            output.status.code().unwrap(),
            String::from_utf8(output.stderr).unwrap(),
            output.stdout,
        )
    };
    let (code, told, _) = export(&[]);
    assert_eq!(code, 2, "{told}");
    assert!(told.contains("--stations"), "{told}");
    let (code, told, written) = export(&[file("stations")]);
    assert_eq!(code, 0, "{told}");
    assert!(written.starts_with(b"\x89MCAP0\r\n"));
    let other = undisturbed().table_file("stations", "tue");
    let (code, told, _) = export(&[other]);
    assert_eq!(code, 2, "{told}");
    assert!(told.contains("take the file of the same run"), "{told}");
    let mut csv = posegrid();
    let csv = csv
        .arg("export")
        .arg(file("compensation"))
        .args(["--format", "csv", "--stations"]);
    ended(csv.arg(file("stations"))).expect(2, &["csv has none: leave it out"]);
}
