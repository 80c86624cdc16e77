//! A rival: inverse distance weights in space of what the identified geometry leaves.

use super::on_geometry::on_geometry;
use super::{About, Corrects, Made};
use crate::fit::model::{Angles, PoseModel};
use crate::fit::models::Training;
use crate::fit::rivals::idw::{Idw, Space};

pub(super) const ABOUT: About = About {
    word: "idw_space",
    name: "geometry, inverse distances in space",
    look: 5,
    corrects: Corrects::Predicted,
    angles: &[Angles::Reported],
    serves: false,
    made: Made::Rival(make),
    load: None,
};

fn make(training: &Training<'_>) -> Option<Box<dyn PoseModel>> {
    on_geometry(training, |samples| Idw::new(samples, Space::Position))
}
