//! `benchmark`: figures of models and programs on splits of open data, with intervals.

use super::words::Unit;
use crate::benchmark::FigureName;
use crate::benchmark::suite::SplitKind;
use crate::io::table::{row, words};
use crate::report::Angles;

row! {
    /// A figure of one model on one split.
    pub struct BenchmarkRow of "benchmark" {
        /// The arm, by the suite.
        robot: String,
        /// The sessions that test.
        session: String,
        /// The name that follows from data, split, settings and version.
        run: String,
        /// The suite.
        suite: String,
        /// The split.
        split: String,
        /// How it divides stations.
        split_kind: SplitKind,
        /// Number of stations that trained.
        train_stations: usize,
        /// Number of stations that judge.
        test_stations: usize,
        /// Listed stations without a reading.
        left_out: usize,
        /// Blocks of the work space among the stations that judge.
        blocks: usize,
        /// The base that predictions are stated in.
        base: TableBase,
        /// Whether test stations stand among training stations.
        leaks: bool,
        /// Mean share of training stations among the neighbours of a test station.
        neighbour_share: f64,
        /// Median distance of a test station from training, rad.
        nearest_rad: f64,
        /// Test stations at a pose that trained.
        same_poses: usize,
        /// The split that the figures stand beside.
        beside: Option<String>,
        /// Who predicts.
        entrant: Entrant,
        /// The model or program.
        model: String,
        /// The angles that it predicts from.
        angles: Option<Angles>,
        /// The figure.
        figure: FigureName,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: Unit,
        /// Lower end of its interval.
        low: Option<f64>,
        /// Upper end of its interval.
        high: Option<f64>,
        /// Confidence of the interval.
        confidence: Option<f64>,
        /// Where it was published.
        source: Option<String>,
    }
}

/// Who predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Entrant {
    /// A model of this program.
    Posegrid,
    /// Another program, by its file of predictions.
    Program,
    /// Nobody here: a figure that its authors published.
    Published,
}

/// The base that predictions are stated in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableBase {
    /// That of the training.
    Training,
    /// Aligned with stations that judge nothing.
    Stations,
    /// Aligned with the stations that judge.
    Test,
}

words! {
    SplitKind { Rows: "rows", Region: "region", Session: "session" }
    FigureName {
        Mean: "mean",
        Rms: "rms",
        P95: "p95",
        Max: "max",
        Coverage: "coverage",
        Improvement: "improvement",
        Difference: "difference",
    }
    Entrant { Posegrid: "posegrid", Program: "program", Published: "published" }
    TableBase { Training: "training", Stations: "stations", Test: "test" }
}
