//! The raw command, without any correction.

use super::{About, Corrects};

pub(super) const ABOUT: About = About {
    word: "raw_command",
    name: "raw command",
    look: 1,
    corrects: Corrects::Nothing,
    angles: &[],
    serves: false,
    of_training: None,
    load: None,
};
