//! Mistakes about the joints: their order, also with signs, their signs, their zeros and their coupling.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{DMatrix, DVector};

use super::Hypothesis;
use super::links::to_write;
use crate::kinematics::{Element, LinkQuantity, Parameter};
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

pub(super) fn name(stated: &SetUp, joint: usize) -> String {
    format!("{:?} (joint {})", stated.arm.joints()[joint].name, joint + 1)
}

/// The robot file's joint map with `map` before it, as a key with its value.
fn joint_map(stated: &SetUp, map: &DMatrix<f64>) -> String {
    let map = stated.arm.axes_from_joints() * map;
    let rows: Vec<Vec<f64>> =
        map.row_iter().map(|row| row.iter().map(|x| x + 0.0).collect()).collect();
    format!("robot file: joint_map = {rows:?}")
}

/// One joint, two joints and all joints counted the other way.
fn signs(stated: &SetUp) -> Vec<Hypothesis> {
    let count = stated.arm.joints().len();
    let turned = |joints: &[usize]| {
        let sign = |joint: usize| if joints.contains(&joint) { -1.0 } else { 1.0 };
        let map = DMatrix::from_diagonal(&DVector::from_fn(count, |joint, _| sign(joint)));
        let names: Vec<String> = joints.iter().map(|&joint| name(stated, joint)).collect();
        let mistake = format!("the controller counts {} the other way", names.join(" and "));
        let edit = sign_keys(stated, joints, |joint| joint);
        let edit = edit.unwrap_or_else(|| joint_map(stated, &map));
        Hypothesis::new(mistake, edit, mapped(stated, &map))
    };
    let singles = (0..count).map(|joint| vec![joint]);
    let pairs =
        (0..count).flat_map(|first| (first + 1..count).map(move |second| vec![first, second]));
    let all = singles.chain(pairs).chain((count > 2).then(|| (0..count).collect()));
    all.map(|joints: Vec<usize>| turned(&joints)).collect()
}

/// The sign of a joint as the robot file has it; `None` where a joint map or another joint that follows reads it too.
fn sign_key(stated: &SetUp, joint: usize) -> Option<f64> {
    let mut own = stated.arm.chain().elements().iter().filter_map(|element| match element {
        Element::Joint { joint: variable, sign, .. } if *variable == joint => Some(*sign),
        _ => None,
    });
    let sign = own.next()?;
    let count = stated.arm.joints().len();
    let is_plain = stated.arm.axes_from_joints() == DMatrix::identity(count, count);
    (own.next().is_none() && is_plain).then_some(sign)
}

/// The keys that turn the signs of some joints, each under the name of the joint that `named` gives; `None` where one has no key of its own.
fn sign_keys(stated: &SetUp, joints: &[usize], named: impl Fn(usize) -> usize) -> Option<String> {
    let signs = joints.iter().map(|&joint| {
        let name = &stated.arm.joints()[named(joint)].name;
        Some(format!("[[joint]] {name:?}: sign = {:.0}", -sign_key(stated, joint)?))
    });
    let signs: Option<Vec<String>> = signs.collect();
    Some(format!("robot file, {}", signs?.join(", ")))
}

/// Two joints in each other's place, also with one or both of them counted the other way, and all in reverse.
fn orders(stated: &SetUp) -> Vec<Hypothesis> {
    let joints = stated.arm.joints();
    let count = joints.len();
    let mut all = Vec::new();
    for first in 0..count {
        for second in first + 1..count {
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(first, second);
            // A position in an angle's place is another log's channel, not a slip of the order.
            if joints[first].slides != joints[second].slides {
                continue;
            }
            let names = [first, second].map(|joint| name(stated, joint));
            let swapped = format!("{} and {} are swapped", names[0], names[1]);
            for turned in [&[][..], &[first], &[second], &[first, second]] {
                all.push(ordered(stated, &order, turned, &swapped));
            }
        }
    }
    if count > 3 && !stated.arm.has_slides() {
        let reverse: Vec<usize> = (0..count).rev().collect();
        all.push(ordered(stated, &reverse, &[], "the joints are in reverse order"));
    }
    all
}

/// The axes read the reported joints in this order, and those of `turned` read theirs with the opposite sign.
fn ordered(stated: &SetUp, order: &[usize], turned: &[usize], mistake: &str) -> Hypothesis {
    let joints = stated.arm.joints();
    let sign = |axis: usize| if turned.contains(&axis) { -1.0 } else { 1.0 };
    let map = DMatrix::from_fn(order.len(), order.len(), |axis, reported| {
        if order[axis] == reported { sign(axis) } else { 0.0 }
    });
    let of_table = stated.is_of_tables();
    let order_edit = if of_table {
        let places = order.iter().map(|place| (place + 1).to_string()).collect::<Vec<_>>();
        format!("[stations] joints: the columns that are now at {}", places.join(", "))
    } else {
        let names: Vec<&str> = order.iter().map(|&joint| joints[joint].name.as_str()).collect();
        format!("robot file: the names of [[joint]], base first: {}", names.join(", "))
    };
    let counts =
        |axis: &usize| format!(", and {} counts the other way", name(stated, order[*axis]));
    let turns: String = turned.iter().map(counts).collect();
    let named = |axis: usize| if of_table { axis } else { order[axis] };
    let edit = match sign_keys(stated, turned, named) {
        _ if turned.is_empty() => order_edit,
        Some(signs) => format!("{order_edit}; then {signs}"),
        None => joint_map(stated, &map),
    };
    Hypothesis::new(format!("{mistake}{turns}"), edit, mapped(stated, &map))
}

/// The place of the reported joint with this number in parameters (from 1); `None` where that one slides, or follows another: those
/// have numbers behind the reported ones.
fn reported(stated: &SetUp, number: usize) -> Option<usize> {
    let place = number.checked_sub(1)?;
    (!stated.arm.joints().get(place)?.slides).then_some(place)
}

/// A joint whose zero is right angles away.
fn zeros(stated: &SetUp) -> Vec<Hypothesis> {
    let parameters = stated.arm.chain().parameters();
    let mut all = Vec::new();
    for (place, parameter) in parameters.iter().enumerate() {
        let Parameter::Link { joint, quantity: LinkQuantity::Theta } = *parameter else { continue };
        let Some(joint) = reported(stated, joint) else { continue };
        for angle in [FRAC_PI_2, -FRAC_PI_2, PI] {
            let mut offsets = vec![0.0; parameters.len()];
            offsets[place] = angle;
            let (name, degrees) = (name(stated, joint), angle.to_degrees());
            let mistake = format!("the zero of {name} is {degrees:+.0}° away");
            let (named, value) =
                (&stated.arm.joints()[joint].name, to_write(&stated.arm, *parameter, angle));
            let edit = format!("robot file, [[joint]] {named:?}: {value}");
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
            all.push(Hypothesis::new(mistake, joint_map(stated, &map), mapped(stated, &map)));
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
        let third = edits.iter().filter(|edit| edit.contains("[[joint]] \"a3\": offset_deg = "));
        assert_eq!(third.count(), 3, "{edits:?}");
        // A joint map has the signs in it.
        let (maps, keys): (Vec<_>, Vec<_>) =
            orders(&stated).into_iter().partition(|own| own.edit.contains("joint_map = "));
        assert!(maps.iter().all(|own| !own.edit.contains("sign = ")) && !maps.is_empty());
        assert!(keys.iter().all(|own| own.edit.contains("[[joint]], base first")));
    }

    #[test]
    fn a_sign_is_that_of_the_joint_as_it_is_named_behind_the_swap() {
        let file: RobotFile =
            toml::from_str(include_str!("../../../../pipelines/robots/ur10.toml")).unwrap();
        let stated = SetUp::of_arm(file.arm().expect("an arm"));
        let found = ordered(&stated, &[0, 1, 2, 3, 5, 4], &[5], "swapped");
        assert_eq!(found.mistake, "swapped, and \"wrist_2_joint\" (joint 5) counts the other way");
        let (_, edit) = found.edit.split_once("wrist_1_joint, ").expect("names");
        let names = "wrist_3_joint, wrist_2_joint";
        assert_eq!(
            edit,
            format!("{names}; then robot file, [[joint]] \"wrist_2_joint\": sign = -1")
        );
        let reported = DVector::from_vec(vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.6]);
        let turned = &found.set_up.joints_from_reported * reported;
        assert_eq!(turned.as_slice()[4..], [0.6, -0.5]);
    }
}
