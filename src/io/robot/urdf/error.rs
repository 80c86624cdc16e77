use thiserror::Error;

pub(super) type Result<T, E = UrdfError> = std::result::Result<T, E>;

#[derive(Debug, Clone, PartialEq, Error)]
pub enum UrdfError {
    #[error(
        "line {line}, column {column}: it is no XML that can be read: {problem}; is it the right file?"
    )]
    Xml { line: u32, column: u32, problem: String },
    #[error(
        "line {line}: the prefix {prefix:?} is declared nowhere; write xmlns:{prefix}=\"{prefix}\" into <robot …>"
    )]
    Prefix { line: u32, prefix: String },
    #[error(
        "line {line}: {found:?} is xacro, from which a URDF is still to be made: `xacro my.urdf.xacro > my.urdf`, then give my.urdf"
    )]
    Xacro { line: u32, found: String },
    #[error(
        "line {line}: the file is XML, but begins with <{found}>; a URDF begins with <robot name=\"…\">"
    )]
    NotRobot { line: u32, found: String },
    #[error("line {line}: {element} has no {wanted}; a URDF needs it")]
    Incomplete { line: u32, element: String, wanted: &'static str },
    #[error(
        "line {line}: {kind} {name:?} is there already, in line {first}; each needs a name of its own"
    )]
    Twice { line: u32, kind: &'static str, name: String, first: u32 },
    #[error(
        "line {line}: joint {joint:?} has the {role} link {link:?}, which is not in the file; add <link name={link:?}/> or mend the name. {}",
        links_there(links)
    )]
    UnknownLink { line: u32, joint: String, role: &'static str, link: String, links: Vec<String> },
    #[error(
        "line {line}: joint {joint:?} has the child link {link:?}, which joint {other:?} in line {other_line} has already; \
         a URDF is a tree: take one of the two out"
    )]
    TwoParents { line: u32, joint: String, link: String, other: String, other_line: u32 },
    #[error(
        "line {line}: joint {joint:?} closes a circle of {count} joints through link {link:?}; a URDF is a tree: take out the joint that \
         closes the loop"
    )]
    Circle { line: u32, joint: String, count: usize, link: String },
    #[error(
        "the URDF has {} root links, {}; it has to have one: add a fixed joint to those that belong to the robot and take the others out",
        roots.len(), with_lines(roots)
    )]
    Roots { roots: Vec<(String, u32)> },
    #[error("the URDF has no <link>; is it the right file?")]
    NoLinks,
    #[error("{role} = {link:?} is no link of the URDF. {}", links_there(links))]
    NoSuchEnd { role: &'static str, link: String, links: Vec<String> },
    #[error(
        "several links end the chains behind {base:?}: {}; choose the tip: --tip LINK, or tip = \"LINK\" beside [robot] file",
        listed(leaves)
    )]
    SeveralTips { base: String, leaves: Vec<String> },
    #[error(
        "base and tip are one link, {link:?}: choose two with joints between them. {}",
        links_there(links)
    )]
    OneLink { link: String, links: Vec<String> },
    #[error(
        "line {line}: joint {joint:?} is {found:?}; joints of an arm are revolute, continuous, prismatic or fixed: choose base and tip so \
         that it is not between them, or give it one of these types"
    )]
    Kind { line: u32, joint: String, found: String },
    #[error("line {line}: joint {joint:?}: {key} = {found:?}, but it has to be {wanted}")]
    Number { line: u32, joint: String, key: String, found: String, wanted: &'static str },
    #[error("line {line}: joint {joint:?}: {problem}")]
    Form { line: u32, joint: String, problem: &'static str },
    #[error("line {line}: joint {joint:?} has {found}; {remedy}")]
    Has { line: u32, joint: String, found: String, remedy: &'static str },
    #[error(
        "line {line}: joint {joint:?} follows {follows:?}, which {problem}; its position cannot be known from the chain: choose another base or \
         tip, or take <mimic> out and let the controller report it"
    )]
    Mimic { line: u32, joint: String, follows: String, problem: &'static str },
    #[error(
        "the way from {base:?} to {tip:?} has {found} joints; a robot file has {most} at most: choose base and tip so that only the arm is \
         between them"
    )]
    TooLong { base: String, tip: String, found: usize, most: usize },
}

impl UrdfError {
    pub(super) fn of_xml(error: &roxmltree::Error) -> Self {
        let at = error.pos();
        if let roxmltree::Error::UnknownNamespace(prefix, _) = error {
            return Self::Prefix { line: at.row, prefix: printable(prefix) };
        }
        let problem = error.to_string();
        let place = format!(" at {}:{}", at.row, at.col);
        let problem = printable(problem.strip_suffix(&place).unwrap_or(&problem));
        Self::Xml { line: at.row, column: at.col, problem }
    }
}

pub(crate) fn printable(text: &str) -> String {
    let letter = |letter: char| {
        if letter.is_control() { letter.escape_default().to_string() } else { letter.to_string() }
    };
    text.chars().map(letter).collect()
}

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
