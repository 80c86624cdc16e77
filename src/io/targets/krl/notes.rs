//! Remarks on a data list for the user, in addition to its targets.

use super::{DataList, Point};

const LINES_SHOWN: usize = 10;

impl DataList {
    pub fn notes(&self) -> Vec<String> {
        let notes = [
            Some(self.whose()),
            self.frame_values(),
            self.count(Point::is_taught_accurate).map(|count| {
                format!(
                    "{count} positions were taught with the controller's absolute-accuracy option on (bit 4 of S)"
                )
            }),
            self.count(|point| point.external).map(|count| {
                format!(
                    "{count} positions have external axes away from 0: where these move the arm or the part, the table's frame of \
                     commands moves with them, and the corrections do not hold"
                )
            }),
            self.left(),
        ];
        notes.into_iter().flatten().collect()
    }

    fn whose(&self) -> String {
        match &self.frames {
            Some(frames) => format!(
                "the positions are those of {frames}: make sure that these are the table's tool and frame of commands"
            ),
            None => {
                "no FDAT states for which tool and base the positions are: make sure that these are the table's".to_owned()
            }
        }
    }

    /// A sentence on values of type FRAME; programs keep tools and bases in values of the same type.
    fn frame_values(&self) -> Option<String> {
        let lines = self.points.iter().filter_map(|point| point.frame_in);
        let all = lines.clone().count();
        let shown: Vec<String> = lines.take(LINES_SHOWN).map(|line| line.to_string()).collect();
        let more = if all > shown.len() { ", …" } else { "" };
        (all > 0).then(|| {
            format!(
                "{all} values of type FRAME are taken for positions (line {}{more}): make sure that none of them is a tool or a base",
                shown.join(", ")
            )
        })
    }

    fn count(&self, is: impl Fn(&Point) -> bool) -> Option<usize> {
        let count = self.points.iter().filter(|point| is(point)).count();
        (count > 0).then_some(count)
    }

    fn left(&self) -> Option<String> {
        let others = self.others.iter();
        let others: Vec<String> = others.map(|(kind, n)| format!("{n} {kind}")).collect();
        (!others.is_empty()).then(|| format!("unchanged: {}", others.join(", ")))
    }
}

impl Point {
    fn is_taught_accurate(&self) -> bool {
        self.status.is_some_and(super::Status::taught_absolutely_accurate)
    }
}
