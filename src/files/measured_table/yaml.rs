//! YAML → values. The parser gives events one by one; depth and number of values are bounded here, aliases included.

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, Span};

use super::number::Numbers;
use super::tree::{Document, Keys, MOST_LEVELS, MOST_NODES, Map, Node};
use super::{Counted, Form, MeasuredTable, MeasuredTableErrorKind, Result, decoded, tree};

pub(super) fn read(bytes: &[u8], form: &Form) -> Result<MeasuredTable> {
    let decoded = decoded::decode(bytes)?;
    let mut builder = Builder::default();
    let mut parser = Parser::new_from_str(&decoded.text);
    while let Some(event) = parser.next_event() {
        let (event, span) = event.map_err(|error| scan(&error))?;
        builder.event(event, span)?;
    }
    if builder.roots.is_empty() {
        return Err(MeasuredTableErrorKind::Empty);
    }
    let (roots, counted) = (builder.roots, Counted::Line);
    tree::table(&Document { roots, counted }, form)
}

fn scan(error: &ScanError) -> MeasuredTableErrorKind {
    let place = error.marker();
    let (line, column) = (place.line() as u64, place.col() + 1);
    MeasuredTableErrorKind::Yaml { line, column, problem: error.info().to_owned() }
}

/// A list or mapping whose end has not come.
struct Open {
    node: Node,
    /// The key whose value comes next, and its line.
    key: Option<(String, u64)>,
    line: u64,
    anchor: usize,
    /// Mappings whose members it has where it has none of its own.
    merged: Vec<Map>,
}

impl Open {
    fn closed(self) -> Node {
        let Node::Map(mut map) = self.node else { return self.node };
        if !self.merged.is_empty() {
            let own = map.members.iter().map(|(key, _)| Rc::clone(key));
            let mut known: HashSet<Rc<str>> = own.collect();
            let merged = self.merged.into_iter().flat_map(|merged| merged.members);
            let others = merged.filter(|(key, _)| known.insert(Rc::clone(key)));
            map.members.extend(others);
        }
        Node::Map(map)
    }
}

/// Number of values, and levels, of a value.
#[derive(Clone, Copy)]
struct Size {
    nodes: usize,
    levels: usize,
}

impl Size {
    fn of(node: &Node) -> Self {
        let inner = |nodes: &mut dyn Iterator<Item = &Node>| {
            let one = Self { nodes: 1, levels: 1 };
            nodes.map(Self::of).fold(one, |sum, own| Self {
                nodes: sum.nodes.saturating_add(own.nodes),
                levels: sum.levels.max(own.levels + 1),
            })
        };
        match node {
            Node::List(list) => inner(&mut list.iter()),
            Node::Map(map) => inner(&mut map.members.iter().map(|(_, node)| node)),
            _ => Self { nodes: 1, levels: 1 },
        }
    }
}

#[derive(Default)]
struct Builder {
    roots: Vec<(u64, Node)>,
    open: Vec<Open>,
    anchors: HashMap<usize, (Node, Size)>,
    keys: Keys,
    numbers: Numbers,
    nodes: usize,
}

impl Builder {
    fn event(&mut self, event: Event<'_>, span: Span) -> Result<()> {
        let line = span.start.line() as u64;
        match event {
            Event::Scalar(text, style, anchor, _) => {
                if self.takes_key() {
                    self.key(text.into_owned(), line);
                    return Ok(());
                }
                let node = self.scalar(&text, style);
                self.value(node, line, anchor)
            }
            Event::SequenceStart(anchor, _) => self.begin(Node::List(Vec::new()), line, anchor),
            Event::MappingStart(anchor, _) => {
                let map = Map { line, members: Vec::new() };
                self.begin(Node::Map(map), line, anchor)
            }
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(open) => {
                    let (line, anchor) = (open.line, open.anchor);
                    self.value(open.closed(), line, anchor)
                }
                None => Ok(()),
            },
            Event::Alias(anchor) => self.alias(anchor, line),
            Event::Nothing
            | Event::StreamStart
            | Event::StreamEnd
            | Event::DocumentStart(_)
            | Event::DocumentEnd => Ok(()),
        }
    }

    /// Whether a key of a mapping comes next.
    fn takes_key(&self) -> bool {
        let last = self.open.last();
        last.is_some_and(|open| matches!(open.node, Node::Map(_)) && open.key.is_none())
    }

    fn key(&mut self, text: String, line: u64) {
        if let Some(open) = self.open.last_mut() {
            open.key = Some((text, line));
        }
    }

    fn begin(&mut self, node: Node, line: u64, anchor: usize) -> Result<()> {
        if self.takes_key() {
            return Err(wrong(line, "a key is a list or a mapping"));
        }
        if self.open.len() >= MOST_LEVELS {
            return Err(wrong(line, "values are nested too deeply"));
        }
        self.open.push(Open { node, key: None, line, anchor, merged: Vec::new() });
        Ok(())
    }

    fn scalar(&self, text: &str, style: ScalarStyle) -> Node {
        if style != ScalarStyle::Plain {
            return Node::Text(text.into());
        }
        match text {
            "" | "~" | "null" | "Null" | "NULL" => Node::Blank,
            ".nan" | ".NaN" | ".NAN" => Node::Number(f64::NAN),
            _ => match self.numbers.parse(text.as_bytes()) {
                Some(number) => Node::Number(number),
                None if matches!(text.trim_start_matches(['+', '-']), ".inf" | ".Inf" | ".INF") => {
                    Node::Number(f64::NAN)
                }
                None => Node::Text(text.into()),
            },
        }
    }

    /// Takes a value that is complete into the list, the mapping or the document that it belongs to.
    fn value(&mut self, node: Node, line: u64, anchor: usize) -> Result<()> {
        self.count(1)?;
        if anchor > 0 {
            let size = Size::of(&node);
            self.count(size.nodes)?;
            self.anchors.insert(anchor, (node.clone(), size));
        }
        let Some(open) = self.open.last_mut() else {
            self.roots.push((line, node));
            return Ok(());
        };
        match &mut open.node {
            Node::List(list) => list.push(node),
            Node::Map(map) => {
                let (key, line) = open.key.take().unwrap_or_default();
                match node {
                    Node::Map(merged) if key == "<<" => open.merged.push(merged),
                    // A record is looked up by its key.
                    Node::Map(own) => {
                        let own = Node::Map(Map { line, ..own });
                        map.members.push((self.keys.one(&key), own));
                    }
                    node => map.members.push((self.keys.one(&key), node)),
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn alias(&mut self, anchor: usize, line: u64) -> Result<()> {
        if self.takes_key() {
            return Err(wrong(line, "an alias stands for a key"));
        }
        let Some((node, size)) = self.anchors.get(&anchor) else {
            return Err(wrong(line, "an alias stands for no value above it"));
        };
        if self.open.len() + size.levels > MOST_LEVELS {
            return Err(wrong(line, "values are nested too deeply"));
        }
        let (node, nodes) = (node.clone(), size.nodes);
        self.count(nodes)?;
        self.value(node, line, 0)
    }

    fn count(&mut self, nodes: usize) -> Result<()> {
        self.nodes = self.nodes.saturating_add(nodes);
        if self.nodes > MOST_NODES {
            return Err(MeasuredTableErrorKind::TooManyCells);
        }
        Ok(())
    }
}

fn wrong(line: u64, problem: &str) -> MeasuredTableErrorKind {
    MeasuredTableErrorKind::Yaml { line, column: 1, problem: problem.to_owned() }
}
