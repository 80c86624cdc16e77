//! The report of a corrected program: every position that motions use, by line.

use std::fmt;

use serde::Serialize;

use crate::programs::{Position, Programs};

/// What became of a position.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "verdict", rename_all = "snake_case")]
pub(super) enum Outcome {
    Corrected { correction_mm: f64, crossed: usize },
    Refused { reason: String },
    Computed,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Entry {
    file: String,
    line: u32,
    /// The position's name, or what the program works out.
    position: String,
    /// Whether a motion moves beside it, by an offset that stays as it is.
    beside: bool,
    #[serde(flatten)]
    outcome: Outcome,
}

/// All positions that motions use, in the order of files and lines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    positions: usize,
    corrected: usize,
    refused: usize,
    computed: usize,
    largest_correction_mm: f64,
    /// Joints that crossed a border of T, cf1, cf4 or cf6.
    crossed: usize,
    orientations_corrected: bool,
    /// Files of programs that are not read.
    pub(super) unread: Vec<String>,
    lines: Vec<Entry>,
}

impl Report {
    pub(super) fn new(programs: &Programs, orientations_corrected: bool) -> Self {
        let lines = programs.computed.iter().map(|own| Entry {
            file: programs.files[own.file].name.clone(),
            line: own.line,
            position: format!("{} {}", own.word, own.text),
            beside: false,
            outcome: Outcome::Computed,
        });
        let lines: Vec<Entry> = lines.collect();
        Self {
            positions: lines.len(),
            corrected: 0,
            refused: 0,
            computed: lines.len(),
            largest_correction_mm: 0.0,
            crossed: 0,
            orientations_corrected,
            unread: Vec::new(),
            lines,
        }
    }

    pub(super) fn add(&mut self, programs: &Programs, position: &Position, outcome: Outcome) {
        self.positions += 1;
        match &outcome {
            Outcome::Corrected { correction_mm, crossed } => {
                self.corrected += 1;
                self.crossed += crossed;
                self.largest_correction_mm = self.largest_correction_mm.max(*correction_mm);
            }
            Outcome::Refused { .. } => self.refused += 1,
            Outcome::Computed => self.computed += 1,
        }
        self.lines.push(Entry {
            file: programs.files[position.file].name.clone(),
            line: position.line,
            position: position.name.clone(),
            beside: position.uses.iter().any(|own| own.is_beside),
            outcome,
        });
    }

    /// 0 where every position is corrected, 1 where none is, 3 otherwise.
    pub(super) const fn exit_code(&self) -> u8 {
        match (self.corrected, self.refused + self.computed) {
            (0, _) => 1,
            (_, 0) => 0,
            _ => 3,
        }
    }

    pub(super) fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut lines: Vec<&Entry> = self.lines.iter().collect();
        lines.sort_by_key(|own| (&own.file, own.line));
        for own in lines {
            let place = format!("{}, line {}: {}", own.file, own.line, own.position);
            match &own.outcome {
                Outcome::Corrected { .. } => {}
                Outcome::Refused { reason } => writeln!(f, "{place}: refused: {reason}")?,
                Outcome::Computed => {
                    writeln!(f, "{place}: computed when the program runs, stays as it is")?;
                }
            }
        }
        for name in &self.unread {
            writeln!(f, "{name}: not read: programs of this dialect are not corrected")?;
        }
        write!(
            f,
            "{} positions that motions use: {} corrected, {} refused, {} computed; largest correction {:.3} mm",
            self.positions, self.corrected, self.refused, self.computed, self.largest_correction_mm
        )?;
        if self.crossed > 0 {
            write!(
                f,
                "; {} joints crossed a border of their turns, which are written anew",
                self.crossed
            )?;
        }
        let beside = self.lines.iter().filter(|own| own.beside).count();
        if beside > 0 {
            write!(f, "; motions move beside {beside} of them, by offsets that stay as they are")?;
        }
        let how = if self.orientations_corrected {
            "are corrected too"
        } else {
            "are not corrected, as the calibration does not show them"
        };
        write!(f, "; orientations {how}")
    }
}
