//! A URDF with the identified geometry in it: the same bytes but for `xyz` and `rpy` in the `<origin>` of each joint of
//! the arm that moves, and of the first fixed joint behind the last of them. Joint offsets are in the origins, so joint
//! angles stay those that the controller reports. A URDF that was corrected is refused: it is no longer the nominal
//! arm.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use nalgebra::Isometry3;
use roxmltree::Node;

use super::controller_base::InControllerBase;
use super::limits::Limits;
use super::origins::{ChainJoint, Origins};
use super::urdf::three;
use super::urdf_chain::{self, Ends, Step};
use super::{ExportError, ExportErrorKind};
use crate::geometry::rpy;
use crate::manifest::RunKey;
use crate::robot;
use crate::robot::urdf::{self, child};
use crate::units::MM_PER_M;

#[derive(Debug, Clone, Copy)]
pub struct GivenUrdf<'a> {
    pub path: &'a Path,
    pub ends: Ends<'a>,
}

/// Writes the URDF with the geometry in a file of table `calibrations`; gives remarks for a person, a line each.
pub fn write(
    path: &Path,
    given: &GivenUrdf<'_>,
    mut sink: impl Write,
) -> Result<Vec<String>, ExportError> {
    let own = InControllerBase::read(path)?;
    let at = |kind: ExportErrorKind| kind.at(given.path);
    let text = robot::text(given.path).map_err(|source| at(ExportErrorKind::NotRead(source)))?;
    let no_chain = |source| at(ExportErrorKind::NoChain(source));
    let document = urdf::document(&text).map_err(|source| no_chain(source.into()))?;
    let steps = urdf_chain::steps(&document, given.ends).map_err(no_chain)?;
    let chain: Vec<ChainJoint> = steps.iter().map(|step| step.joint.clone()).collect();
    let origins = Origins::of(&own, &chain);
    let origins = origins.map_err(|source| at(ExportErrorKind::OtherChain(source)))?;
    let changed = steps.iter().zip(&origins.joints);
    let edits =
        changed.filter_map(|(step, origin)| Some(edits(&text, step.node, origin.as_ref()?)));
    let corrected = edited(&text, edits.flatten().chain(encoding(&text)).collect());
    sink.write_all(corrected.as_bytes())?;
    Ok(remarks(&own, &steps, &origins, Limits::of(path)))
}

type Edit = (Range<usize>, String);

/// Changes of a joint's text that give it another origin, mm.
fn edits(text: &str, joint: Node<'_, '_>, origin: &Isometry3<f64>) -> Vec<Edit> {
    let numbers = [
        ("xyz", three((origin.translation.vector / MM_PER_M).into())),
        ("rpy", three(rpy(&origin.rotation))),
    ];
    let Some(node) = child(joint, "origin") else {
        return new_origin(text, joint, &numbers).into_iter().collect();
    };
    // A missing attribute comes behind the other one, or behind the name of the element.
    let start = node.range().start;
    let name = text[start..].find(|end: char| end.is_whitespace() || matches!(end, '/' | '>'));
    let name = start + name.unwrap_or_default();
    let behind = node.attributes().map(|own| own.range().end).max().unwrap_or(name);
    let edit = |(name, value): (&str, String)| match node.attribute_node(name) {
        Some(own) => (own.range_value(), value),
        None => (behind..behind, format!(" {name}=\"{value}\"")),
    };
    numbers.into_iter().map(edit).collect()
}

/// The encoding that an XML declaration states becomes that of what is written.
fn encoding(text: &str) -> Option<Edit> {
    let head = text.split_once("?>").filter(|(head, _)| head.contains("<?xml"))?.0;
    let stated = head.find("encoding")?;
    let quote = stated + head[stated..].find(['"', '\''])?;
    let value = head[quote + 1..].split(&head[quote..=quote]).next()?;
    let is_other = !value.eq_ignore_ascii_case("utf-8");
    is_other.then(|| (quote + 1..quote + 1 + value.len(), "UTF-8".to_owned()))
}

/// An origin before the first element of a joint that has none.
fn new_origin(text: &str, joint: Node<'_, '_>, numbers: &[(&str, String); 2]) -> Option<Edit> {
    let first = joint.first_element_child()?.range().start;
    let before = &text[..first];
    let indent = before.trim_end_matches([' ', '\t', '\r', '\n']).len();
    let [(_, xyz), (_, rpy)] = numbers;
    let origin = format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>{}", &before[indent..]);
    Some((first..first, origin))
}

fn edited(text: &str, mut edits: Vec<Edit>) -> String {
    edits.sort_by_key(|(place, _)| place.start);
    let (mut out, mut done) = (String::with_capacity(text.len()), 0);
    for (place, value) in edits {
        out.push_str(&text[done..place.start]);
        out.push_str(&value);
        done = place.end;
    }
    out.push_str(&text[done..]);
    out
}

fn remarks(
    own: &InControllerBase,
    steps: &[Step<'_, '_>],
    origins: &Origins,
    limits: Limits,
) -> Vec<String> {
    let RunKey { robot, session, run } = &own.published.key;
    let changed = steps.iter().zip(&origins.joints);
    let changed = changed.filter(|(_, origin)| origin.is_some());
    let names: Vec<&str> = changed.map(|(step, _)| step.joint.name.as_str()).collect();
    let mut lines = vec![
        format!(
            "origins of {} are the identified geometry of robot {robot:?}, session {session:?}, run {run}; joint offsets are in them, and nothing else changed",
            names.join(", ")
        ),
        own.published.error_frame.words(),
        limits.not_identified,
        limits.dropped,
    ];
    lines.extend(origins.rest.as_ref().map(|rest| {
        format!(
            "no fixed joint stands behind the last one that moves, so that the flange is {:.4} mm and {:.6} deg off the tip: add to the tool \
             xyz=\"{}\" rpy=\"{}\" (m, rad)",
            rest.translation.vector.norm(),
            rest.rotation.angle().to_degrees(),
            three((rest.translation.vector / MM_PER_M).into()),
            three(rpy(&rest.rotation))
        )
    }));
    lines
}

#[cfg(test)]
mod tests;
