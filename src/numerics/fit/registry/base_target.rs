//! Base + target: the nominal arm with the best fitting frames.

use super::{About, Corrects, geometric};
use crate::fit::model::Angles;

pub(super) const ABOUT: About = About {
    word: "base_target",
    name: "base and target fitted",
    look: 1,
    corrects: Corrects::Frames,
    angles: &[Angles::Reported],
    serves: false,
    of_training: Some(|models| Some(&models.base_target)),
    load: Some(geometric::load),
};
