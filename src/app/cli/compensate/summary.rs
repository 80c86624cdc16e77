use std::collections::BTreeMap;
use std::fmt;

use super::Compensated;
use crate::compensation::Validity;
use crate::compensation::validity::{Held, Term};
use crate::io::rows::Word as _;
use crate::io::targets::RefusedFor;

const REFUSALS_SHOWN: usize = 20;

impl fmt::Display for Compensated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (source, by) = (&self.source, self.source.by(&[]));
        let (robot, session) = (&by.key.robot, &by.key.session);
        let (what, table, valid) = (source.what(), by.table_id, valid_for(source.validity()));
        let mut lines = Vec::from_iter(self.named.words.clone());
        lines.push(format!("{what} {table:?} of robot {robot:?}, session {session:?}; {valid}"));
        lines.extend(source.frame());
        lines.push(source.measured());
        lines.extend(source.table_and_arm().map(str::to_owned));
        lines.extend(checked(&self.held));
        lines.extend(self.warnings());
        lines.extend(self.recording.words().map(str::to_owned));
        lines.extend(self.refused().take(REFUSALS_SHOWN).map(ToString::to_string));
        let (all, corrected) = (self.outcomes.len(), self.corrected().count());
        let largest = self.corrected().map(|own| own.correction.norm()).fold(0.0, f64::max);
        lines.push(format!(
            "{all} targets: {corrected} corrected, refused: {}; largest correction {largest:.3} mm",
            self.refusals()
        ));
        f.write_str(&lines.join("\n"))
    }
}

impl Compensated {
    fn warnings(&self) -> Vec<String> {
        let mut warnings = self.source.warnings(&self.targets.targets);
        let mut allowed = BTreeMap::<&str, usize>::new();
        let needed = self.corrected().flat_map(|done| &done.allowed);
        needed.for_each(|exception| *allowed.entry(exception.word()).or_default() += 1);
        warnings.extend(allowed.into_iter().map(|(name, count)| {
            format!(
                "{count} targets were corrected by an exception, {name} allowed: see column allowed"
            )
        }));
        if !self.targets.unused.is_empty() {
            let unused = self.targets.unused.join(", ");
            warnings.push(format!("columns without effect on a correction: {unused}"));
        }
        warnings
    }

    fn refusals(&self) -> String {
        let mut reasons = BTreeMap::<&str, usize>::new();
        self.refused().for_each(|refused| {
            *reasons.entry(RefusedFor::from(&refused.reason).word()).or_default() += 1;
        });
        let counted: Vec<String> =
            reasons.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        if counted.is_empty() { "none".to_owned() } else { counted.join(", ") }
    }
}

/// The conditions that were compared with the table's, and those that could not be.
fn checked(held: &Held) -> Vec<String> {
    let named = |terms: &[Term]| {
        let names: Vec<&str> = terms.iter().map(|term| term.name()).collect();
        names.join(", ")
    };
    let mut lines = Vec::new();
    if !held.within.is_empty() {
        lines.push(format!("within what the table is valid for: {}", named(&held.within)));
    }
    for outside in &held.outside {
        lines.push(format!("outside what the table is valid for, and allowed: {outside}"));
    }
    if !held.not_said.is_empty() {
        let not_said = named(&held.not_said);
        lines.push(format!("not checked, as it is not stated for the targets: {not_said}"));
    }
    if !held.not_stated.is_empty() {
        let not_stated = named(&held.not_stated);
        lines.push(format!("not checked, as the table does not state it: {not_stated}"));
    }
    lines
}

fn valid_for(validity: &Validity) -> String {
    let conditions = &validity.conditions;
    let parts = [
        conditions.tool.as_ref().map(|tool| format!("tool {tool:?}")),
        conditions.payload_kg.map(|kg| format!("payload {kg} kg")),
        conditions.mounting.as_ref().map(|mounting| format!("mounting {mounting:?}")),
        conditions.base.as_ref().map(|base| format!("base {base:?}")),
        conditions.controller_model.as_ref().map(|model| format!("controller {model:?}")),
        conditions
            .absolute_accuracy_option
            .map(|on| format!("absolute-accuracy option {}", if on { "on" } else { "off" })),
        validity.temperature_c.map(|[low, high]| format!("{low:.1} to {high:.1} °C")),
    ];
    let stated: Vec<String> = parts.into_iter().flatten().collect();
    if stated.is_empty() {
        "it does not state what it is valid for: make sure that tool, payload and base are those of the session".to_owned()
    } else {
        format!("valid for {}", stated.join(", "))
    }
}
