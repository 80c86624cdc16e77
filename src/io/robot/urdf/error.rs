//! Faults of a URDF, each with its line, its joint and what to do.

use thiserror::Error;

/// A fault of a URDF.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UrdfError {
    /// No well-formed XML.
    #[error(
        "line {line}, column {column}: it is no XML that can be read: {problem}; is it the right file?"
    )]
    Xml {
        /// Counted from 1.
        line: u32,
        /// Counted from 1.
        column: u32,
        /// The fault, in the reader's words.
        problem: String,
    },
    /// A xacro file.
    #[error(
        "line {line}: {found:?} is xacro, from which a URDF is still to be made: `xacro my.urdf.xacro > my.urdf`, then give my.urdf"
    )]
    Xacro {
        /// Counted from 1.
        line: u32,
        /// The text that shows it.
        found: String,
    },
    /// XML of another kind.
    #[error(
        "line {line}: the file is XML, but begins with <{found}>; a URDF begins with <robot name=\"…\">"
    )]
    NotRobot {
        /// Counted from 1.
        line: u32,
        /// Name of the root element, escaped.
        found: String,
    },
    /// An element that lacks a name or a link.
    #[error("line {line}: {element} has no {wanted}; a URDF needs it")]
    Incomplete {
        /// Counted from 1.
        line: u32,
        element: String,
        /// The part that it lacks.
        wanted: &'static str,
    },
    /// Two links, or two joints, of one name.
    #[error(
        "line {line}: {kind} {name:?} is there already, in line {first}; each needs a name of its own"
    )]
    Twice {
        /// Line of the second, from 1.
        line: u32,
        /// `link` or `joint`.
        kind: &'static str,
        name: String,
        /// Line of the first, from 1.
        first: u32,
    },
    /// A joint at a link that is not there.
    #[error(
        "line {line}: joint {joint:?} has the {role} link {link:?}, which is not in the file; add <link name={link:?}/> or mend the name. {}",
        links_there(links)
    )]
    UnknownLink {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The link that is not there.
        link: String,
        links: Vec<String>,
    },
    /// A link on two joints.
    #[error(
        "line {line}: joint {joint:?} has the child link {link:?}, which joint {other:?} in line {other_line} has already; \
         a URDF is a tree: take one of the two out"
    )]
    TwoParents {
        /// Line of the second joint, from 1.
        line: u32,
        /// The second joint.
        joint: String,
        link: String,
        /// The first joint.
        other: String,
        /// Line of the first joint, from 1.
        other_line: u32,
    },
    /// A circle of joints.
    #[error(
        "line {line}: joint {joint:?} closes a circle of {count} joints through link {link:?}; a URDF is a tree: take out the joint that \
         closes the loop"
    )]
    Circle {
        /// Line of a joint in it, from 1.
        line: u32,
        joint: String,
        /// Number of joints in it.
        count: usize,
        link: String,
    },
    /// Links that nothing carries.
    #[error(
        "the URDF has {} root links, {}; it has to have one: add a fixed joint to those that belong to the robot and take the others out",
        roots.len(), with_lines(roots)
    )]
    Roots {
        /// The links that are no joint's child, with their lines.
        roots: Vec<(String, u32)>,
    },
    /// A file without links.
    #[error("the URDF has no <link>; is it the right file?")]
    NoLinks,
    /// A chosen link that is not there.
    #[error("{role} = {link:?} is no link of the URDF. {}", links_there(links))]
    NoSuchEnd {
        /// `base` or `tip`.
        role: &'static str,
        link: String,
        /// The links that are there.
        links: Vec<String>,
    },
    /// Several links could be the tip.
    #[error(
        "several links end the chains behind {base:?}: {}; choose the tip: --tip LINK, or tip = \"LINK\" beside [robot] file",
        listed(leaves)
    )]
    SeveralTips {
        base: String,
        /// The links without a joint behind them.
        leaves: Vec<String>,
    },
    /// Base and tip are one link.
    #[error(
        "base and tip are one link, {link:?}: choose two with joints between them. {}",
        links_there(links)
    )]
    OneLink {
        link: String,
        /// The links that are there.
        links: Vec<String>,
    },
    /// A kind of joint that an arm has not, or that no URDF has.
    #[error(
        "line {line}: joint {joint:?} is {found:?}; joints of an arm are revolute, continuous, prismatic or fixed: choose base and tip so \
         that it is not between them, or give it one of these types"
    )]
    Kind {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// Its type.
        found: String,
    },
    /// Numbers that are none.
    #[error("line {line}: joint {joint:?}: {key} = {found:?}, but it has to be {wanted}")]
    Number {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// Element and attribute.
        key: String,
        /// The text found.
        found: String,
        /// The values that are allowed.
        wanted: &'static str,
    },
    /// A rotation that is stated twice, or in a way that the file's version has not.
    #[error("line {line}: joint {joint:?}: {problem}")]
    Rotation {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// The fault, and what to do.
        problem: &'static str,
    },
    /// Limits between which a joint cannot move, or none where there have to be some.
    #[error("line {line}: joint {joint:?} has {found}; {remedy}")]
    Limits {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// The limits found.
        found: String,
        /// Advice.
        remedy: &'static str,
    },
    /// A joint that follows one that does not move the chain.
    #[error(
        "line {line}: joint {joint:?} follows {follows:?}, which {problem}; its position cannot be known from the chain: choose another base or \
         tip, or take <mimic> out and let the controller report it"
    )]
    Mimic {
        /// Counted from 1.
        line: u32,
        joint: String,
        /// The joint that it follows.
        follows: String,
        /// Why that cannot be.
        problem: &'static str,
    },
    /// More joints on the way than a robot file has.
    #[error(
        "the way from {base:?} to {tip:?} has {found} joints; a robot file has {most} at most: choose base and tip so that only the arm is \
         between them"
    )]
    TooLong {
        /// The first link.
        base: String,
        /// The last link.
        tip: String,
        /// Number of joints, those that do not move included.
        found: usize,
        /// The most that there may be.
        most: usize,
    },
}

impl UrdfError {
    /// The error of a text that is no XML.
    pub(super) fn of_xml(error: &roxmltree::Error) -> Self {
        let at = error.pos();
        if let roxmltree::Error::UnknownNamespace(prefix, _) = error
            && prefix == "xacro"
        {
            return Self::Xacro { line: at.row, found: "xacro:".to_owned() };
        }
        let problem = error.to_string();
        let place = format!(" at {}:{}", at.row, at.col);
        Self::Xml {
            line: at.row,
            column: at.col,
            problem: printable(problem.strip_suffix(&place).unwrap_or(&problem)),
        }
    }
}

/// A text of the reader, which may quote a control character of the file.
fn printable(text: &str) -> String {
    let letter = |letter: char| {
        if letter.is_control() { letter.escape_default().to_string() } else { letter.to_string() }
    };
    text.chars().map(letter).collect()
}

/// The most names that a message lists.
const MOST_LISTED: usize = 60;

fn listed(names: &[String]) -> String {
    let quoted = names.iter().take(MOST_LISTED);
    let mut quoted: Vec<String> = quoted.map(|name| format!("{name:?}")).collect();
    if names.len() > MOST_LISTED {
        quoted.push(format!("and {} more", names.len() - MOST_LISTED));
    }
    quoted.join(", ")
}

fn links_there(links: &[String]) -> String {
    format!("Its links: {}", listed(links))
}

fn with_lines(roots: &[(String, u32)]) -> String {
    let named = roots.iter().take(MOST_LISTED);
    let named: Vec<String> = named.map(|(link, line)| format!("{link:?} (line {line})")).collect();
    named.join(", ")
}
