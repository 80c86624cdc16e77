//! Expressions of frames: `BASE_DATA[1]`, `{X …}`, `$NULLFRAME`, FDAT.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::Reading;
use crate::flow::{Known, Setting, known, unknown};
use crate::frame::Chain;
use crate::names::Written;
use crate::names::{Scope, parts};
use crate::reading::Here;
use crate::refusal::Refusal;
use crate::value::{Cursor, Value};

/// `{X, Y, Z, A, B, C}` as an isometry: mm, and `Rz(A) Ry(B) Rx(C)` in degrees.
pub(super) fn isometry(value: &Value) -> Option<Isometry3<f64>> {
    let number = |name| value.number_of(name).map(|number| number.value);
    let at = Translation3::new(number("X")?, number("Y")?, number("Z")?);
    Some(Isometry3::from_parts(at, abc([number("A")?, number("B")?, number("C")?])))
}

/// `Rz(A) Ry(B) Rx(C)`, degrees.
pub fn abc(degrees: [f64; 3]) -> UnitQuaternion<f64> {
    let [a, b, c] = degrees.map(f64::to_radians);
    UnitQuaternion::from_euler_angles(c, b, a)
}

impl Reading<'_> {
    /// The frames of an expression; `variable` is what they are set to.
    pub(super) fn frames(&self, here: &Here<'_>, variable: &str, expression: Cursor<'_>) -> Known {
        let mut chain = Chain::default();
        let mut rest = expression;
        while let Some(part) = rest.take_part(b':') {
            match self.frame(here, variable, part) {
                Ok(frames) => chain.0.extend(frames.0),
                Err(why) => return unknown(why),
            }
        }
        known(Setting::Frames(chain))
    }

    fn frame(&self, here: &Here<'_>, variable: &str, part: Cursor<'_>) -> Result<Chain, Refusal> {
        let at_run_time =
            || Refusal::AtRunTime { what: variable.to_owned(), at: self.common.at(here) };
        let mut call = part;
        if let Some(name) = call.take_name()
            && call.take_sign(b'(')
            && let Some(arguments) = call.take_part(b')')
        {
            return self.function(here, &name, arguments).unwrap_or_else(|| Err(at_run_time()));
        }
        match part.value() {
            value @ Value::Fields { .. } => {
                let place = isometry(&value).ok_or_else(|| Refusal::NoFrame {
                    name: variable.to_owned(),
                    at: self.common.at(here),
                });
                Ok(Chain::one(variable, place))
            }
            Value::Name(name) => self.named(here.scopes, &name).ok_or_else(at_run_time),
            _ => Err(at_run_time()),
        }
    }

    /// Functions of inline forms: `SBASE(FP1.BASE_NO)`, `STOOL2(FP1)`.
    fn function(
        &self,
        here: &Here<'_>,
        name: &str,
        arguments: Cursor<'_>,
    ) -> Option<Result<Chain, Refusal>> {
        let (field, data) = match name {
            "SBASE" => ("BASE_NO", "BASE_DATA"),
            "STOOL" | "STOOL2" => ("TOOL_NO", "TOOL_DATA"),
            "EK" => {
                let name = "the base (EK)".to_owned();
                return Some(Err(Refusal::Moving { name, at: self.common.at(here) }));
            }
            _ => return None,
        };
        Some(self.field(here, field, arguments).map(|number| self.data_frame(data, number)))
    }

    /// The number of a field of an FDAT: `FP1.BASE_NO`, `FP1`, or a number as it is.
    fn field(&self, here: &Here<'_>, field: &str, of: Cursor<'_>) -> Result<i64, Refusal> {
        let mut rest = of;
        if let Value::Number(number) = of.value() {
            return whole(number.value).ok_or_else(|| self.no_number(here, field));
        }
        let name = rest.element().ok_or_else(|| self.no_number(here, field))?;
        let is_field =
            rest.is_empty() || (rest.take_sign(b'.') && rest.take_word(field) && rest.is_empty());
        if !is_field {
            return Err(self.no_number(here, field));
        }
        let written = self.common.constant(here.scopes, &name)?;
        let number = written.value.number_of(field).and_then(|number| whole(number.value));
        number.ok_or_else(|| self.no_number(here, field))
    }

    fn no_number(&self, here: &Here<'_>, field: &str) -> Refusal {
        Refusal::AtRunTime { what: field.to_owned(), at: self.common.at(here) }
    }

    /// A variable's frame; `None` for what is no frame.
    fn named(&self, scopes: &[Scope], name: &str) -> Option<Chain> {
        let (own, element) = parts(name);
        match own {
            "$NULLFRAME" | "$WORLD" => return Some(Chain::default()),
            "BASE_DATA" | "TOOL_DATA" if !element.is_empty() => {
                let number = element.trim_matches(['[', ']']).parse().ok()?;
                return Some(self.data_frame(own, number));
            }
            own if own.starts_with('$') && own != "$ROBROOT" => return None,
            _ => {}
        }
        Some(Chain::one(name, self.value(scopes, name, "the .dat file that declares it")))
    }

    /// `BASE_DATA[n]` or `TOOL_DATA[n]`; 0 is the identity.
    pub(super) fn data_frame(&self, data: &str, number: i64) -> Chain {
        if number == 0 {
            return Chain::default();
        }
        let name = format!("{data}[{number}]");
        Chain::one(name.as_str(), self.unmoved(data, number, &name))
    }

    fn unmoved(&self, data: &str, number: i64, name: &str) -> Result<Isometry3<f64>, Refusal> {
        let everywhere = [String::new()];
        let machine = format!("MACHINE_FRAME_DAT[{number}]");
        if data == "BASE_DATA"
            && let Some(own) = self.stated(&everywhere, &machine)?
            && own.value.number_of("MACH_DEF_INDEX").is_some_and(|index| index.value > 0.0)
        {
            let at = self.common.files[own.file].at(own.line);
            return Err(Refusal::Moving { name: name.to_owned(), at });
        }
        self.value(&everywhere, name, "$config.dat")
    }

    /// What files state of a name that may stand in none of them.
    fn stated(&self, scopes: &[Scope], name: &str) -> Result<Option<&Written>, Refusal> {
        match self.common.names.constant(scopes, name, self.common.files, "") {
            Err(Refusal::NotGiven { .. }) => Ok(None),
            own => own.map(Some),
        }
    }

    fn value(&self, scopes: &[Scope], name: &str, give: &str) -> Result<Isometry3<f64>, Refusal> {
        let names = &self.common.names;
        let written = names.constant(scopes, name, self.common.files, give)?;
        let at = self.common.files[written.file].at(written.line);
        if names.find(scopes, parts(name).0).is_some_and(|own| !own.is_declared) {
            return Err(Refusal::Other(format!(
                "{name} is written in {at}, and what it is before that is in no file given; give {give}"
            )));
        }
        isometry(&written.value).ok_or(Refusal::NoFrame { name: name.to_owned(), at })
    }

    /// Base, tool and mode of an FDAT, by its name or written out.
    pub(super) fn inline(&mut self, here: &Here<'_>, expression: Cursor<'_>) -> Known {
        let value = match expression.value() {
            Value::Name(name) => match self.common.constant(here.scopes, &name) {
                Ok(written) => written.value.clone(),
                Err(why) => return unknown(why),
            },
            value => value,
        };
        let number = |field| value.number_of(field).and_then(|number| whole(number.value));
        let (Some(base), Some(tool)) = (number("BASE_NO"), number("TOOL_NO")) else {
            return unknown(self.no_number(here, "BASE_NO"));
        };
        let mode = match value.field("IPO_FRAME") {
            Some(Value::Name(name)) if name == "#BASE" => known(Setting::On(true)),
            None => unknown(self.no_number(here, "IPO_FRAME")),
            Some(_) => unknown(Refusal::FixedTool { at: self.common.at(here) }),
        };
        let frames = [("BASE_DATA", base), ("TOOL_DATA", tool)]
            .map(|(data, number)| known(Setting::Frames(self.data_frame(data, number))));
        let [base, tool] = frames;
        known(Setting::Inline(Box::new([base, tool, mode])))
    }

    /// `$ROBROOT`: the arm's base in `$WORLD`.
    pub(super) fn root(&self) -> Chain {
        Chain::one("$ROBROOT", self.standing())
    }

    /// An error where a linear unit carries the arm.
    fn standing(&self) -> Result<Isometry3<f64>, Refusal> {
        let everywhere = [String::new()];
        if let Some(own) = self.stated(&everywhere, "$EX_KIN")?
            && let Value::Fields { fields, .. } = &own.value
            && fields.iter().any(|(_, value)| *value == Value::Name("#ERSYS".to_owned()))
        {
            let at = self.common.files[own.file].at(own.line);
            return Err(Refusal::Moving { name: "$ROBROOT".to_owned(), at });
        }
        self.value(&everywhere, "$ROBROOT", "$machine.dat")
    }
}

#[expect(clippy::cast_possible_truncation, reason = "numbers of frames are small")]
pub(super) fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 1e9).then_some(value as i64)
}
