//! Variables of programs by their scopes: the values that files write for them, and whether anything else happens to them.

use std::collections::{BTreeMap, HashMap};

use crate::program::{File, Position};
use crate::refusal::{Place, Refusal};
use crate::value::Value;

/// Where a name holds, from within: a routine of a module, the module, everywhere.
pub(crate) type Scope = String;

/// A value that a file writes for a variable or an element.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Written {
    pub(crate) file: usize,
    pub(crate) line: u32,
    pub(crate) value: Value,
    pub(crate) span: std::ops::Range<usize>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Variable {
    /// Its type in capitals; empty where none is declared.
    pub(crate) kind: String,
    /// Values by element; that of a variable without elements is under an empty name.
    pub(crate) values: BTreeMap<String, Vec<Written>>,
    /// The place where it may become another when the program runs; by elements, all of them under an empty name.
    touched: BTreeMap<String, Place>,
    /// A place where it is read other than by a motion.
    pub(crate) read: Option<Place>,
    pub(crate) is_parameter: bool,
    /// Whether a file declares it, or a data list gives it a value.
    pub(crate) is_declared: bool,
    /// Indices of its elements among the positions, once a motion uses them.
    pub(crate) positions: BTreeMap<String, usize>,
}

#[derive(Debug, Default)]
pub(crate) struct Names {
    of: HashMap<Scope, HashMap<String, Variable>>,
}

/// A name without its element, and the element with its brackets.
pub(crate) fn parts(name: &str) -> (&str, &str) {
    match name.find('[') {
        Some(place) => name.split_at(place),
        None => (name, ""),
    }
}

impl Variable {
    /// Marks that an element may become another; all of them by an empty name.
    pub(crate) fn touch(&mut self, element: &str, at: &Place) {
        self.touched.entry(element.to_owned()).or_insert_with(|| at.clone());
    }

    /// The place where an element may become another; any of them by an empty name.
    fn touched(&self, element: &str) -> Option<&Place> {
        let any = || self.touched.values().next().filter(|_| element.is_empty());
        self.touched.get("").or_else(|| self.touched.get(element)).or_else(any)
    }
}

impl Names {
    pub(crate) fn declare(&mut self, scope: &str, name: &str, kind: &str) -> &mut Variable {
        let scope = self.of.entry(scope.to_owned()).or_default();
        let variable = scope.entry(name.to_owned()).or_default();
        variable.is_declared |= !kind.is_empty();
        if variable.kind.is_empty() {
            kind.clone_into(&mut variable.kind);
        }
        variable
    }

    /// The variable that a name means in the first of the scopes that has it.
    pub(crate) fn find(&self, scopes: &[Scope], name: &str) -> Option<&Variable> {
        scopes.iter().find_map(|scope| self.of.get(scope)?.get(name))
    }

    pub(crate) fn find_mut(&mut self, scopes: &[Scope], name: &str) -> Option<&mut Variable> {
        let scope = scopes
            .iter()
            .find(|scope| self.of.get(*scope).is_some_and(|names| names.contains_key(name)))?;
        self.of.get_mut(scope)?.get_mut(name)
    }

    /// Marks that all variables may become others.
    pub(crate) fn touch_all(&mut self, at: &Place) {
        self.of.values_mut().flat_map(HashMap::values_mut).for_each(|own| own.touch("", at));
    }

    pub(crate) fn changes_parameters(&self, routine: &str) -> bool {
        let changes = |own: &Variable| own.is_parameter && !own.touched.is_empty();
        self.of.get(routine).is_some_and(|names| names.values().any(changes))
    }

    /// Forbids to correct positions of variables that may become others, or are read elsewhere.
    pub(crate) fn forbid(&self, positions: &mut [Position]) {
        for (name, variable) in self.of.values().flatten() {
            for (element, position) in &variable.positions {
                let why = match (variable.touched(element), &variable.read) {
                    (Some(at), _) => Refusal::AtRunTime { what: name.clone(), at: at.clone() },
                    (None, Some(at)) => Refusal::Read { at: at.clone() },
                    (None, None) if !variable.is_declared => Refusal::NotGiven {
                        name: name.clone(),
                        give: "the file that declares it".to_owned(),
                    },
                    (None, None) => continue,
                };
                positions[*position].obstacle.get_or_insert(why);
            }
        }
    }

    /// The only value of a name with its element; of several that are one the first.
    pub(crate) fn constant(
        &self,
        scopes: &[Scope],
        name: &str,
        files: &[File],
        give: &str,
    ) -> Result<&Written, Refusal> {
        let all = self.values(scopes, name, give)?;
        let (first, others) = (&all[0], &all[1..]);
        match others.iter().find(|own| !own.value.is_same(&first.value)) {
            Some(second) => Err(two_values(name, files, first, second)),
            None => Ok(first),
        }
    }

    /// The only value of a name with its element, where only one place writes it.
    pub(crate) fn only(
        &self,
        scopes: &[Scope],
        name: &str,
        files: &[File],
        give: &str,
    ) -> Result<&Written, Refusal> {
        match self.values(scopes, name, give)? {
            [first, second, ..] => Err(two_values(name, files, first, second)),
            all => Ok(&all[0]),
        }
    }

    /// All values of a name with its element, at least one, that nothing changes.
    fn values(&self, scopes: &[Scope], name: &str, give: &str) -> Result<&[Written], Refusal> {
        let missing = || Refusal::NotGiven { name: name.to_owned(), give: give.to_owned() };
        let (own, element) = parts(name);
        let variable = self.find(scopes, own).ok_or_else(missing)?;
        if variable.is_parameter {
            return Err(Refusal::Other(format!("{name}, a parameter, is worked out")));
        }
        if let Some(at) = variable.touched(element) {
            return Err(Refusal::AtRunTime { what: name.to_owned(), at: at.clone() });
        }
        variable.values.get(element).map(Vec::as_slice).ok_or_else(missing)
    }
}

fn two_values(name: &str, files: &[File], first: &Written, second: &Written) -> Refusal {
    Refusal::TwoValues {
        name: name.to_owned(),
        first: files[first.file].at(first.line),
        second: files[second.file].at(second.line),
    }
}
