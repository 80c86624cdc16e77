//! The compensation table: only its names are here; its predictions are in [`crate::compensation::table`].

use super::{About, Corrects};

pub(super) const ABOUT: About = About {
    word: "table",
    name: "compensation table",
    look: 3,
    corrects: Corrects::Commands,
    angles: &[],
    serves: false,
    of_training: None,
    load: None,
};
