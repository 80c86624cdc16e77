//! A rival: an ensemble of small neural networks on what the identified geometry leaves; only with the feature `learned`.

use super::{About, Corrects, Made};
use crate::fit::model::{Angles, PoseModel};
use crate::fit::models::Training;

pub(super) const ABOUT: About = About {
    word: "network",
    name: "geometry, neural network",
    look: 4,
    corrects: Corrects::Predicted,
    angles: &[Angles::Weighted],
    serves: false,
    made: Made::Rival(make),
    load: None,
};

#[cfg(feature = "learned")]
fn make(training: &Training<'_>) -> Option<Box<dyn PoseModel>> {
    use super::on_geometry::on_geometry;
    use crate::fit::rivals::{network::Network, slides};

    let slides = slides(training.arm);
    on_geometry(training, |samples| Network::new(samples, &slides))
}

#[cfg(not(feature = "learned"))]
fn make(_: &Training<'_>) -> Option<Box<dyn PoseModel>> {
    None
}
