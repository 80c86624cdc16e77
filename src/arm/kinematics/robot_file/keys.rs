//! Keys that a joint has to have, and those that its convention does not read.

use super::super::convention::Convention;
use super::{JointFile, JointKind};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Use {
    Needed,
    Allowed,
    Unread,
}

/// The keys that the joint lacks, and those that nothing reads.
pub(super) fn wrong(
    joint: &JointFile,
    convention: Convention,
) -> (Vec<&'static str>, Vec<&'static str>) {
    let (mut missing, mut unread) = (Vec::new(), Vec::new());
    for (key, is_there) in joint.keys() {
        match use_of(key, joint, convention) {
            Use::Needed if !is_there => missing.push(key),
            Use::Unread if is_there => unread.push(key),
            _ => {}
        }
    }
    (missing, unread)
}

fn use_of(key: &str, joint: &JointFile, convention: Convention) -> Use {
    use Convention::{Cpc, MdH, MinimalPoe, ModifiedDh, Poe, SModel, StandardDh, Urdf};
    let is_table = matches!(convention, StandardDh | MdH | ModifiedDh | SModel);
    let is_exponential = matches!(convention, Poe | MinimalPoe);
    let (kind, follows) = (joint.kind, joint.mimic.is_some());
    let moves = kind != JointKind::Fixed;
    let slides = kind == JointKind::Prismatic;
    let needed_if = |needed: bool| if needed { Use::Needed } else { Use::Unread };
    let allowed_if = |allowed: bool| if allowed { Use::Allowed } else { Use::Unread };
    match key {
        "a_mm" | "alpha_deg" | "d_mm" => needed_if(is_table),
        "offset_deg" if is_table => Use::Needed,
        "offset_deg" => allowed_if(moves && !slides),
        "offset_mm" => allowed_if(slides && !is_table),
        "gamma_deg" => needed_if(matches!(convention, SModel | Cpc)),
        "b_mm" => needed_if(convention == SModel),
        "direction" | "shift_mm" => needed_if(convention == Cpc),
        "axis" => needed_if(moves && (is_exponential || convention == Urdf)),
        "point_mm" if slides => allowed_if(is_exponential),
        "point_mm" => needed_if(is_exponential),
        "origin" => needed_if(convention == Urdf),
        "sign" if is_table && moves => Use::Needed,
        "limits_deg" => match kind {
            JointKind::Revolute if !follows => Use::Needed,
            JointKind::Revolute | JointKind::Continuous => Use::Allowed,
            JointKind::Prismatic | JointKind::Fixed => Use::Unread,
        },
        "limits_mm" if slides && !follows => Use::Needed,
        "limits_mm" => allowed_if(slides),
        "sign" | "mimic" => allowed_if(moves),
        _ => Use::Allowed,
    }
}

impl JointFile {
    fn keys(&self) -> [(&'static str, bool); 16] {
        [
            ("a_mm", self.a_mm.is_some()),
            ("alpha_deg", self.alpha_deg.is_some()),
            ("d_mm", self.d_mm.is_some()),
            ("offset_deg", self.offset_deg.is_some()),
            ("offset_mm", self.offset_mm.is_some()),
            ("gamma_deg", self.gamma_deg.is_some()),
            ("b_mm", self.b_mm.is_some()),
            ("direction", self.direction.is_some()),
            ("shift_mm", self.shift_mm.is_some()),
            ("axis", self.axis.is_some()),
            ("point_mm", self.point_mm.is_some()),
            ("origin", self.origin.is_some()),
            ("sign", self.sign.is_some()),
            ("limits_deg", self.limits_deg.is_some()),
            ("limits_mm", self.limits_mm.is_some()),
            ("mimic", self.mimic.is_some()),
        ]
    }
}
