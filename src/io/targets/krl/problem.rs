//! Errors of a data list.

use std::fmt;

use thiserror::Error;

use super::super::RowProblem;

/// The tool and base of positions, by their numbers at the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FdatFrames {
    /// `TOOL_NO`.
    pub tool: i64,
    /// `BASE_NO`.
    pub base: i64,
}

impl fmt::Display for FdatFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TOOL_NO {}, BASE_NO {}", self.tool, self.base)
    }
}

/// The fault in a line of a data list.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KrlProblem {
    /// The text has no DEFDAT.
    #[error("no line DEFDAT up to here; a data list of KUKA begins with DEFDAT and its name")]
    NoList,
    /// The text has no ENDDAT.
    #[error("no line ENDDAT up to here; the list is cut, or its end is missing")]
    NoEnd,
    /// A second DEFDAT.
    #[error("a second DEFDAT before ENDDAT; give each list in a file of its own")]
    SecondList,
    /// A DEFDAT without a name, or with more than one.
    #[error("DEFDAT is followed by a name, and PUBLIC or nothing after that")]
    Head,
    /// A statement outside the list.
    #[error(
        "a statement outside of the list; before DEFDAT there may be lines that begin with &, after ENDDAT only comments"
    )]
    Outside,
    /// A text that does not end.
    #[error("a text begins with \" and does not end in its line")]
    OpenText,
    /// A second type for the same name.
    #[error("{name} is declared in line {first_line} already")]
    DeclaredTwice {
        name: String,
        /// Line of the first declaration.
        first_line: u64,
    },
    /// The mark of a corrected list.
    #[error(
        "corrected already, by table {table:?}, as {name} states; correct the list that it was made from, a second correction \
         would move the tool by the error once more"
    )]
    Marked {
        /// Name of the variable.
        name: String,
        /// The table's id, as in the list.
        table: String,
    },
    /// The list holds data of the controller itself.
    #[error(
        "this list belongs to the system, and its frames are tools and bases, not targets; give the .dat of a program"
    )]
    System,
    /// The list holds commands, which are no targets.
    #[error(
        "corrected already: {comment:?}; correct the list that it was made from, a second correction would move the tool by \
         the error once more"
    )]
    Corrected {
        /// The comment that marks it.
        comment: String,
    },
    /// A line's end that readers interpret in different ways.
    #[error(
        "a carriage return without a line feed; where the line ends is not clear, save the list with CR LF or LF"
    )]
    LoneReturn,
    /// Points of several frames in one list.
    #[error(
        "{other}, but {first} in line {first_line}: a table holds in one frame of commands and for one tool; make a list of \
         each pair and correct each by its own table"
    )]
    SeveralFrames {
        /// The first pair.
        first: FdatFrames,
        /// Line of the first pair.
        first_line: u64,
        /// The other pair.
        other: FdatFrames,
    },
    /// The robot carries the workpiece.
    #[error(
        "IPO_FRAME #TCP: the tool is fixed in the cell and the robot carries the part, and tables are for tools that the robot \
         carries"
    )]
    ToolInTheCell,
    /// A position whose type is not stated.
    #[error(
        "{name} has X, Y and Z, but neither this list nor the value itself states its type; write {{E6POS: X …}} if it is a \
         position"
    )]
    NoKind { name: String },
    /// A position whose value is no aggregate.
    #[error("{name} is a position, but its value is no aggregate; write {{X …,Y …,Z …}}")]
    NoAggregate { name: String },
    /// A value for something that is no name.
    #[error(
        "the text before = is no name, or a type and a name; write each value in a line of its own"
    )]
    NoStatement,
    /// A line that is no statement.
    #[error(
        "this is neither a declaration (a type and names) nor a value (a name, =, and one value); is an = or a comma missing?"
    )]
    NoDeclaration,
    /// A value for one component of a position.
    #[error(
        "a value for a component of {name}; write the whole position in braces, {{X …,Y …,Z …}}"
    )]
    Component {
        /// Name of the variable.
        name: String,
    },
    /// An element whose index is no number.
    #[error("{name} is a position, but its index is no whole number")]
    NoIndex {
        /// The name with its index.
        name: String,
    },
    /// A value with further text after it.
    #[error("{text:?} is not one value; write each value in a line of its own")]
    NoValue {
        /// The text of the value.
        text: String,
    },
    /// A component that is not a name and one value.
    #[error(
        "{text:?} is between the commas of the braces, where a component, a name and its value, belongs; a number has a \
         decimal point, and components have one comma between them"
    )]
    NoComponent {
        /// The text between the commas.
        text: String,
    },
    /// A component that positions do not have.
    #[error("component {component}: a value of type {kind} has none of this name")]
    OtherComponent {
        component: String,
        /// The type.
        kind: String,
    },
    /// The type before the colon differs from the declared one.
    #[error("the value is of type {own}, but {name} is declared as {kind}")]
    OtherKind {
        name: String,
        /// The type declared.
        kind: String,
        /// The type of the value.
        own: String,
    },
    /// Braces that do not close.
    #[error(
        "the braces of the value do not close in the line, or are nested too deep; write each value in a line of its own"
    )]
    Open,
    /// A component is given twice.
    #[error("component {component} is given twice")]
    SameComponent { component: String },
    /// Only some of an orientation's three angles are given.
    #[error(
        "an orientation is three angles, A B C, and some of them are missing; give all or none"
    )]
    PartOfOrientation,
    /// A text in the place of a number.
    #[error("component {component} holds {text:?}, which is no finite number")]
    NoNumber { component: String, text: String },
    /// A text in the place of a whole number.
    #[error("component {component} holds {text:?}, which is no whole number")]
    NoWhole { component: String, text: String },
    /// An S with bits that are not defined.
    #[error("S is {number}; it has the bits 0 to 4, so it is 0 to 31")]
    NoStatus {
        /// S.
        number: i64,
    },
}

impl From<KrlProblem> for RowProblem {
    fn from(problem: KrlProblem) -> Self {
        Self::Krl(problem)
    }
}
