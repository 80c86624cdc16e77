//! The errors that a run's headline is of: before and after a correction, at the same stations and in one frame.

use nalgebra::{Point3, Vector3};

use crate::figures::Figures;

/// Errors before and after a correction, in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
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
    /// Number of the station.
    pub station: usize,
    /// The place that was commanded or predicted.
    pub at: Point3<f64>,
    /// The error before.
    pub before: Vector3<f64>,
    /// The error that the correction leaves.
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

    /// Number of different stations.
    pub fn count(&self) -> usize {
        let mut stations: Vec<usize> = self.errors.iter().map(|pair| pair.station).collect();
        stations.sort_unstable();
        stations.dedup();
        stations.len()
    }

    /// The figures in a line; `None` without any station.
    pub fn words(&self) -> Option<String> {
        let [before, after] = self.figures()?;
        Some(format!(
            "mean {:.3} → {:.3} mm, largest {:.3} → {:.3} mm ({} → {}, {}, {} stations of {})",
            before.mean,
            after.mean,
            before.max,
            after.max,
            self.before,
            self.after,
            self.frame,
            self.count(),
            self.stations
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
                "mean 1.667 → 0.200 mm, largest 2.000 → 0.300 mm (raw command → compensation table, in the surveyed base, \
                 2 stations of held-out blocks of mon)"
            )
        );
        let none = Compared {
            errors: Vec::new(),
            ..compared
        };
        assert_eq!(none.words(), None);
    }
}
