//! The arm decides: what each reading of the columns leaves of the nominal arm, base and target fitted to the table.
//! Units and orders of the joints are tried on a few stations, then the best on more. Names come before residuals: a
//! controller's own position agrees with the arm better than any measured one. What is left over is put to
//! [`crate::setup`].

use std::iter;
use std::sync::{Arc, LazyLock};

use nalgebra::{DMatrix, Matrix3};

use super::choices::{Choice, Part};
use super::columns::{number, position, spread};
use super::roles::Whose;
use crate::ingest::{AngleUnit, LengthUnit};
use crate::join::JoinSettings;
use crate::kinematics::Arm;
use crate::measured_table::MeasuredTable;
use crate::robot::ready;
use crate::setup::{
    self, Agreement, Alternatives, Dwelt, Evidence, KnownArm, Relation, SetUp, UnitKeys, Units,
};

const SCREENED: usize = 40;
/// The fewest stations by which anything is decided: base and target have nine numbers.
pub const LEAST_STATIONS: usize = 6;
/// No joint turns further, rad: what is beyond is in degrees.
const LARGEST_RAD: f64 = 4.0 * std::f64::consts::PI;
/// One reading is better than another where it leaves less than this share of it.
pub const BETTER: f64 = 1.0 / 3.0;
/// A position that leaves less than this share of another one was computed from the joints.
const COMPUTED: f64 = 0.1;
/// The most other choices of columns that are shown.
const MOST_COLUMNS: usize = 3;
/// The most readings whose mistakes are searched where none agrees.
const MOST_SEARCHED: usize = 4;

/// Units in which lengths of a table are tried, the usual ones first. In feet what is in metres moves enough to look like another arm.
pub const LENGTHS: [LengthUnit; 4] =
    [LengthUnit::Mm, LengthUnit::M, LengthUnit::Cm, LengthUnit::Inch];

#[derive(Debug, Clone, Default)]
pub struct Arms {
    pub known: Vec<KnownArm>,
    /// Whether it is the one that was named; otherwise they are the ready ones.
    pub is_named: bool,
}

impl Arms {
    pub fn ready() -> Self {
        Self { known: ready::arms(), is_named: false }
    }

    pub fn named(file: String, arm: Arm) -> Self {
        Self { known: vec![KnownArm { file, arm }], is_named: true }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    pub choice: usize,
    pub arm: usize,
    pub angle: AngleUnit,
    pub slide: LengthUnit,
    pub length: LengthUnit,
    pub is_reversed: bool,
    /// Median distance between the measured position and that of the nominal arm, base and target fitted, mm.
    pub median_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Differs {
    Angle,
    Slide,
    Length,
    Order,
    Arm,
    Columns,
}

#[derive(Debug, Clone)]
pub struct Verdict {
    pub best: Tried,
    pub others: Vec<(Differs, Tried)>,
    pub stations: usize,
    /// Other arms with the same chain.
    pub alike: Vec<usize>,
    pub finding: Option<String>,
}

impl Verdict {
    /// Whether the arm agrees at all: its residual is one of nominal arms.
    pub fn agrees(&self) -> bool {
        self.best.median_mm <= gate_mm()
    }

    /// The best other reading that differs in this, where it is not clearly worse.
    pub fn rival(&self, differs: Differs) -> Option<&Tried> {
        let others = self.others.iter().filter(|(own, _)| *own == differs);
        others.map(|(_, tried)| tried).find(|tried| self.best.median_mm > BETTER * tried.median_mm)
    }
}

/// How far a reading of the right target may be from the nominal arm, mm.
fn gate_mm() -> f64 {
    JoinSettings::default().geometry_gate_mm
}

struct Bench<'t> {
    table: &'t MeasuredTable,
    rows: &'t [usize],
    choices: &'t [Choice],
    arms: &'t Arms,
}

/// The verdict of the arms about the choices, from these rows; `None` where no arm has as many joints, or too few
/// stations are whole.
pub fn verdict(
    table: &MeasuredTable,
    rows: &[usize],
    choices: &[Choice],
    arms: &Arms,
) -> Option<Verdict> {
    let bench = Bench { table, rows, choices, arms };
    let mut tried: Vec<_> = (0..choices.len()).flat_map(|choice| bench.screened(choice)).collect();
    tried.sort_by(|a, b| a.median_mm.total_cmp(&b.median_mm));
    let first = bench.chosen(&tried)?;
    let evidence = bench.evidence(first.choice, usize::MAX);
    let whole = |tried: Tried| Tried {
        median_mm: bench.median(&tried, &bench.evidence(tried.choice, usize::MAX)),
        ..tried
    };
    let best = whole(first);
    let others = bench.others(&tried, &first).into_iter();
    let others = others.map(|(differs, own)| (differs, whole(own))).collect();
    let alike = bench.alike(best.arm);
    let finding = bench.finding(&tried, &best, &evidence);
    Some(Verdict { best, others, stations: evidence.stations.len(), alike, finding })
}

impl Bench<'_> {
    fn evidence(&self, choice: usize, most: usize) -> Evidence {
        let choice = &self.choices[choice];
        let dwelt = |&row: &usize| {
            let joints =
                choice.joints.columns.iter().map(|&column| number(self.table, row, column));
            Some(Dwelt {
                reported: joints.collect::<Option<_>>()?,
                measured: position(&choice.targets.first()?.position, self.table, row)?.into(),
                orientation: None,
                command: None,
            })
        };
        let stations: Vec<Dwelt> = self.rows.iter().filter_map(dwelt).collect();
        let stride = stations.len().div_ceil(most.max(1)).max(1);
        Evidence::spread(stations.into_iter().step_by(stride).collect())
    }

    fn screened(&self, choice: usize) -> Vec<Tried> {
        let evidence = self.evidence(choice, SCREENED);
        if evidence.stations.len() < LEAST_STATIONS {
            return Vec::new();
        }
        let tried = self.readings(choice, &evidence).into_iter();
        tried.map(|own| Tried { median_mm: self.median(&own, &evidence), ..own }).collect()
    }

    fn readings(&self, choice: usize, evidence: &Evidence) -> Vec<Tried> {
        let joints = self.choices[choice].joints.columns.len();
        let values = evidence.stations.iter().flat_map(|station| &station.reported);
        let is_degrees =
            values.fold(0.0_f64, |largest, value| largest.max(value.abs())) > LARGEST_RAD;
        let angles =
            if is_degrees { &[AngleUnit::Deg][..] } else { &[AngleUnit::Rad, AngleUnit::Deg] };
        // In a unit in which positions hardly move they agree with anything.
        let spread = spread(self.table, &self.choices[choice].targets[0].position);
        let moving = LENGTHS.into_iter().filter(|unit| unit.to_mm() * spread > gate_mm());
        let moving: Vec<LengthUnit> = moving.collect();
        let (mut all, median_mm) = (Vec::new(), f64::INFINITY);
        let known = self.arms.known.iter().enumerate();
        for (arm, known) in known.filter(|(_, known)| known.arm.joints().len() == joints) {
            let slides = if known.arm.has_slides() { &LENGTHS[..] } else { &LENGTHS[..1] };
            for (&angle, &slide) in
                angles.iter().flat_map(|angle| slides.iter().map(move |slide| (angle, slide)))
            {
                for (length, is_reversed) in
                    moving.iter().flat_map(|length| [(*length, false), (*length, true)])
                {
                    all.push(Tried { choice, arm, angle, slide, length, is_reversed, median_mm });
                }
            }
        }
        all
    }

    fn set_up(&self, tried: &Tried) -> SetUp {
        let arm = &self.arms.known[tried.arm].arm;
        SetUp {
            joints_from_reported: joints_from_columns(arm, tried),
            reading_map: Matrix3::from_diagonal_element(tried.length.to_mm()),
            unit_keys: UnitKeys::TABLES,
            units: Units { slides: tried.slide, ..Units::of(tried.angle, tried.length) },
            ..SetUp::of_arm(arm.clone())
        }
    }

    fn median(&self, tried: &Tried, evidence: &Evidence) -> f64 {
        let agreement = Agreement::of(&self.set_up(tried), evidence);
        agreement.get(Relation::Arm).unwrap_or(f64::INFINITY)
    }

    /// The reading to take: names come first as far as the arm agrees with them, then its residual decides.
    fn chosen(&self, tried: &[Tried]) -> Option<Tried> {
        let choice = |own: &Tried| &self.choices[own.choice];
        let of_whose = |whose: Whose| {
            let own = tried.iter().filter(move |own| choice(own).whose == whose);
            own.collect::<Vec<_>>()
        };
        let classes =
            [Whose::Measured, Whose::Unknown, Whose::Controller, Whose::Command].map(of_whose);
        let agreeing =
            classes.iter().find(|own| own.first().is_some_and(|best| best.median_mm <= gate_mm()));
        let Some(class) = agreeing else { return tried.first().copied() };
        let best = **class.first()?;
        if choice(&best).part != Part::Whole {
            return self.chosen_part(class).or(Some(best));
        }
        let is_named =
            |own: &&&Tried| choice(own).doubt.is_none() && choice(own).joints.doubt.is_none();
        let other = class.iter().find(|own| choice(own).targets != choice(&best).targets);
        let measured = other
            .filter(is_named)
            .filter(|own| own.median_mm <= gate_mm() && best.median_mm < COMPUTED * own.median_mm);
        Some(measured.map_or(best, |own| **own))
    }

    /// Of a position, and it with differences added or taken away: the one that was measured.
    fn chosen_part(&self, class: &[&Tried]) -> Option<Tried> {
        let of = |part: Part| {
            class.iter().find(|own| self.choices[own.choice].part == part).map(|own| **own)
        };
        let (base, plus, minus) = (of(Part::Base)?, of(Part::Plus)?, of(Part::Minus)?);
        let summed = plus.median_mm.min(minus.median_mm);
        let is_own = self.choices[base.choice].whose == Whose::Measured;
        let base_is_measured =
            summed < COMPUTED * base.median_mm || (is_own && base.median_mm >= COMPUTED * summed);
        Some(if base_is_measured { base } else { plus })
    }

    /// The best other reading for each thing in which it may differ.
    fn others(&self, tried: &[Tried], best: &Tried) -> Vec<(Differs, Tried)> {
        let same = |own: &Tried| Tried { median_mm: 0.0, ..*own };
        let but = |change: fn(&mut Tried, &Tried)| {
            tried.iter().find(|own| {
                let mut changed = same(own);
                change(&mut changed, best);
                changed == same(best) && same(own) != same(best)
            })
        };
        let chain = |own: &&Tried| {
            self.arms.known[own.arm].arm.chain() != self.arms.known[best.arm].arm.chain()
        };
        let arm = tried.iter().filter(|own| own.choice == best.choice).find(chain);
        let mut columns: Vec<&Tried> = Vec::new();
        for own in tried.iter().filter(|own| own.choice != best.choice) {
            if columns.iter().all(|other| other.choice != own.choice) {
                columns.push(own);
            }
        }
        columns.truncate(MOST_COLUMNS);
        let found = [
            (Differs::Angle, but(|own, best| own.angle = best.angle)),
            (Differs::Slide, but(|own, best| own.slide = best.slide)),
            (Differs::Length, but(|own, best| own.length = best.length)),
            (Differs::Order, but(|own, best| own.is_reversed = best.is_reversed)),
            (Differs::Arm, arm),
        ];
        let found = found.into_iter().filter_map(|(differs, own)| Some((differs, *own?)));
        found.chain(columns.into_iter().map(|own| (Differs::Columns, *own))).collect()
    }

    fn alike(&self, arm: usize) -> Vec<usize> {
        let chain = |place: usize| self.arms.known[place].arm.chain();
        (0..self.arms.known.len())
            .filter(|&place| place != arm && chain(place) == chain(arm))
            .collect()
    }

    /// The usual mistake that explains what the best reading leaves over; where none agrees, what a few of the best
    /// readings leave.
    fn finding(&self, tried: &[Tried], best: &Tried, evidence: &Evidence) -> Option<String> {
        let most = if best.median_mm > gate_mm() { MOST_SEARCHED } else { 1 };
        // A named arm may have been taken for another one; ready ones have all been tried.
        let mut alternatives = Alternatives::default();
        if self.arms.is_named {
            alternatives.arms = Arc::new(LazyLock::new(ready::arms));
        }
        let mut searched: Vec<Tried> = Vec::new();
        for own in iter::once(best).chain(tried.iter().filter(|own| own.choice == best.choice)) {
            let is_new = searched.iter().all(|other| {
                Tried { median_mm: 0.0, ..*other } != Tried { median_mm: 0.0, ..*own }
            });
            searched.extend((is_new && searched.len() < most).then_some(*own));
        }
        let found = searched.iter().filter_map(|own| {
            let finding = setup::check(&self.set_up(own), evidence, &alternatives, gate_mm())?;
            let words = format!("{}: {finding}", self.arms.known[own.arm].file);
            // What leaves more than nominal arms are off by explains nothing.
            Some((finding.mended.filter(|mm| *mm <= gate_mm())?, words))
        });
        found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, words)| words)
    }
}

/// Joint values in rad and mm, in the arm's order, from the numbers in the columns.
pub fn joints_from_columns(arm: &Arm, tried: &Tried) -> DMatrix<f64> {
    let count = arm.joints().len();
    let factor = |joint: usize| {
        if arm.joints()[joint].slides { tried.slide.to_mm() } else { tried.angle.to_rad() }
    };
    DMatrix::from_fn(count, count, |joint, column| {
        let own = if tried.is_reversed { count - 1 - joint } else { joint };
        if own == column { factor(joint) } else { 0.0 }
    })
}
