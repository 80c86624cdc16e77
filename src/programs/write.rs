//! Corrected poses → numbers in the places of the old ones, and marks; every other byte stays.
//!
//! A number has as many decimals as the file has for it, and at least those that its dialect takes (`Position::decimals`); no exponent and
//! no −0. A number that is the same when it is read again keeps its text. An orientation that is not corrected keeps its text too.

use std::f64::consts::TAU;

use crate::geometry::rpy;
use crate::geometry::typed::number as decimal;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::ask::{Asked, Wanted, pose};
use crate::edit::{CORRECTED, Edit, insert, line_end};
use crate::krl::{KRL, abc};
use crate::lex::{Kind, Token, after_mark, capitals, tokens};
use crate::program::{File, Further, Position, Shape, Stated, Turn};
use crate::rapid::RAPID;
use crate::urscript::vector_near;
use crate::value::Number;

pub(crate) const QUATERNION_DECIMALS: usize = 8;
/// Joints 1, 4 and 6: those whose turns are counted, in quarters by ABB, whole by FANUC (`$TURN_AXIS`).
pub const COUNTED: [usize; 3] = [0, 3, 5];
/// An orientation that is turned by less is not turned, rad.
const UNTURNED: f64 = 1e-8;

/// The command for a position.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// The tool in the arm's base, mm; of a position in joint angles `None`.
    pub base_from_tool: Option<Isometry3<f64>>,
    /// Joint angles at which the nominal arm has the position, and those of the command, degrees as the controller counts them.
    pub joints: Option<[Vec<f64>; 2]>,
}

/// What a command changes at a position.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Edits {
    pub all: Vec<Edit>,
    /// Joints that cross a border of T or of the quarter turns, so that these are written anew.
    pub crossed: usize,
}

/// Replaces the numbers of one position by those of its command.
pub fn edits(position: &Position, asked: &Asked, command: &Command) -> Edits {
    let mut edits = Edits::default();
    let [mm, degrees] = position.decimals;
    match (&position.shape, &asked.wanted, command) {
        (Ok(Shape::Joints(numbers)), Wanted::Joints(_), Command { joints: Some([_, to]), .. }) => {
            for (number, to) in numbers.iter().zip(to) {
                edits.number(number, *to, degrees);
            }
        }
        (
            Ok(Shape::Pose { xyz, turn, stated }),
            Wanted::Pose { .. },
            Command { base_from_tool: Some(base_from_tool), joints },
        ) => {
            let Some(to) = asked.numbers(base_from_tool) else { return edits };
            edits.place(xyz, &to, mm);
            let before = pose(xyz, turn).map(|pose| pose.rotation);
            if before.is_ok_and(|before| before.angle_to(&to.rotation) > UNTURNED) {
                edits.turn(turn, &to.rotation, degrees);
            }
            if let (Some(stated), Some([from, to])) = (stated, joints) {
                edits.stated(stated, from, to);
            }
        }
        _ => {}
    }
    edits
}

impl Edits {
    fn place(&mut self, xyz: &[Number; 3], to: &Isometry3<f64>, least: usize) {
        for (number, to) in xyz.iter().zip(to.translation.vector.iter()) {
            self.number(number, *to, least);
        }
    }

    fn number(&mut self, number: &Number, to: f64, least: usize) {
        // m and rad have as many more.
        let more = if number.unit > 1.0 { number.unit.log10().round() } else { 0.0 };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0, 2 or 3")]
        let least = least + more as usize;
        let text = decimal(to / number.unit, number.decimals.max(least).min(9));
        self.text(number, text);
    }

    fn text(&mut self, number: &Number, mut text: String) {
        #[expect(clippy::float_cmp, reason = "the same number is the same text")]
        let is_same = text.parse::<f64>().is_ok_and(|value| value * number.unit == number.value);
        if !is_same {
            if number.is_glued && !text.starts_with('-') {
                text.insert(0, ' ');
            }
            self.all.push(Edit { span: number.span.clone(), text });
        }
    }

    fn turn(&mut self, turn: &Turn, to: &UnitQuaternion<f64>, degrees: usize) {
        match turn {
            Turn::Abc(numbers) => {
                let near = numbers.each_ref().map(|number| number.value);
                for (number, to) in numbers.iter().zip(abc_near(to, near)) {
                    self.number(number, to, degrees);
                }
            }
            Turn::Quaternion(numbers) => {
                let near = numbers.each_ref().map(|number| number.value);
                for (number, to) in numbers.iter().zip(quaternion_near(to, near)) {
                    self.text(number, decimal(to, QUATERNION_DECIMALS));
                }
            }
            Turn::Vector(numbers) => {
                let near = numbers.each_ref().map(|number| number.value);
                for (number, to) in numbers.iter().zip(vector_near(to, near)) {
                    self.number(number, to, degrees + 2);
                }
            }
        }
    }

    /// T, and the quarter turns, where a joint crosses a border at which the old ones agree with the joints.
    fn stated(&mut self, stated: &Stated, from: &[f64], to: &[f64]) {
        match stated {
            Stated::Status { turn: Some(turn), .. } => {
                let old = turn.value;
                let mut new = old;
                for (joint, (from, to)) in from.iter().zip(to).take(6).enumerate() {
                    let bit = 2_f64.powi(i32::try_from(joint).unwrap_or_default());
                    let is_set = (old / bit).floor() % 2.0 >= 1.0;
                    if is_set == (*from < 0.0) && is_set != (*to < 0.0) {
                        new += if is_set { -bit } else { bit };
                        self.crossed += 1;
                    }
                }
                self.text(turn, decimal(new, 0));
            }
            Stated::Status { turn: None, .. } | Stated::Near(_) => {}
            Stated::Quadrants(numbers) => {
                let quarter = |degrees: f64| (degrees / 90.0).floor();
                self.counted(numbers, [from, to], quarter);
            }
            Stated::Config { turns, .. } => {
                self.counted(turns, [from, to], whole_turns);
            }
        }
    }

    /// Counts of whole or quarter turns of joints, where those before agree with the position's.
    fn counted(&mut self, numbers: &[Number], [from, to]: [&[f64]; 2], count: impl Fn(f64) -> f64) {
        for (number, joint) in numbers.iter().zip(COUNTED) {
            let counted = |joints: &[f64]| joints.get(joint).map(|degrees| count(*degrees));
            let (from, to) = (counted(from), counted(to));
            if from == Some(number.value)
                && let Some(to) = to.filter(|to| Some(*to) != from)
            {
                self.crossed += 1;
                self.text(number, decimal(to, 0));
            }
        }
    }
}

/// The entry of a position in a listing for a further point, without its number: the same but for its numbers.
pub(crate) fn listed(position: &Position, bytes: &[u8], point: &Further) -> Option<String> {
    let Ok(Shape::Pose { xyz, turn, stated }) = &position.shape else { return None };
    let [mm, degrees] = position.decimals;
    let mut edits = Edits::default();
    edits.place(xyz, &point.frame_from_tool, mm);
    edits.turn(turn, &point.frame_from_tool.rotation, degrees);
    if let Some(Stated::Config { turns, .. }) = stated {
        for (number, joint) in turns.iter().zip(COUNTED) {
            edits.text(number, decimal(whole_turns(*point.joints.get(joint)?), 0));
        }
    }
    let head = bytes[position.span.clone()].iter().position(|byte| *byte == b']')?;
    let span = position.span.start + head..position.span.end;
    for own in &mut edits.all {
        own.span = own.span.start - span.start..own.span.end - span.start;
    }
    String::from_utf8(applied(&bytes[span], &edits.all)).ok()
}

/// Turns of a joint as FANUC counts them: 0 within half a turn.
fn whole_turns(degrees: f64) -> f64 {
    ((degrees + 180.0) / 360.0).floor()
}

/// A, B, C of a rotation, degrees: of all that make it, those nearest to others.
pub(crate) fn abc_near(rotation: &UnitQuaternion<f64>, near: [f64; 3]) -> [f64; 3] {
    let [c, b, a] = rpy(rotation).map(f64::to_degrees);
    let half = 180.0;
    let mut all = vec![[a, b, c], [a + half, half - b, c + half]];
    // Where B is a quarter turn A and C turn about one axis: A stays.
    if b.to_radians().cos() < 1e-3 {
        let behind =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -near[0].to_radians()) * rotation;
        let [c, b, a] = rpy(&behind).map(f64::to_degrees);
        all.extend([[near[0] + a, b, c], [near[0] + a + half, half - b, c + half]]);
    }
    let near_turn = |own: [f64; 3]| {
        let mut own = own;
        for (own, near) in own.iter_mut().zip(near) {
            let turns = ((near - *own) / 360.0).round();
            *own += 360.0 * turns;
            // Within half a turn angles stay within it.
            if near.abs() <= half && own.abs() > half {
                *own -= 360.0 * own.signum();
            }
        }
        own
    };
    let apart = |own: &[f64; 3]| -> f64 {
        let pairs = own.iter().zip(near);
        pairs
            .map(|(own, near)| {
                let apart = (own - near).to_radians();
                (apart - TAU * (apart / TAU).round()).powi(2)
            })
            .sum()
    };
    let near = all.into_iter().map(near_turn).filter(|own| is_of(rotation, own));
    near.min_by(|one, other| apart(one).total_cmp(&apart(other))).unwrap_or([a, b, c])
}

fn is_of(rotation: &UnitQuaternion<f64>, own: &[f64; 3]) -> bool {
    abc(*own).angle_to(rotation) < 1e-7
}

/// Four numbers of a rotation, real part first, of the sign of others and of norm 1 after rounding.
pub(crate) fn quaternion_near(rotation: &UnitQuaternion<f64>, near: [f64; 4]) -> [f64; 4] {
    let own = rotation.quaternion();
    let mut parts = [own.w, own.i, own.j, own.k];
    let along: f64 = parts.iter().zip(near).map(|(own, near)| own * near).sum();
    if along < 0.0 {
        parts = parts.map(|part| -part);
    }
    let digits = 1e8;
    let mut parts = parts.map(|part| (part * digits).round() / digits);
    let largest = (0..4).max_by(|a, b| parts[*a].abs().total_cmp(&parts[*b].abs())).unwrap_or(0);
    let others: f64 =
        (0..4).filter(|place| *place != largest).map(|place| parts[place].powi(2)).sum();
    parts[largest] = parts[largest].signum() * (1.0 - others).max(0.0).sqrt();
    parts
}

/// The constant that marks a corrected file where comments are removed.
const CONSTANT: &str = "POSEGRID_CORRECTED";

/// The line of a file's mark; `None` for a file that is not corrected.
pub fn mark(file: &File) -> Option<u32> {
    let lines = file.bytes.split(|byte| *byte == b'\n');
    let is_mark = |line: &[u8]| {
        let is_before =
            |byte: &u8| matches!(byte, b' ' | b'\t' | b';' | b'!' | b'#' | b':' | b'0'..=b'9');
        let start = line.iter().position(|byte| !is_before(byte));
        let rest = &line[start.unwrap_or(line.len())..];
        let begins = |words: &str| {
            rest.get(..words.len()).is_some_and(|own| own.eq_ignore_ascii_case(words.as_bytes()))
        };
        let has_constant = || {
            line.windows(CONSTANT.len()).any(|own| own.eq_ignore_ascii_case(CONSTANT.as_bytes()))
        };
        begins(CORRECTED) || has_constant()
    };
    let has_mark = |line: &[u8]| line.split(|byte| *byte == b'\r').any(is_mark);
    let found = lines.enumerate().find(|(_, line)| has_mark(line));
    found.and_then(|(place, _)| u32::try_from(place + 1).ok())
}

/// The lines that mark a file as corrected by `words` beside other edits: a comment, and a constant named after `id` where the dialect has one.
pub fn marks(file: &File, words: &str, id: &str, edits: &[Edit]) -> Vec<Edit> {
    let own = crate::DIALECTS.iter().find(|(own, ..)| file.is_of(own));
    own.map_or_else(Vec::new, |(.., marks)| marks(file, &plain(words), &plain(id), edits))
}

/// The comment that marks a file, with its line end.
fn comment(file: &File, words: &str) -> String {
    let sign = file.dialect().map_or(' ', |own| own.comment);
    format!("{sign} {CORRECTED} {words}{}", line_end(&file.bytes))
}

/// The mark as the first line of a file.
pub(crate) fn first_comment(file: &File, words: &str, _: &str, _: &[Edit]) -> Vec<Edit> {
    let (bytes, line) = (&file.bytes, comment(file, words));
    vec![insert(bytes, after_mark(bytes), line, line_end(bytes))]
}

/// The mark behind the head of a module of KRL or RAPID, and the constant.
pub(crate) fn behind_head_marks(file: &File, words: &str, id: &str, edits: &[Edit]) -> Vec<Edit> {
    let end = line_end(&file.bytes);
    let is_rapid = file.is_of(&RAPID);
    let tokens = tokens(&file.bytes, if is_rapid { &RAPID } else { &KRL });
    let id: String = id.replace('"', "?").chars().take(80).collect();
    let line = comment(file, words);
    // Without a head nothing is known of where a declaration may stand.
    let mut marks = match behind_head(file, &tokens, is_rapid) {
        None => first_comment(file, words, &id, edits),
        Some(place) if is_rapid => {
            let constant = format!("LOCAL CONST string posegrid_corrected:=\"{id}\";{end}");
            match behind_types(file, &tokens) {
                Some(types) => vec![
                    insert(&file.bytes, place, line, end),
                    insert(&file.bytes, types, constant, end),
                ],
                None => vec![insert(&file.bytes, place, line + &constant, end)],
            }
        }
        Some(place) => vec![insert(&file.bytes, place, line, end)],
    };
    if let Some(place) = before_end_of_list(file, &tokens)
        && !id.is_empty()
    {
        // A list gives an array of characters its value in a line of its own.
        let text = format!("DECL CHAR {CONSTANT}[{}]{end}{CONSTANT}[]=\"{id}\"{end}", id.len());
        marks.push(Edit { span: place..place, text });
    }
    marks
}

/// The end of the header's line: of `DEF`, `DEFDAT` or `MODULE`; that of the header itself where code follows it in its line.
fn behind_head(file: &File, tokens: &[Token], is_rapid: bool) -> Option<usize> {
    let words: &[&str] = if is_rapid { &["MODULE"] } else { &["DEF", "DEFFCT", "DEFDAT"] };
    let is_head = |token: &Token| {
        token.kind == Kind::Name && words.contains(&capitals(&file.bytes[token.span()]).as_str())
    };
    let head = tokens.iter().position(is_head)?;
    let is_end = |token: &Token| token.kind == Kind::LineEnd;
    let behind = || tokens.iter().enumerate().skip(head);
    let last = if is_rapid {
        let mut words = behind().filter(|(_, token)| !is_end(token)).skip(1);
        let mut name = words.next()?.0;
        // A name of digits too, which no controller takes, is not cut.
        while tokens.get(name + 1).is_some_and(|next| {
            next.kind == Kind::Name && next.span().start == tokens[name].span().end
        }) {
            name = words.next()?.0;
        }
        let has_list = words.next().is_some_and(|(_, token)| token.is(b'('));
        let close = behind().find(|(_, token)| token.is(b')')).filter(|_| has_list);
        close.map_or(name, |(place, _)| place)
    } else {
        behind().find(|(_, token)| is_end(token)).map_or(tokens.len(), |(place, _)| place) - 1
    };
    match tokens.get(last + 1) {
        Some(next) if !is_end(next) => Some(tokens[last].span().end),
        Some(end) => Some(end.span().end),
        None => Some(file.bytes.len()),
    }
}

/// The end of a module's last type: data may be declared only behind types.
fn behind_types(file: &File, tokens: &[Token]) -> Option<usize> {
    let is = |token: &Token, word: &[u8]| {
        token.kind == Kind::Name && file.bytes[token.span()].eq_ignore_ascii_case(word)
    };
    let record = tokens.iter().rposition(|token| is(token, b"ENDRECORD"));
    let alias = tokens.iter().rposition(|token| is(token, b"ALIAS")).and_then(|place| {
        let end = tokens[place..].iter().position(|token| token.is(b';'))?;
        Some(place + end)
    });
    let last = record.max(alias)?;
    match tokens.get(last + 1) {
        Some(next) if next.kind == Kind::LineEnd => Some(next.span().end),
        _ => Some(tokens[last].span().end),
    }
}

/// The line of ENDDAT.
fn before_end_of_list(file: &File, tokens: &[Token]) -> Option<usize> {
    let is_end = |token: &&Token| {
        token.kind == Kind::Name && file.bytes[token.span()].eq_ignore_ascii_case(b"ENDDAT")
    };
    let end = tokens.iter().rev().find(is_end).filter(|_| file.is_list())?;
    let before =
        file.bytes[..end.span().start].iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
    Some(before.map_or(0, |place| place + 1))
}

/// Text that cannot end its comment: printable ASCII only.
fn plain(words: &str) -> String {
    words.chars().map(|letter| if matches!(letter, ' '..='~') { letter } else { '?' }).collect()
}

/// A file with edits, which do not overlap.
pub fn applied(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut written = Vec::with_capacity(bytes.len() + 16 * edits.len());
    let mut copied = 0;
    for edit in in_order(bytes, edits) {
        written.extend(&bytes[copied..edit.span.start]);
        written.extend(edit.text.bytes());
        copied = edit.span.end;
    }
    written.extend(&bytes[copied..]);
    written
}

/// The edits of a file in its order, without those that overlap one before them.
pub(crate) fn in_order<'e>(bytes: &[u8], edits: &'e [Edit]) -> impl Iterator<Item = &'e Edit> {
    let mut sorted: Vec<&Edit> = edits.iter().collect();
    sorted.sort_by_key(|edit| edit.span.start);
    let (mut from, length) = (0, bytes.len());
    sorted.into_iter().filter(move |edit| {
        let is_free = edit.span.start >= from && edit.span.end <= length;
        if is_free {
            from = edit.span.end;
        }
        is_free
    })
}
