//! Columns of instruments that read one length, by their names and by the arm.
//!
//! 1. A column of numbers that differ is a candidate where its name is one of such instruments (a wire, a ball bar, a distance meter, a
//!    dial gauge) or of what they read, and nothing else uses it. In a long table it is a column of rows that name no target with a position.
//! 2. Where an arm agrees with the table, each is read in mm and in m, as a distance from a free anchor with a constant offset and as a
//!    height above a free plane; what leaves least is taken, and a candidate that nothing explains is not used.
//! 3. What the arm cannot know is unsure: the standard deviation of a reading, and that anchor and offset are to be found.

use nalgebra::Isometry3;

use super::columns::{ColumnSummary, number};
use super::long::{self, Long};
use super::names::{Sense, StatedUnit, any_has};
use crate::fit::KnownTarget;
use crate::fit::gauge::Gauge;
use crate::fit::start::gauge_alone;
use crate::ingest::{LengthColumns, LengthRead, LengthUnit, StandsOn};
use crate::io::measured_table::MeasuredTable;
use crate::join::ReadingKind;
use crate::join::placement::{NOMINAL_MM, Placement};

/// Lengths that are all below this are in metres.
const LARGEST_M: f64 = 30.0;
/// Another kind or unit is another choice where it leaves less than this many times the best.
const RIVAL: f64 = 3.0;
/// Standard deviation of the target's place as found beside the tracker, mm.
const TARGET_SD_MM: f64 = 5.0;
/// Standard deviation that is written for a reading, mm.
const SD_MM: f64 = 0.1;
/// Readings that are held against the arm at least.
const LEAST: usize = 12;

/// An instrument of one length, and what is unsure about it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Guessed {
    pub own: LengthColumns,
    pub doubts: Vec<String>,
}

/// The rows of an instrument of one length, with the nominal flange; no flanges where no arm agrees.
struct Candidate {
    name: String,
    column: usize,
    rows: Vec<usize>,
}

/// Lengths with the nominal flanges at which they were read.
type Read = Vec<(Isometry3<f64>, f64)>;

/// One way to read a column.
struct Tried {
    reads: LengthRead,
    unit: LengthUnit,
    gauge: Gauge,
    median_mm: f64,
}

/// The instruments of one length in a table, and notes about columns that are named as one and are none. `flange` is the nominal flange at
/// a row, where an arm agrees; `references` whether the section has references on the base.
pub(super) fn lengths(
    table: &MeasuredTable,
    columns: &[ColumnSummary],
    (used, long): (&[usize], Option<&Long>),
    flange: impl Fn(usize) -> Option<Isometry3<f64>>,
    placement: Option<&Placement>,
    references: bool,
) -> (Vec<Guessed>, Vec<String>) {
    let (mut found, mut notes) = (Vec::new(), Vec::new());
    for candidate in candidates(table, columns, used, long) {
        let summary = &columns[candidate.column];
        let read: Read = candidate
            .rows
            .iter()
            .filter_map(|&row| Some((flange(row)?, number(table, row, candidate.column)?)))
            .collect();
        let tried = tried(&read, summary, placement);
        let sd = deviation(columns, summary, used);
        match &tried[..] {
            [best, ..] if best.median_mm > NOMINAL_MM => notes.push(format!(
                "{:?} is named like an instrument of one length, and the arm explains it neither as a distance nor as a height: the best leaves \
                 {:.1} mm in the median; it is not used",
                candidate.name, best.median_mm
            )),
            tried => found.push(guessed(candidate, summary, tried, sd, references)),
        }
    }
    (found, notes)
}

/// The columns named like such an instrument that nothing else uses, each with its rows; in a long table the names beside targets.
fn candidates(
    table: &MeasuredTable,
    columns: &[ColumnSummary],
    used: &[usize],
    long: Option<&Long>,
) -> Vec<Candidate> {
    let is_named = |column: &usize| {
        let own = &columns[*column];
        own.is_numeric() && own.varies() && !used.contains(column) && is_length(&own.named.words)
    };
    let named: Vec<usize> = (0..columns.len()).filter(is_named).collect();
    let Some(long) = long else {
        let all = 0..table.row_count();
        let wide = named.into_iter().map(|column| Candidate {
            name: columns[column].name.clone(),
            column,
            rows: all.clone().collect(),
        });
        return wide.collect();
    };
    let rows_of = |name: &str, column: usize| {
        let is_own = |row: &usize| {
            long::name(table.cell(*row, long.target)).as_deref() == Some(name)
                && number(table, *row, column).is_some()
        };
        (0..table.row_count()).filter(is_own).collect::<Vec<usize>>()
    };
    let of_names = long.lengths.iter().filter_map(|name| {
        let own = named.iter().map(|&column| (column, rows_of(name, column)));
        let (column, rows) = own.max_by_key(|(column, rows)| (rows.len(), usize::MAX - column))?;
        (!rows.is_empty()).then(|| Candidate { name: name.clone(), column, rows })
    });
    of_names.collect()
}

/// Whether words name an instrument of one length or its readings.
pub(super) fn is_length(words: &[String]) -> bool {
    let other = [
        Sense::Deviation,
        Sense::Difference,
        Sense::Time,
        Sense::Temperature,
        Sense::Other,
        Sense::Command,
    ];
    let has = |sense| any_has(words, sense);
    (has(Sense::Length) || has(Sense::Height)) && !other.into_iter().any(has)
}

/// The column of the standard deviation of a length: of the same words, with one of deviations.
fn deviation(columns: &[ColumnSummary], own: &ColumnSummary, used: &[usize]) -> Option<String> {
    let words = |summary: &ColumnSummary| {
        let words = summary.named.words.iter();
        let mut words: Vec<String> = words
            .filter(|word| !super::names::has_sense(word, Sense::Deviation))
            .cloned()
            .collect();
        words.sort();
        words
    };
    let is_its = |(place, other): &(usize, &ColumnSummary)| {
        other.named.has(Sense::Deviation)
            && other.is_numeric()
            && other.range.is_some_and(|(low, _)| low >= 0.0)
            && !used.contains(place)
            && words(other) == words(own)
    };
    let found = columns.iter().enumerate().find(is_its);
    found.map(|(_, other)| other.name.clone())
}

/// All ways to read lengths beside the arm, the one that leaves least first; none without an arm.
fn tried(read: &Read, summary: &ColumnSummary, placement: Option<&Placement>) -> Vec<Tried> {
    if read.len() < LEAST {
        return Vec::new();
    }
    let target =
        placement.map(|own| KnownTarget { xyz_mm: own.target_mm.into(), sd_mm: TARGET_SD_MM });
    let units = match summary.named.unit {
        Some(StatedUnit::Length(unit)) => vec![unit],
        _ => vec![LengthUnit::Mm, LengthUnit::M],
    };
    let kinds =
        [(LengthRead::Distance, ReadingKind::Distance), (LengthRead::Height, ReadingKind::Height)];
    let mut all = Vec::new();
    for unit in units {
        let in_mm: Read = read.iter().map(|(at, own)| (*at, own * unit.to_mm())).collect();
        for (reads, kind) in kinds {
            if let Some((gauge, median_mm)) = gauge_alone(&in_mm, kind, target) {
                all.push(Tried { reads, unit, gauge, median_mm });
            }
        }
    }
    all.sort_by(|a, b| a.median_mm.total_cmp(&b.median_mm));
    all
}

/// The section of a candidate by the best way to read it, or by its name and size where there is no arm.
fn guessed(
    candidate: Candidate,
    summary: &ColumnSummary,
    tried: &[Tried],
    sd: Option<String>,
    references: bool,
) -> Guessed {
    let mut doubts = Vec::new();
    let by_name = if any_has(&summary.named.words, Sense::Height) {
        LengthRead::Height
    } else {
        LengthRead::Distance
    };
    let (reads, unit) = if let [best, others @ ..] = tried {
        doubts.push(by_arm(best, others));
        (best.reads, best.unit)
    } else {
        let unit = unit_by_size(summary);
        doubts.push(format!(
                "no arm tells it: {} by its name, in {} by its {}; \"distance\" is from an anchor, \"height\" above a plane",
                by_name.word(),
                unit_word(unit),
                if summary.named.unit.is_some() { "name" } else { "size" },
            ));
        (by_name, unit)
    };
    if sd.is_none() {
        doubts.push(format!(
            "sd_mm = {SD_MM} is no guess: write the standard deviation of a reading from the data sheet"
        ));
    }
    if references {
        doubts.push("on = \"base\" as references on the base are given: an instrument on the floor cannot be used beside them".to_owned());
    }
    Guessed {
        own: LengthColumns {
            name: candidate.name,
            reads,
            column: summary.name.clone(),
            unit,
            sd_mm: SD_MM,
            sd,
            target: None,
            on: references.then_some(StandsOn::Base),
            place: None,
            offset: None,
        },
        doubts,
    }
}

/// What the arm says of the best way to read a column, and of its rivals.
fn by_arm(best: &Tried, others: &[Tried]) -> String {
    let found = match &best.gauge {
        Gauge::Distance(anchor) => {
            let [x, y, z] = [anchor.place.x, anchor.place.y, anchor.place.z];
            format!(
                "anchor at about [{x:.0}, {y:.0}, {z:.0}] mm in the base's frame and offset {:.1} mm by the nominal arm: state `place` and \
                 `offset` where they are known, else both are found",
                anchor.offset_mm
            )
        }
        Gauge::Height(plane) => {
            let [x, y, z] = [plane.normal.x, plane.normal.y, plane.normal.z];
            format!(
                "plane with the normal [{x:.3}, {y:.3}, {z:.3}] in the base's frame by the nominal arm"
            )
        }
    };
    let rivals = others.iter().filter(|own| own.median_mm < RIVAL * best.median_mm);
    let rivals: Vec<String> = rivals
        .map(|own| {
            format!(
                "a {} in {} leaves {:.2} mm",
                own.reads.word(),
                unit_word(own.unit),
                own.median_mm
            )
        })
        .collect();
    let rivals = if rivals.is_empty() { String::new() } else { format!("; {}", rivals.join(", ")) };
    format!(
        "a {} in {} leaves {:.2} mm in the median of the nominal arm{rivals}; {found}",
        best.reads.word(),
        unit_word(best.unit),
        best.median_mm
    )
}

fn unit_by_size(summary: &ColumnSummary) -> LengthUnit {
    match summary.named.unit {
        Some(StatedUnit::Length(unit)) => unit,
        _ if summary.largest() > LARGEST_M => LengthUnit::Mm,
        _ => LengthUnit::M,
    }
}

const fn unit_word(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Mm => "mm",
        LengthUnit::M => "m",
    }
}
