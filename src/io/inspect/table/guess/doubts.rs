use super::{Doubt, Key, Work, stated_angle, stated_length};
use crate::inspect::table::by_arm::{Arms, BETTER, Differs, LEAST_STATIONS, Tried, Verdict};
use crate::inspect::table::choices::{Choice, Part};
use crate::inspect::table::columns::largest;

impl Work<'_> {
    pub(super) fn doubts(&self, choices: &[Choice], arms: &Arms, doubts: &mut Vec<Doubt>) {
        let mut add = |key: Key, words: String| doubts.push(Doubt { key, words });
        self.choice.joints.doubt.iter().for_each(|words| add(Key::Joints, words.clone()));
        self.choice.doubt.iter().for_each(|words| add(Key::Position, words.clone()));
        let Some(verdict) = &self.verdict else { return self.by_size(arms, &mut add) };
        if !verdict.agrees() {
            let words = format!(
                "no reading of the columns agrees with the arm: the best leaves {:.1} mm in the median; name the robot's file with --robot",
                verdict.best.median_mm
            );
            add(Key::Robot, words);
        } else if !arms.is_named {
            add_arm(verdict, arms, &mut add);
        }
        self.of_units(verdict, &mut add);
        self.of_columns(verdict, choices, &mut add);
    }

    /// Without an arm, units follow from the sizes of the numbers.
    fn by_size(&self, arms: &Arms, add: &mut impl FnMut(Key, String)) {
        let joints = self.choice.joints.columns.len();
        let has_arm = arms.known.iter().any(|known| known.arm.joints().len() == joints);
        add(
            Key::Robot,
            match (has_arm, arms.is_named) {
                (true, _) => format!(
                    "fewer than {LEAST_STATIONS} rows have all joints and a position: too few to tell anything by the arm"
                ),
                (false, true) => format!(
                    "the table has {joints} columns of joints, and the arm another number of them"
                ),
                (false, false) => format!(
                    "no ready robot has {joints} joints; name the robot's file with --robot, and the rest is told by its residual"
                ),
            },
        );
        if stated_angle(self.columns, &self.choice).is_none() {
            let largest = largest(self.columns, self.choice.joints.columns.iter().copied());
            add(Key::JointUnit, format!("by numbers up to {largest:.4} alone"));
        }
        if stated_length(self.columns, &self.choice).is_none() {
            let largest = largest(self.columns, self.choice.placed());
            add(Key::Unit, format!("by numbers up to {largest:.4} alone"));
        }
    }

    fn of_units(&self, verdict: &Verdict, add: &mut impl FnMut(Key, String)) {
        let best = &verdict.best;
        if let Some(other) = verdict.rival(Differs::Angle) {
            add(Key::JointUnit, rival(best, other, other.angle.word()));
        }
        let stated = stated_angle(self.columns, &self.choice);
        if let Some(stated) = stated.filter(|unit| *unit != best.angle) {
            let words = format!("the table states {}, and the arm agrees with this", stated.word());
            add(Key::JointUnit, words);
        }
        if let Some(other) = verdict.rival(Differs::Slide) {
            add(Key::LengthUnit, rival(best, other, &other.slide.to_string()));
        }
        if let Some(other) = verdict.rival(Differs::Length) {
            add(Key::Unit, rival(best, other, &other.length.to_string()));
        }
        let stated = stated_length(self.columns, &self.choice);
        if let Some(stated) = stated.filter(|unit| *unit != best.length) {
            add(Key::Unit, format!("the table states {stated}, and the arm agrees with this"));
        }
        if let Some(other) = verdict.rival(Differs::Order) {
            add(Key::Joints, rival(best, other, "in reverse order"));
        } else if best.is_reversed && verdict.agrees() {
            let forward = verdict.others.iter().find(|(differs, _)| *differs == Differs::Order);
            let forward = forward.map_or(f64::INFINITY, |(_, tried)| tried.median_mm);
            add(
                Key::Joints,
                format!(
                    "the columns stand from flange to base: in their own order {forward:.1} mm remain instead of {:.2}",
                    best.median_mm
                ),
            );
        }
    }

    fn of_columns(&self, verdict: &Verdict, choices: &[Choice], add: &mut impl FnMut(Key, String)) {
        let best = &verdict.best;
        match self.choice.part {
            Part::Base => add(
                Key::Position,
                "the table has differences beside it, which are taken as computed ones".to_owned(),
            ),
            Part::Plus | Part::Minus => add(
                Key::Position,
                "taken as target and difference, measured less target; write the target less the difference where it is the other way round"
                    .to_owned(),
            ),
            Part::Whole => {
                // A position that names say is another's is no rival: a controller's own agrees with the arm better than any measured one.
                let others = verdict.others.iter().filter(|(differs, other)| *differs == Differs::Columns && choices[other.choice].whose == self.choice.whose);
                let rivals = others.map(|(_, other)| other).find(|other| best.median_mm > BETTER * other.median_mm);
                if let Some(other) = rivals {
                    add(Key::Position, rival(best, other, &super::in_words(&choices[other.choice], self.names)));
                }
            }
        }
    }
}

fn rival(best: &Tried, other: &Tried, alternative: &str) -> String {
    let (mm, best_mm) = (other.median_mm, best.median_mm);
    format!("{alternative} agrees with the arm nearly as well: {mm:.2} mm instead of {best_mm:.2}")
}

fn add_arm(verdict: &Verdict, arms: &Arms, add: &mut impl FnMut(Key, String)) {
    let file = |place: usize| arms.known[place].file.as_str();
    if !verdict.alike.is_empty() {
        let alike: Vec<&str> = verdict.alike.iter().map(|&place| file(place)).collect();
        add(Key::Robot, format!("{} has the same nominal arm", alike.join(", ")));
    }
    match verdict.rival(Differs::Arm) {
        Some(other) => add(Key::Robot, rival(&verdict.best, other, file(other.arm))),
        None => add(
            Key::Robot,
            "found among the ready robots by its residual; name yours with --robot to be sure"
                .to_owned(),
        ),
    }
}
