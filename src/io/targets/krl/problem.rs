//! What can be wrong with a data list.

use std::fmt;

use thiserror::Error;

use super::super::RowProblem;

/// Tool and base of positions, by their numbers at the controller.
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

/// What is wrong with a line of a data list.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KrlProblem {
    /// No DEFDAT.
    #[error("no line DEFDAT up to here; a data list of KUKA begins with DEFDAT and its name")]
    NoList,
    /// No ENDDAT.
    #[error("no line ENDDAT up to here; the list is cut, or its end is missing")]
    NoEnd,
    /// A second DEFDAT.
    #[error("a second DEFDAT before ENDDAT; give each list in a file of its own")]
    SecondList,
    /// A DEFDAT without a name, or with more than one.
    #[error("DEFDAT has a name behind it, and PUBLIC or nothing behind that")]
    Head,
    /// A statement outside of the list.
    #[error(
        "a statement outside of the list; before DEFDAT stand lines that begin with &, and behind ENDDAT comments alone"
    )]
    Outside,
    /// A text without an end.
    #[error("a text begins with \" and does not end in its line")]
    OpenText,
    /// A type again for the same name.
    #[error("{name} is declared in line {first_line} already")]
    DeclaredTwice {
        /// The name.
        name: String,
        /// Where it is declared first.
        first_line: u64,
    },
    /// The mark of a corrected list.
    #[error(
        "corrected already, by table {table:?}, as {name} says; correct the list that it was made from, a second correction \
         would move the tool by the error once more"
    )]
    Marked {
        /// The variable.
        name: String,
        /// The table, where the list tells.
        table: String,
    },
    /// Data of the controller itself.
    #[error(
        "this list belongs to the system, and its frames are tools and bases, not targets; give the .dat of a program"
    )]
    System,
    /// Commands are no targets.
    #[error(
        "corrected already: {comment:?}; correct the list that it was made from, a second correction would move the tool by \
         the error once more"
    )]
    Corrected {
        /// The line that says so.
        comment: String,
    },
    /// Ends of lines that readers do not agree about.
    #[error(
        "a carriage return without a line feed; where the line ends is not clear, save the list with CR LF or LF"
    )]
    LoneReturn,
    /// Points of several frames.
    #[error(
        "{other}, but {first} in line {first_line}: a table holds in one frame of commands and for one tool; make a list of \
         each pair and correct each by its own table"
    )]
    SeveralFrames {
        /// The first pair.
        first: FdatFrames,
        /// Where it stands.
        first_line: u64,
        /// The other.
        other: FdatFrames,
    },
    /// The robot carries the work piece.
    #[error(
        "IPO_FRAME #TCP: the tool stands in the cell and the robot carries the part, and tables are for tools that the robot \
         carries"
    )]
    ToolInTheCell,
    /// A position whose type nothing says.
    #[error(
        "{name} has X, Y and Z, but neither this list nor the value itself says its type; write {{E6POS: X …}} if it is a \
         position"
    )]
    NoKind {
        /// The name.
        name: String,
    },
    /// A position whose value is none.
    #[error("{name} is a position, but its value is no aggregate; write {{X …,Y …,Z …}}")]
    NoAggregate {
        /// The name.
        name: String,
    },
    /// A value for something that is no name.
    #[error(
        "what stands before = is no name, or a type and a name; write each value in a line of its own"
    )]
    NoStatement,
    /// A line that is no statement.
    #[error(
        "this is neither a declaration (a type and names) nor a value (a name, =, and one value); is an = or a comma missing?"
    )]
    NoDeclaration,
    /// A value for a part of a position.
    #[error(
        "a value for a component of {name}; write the whole position in braces, {{X …,Y …,Z …}}"
    )]
    Component {
        /// The variable.
        name: String,
    },
    /// An element whose number is none.
    #[error("{name} is a position, but its index is no whole number")]
    NoIndex {
        /// The name with its index.
        name: String,
    },
    /// A value with something behind it.
    #[error("{text:?} is not one value; write each value in a line of its own")]
    NoValue {
        /// What stands there.
        text: String,
    },
    /// A component that is not a name and one value.
    #[error(
        "{text:?} stands between the commas of the braces where a component, a name and its value, should; a number has a \
         decimal point, and components have one comma between them"
    )]
    NoComponent {
        /// What stands there.
        text: String,
    },
    /// A component that positions do not have.
    #[error("component {component}: a value of type {kind} has none of this name")]
    OtherComponent {
        /// The component.
        component: String,
        /// The type.
        kind: String,
    },
    /// A type before the colon that is not the one declared.
    #[error("the value is of type {own}, but {name} is declared as {kind}")]
    OtherKind {
        /// The name.
        name: String,
        /// The type declared.
        kind: String,
        /// The type of the value.
        own: String,
    },
    /// Braces without an end.
    #[error(
        "the braces of the value do not close at the end of the line, or lie too deep; write each value in a line of its own"
    )]
    Open,
    /// The same component twice.
    #[error("component {component} stands twice")]
    SameComponent {
        /// The component.
        component: String,
    },
    /// Some of an orientation's three angles.
    #[error(
        "an orientation is three angles, A B C, and some of them are missing; give all or none"
    )]
    PartOfOrientation,
    /// Text where a number stands.
    #[error("component {component} holds {text:?}, which is no finite number")]
    NoNumber {
        /// The component.
        component: String,
        /// What stands there.
        text: String,
    },
    /// Text where a whole number stands.
    #[error("component {component} holds {text:?}, which is no whole number")]
    NoWhole {
        /// The component.
        component: String,
        /// What stands there.
        text: String,
    },
    /// An S with bits that do not exist.
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
