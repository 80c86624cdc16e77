//! The reference of keys as text for a person.

use std::fmt;

use super::{Key, KeyReference, KeySection};

impl fmt::Display for KeyReference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Keys of a {} file. {}", self.file, self.about)?;
        writeln!(
            f,
            "A key without default that is not required may be left out. Any other key is an error."
        )?;
        let mut shown = self.sections.iter().filter(|own| !own.keys.is_empty());
        shown.try_for_each(|own| write!(f, "{own}"))
    }
}

impl fmt::Display for KeySection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let required = match &self.common.unless {
            _ if !self.common.required => String::new(),
            None => "  required".to_owned(),
            Some(section) => format!("  required without [{section}]"),
        };
        writeln!(f, "\n{}{required}", self.heading())?;
        writeln!(f, "    {}", self.common.about)?;
        self.keys.iter().try_for_each(|key| write!(f, "{key}"))
    }
}

impl KeySection {
    /// The section as it is written in a file, or the values that these keys are of.
    pub(super) fn heading(&self) -> String {
        if !self.at.is_empty() {
            format!("{} of {}", self.name, self.at.join(", "))
        } else if self.name.is_empty() {
            "top of the file".to_owned()
        } else if self.repeated {
            format!("[[{}]]", self.name)
        } else {
            format!("[{}]", self.name)
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.unit.as_deref().filter(|unit| *unit != "1");
        let (kind, without) = (self.kind.as_str(), self.without());
        let parts = [Some(kind), unit, self.range.as_deref(), Some(&without)];
        let parts: Vec<&str> = parts.into_iter().flatten().collect();
        writeln!(f, "\n  {}  {}", self.key, parts.join(", "))?;
        writeln!(f, "    {}", self.common.about)?;
        if !self.values.is_empty() {
            writeln!(f, "    one of: {}", self.values.join(", "))?;
        }
        Ok(())
    }
}

impl Key {
    /// What holds where the key is absent.
    fn without(&self) -> String {
        match (&self.default, &self.absent) {
            _ if self.common.required => match &self.common.unless {
                None => "required".to_owned(),
                Some(section) => format!("required without [{section}]"),
            },
            (Some(value), _) => format!("default {value}"),
            (None, Some(words)) => format!("without it: {words}"),
            (None, None) => "may be left out".to_owned(),
        }
    }
}
