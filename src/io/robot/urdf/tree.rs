//! Links and joints of a URDF as a tree, and the way between two links.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::super::Selection;
use super::error::{Result, UrdfError};
use super::{attribute, child, children, line};

/// A joint with its two links; its numbers stay unread.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Joint<'a, 'i> {
    pub(crate) node: Node<'a, 'i>,
    pub(crate) name: &'a str,
    pub(crate) parent: &'a str,
    pub(crate) child: &'a str,
}

#[derive(Debug)]
pub(crate) struct Tree<'a, 'i> {
    pub(crate) robot: &'a str,
    pub(crate) joints: Vec<Joint<'a, 'i>>,
    /// Each link with the joint that carries it; `None` for the root.
    carried: BTreeMap<&'a str, Option<usize>>,
    links: Vec<&'a str>,
    root: &'a str,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Ends<'a> {
    pub(crate) base: &'a str,
    pub(crate) tip: &'a str,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<'t, 'a, 'i> {
    pub(crate) joint: &'t Joint<'a, 'i>,
    pub(crate) is_up: bool,
}

impl Joint<'_, '_> {
    pub(crate) fn line(&self) -> u32 {
        line(self.node)
    }
}

impl<'a, 'i> Tree<'a, 'i> {
    /// The tree of a document; an error where it is none.
    pub(crate) fn of(document: &'a Document<'i>) -> Result<Self> {
        let root = document.root_element();
        if root.tag_name().name() != "robot" {
            let found = root.tag_name().name().escape_debug().to_string();
            return Err(UrdfError::NotRobot { line: line(root), found });
        }
        let nodes = named(root, "link")?;
        let joints = joints(root)?;
        let mut tree = Self {
            robot: attribute(root, "name").unwrap_or_default(),
            carried: nodes.iter().map(|(name, _)| (*name, None)).collect(),
            links: nodes.iter().map(|(name, _)| *name).collect(),
            joints,
            root: "",
        };
        tree.carry()?;
        tree.refuse_circles()?;
        tree.root = tree.only_root(&nodes)?;
        Ok(tree)
    }

    /// Notes for each link the joint that carries it.
    fn carry(&mut self) -> Result<()> {
        for (place, joint) in self.joints.iter().enumerate() {
            self.check_links(joint)?;
            let before = self.carried.insert(joint.child, Some(place)).flatten();
            if let Some(other) = before.map(|before| &self.joints[before]) {
                return Err(UrdfError::TwoParents {
                    line: joint.line(),
                    joint: joint.name.to_owned(),
                    link: joint.child.to_owned(),
                    other: other.name.to_owned(),
                    other_line: other.line(),
                });
            }
        }
        Ok(())
    }

    fn check_links(&self, joint: &Joint<'a, 'i>) -> Result<()> {
        let ends = [("parent", joint.parent), ("child", joint.child)];
        let unknown = ends.into_iter().find(|(_, link)| !self.carried.contains_key(link));
        unknown.map_or(Ok(()), |(role, link)| {
            let (line, joint) = (joint.line(), joint.name.to_owned());
            let (link, links) = (link.to_owned(), self.names());
            Err(UrdfError::UnknownLink { line, joint, role, link, links })
        })
    }

    fn names(&self) -> Vec<String> {
        self.links.iter().map(|link| (*link).to_owned()).collect()
    }

    fn carrier(&self, link: &str) -> Option<&Joint<'a, 'i>> {
        let place = *self.carried.get(link)?;
        place.map(|place| &self.joints[place])
    }

    /// Walks up from every link once; a walk that comes upon itself is a circle.
    fn refuse_circles(&self) -> Result<()> {
        // The link from which each link was first walked over.
        let mut walked: BTreeMap<&str, &str> = BTreeMap::new();
        for &start in &self.links {
            let mut link = start;
            while !walked.contains_key(link) {
                walked.insert(link, start);
                let Some(joint) = self.carrier(link) else { break };
                link = joint.parent;
                if walked.get(link) == Some(&start) {
                    return Err(self.circle(link));
                }
            }
        }
        Ok(())
    }

    fn circle(&self, link: &str) -> UrdfError {
        let mut around: Vec<_> = self.upwards(link).take(self.joints.len()).collect();
        let end = around.iter().position(|joint| joint.parent == link);
        around.truncate(end.map_or(around.len(), |end| end + 1));
        let closing = around.iter().max_by_key(|joint| joint.node.range().start);
        UrdfError::Circle {
            line: closing.map_or(0, |joint| joint.line()),
            joint: closing.map_or_else(String::new, |joint| joint.name.to_owned()),
            count: around.len(),
            link: link.to_owned(),
        }
    }

    fn only_root(&self, nodes: &[(&'a str, Node<'a, 'i>)]) -> Result<&'a str> {
        let is_root = |(name, _): &&(&'a str, Node<'a, 'i>)| self.carrier(name).is_none();
        let roots: Vec<_> = nodes.iter().filter(is_root).collect();
        match roots.as_slice() {
            [(only, _)] => Ok(only),
            [] => Err(UrdfError::NoLinks),
            several => {
                let told = several.iter().take(100);
                let told = told.map(|(name, node)| ((*name).to_owned(), line(*node)));
                Err(UrdfError::Roots { roots: told.collect() })
            }
        }
    }

    pub(crate) fn ends(&self, selection: &Selection) -> Result<Ends<'a>> {
        let base = self.end("base", selection.base.as_deref())?;
        let base = base.unwrap_or(self.root);
        let tip = match self.end("tip", selection.tip.as_deref())? {
            Some(tip) => tip,
            None => self.only_leaf(base)?,
        };
        if base == tip {
            return Err(UrdfError::OneLink { link: base.to_owned(), links: self.names() });
        }
        Ok(Ends { base, tip })
    }

    fn end(&self, role: &'static str, chosen: Option<&str>) -> Result<Option<&'a str>> {
        let Some(link) = chosen else { return Ok(None) };
        match self.carried.get_key_value(link) {
            Some((own, _)) => Ok(Some(own)),
            None => Err(UrdfError::NoSuchEnd { role, link: link.to_owned(), links: self.names() }),
        }
    }

    /// The only link behind `base` that carries none.
    fn only_leaf(&self, base: &'a str) -> Result<&'a str> {
        let mut behind: BTreeMap<&str, Vec<&'a str>> = BTreeMap::new();
        for joint in &self.joints {
            behind.entry(joint.parent).or_default().push(joint.child);
        }
        let (mut leaves, mut open) = (Vec::new(), vec![base]);
        while let Some(link) = open.pop() {
            match behind.get(link) {
                Some(next) => open.extend(next.iter().rev()),
                None => leaves.push(link),
            }
        }
        match leaves.as_slice() {
            [only] => Ok(only),
            several => Err(UrdfError::SeveralTips {
                base: base.to_owned(),
                leaves: several.iter().map(|link| (*link).to_owned()).collect(),
            }),
        }
    }

    /// The joints from base to tip: up to the link that both stand on, and down.
    pub(crate) fn steps(&self, ends: &Ends<'_>) -> Vec<Step<'_, 'a, 'i>> {
        let mut up: Vec<_> = self.upwards(ends.base).collect();
        let mut down: Vec<_> = self.upwards(ends.tip).collect();
        let is_shared = |up: &[&Joint<'_, '_>], down: &[&Joint<'_, '_>]| match (up, down) {
            ([.., a], [.., b]) => a.name == b.name,
            _ => false,
        };
        while is_shared(&up, &down) {
            up.pop();
            down.pop();
        }
        let up = up.into_iter().map(|joint| Step { joint, is_up: true });
        let down = down.into_iter().rev();
        up.chain(down.map(|joint| Step { joint, is_up: false })).collect()
    }

    /// The joints from a link to the root; without end where they close a circle.
    fn upwards(&self, link: &str) -> impl Iterator<Item = &Joint<'a, 'i>> {
        let up = |joint: &&Joint<'a, 'i>| self.carrier(joint.parent);
        std::iter::successors(self.carrier(link), up)
    }
}

/// Whether a node is of the namespace of xacro, whose declaration alone stays in expanded files.
pub(super) fn is_xacro(node: &Node<'_, '_>) -> bool {
    node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
}

/// An error where an element of xacro stands in the node, or is it.
pub(super) fn refuse_xacro(own: Node<'_, '_>) -> Result<()> {
    own.descendants().find(is_xacro).map_or(Ok(()), |node| {
        let found = format!("xacro:{}", node.tag_name().name());
        Err(UrdfError::Xacro { line: line(node), found })
    })
}

/// A text of the file; an error where it is still to be expanded.
pub(crate) fn expanded<'a>(node: Node<'a, '_>, text: &'a str) -> Result<&'a str> {
    if text.contains("${") || text.contains("$(") {
        return Err(UrdfError::Xacro { line: line(node), found: text.to_owned() });
    }
    Ok(text)
}

/// Elements of the robot with their names, in order; an error where two have one.
fn named<'a, 'i>(robot: Node<'a, 'i>, kind: &'static str) -> Result<Vec<(&'a str, Node<'a, 'i>)>> {
    let mut all = Vec::new();
    let mut seen = BTreeMap::new();
    for node in children(robot, kind) {
        let element = format!("a <{kind}>");
        let nameless = || UrdfError::Incomplete { line: line(node), element, wanted: "name" };
        let name = expanded(node, attribute(node, "name").ok_or_else(nameless)?)?;
        if let Some(first) = seen.insert(name, node) {
            let (line, first) = (line(node), line(first));
            return Err(UrdfError::Twice { line, kind, name: name.to_owned(), first });
        }
        all.push((name, node));
    }
    Ok(all)
}

fn joints<'a, 'i>(robot: Node<'a, 'i>) -> Result<Vec<Joint<'a, 'i>>> {
    let with_links = |(name, node): (&'a str, Node<'a, 'i>)| {
        let (parent, child) = (end(node, name, "parent")?, end(node, name, "child")?);
        Ok(Joint { node, name, parent, child })
    };
    named(robot, "joint")?.into_iter().map(with_links).collect()
}

fn end<'a>(joint: Node<'a, '_>, name: &str, role: &'static str) -> Result<&'a str> {
    let link = child(joint, role).and_then(|end| attribute(end, "link"));
    let link = link.ok_or_else(|| UrdfError::Incomplete {
        line: line(joint),
        element: format!("joint {name:?}"),
        wanted: if role == "parent" { "<parent link=\"…\"/>" } else { "<child link=\"…\"/>" },
    })?;
    expanded(joint, link)
}
