//! The compensation table: errors at the nodes of a lattice → the error at a command inside it.
//!
//! Between nodes `ê = Σ w_i e_i` with the weights of the interpolation that the table was judged with. The covariance given
//! is `Σ w_i C_i`: node errors come from one model and are correlated; the table does not state how much. As the weights are
//! positive and sum to one, this is an upper bound of the covariance of `ê` for any correlation (Jensen).

use nalgebra::{DMatrix, Matrix3, Point3, UnitQuaternion, Vector3};
use thiserror::Error;

use super::{Reason, Target, Validity};
use crate::fit::model::{Open, Spread};
use crate::fit::{At, FrameUncertainty, Frames, Gap, PoseModel, Prediction, SourceId};
use crate::geometry::{Base, Command, Position, Transform};
use crate::grid::lattice::InCell;
use crate::grid::node::on_one_branch;
use crate::grid::{Interpolation, Lattice, Refusal};

/// The properties of a table in addition to its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// The table's identifier, carried by targets corrected with it.
    pub table_id: String,
    /// The tool's orientation at every node, in the frame of commands.
    pub orientation: UnitQuaternion<f64>,
    /// The largest turn of a target's orientation from the table's, rad.
    pub orientation_tolerance_rad: f64,
    /// The arm configuration at every node; `None` for arms without six axes.
    pub configuration: Option<String>,
    pub interpolation: Interpolation,
    /// The power of inverse distance weighting (IDW); trilinear interpolation does not use it.
    pub idw_power: f64,
    /// Second moment of what interpolation adds to the nodes' errors inside a cell, frame of commands, mm²; zero where not known.
    pub interpolation_mm2: Matrix3<f64>,
    pub validity: Validity,
    /// The uncertainty of the frame that errors are stated in, which is in no node's covariance.
    pub frame: FrameUncertainty,
    /// Radians that one unit of each joint's variable counts as; empty where all are angles.
    pub counted: Vec<f64>,
}

/// The values of a node that has a prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Joint angles at the node, rad; mm of a joint that slides.
    pub joints: Vec<f64>,
    /// Attained minus commanded position in the frame of commands, mm.
    pub error: Vector3<f64>,
    /// Covariance of the error, mm².
    pub covariance: Matrix3<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct CompensationTable {
    terms: Terms,
    command_from_base: Transform<Command, Base>,
    lattice: Lattice,
    nodes: Vec<Result<Known, Refusal>>,
}

/// The command of a target inside the box may be beyond the rim by this share of the pitch. Over a whole pitch the error
/// changes by no more than a cell can follow, so its change over this share is negligible.
const BEYOND_RIM: f64 = 0.1;

/// Nodes that do not make a table with a lattice.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Misfit {
    #[error("{found} nodes do not fill a lattice of {x} × {y} × {z} nodes", x = counts[0], y = counts[1], z = counts[2])]
    NodeCount {
        found: usize,
        /// Nodes of the lattice along each axis.
        counts: [usize; 3],
    },
    #[error("node {node} has {found} joint angles, the nodes before it have {expected}")]
    JointCount { node: usize, found: usize, expected: usize },
}

/// The error of the arm at a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Attained minus commanded position in the frame of commands, mm.
    pub error: Vector3<f64>,
    /// An upper bound of its covariance from the nodes' covariances and, off the nodes, the interpolation error, mm².
    pub covariance: Matrix3<f64>,
}

impl Terms {
    /// Refuses a target that the table is not valid for.
    pub(super) fn admit(&self, target: &Target) -> Result<(), Reason> {
        target.is_reached_in(self.configuration.clone())?;
        self.validity.admit(target)?;
        self.serves(target.orientation.as_ref()).map_err(Reason::Target)
    }

    /// Refuses a tool orientation too far from the table's; `None` is accepted.
    fn serves(&self, orientation: Option<&UnitQuaternion<f64>>) -> Result<(), Gap> {
        let angle = orientation.map_or(0.0, |turned| self.orientation.angle_to(turned));
        if angle > self.orientation_tolerance_rad {
            return Err(Gap::Orientation {
                angle_deg: angle.to_degrees(),
                limit_deg: self.orientation_tolerance_rad.to_degrees(),
            });
        }
        Ok(())
    }
}

impl CompensationTable {
    /// The table of `nodes` in the order of the lattice, which lies in the base frame.
    pub fn new(
        terms: Terms,
        command_from_base: Transform<Command, Base>,
        lattice: Lattice,
        nodes: Vec<Result<Known, Refusal>>,
    ) -> Result<Self, Misfit> {
        if nodes.len() != lattice.node_count() {
            return Err(Misfit::NodeCount { found: nodes.len(), counts: lattice.counts });
        }
        let joint_counts = nodes
            .iter()
            .enumerate()
            .filter_map(|(node, known)| Some((node, known.as_ref().ok()?.joints.len())));
        let expected = joint_counts.clone().next().map_or(0, |(_, count)| count);
        if let Some((node, found)) = joint_counts.clone().find(|&(_, count)| count != expected) {
            return Err(Misfit::JointCount { node, found, expected });
        }
        Ok(Self { terms, command_from_base, lattice, nodes })
    }

    pub const fn terms(&self) -> &Terms {
        &self.terms
    }

    /// The nodes in the lattice's order: their values, or the reasons why they have none.
    pub fn nodes(&self) -> &[Result<Known, Refusal>] {
        &self.nodes
    }

    /// The lattice of the nodes, in the base frame.
    pub const fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The position of the node `number`, mm.
    pub fn position(&self, number: usize) -> Position<Command> {
        self.command_from_base * Position::claim(self.lattice.position(number))
    }

    /// The error of the arm at a command, or the reason why the table has none.
    pub fn error_at(&self, command: &Position<Command>) -> Result<Estimate, Gap> {
        let place = *(self.command_from_base.inverse() * *command).point();
        let cell = self.lattice.locate(&place).ok_or_else(|| self.outside(&place))?;
        let vertices = self.vertices(&cell)?;
        if !on_one_branch(&vertices.map(|known| known.joints.as_slice()), &self.terms.counted) {
            return Err(Gap::Branches);
        }
        let power = self.terms.idw_power;
        let weights = self.terms.interpolation.weights(&cell.fraction, &self.lattice.step, power);
        let weighted = || weights.iter().zip(vertices);
        let nodes: Matrix3<f64> = weighted().map(|(&w, known)| known.covariance * w).sum();
        let between = if cell.is_node() { 0.0 } else { 1.0 };
        Ok(Estimate {
            error: weighted().map(|(&w, known)| known.error * w).sum(),
            covariance: nodes + self.terms.interpolation_mm2 * between,
        })
    }

    /// Covariance that the surveyed frame leaves of a tool at `place`, in the frame of commands, mm².
    pub(super) fn frame_covariance(&self, place: &Position<Command>) -> Matrix3<f64> {
        let in_base = self.command_from_base.inverse() * *place;
        let matrix = self.command_from_base.isometry().rotation.to_rotation_matrix();
        matrix * self.terms.frame.covariance(in_base.point()) * matrix.transpose()
    }

    /// The point of the box nearest to a command (mm) that is beyond the rim by no more than is allowed; else the command.
    pub(super) fn at_rim(&self, command: &Point3<f64>) -> Point3<f64> {
        let place =
            *(self.command_from_base.inverse() * Position::<Command>::claim(*command)).point();
        let beyond = self.beyond(&place);
        let most = Vector3::from(self.lattice.step) * BEYOND_RIM;
        let is_near = (0..3).all(|axis| beyond[axis].abs() <= most[axis]);
        if is_near && beyond.norm() > 0.0 {
            *(self.command_from_base * Position::<Base>::claim(place - beyond)).point()
        } else {
            *command
        }
    }

    fn vertices(&self, cell: &InCell) -> Result<[&Known; 8], Gap> {
        let refused =
            cell.vertices.iter().find_map(|&node| Some((node, *self.nodes[node].as_ref().err()?)));
        if let Some((node, why)) = refused {
            return Err(Gap::Node { node, at: *self.position(node).point(), why });
        }
        let known = |node: usize| self.nodes[node].as_ref().expect("refused nodes were looked for");
        Ok(cell.vertices.map(known))
    }

    fn outside(&self, place: &Point3<f64>) -> Gap {
        Gap::Outside { beyond_mm: self.command_from_base.isometry().rotation * self.beyond(place) }
    }

    /// Distance of a point in the base frame from the box along each axis, mm; 0 inside.
    fn beyond(&self, place: &Point3<f64>) -> Vector3<f64> {
        let Lattice { origin, step, counts } = self.lattice;
        Vector3::from_fn(|axis, _| {
            let high = (counts[axis] - 1) as f64 * step[axis];
            let inside = place[axis] - origin[axis];
            inside - inside.clamp(0.0, high)
        })
    }
}

impl PoseModel for CompensationTable {
    /// None: a table has the frame of commands and no tracker.
    fn frames(&self) -> &[Frames] {
        &[]
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        let At::Tool { position, orientation } = at else { return Err(Gap::NoPosition) };
        self.terms.serves(orientation.as_ref())?;
        let found = self.error_at(&Position::claim(*position))?;
        Ok(Prediction {
            position: position + found.error,
            flange: orientation.unwrap_or(self.terms.orientation),
            error: Some(found.error),
            open: Some(Open { rows: DMatrix::zeros(3, 0), alone: found.covariance }),
        })
    }

    fn spread(&self, _: usize, _: SourceId, prediction: &Prediction) -> Spread {
        let open = prediction.open.as_ref();
        Spread::Of(open.map_or_else(Matrix3::zeros, |open| open.alone))
    }
}
