//! Names of columns and keys, of which no two may have the same meaning: a skipped name is a lost value. The marks of
//! corrected targets ([`MARKS`]) are accepted in any case, since they only forbid and hold no number.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::schema;

/// Columns that have a value in corrected targets only.
pub(super) const MARKS: [&str; 2] = ["table_id", "corrected_by"];

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NamesProblem {
    #[error("{name:?} is given twice; which value is meant is not clear")]
    Twice { name: String },
    #[error(
        "{first:?} and {second:?} differ in the size of letters alone; which is meant is not clear"
    )]
    Alike { first: String, second: String },
    #[error("{found:?} is no name that is known here, and {known:?} is; write it so")]
    OtherLetters { found: String, known: String },
    #[error(
        "{name:?} states an orientation or a frame in a form that is not read here; give positions in the table's frame and orientations as qx, \
         qy, qz and qw, or take the column out where it means nothing"
    )]
    NotRead { name: String },
}

/// Names, without their unit, of orientations and frames in forms that are not read.
const NOT_READ: &str = "rx ry rz roll pitch yaw frame base wobj uf ut user_frame base_no tool_no uframe utool ufr q1 q2 q3 q4 \
    alpha beta gamma phi theta psi rotx roty rotz rot_x rot_y rot_z";
/// Letters that are such names together; one of them alone may be the caller's own.
const NOT_READ_TOGETHER: [[&str; 3]; 4] =
    [["a", "b", "c"], ["w", "p", "r"], ["o", "a", "t"], ["i", "j", "k"]];

/// Compares the names of one file or object with each other and with the known ones.
pub(super) fn check<'n>(names: impl IntoIterator<Item = &'n str>) -> Result<(), NamesProblem> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    let mut stems: BTreeMap<String, &str> = BTreeMap::new();
    for name in names {
        let folded = folded(name);
        match known(&folded) {
            Some(known) if known != name => {
                return Err(NamesProblem::OtherLetters { found: name.to_owned(), known });
            }
            Some(_) => {}
            None => {
                let stem = folded.trim_end_matches("_deg").trim_end_matches("_rad");
                if NOT_READ.split_whitespace().any(|own| own == stem) {
                    return Err(NamesProblem::NotRead { name: name.to_owned() });
                }
                stems.insert(stem.to_owned(), name);
            }
        }
        match seen.insert(folded, name) {
            None => {}
            Some(first) if first == name => {
                return Err(NamesProblem::Twice { name: name.to_owned() });
            }
            Some(first) => {
                let (first, second) = (first.to_owned(), name.to_owned());
                return Err(NamesProblem::Alike { first, second });
            }
        }
    }
    let mut together = NOT_READ_TOGETHER.iter();
    let whole = together.find(|own| own.iter().all(|letter| stems.contains_key(*letter)));
    whole.map_or(Ok(()), |own| Err(NamesProblem::NotRead { name: stems[own[0]].to_owned() }))
}

pub(super) fn is_mark(name: &str) -> bool {
    MARKS.contains(&folded(name).as_str())
}

fn folded(name: &str) -> String {
    name.trim().to_lowercase()
}

/// The name in small letters, where it is known; marks are known in any case.
fn known(folded: &str) -> Option<String> {
    if MARKS.contains(&folded) {
        return None;
    }
    let targets = schema::find("targets").expect("it is one of the program's own schemas");
    let is_column = targets.column(folded).is_some();
    (is_column || super::angles::is_angle(folded)).then(|| folded.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(names: &[&str]) -> String {
        check(names.iter().copied()).unwrap_err().to_string()
    }

    #[test]
    fn names_of_the_callers_own_pass_as_they_are() {
        assert_eq!(check(["target", "x_mm", "Note", "ID", "q1_deg"]), Ok(()));
        assert_eq!(check(["Table_ID", "Corrected_By"]), Ok(()), "known so too");
    }

    #[test]
    fn orientations_and_frames_in_other_forms_are_refused() {
        for name in ["rx_deg", "Yaw", "FRAME", "wobj", "BASE_NO", "q1", "alpha"] {
            assert!(told(&["target", "x_mm", name]).contains("is not read here"), "{name}");
        }
        for names in [["A", "B", "C"], ["w_deg", "p_deg", "r_deg"]] {
            assert!(told(&names).contains(&format!("{:?} states", names[0])), "{names:?}");
        }
        assert_eq!(check(["P", "r", "a", "b"]), Ok(()), "the caller's own");
    }

    #[test]
    fn two_for_one_and_one_in_other_letters_are_reported_by_name() {
        assert!(told(&["x_mm", "x_mm"]).contains("\"x_mm\" is given twice"));
        assert!(told(&["x_mm", "X_mm"]).contains("\"X_mm\" is no name that is known here"));
        assert!(told(&["note", "Note"]).contains("\"note\" and \"Note\" differ"));
        assert!(told(&["table_id", "Table_ID"]).contains("differ in the size"));
        assert!(told(&["Q1_DEG"]).contains("\"q1_deg\" is; write it so"));
    }
}
