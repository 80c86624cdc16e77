//! The errors that a run states before and after a correction: at the same stations, in one frame and at the same angles. They are made once
//! ([`Pairs`]) and shown everywhere: summary, page, `runs` and all that reads it.

use nalgebra::{Point3, Vector3};

use super::Subject;
use crate::figures::Figures;
use crate::grid::{WITHIN, WITHIN_MM};

/// The errors before and after of one run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pairs {
    /// Those that were measured of the table that drove the session; `None` where none did.
    pub measured: Option<Compared>,
    /// Those that the verdict's figure is of; `None` where no station judges.
    pub predicted: Option<Compared>,
    /// What the table leaves beside the identified arm; `None` where nothing shows both.
    pub table_and_arm: Option<TableAndArm>,
    /// In each of several sessions trained together, mm at its stations: the arm identified from all, judged by held-out blocks, and the arm
    /// identified without that session.
    pub of_sessions: Vec<(Subject, Compared)>,
}

/// Mean errors where the table answers, of the same held-out stations, in one frame and at commanded angles, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableAndArm {
    pub before_mm: f64,
    pub table_mm: f64,
    pub arm_mm: f64,
    pub stations: usize,
}

impl TableAndArm {
    /// The three figures in a sentence, and which to use where the table does not come near the arm.
    pub fn words(&self) -> String {
        let use_arm = if self.table_mm - self.arm_mm > (WITHIN * self.arm_mm).max(WITHIN_MM) {
            "; the table does not come near the arm: correct by the identified arm (calibrations) what states joint angles or a pose"
        } else {
            ""
        };
        format!(
            "where the table answers: mean {:.3} mm before, {:.3} mm by the table, {:.3} mm by the identified arm ({} held-out stations, \
             commanded angles){use_arm}",
            self.before_mm, self.table_mm, self.arm_mm, self.stations
        )
    }
}

impl Pairs {
    /// The errors that stand for the run: measured where there are any, else predicted.
    pub fn stated(&self) -> Option<&Compared> {
        self.measured.as_ref().or(self.predicted.as_ref())
    }
}

/// Errors before and after a correction, in one frame; of one station at least.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Whether the errors after were measured, in a session that the correction drove, and not predicted.
    pub is_measured: bool,
    /// The errors before, in words: `the raw command`.
    pub before: String,
    /// What corrects, in words: `compensation table`.
    pub after: String,
    /// The frame that both are in, in words: `in the surveyed base`.
    pub frame: String,
    /// The stations, in words: `held-out blocks of monday`.
    pub stations: String,
    /// The errors; a station that several decimated grids judge has one for each.
    pub errors: Vec<ErrorPair>,
}

/// The errors at one station, base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorPair {
    pub station: usize,
    pub at: Point3<f64>,
    pub before: Vector3<f64>,
    pub after: Vector3<f64>,
}

impl Compared {
    /// Figures of the error norms before and after, mm; `None` without any station.
    pub fn figures(&self) -> Option<[Figures; 2]> {
        let of = |error: fn(&ErrorPair) -> Vector3<f64>| {
            let norms: Vec<f64> = self.errors.iter().map(|pair| error(pair).norm()).collect();
            Figures::of(&norms)
        };
        Some([of(|pair| pair.before)?, of(|pair| pair.after)?])
    }

    pub fn count(&self) -> usize {
        let mut stations: Vec<usize> = self.errors.iter().map(|pair| pair.station).collect();
        stations.sort_unstable();
        stations.dedup();
        stations.len()
    }

    /// Whether what is left was measured or is predicted, in a word.
    const fn evidence(&self) -> &'static str {
        if self.is_measured { "measured" } else { "predicted" }
    }

    /// What both errors are errors of, in words.
    fn subject(&self) -> String {
        let Self { before, after, frame, stations, .. } = self;
        format!("{before} → {after}, {frame}, {} stations of {stations}", self.count())
    }

    /// The errors that both figures are of, in words, which distinguish figures of one session.
    pub fn of(&self) -> String {
        format!("{}: {}", self.evidence(), self.subject())
    }

    /// The figures in a line; `None` without any station.
    pub fn words(&self) -> Option<String> {
        let [before, after] = self.figures()?;
        Some(format!(
            "before → after, {}: mean {:.3} → {:.3} mm, largest {:.3} → {:.3} mm ({})",
            self.evidence(),
            before.mean,
            after.mean,
            before.max,
            after.max,
            self.subject()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_figures_are_of_the_same_stations() {
        let pair = |station: usize, before: f64, after: f64| ErrorPair {
            station,
            at: Point3::origin(),
            before: Vector3::x() * before,
            after: Vector3::y() * after,
        };
        let compared = Compared {
            is_measured: false,
            before: "raw command".to_owned(),
            after: "compensation table".to_owned(),
            frame: "in the surveyed base".to_owned(),
            stations: "held-out blocks of mon".to_owned(),
            errors: vec![pair(1, 1.0, 0.1), pair(2, 2.0, 0.3), pair(2, 2.0, 0.2)],
        };
        assert_eq!(compared.count(), 2);
        assert_eq!(
            compared.words().as_deref(),
            Some(
                "before → after, predicted: mean 1.667 → 0.200 mm, largest 2.000 → 0.300 mm (raw command → compensation table, \
                 in the surveyed base, 2 stations of held-out blocks of mon)"
            )
        );
        let none = Compared { errors: Vec::new(), ..compared };
        assert_eq!(none.words(), None);
    }
}
