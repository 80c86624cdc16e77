//! A robot file → TOML, a line for each key.

use std::fmt::Write as _;

use toml::{Table, Value};

use super::LeftOut;
use crate::kinematics::RobotFile;

/// Keys of a file before its joints, in the order of the text.
const TOP: &str = "model source convention home_deg joint_map base flange";
/// Keys of a joint, in the order of the text; others come behind them.
const JOINT: &str = "name kind origin a_mm alpha_deg d_mm offset_deg offset_mm gamma_deg b_mm axis \
     direction point_mm shift_mm sign mimic limits_deg";

/// No error for a file that was read: each of its values has a form in TOML.
pub fn toml(file: &RobotFile) -> Result<String, toml::ser::Error> {
    let mut table = Table::try_from(file)?;
    let joints = table.remove("joint");
    let mut text = String::new();
    push(&mut text, &table, TOP);
    for joint in joints.iter().filter_map(Value::as_array).flatten() {
        text.push_str("\n[[joint]]\n");
        if let Value::Table(joint) = joint {
            push(&mut text, joint, JOINT);
        }
    }
    Ok(text)
}

fn push(text: &mut String, table: &Table, order: &str) {
    for (key, value) in ordered(table, order) {
        let _ = writeln!(text, "{key} = {}", inline(value));
    }
}

/// The entries of a table, those of the keys in `order` first.
fn ordered<'t>(table: &'t Table, order: &'t str) -> impl Iterator<Item = (&'t String, &'t Value)> {
    let known = order.split_whitespace().filter_map(|key| table.get_key_value(key));
    let is_known = move |key: &str| order.split_whitespace().any(|own| own == key);
    known.chain(table.iter().filter(move |(key, _)| !is_known(key)))
}

/// The value on one line; the origin of a placement stands before its rotation.
fn inline(value: &Value) -> String {
    let Value::Table(table) = value else { return value.to_string() };
    let all = ordered(table, "xyz_mm joint").map(|(key, value)| format!("{key} = {value}"));
    format!("{{ {} }}", all.collect::<Vec<_>>().join(", "))
}

/// Comment lines on the URDF at the name `source` that a file was made from. Names are quoted: none can end its line.
pub fn comment(source: &str, left_out: &LeftOut) -> String {
    let mut text = format!(
        "# Made by posegrid robot from {source:?}: the chain from link {:?} to link {:?}.\n",
        left_out.base, left_out.tip
    );
    let elements = left_out.elements.iter();
    let elements = elements.map(|(name, count)| format!("{count} {name}"));
    let joints =
        (left_out.joints > 0).then(|| format!("{} joints beside the chain", left_out.joints));
    let parts: Vec<String> = elements.chain(joints).collect();
    if !parts.is_empty() {
        let _ = writeln!(text, "# Left out: {}.", parts.join(", "));
    }
    for remark in &left_out.remarks {
        let _ = writeln!(text, "# Note: {remark}.");
    }
    text
}
