//! Mistakes about how logs and tables are read: units, mirrored positions, the parts of quaternions, rows shifted by one.

use nalgebra::{Matrix3, Matrix4};

use super::Hypothesis;
use super::joints::name;
use crate::ingest::{AngleUnit, LengthUnit, OrientationForm};
use crate::setup::set_up::{Reread, SetUp};

/// Places of the parts that belong to x, y, z, w, the sign of x, y and z, and what the quaternions are then.
const PARTS: [([usize; 4], f64, &str); 8] = [
    ([1, 2, 3, 0], 1.0, "in the order w, x, y, z"),
    ([3, 0, 1, 2], 1.0, "in the order x, y, z, w, and read as w, x, y, z"),
    ([2, 1, 0, 3], 1.0, "with x and z exchanged"),
    ([1, 0, 2, 3], 1.0, "with x and y exchanged"),
    ([0, 2, 1, 3], 1.0, "with y and z exchanged"),
    ([0, 1, 2, 3], -1.0, "of the inverse orientation"),
    ([1, 2, 3, 0], -1.0, "of the inverse orientation, in the order w, x, y, z"),
    ([3, 0, 1, 2], -1.0, "of the inverse orientation, in the order x, y, z, w, read as w, x, y, z"),
];

/// Places of the coordinates that belong to x, y, z, the axis that counts the other way, and what is wrong then.
const MIRRORS: [([usize; 3], usize, &str); 6] = [
    ([1, 0, 2], NONE, "x and y are exchanged"),
    ([2, 1, 0], NONE, "x and z are exchanged"),
    ([0, 2, 1], NONE, "y and z are exchanged"),
    ([0, 1, 2], 0, "x counts the other way"),
    ([0, 1, 2], 1, "y counts the other way"),
    ([0, 1, 2], 2, "z counts the other way"),
];
const NONE: usize = usize::MAX;

/// What a table may have a row off: which of joints, measured position, measured orientation and command.
const ROWS: [(&str, [i8; 4]); 5] = [
    ("readings", [0, 1, 1, 0]),
    ("positions alone", [0, 1, 0, 0]),
    ("orientations alone", [0, 0, 1, 0]),
    ("joints alone", [1, 0, 0, 0]),
    ("commands alone", [0, 0, 0, 1]),
];

const AXES: [&str; 4] = ["x", "y", "z", "w"];
const OPPOSITE: &str = "x, y and z of the quaternions with the opposite sign where they are logged";

pub(super) fn readings(stated: &SetUp) -> Vec<Hypothesis> {
    let angle_units = AngleUnit::ALL.into_iter().filter(|unit| *unit != stated.units.angles);
    let mut all: Vec<Hypothesis> = angle_units.map(|unit| angles(stated, unit)).collect();
    all.extend(LengthUnit::ALL.into_iter().flat_map(|unit| lengths(stated, unit)));
    all.extend(mirrored(stated));
    all.extend(orientations(stated));
    if stated.is_of_tables() {
        for (what, own) in ROWS {
            // Without orientations positions alone are the readings.
            if own[1] != own[2] && stated.reading_form.is_none() {
                continue;
            }
            all.extend([(-1, "high", "down"), (1, "low", "up")].map(|(row, place, way)| {
                let mistake = format!("the {what} stand one row too {place}");
                let edit =
                    format!("the table with the columns of the {what} one row further {way}");
                let rows = own.map(|own| row * own);
                Hypothesis::new(mistake, edit, SetUp { rows, ..stated.clone() })
            }));
        }
    }
    all.extend(single_angles(stated));
    all
}

/// The set-up with a factor on each reported joint.
fn scaled(stated: &SetUp, factor: impl Fn(usize) -> f64) -> SetUp {
    let mut set_up = stated.clone();
    for (joint, mut column) in set_up.joints_from_reported.column_iter_mut().enumerate() {
        column *= factor(joint);
    }
    set_up
}

fn angles(stated: &SetUp, to: AngleUnit) -> Hypothesis {
    let joints = stated.arm.joints();
    let (factor, unit) = (to.to_rad() / stated.units.angles.to_rad(), to.word());
    let mut set_up = scaled(stated, |joint| if joints[joint].slides { 1.0 } else { factor });
    set_up.units.angles = to;
    let edit = format!("{} = \"{unit}\"", stated.unit_keys.angles);
    Hypothesis::new(format!("the reported joint angles are in {unit}"), edit, set_up)
}

/// One joint that turns in another unit of angles.
fn single_angles(stated: &SetUp) -> Vec<Hypothesis> {
    let joints = stated.arm.joints();
    let turning = (0..joints.len()).filter(|&joint| !joints[joint].slides && joints.len() > 1);
    let others = stated.units.angles;
    let single = |joint: usize, unit: AngleUnit| {
        let (name, factor) = (name(stated, joint), unit.to_rad() / others.to_rad());
        let (unit, others) = (unit.word(), others.word());
        let set_up = scaled(stated, |own| if own == joint { factor } else { 1.0 });
        let edit = format!(
            "the values of {name} in {others} like the others', where they are logged (times {factor:.7})"
        );
        let mistake = format!("{name} alone is in {unit}, the others are in {others}");
        Hypothesis::new(mistake, edit, set_up)
    };
    let units = [AngleUnit::Rad, AngleUnit::Deg, AngleUnit::Gon].into_iter();
    let units: Vec<AngleUnit> = units.filter(|own| *own != others).collect();
    let all = turning.flat_map(|joint| units.iter().map(move |unit| (joint, *unit)));
    all.map(|(joint, unit)| single(joint, unit)).collect()
}

/// The unit of sliding joints, readings and commands.
fn lengths(stated: &SetUp, unit: LengthUnit) -> Vec<Hypothesis> {
    let joints = stated.arm.joints();
    let (keys, units) = (&stated.unit_keys, &stated.units);
    let from = |stated: LengthUnit| unit.to_mm() / stated.to_mm();
    let mut slid =
        scaled(stated, |joint| if joints[joint].slides { from(units.slides) } else { 1.0 });
    slid.units.slides = unit;
    let mut read = stated.clone();
    read.reading_map *= from(units.readings);
    read.units.readings = unit;
    let mut commanded = stated.clone();
    commanded.command_scale *= from(units.commands);
    commanded.units.commands = unit;
    let streams = [
        ("the reported positions of joints that slide", keys.slides, units.slides, slid),
        ("the tracker's positions", keys.readings, units.readings, read),
        ("the commanded positions", keys.commands, units.commands, commanded),
    ];
    let has_slides = stated.arm.has_slides();
    let streams = streams
        .into_iter()
        .filter(|(_, key, own, _)| *own != unit && (has_slides || *key != keys.slides));
    let stream = |(what, key, _, set_up): (&str, &str, LengthUnit, SetUp)| {
        Hypothesis::new(format!("{what} are in {unit}"), format!("{key} = \"{unit}\""), set_up)
    };
    streams.map(stream).collect()
}

fn section(key: &str) -> &str {
    key.split(' ').next().unwrap_or(key)
}

fn named(places: &[usize]) -> String {
    places.iter().map(|&place| AXES[place]).collect::<Vec<_>>().join(", ")
}

fn places(stated: &SetUp) -> &'static str {
    if stated.is_of_tables() { "columns" } else { "fields" }
}

/// Mirrored readings. In a base that is fitted all mirrors are one mistake, which exchanging two axes mends.
fn mirrored(stated: &SetUp) -> Vec<Hypothesis> {
    let key = section(stated.unit_keys.readings);
    let mut all = MIRRORS.map(|(axes, turned, words)| {
        let mirror = Matrix3::from_fn(|row, column| {
            let sign = if row == turned { -1.0 } else { 1.0 };
            if axes[row] == column { sign } else { 0.0 }
        });
        let edit = match AXES.get(turned) {
            Some(axis) => format!("{axis} with the opposite sign where it is logged"),
            None => format!("{key}: for x, y, z the {} now of {}", places(stated), named(&axes)),
        };
        let set_up = SetUp { reading_map: mirror * stated.reading_map, ..stated.clone() };
        Hypothesis::new(format!("the tracker's {words}"), edit, set_up)
    });
    if stated.tracker_from_base.is_some() {
        return all.into();
    }
    "the tracker's positions are mirrored: an axis counts the other way, or two are exchanged"
        .clone_into(&mut all[0].mistake);
    all.into_iter().take(1).collect()
}

/// Orientations of commands and of readings that are something else than stated: their quaternions' parts, their angles' order or unit.
fn orientations(stated: &SetUp) -> Vec<Hypothesis> {
    let keys = &stated.unit_keys;
    let streams = [
        ("commanded", keys.commands, &stated.command_form),
        ("measured", keys.readings, &stated.reading_form),
    ];
    let read = |what: &str, reread: Reread| match what {
        "commanded" => SetUp { command_turns: reread, ..stated.clone() },
        _ => SetUp { reading_turns: reread, ..stated.clone() },
    };
    let of_stream = |(what, key, form): (&str, &str, &Option<OrientationForm>)| {
        let others = form.iter().flat_map(|form| {
            form.others().into_iter().map(|(other, words)| {
                let edit = format!("{} orientation: {words}", section(key));
                Hypothesis::new(
                    format!("the {what} orientations are written with {words}"),
                    edit,
                    read(what, Reread::Form(Box::new([form.clone(), other]))),
                )
            })
        });
        let has_parts = matches!(form, None | Some(OrientationForm::Quaternion(_)));
        let is_vector = matches!(form, Some(OrientationForm::Vector(..)));
        let of_parts = PARTS.into_iter().filter(move |(from, ..)| {
            has_parts || *from == [0, 1, 2, 3] || (is_vector && from[3] == 3)
        });
        let parts = of_parts.map(|(from, sign, words)| {
            let map = Matrix4::from_fn(|part, place| match (from[part] == place, part) {
                (false, _) => 0.0,
                (true, 3) => 1.0,
                (true, _) => sign,
            });
            let in_table = format!("the {what} orientations inverted where the table is made");
            let inverse = if has_parts { OPPOSITE.to_owned() } else { in_table };
            let inverse = (sign < 0.0).then_some(inverse);
            let ordered = (from != [0, 1, 2, 3]).then(|| {
                let parts = if has_parts { 4 } else { 3 };
                let [own, order] = [&[0, 1, 2, 3], &from].map(|all| named(&all[..parts]));
                format!("{}: for {own} the {} now of {order}", section(key), places(stated))
            });
            let edit = ordered.into_iter().chain(inverse).collect::<Vec<_>>().join("; and ");
            let noun = if has_parts { "quaternions" } else { "orientations" };
            Hypothesis::new(
                format!("the {what} {noun} are {words}"),
                edit,
                read(what, Reread::Parts(map)),
            )
        });
        parts.chain(others).collect::<Vec<_>>()
    };
    streams.into_iter().flat_map(of_stream).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3};

    use super::*;
    use crate::geometry::{RotationOrder, isometry_from_rpy};
    use crate::join::Command;
    use crate::kinematics::RobotFile;
    use crate::setup::{Alternatives, Dwelt, Evidence, UnitKeys, Units, check};

    fn tracker_from_base() -> Isometry3<f64> {
        isometry_from_rpy([2000.0, -500.0, 300.0], [0.1, 0.0, 1.0])
    }

    /// The mistake that is found in a table of poses once its stations are changed.
    fn found(change: impl Fn(&mut Vec<Dwelt>)) -> String {
        found_of(None, change)
    }

    fn found_of(form: Option<&OrientationForm>, change: impl Fn(&mut Vec<Dwelt>)) -> String {
        found_in(LengthUnit::Mm, form, change)
    }

    fn found_in(
        unit: LengthUnit,
        form: Option<&OrientationForm>,
        change: impl Fn(&mut Vec<Dwelt>),
    ) -> String {
        let text = include_str!("../../../../pipelines/robots/ur10.toml");
        let arm = toml::from_str::<RobotFile>(text).expect("a robot file").arm().expect("an arm");
        let reading_form = form.cloned();
        let units = Units::of(AngleUnit::Deg, unit);
        let unit_keys = UnitKeys::TABLES;
        let stated = SetUp { reading_form, unit_keys, units, ..SetUp::of_arm(arm) };
        let tracker_from_base = tracker_from_base();
        let dwelt = |k: i32| {
            let turned = |joint: i32| (f64::from(k * (joint + 2)) * 0.7).sin() * 0.8;
            let reported: Vec<f64> = (0..6).map(turned).collect();
            let flange = tracker_from_base * stated.flange(&reported);
            let measured = (flange * Point3::new(20.0, 30.0, 90.0)).coords;
            Dwelt { measured, reported, orientation: Some(flange.rotation), command: None }
        };
        let mut stations = (0..60).map(dwelt).collect();
        change(&mut stations);
        let evidence = Evidence::spread(stations);
        let found = check(&stated, &evidence, &Alternatives::default(), 30.0);
        found.expect("a mistake").to_string()
    }

    #[test]
    fn units_of_length_are_named() {
        for stated in [LengthUnit::M, LengthUnit::Mm, LengthUnit::Um] {
            for unit in LengthUnit::ALL.into_iter().filter(|unit| *unit != stated) {
                let factor = stated.to_mm() / unit.to_mm();
                let words = found_in(stated, None, |all| {
                    for station in all {
                        station.measured *= factor;
                    }
                });
                let named = format!(
                    "the tracker's positions are in {unit}; write [stations.measured] unit = \"{unit}\""
                );
                assert!(words.contains(&named), "{unit} as {stated}: {words}");
            }
        }
    }

    #[test]
    fn orders_and_units_of_angles_are_named() {
        let of = |order: &str, unit| {
            let order = RotationOrder::try_from(order.to_owned()).expect("an order");
            OrientationForm::Angles(["a", "b", "c"].map(str::to_owned), order, unit)
        };
        for (stated, order, unit) in [
            (of("moving-xyz", AngleUnit::Deg), "fixed-xyz", AngleUnit::Deg),
            (of("fixed-xyz", AngleUnit::Deg), "moving-zyx", AngleUnit::Deg),
            (of("moving-zyz", AngleUnit::Deg), "fixed-xyz", AngleUnit::Rad),
            (
                OrientationForm::Vector(["a", "b", "c"].map(str::to_owned), AngleUnit::Deg),
                "moving-zyx",
                AngleUnit::Deg,
            ),
        ] {
            let written = of(order, unit);
            let words = found_of(Some(&stated), |all| {
                for own in all {
                    let numbers = own.orientation.and_then(|own| written.numbers(&own));
                    own.orientation = numbers.and_then(|numbers| stated.rotation(numbers));
                }
            });
            let unit = if unit == AngleUnit::Rad { "rad" } else { "deg" };
            let named = format!(
                "write [stations.measured] orientation: order = \"{order}\", unit = \"{unit}\""
            );
            assert!(words.contains(&named), "{stated:?}: {words}");
        }
    }

    #[test]
    fn rotation_vectors_with_two_parts_exchanged_are_named() {
        let form = OrientationForm::Vector(["a", "b", "c"].map(str::to_owned), AngleUnit::Rad);
        let words = found_of(Some(&form), |all| {
            for own in all {
                let numbers = own.orientation.and_then(|own| form.numbers(&own));
                own.orientation = numbers.and_then(|[x, y, z]| form.rotation([z, y, x]));
            }
        });
        let named = "are with x and z exchanged; write [stations.measured]: for x, y, z the columns now of z, y, x";
        assert!(words.contains(named), "{words}");
    }

    #[test]
    fn readings_in_the_row_of_another_station_are_named_with_their_orientations() {
        let words = found(|all| {
            for place in 1..all.len() {
                let next = all[place].clone();
                (all[place - 1].measured, all[place - 1].orientation) =
                    (next.measured, next.orientation);
            }
        });
        assert!(words.contains("the readings stand one row too high"), "{words}");
        let form = OrientationForm::Quaternion(["x", "y", "z", "w"].map(str::to_owned));
        let words = found_of(Some(&form), |all| {
            for place in (1..all.len()).rev() {
                all[place].measured = all[place - 1].measured;
            }
        });
        assert!(words.contains("the positions alone stand one row too low; write"), "{words}");
    }

    #[test]
    fn joints_or_commands_in_the_row_of_another_station_are_named() {
        let shifted = |shift: fn(&mut Dwelt, &Dwelt)| {
            found(|all| {
                for own in all.iter_mut() {
                    let position = tracker_from_base().inverse() * Point3::from(own.measured);
                    own.command = Some(Command { position, orientation: None });
                }
                for place in (1..all.len()).rev() {
                    let before = all[place - 1].clone();
                    shift(&mut all[place], &before);
                }
            })
        };
        let words = shifted(|own, before| own.reported.clone_from(&before.reported));
        assert!(words.contains("the joints alone stand one row too low; write"), "{words}");
        let words = shifted(|own, before| own.command.clone_from(&before.command));
        assert!(words.contains("the commands alone stand one row too low; write"), "{words}");
    }
}
