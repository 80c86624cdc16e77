//! A rival: inverse distance weights in joint space of what the identified geometry leaves.

use super::on_geometry::on_geometry;
use super::{About, Corrects, Made};
use crate::fit::model::{Angles, PoseModel};
use crate::fit::models::Training;
use crate::fit::rivals::idw::{Idw, Space};
use crate::fit::rivals::slides;

pub(super) const ABOUT: About = About {
    word: "idw_joints",
    name: "geometry, inverse distances in joint space",
    look: 3,
    corrects: Corrects::Predicted,
    angles: &[Angles::Reported],
    serves: false,
    made: Made::Rival(make),
    load: None,
};

fn make(training: &Training<'_>) -> Option<Box<dyn PoseModel>> {
    let space = Space::Joints(slides(training.arm));
    on_geometry(training, |samples| Idw::new(samples, space))
}
