//! Orientations: the form, the order of axes and the unit under which they turn with the nominal flange.

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::columns::number;
use super::roles::TurnColumns;
use crate::figures::median;
use crate::geometry::RotationOrder;
use crate::ingest::AngleUnit;
use crate::measured_table::MeasuredTable;
use crate::station_table::rotation_of_matrix;

/// Largest angle in radians that is tried as such.
const LARGEST_RAD: f64 = 2.2 * std::f64::consts::PI;
/// Orientations that disagree by more than this in the median are of something else, rad.
const LARGEST_APART: f64 = 0.1;
/// Forms within this factor of the best one are as good.
const AS_GOOD: f64 = 3.0;
/// An agreement below this says nothing more, rad: five digits of degrees.
const ROUNDED: f64 = 1e-5;
/// Orders that people use, the more usual ones first; others are taken only where they agree better.
const USUAL: [&str; 5] = ["fixed-xyz", "moving-xyz", "moving-zyx", "moving-zyz", "fixed-zyx"];

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// A quaternion; the columns in the order x y z w.
    Quaternion([usize; 4]),
    Angles([usize; 3], RotationOrder, AngleUnit),
    Vector([usize; 3], AngleUnit),
    /// A rotation matrix; the columns row by row.
    Matrix([usize; 9]),
}

#[derive(Debug, Clone, PartialEq)]
pub struct Turned {
    pub form: Form,
    pub flange_from_own: UnitQuaternion<f64>,
    /// Median angle between it and the nominal arm, rad.
    pub median_rad: f64,
    pub as_good: Vec<Form>,
}

impl Form {
    /// Every form of these columns, the usual ones first; `largest` is the largest of their numbers.
    pub fn all(columns: &TurnColumns, largest: f64) -> Vec<Self> {
        match *columns {
            TurnColumns::Quaternion(own @ [x, y, z, w]) => {
                vec![Self::Quaternion(own), Self::Quaternion([w, x, y, z])]
            }
            TurnColumns::Matrix(own @ [a, b, c, d, e, f, g, h, i]) => {
                vec![Self::Matrix(own), Self::Matrix([a, d, g, b, e, h, c, f, i])]
            }
            TurnColumns::Angles(own) => {
                let both = [AngleUnit::Rad, AngleUnit::Deg];
                let units = if largest > LARGEST_RAD { &both[1..] } else { &both[..] };
                let of_unit = |&unit: &AngleUnit| {
                    let orders =
                        usual_orders().into_iter().map(move |order| Self::Angles(own, order, unit));
                    orders.chain([Self::Vector(own, unit)])
                };
                units.iter().flat_map(of_unit).collect()
            }
        }
    }

    /// The orientation in a row; `None` where a cell has no number, or a quaternion is none.
    fn rotation(&self, table: &MeasuredTable, row: usize) -> Option<UnitQuaternion<f64>> {
        let at = |column: usize| number(table, row, column);
        let three = |[a, b, c]: [usize; 3]| Some([at(a)?, at(b)?, at(c)?]);
        match *self {
            Self::Quaternion([x, y, z, w]) => {
                let quaternion = Quaternion::new(at(w)?, at(x)?, at(y)?, at(z)?);
                ((quaternion.norm() - 1.0).abs() < 1e-2)
                    .then(|| UnitQuaternion::from_quaternion(quaternion))
            }
            Self::Angles(own, order, unit) => {
                Some(order.rotation(three(own)?.map(|angle| angle * unit.to_rad())))
            }
            Self::Vector(own, unit) => {
                let vector = Vector3::from(three(own)?) * unit.to_rad();
                Some(UnitQuaternion::from(Rotation3::new(vector)))
            }
            Self::Matrix(own) => {
                let numbers: Option<Vec<f64>> = own.into_iter().map(at).collect();
                rotation_of_matrix(&numbers?)
            }
        }
    }
}

fn usual_orders() -> Vec<RotationOrder> {
    let usual = USUAL.iter().filter_map(|word| RotationOrder::try_from((*word).to_owned()).ok());
    let mut orders: Vec<RotationOrder> = usual.collect();
    orders.extend(
        RotationOrder::all().filter(|order| !USUAL.contains(&String::from(*order).as_str())),
    );
    orders
}

/// `flanges` are rows with the nominal flange's orientation; `None` where no form agrees.
pub fn turned(
    table: &MeasuredTable,
    columns: &TurnColumns,
    flanges: &[(usize, UnitQuaternion<f64>)],
) -> Option<Turned> {
    let numbers = flanges.iter().flat_map(|(row, _)| {
        columns.columns().iter().filter_map(|&column| number(table, *row, column))
    });
    let largest = numbers.fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let fits = Form::all(columns, largest).into_iter().filter_map(|form| fit(table, form, flanges));
    let fits: Vec<Turned> = fits.collect();
    let least = fits.iter().map(|own| own.median_rad).min_by(f64::total_cmp)?;
    let is_as_good = |own: &&Turned| own.median_rad <= (AS_GOOD * least).max(ROUNDED);
    let mut best: Vec<&Turned> = fits.iter().filter(is_as_good).collect();
    // Where one of the usual forms agrees as well as any, it is taken.
    let first = best.remove(0);
    (first.median_rad <= LARGEST_APART).then(|| Turned {
        as_good: best.into_iter().map(|own| own.form).collect(),
        ..first.clone()
    })
}

fn fit(
    table: &MeasuredTable,
    form: Form,
    flanges: &[(usize, UnitQuaternion<f64>)],
) -> Option<Turned> {
    let relative = |(row, flange): &(usize, UnitQuaternion<f64>)| {
        Some(flange.inverse() * form.rotation(table, *row)?)
    };
    let all: Vec<UnitQuaternion<f64>> = flanges.iter().filter_map(relative).collect();
    let apart = |centre: &UnitQuaternion<f64>| {
        median(&all.iter().map(|own| own.angle_to(centre)).collect::<Vec<_>>())
    };
    let stride = all.len().div_ceil(25).max(1);
    let centres = all.iter().step_by(stride).filter_map(|centre| Some((apart(centre)?, *centre)));
    let (near, centre) = centres.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mean = mean(all.iter().filter(|own| own.angle_to(&centre) <= AS_GOOD * near), &centre);
    Some(Turned { form, flange_from_own: mean, median_rad: apart(&mean)?, as_good: Vec::new() })
}

/// The mean of orientations near `centre`.
fn mean<'a>(
    all: impl Iterator<Item = &'a UnitQuaternion<f64>>,
    centre: &UnitQuaternion<f64>,
) -> UnitQuaternion<f64> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for own in all {
        sum += (centre.inverse() * own).scaled_axis();
        count += 1.0;
    }
    if count == 0.0 { *centre } else { centre * UnitQuaternion::from_scaled_axis(sum / count) }
}
