//! The coverage of a table: the share of the measured stations, and of the box.

use serde::{Deserialize, Serialize};

use super::lattice::Lattice;
use super::node::GridStation;
use super::settings::GridPlan;

/// A table that covers a smaller share of the stations like it is chosen only where none covers more.
pub(super) const ENOUGH: f64 = 0.95;

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Covered {
    pub stations: usize,
    /// Number of stations like it: of its arm configuration, and turned from its orientation by at most the tolerance.
    pub like: usize,
    /// Number of all measured stations.
    pub measured: usize,
    /// Share of the box's volume in cells that can serve, 0 to 1.
    pub of_box: f64,
}

impl Covered {
    /// The coverage of the nodes of `lattice`; `serves` gives whether a cell with these vertices has values.
    pub(super) fn of(
        lattice: &Lattice,
        plan: &GridPlan,
        stations: &[GridStation],
        serves: impl Fn(&[usize; 8]) -> bool,
    ) -> Self {
        let like = || stations.iter().filter(|station| plan.is_like(station));
        let answers = |station: &&GridStation| {
            let cell = lattice.locate(&station.position);
            cell.is_some_and(|cell| serves(&cell.vertices))
        };
        let serving = lattice.cells().filter(|index| serves(&lattice.vertices(*index)));
        let volume: f64 = serving.map(|index| lattice.volume_in(&plan.bounds, index)).sum();
        let whole: f64 = (0..3).map(|axis| plan.bounds.size(axis)).product();
        Self {
            stations: like().filter(answers).count(),
            like: like().count(),
            measured: stations.len(),
            of_box: (volume / whole).min(1.0),
        }
    }

    /// Share of all measured stations; 0 without any.
    pub fn of_stations(&self) -> f64 {
        self.stations as f64 / self.measured.max(1) as f64
    }

    /// Share of the stations like the table; `None` where there is none.
    pub fn of_like(&self) -> Option<f64> {
        (self.like > 0).then(|| self.stations as f64 / self.like as f64)
    }

    /// Whether it covers enough of the stations like it to be chosen before others.
    pub(super) fn is_enough(&self) -> bool {
        self.of_like().is_none_or(|share| share >= ENOUGH)
    }

    /// The coverage as text: of all measured stations, as a table that answers for all of its own orientation can answer for few.
    pub fn words(&self) -> String {
        let like = if self.like == self.measured {
            String::new()
        } else {
            format!(" ({} are of its orientation and configuration)", self.like)
        };
        format!(
            "it answers for {} of {} measured stations{like} and {:.1} % of the box",
            self.stations,
            self.measured,
            100.0 * self.of_box
        )
    }
}
