//! Why a position is not corrected, in the words of its report: what is missing, and what to give.

use thiserror::Error;

/// A line of a file, as messages name it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{file}, line {line}")]
pub struct Place {
    pub file: String,
    /// From 1.
    pub line: u32,
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Refusal {
    #[error(
        "nothing sets {what} before this motion in routine {routine}; set it there by a constant"
    )]
    NotSet { what: &'static str, routine: String },
    #[error("{what} is worked out at run time ({at}); give it by a constant")]
    AtRunTime { what: String, at: Place },
    #[error(
        "{what} is another by the way that the program takes to this motion; set it before the motion"
    )]
    Ways { what: &'static str },
    #[error(
        "the call of {routine} ({at}) may change {what}: {routine} is in none of the files, or in several; give one file that has it, set \
         {what} behind the call, or, where it moves nothing and sets no frame, name it above all tables of the file of the cell: harmless = [{name}]", name = quoted(routine)
    )]
    Call { what: &'static str, routine: String, at: Place },
    #[error(
        "{routine}, which an interrupt, a trigger or a thread runs at any time ({at}), changes {what}; let it change nothing that motions read"
    )]
    Interrupt { what: &'static str, routine: String, at: Place },
    #[error("{name} has no value in the files given; give {give}")]
    NotGiven { name: String, give: String },
    #[error(
        "{name} has two values ({first}; {second}); which one holds is not known; write it at one place"
    )]
    TwoValues { name: String, first: Place, second: Place },
    #[error("{name} is no frame with all of its numbers ({at})")]
    NoFrame { name: String, at: Place },
    #[error("nothing says how {name} was found; say whether it is surveyed or taught in the file of the cell: [frames.{key}] found = \"surveyed\"", key = quoted(name))]
    NotFound { name: String },
    #[error(
        "{name} is taught with an arm, so it holds that arm's errors already; give in the file of the cell taught_with (table calibrations \
         of the arm that touched it, as it was then) and points (joints_deg of the three points of a base with the tool that touched, of \
         four poses or more for a tool), or survey it"
    )]
    Taught { name: String },
    #[error(
        "the tool stands in the cell or the arm holds the part ({at}); such positions are corrected in RAPID alone, where both data say so, but for \
         circles"
    )]
    FixedTool { at: Place },
    #[error(
        "{name} moves with an external axis or a conveyor ({at}); such positions are not corrected"
    )]
    Moving { name: String, at: Place },
    #[error(
        "{name} is at {value}, and nothing says that the external axes carry neither arm nor part; say so above all tables of the file of the cell: external_axes = \"apart\""
    )]
    ExternalAxis { name: String, value: String },
    #[error("it states no {what}, so the controller goes on with the last ones; state them")]
    Partial { what: &'static str },
    #[error("its {what} is in a form that is not rewritten: {form}; write it as a plain number")]
    Form { what: &'static str, form: String },
    #[error(
        "it is used under {first} in line {first_line} and under {second} in line {second_line}; give each its own position"
    )]
    TwoFrames { first: String, first_line: u32, second: String, second_line: u32 },
    #[error("it is also read in {at}, where it is not followed; give the motion its own position")]
    Read { at: Place },
    #[error(
        "it stands in {file}, which all programs of the controller share; correct none of these by a program"
    )]
    Shared { file: String },
    #[error("{word} is not followed ({at}); its positions are not corrected")]
    Instruction { word: String, at: Place },
    #[error(
        "a displacement may be on ({what}); switch it off before this motion, or take it out of the program"
    )]
    Displaced { what: &'static str },
    #[error(
        "no motion before it states an arm configuration in routine {routine}; begin the routine with one that does"
    )]
    NoBranch { routine: String },
    #[error("the motions that lead to it state two arm configurations")]
    TwoBranches,
    #[error("the blocks of routine {routine} do not close as they open; mend the program")]
    Blocks { routine: String },
    #[error("the file is corrected already by posegrid ({at}); correct the original")]
    Corrected { at: Place },
    #[error("{0}")]
    Other(String),
}

/// A name as a key of TOML.
fn quoted(name: &str) -> String {
    format!("{name:?}")
}
