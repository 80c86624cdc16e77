//! What a batch tells of a run that was never made.

use posegrid::grid::Verdict;
use posegrid::io::lake::Lake;
use posegrid::manifest::RunKey;
use posegrid::pipeline::fleet::FleetPiece;
use posegrid::pipeline::run::Done;

/// The name of such runs.
pub const RUN: &str = "0a";

/// A run of a piece of work that meets its tolerance.
pub fn done(own: FleetPiece<'_>, lake: &Lake) -> Done {
    let robot = own.configuration.robot.as_deref().expect("named");
    Done {
        key: RunKey::new(robot, &own.piece.session, RUN),
        already_there: false,
        asked: 1,
        took_place: None,
        verdict: Verdict::Meets,
        reason: None,
        verdict_of: None,
        rejected: Vec::new(),
        summary: None,
        words: Vec::new(),
        corrects: None,
        tables: lake.root(),
        page: None,
        took: None,
    }
}
