//! A joint's variable for people and files: degrees where the joint turns, mm where it slides.

use super::arm::{Arm, Joint};
use crate::units::per_radian;

impl Joint {
    /// The variable `value` (rad; mm for a joint that slides) in the unit of [`Self::unit`].
    pub fn shown(&self, value: f64) -> f64 {
        if self.slides { value } else { value.to_degrees() }
    }

    /// The variable (rad; mm for a joint that slides) that is `shown` in the unit of [`Self::unit`].
    pub fn read(&self, shown: f64) -> f64 {
        if self.slides { shown } else { shown.to_radians() }
    }

    /// The unit in files and messages: "deg", or "mm" for a joint that slides.
    pub const fn unit(&self) -> &'static str {
        if self.slides { "mm" } else { "deg" }
    }

    /// The unit behind a number in text: "°", or " mm" for a joint that slides.
    pub const fn sign_of_unit(&self) -> &'static str {
        if self.slides { " mm" } else { "°" }
    }

    /// Units of the variable that count as one radian: 1 rad where it turns, 1000 mm where it slides.
    pub const fn per_radian(&self) -> f64 {
        per_radian(self.slides)
    }

    /// Radians that one unit of the variable counts as: 1 where it turns; 1/1000 a mm where it slides.
    pub const fn counted(&self) -> f64 {
        1.0 / per_radian(self.slides)
    }
}

impl Arm {
    pub fn has_slides(&self) -> bool {
        self.joints().iter().any(|joint| joint.slides)
    }

    /// Radians that one unit of each joint's variable counts as, in the arm's order ([`Joint::counted`]).
    pub fn counted(&self) -> Vec<f64> {
        self.joints().iter().map(Joint::counted).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(slides: bool) -> Joint {
        Joint { name: "j".to_owned(), lower: -1.0, upper: 1.0, slides }
    }

    #[test]
    fn angles_are_shown_in_degrees_and_positions_in_mm() {
        let (turns, slides) = (joint(false), joint(true));
        assert!((turns.shown(1.0) - 57.295_779_513).abs() < 1e-9);
        assert!((turns.read(turns.shown(0.3)) - 0.3).abs() < 1e-15);
        assert!((slides.shown(12.5) - slides.read(12.5)).abs() < 1e-15);
        assert_eq!((turns.unit(), slides.unit()), ("deg", "mm"));
        assert!((slides.counted() * 1.0 - 1e-3 * turns.counted()).abs() < 1e-18);
    }
}
