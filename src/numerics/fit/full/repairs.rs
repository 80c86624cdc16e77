//! Joints that were repaired: what sessions before the repair say of such a joint says nothing of it afterwards.
//!
//! A new gear has a curve and gear lines of its own, and its encoder another zero. So a session before the repair sees, in place of the
//! joint's curve ([`Block::Curve`](super::layout::Block)), the one that it had then, with a constant
//! ([`Block::Earlier`](super::layout::Block)), of the same prior. All else that such a session says (other joints, links, gravity) is
//! pooled. A zero that moved by φ is told to the first order: 3 mrad bend two metres by 9 µm.

use serde::{Deserialize, Serialize};

use crate::units::WallTime;

/// Standard deviation of a joint's zero before its repair relative to now, rad: wider than a mastering leaves open.
pub(super) const ZERO_SD_RAD: f64 = 0.02;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Repair {
    /// The joint, from 1 at the base.
    pub joint: usize,
    /// Sessions that began then or later are after the repair, UTC.
    pub from: Day,
}

impl Repair {
    /// Whether it was still to come on a day, days since 1970.
    pub fn is_to_come(&self, day: f64) -> bool {
        day < self.from.0.day()
    }
}

/// A moment that is stated as text: `2026-05-14`, which stands for its beginning, or `2026-05-14 14:30`, UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Day(pub WallTime);

impl TryFrom<String> for Day {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        WallTime::stated(&text).map(Self).ok_or_else(|| {
            format!("\"{text}\" is no time; write \"2026-05-14\" or \"2026-05-14 14:30\"")
        })
    }
}

impl From<Day> for String {
    fn from(day: Day) -> Self {
        day.0.to_string()
    }
}

/// Number of repairs that were still to come in each session of these days (since 1970), for each of `joints` joints; empty where none
/// was. A session without a date is taken for one after all repairs.
pub(super) fn to_come(repairs: &[Repair], days: &[Option<f64>], joints: usize) -> Vec<Vec<usize>> {
    let of_session = |day: &Option<f64>| {
        let mut to_come = vec![0; joints];
        for repair in repairs {
            let is_to_come = day.is_some_and(|day| repair.is_to_come(day));
            let joint = to_come.get_mut(repair.joint.wrapping_sub(1));
            if let Some(count) = joint.filter(|_| is_to_come) {
                *count += 1;
            }
        }
        to_come
    };
    let to_come: Vec<Vec<usize>> = days.iter().map(of_session).collect();
    if to_come.iter().flatten().all(|count| *count == 0) {
        return Vec::new();
    }
    to_come
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repair(joint: usize, from: &str) -> Repair {
        let text = format!("joint = {joint}\nfrom = \"{from}\"");
        toml::from_str(&text).expect("a repair")
    }

    #[test]
    fn each_session_counts_the_repairs_of_a_joint_that_were_still_to_come() {
        let repairs =
            [repair(2, "2026-05-14"), repair(2, "2026-08-01 12:00"), repair(1, "2026-05-14")];
        let of = |days: &[Option<f64>]| to_come(&repairs, days, 3);
        let day = repairs[0].from.0.day();
        let found = of(&[Some(day - 0.001), Some(day), Some(day + 100.0), None]);
        assert_eq!(found[0], [1, 2, 0]);
        assert_eq!(found[1], [0, 1, 0]);
        assert_eq!((&found[2], &found[3]), (&vec![0; 3], &vec![0; 3]));
        assert!(of(&[Some(day + 100.0)]).is_empty());
    }

    #[test]
    fn a_time_reads_back_as_it_was_written_and_another_text_is_refused() {
        let own = repair(3, "2026-05-14 14:30");
        let text = toml::to_string(&own).expect("text");
        assert_eq!(toml::from_str::<Repair>(&text).expect("its own text"), own);
        for text in ["14.05.2026", "2026-02-30", ""] {
            let refused = Day::try_from(text.to_owned()).expect_err(text);
            assert!(refused.contains("write \"2026-05-14\""), "{refused}");
        }
    }
}
