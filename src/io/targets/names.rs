//! Names of columns and keys: what each stands for, and that no two stand for the same.
//!
//! A spreadsheet or a script may write `X_mm` beside `x_mm`, or `Table_ID` for `table_id`. Which of two is meant cannot be
//! told, and a name in other letters that is passed over is a value that is lost: both are errors that say the names. The
//! marks of corrected targets ([`MARKS`]) are known in any letters, since they forbid and never say a number.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::io::schema;

/// Columns that only corrected targets have a value in.
pub(super) const MARKS: [&str; 2] = ["table_id", "corrected_by"];

/// What is wrong with the names of columns or keys.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NamesProblem {
    /// The same name twice.
    #[error("{name:?} stands twice; which value is meant is not clear")]
    Twice {
        /// The name.
        name: String,
    },
    /// The same but for the size of letters.
    #[error(
        "{first:?} and {second:?} differ in the size of letters alone; which is meant is not clear"
    )]
    Alike {
        /// One.
        first: String,
        /// The other.
        second: String,
    },
    /// A name that is known in other letters.
    #[error("{found:?} is no name that is known here, and {known:?} is; write it so")]
    OtherLetters {
        /// What stands there.
        found: String,
        /// What is known.
        known: String,
    },
}

/// Holds the names of one file or object against each other and against those that are known.
pub(super) fn check<'n>(names: impl IntoIterator<Item = &'n str>) -> Result<(), NamesProblem> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    for name in names {
        let folded = folded(name);
        if let Some(known) = known(&folded).filter(|known| known != name) {
            return Err(NamesProblem::OtherLetters {
                found: name.to_owned(),
                known,
            });
        }
        match seen.insert(folded, name) {
            None => {}
            Some(first) if first == name => {
                let name = name.to_owned();
                return Err(NamesProblem::Twice { name });
            }
            Some(first) => {
                return Err(NamesProblem::Alike {
                    first: first.to_owned(),
                    second: name.to_owned(),
                });
            }
        }
    }
    Ok(())
}

/// Whether a name is that of a mark.
pub(super) fn is_mark(name: &str) -> bool {
    MARKS.contains(&folded(name).as_str())
}

fn folded(name: &str) -> String {
    name.trim().to_lowercase()
}

/// The name in small letters, where it stands for something here; marks do in any letters.
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
    fn two_for_one_and_one_in_other_letters_are_reported_by_name() {
        assert!(told(&["x_mm", "x_mm"]).contains("\"x_mm\" stands twice"));
        assert!(told(&["x_mm", "X_mm"]).contains("\"X_mm\" is no name that is known here"));
        assert!(told(&["note", "Note"]).contains("\"note\" and \"Note\" differ"));
        assert!(told(&["table_id", "Table_ID"]).contains("differ in the size"));
        assert!(told(&["Q1_DEG"]).contains("\"q1_deg\" is; write it so"));
    }
}
