//! Predictions that are in another unit or frame than the measurements: recognised by what they fit to after a change.
//!
//! The rule: as stated they are more than ten times as far from the measured positions as base + target is, and after a
//! change of unit, frame or both they are within three times. A model that is bad without such a reason is judged as it is.

use std::fmt;

use nalgebra::Point3;

use super::Compared;
use crate::figures::Figures;
use crate::geometry::align;

/// Further off than this many times base + target's rms, predictions are looked at.
const WORSE: f64 = 10.0;
/// Predictions that a change brings within this many times base + target's rms are as good as any.
const AS_GOOD: f64 = 3.0;
/// Fewer stations fit any frame.
const LEAST_STATIONS: usize = 6;
/// Other units, with millimetres in each.
const UNITS: [(&str, f64); 4] =
    [("metres", 1000.0), ("micrometres", 0.001), ("centimetres", 10.0), ("inches", 25.4)];

/// Predictions in another unit or frame than the measurements: their errors as stated and after the change.
#[derive(Debug, Clone, PartialEq)]
pub struct Unlike {
    /// Root mean square error as stated, mm.
    as_stated_mm: f64,
    /// The unit that they look like; `None` for millimetres.
    unit: Option<&'static str>,
    /// The motion that they fit after: its length at the middle of the stations, mm, and its angle, rad; `None` of no motion.
    motion: Option<(f64, f64)>,
    /// Root mean square error after the change, mm.
    changed_mm: f64,
}

impl fmt::Display for Unlike {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "they are {:.3} mm (rms) from the measured positions; ", self.as_stated_mm)?;
        if let Some(unit) = self.unit {
            write!(f, "these look like {unit}, where millimetres are needed")?;
        }
        match (self.unit, self.motion) {
            (Some(_), Some(_)) => write!(f, ", and like another frame: ")?,
            (None, Some(_)) => write!(f, "these look like another frame: ")?,
            _ => write!(f, ": ")?,
        }
        match self.motion {
            Some((shift_mm, turn)) => write!(
                f,
                "they fit to {:.3} mm after a shift of {shift_mm:.3} mm and a turn of {:.3}°; state them in the frame that training \
                 positions are in",
                self.changed_mm,
                turn.to_degrees()
            ),
            None => write!(f, "so they fit to {:.3} mm", self.changed_mm),
        }
    }
}

/// The unit or frame that predictions look like, where base + target leaves `reference_mm` (rms); `None` where neither explains their
/// errors. `has_own_frame` says that the frame is aligned anyway.
pub fn unlike(compared: &[Compared], reference_mm: f64, has_own_frame: bool) -> Option<Unlike> {
    let as_stated_mm = rms(compared, |own| own.predicted)?;
    let is_off = |mm: f64| mm > WORSE * reference_mm;
    let aligned_mm = moved(compared, 1.0).map_or(f64::INFINITY, |own| own.rms_mm);
    let stated_mm = if has_own_frame { aligned_mm } else { as_stated_mm };
    if compared.len() < LEAST_STATIONS || !is_off(stated_mm) {
        return None;
    }
    let units = UNITS.iter().map(|(unit, mm)| (Some(*unit), *mm));
    let units: Vec<(Option<&str>, f64)> = std::iter::once((None, 1.0)).chain(units).collect();
    let change = |unit, motion, changed_mm: f64| {
        (changed_mm <= AS_GOOD * reference_mm).then_some(Unlike {
            as_stated_mm,
            unit,
            motion,
            changed_mm,
        })
    };
    // Another unit alone is looked for before another frame.
    let plain =
        |&(unit, mm): &(_, f64)| change(unit, None, rms(compared, |own| own.predicted * mm)?);
    let in_frame = |&(unit, mm): &(_, f64)| {
        let moved = moved(compared, mm)?;
        change(unit, Some((moved.shift_mm, moved.turn)), moved.rms_mm)
    };
    units.iter().find_map(plain).or_else(|| units.iter().find_map(in_frame))
}

/// A motion onto the measured positions.
struct Moved {
    shift_mm: f64,
    turn: f64,
    rms_mm: f64,
}

/// Predictions times `mm`, moved onto the measured positions as one rigid body.
fn moved(compared: &[Compared], mm: f64) -> Option<Moved> {
    let measured: Vec<Point3<f64>> = compared.iter().map(|own| own.measured).collect();
    let predicted: Vec<Point3<f64>> = compared.iter().map(|own| own.predicted * mm).collect();
    let motion = align(&measured, &predicted, &vec![1.0; compared.len()])?;
    let middle = predicted
        .iter()
        .fold(Point3::origin(), |sum, own| sum + own.coords / predicted.len() as f64);
    Some(Moved {
        shift_mm: (motion * middle - middle).norm(),
        turn: motion.rotation.angle(),
        rms_mm: rms(compared, |own| motion * (own.predicted * mm))?,
    })
}

fn rms(compared: &[Compared], predicted: impl Fn(&Compared) -> Point3<f64>) -> Option<f64> {
    let away = compared.iter().map(|own| (own.measured - predicted(own)).norm());
    Some(Figures::of(&away.collect::<Vec<_>>())?.rms)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;

    fn compared(predicted: impl Fn(Point3<f64>) -> Point3<f64>) -> Vec<Compared> {
        let of = |place: i32| {
            let [x, y, z] = [place % 3, place / 3 % 3, place / 9].map(|own| 100.0 * f64::from(own));
            let measured = Point3::new(800.0 + x, y - 300.0, 400.0 + z);
            let error = Vector3::new(0.3, -0.2, 0.1) * f64::from(place % 4 - 1);
            Compared { measured, predicted: predicted(measured + error), covariance: None }
        };
        (0..27).map(of).collect()
    }

    fn words(predicted: impl Fn(Point3<f64>) -> Point3<f64>) -> Option<String> {
        unlike(&compared(predicted), 0.5, false).map(|own| own.to_string())
    }

    #[test]
    fn another_unit_or_frame_is_named_and_a_bad_model_is_not() {
        assert_eq!(words(|own| own), None);
        let metres = words(|own| own / 1000.0).unwrap();
        assert!(metres.contains("these look like metres, where millimetres"), "{metres}");
        // Without errors of their own the motion is found to the last digit shown.
        let exact = |own: Compared| Compared {
            predicted: own.measured + Vector3::new(0.0, 30.0, 40.0),
            ..own
        };
        let exact: Vec<Compared> = compared(|own| own).into_iter().map(exact).collect();
        let shifted = unlike(&exact, 0.5, false).unwrap().to_string();
        assert!(shifted.contains("another frame"), "{shifted}");
        assert!(shifted.contains("a shift of 50.000 mm and a turn of 0.000°"), "{shifted}");
        let frame = Isometry3::new(Vector3::new(1000.0, 0.0, 0.0), Vector3::z() * 0.5);
        let both = words(|own| frame * own / 1000.0).unwrap();
        assert!(both.contains("metres") && both.contains("another frame"), "{both}");
        // Bent out of shape: no motion and no unit explains it.
        assert_eq!(words(|own| Point3::new(own.y, own.x * 2.0, own.z * own.z / 100.0)), None);
    }

    #[test]
    fn a_frame_that_is_aligned_anyway_is_no_fault() {
        let moved = compared(|own| own + Vector3::x() * 500.0);
        assert_eq!(unlike(&moved, 0.5, true), None);
        let metres = unlike(&compared(|own| own / 1000.0), 0.5, true).unwrap();
        assert!(metres.to_string().contains("metres"));
    }
}
