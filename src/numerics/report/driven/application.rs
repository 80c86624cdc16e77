//! The way in which corrections were applied, found from their effect.
//!
//! A correction δ that a table gives is minus the error that the arm would have made: at a station with error r relative to
//! its command, δ = −r was applied as meant. So the session that a table drove shows it by itself, without the table:
//! 1. a motion of the base in the meantime is no misuse: small rigid motions are removed from errors and corrections;
//! 2. each way of applying a table predicts the corrections from the errors: −r as meant, +r with the wrong sign, −2r
//!    twice, −R r in a frame that is turned by R (Kabsch's closed form);
//! 3. the way with the smallest remainder is the result, if its remainder is about the one that the table states, or it
//!    explains most of the corrections; if none does, the corrections have nothing to do with this arm's errors.

use nalgebra::{Matrix3, Matrix6, Point3, Rotation3, Vector3, Vector6};

use super::DrivenStation;

/// The way in which the corrections of a table were applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Application {
    AsMeant(f64),
    /// Not at all: commands equal the targets.
    Not,
    /// With the wrong sign: added where they had to be subtracted.
    WrongSign(f64),
    Twice(f64),
    /// In a frame that is rotated relative to the table's.
    Turned {
        angle_deg: f64,
        explained: f64,
    },
    /// Unrelated to the errors of this arm in every way of applying them: the largest share that the errors explain.
    Unrelated(f64),
    TooFew {
        stations: usize,
    },
}

/// Fewest stations: with fewer, a rotation and a motion of the base alone could explain much.
const LEAST_STATIONS: usize = 12;
/// Corrections smaller than this share of the stated ones were not made.
const NOT_MADE: f64 = 0.2;
/// A way of applying a table is accepted if its remainder is at most this many times the one that the table states …
const OF_STATED: f64 = 2.0;
/// … or if it explains this share of the corrections: an arm that has changed since leaves more.
const EXPLAINS: f64 = 0.8;
/// Smallest rotation that counts, degrees, and only where its remainder is clearly less than that of the next way.
const TURN_DEG: f64 = 15.0;
/// A way whose remainder is less than this share of another's is clearly better. Where errors are as small as the remainder
/// that the table states, this alone distinguishes a misuse from use as meant.
const CLEARLY: f64 = 0.5;

pub fn application(stations: &[DrivenStation]) -> Application {
    if stations.len() < LEAST_STATIONS {
        return Application::TooFew { stations: stations.len() };
    }
    let made: Vec<Vector3<f64>> = stations.iter().map(|s| s.command - s.target).collect();
    let stated: Vec<Vector3<f64>> = stations.iter().map(|s| s.stated).collect();
    if rms(&made) < NOT_MADE * rms(&stated) {
        return Application::Not;
    }
    Ways::of(stations, &made).best()
}

/// Corrections and errors without the motion of the base, and the remainder that the table states.
struct Ways {
    positions: Vec<Point3<f64>>,
    made: Vec<Vector3<f64>>,
    errors: Vec<Vector3<f64>>,
    /// Sum of squares of the remainder that the table states, mm².
    stated: f64,
}

struct Way {
    application: Application,
    /// Sum of squares that it leaves of the corrections, mm².
    left: f64,
    /// The remainder divided by the one that the table states, counted as often as the errors.
    of_stated: f64,
}

impl Ways {
    fn of(stations: &[DrivenStation], made: &[Vector3<f64>]) -> Self {
        let positions: Vec<Point3<f64>> = stations.iter().map(|s| s.command).collect();
        let errors: Vec<Vector3<f64>> = stations.iter().map(|s| s.attained - s.command).collect();
        Self {
            made: settled(&positions, made),
            errors: settled(&positions, &errors),
            stated: stations.iter().map(|s| s.variance_mm2).sum(),
            positions,
        }
    }

    /// The way in which the error was counted `times` after the rotation `turn`.
    fn way(&self, times: f64, turn: &Rotation3<f64>, name: impl Fn(f64) -> Application) -> Way {
        let predicted = self.made.iter().zip(&self.errors);
        let left: Vec<_> = predicted.map(|(made, error)| made - turn * error * times).collect();
        let left = sum_of_squares(&settled(&self.positions, &left));
        Way {
            application: name(1.0 - left / sum_of_squares(&self.made)),
            left,
            of_stated: left / (self.stated * times * times),
        }
    }

    fn best(&self) -> Application {
        let straight = Rotation3::identity();
        let as_meant = self.way(-1.0, &straight, Application::AsMeant);
        let least = |one: Way, other: Way| if other.left < one.left { other } else { one };
        let wrong_sign = self.way(1.0, &straight, Application::WrongSign);
        let mut other = least(wrong_sign, self.way(-2.0, &straight, Application::Twice));
        let turn = turn(&self.errors, &self.made);
        let angle_deg = turn.angle().to_degrees();
        let turned =
            self.way(-1.0, &turn, |explained| Application::Turned { angle_deg, explained });
        let next = other.left.min(as_meant.left);
        if angle_deg >= TURN_DEG && turned.left < CLEARLY * next {
            other = turned;
        }
        if as_meant.of_stated <= OF_STATED && other.left >= CLEARLY * as_meant.left {
            return as_meant.application;
        }
        let best = least(as_meant, other);
        let explained = best.application.explained();
        let is_found = best.of_stated <= OF_STATED || explained >= EXPLAINS;
        if is_found { best.application } else { Application::Unrelated(explained) }
    }
}

impl Application {
    /// The share of the corrections that the errors explain.
    pub fn explained(&self) -> f64 {
        match *self {
            Self::AsMeant(share)
            | Self::WrongSign(share)
            | Self::Twice(share)
            | Self::Unrelated(share)
            | Self::Turned { explained: share, .. } => share,
            Self::Not | Self::TooFew { .. } => 0.0,
        }
    }

    /// The result as text for a person, with advice.
    pub fn words(&self) -> String {
        let percent = 100.0 * self.explained();
        match self {
            Self::AsMeant(_) => "corrections were applied as meant".to_owned(),
            Self::Not => {
                "corrections were NOT applied: commands are the targets as they were; load the corrected program"
                    .to_owned()
            }
            Self::WrongSign(_) => format!(
                "corrections were applied with the WRONG SIGN (so applied, the errors explain {percent:.0} % of them): subtract \
                 the error, do not add it"
            ),
            Self::Twice(_) => format!(
                "corrections were applied TWICE (so the errors explain {percent:.0} % of them): correct the targets themselves, \
                 not corrected ones"
            ),
            Self::Turned { angle_deg, .. } => format!(
                "corrections were applied in ANOTHER FRAME, turned by {angle_deg:.0}° relative to the table's (so the errors explain \
                 {percent:.0} % of them): give targets in the frame of commands"
            ),
            Self::Unrelated(_) => format!(
                "corrections have NOTHING TO DO with this arm's errors (however applied, they explain at most {percent:.0} %): a \
                 table of another arm, looked up in another frame, or the arm has changed; measure it again"
            ),
            Self::TooFew { stations } => format!(
                "{stations} stations are too few to find how corrections were applied; {LEAST_STATIONS} are enough"
            ),
        }
    }
}

/// The rotation that brings `−errors` closest to `made`.
fn turn(errors: &[Vector3<f64>], made: &[Vector3<f64>]) -> Rotation3<f64> {
    let pairs = errors.iter().zip(made);
    let cross = pairs.fold(Matrix3::zeros(), |sum, (error, made)| sum - made * error.transpose());
    let svd = cross.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Rotation3::identity() };
    let mended = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    Rotation3::from_matrix_unchecked(u * mended * v_t)
}

/// Vectors at positions without the small rigid motion `t + ω × (p − p̄)` that fits them best.
fn settled(positions: &[Point3<f64>], vectors: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let n = positions.len() as f64;
    let middle = positions.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords) / n;
    // Radians times this are mm about as large as the translation, so that the six numbers have similar size.
    let size =
        (positions.iter().map(|p| (p.coords - middle).norm_squared()).sum::<f64>() / n).sqrt();
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    let rows = |p: &Point3<f64>| {
        let mut rows = nalgebra::Matrix3x6::identity();
        let lever = (p.coords - middle) / size.max(1.0);
        rows.fixed_view_mut::<3, 3>(0, 3).copy_from(&-lever.cross_matrix());
        rows
    };
    for (p, vector) in positions.iter().zip(vectors) {
        let rows = rows(p);
        normal += rows.tr_mul(&rows);
        right += rows.tr_mul(vector);
    }
    // Stations on a line leave the rotation about it undetermined; the smallest motion is used then.
    let motion = normal.svd(true, true).solve(&right, 1e-9 * n);
    let motion = motion.expect("both sides of the decomposition were asked for");
    positions.iter().zip(vectors).map(|(p, vector)| vector - rows(p) * motion).collect()
}

fn sum_of_squares(vectors: &[Vector3<f64>]) -> f64 {
    vectors.iter().map(Vector3::norm_squared).sum()
}

fn rms(vectors: &[Vector3<f64>]) -> f64 {
    (sum_of_squares(vectors) / vectors.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    /// A smooth error field of about 0.3 mm; another `phase` gives another arm.
    fn error(p: &Point3<f64>, phase: f64) -> Vector3<f64> {
        let [x, y, z] = [p.x, p.y, p.z].map(|v| v / 200.0 + phase);
        Vector3::new((x + y).sin(), (1.3 * y - z + phase).cos(), (x - 0.7 * z * y).sin()) * 0.3
    }

    /// 125 stations in a box of 800 mm, with corrections that `apply` makes from the error field.
    fn stations(apply: impl Fn(Vector3<f64>) -> Vector3<f64>, phase: f64) -> Vec<DrivenStation> {
        let place = |i: usize| {
            let [x, y, z] = [i % 5, i / 5 % 5, i / 25].map(|k| 200.0 * k as f64);
            Point3::new(1200.0 + x, y - 400.0, 500.0 + z)
        };
        let station = |i: usize| {
            let target = place(i);
            let command = target + apply(error(&target, phase));
            // The base has moved by 0.5 mm and 0.2 mrad.
            let moved = Vector3::new(0.5, -0.1, 0.2)
                + Vector3::new(1e-4, 1e-4, -1e-4).cross(&target.coords);
            DrivenStation {
                station: i,
                pose: i,
                target,
                command,
                attained: command + error(&command, 0.0) + moved,
                stated: -error(&target, phase),
                variance_mm2: 3e-4,
                turn: None,
            }
        };
        (0..125).map(station).collect()
    }

    #[test]
    fn each_way_of_applying_a_table_is_named() {
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        let found =
            |apply: &dyn Fn(Vector3<f64>) -> Vector3<f64>| application(&stations(apply, 0.0));
        assert!(matches!(found(&|e| -e), Application::AsMeant(share) if share > 0.99));
        assert!(matches!(found(&|e| e), Application::WrongSign(share) if share > 0.99));
        assert!(matches!(found(&|e| -2.0 * e), Application::Twice(share) if share > 0.99));
        assert_eq!(found(&|_| Vector3::zeros()), Application::Not);
        assert!(
            matches!(found(&|e| -(turned * e)), Application::Turned { angle_deg, .. } if (angle_deg - 90.0).abs() < 5.0)
        );
        let of_another_arm = application(&stations(|e| -e, 2.0));
        assert!(
            matches!(of_another_arm, Application::Unrelated(share) if share < 0.5),
            "{of_another_arm:?}"
        );
    }

    #[test]
    fn what_is_left_within_what_was_stated_is_as_meant_however_little_the_errors_explain() {
        // Corrections of a hundredth of the remaining error, which the table states.
        let mut all = stations(|e| -e, 0.0);
        for (i, station) in all.iter_mut().enumerate() {
            let noise = Vector3::new(1.0, -1.0, 0.5) * if i % 2 == 0 { 0.3 } else { -0.3 };
            station.command = station.target + Vector3::new(0.01, 0.0, 0.0) * (i % 3) as f64;
            station.stated = station.command - station.target;
            station.attained = station.target + noise;
            station.variance_mm2 = 0.3;
        }
        let found = application(&all);
        assert!(matches!(found, Application::AsMeant(_) | Application::TooFew { .. }));
    }

    #[test]
    fn few_stations_tell_nothing() {
        let few = &stations(|e| e, 0.0)[..11];
        assert_eq!(application(few), Application::TooFew { stations: 11 });
    }

    #[test]
    fn a_motion_of_the_base_is_taken_out_whole() {
        let positions: Vec<Point3<f64>> = stations(|e| e, 0.0).iter().map(|s| s.target).collect();
        let moved = |p: &Point3<f64>| {
            Vector3::new(1.0, 2.0, 3.0) + Vector3::new(1e-3, -2e-3, 3e-3).cross(&p.coords)
        };
        let vectors: Vec<_> = positions.iter().map(moved).collect();
        assert!(rms(&settled(&positions, &vectors)) < 1e-9);
    }
}
