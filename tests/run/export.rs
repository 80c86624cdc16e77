//! What a run published, in the forms that others read: the same numbers, read by readers of their own.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Matrix4, Vector3, Vector4};
use posegrid::fit::{Model, ToolErrors};
use posegrid::io::calibrations_table;

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};

fn file(table: &str) -> PathBuf {
    undisturbed().table_file(table, "mon")
}

fn export(table: &str, format: &str) -> Ended {
    ended(posegrid().arg("export").arg(file(table)).args(["--format", format]))
}

#[test]
fn nodes_as_csv_are_the_table_to_the_nanometre() {
    let exported = export("compensation", "csv");
    exported.expect(0, &[]);
    let table = undisturbed().table("compensation", "mon");
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(exported.results.as_bytes());
    let headers = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), table.rows());
    for column in
        ["x_mm", "y_mm", "z_mm", "error_x_mm", "error_y_mm", "error_z_mm", "error_cov_xy_mm2"]
    {
        let place = headers.iter().position(|name| name == column).unwrap();
        for (row, record) in rows.iter().enumerate() {
            let (was, is) = (table.f64(column).value(row), record[place].parse::<f64>().unwrap());
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
    assert_eq!(said["table_id"], format!("{:?}", table.text("table_id").value(0)));
    assert_eq!(said["tool"], "\"reflector holder\"");
    assert_eq!(said["payload_kg"], "null");
    // The units of joints are null where all turn.
    let columns = posegrid::files::schema::find("compensation").unwrap().columns.iter();
    for column in columns.filter(|column| column.name != "joint_units") {
        let of_nodes =
            headers.iter().any(|name| name == column.name) || column.name == "joints_rad";
        assert!(of_nodes != said.contains_key(column.name.as_str()), "{}", column.name);
    }
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
    let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().unwrap()).collect();
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
    let joints = document.root_element().children().filter(|node| node.has_tag_name("joint"));
    let joint = |node: roxmltree::Node<'_, '_>| {
        let of = |tag: &str, attribute: &str| {
            let child = node.children().find(|child| child.has_tag_name(tag))?;
            child.attribute(attribute).map(str::to_owned)
        };
        let rpy = of("origin", "rpy").map_or_else(Vector3::zeros, |text| three(&text));
        let mut origin = Matrix4::<f64>::identity();
        origin
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(turn(2, rpy.z) * turn(1, rpy.y) * turn(0, rpy.x)));
        origin
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&of("origin", "xyz").map_or_else(Vector3::zeros, |text| three(&text)));
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

/// A turn about any axis, by Rodrigues' formula.
fn about(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let n = axis.normalize();
    let cross = Matrix3::new(0.0, -n.z, n.y, n.z, 0.0, -n.x, -n.y, n.x, 0.0);
    Matrix3::identity() + cross * angle.sin() + cross * cross * (1.0 - angle.cos())
}

/// Where a link stands in `base_link`, m.
fn forward(joints: &[UrdfJoint], link: &str, q: &BTreeMap<String, f64>) -> Matrix4<f64> {
    if link == "base_link" {
        return Matrix4::<f64>::identity();
    }
    let joint = joints.iter().find(|joint| joint.child == link).unwrap();
    let mut turned = Matrix4::<f64>::identity();
    if let Some(axis) = joint.axis {
        turned.fixed_view_mut::<3, 3>(0, 0).copy_from(&about(&axis, q[&joint.name]));
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
    let names: Vec<&str> = arm.arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    let mut largest: f64 = 0.0;
    for number in 1..500_u32 {
        // An irrational rotation per joint covers the limits evenly without randomness.
        let spread = (1_u32..).zip(arm.arm.joints()).map(|(joint, limits)| {
            let share = (f64::from(number) * f64::from(joint + 1).sqrt().sqrt()).fract();
            limits.lower + share * (limits.upper - limits.lower)
        });
        let q: Vec<f64> = spread.collect();
        let named = names.iter().map(|name| (*name).to_owned()).zip(q.iter().copied()).collect();
        let tool = forward(&joints, "tool", &named) * Vector4::new(0.0, 0.0, 0.0, 1.0) * 1000.0;
        let nominal: Isometry3<f64> = error_frame.nominal_tool(&q);
        let error = errors.error(&q).unwrap();
        let expected = nominal.translation.vector + error;
        let apart = (tool.xyz() - expected).norm();
        assert!(apart < 1e-9, "{q:?}: {apart} mm");
        largest = largest.max(error.norm());
    }
    assert!(largest > 0.1, "the identified arm is not the nominal one: {largest} mm");
    for (joint, own) in joints.iter().zip(arm.arm.joints()) {
        assert_eq!(
            (joint.name.as_str(), joint.limits),
            (own.name.as_str(), Some([own.lower, own.upper]))
        );
    }
    assert!(exported.results.contains(&format!("by posegrid run {}", published.key.run)));
}

#[test]
fn a_format_is_made_of_its_own_tables_and_nothing_is_written_over() {
    export("stations", "csv")
        .expect(2, &["holds table \"stations\"; csv is made of table \"compensation\""]);
    export("compensation", "urdf").expect(2, &["urdf is made of table \"calibrations\""]);
    let out = undisturbed().path("nodes.csv");
    let once = || {
        let mut command = posegrid();
        let command =
            command.arg("export").arg(file("compensation")).args(["--format", "csv", "--out"]);
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

/// Joint angles spread over the limits of the cell's arm, rad.
fn poses() -> Vec<Vec<f64>> {
    let published = calibrations_table::read_geometry(&file("calibrations")).unwrap();
    let joints = published.arm.arm.joints().to_vec();
    let pose = |number: u32| {
        let spread = (2_u32..).zip(&joints).map(|(joint, limits)| {
            let share = (f64::from(number) * f64::from(joint).sqrt().sqrt()).fract();
            limits.lower + share * (limits.upper - limits.lower)
        });
        spread.collect()
    };
    (1..200).map(pose).collect()
}

/// The flange as format `urdf` has it, mm.
fn identified_flanges(poses: &[Vec<f64>]) -> Vec<Matrix4<f64>> {
    let exported = export("calibrations", "urdf");
    exported.expect(0, &[]);
    let joints = urdf_joints(&exported.results);
    let names = |q: &Vec<f64>| (1..).zip(q).map(|(n, q)| (format!("joint_a{n}"), *q)).collect();
    let flange = |q: &Vec<f64>| in_mm(forward(&joints, "flange", &names(q)));
    poses.iter().map(flange).collect()
}

fn in_mm(metres: Matrix4<f64>) -> Matrix4<f64> {
    let mut pose = metres;
    for row in 0..3 {
        pose[(row, 3)] *= 1000.0;
    }
    pose
}

/// The largest distance, mm, and the largest element that two rotations differ by.
fn apart(one: &[Matrix4<f64>], other: &[Matrix4<f64>]) -> (f64, f64) {
    let both = one.iter().zip(other).map(|(one, other)| one - other);
    both.fold((0.0, 0.0), |(mm, rad): (f64, f64), off| {
        let shift: Vector3<f64> = off.fixed_view::<3, 1>(0, 3).into();
        (mm.max(shift.norm()), rad.max(off.fixed_view::<3, 3>(0, 0).abs().max()))
    })
}

/// One elementary motion, mm and rad.
fn motion(name: &str, amount: f64) -> Matrix4<f64> {
    let mut motion = Matrix4::<f64>::identity();
    match name {
        "x" => motion[(0, 3)] = amount,
        "y" => motion[(1, 3)] = amount,
        "z" => motion[(2, 3)] = amount,
        "rx" => motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn(0, amount)),
        "ry" => motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn(1, amount)),
        "rz" => motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn(2, amount)),
        other => panic!("{other}"),
    }
    motion
}

/// A placement of a robot file: fixed x, y and z in degrees.
fn placement(stated: Option<&toml::Value>) -> Matrix4<f64> {
    let Some(stated) = stated else {
        return Matrix4::<f64>::identity();
    };
    let numbers = |key: &str| -> Vec<f64> {
        let all = stated[key].as_array().unwrap().iter();
        all.map(|n| n.as_float().unwrap()).collect()
    };
    let (at, angles) = (numbers("xyz_mm"), numbers("euler_deg"));
    assert_eq!(stated["euler_order"].as_str(), Some("fixed-xyz"));
    let shift = motion("x", at[0]) * motion("y", at[1]) * motion("z", at[2]);
    let turned = [("rz", angles[2]), ("ry", angles[1]), ("rx", angles[0])];
    turned.iter().fold(shift, |end, (name, deg)| end * motion(name, deg.to_radians()))
}

/// Parameters of a convention: `parameter` → identified value, mm or rad, and the nominal arm that the file states.
fn parameters(convention: &str) -> (BTreeMap<String, f64>, toml::Value) {
    let exported = ended(posegrid().arg("export").arg(file("calibrations")).args([
        "--format",
        "parameters",
        "--convention",
        convention,
    ]));
    exported.expect(0, &[]);
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(exported.results.as_bytes());
    let mut values = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        assert!((number("nominal") + number("offset") - number("identified")).abs() < 1e-9);
        assert!(number("standard_error") >= 0.0);
        let value = match row["unit"].as_str() {
            "deg" => number("identified").to_radians(),
            _ => number("identified"),
        };
        values.insert(row["parameter"].clone(), value);
    }
    let nominal = exported.results.lines().filter_map(|line| line.strip_prefix("#   "));
    let nominal = nominal.collect::<Vec<_>>().join("\n");
    let nominal = if nominal.is_empty() {
        fs::read_to_string("pipelines/robots/kr210-r2700-extra.toml").unwrap()
    } else {
        nominal
    };
    (values, toml::from_str(&nominal).unwrap())
}

/// The flange by the formula of a convention, written out: links between the base's motions and the flange's.
fn by_formula(convention: &str, poses: &[Vec<f64>]) -> Vec<Matrix4<f64>> {
    let (values, nominal) = parameters(convention);
    let value = |name: &str| values.get(name).copied();
    let whole = |of: &str| -> Matrix4<f64> {
        ["x", "y", "z", "rx", "ry", "rz"].iter().fold(Matrix4::<f64>::identity(), |end, name| {
            end * motion(name, value(&format!("{of}_{name}")).unwrap_or(0.0))
        })
    };
    let joints = nominal["joint"].as_array().unwrap();
    let flange = |q: &Vec<f64>| {
        let mut end = whole("base") * placement(nominal.get("base"));
        let mut place = Matrix4::<f64>::identity();
        for ((number, joint), q) in (1..).zip(joints).zip(q) {
            let stated = |key: &str| joint.get(key).map_or(0.0, |n| n.as_float().unwrap());
            let of =
                |name: &str, nominal: f64| value(&format!("{name}_{number}")).unwrap_or(nominal);
            let sign = joint.get("sign").map_or(1, |sign| sign.as_integer().unwrap()) as f64;
            let theta = of("theta", stated("offset_deg").to_radians()) + sign * q;
            let d = of("d", stated("d_mm"));
            let a = motion("x", of("a", stated("a_mm")));
            let alpha = motion("rx", of("alpha", stated("alpha_deg").to_radians()));
            let beta = motion("ry", of("beta", 0.0));
            let turned = motion("rz", theta);
            let numbers = |key: &str| -> Vector3<f64> {
                let all = joint[key].as_array().unwrap().iter();
                Vector3::from_iterator(all.map(|n| n.as_float().unwrap()))
            };
            end *= match convention {
                "standard-dh" => turned * motion("z", d) * a * alpha * beta,
                "s-model" => {
                    let behind = motion("rz", of("gamma", stated("gamma_deg").to_radians()))
                        * motion("z", of("b", stated("b_mm")));
                    turned * motion("z", d) * a * alpha * beta * behind
                }
                "modified-dh" => alpha * a * beta * turned * motion("z", d),
                "cpc" => {
                    let next = z_to(&numbers("direction"));
                    let shift = numbers("shift_mm");
                    let shifts = motion("x", of("x", shift.x))
                        * motion("y", of("y", shift.y))
                        * motion("z", of("b", shift.z));
                    motion("rz", sign * q)
                        * next
                        * motion("rx", of("rx", 0.0))
                        * motion("ry", of("ry", 0.0))
                        * motion("rz", of("gamma", stated("gamma_deg").to_radians()))
                        * shifts
                }
                _ => {
                    // Small motions of a frame on the joint's line, z along it, and the joint about that z.
                    let at = numbers("point_mm");
                    let frame = motion("x", at.x)
                        * motion("y", at.y)
                        * motion("z", at.z)
                        * z_to(&numbers("axis"));
                    let link = place.try_inverse().unwrap() * frame;
                    place = frame;
                    let small = [
                        ("x", "x"),
                        ("y", "y"),
                        ("z", "d"),
                        ("rx", "rx"),
                        ("ry", "ry"),
                        ("rz", "theta"),
                    ];
                    let small =
                        small.iter().fold(Matrix4::<f64>::identity(), |end, (name, of_it)| {
                            end * motion(name, of(of_it, 0.0))
                        });
                    link * small * motion("rz", sign * q)
                }
            };
        }
        let last = placement(nominal.get("flange"));
        end * place.try_inverse().unwrap() * last * whole("target")
    };
    poses.iter().map(flange).collect()
}

/// The turn that brings z to a direction by the shortest way.
fn z_to(direction: &Vector3<f64>) -> Matrix4<f64> {
    let mut turned = Matrix4::<f64>::identity();
    let to = direction.normalize();
    let across = Vector3::z().cross(&to);
    let angle = across.norm().atan2(to.z);
    let axis = if across.norm() > 0.0 { across } else { Vector3::x() };
    turned.fixed_view_mut::<3, 3>(0, 0).copy_from(&about(&axis, angle));
    turned
}

#[test]
fn parameters_in_every_convention_are_the_identified_arm_by_its_own_formula() {
    let poses = poses();
    let wanted = identified_flanges(&poses);
    for convention in ["standard-dh", "modified-dh", "s-model", "cpc", "poe"] {
        let (mm, rad) = apart(&by_formula(convention, &poses), &wanted);
        assert!(mm < 1e-6, "{convention}: {mm} mm");
        assert!(rad < 1e-9, "{convention}: {rad} rad");
    }
}

#[test]
fn what_an_export_drops_is_named_with_its_cost_on_held_out_stations() {
    let accuracy = undisturbed().table("accuracy", "mon");
    let texts = ["split", "role", "model", "angles", "moment", "quantity", "name"];
    let figure = |model: &str, angles: &str| {
        let wanted = ["blocks", "held-out", model, angles, "after", "position-error", "mean"];
        let is_it = |row: &usize| {
            texts
                .iter()
                .zip(wanted)
                .all(|(column, word)| accuracy.text(column).value(*row).replace('_', "-") == word)
        };
        let row =
            (0..accuracy.rows()).find(is_it).unwrap_or_else(|| panic!("no figure of {model}"));
        accuracy.f64("value").value(row)
    };
    let cost = format!(
        "held-out stations the geometry alone leaves a mean error of {:.3} mm, the full error model {:.3} mm.",
        figure("geometric", "reported"),
        figure("full", "weighted")
    );
    for format in ["urdf", "parameters"] {
        let exported = export("calibrations", format);
        exported.expect(0, &[]);
        assert!(exported.results.contains(&cost), "{format}: {cost}\n{}", exported.results);
        assert!(exported.results.contains("Not in it: joint curves"), "{format}");
    }
    corrected("base", "tool0").expect_messages(&[&cost]);
}

#[test]
fn what_is_not_identified_is_named_in_the_file_and_on_standard_error() {
    // The height of the base and that of the first axis on it are one by structure.
    let parameters = undisturbed().table("parameters", "mon");
    let not_identified = |name: &str| {
        let is_it = |row: &usize| {
            parameters.text("model").value(*row) == "geometric"
                && parameters.text("parameter").value(*row) == name
        };
        let row = (0..parameters.rows()).find(is_it).unwrap();
        parameters.text("identifiability").value(row) != "identifiable"
    };
    for name in ["base_z", "d_1"] {
        assert!(not_identified(name), "{name}");
    }
    let told = |text: &str, format: &str| {
        let (_, told) = text
            .split_once("Not identified by the stations are ")
            .unwrap_or_else(|| panic!("{format}: {text}"));
        let (named, _) = told.split_once(": each of these numbers").unwrap();
        for part in ["base (", "base_z of mon ± ", "lengths (", "d_1 ± "] {
            assert!(named.contains(part), "{format}: {part} in {named}");
        }
    };
    for format in ["urdf", "parameters"] {
        let exported = export("calibrations", format);
        exported.expect(0, &[]);
        told(&exported.results, format);
        told(&exported.messages, format);
    }
    told(&corrected("base", "tool0").messages, "corrected urdf");
}

#[test]
fn a_file_outside_its_lake_says_that_its_limits_are_not_beside_it() {
    let alone = ended(
        posegrid().arg("export").arg(super::cell::alone("calibrations")).args(["--format", "urdf"]),
    );
    alone.expect(0, &[]);
    for table in ["accuracy", "parameters"] {
        let said = format!("is in table {table} of the run, which is not beside this file");
        assert!(alone.results.contains(&said), "{table}");
    }
}

const OWN_URDF: &str = "tests/robots/kr210.urdf";

fn corrected(base: &str, tip: &str) -> Ended {
    corrected_file(OWN_URDF.as_ref(), base, tip, "urdf")
}

fn corrected_file(urdf: &std::path::Path, base: &str, tip: &str, format: &str) -> Ended {
    let mut command = posegrid();
    let command = command.arg("export").arg(file("calibrations"));
    ended(
        command.args(["--format", format, "--urdf"]).arg(urdf).args(["--base", base, "--tip", tip]),
    )
}

impl Ended {
    fn expect_messages(&self, texts: &[&str]) {
        assert_eq!(self.code, 0, "{}", self.messages);
        for text in texts {
            assert!(self.messages.contains(text), "{text:?} in {}", self.messages);
        }
    }
}

/// The tip in the base of a URDF with joints `joint_1` to `joint_6`, mm.
fn tips(urdf: &str, poses: &[Vec<f64>], tip: &str) -> Vec<Matrix4<f64>> {
    let joints = urdf_joints(urdf);
    let tip = |q: &Vec<f64>| {
        let named: BTreeMap<String, f64> =
            (1..).zip(q).map(|(n, q)| (format!("joint_{n}"), *q)).collect();
        let base = forward(&joints, "base", &named);
        in_mm(base.try_inverse().unwrap() * forward(&joints, tip, &named))
    };
    poses.iter().map(tip).collect()
}

#[test]
fn a_corrected_urdf_is_the_file_with_other_origins_and_the_identified_arm() {
    let exported = corrected("base", "tool0");
    exported.expect_messages(&[
        "origins of joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_6-flange are the identified geometry",
        "joint offsets are in them",
    ]);
    let before = fs::read_to_string(OWN_URDF).unwrap();
    let poses = poses();
    let (mm, rad) = apart(&tips(&exported.results, &poses, "tool0"), &identified_flanges(&poses));
    assert!(mm < 1e-6, "{mm} mm");
    assert!(rad < 1e-9, "{rad}");
    let (mm, _) = apart(&tips(&before, &poses, "tool0"), &identified_flanges(&poses));
    assert!(mm > 0.1, "the identified arm is not the nominal one: {mm} mm");
    // Put the old numbers back in the place of the new ones, and the file is what it was.
    let mut back = exported.results.clone();
    for (old, name) in [
        ("rpy='0 0 3.14159265358979'\n            xyz=\"0  0\t0.775\"", "joint_1"),
        ("xyz=\"0.350 0 0\"", "joint_2"),
        ("rpy=\"0 0 0\" xyz=\"1.150 0 0\"", "joint_3"),
        ("xyz=\"0 0 -0.041\" rpy=\"0 0 0\"", "joint_4"),
        ("", "joint_5"),
        ("xyz=\"0.215 0 0\" rpy=\"0 0 0\"", "joint_6"),
        ("xyz=\"0 0 0\" rpy=\"0 0 0\"", "joint_6-flange"),
    ] {
        let document = roxmltree::Document::parse(&back).unwrap();
        let joint =
            document.descendants().find(|node| node.attribute("name") == Some(name)).unwrap();
        let origin = joint.children().find(|child| child.has_tag_name("origin")).unwrap();
        let attributes: Vec<_> = origin.attributes().map(|own| own.range()).collect();
        let place = attributes[0].start..attributes.last().unwrap().end;
        let place = if old.is_empty() {
            // An origin that was not there stands before the first element, on a line of its own.
            origin.range().start..origin.next_sibling_element().unwrap().range().start
        } else {
            place
        };
        back.replace_range(place, old);
    }
    assert_eq!(back, before);
    // The changes are those of an arm with errors, not another way to write it: one tool orientation leaves base and target millimetres.
    let changed = urdf_joints(&exported.results);
    for (was, is) in urdf_joints(&before).iter().zip(&changed) {
        let off = was.origin - is.origin;
        assert!(off.abs().max() < 0.02, "{}: {off}", was.name);
    }
}

#[test]
fn a_urdf_whose_last_joint_is_the_tip_says_what_it_cannot_hold() {
    let exported = corrected("base", "link_6");
    exported.expect(2, &["another flange", "joint_1 = joint_a1"]);
    let urdf = fs::read_to_string(OWN_URDF).unwrap();
    // The last joint turned so that its link is the flange, about another axis of its frame.
    let turned = urdf
        .replace(
            "<origin xyz=\"0.215 0 0\" rpy=\"0 0 0\"/>",
            "<origin xyz=\"0.215 0 0\" rpy=\"0 1.5708 0\"/>",
        )
        .replace("<axis xyz=\"-1 0 0\"/>", "<axis xyz=\"0 0 -1\"/>");
    let path = undisturbed().path("turned.urdf");
    fs::write(&path, turned).unwrap();
    let exported = corrected_file(&path, "base", "link_6", "urdf");
    exported.expect_messages(&["add to the tool"]);
    let (_, rest) = exported.messages.split_once("xyz=\"").unwrap();
    let (xyz, rest) = rest.split_once('"').unwrap();
    let (_, rest) = rest.split_once("rpy=\"").unwrap();
    let rpy = three(rest.split_once('"').unwrap().0);
    let at = three(xyz) * 1000.0;
    let turned = motion("rz", rpy.z) * motion("ry", rpy.y) * motion("rx", rpy.x);
    let rest = motion("x", at.x) * motion("y", at.y) * motion("z", at.z) * turned;
    let poses = poses();
    let ends = tips(&exported.results, &poses, "link_6");
    let ends: Vec<Matrix4<f64>> = ends.into_iter().map(|end| end * rest).collect();
    let (mm, rad) = apart(&ends, &identified_flanges(&poses));
    assert!(mm < 1e-6, "{mm} mm");
    assert!(rad < 1e-9, "{rad}");
    assert!(at.z.abs() < 1e-9, "what goes along the last axis is in the last origin");
}

#[test]
fn a_urdf_that_is_not_the_nominal_arm_is_refused_with_the_reason() {
    let urdf = fs::read_to_string(OWN_URDF).unwrap();
    let path = undisturbed().path("other.urdf");
    for (from, to, base, texts) in [
        ("1.150 0 0", "1.350 0 0", "base", ["200.0", "joint_2 = joint_a2"]),
        ("0 1 0", "0 -1 0", "base", ["is not the nominal arm", "joint_1 = joint_a1"]),
        ("", "", "base_link", ["another base", "--base"]),
        ("", "", "elbow", ["has no link \"elbow\"", "tool0"]),
        ("0.350 0 0", "${l1} 0 0", "base", ["expand it first", "line"]),
        ("0.350 0 0", "0.350 0", "base", ["joint \"joint_2\"", "not three numbers"]),
        ("type=\"continuous\"", "type=\"floating\"", "base", ["joint \"joint_4\"", "floating"]),
        (
            "type=\"continuous\"",
            "type=\"fixed\"",
            "base",
            ["5 joints that move", "the run's arm 6"],
        ),
        ("<link name=\"tool0\"/>", "", "base", ["has no link \"tool0\"", "link_6"]),
        ("</robot>", "", "base", ["is not XML", "other.urdf"]),
    ] {
        fs::write(&path, urdf.replace(from, to)).unwrap();
        corrected_file(&path, base, "tool0", "urdf").expect(2, &texts);
    }
    // A correction is not made twice.
    fs::write(&path, corrected("base", "tool0").results).unwrap();
    corrected_file(&path, "base", "tool0", "urdf").expect(2, &["is not the nominal arm"]);
    let missing = undisturbed().path("missing.urdf");
    corrected_file(&missing, "base", "tool0", "urdf").expect(2, &["missing.urdf"]);
    corrected_file(OWN_URDF.as_ref(), "base", "tool0", "parameters").expect(2, &["leave them out"]);
}

/// A cell with one session of an arm of Universal Robots.
fn ur_cell() -> Cell {
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/robots/ur10e.toml");
    let cell = Cell::new().with("robots/kr210-r2700-extra.toml", robot);
    let mut simulate = posegrid();
    let simulate =
        simulate.args(["simulate", robot, "--robot-name", "kr210-demo", "--session", "ur"]);
    let simulate = simulate.args(["--home", "0,-70,100,-120,-90,0", "--size", "400,400,400"]);
    let made = simulate.args(["--seed", "3", "--random", "80", "--out"]).arg(cell.session("ur"));
    ended(made).expect(0, &[]);
    let ran = cell.run(&[]);
    assert!([0, 3].contains(&ran.code), "{}", ran.messages);
    cell
}

#[test]
fn the_calibration_of_a_ur_is_the_identified_arm_but_for_what_it_says() {
    let cell = ur_cell();
    let table = cell.table_file("calibrations", "ur");
    let export = |format: &str| {
        let ended = ended(posegrid().arg("export").arg(&table).args(["--format", format]));
        ended.expect(0, &[]);
        ended.results
    };
    let (yaml, urdf) = (export("ur-calibration"), urdf_joints(&export("urdf")));
    let mut frames = Vec::new();
    for link in ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"] {
        let (_, of) = yaml.split_once(&format!("  {link}:\n")).unwrap();
        let number = |key: &str| -> f64 {
            let line = of.lines().find_map(|line| line.strip_prefix(&format!("    {key}: ")));
            line.unwrap().parse().unwrap()
        };
        let at = ["x", "y", "z"].map(|key| 1000.0 * number(key));
        // As urdf/ur_macro.xacro has it: rpy of an origin, the joint about z.
        frames.push(
            motion("x", at[0])
                * motion("y", at[1])
                * motion("z", at[2])
                * motion("rz", number("yaw"))
                * motion("ry", number("pitch"))
                * motion("rx", number("roll")),
        );
    }
    let rest = yaml.lines().find(|line| line.contains("tool0 to flange")).unwrap();
    let numbers: Vec<&str> = rest.split('"').collect();
    let (at, rpy) = (three(numbers[1]) * 1000.0, three(numbers[3]));
    let rest = motion("x", at.x)
        * motion("y", at.y)
        * motion("z", at.z)
        * motion("rz", rpy.z)
        * motion("ry", rpy.y)
        * motion("rx", rpy.x);
    assert!(at.z.abs() < 1e-9 && rpy.z.abs() < 1e-6, "only what stands across axis 6: {at} {rpy}");
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    let (mut own, mut wanted) = (Vec::new(), Vec::new());
    for number in 1..200_u32 {
        let q: Vec<f64> = (2..8_u32)
            .map(|joint| (f64::from(number) * f64::from(joint).sqrt().sqrt()).fract() * 12.0 - 6.0)
            .collect();
        let end = frames
            .iter()
            .zip(&q)
            .fold(Matrix4::<f64>::identity(), |end, (frame, q)| end * frame * motion("rz", *q));
        own.push(end * rest);
        let named = names.iter().map(|name| (*name).to_owned()).zip(q).collect();
        wanted.push(in_mm(forward(&urdf, "flange", &named)));
    }
    let (mm, rad) = apart(&own, &wanted);
    assert!(mm < 1e-6, "{mm} mm");
    assert!(rad < 1e-9, "{rad}");
    // Frames stay near those of the published description: config/ur10e/default_kinematics.yaml.
    let nominal = [
        [0.0, 0.0, 180.7],
        [0.0; 3],
        [-612.7, 0.0, 0.0],
        [-571.55, 0.0, 174.15],
        [0.0, -119.85, 0.0],
        [0.0, 116.55, 0.0],
    ];
    for (frame, nominal) in frames.iter().zip(nominal) {
        let at: Vector3<f64> = frame.fixed_view::<3, 1>(0, 3).into();
        assert!((at - Vector3::from(nominal)).norm() < 5.0, "{at}");
    }
    assert!(yaml.contains("\n  hash: calib_posegrid_"));
    // Another arm has no such file.
    self::export("calibrations", "ur-calibration").expect(2, &["is not one of Universal Robots"]);
}
