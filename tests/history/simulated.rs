//! False alarms at the stated rate, and known changes named, on sessions drawn from a real fit's own information.

use nalgebra::DMatrix;

use super::*;
use crate::fit::full::{FullModel, FullSettings};
use crate::fit::saved::SavedCalibration;
use crate::fit::{self, FitSettings, Freedom, Noise, Observation, TrackerUncertainty};
use crate::geometry::isometry_from_rpy;
use crate::kinematics::{Arm, Axis, Motion};
use crate::simulate::{ArmErrors, Commanded, Ingredient, SimulateSettings, Stream, visits};

const STATIONS: usize = 80;
const HOME_DEG: [f64; 6] = [0.0, -75.0, 95.0, 0.0, 60.0, 0.0];
const SPREAD_DEG: [f64; 6] = [60.0, 30.0, 35.0, 90.0, 40.0, 120.0];

pub(crate) fn arm() -> Arm {
    let text = include_str!("../../pipelines/robots/kr210-r2700-extra.toml");
    let file: crate::kinematics::RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

/// Stations of a KR 210 with realistic errors (arm 7) at random configurations.
pub(crate) fn observations(
    arm: &Arm,
    session: u64,
    change: impl Fn(&mut SimulateSettings, &mut ArmErrors),
) -> Vec<Observation> {
    let home: Vec<f64> = HOME_DEG.iter().map(|q| q.to_radians()).collect();
    let listed = || crate::simulate::Poses::Listed { joints: Vec::new() };
    let of_arm = SimulateSettings::realistic(7, home.clone(), listed());
    let mut errors = ArmErrors::draw(arm, &of_arm);
    let mut settings = SimulateSettings::realistic(1000 + session, home.clone(), listed());
    change(&mut settings, &mut errors);
    let target = isometry_from_rpy(
        settings.cell.flange_from_target_mm,
        settings.cell.flange_from_target_rpy,
    );
    let mut poses = Stream::new(session, Ingredient::Poses);
    let commanded: Vec<Commanded> = (0..STATIONS)
        .map(|_| {
            let sides = SPREAD_DEG.map(|spread| spread.to_radians());
            let joints: Vec<f64> = home
                .iter()
                .zip(sides)
                .map(|(q, side)| q + poses.between(-side, side))
                .collect();
            Commanded {
                base_from_target: arm.chain().nominal(&arm.axes(&joints)) * target,
                joints,
            }
        })
        .collect();
    let visits = visits(arm, &settings, &errors, &commanded);
    let stations: Vec<_> = visits.into_iter().map(|visit| visit.station).collect();
    let noise = Noise {
        tracker: TrackerUncertainty {
            range_um: 10.0,
            range_um_per_m: 0.3,
            transverse_um: 15.0,
            transverse_um_per_m: 6.0,
            divisor: 2.0,
            orientation_rad: None,
        },
        repeatability_mm: 0.03,
        orientations: false,
    };
    fit::observations(0, &stations, arm, &noise)
}

fn geometric(arm: &Arm) -> Estimate {
    let seen = observations(arm, 1, |_, _| ());
    let fitted =
        fit::identify(arm, &seen, 1, Freedom::Geometry, &FitSettings::default()).expect("a fit");
    let saved = SavedCalibration::of(&fitted, arm, &["one"]);
    Estimate::of_geometric(&saved)
        .expect("sound")
        .expect("an estimate")
}

pub(crate) fn full(arm: &Arm, seen: &[Observation]) -> Estimate {
    let settings = FitSettings::default();
    let start = fit::identify(arm, seen, 1, Freedom::Geometry, &settings).expect("a fit");
    let quick = FullSettings {
        harmonics: 12,
        gear_lines: false,
        ..FullSettings::default()
    };
    let up = Some(nalgebra::Vector3::z_axis());
    let model = FullModel::train(
        arm,
        seen,
        &start.frames,
        &start.geometry,
        settings.prior(),
        &quick,
        up,
    );
    Estimate::of_full(&model.expect("a model")).expect("an estimate")
}

/// Sessions of the same poses, with a truth of their own each.
struct Drawing {
    of: Estimate,
    root: DMatrix<f64>,
    stream: Stream,
}

impl Drawing {
    fn new(of: Estimate, seed: u64) -> Self {
        Self {
            root: of.root(),
            of,
            stream: Stream::new(seed, Ingredient::Errors),
        }
    }

    fn next(&mut self, truth: &[(Column, f64)]) -> Estimate {
        let noise = self.stream.normals(self.of.columns().len(), 1.0);
        self.of.drawn(&self.root, truth, &noise)
    }

    fn compared(&mut self, truth: &[(Column, f64)]) -> (Vec<Asked>, Finding) {
        let (earlier, later) = (self.next(&[]), self.next(truth));
        let comparison = Comparison::new(&earlier, &later);
        find(&comparison, &suspects(comparison.columns()))
    }
}

fn base(axis: Axis) -> Column {
    Column::Chain(Parameter::Base(Motion::Translation(axis)))
}

fn target(axis: Axis) -> Column {
    Column::Chain(Parameter::Target(Motion::Translation(axis)))
}

fn theta(joint: usize) -> Column {
    Column::Chain(Parameter::Link {
        joint,
        quantity: LinkQuantity::Theta,
    })
}

#[test]
fn p_values_are_uniform_where_nothing_changed() {
    let mut drawing = Drawing::new(geometric(&arm()), 1);
    let rounds = 600;
    let (mut omnibus, mut any) = (0, 0);
    for _ in 0..rounds {
        let (asked, _) = drawing.compared(&[]);
        let all = asked
            .iter()
            .find(|asked| asked.suspect == Suspect::Anything)
            .expect("asked");
        omnibus += usize::from(all.alone.p_value() < 0.1);
        let least = asked
            .iter()
            .map(|asked| asked.alone.p_value())
            .fold(1.0, f64::min);
        any += usize::from(least * (asked.len() as f64) < 0.1);
    }
    // 10 % of 600 is 60 ± 7.3; the family's rate may be lower, as suspects overlap, but not higher, and not nothing.
    assert!(
        (38..=82).contains(&omnibus),
        "{omnibus} of {rounds} below 0.1"
    );
    assert!(
        (12..=82).contains(&any),
        "{any} of {rounds} families below 0.1"
    );
}

/// How often the first named is what is expected, and it is named alone.
fn named(truth: &[(Column, f64)], expected: Suspect) -> (usize, usize) {
    let mut drawing = Drawing::new(geometric(&arm()), 2);
    let (mut among, mut alone) = (0, 0);
    for _ in 0..60 {
        let (_, finding) = drawing.compared(truth);
        let parts = finding.parts();
        among += usize::from(parts.contains(&expected));
        alone += usize::from(parts == [expected]);
    }
    (among, alone)
}

#[test]
fn known_changes_are_named() {
    let cases = [
        (vec![(base(Axis::X), 0.2)], Suspect::Base),
        (vec![(target(Axis::Y), 0.1)], Suspect::Target),
        (vec![(theta(3), 50e-6)], Suspect::JointOffset(3)),
        (vec![(theta(3), 200e-6)], Suspect::JointOffset(3)),
    ];
    for (truth, expected) in cases {
        let found = named(&truth, expected);
        eprintln!("{truth:?}: {found:?}");
    }
}

fn figures(estimate: Estimate) -> SessionFigures {
    let name = || "the same".to_owned();
    let basis = Basis {
        pipeline: name(),
        version: name(),
        robot_file: name(),
        settings: name(),
        model: name(),
    };
    SessionFigures {
        basis,
        estimate,
        accuracy: Vec::new(),
    }
}

#[test]
fn the_whole_model_finds_what_moved_from_measured_stations() {
    let arm = arm();
    let mut course = Course::default();
    for session in 0..12 {
        let seen = observations(&arm, session, |settings, errors| {
            settings.cell.base_drift_mm = 0.0;
            if session >= 3 {
                settings.cell.tracker_from_base_mm[0] += 0.2;
            }
            if session >= 6 {
                let place = arm
                    .chain()
                    .parameters()
                    .iter()
                    .position(|own| Column::Chain(*own) == theta(3));
                errors.offsets[place.expect("free")] += 50e-6;
            }
            if session >= 9 {
                errors.flange_from_target_mm[0] += 0.1;
            }
        });
        let judged = course.next(&figures(full(&arm, &seen)));
        eprintln!(
            "{session} against {} {:?} {:?} settles {:?}",
            judged.against,
            judged.in_words(),
            judged.finding,
            judged.settles
        );
        let all = judged.asked.iter().find(|a| a.suspect == Suspect::Anything);
        eprintln!(
            "   {all:?} {:?}",
            judged
                .asked
                .iter()
                .map(|a| format!("{} {:.1}/{}", a.suspect, a.alone.statistic, a.alone.freedom))
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
}
