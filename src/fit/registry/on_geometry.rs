//! Rivals on top of the identified geometry of a training.

use std::sync::Arc;

use super::IdentifiedGeometry;
use crate::fit::model::PoseModel;
use crate::fit::models::Training;
use crate::fit::rivals::{ErrorMap, Rival, Sample, samples};

/// The identified geometry with the map that `learn` makes of the errors that it leaves; `None` where it makes none.
pub(super) fn on_geometry<M: ErrorMap + 'static>(
    training: &Training<'_>,
    learn: impl FnOnce(&[Sample<'_>]) -> Option<M>,
) -> Option<Box<dyn PoseModel>> {
    let geometry = Arc::new(IdentifiedGeometry::from(&training.models.geometric));
    let map = learn(&samples(&*geometry, training.observations))?;
    Some(Box::new(Rival::new(geometry, map)))
}
