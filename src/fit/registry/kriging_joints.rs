//! A rival: kriging of what the identified geometry leaves, with one kernel of all joints.

use super::on_geometry::on_geometry;
use super::{About, Corrects, Made};
use crate::fit::model::{Angles, PoseModel};
use crate::fit::models::Training;
use crate::fit::rivals::kriging::Kriging;
use crate::fit::rivals::slides;

pub(super) const ABOUT: About = About {
    word: "kriging_joints",
    name: "geometry, kriging of all joints",
    look: 4,
    corrects: Corrects::Predicted,
    angles: &[Angles::Reported],
    serves: false,
    made: Made::Rival(make),
    load: None,
};

fn make(training: &Training<'_>) -> Option<Box<dyn PoseModel>> {
    let slides = slides(training.arm);
    on_geometry(training, |samples| Kriging::new(samples, &slides))
}
