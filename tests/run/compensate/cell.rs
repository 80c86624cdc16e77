//! A table as a run publishes it, in a folder with files of targets.

use std::fs;
use std::path::{Path, PathBuf};

use posegrid::cli::compensate::program::ProgramArgs;
use posegrid::cli::compensate::{
    self, CompensateArgs, CompensateCommandError, Compensated, UsedWithArgs,
};
use posegrid::compensation::Exception;
use posegrid::files::schema;
use posegrid::files::table::{self, Columns, Table};
use posegrid::manifest::RunKey;

pub const COUNTS: [usize; 3] = [4, 3, 3];
const NODES: usize = 36;
pub const STEP_MM: f64 = 100.0;
/// The node at (600, −100, 400) mm has no value.
pub const REFUSED: usize = 0;

/// What a test changes of the sample table.
#[derive(Clone, Copy)]
pub struct Sample {
    /// The frame of commands is turned by this about z against the lattice.
    pub turn_rad: f64,
    pub table_id: fn(usize) -> &'static str,
    pub place: fn(usize) -> usize,
    pub power: Option<f64>,
    pub shift_mm: fn(usize) -> f64,
    pub variance_mm2: f64,
    pub verdict: &'static str,
    /// Of the run's stations before correction.
    pub largest_error_mm: Option<f64>,
    /// Whether no tool of the controller is stated.
    pub tool_is_target: Option<bool>,
    /// The error at a place of the lattice, mm.
    pub error: fn([f64; 3]) -> [f64; 3],
    /// Joint angles at every node.
    pub joints: [f64; 6],
}

pub const SAMPLE: Sample = Sample {
    turn_rad: 0.0,
    table_id: |_| "t-1",
    place: |node| node,
    power: None,
    shift_mm: |_| 0.0,
    variance_mm2: 0.0004,
    verdict: "met",
    largest_error_mm: Some(2.0),
    tool_is_target: None,
    error: stretch,
    joints: [0.1; 6],
};

fn index(node: usize) -> [usize; 3] {
    let [nx, ny, _] = COUNTS;
    [node % nx, node / nx % ny, node / (nx * ny)]
}

fn turned(sample: &Sample, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = sample.turn_rad.sin_cos();
    [cos * x - sin * y, sin * x + cos * y, z]
}

/// 1 mm along the lattice's x, and 2 µm more per mm of it; −0.5 mm along z.
fn stretch([x, _, _]: [f64; 3]) -> [f64; 3] {
    [1.0 + 0.002 * (x - 600.0), 0.0, -0.5]
}

fn sample_table(sample: &Sample) -> Table {
    let nodes = 0..NODES;
    let on_lattice = |node: usize| {
        let [i, j, k] = index(node).map(|index| index as f64 * STEP_MM);
        [600.0 + i + (sample.shift_mm)(node), -100.0 + j, 400.0 + k]
    };
    let known = |node: usize| (node != REFUSED).then_some(node);
    let variance = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0].map(|part| part * sample.variance_mm2);
    let indices = |axis: usize| nodes.clone().map(move |node| index(node)[axis]);
    let half = sample.turn_rad / 2.0;
    let columns = Columns::new(schema::find("compensation").unwrap(), nodes.len())
        .key(&RunKey::new("ur10", "monday", "00ff"))
        .column("node", nodes.clone().map(sample.place))
        .same("orientation", 0_u64)
        .column("index_x", indices(0))
        .column("index_y", indices(1))
        .column("index_z", indices(2))
        .column("table_id", nodes.clone().map(sample.table_id))
        .group(["x_mm", "y_mm", "z_mm"], nodes.clone().map(|node| turned(sample, on_lattice(node))))
        .group(["qx", "qy", "qz", "qw"], nodes.clone().map(|_| [0.0, 0.0, half.sin(), half.cos()]))
        .same("configuration", Some("shoulder+ elbow- wrist+"))
        .same("joint_names", &["a1", "a2", "a3", "a4", "a5", "a6"][..])
        .column("joints_rad", nodes.clone().map(|node| known(node).map(|_| sample.joints.to_vec())))
        .group(
            ["error_x_mm", "error_y_mm", "error_z_mm"],
            nodes.clone().map(|node| {
                known(node).map(|node| turned(sample, (sample.error)(on_lattice(node))))
            }),
        )
        .group(
            [
                "error_cov_xx_mm2",
                "error_cov_xy_mm2",
                "error_cov_xz_mm2",
                "error_cov_yy_mm2",
                "error_cov_yz_mm2",
                "error_cov_zz_mm2",
            ],
            nodes.clone().map(|node| known(node).map(|_| variance)),
        )
        .column("error_sd_mm", nodes.clone().map(|node| known(node).map(|_| 0.02 * 3.0_f64.sqrt())))
        .column("refused", nodes.clone().map(|node| (node == REFUSED).then_some("singularity")));
    support(terms(columns, sample), nodes.len()).rest_absent().finish().unwrap()
}

/// What a table says of itself, the same in every row.
fn terms(columns: Columns, sample: &Sample) -> Columns {
    let half = sample.turn_rad / 2.0;
    let interpolation = if sample.power.is_some() { "idw" } else { "trilinear" };
    columns
        .group(
            ["command_from_base_x_mm", "command_from_base_y_mm", "command_from_base_z_mm"],
            vec![[0.0; 3]; NODES],
        )
        .group(
            [
                "command_from_base_qx",
                "command_from_base_qy",
                "command_from_base_qz",
                "command_from_base_qw",
            ],
            vec![[0.0, 0.0, half.sin(), half.cos()]; NODES],
        )
        .same("step_x_mm", STEP_MM)
        .same("step_y_mm", STEP_MM)
        .same("step_z_mm", STEP_MM)
        .same("source", "model")
        .same("interpolation", interpolation)
        .same("idw_power", sample.power)
        .same("angles", "reported")
        .same("orientation_tolerance_deg", 5.0)
        .same("verdict", sample.verdict)
        .same("largest_error_mm", sample.largest_error_mm)
        .same("tool_is_target", sample.tool_is_target)
        .same("joint_lower_rad", vec![-0.5; 6])
        .same("joint_upper_rad", vec![0.25; 6])
        .same("flange_from_target_x_mm", 25.0)
        .same("flange_from_target_y_mm", -40.0)
        .same("flange_from_target_z_mm", 100.0)
        .same("error_frame", "surveyed")
        .same("error_frame_base_x_mm", 4000.0)
        .same("error_frame_base_y_mm", 0.0)
        .same("error_frame_base_z_mm", -600.0)
        .same("error_frame_base_qx", 0.0)
        .same("error_frame_base_qy", 0.0)
        .same("error_frame_base_qz", 0.0)
        .same("error_frame_base_qw", 1.0)
        .same("error_frame_sd_mm", Some(0.02))
        .same("error_frame_sd_deg", Some(0.001))
        .same("tool", Some("drill"))
        .same("payload_kg", Some(12.5))
        .same("temperature_min_c", Some(19.25))
        .same("temperature_max_c", Some(21.5))
}

/// Columns that only people read.
fn support(columns: Columns, nodes: usize) -> Columns {
    let known = |node: usize| (node != REFUSED).then_some(node);
    columns
        .same("nearest_station_mm", Some(12.0))
        .column("nearest_station_rad", (0..nodes).map(|node| known(node).map(|_| 0.05)))
        .same("stations_near", 3_u64)
        .column("within_joint_ranges", (0..nodes).map(|node| known(node).map(|_| true)))
}

fn save(folder: &Path, sample: &Sample) -> PathBuf {
    let path = folder.join("table.parquet");
    fs::write(&path, table::write(&sample_table(sample), Vec::new()).unwrap()).unwrap();
    path
}

pub struct Cell {
    pub folder: tempfile::TempDir,
    pub table: PathBuf,
}

impl Cell {
    pub fn new(sample: &Sample) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let table = save(folder.path(), sample);
        Self { folder, table }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn compensate(
        &self,
        targets: &str,
        out: Option<&str>,
    ) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        self.compensate_with(targets, out, &[], &UsedWithArgs::default())
    }

    pub fn compensate_with(
        &self,
        targets: &str,
        out: Option<&str>,
        allow: &[Exception],
        used_with: &UsedWithArgs,
    ) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        Self::run(&CompensateArgs {
            table: self.table.clone(),
            targets: self.path(targets),
            out: out.map(|out| self.path(out)),
            allow: allow.to_vec(),
            no_record: false,
            no_covariance: false,
            lake: None,
            session: None,
            by: None,
            used_with: used_with.clone(),
            program: ProgramArgs::default(),
        })
    }

    /// With `--no-record`.
    pub fn without_record(
        &self,
        targets: &str,
        out: &str,
        used_with: &UsedWithArgs,
    ) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        Self::run(&CompensateArgs {
            table: self.table.clone(),
            targets: self.path(targets),
            out: Some(self.path(out)),
            allow: Vec::new(),
            no_record: true,
            no_covariance: false,
            lake: None,
            session: None,
            by: None,
            used_with: used_with.clone(),
            program: ProgramArgs::default(),
        })
    }

    fn run(args: &CompensateArgs) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        let mut stdout = Vec::new();
        let compensated = compensate::run(args, &mut stdout)?;
        Ok((compensated, String::from_utf8(stdout).unwrap()))
    }

    pub fn csv(&self, rows: &str) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        fs::write(self.path("targets.csv"), rows).unwrap();
        self.compensate("targets.csv", None)
    }
}

/// The cell of a column in the row of a target.
pub fn field(csv: &str, target: &str, column: &str) -> String {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let place = |reader: &mut csv::Reader<&[u8]>, name: &str| {
        reader.headers().unwrap().iter().position(|c| c == name).unwrap()
    };
    let (name, wanted) = (place(&mut reader, "target"), place(&mut reader, column));
    let row = reader.records().map(Result::unwrap).find(|row| &row[name] == target).unwrap();
    row[wanted].to_owned()
}
