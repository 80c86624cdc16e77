//! Mistakes about the joints: their order, their signs, their zeros and their coupling.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::DMatrix;

use super::Hypothesis;
use crate::kinematics::{LinkQuantity, Parameter};
use crate::setup::set_up::SetUp;

/// Order, signs, zeros and coupling of the joints.
pub(super) fn joints(stated: &SetUp) -> Vec<Hypothesis> {
    let mut all = signs(stated);
    all.extend(orders(stated));
    all.extend(zeros(stated));
    all.extend(couplings(stated));
    all
}

/// A map of reported angles before that of the set-up.
fn mapped(stated: &SetUp, map: &DMatrix<f64>) -> SetUp {
    SetUp { joints_from_reported: map * &stated.joints_from_reported, ..stated.clone() }
}

fn name(stated: &SetUp, joint: usize) -> String {
    format!("{:?} (joint {})", stated.arm.joints()[joint].name, joint + 1)
}

/// One joint, two joints and all joints counted the other way.
fn signs(stated: &SetUp) -> Vec<Hypothesis> {
    let count = stated.arm.joints().len();
    let turned = |joints: &[usize]| {
        let sign = |joint: usize| if joints.contains(&joint) { -1.0 } else { 1.0 };
        let map = DMatrix::from_fn(
            count,
            count,
            |row, column| if row == column { sign(row) } else { 0.0 },
        );
        let names: Vec<String> = joints.iter().map(|&joint| name(stated, joint)).collect();
        let names = names.join(" and ");
        let mistake = format!("the controller counts {names} the other way");
        Hypothesis::new(
            mistake,
            format!("robot file, [[joint]] {names}: the opposite sign"),
            mapped(stated, &map),
        )
    };
    let singles = (0..count).map(|joint| vec![joint]);
    let pairs =
        (0..count).flat_map(|first| (first + 1..count).map(move |second| vec![first, second]));
    let all: Vec<Vec<usize>> =
        singles.chain(pairs).chain((count > 2).then(|| (0..count).collect())).collect();
    all.iter().map(|joints| turned(joints)).collect()
}

/// Two joints in each other's place, and all in reverse.
fn orders(stated: &SetUp) -> Vec<Hypothesis> {
    let count = stated.arm.joints().len();
    let ordered = |order: &[usize], mistake: String| {
        let map =
            DMatrix::from_fn(count, count, |row, column| f64::from(u8::from(order[row] == column)));
        let edit = "robot file: the names of [[joint]] in the order of the arm's axes, base first, as the log names them";
        Hypothesis::new(mistake, edit, mapped(stated, &map))
    };
    let mut all = Vec::new();
    for first in 0..count {
        for second in first + 1..count {
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(first, second);
            // A position in an angle's place is another log's channel, not a slip of the order.
            let joints = stated.arm.joints();
            if joints[first].slides != joints[second].slides {
                continue;
            }
            let names = [first, second].map(|joint| name(stated, joint));
            all.push(ordered(&order, format!("{} and {} are swapped", names[0], names[1])));
        }
    }
    if count > 3 && !stated.arm.has_slides() {
        let reverse: Vec<usize> = (0..count).rev().collect();
        all.push(ordered(&reverse, "the joints are in reverse order".to_owned()));
    }
    all
}

/// The place of the reported joint with this number in parameters (from 1); `None` where that one slides, or follows another: those
/// have numbers behind the reported ones.
fn reported(stated: &SetUp, number: usize) -> Option<usize> {
    let place = number.checked_sub(1)?;
    let joint = stated.arm.joints().get(place)?;
    (!joint.slides).then_some(place)
}

/// A joint whose zero is right angles away.
fn zeros(stated: &SetUp) -> Vec<Hypothesis> {
    let parameters = stated.arm.chain().parameters();
    let mut all = Vec::new();
    for (place, parameter) in parameters.iter().enumerate() {
        let Parameter::Link { joint, quantity: LinkQuantity::Theta } = *parameter else {
            continue;
        };
        let Some(joint) = reported(stated, joint) else {
            continue;
        };
        for angle in [FRAC_PI_2, -FRAC_PI_2, PI] {
            let mut offsets = vec![0.0; parameters.len()];
            offsets[place] = angle;
            let name = name(stated, joint);
            let degrees = angle.to_degrees();
            let mistake = format!("the zero of {name} is {degrees:+.0}° away");
            let edit = format!("robot file, [[joint]] {name}: offset_deg {degrees:+.0}");
            all.push(Hypothesis::new(mistake, edit, stated.with_offsets(&offsets)));
        }
    }
    all
}

/// A joint reported with the one before it added or taken away.
fn couplings(stated: &SetUp) -> Vec<Hypothesis> {
    let count = stated.arm.joints().len();
    let mut all = Vec::new();
    let joints = stated.arm.joints();
    for second in 1..count {
        if joints[second].slides || joints[second - 1].slides {
            continue;
        }
        for share in [1.0, -1.0] {
            let mut map = DMatrix::identity(count, count);
            map[(second, second - 1)] = share;
            let names = [second, second - 1].map(|joint| name(stated, joint));
            let sign = if share > 0.0 { '+' } else { '-' };
            let mistake = format!("the axis of {} turns by it {sign} {}", names[0], names[1]);
            let edit = format!(
                "robot file: joint_map with {share:+.0} in row {}, column {second}",
                second + 1
            );
            all.push(Hypothesis::new(mistake, edit, mapped(stated, &map)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::RobotFile;

    #[test]
    fn a_zero_is_that_of_its_joint_behind_one_that_follows() {
        let text = include_str!("../../../../tests/robots/parallelogram.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        let stated = SetUp::of_arm(file.arm().expect("an arm"));
        let edits: Vec<String> = zeros(&stated).into_iter().map(|own| own.edit).collect();
        assert_eq!(edits.len(), 18, "three zeros of each of six joints: {edits:?}");
        let third = edits.iter().filter(|edit| edit.contains("\"a3\" (joint 3)"));
        assert_eq!(third.count(), 3, "{edits:?}");
    }
}
