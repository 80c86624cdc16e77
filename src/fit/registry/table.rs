//! The compensation table: known of here by its words; what it predicts stands in [`crate::compensation::table`].

use super::{About, Corrects, Made};

pub(super) const ABOUT: About = About {
    word: "table",
    name: "compensation table",
    look: 3,
    corrects: Corrects::Commands,
    angles: &[],
    serves: false,
    made: Made::Elsewhere,
    load: None,
};
