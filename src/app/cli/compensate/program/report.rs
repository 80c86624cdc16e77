//! The report of a corrected program: every position that motions use, by line.

use std::cmp::Ordering::Equal;
use std::fmt;

use serde::Serialize;

use super::densify::Densified;
use super::offsets::AWAY_MM;
use super::taught::FoundFrame;
use crate::programs::Programs;

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

/// A motion with the largest distance from its wanted path, or why that is not stated.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Motion {
    file: String,
    line: u32,
    instruction: String,
    /// Whether the corner at its end is blended; that is left out.
    blended: bool,
    deviation_mm: Option<f64>,
    not_stated: Option<&'static str>,
    /// Further points that are written before it; `deviation_mm` is with them.
    points_added: usize,
    /// Why it gets none though it leaves its path by more than was asked.
    not_split: Option<String>,
}

/// All positions that motions use, in the order of files and lines.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Report {
    positions: usize,
    corrected: usize,
    refused: usize,
    computed: usize,
    largest_correction_mm: f64,
    /// Joints that crossed a border of T, cf1, cf4 or cf6.
    crossed: usize,
    orientations_corrected: bool,
    /// Largest error that stays at the end of an offset of 100 mm, mm; `None` where no motion moves beside a corrected position.
    pub(super) left_by_offsets_mm: Option<f64>,
    /// Files of programs that are not read.
    unread: Vec<String>,
    /// Those that were touched with an arm.
    taught_frames: Vec<FoundFrame>,
    lines: Vec<Entry>,
    motions: Vec<Motion>,
}

impl Report {
    pub(super) fn of(
        programs: &Programs,
        outcomes: Vec<Outcome>,
        deviations: Vec<Result<f64, &'static str>>,
        orientations_corrected: bool,
        unread: Vec<String>,
        taught_frames: Vec<FoundFrame>,
    ) -> Self {
        let name = |file: usize| programs.files[file].name.clone();
        let entry = |(file, line), position, beside, outcome| {
            let file = name(file);
            Entry { file, line, position, beside, outcome }
        };
        let computed = programs.computed.iter().map(|own| {
            let position = format!("{} {}", own.word, own.text);
            entry((own.file, own.line), position, false, Outcome::Computed)
        });
        let positions = programs.positions.iter().zip(outcomes).map(|(own, outcome)| {
            let beside = own.uses.iter().any(|own| own.is_beside);
            entry((own.file, own.line), own.name.clone(), beside, outcome)
        });
        let lines: Vec<Entry> = computed.chain(positions).collect();
        let motions = programs.paths.iter().zip(deviations);
        let motions = motions.map(|(path, deviation)| Motion {
            file: name(path.file),
            line: path.line,
            instruction: path.word.clone(),
            blended: path.is_blended,
            deviation_mm: deviation.ok(),
            not_stated: deviation.err(),
            points_added: 0,
            not_split: None,
        });
        let mut report = Self {
            positions: lines.len(),
            orientations_corrected,
            unread,
            taught_frames,
            motions: motions.collect(),
            ..Self::default()
        };
        for own in &lines {
            match &own.outcome {
                Outcome::Corrected { correction_mm, crossed } => {
                    report.corrected += 1;
                    report.crossed += crossed;
                    report.largest_correction_mm = report.largest_correction_mm.max(*correction_mm);
                }
                Outcome::Refused { .. } => report.refused += 1,
                Outcome::Computed => report.computed += 1,
            }
        }
        Self { lines, ..report }
    }

    /// Adds the further points of motions, and puts these in the order of their files.
    pub(super) fn add(&mut self, further: Vec<Densified>) {
        for own in further {
            let motion = &mut self.motions[own.path];
            match own.points {
                Ok(points) => {
                    motion.points_added = points.count;
                    motion.deviation_mm = Some(points.deviation_mm);
                }
                Err(why) => motion.not_split = Some(why),
            }
        }
        self.motions.sort_by(|one, other| (&one.file, one.line).cmp(&(&other.file, other.line)));
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

    /// How far the arm leaves the wanted path between positions.
    fn write_motions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stated = |own: &Motion| own.deviation_mm;
        let largest = self.motions.iter().filter(|own| own.deviation_mm.is_some());
        let largest = largest.max_by(|a, b| stated(a).partial_cmp(&stated(b)).unwrap_or(Equal));
        let Some(Motion { file, line, instruction, deviation_mm: Some(mm), .. }) = largest else {
            return Ok(());
        };
        write!(
            f,
            "between positions the arm leaves the wanted path by {mm:.3} mm at most ({file}, line {line}: {instruction})"
        )?;
        let not_stated = self.motions.iter().filter(|own| own.not_stated.is_some()).count();
        if not_stated > 0 {
            write!(f, "; not stated for {not_stated} of {} motions", self.motions.len())?;
        }
        let blended = self.motions.iter().filter(|own| own.blended).count();
        if blended > 0 {
            write!(f, "; {blended} blended corners are left out")?;
        }
        writeln!(f)
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
        for own in &self.motions {
            let Motion { file, line, instruction, points_added, .. } = own;
            if let Some(why) = &own.not_split {
                writeln!(f, "{file}, line {line}: {instruction}: gets no further points: {why}")?;
            } else if *points_added > 0 {
                let mm = own.deviation_mm.unwrap_or_default();
                writeln!(
                    f,
                    "{file}, line {line}: {instruction}: {points_added} points added before it; it leaves its path by {mm:.3} mm with them"
                )?;
            }
        }
        self.taught_frames.iter().try_for_each(|frame| writeln!(f, "{frame}"))?;
        self.write_motions(f)?;
        let Self { positions, corrected, refused, computed, crossed, .. } = self;
        let largest_mm = self.largest_correction_mm;
        write!(
            f,
            "{positions} positions that motions use: {corrected} corrected, {refused} refused, {computed} computed; largest correction {largest_mm:.3} mm"
        )?;
        if *crossed > 0 {
            write!(
                f,
                "; {crossed} joints crossed a border of their turns, which are written anew"
            )?;
        }
        let beside = self.lines.iter().filter(|own| own.beside).count();
        if beside > 0 {
            write!(f, "; motions move beside {beside} of them, by offsets that stay as they are")?;
        }
        if let Some(mm) = self.left_by_offsets_mm {
            write!(f, " and leave at most {mm:.3} mm for each {AWAY_MM} mm")?;
        }
        let how = if self.orientations_corrected {
            "are corrected too"
        } else {
            "are not corrected, as the calibration does not show them"
        };
        write!(f, "; orientations {how}")
    }
}
