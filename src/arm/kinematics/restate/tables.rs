//! Lines as tables: standard and modified DH and the S-model, by common normals.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::super::convention::Convention;
use super::super::robot_file::RobotFile;
use super::super::screws::{Line, Screws};
use super::{RestateError, clean, degrees, on_first_axis, placement};

/// Axes whose directions differ by less are parallel, rad.
const PARALLEL: f64 = 1e-11;
/// Lines that pass each other nearer than this meet, mm.
const MEET: f64 = 1e-9;
/// A common normal farther from its link than this is no place to put it, mm.
const FARTHEST_MM: f64 = 1e6;

/// The common normal of two lines: where it meets each, and its direction.
struct Normal {
    on_first: Point3<f64>,
    on_second: Point3<f64>,
    across: Vector3<f64>,
}

/// The place and direction that a normal has where the lines leave them open.
struct Hint {
    /// A point of the first line, for parallel lines.
    point: Point3<f64>,
    /// A direction, for lines that are one.
    across: Vector3<f64>,
}

/// Standard DH: the link behind each joint goes to the common normal with the next axis, the last to the flange's z.
pub(super) fn standard(file: &mut RobotFile, screws: &Screws) -> Result<(), RestateError> {
    let lines: Vec<Line> = screws.axes.iter().map(|screw| screw.line).collect();
    let Some(first) = lines.first() else { return Ok(()) };
    let mut frame = on_first_axis(first);
    file.base = placement(&frame);
    for place in 0..lines.len() {
        let is_last = place + 1 == lines.len();
        let next = lines.get(place + 1).copied().unwrap_or_else(|| Line::z_of(&screws.flange));
        let at_flange = || {
            let point = lines[place].nearest_to(&screws.flange.translation.vector.into());
            Hint { point, across: screws.flange.rotation * Vector3::x() }
        };
        let hint = if is_last { at_flange() } else { hint_of(&frame) };
        // On the next line where the common normal meets it, x along the normal.
        let line = Line::z_of(&frame);
        let normal = Normal::of(&line, &next, &hint);
        refuse_far(file, place, &line, &next, &normal, &hint.point)?;
        let behind = frame_at(&normal.on_second, &normal.across, &next);
        put(file, place, &(frame.inverse() * behind), Order::TurnFirst);
        frame = behind;
    }
    finish(file, &frame, &screws.flange);
    Ok(())
}

/// Modified DH: the link before a joint leads along the common normal with the axis before; the base's z axis is first.
pub(super) fn modified(file: &mut RobotFile, screws: &Screws) -> Result<(), RestateError> {
    let lines: Vec<Line> = screws.axes.iter().map(|screw| screw.line).collect();
    let Some(first) = lines.first() else { return Ok(()) };
    let base = Isometry3::identity();
    let normal = Normal::of(&Line::z_of(&base), first, &hint_of(&base));
    let mut frame = frame_at(&normal.on_first, &normal.across, &Line::z_of(&base));
    file.base = placement(&frame);
    for place in 0..lines.len() {
        // The frame before, with its x along the normal to this axis; then this joint's frame, with x along the next normal.
        let next = lines.get(place + 1);
        let here = Normal::of(&Line::z_of(&frame), &lines[place], &hint_of(&frame));
        let ahead = match next {
            Some(next) => {
                let at = Hint { point: here.on_second, across: here.across };
                let normal = Normal::of(&lines[place], next, &at);
                refuse_far(file, place, &lines[place], next, &normal, &here.on_second)?;
                frame_at(&normal.on_first, &normal.across, &lines[place])
            }
            None => frame_at(&here.on_second, &here.across, &lines[place]),
        };
        put(file, place, &(frame.inverse() * ahead), Order::TwistFirst);
        frame = ahead;
    }
    file.flange = placement(&(frame.inverse() * screws.flange));
    Ok(())
}

fn hint_of(frame: &Isometry3<f64>) -> Hint {
    Hint { point: frame.translation.vector.into(), across: frame.rotation * Vector3::x() }
}

fn refuse_far(
    file: &RobotFile,
    place: usize,
    line: &Line,
    next: &Line,
    normal: &Normal,
    near: &Point3<f64>,
) -> Result<(), RestateError> {
    let distance = (normal.on_first - near).norm();
    if distance < FARTHEST_MM {
        return Ok(());
    }
    Err(RestateError::NearlyParallel {
        joint: file.joint[place].name.clone(),
        convention: file.convention.word(),
        angle_deg: line.direction.cross(&next.direction).norm().asin().to_degrees(),
        distance_m: distance / 1000.0,
    })
}

fn frame_at(point: &Point3<f64>, across: &Vector3<f64>, line: &Line) -> Isometry3<f64> {
    let z = line.direction.into_inner();
    let y = z.cross(across).normalize();
    let x = y.cross(&z);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(
        Translation3::from(*point),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

impl Normal {
    fn of(first: &Line, second: &Line, hint: &Hint) -> Self {
        let (z, next) = (first.direction.into_inner(), second.direction.into_inner());
        let cross = z.cross(&next);
        let between = second.point - first.point;
        if cross.norm() < PARALLEL {
            let on_first = first.nearest_to(&hint.point);
            let on_second = second.nearest_to(&on_first);
            let apart = on_second - on_first;
            let is_open = apart.norm() < MEET;
            let across = if is_open { hint.across - z * z.dot(&hint.across) } else { apart };
            return Self { on_first, on_second, across: across.normalize() };
        }
        // The feet of the common normal: the distance along each line where the difference is across both.
        let sine2 = cross.norm_squared();
        let along_first = between.cross(&next).dot(&cross) / sine2;
        let along_second = between.cross(&z).dot(&cross) / sine2;
        let on_first = first.point + z * along_first;
        let on_second = second.point + next * along_second;
        let apart = cross.dot(&between) / cross.norm();
        let across = cross.normalize() * if apart < -MEET { -1.0 } else { 1.0 };
        Self { on_first, on_second, across }
    }
}

#[derive(Clone, Copy)]
enum Order {
    TurnFirst,
    TwistFirst,
}

impl Order {
    /// θ, α, d and a of a link.
    fn quantities(self, link: &Isometry3<f64>) -> [f64; 4] {
        let matrix = link.rotation.to_rotation_matrix();
        let at = link.translation.vector;
        match self {
            Self::TurnFirst => {
                let theta = matrix[(1, 0)].atan2(matrix[(0, 0)]);
                let alpha = matrix[(2, 1)].atan2(matrix[(2, 2)]);
                [theta, alpha, at.z, at.x * theta.cos() + at.y * theta.sin()]
            }
            Self::TwistFirst => {
                let theta = (-matrix[(0, 1)]).atan2(matrix[(0, 0)]);
                let alpha = (-matrix[(1, 2)]).atan2(matrix[(2, 2)]);
                [theta, alpha, at.z * alpha.cos() - at.y * alpha.sin(), at.x]
            }
        }
    }
}

fn put(file: &mut RobotFile, place: usize, link: &Isometry3<f64>, order: Order) {
    let [theta, alpha, d, a] = order.quantities(link);
    let joint = &mut file.joint[place];
    joint.a_mm = Some(clean(a));
    joint.alpha_deg = Some(degrees(alpha));
    joint.d_mm = Some(clean(d));
    joint.offset_deg = Some(degrees(theta));
    if file.convention == Convention::SModel {
        joint.gamma_deg = Some(0.0);
        joint.b_mm = Some(0.0);
    }
}

/// Transform left between the last link's frame and the flange, of one z axis: γ and b of the S-model, else `[flange]`.
fn finish(file: &mut RobotFile, last: &Isometry3<f64>, flange: &Isometry3<f64>) {
    let left = last.inverse() * flange;
    let (convention, joint) = (file.convention, file.joint.last_mut());
    match (convention, joint) {
        (Convention::SModel, Some(joint)) => {
            let x = left.rotation * Vector3::x();
            joint.gamma_deg = Some(degrees(x.y.atan2(x.x)));
            joint.b_mm = Some(clean(left.translation.vector.z));
        }
        _ => file.flange = placement(&left),
    }
}
