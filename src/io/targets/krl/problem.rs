use std::fmt;

use thiserror::Error;

use super::super::RowProblem;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FdatFrames {
    pub tool: i64,
    pub base: i64,
}

impl fmt::Display for FdatFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TOOL_NO {}, BASE_NO {}", self.tool, self.base)
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KrlProblem {
    #[error("no line DEFDAT up to here; a data list of KUKA begins with DEFDAT and its name")]
    NoList,
    #[error("no line ENDDAT up to here; the list is cut, or its end is missing")]
    NoEnd,
    #[error("a second DEFDAT before ENDDAT; give each list in a file of its own")]
    SecondList,
    #[error("DEFDAT is followed by a name, and PUBLIC or nothing after that")]
    Head,
    #[error(
        "a statement outside of the list; before DEFDAT there may be lines that begin with &, after ENDDAT only comments"
    )]
    Outside,
    #[error("a text begins with \" and does not end in its line")]
    OpenText,
    #[error("{name} is declared in line {first_line} already")]
    DeclaredTwice { name: String, first_line: u64 },
    #[error(
        "corrected already, by table {table:?}, as {name} states; correct the list that it was made from, a second correction \
         would move the tool by the error once more"
    )]
    Marked { name: String, table: String },
    #[error(
        "this list belongs to the system, and its frames are tools and bases, not targets; give the .dat of a program"
    )]
    System,
    #[error(
        "corrected already: {comment:?}; correct the list that it was made from, a second correction would move the tool by \
         the error once more"
    )]
    Corrected { comment: String },
    #[error(
        "a carriage return without a line feed; where the line ends is not clear, save the list with CR LF or LF"
    )]
    LoneReturn,
    #[error(
        "{other}, but {first} in line {first_line}: a table holds in one frame of commands and for one tool; make a list of \
         each pair and correct each by its own table"
    )]
    SeveralFrames { first: FdatFrames, first_line: u64, other: FdatFrames },
    #[error(
        "IPO_FRAME #TCP: the tool is fixed in the cell and the robot carries the part, and tables are for tools that the robot \
         carries"
    )]
    ToolInTheCell,
    #[error(
        "{name} has X, Y and Z, but neither this list nor the value itself states its type; write {{E6POS: X …}} if it is a \
         position"
    )]
    NoKind { name: String },
    #[error("{name} is a position, but its value is no aggregate; write {{X …,Y …,Z …}}")]
    NoAggregate { name: String },
    #[error(
        "the text before = is no name, or a type and a name; write each value in a line of its own"
    )]
    NoStatement,
    #[error(
        "this is neither a declaration (a type and names) nor a value (a name, =, and one value); is an = or a comma missing?"
    )]
    NoDeclaration,
    #[error(
        "a value for a component of {name}; write the whole position in braces, {{X …,Y …,Z …}}"
    )]
    Component { name: String },
    #[error("{name} is a position, but its index is no whole number")]
    NoIndex { name: String },
    #[error("{text:?} is not one value; write each value in a line of its own")]
    NoValue { text: String },
    #[error(
        "{text:?} is between the commas of the braces, where a component, a name and its value, belongs; a number has a \
         decimal point, and components have one comma between them"
    )]
    NoComponent { text: String },
    #[error("component {component}: a value of type {kind} has none of this name")]
    OtherComponent { component: String, kind: String },
    #[error("the value is of type {own}, but {name} is declared as {kind}")]
    OtherKind { name: String, kind: String, own: String },
    #[error(
        "the braces of the value do not close in the line, or are nested too deep; write each value in a line of its own"
    )]
    Open,
    #[error("component {component} is given twice")]
    SameComponent { component: String },
    #[error(
        "an orientation is three angles, A B C, and some of them are missing; give all or none"
    )]
    PartOfOrientation,
    #[error("component {component} holds {text:?}, which is no finite number")]
    NoNumber { component: String, text: String },
    #[error("component {component} holds {text:?}, which is no whole number")]
    NoWhole { component: String, text: String },
    #[error("S is {number}; it has the bits 0 to 4, so it is 0 to 31")]
    NoStatus { number: i64 },
}

impl From<KrlProblem> for RowProblem {
    fn from(problem: KrlProblem) -> Self {
        Self::Krl(problem)
    }
}
