//! Tables of known error fields: fixed points calculated by hand, the tables' rims and missing nodes.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::fit::model::{Known as Angles, Query};
use crate::fit::{FrameUncertainty, SourceId, TargetId};
use crate::geometry::{Base, Transform};
use crate::grid::{self, Interpolation, Lattice, Refusal, Source, TableNode};

const STEP_MM: f64 = 100.0;

/// 4 × 3 × 3 nodes from (600, −100, 400); the error at a node is `field` there, each component's variance 0.0004 mm².
fn grid_table(
    interpolation: Interpolation,
    field: impl Fn(&Point3<f64>) -> Vector3<f64>,
) -> grid::Table {
    let lattice = Lattice {
        origin: Point3::new(600.0, -100.0, 400.0),
        step: [STEP_MM; 3],
        counts: [4, 3, 3],
    };
    let node = |number: usize| TableNode {
        joints: Ok(vec![0.1; 6]),
        error: Ok((field(&lattice.position(number)), Matrix3::identity() * 0.0004)),
        nearest_mm: 10.0,
    };
    grid::Table {
        step_mm: STEP_MM,
        lattice,
        orientation: UnitQuaternion::identity(),
        configuration: None,
        source: Source::Model,
        interpolation,
        idw_power: 2.0,
        interpolation_mm2: None,
        orientation_tolerance_rad: 5.0_f64.to_radians(),
        counted: Vec::new(),
        nodes: (0..lattice.node_count()).map(node).collect(),
    }
}

fn table_in(command_from_base: Isometry3<f64>, table: &grid::Table) -> CompensationTable {
    surveyed(command_from_base, table, FrameUncertainty::default())
}

fn surveyed(
    command_from_base: Isometry3<f64>,
    table: &grid::Table,
    frame: FrameUncertainty,
) -> CompensationTable {
    let conditions = Conditions { tool: Some("drill".to_owned()), ..Conditions::default() };
    let validity = Validity { conditions, ..Validity::default() };
    let command_from_base = Transform::<Command, Base>::claim(command_from_base);
    of_grid(table, &command_from_base, "t-1".to_owned(), validity, frame)
        .expect("the nodes fill the lattice")
}

/// The table that the grid stage chose, transformed from the base frame into the frame of commands.
fn of_grid(
    table: &grid::Table,
    command_from_base: &Transform<Command, Base>,
    table_id: String,
    validity: Validity,
    frame: FrameUncertainty,
) -> Result<CompensationTable, Misfit> {
    let turn = command_from_base.isometry().rotation;
    let matrix = turn.to_rotation_matrix();
    let turned = |own: Matrix3<f64>| matrix * own * matrix.transpose();
    let terms = Terms {
        table_id,
        orientation: turn * table.orientation,
        orientation_tolerance_rad: table.orientation_tolerance_rad,
        configuration: table.configuration.map(|c| c.to_string()),
        interpolation: table.interpolation,
        idw_power: table.idw_power,
        interpolation_mm2: table.interpolation_mm2.map_or_else(Matrix3::zeros, turned),
        validity,
        frame,
        counted: table.counted.clone(),
    };
    let known = |node: &TableNode| {
        let (error, covariance) = node.error?;
        Ok(Known {
            joints: node.joints.clone()?,
            error: matrix * error,
            covariance: turned(covariance),
        })
    };
    let nodes = table.nodes.iter().map(known).collect();
    CompensationTable::new(terms, *command_from_base, table.lattice, nodes)
}

fn table(
    interpolation: Interpolation,
    field: impl Fn(&Point3<f64>) -> Vector3<f64>,
) -> CompensationTable {
    table_in(Isometry3::identity(), &grid_table(interpolation, field))
}

fn target(x: f64, y: f64, z: f64) -> Target {
    Target {
        name: "rivet 7".to_owned(),
        position: Some(Position::claim(Point3::new(x, y, z))),
        ..Target::default()
    }
}

fn refusal(table: &CompensationTable, target: &Target) -> Reason {
    compensate(table, target).expect_err("a target that is refused").reason
}

/// 1 mm along x, and 2 µm more per mm of x.
fn stretch(at: &Point3<f64>) -> Vector3<f64> {
    Vector3::new(1.0 + 0.002 * (at.x - 600.0), 0.0, -0.5)
}

#[test]
fn a_linear_error_field_is_corrected_exactly() {
    let found = compensate(&table(Interpolation::Trilinear, stretch), &target(751.0, 20.0, 450.0))
        .expect("inside");
    // c + 1 + 0.002 (c − 600) = 751 has c = 600 + 150 / 1.002.
    let expected = Vector3::new(600.0 + 150.0 / 1.002, 20.0, 450.5);
    assert!((found.command.coords() - expected).norm() < 1e-8, "{found:?}");
    assert!((found.correction - (expected - Vector3::new(751.0, 20.0, 450.0))).norm() < 1e-8);
    // 1 mm shrinks by 0.002 an iteration: 1, 2e-3, 5e-6, 1e-8 mm, the last below a nanometre and a half.
    assert_eq!(found.iterations, 4);
}

#[test]
fn the_interpolation_error_is_counted_off_the_nodes() {
    let mut given = grid_table(Interpolation::Trilinear, stretch);
    given.interpolation_mm2 = Some(Matrix3::from_diagonal(&Vector3::new(0.01, 0.0, 0.02)));
    // A quarter turn about z brings the base's x to y.
    let quarter = Isometry3::rotation(Vector3::z() * FRAC_PI_2);
    let table = table_in(quarter, &given);
    let covariance = |x: f64| {
        let command = Position::claim(quarter * Point3::new(x, 0.0, 500.0));
        table.error_at(&command).expect("inside").covariance
    };
    let nodes = Matrix3::identity() * 0.0004;
    assert!((covariance(700.0) - nodes).amax() < 1e-12);
    let added = Matrix3::from_diagonal(&Vector3::new(0.0, 0.01, 0.02));
    assert!((covariance(750.0) - nodes - added).amax() < 1e-12);
}

#[test]
fn a_table_predicts_only_for_its_orientation_inside_its_box() {
    let table = table(Interpolation::Trilinear, stretch);
    let at = |x: f64, turned_deg: f64| At::Tool {
        position: Point3::new(x, 20.0, 450.0),
        orientation: Some(UnitQuaternion::from_scaled_axis(Vector3::z() * turned_deg.to_radians())),
    };
    let found = table.predict(&at(751.0, 4.0)).unwrap();
    let expected = stretch(&Point3::new(751.0, 20.0, 450.0));
    assert!((found.error.unwrap() - expected).norm() < 1e-12);
    assert!((found.position - Point3::new(751.0, 20.0, 450.0) - expected).norm() < 1e-12);
    // Eight positive weights that sum to one: the variance of every node.
    let covariance = table.spread(0, SourceId::ONLY, &found).covariance();
    assert!((covariance - Matrix3::identity() * 0.0004).abs().max() < 1e-15);
    assert!(matches!(
        table.predict(&at(751.0, 6.0)),
        Err(Gap::Orientation { angle_deg, limit_deg }) if (angle_deg - 6.0).abs() < 1e-9 && (limit_deg - 5.0).abs() < 1e-9
    ));
    assert!(matches!(table.predict(&at(901.0, 0.0)), Err(Gap::Outside { .. })));
    let joints = At::Joints(Query {
        axes: &[0.1; 6],
        known: Angles::Commanded,
        lever: Vector3::zeros(),
        session: 0,
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        own: true,
        station: None,
    });
    assert!(matches!(table.predict(&joints), Err(Gap::NoPosition)));
}

#[test]
fn a_frame_of_commands_turned_against_the_base_gives_the_same_correction_there() {
    let grid_table = grid_table(Interpolation::Trilinear, stretch);
    let command_from_base = Isometry3::new(Vector3::new(10.0, 20.0, 30.0), Vector3::z() * 0.7);
    let turned = table_in(command_from_base, &grid_table);
    let plain = table_in(Isometry3::identity(), &grid_table);
    let here = target(751.0, 20.0, 450.0);
    let there = Target {
        position: here.position.map(|at| Position::claim(command_from_base * at.point())),
        orientation: Some(UnitQuaternion::from_scaled_axis(Vector3::z() * 0.7)),
        ..here.clone()
    };
    let (plain, turned) =
        (compensate(&plain, &here).unwrap(), compensate(&turned, &there).unwrap());
    assert!((command_from_base * plain.correction - turned.correction).norm() < 1e-9);
    // The error along base x has all of its variance along command y after a quarter turn.
    let mut lopsided = grid_table;
    for node in &mut lopsided.nodes {
        node.error = node
            .error
            .map(|(error, _)| (error, Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0))));
    }
    let quarter = Isometry3::new(Vector3::zeros(), Vector3::z() * FRAC_PI_2);
    let found = compensate(&table_in(quarter, &lopsided), &target(-20.0, 751.0, 450.0)).unwrap();
    assert!(
        (found.standard_deviation().unwrap() - Vector3::y()).norm() < 1e-7,
        "{:?}",
        found.covariance
    );
}

#[test]
fn a_correction_is_as_uncertain_as_the_surveyed_frame_is_at_the_target() {
    let grid_table = grid_table(Interpolation::Trilinear, stretch);
    let frame = FrameUncertainty { origin_mm: 0.03, rotation_rad: 1e-4, lever_mm: 0.04 };
    // Commands in a frame that is elsewhere and turned by a quarter: the survey turns about the base's origin, not about theirs.
    let command_from_base =
        Isometry3::new(Vector3::new(100.0, -50.0, 20.0), Vector3::z() * FRAC_PI_2);
    let at = command_from_base * Point3::new(700.0, 20.0, 500.0);
    let found = |frame: FrameUncertainty| {
        let table = surveyed(command_from_base, &grid_table, frame);
        compensate(&table, &target(at.x, at.y, at.z)).expect("inside")
    };
    let (with, without) = (found(frame), found(FrameUncertainty::default()));
    assert_eq!((with.command, with.correction), (without.command, without.correction));
    assert_eq!(without.of_frame, Matrix3::zeros());
    // 0.03² + 0.04² = 0.0025 mm² everywhere, and 1e-8 of |p|² I − p pᵀ at p = (700, 20, 500) mm in the base; command x is base −y and
    // command y is base x: p is (−20, 700, 500) along the axes of commands.
    let expected = Matrix3::new(
        0.0025 + 1e-8 * (490_000.0 + 250_000.0),
        1e-8 * 14_000.0,
        1e-8 * 10_000.0,
        1e-8 * 14_000.0,
        0.0025 + 1e-8 * (400.0 + 250_000.0),
        -1e-8 * 350_000.0,
        1e-8 * 10_000.0,
        -1e-8 * 350_000.0,
        0.0025 + 1e-8 * (490_000.0 + 400.0),
    );
    assert!((with.of_frame - expected).abs().max() < 1e-12, "{}", with.of_frame);
    assert!(
        (with.covariance.unwrap() - without.covariance.unwrap() - expected).abs().max() < 1e-12
    );
    assert!((with.own_variance_mm2().unwrap() - 3.0 * 0.0004).abs() < 1e-12);
    assert!((with.frame_deviation_norm().powi(2) - expected.trace()).abs() < 1e-12);
}

#[test]
fn between_nodes_of_equal_standard_deviation_the_correction_has_it_too() {
    // √0.0004 = 0.02 mm per axis. With independent errors of the nodes it would be 0.02 / √8 in the middle, but the table
    // does not state that they are independent.
    let found =
        compensate(&table(Interpolation::Idw, |_| Vector3::zeros()), &target(650.0, -50.0, 450.0))
            .unwrap();
    assert!((found.standard_deviation().unwrap() - Vector3::repeat(0.02)).norm() < 1e-12);
    assert!((found.standard_deviation_norm().unwrap() - 0.02 * 3.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_target_outside_is_refused_with_its_distance() {
    let table = table(Interpolation::Trilinear, stretch);
    // The box is 600…900, −100…100, 400…600.
    let outside = refusal(&table, &target(912.5, 0.0, 399.0));
    let Reason::Target(Gap::Outside { beyond_mm }) = &outside else {
        panic!("{outside:?}");
    };
    assert!((beyond_mm - Vector3::new(12.5, 0.0, -1.0)).norm() < 1e-9);
    let message = compensate(&table, &target(912.5, 0.0, 399.0)).unwrap_err().to_string();
    let expected =
        "target \"rivet 7\" lies 12.5000 mm along +x and 1.0000 mm along −z beyond the table's box";
    assert!(message.starts_with(expected), "{message}");
}

#[test]
fn a_command_that_its_correction_takes_beyond_the_rim_has_the_error_there() {
    // ê is +1 mm along x at the low rim: the command is 0.7 mm outside.
    let near_rim = target(600.3, 0.0, 500.0);
    let found = compensate(&table(Interpolation::Trilinear, stretch), &near_rim).expect("inside");
    assert!((found.correction - Vector3::new(-1.0, 0.0, 0.5)).norm() < 1e-9);
    // The frame of commands does not matter.
    let turned = Isometry3::new(Vector3::new(10.0, 20.0, 30.0), Vector3::z() * FRAC_PI_2);
    let table = table_in(turned, &grid_table(Interpolation::Trilinear, stretch));
    let place = turned * Point3::new(600.3, 0.0, 500.0);
    let there = compensate(&table, &target(place.x, place.y, place.z)).expect("inside");
    let expected = turned.rotation * Vector3::new(-1.0, 0.0, 0.5);
    assert!((there.correction - expected).norm() < 1e-9, "{there:?}");
}

#[test]
fn a_command_far_beyond_the_rim_is_refused_though_the_target_is_inside() {
    // A tenth of the pitch is 10 mm; ê is +12 mm along x.
    let found = refusal(
        &table(Interpolation::Trilinear, |_| Vector3::new(12.0, 0.0, 0.0)),
        &target(600.3, 0.0, 500.0),
    );
    let Reason::Command(Gap::Outside { beyond_mm }) = found else {
        panic!("{found:?}");
    };
    assert!((beyond_mm.x + 11.7).abs() < 0.01, "{beyond_mm}");
    assert!(beyond_mm.yz().norm() < 1e-12);
}

#[test]
fn a_cell_with_a_refused_node_is_refused_and_its_neighbours_are_not() {
    let mut grid_table = grid_table(Interpolation::Trilinear, stretch);
    grid_table.nodes[0].error = Err(Refusal::Singularity); // at (600, −100, 400)
    let table = table_in(Isometry3::identity(), &grid_table);
    let found = refusal(&table, &target(690.0, -10.0, 490.0));
    let expected =
        Gap::Node { node: 0, at: Point3::new(600.0, -100.0, 400.0), why: Refusal::Singularity };
    assert_eq!(found, Reason::Target(expected));
    assert!(compensate(&table, &target(750.0, -10.0, 490.0)).is_ok());
}

#[test]
fn nodes_on_different_branches_are_not_interpolated() {
    let mut grid_table = grid_table(Interpolation::Trilinear, stretch);
    grid_table.nodes[0].joints = Ok(vec![0.1, 0.1, 0.1, 0.1, 0.1, 0.1 + PI]);
    let found =
        refusal(&table_in(Isometry3::identity(), &grid_table), &target(690.0, -10.0, 490.0));
    assert_eq!(found, Reason::Target(Gap::Branches));
}

#[test]
fn targets_outside_the_validity_of_a_table_are_refused() {
    let table = table(Interpolation::Trilinear, stretch);
    let inside = target(751.0, 20.0, 450.0);
    let turned = |degrees: f64| Target {
        orientation: Some(UnitQuaternion::from_scaled_axis(Vector3::x() * degrees.to_radians())),
        ..inside.clone()
    };
    assert!(compensate(&table, &turned(4.99)).is_ok());
    let message = compensate(&table, &turned(7.5)).unwrap_err().to_string();
    assert!(
        message.contains(
            "is turned 7.500° from the table's tool orientation, which is valid up to 5.000°"
        ),
        "{message}"
    );
    let tool = |name: &str| Target { tool: Some(name.to_owned()), ..inside.clone() };
    assert!(compensate(&table, &tool("drill")).is_ok());
    assert!(matches!(refusal(&table, &tool("rivet")), Reason::Tool { .. }));
    let flipped = Target { configuration: Some("wrist-".to_owned()), ..inside.clone() };
    assert!(matches!(refusal(&table, &flipped), Reason::Configuration { .. }));
}

#[test]
fn an_error_field_that_changes_too_fast_does_not_converge() {
    // ê = −2 (x − 750): every step throws the command to the other side, twice as far.
    let runaway =
        table(Interpolation::Trilinear, |at| Vector3::new(-2.0 * (at.x - 750.0), 0.0, 0.0));
    assert!(matches!(
        refusal(&runaway, &target(750.1, 0.0, 500.0)),
        Reason::Command(Gap::Outside { .. })
    ));
    // Two cells that meet at x = 700: near it, each gives a command in the other. Nodes at 600 have −1, at 800 +1 (of the
    // other cell); the plane between is 0 everywhere, so `idw` jumps there.
    let jump = table(Interpolation::Idw, |at| {
        Vector3::new(((at.x - 700.0) / 100.0).clamp(-1.0, 1.0), 0.0, 0.0)
    });
    assert!(compensate(&jump, &target(700.0, -50.0, 450.0)).is_err());
    let smooth = table(Interpolation::Trilinear, |at| {
        Vector3::new(((at.x - 700.0) / 100.0).clamp(-1.0, 1.0), 0.0, 0.0)
    });
    assert!(compensate(&smooth, &target(700.0, -50.0, 450.0)).is_ok());
}

#[test]
fn nodes_that_do_not_fill_the_lattice_are_no_table() {
    let mut grid_table = grid_table(Interpolation::Trilinear, stretch);
    grid_table.nodes[5].joints = Ok(vec![0.1; 7]);
    let of = |table: &grid::Table| {
        of_grid(
            table,
            &Transform::identity(),
            String::new(),
            Validity::default(),
            FrameUncertainty::default(),
        )
    };
    assert_eq!(of(&grid_table), Err(Misfit::JointCount { node: 5, found: 7, expected: 6 }));
    grid_table.nodes.pop();
    assert_eq!(of(&grid_table), Err(Misfit::NodeCount { found: 35, counts: [4, 3, 3] }));
}

proptest! {
    /// Errors of up to 1.5 mm per axis, which change by up to 3 mm from node to node: far rougher than any arm.
    #[test]
    fn a_fixed_point_satisfies_its_equation(
        errors in prop::collection::vec(prop::array::uniform3(-1.5..1.5), 36),
        place in prop::array::uniform3(0.02..0.98),
    ) {
        let mut grid_table = grid_table(Interpolation::Trilinear, |_| Vector3::zeros());
        for (node, error) in grid_table.nodes.iter_mut().zip(&errors) {
            node.error = Ok((Vector3::from(*error), Matrix3::zeros()));
        }
        let table = table_in(Isometry3::identity(), &grid_table);
        let target = target(600.0 + 300.0 * place[0], -100.0 + 200.0 * place[1], 400.0 + 200.0 * place[2]);
        let found = compensate(&table, &target).expect("2 % of the box is more than the largest error");
        let attained = found.command.coords() + table.error_at(&found.command).expect("inside").error;
        prop_assert!((attained - found.target.coords()).norm() < 1e-6);
        prop_assert!((found.command.coords() - found.target.coords() - found.correction).norm() < 1e-12);
    }
}
