//! `/POS` → positions: `P[1:"name"]{ GP1: UF : 1, UT : 2, CONFIG : 'N U T, 0, 0, 0', X = 1.000 mm, … };`, or `J1= 1.000 deg, …`.

use std::ops::Range;

use crate::lex::{Kind, capitals};
use crate::program::{Shape, Stated, Turn};
use crate::refusal::Refusal;
use crate::value::{Cursor, Letters, Number};

pub(super) struct Listed {
    pub(super) line: u32,
    pub(super) shape: Result<Shape, Refusal>,
    pub(super) external: Option<(String, String)>,
    /// Numbers of its user frame and its tool; `None` for those that are set.
    pub(super) frames: [Option<u32>; 2],
    pub(super) span: Range<usize>,
    /// Its index among the positions, once a motion uses it.
    pub(super) position: Option<usize>,
    /// What statements other than motions do with it.
    pub(super) obstacle: Option<Refusal>,
}

enum Field<'t> {
    Number(Number),
    /// `F`: the one that is set.
    Current,
    Config(Cursor<'t>),
    /// `********`: never taught.
    Blank,
}

type Fields<'t> = Vec<(String, Field<'t>)>;

/// The number of an element: `1` of `P[1]`; `None` where it is worked out.
pub(super) fn number(mut inside: Cursor<'_>) -> Option<u32> {
    let number = inside.take_number()?;
    inside.is_empty().then(|| whole(&number)).flatten()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and small")]
pub(super) fn whole(number: &Number) -> Option<u32> {
    let is_whole = number.value.fract() == 0.0 && (0.0..1e9).contains(&number.value);
    is_whole.then_some(number.value as u32)
}

/// All entries with their numbers. Each begins with `P[` at the begin of a line.
pub(super) fn entries(all: Cursor<'_>) -> Vec<(u32, Listed)> {
    let tokens = all.tokens;
    let is_first = |place: usize| place == 0 || tokens[place - 1].line != tokens[place].line;
    let is_head = |place: &usize| {
        is_first(*place)
            && tokens[*place].kind == Kind::Name
            && capitals(all.text(&tokens[*place])) == "P"
            && tokens.get(place + 1).is_some_and(|next| next.is(b'['))
    };
    let mut heads: Vec<usize> = (0..tokens.len()).filter(is_head).collect();
    heads.push(tokens.len());
    let entries = heads.windows(2).map(|ends| Cursor { tokens: &tokens[ends[0]..ends[1]], ..all });
    entries.filter_map(entry).collect()
}

fn entry(own: Cursor<'_>) -> Option<(u32, Listed)> {
    let mut rest = Cursor { tokens: own.tokens.get(2..)?, ..own };
    let number = number(rest.take_part(b']')?)?;
    let is_open = rest.take_sign(b'{');
    let left = rest.tokens.len();
    let body = rest.take_part(b'}').filter(|body| is_open && body.tokens.len() < left);
    let groups = body.map(groups).unwrap_or_default();
    let first = groups.iter().find(|(name, _)| name == "GP1").map(|(_, fields)| fields);
    let frame = |name| match first?.iter().find(|(own, _)| own == name)? {
        (_, Field::Number(number)) => whole(number),
        _ => None,
    };
    let frames = ["UF", "UT"].map(frame);
    let listed = Listed {
        line: own.first()?.line,
        shape: first.map_or_else(|| Err(no_group()), |fields| shape(fields, &groups)),
        external: external(&groups),
        frames,
        span: own.span(),
        position: None,
        obstacle: None,
    };
    Some((number, listed))
}

fn no_group() -> Refusal {
    Refusal::Other("its entry under /POS has no group GP1 that ends; give the whole listing of a program of the first group".to_owned())
}

/// Groups `GP1:` with their fields.
fn groups(body: Cursor<'_>) -> Vec<(String, Fields<'_>)> {
    let mut rest = body;
    let mut groups: Vec<(String, Fields<'_>)> = Vec::new();
    while !rest.is_empty() {
        let Some(name) = rest.take_name() else {
            rest.take();
            continue;
        };
        if !(rest.take_sign(b':') || rest.take_sign(b'=')) {
            continue;
        }
        if name.starts_with("GP") {
            groups.push((name, Vec::new()));
        } else if let Some((_, fields)) = groups.last_mut() {
            fields.push((name, field(&mut rest)));
        }
    }
    groups
}

fn field<'t>(rest: &mut Cursor<'t>) -> Field<'t> {
    if rest.take_sign(b'\'') {
        return rest.take_part(b'\'').map_or(Field::Blank, Field::Config);
    }
    if rest.take_word("F") {
        return Field::Current;
    }
    rest.take_number().map_or(Field::Blank, Field::Number)
}

fn shape(fields: &Fields<'_>, groups: &[(String, Fields<'_>)]) -> Result<Shape, Refusal> {
    let is_arm = |(name, _): &&(String, Field<'_>)| {
        matches!(name.as_str(), "X" | "J4" | "CONFIG" | "KONFIG")
    };
    let mut others = groups.iter().filter(|(name, _)| name != "GP1");
    if let Some((name, _)) = others.find(|(_, fields)| fields.iter().any(|own| is_arm(&own))) {
        return Err(Refusal::Other(format!(
            "its {name} is of a second arm; such positions are not corrected"
        )));
    }
    let number = |name: &str| -> Result<Number, Refusal> {
        let mut own = fields.iter().filter(|(own, _)| own == name);
        match (own.next(), own.next()) {
            (Some((_, Field::Number(number))), None) => Ok(number.clone()),
            (None, _) => Err(Refusal::Partial { what: "X, Y, Z, W, P, R or all of its joints" }),
            _ => Err(Refusal::Other(format!(
                "its {name} has no value; teach it, or take it out of the program"
            ))),
        }
    };
    if fields.iter().any(|(name, _)| name == "J1") {
        let joints = (1..=9).map(|joint| format!("J{joint}"));
        let joints = joints.take_while(|joint| fields.iter().any(|(name, _)| name == joint));
        return joints.map(|joint| number(&joint)).collect::<Result<_, _>>().map(Shape::Joints);
    }
    let xyz = [number("X")?, number("Y")?, number("Z")?];
    // W, P, R turn about the fixed x, y, z: A, B, C of KUKA in the other order.
    let turn = Turn::Abc([number("R")?, number("P")?, number("W")?]);
    let stated = fields.iter().find_map(|(_, field)| match field {
        Field::Config(text) => config(*text),
        _ => None,
    });
    Ok(Shape::Pose { xyz, turn, stated })
}

/// `N U T, 0, 0, 0`; `None` where it is in another form.
fn config(mut text: Cursor<'_>) -> Option<Stated> {
    let mut letter = |is: &str, other: &str| {
        let word = text.take_name()?;
        text.take_sign(b',');
        (word == is || word == other).then_some(word == is)
    };
    let letters =
        Letters { flip: letter("F", "N")?, down: letter("D", "U")?, back: letter("B", "T")? };
    let mut turn = || {
        let turn = text.take_number();
        text.take_sign(b',');
        turn
    };
    let turns = [turn()?, turn()?, turn()?];
    text.is_empty().then_some(Stated::Config { letters, turns })
}

/// An extended axis that is not at 0, or the first axis of a further group.
fn external(groups: &[(String, Fields<'_>)]) -> Option<(String, String)> {
    let told = |field: &Field<'_>| match field {
        Field::Number(number) => number.value.to_string(),
        _ => "no number".to_owned(),
    };
    let is_moved = |field: &Field<'_>| !matches!(field, Field::Number(own) if own.value == 0.0);
    let mut all =
        groups.iter().flat_map(|(group, fields)| fields.iter().map(move |own| (group, own)));
    all.find_map(|(group, (name, field))| match (group.as_str(), name.as_str()) {
        ("GP1", "E1" | "E2" | "E3") if is_moved(field) => Some((name.clone(), told(field))),
        ("GP1", _) => None,
        (group, name) if name.starts_with('J') => Some((format!("{name} of {group}"), told(field))),
        _ => None,
    })
}
