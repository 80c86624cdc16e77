//! Words in the name of a column: `measurement_std_x`, `T1.X`, `J1[deg]` and `Winkel Achse 3 (°)` in one form.

use crate::ingest::{AngleUnit, LengthUnit};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StatedUnit {
    Angle(AngleUnit),
    Length(LengthUnit),
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Named {
    /// Its words in small letters, numbers by themselves, the unit left out.
    pub words: Vec<String>,
    pub unit: Option<StatedUnit>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    Joint,
    Turn,
    Deviation,
    Difference,
    Command,
    Measured,
    Controller,
    Other,
    Time,
    Temperature,
    Session,
    Station,
    Target,
}

const SENSES: &[(Sense, &str)] = &[
    (
        Sense::Joint,
        "joint joints jnt j q qs a ax axis axes achse achsen achswinkel gelenk gelenke gelenkwinkel theta th phi angle angles ang \
         winkel encoder enc motor art jp jpos",
    ),
    (
        Sense::Turn,
        "r q rot rotation rpy euler orientation orient ori quat quaternion rotvec rv angle angles winkel drehung wpr abc",
    ),
    (
        Sense::Deviation,
        "std stdev stddev sd sigma s unc uncertainty u streuung stabw standardabweichung",
    ),
    (
        Sense::Difference,
        "dif diff difference delta d err error abweichung differenz offset residual",
    ),
    (
        Sense::Command,
        "goal command commanded cmd nominal nom desired des set setpoint soll planned plan theo theoretical ref reference wanted",
    ),
    (
        Sense::Measured,
        "measurement measured measure meas mess gemessen tracker laser leica faro smr reflector reflektor prism marker camera cam \
         mocap optitrack vicon observed obs probe lt at",
    ),
    (Sense::Controller, "actual act ist robot controller fk forward tcp tool flange flansch ee"),
    (
        Sense::Other,
        "vel velocity speed v acc acceleration force torque effort current strom moment wrench f i load weight",
    ),
    (Sense::Time, "time timestamp stamp date datum zeit datetime sec secs uhrzeit"),
    (Sense::Temperature, "temperature temperatur temp"),
    (
        Sense::Session,
        "session sitzung run day date tag series serie messreihe batch experiment trial",
    ),
    (
        Sense::Station,
        "station pose index idx no nr id step order config configuration punkt position nummer key",
    ),
    (Sense::Target, "target reflector reflektor smr ziel zielmarke marker prism point name tgt"),
];

pub fn has_sense(word: &str, sense: Sense) -> bool {
    let compound = ["joint", "gelenk", "achse"];
    let lists = SENSES.iter().filter(|(own, _)| *own == sense);
    let listed = lists.flat_map(|(_, words)| words.split_whitespace()).any(|own| own == word);
    listed || (sense == Sense::Joint && compound.iter().any(|part| word.contains(part)))
}

impl Named {
    /// The words of a column's name, with the unit in a line of units where the name states none.
    pub fn of(name: &str, unit_line: Option<&str>) -> Self {
        let (rest, bracketed) = without_brackets(name);
        let mut words = words(&rest);
        let mut unit = bracketed.as_deref().and_then(unit).or_else(|| unit_line.and_then(unit));
        let last = words.last().filter(|_| words.len() > 1).and_then(|word| unit_word(word));
        if let Some(own) = last {
            words.pop();
            unit = unit.or(Some(own));
        }
        Self { words, unit }
    }

    pub fn has(&self, sense: Sense) -> bool {
        any_has(&self.words, sense)
    }
}

pub fn any_has(words: &[String], sense: Sense) -> bool {
    words.iter().any(|word| has_sense(word, sense))
}

/// A name without a unit in brackets or behind a stroke, and that unit. A number in brackets is an index and stays.
fn without_brackets(name: &str) -> (String, Option<String>) {
    let closed = [('[', ']'), ('(', ')'), ('{', '}')];
    for (open, close) in closed {
        let Some((start, end)) = name.find(open).zip(name.rfind(close)).filter(|(a, b)| a < b)
        else {
            continue;
        };
        let inside = name[start + open.len_utf8()..end].trim();
        if unit(inside).is_some() {
            let rest = format!("{} {}", &name[..start], &name[end + close.len_utf8()..]);
            return (rest, Some(inside.to_owned()));
        }
    }
    match name.rsplit_once('/') {
        Some((rest, inside)) if unit(inside).is_some() => {
            (rest.to_owned(), Some(inside.trim().to_owned()))
        }
        _ => (name.to_owned(), None),
    }
}

/// The unit that a text states; `None` where it states none, or one of something else.
pub fn unit(text: &str) -> Option<StatedUnit> {
    let text = text.trim().trim_matches(|c| "[](){}".contains(c)).to_lowercase();
    match text.as_str() {
        "m" | "meter" | "metre" | "meters" | "metres" => Some(StatedUnit::Length(LengthUnit::M)),
        "grad" | "°" => Some(StatedUnit::Angle(AngleUnit::Deg)),
        other => unit_word(other),
    }
}

/// The unit of a word that can stand at the end of a name without brackets.
fn unit_word(word: &str) -> Option<StatedUnit> {
    match word {
        "mm" | "millimeter" | "millimetre" => Some(StatedUnit::Length(LengthUnit::Mm)),
        "deg" | "degree" | "degrees" => Some(StatedUnit::Angle(AngleUnit::Deg)),
        "rad" | "radian" | "radians" => Some(StatedUnit::Angle(AngleUnit::Rad)),
        _ => None,
    }
}

#[derive(PartialEq, Eq, Clone, Copy)]
enum Kind {
    Small,
    Large,
    Digit,
    None,
}

impl Kind {
    fn of(c: char) -> Self {
        match c {
            c if c.is_numeric() => Self::Digit,
            c if c.is_uppercase() => Self::Large,
            c if c.is_alphabetic() => Self::Small,
            _ => Self::None,
        }
    }
}

/// The words of a text: ended by other signs, between letters and digits, and before a large letter after a small one.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = Kind::None;
    for c in text.chars() {
        let kind = Kind::of(c);
        let goes_on = match (before, kind) {
            (_, Kind::None) => false,
            (Kind::Large, Kind::Small) => true,
            (before, kind) => before == kind,
        };
        if !goes_on {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| kind != Kind::None) {
            word.push(c);
        }
        before = kind;
    }
    let words = words.iter().filter(|word| !word.is_empty());
    words.flat_map(|word| large_then_small(word)).collect()
}

/// A word of large letters with one small one behind them is two: `TCPx`.
fn large_then_small(word: &str) -> Vec<String> {
    let large = word.chars().take_while(|c| c.is_uppercase()).count();
    if large < 2 || word.chars().count() != large + 1 {
        return vec![word.to_lowercase()];
    }
    let end = word.char_indices().nth(large).map_or(word.len(), |(at, _)| at);
    [&word[..end], &word[end..]].map(str::to_lowercase).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(name: &str) -> (String, Option<StatedUnit>) {
        let named = Named::of(name, None);
        (named.words.join(" "), named.unit)
    }

    #[test]
    fn names_of_all_manners_are_words() {
        let cases = [
            ("measurement_std_x", "measurement std x"),
            ("T1.X", "t 1 x"),
            ("T1_x", "t 1 x"),
            ("X1", "x 1"),
            ("target_joints[0]", "target joints 0"),
            ("shoulder_pan_joint", "shoulder pan joint"),
            ("TCPx", "tcp x"),
            ("measX", "meas x"),
            ("Goal x", "goal x"),
            ("/arm/joint_1", "arm joint 1"),
        ];
        for (name, words) in cases {
            assert_eq!(told(name), (words.to_owned(), None), "{name}");
        }
    }

    #[test]
    fn units_in_names_are_no_words_of_theirs() {
        let deg = Some(StatedUnit::Angle(AngleUnit::Deg));
        let mm = Some(StatedUnit::Length(LengthUnit::Mm));
        assert_eq!(told("J1[deg]"), ("j 1".to_owned(), deg));
        assert_eq!(told("Achse 3 (°)"), ("achse 3".to_owned(), deg));
        assert_eq!(told("X / mm"), ("x".to_owned(), mm));
        assert_eq!(told("pos_x_mm"), ("pos x".to_owned(), mm));
        assert_eq!(told("q1_rad"), ("q 1".to_owned(), Some(StatedUnit::Angle(AngleUnit::Rad))));
        // A unit of something else is no word to go by, and no unit.
        assert_eq!(told("x [N]").1, None);
        assert_eq!(Named::of("x", Some("[mm]")).unit, mm);
    }

    #[test]
    fn compound_words_of_joints_are_known() {
        assert!(has_sense("achse", Sense::Joint) && has_sense("jointangle", Sense::Joint));
        assert!(!has_sense("x", Sense::Joint));
    }
}
