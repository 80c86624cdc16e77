//! The guess: `[stations]` for a table, with everything about it that is unsure.

mod doubts;
mod orientation;

use nalgebra::{DVector, Isometry3, Vector3};

use super::by_arm::{self, Arms, Verdict, joints_from_columns};
use super::choices::{self, Choice, Part, Target};
use super::columns::{ColumnSummary, largest, number, position};
use super::commands::{Commands, commands};
use super::long::{self, Long};
use super::names::StatedUnit;
use super::roles::{Placed, Roles, Whose};
use super::uses;
use crate::ingest::{
    AngleUnit, LengthUnit, MISSING, PoseColumns, ReadingColumns, ReferenceColumns, StandsOn,
    StationsSettings,
};
use crate::join::placement::{Placement, ReadingAtFlange};
use crate::measured_table::MeasuredTable;
use crate::station_table::name;

/// The most stations at which orientations and commands are held against the arm.
const MOST_STATIONS: usize = 250;
/// No angle in radians is larger: a turn, with some room.
const LARGEST_RAD: f64 = 2.1 * std::f64::consts::PI;
/// Positions that are all below this are in metres: no arm is as large, and none as small.
const LARGEST_M: f64 = 30.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    Robot,
    Joints,
    JointUnit,
    LengthUnit,
    Session,
    Target,
    Time,
    Commanded,
    Position,
    Unit,
    Orientation,
    Reference,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doubt {
    pub key: Key,
    pub words: String,
}

#[derive(Debug)]
pub struct Guess {
    pub settings: StationsSettings,
    pub doubts: Vec<Doubt>,
    /// What was seen and is not used.
    pub notes: Vec<String>,
    /// What the arm says; `None` where no arm has as many joints, or the table too few stations.
    pub verdict: Option<Verdict>,
    pub arms: Vec<String>,
    pub arm_is_named: bool,
    pub choices: Vec<String>,
    pub commands: Option<Commands>,
    /// The base in the frame of the main target's positions, mm, as found beside the nominal arm.
    pub base: Option<Isometry3<f64>>,
    pub sessions: Vec<String>,
}

struct Work<'t> {
    table: &'t MeasuredTable,
    columns: &'t [ColumnSummary],
    names: &'t [String],
    choice: Choice,
    verdict: Option<Verdict>,
    /// Unit of the joints that turn, of the joints that slide, and of the positions.
    units: (AngleUnit, LengthUnit, LengthUnit),
    /// Rows of the main session and target, with the nominal flange; empty where no arm agrees.
    flanges: Vec<(usize, Isometry3<f64>)>,
    placement: Option<Placement>,
}

/// The guess about a table; what is missing where there is none.
pub(super) fn guess(
    table: &MeasuredTable,
    columns: &[ColumnSummary],
    arms: &Arms,
) -> Result<Guess, String> {
    let joint_names: Vec<Vec<String>> = arms
        .known
        .iter()
        .map(|known| known.arm.joints().iter().map(|joint| joint.name.clone()).collect())
        .collect();
    let roles = Roles::of(table, columns, &joint_names);
    let mut judged = Judged::of(table, columns, roles, arms)?;
    let mut doubt = None;
    if let Some(roles) = judged.roles.in_other_order() {
        let other = Judged::of(table, columns, roles, arms)?;
        let [own_mm, other_mm] = [&judged, &other].map(Judged::median_mm);
        // Nothing measured is nearer to the nominal arm than what was commanded.
        if own_mm < by_arm::BETTER * other_mm {
            judged = other;
        } else if other_mm >= by_arm::BETTER * own_mm {
            doubt = Some(
                "the table has these points twice, and neither names nor the arm tell which were measured: the first are taken as commanded"
                    .to_owned(),
            );
        }
    }
    let Judged { roles, long, choices, session, rows, verdict } = judged;
    let choice = choices[verdict.as_ref().map_or(0, |own| own.best.choice)].clone();
    let work = Work::new(table, columns, choice, verdict, arms, &rows);
    let mut guess = work.guess(&roles, long, session, &choices, arms);
    guess.doubts.extend(doubt.map(|words| Doubt { key: Key::Position, words }));
    Ok(guess)
}

/// What columns may be by their roles, and what the arms say of it.
struct Judged {
    roles: Roles,
    long: Option<Long>,
    choices: Vec<Choice>,
    /// The column of sessions, and their names.
    session: Option<(usize, Vec<String>)>,
    /// Rows of the main session and target.
    rows: Vec<usize>,
    verdict: Option<Verdict>,
}

impl Judged {
    fn of(
        table: &MeasuredTable,
        columns: &[ColumnSummary],
        roles: Roles,
        arms: &Arms,
    ) -> Result<Self, String> {
        let named = arms.known.iter().filter(|_| arms.is_named);
        let counts: Vec<usize> = named.map(|known| known.arm.joints().len()).collect();
        let mut long =
            roles.joints.first().and_then(|set| long::long(table, columns, &set.columns));
        let mut choices = choices::choices(columns, &roles, long.as_ref(), &counts);
        for choice in &mut choices {
            choice.targets.sort_by_key(|target| missing(table, target));
        }
        if choices.is_empty() {
            return Err(lacking(&roles));
        }
        if let (Some(long), Some(target)) = (&mut long, choices[0].targets.first()) {
            long.keep_placed(table, |row| position(&target.position, table, row).is_some());
        }
        let session = uses::session(table, columns, &roles.used());
        let rows = main_rows(table, session.as_ref().map(|(column, _)| *column), long.as_ref());
        let verdict = by_arm::verdict(table, &rows, &choices, arms);
        Ok(Self { roles, long, choices, session, rows, verdict })
    }

    /// What the best reading leaves, mm; infinite where no arm tells.
    fn median_mm(&self) -> f64 {
        self.verdict.as_ref().map_or(f64::INFINITY, |own| own.best.median_mm)
    }
}

fn missing(table: &MeasuredTable, target: &Target) -> usize {
    (0..table.row_count()).filter(|&row| position(&target.position, table, row).is_none()).count()
}

/// What neither names nor values tell.
fn lacking(roles: &Roles) -> String {
    let joints = "no columns that are named like joints (joint_1, J1[deg], A1, q1, shoulder_pan_joint) or stand side by side as angles";
    let position = "no columns of a measured position: three numbers that differ, named like x y z";
    let lacking = match (roles.joints.is_empty(), roles.positions.is_empty()) {
        (false, _) => position.to_owned(),
        (true, false) => joints.to_owned(),
        (true, true) => format!("{joints}; {position}"),
    };
    [std::slice::from_ref(&lacking), &roles.notes].concat().join("; ")
}

/// The rows of the session with most rows, and in a long table of the target with most.
fn main_rows(table: &MeasuredTable, session: Option<usize>, long: Option<&Long>) -> Vec<usize> {
    let first = session
        .and_then(|column| (0..table.row_count()).find_map(|row| name(table.cell(row, column))));
    let is_own = |row: &usize| {
        let of_session = session.is_none_or(|column| name(table.cell(*row, column)) == first);
        let of_target = long.is_none_or(|long| {
            name(table.cell(*row, long.target)).as_ref() == long.targets.first()
        });
        of_session && of_target
    };
    (0..table.row_count()).filter(is_own).collect()
}

impl<'t> Work<'t> {
    fn new(
        table: &'t MeasuredTable,
        columns: &'t [ColumnSummary],
        choice: Choice,
        verdict: Option<Verdict>,
        arms: &Arms,
        rows: &[usize],
    ) -> Self {
        let units = verdict.as_ref().map_or_else(
            || (angle_by_size(columns, &choice), LengthUnit::Mm, length_by_size(columns, &choice)),
            |own| (own.best.angle, own.best.slide, own.best.length),
        );
        let mut work = Self {
            table,
            columns,
            names: table.columns(),
            choice,
            verdict,
            units,
            flanges: Vec::new(),
            placement: None,
        };
        work.flanges = work.flanges(arms, rows);
        let reading = |(row, flange): &(usize, Isometry3<f64>)| {
            let at = position(&work.choice.targets.first()?.position, table, *row)?;
            Some(ReadingAtFlange { flange: *flange, attained: Vector3::from(at) * units.2.to_mm() })
        };
        let readings: Vec<ReadingAtFlange> = work.flanges.iter().filter_map(reading).collect();
        work.placement = Placement::fit(&readings).filter(|_| !readings.is_empty());
        work
    }

    /// Nominal flanges at rows, evenly spread; none where no arm agrees.
    fn flanges(&self, arms: &Arms, rows: &[usize]) -> Vec<(usize, Isometry3<f64>)> {
        let Some(verdict) = self.verdict.as_ref().filter(|own| own.agrees()) else {
            return Vec::new();
        };
        let arm = &arms.known[verdict.best.arm].arm;
        let map = joints_from_columns(arm, &verdict.best);
        let flange = |&row: &usize| {
            let joints =
                self.choice.joints.columns.iter().map(|&column| number(self.table, row, column));
            let joints = &map * DVector::from_vec(joints.collect::<Option<Vec<f64>>>()?);
            Some((row, *arm.flange(joints.as_slice()).isometry()))
        };
        let stride = rows.len().div_ceil(MOST_STATIONS).max(1);
        rows.iter().step_by(stride).filter_map(flange).collect()
    }

    fn joints(&self) -> Vec<String> {
        let mut joints: Vec<String> =
            self.choice.joints.columns.iter().map(|&column| self.names[column].clone()).collect();
        if self.verdict.as_ref().is_some_and(|own| own.best.is_reversed && own.agrees()) {
            joints.reverse();
        }
        joints
    }

    fn three(&self, columns: [usize; 3]) -> [String; 3] {
        columns.map(|column| self.names[column].clone())
    }

    fn reading(&self, target: &Target, doubts: &mut Vec<Doubt>) -> ReadingColumns {
        ReadingColumns {
            name: target.name.clone(),
            position: target.position.each_ref().map(|sum| sum.text(self.names)),
            unit: self.units.2,
            sd: target.sd.map(|sd| self.three(sd)),
            covariance: None,
            samples: None,
            orientation: self.orientation(target, doubts),
        }
    }

    fn guess(
        self,
        roles: &Roles,
        long: Option<Long>,
        session: Option<(usize, Vec<String>)>,
        choices: &[Choice],
        arms: &Arms,
    ) -> Guess {
        let mut doubts = Vec::new();
        self.doubts(choices, arms, &mut doubts);
        let measured =
            self.choice.targets.iter().map(|target| self.reading(target, &mut doubts)).collect();
        let commands = self.commands(roles);
        let commanded = commands.as_ref().map(|own| self.commanded(own, &mut doubts));
        let used = self.used(roles);
        let (time, temperature) =
            (uses::time(self.table, self.columns, &used), uses::temperature(self.columns, &used));
        let references = self.references(roles, &mut doubts);
        let mut notes = self.notes(roles, commands.is_some());
        let time = time.and_then(|time| time.map_err(|note| notes.push(note)).ok());
        let time = time.map(|(column, doubt)| {
            doubts.extend(doubt.map(|words| Doubt { key: Key::Time, words }));
            column
        });
        let (angle, slide, _) = self.units;
        let slides =
            self.verdict.as_ref().is_some_and(|own| arms.known[own.best.arm].arm.has_slides());
        Guess {
            settings: StationsSettings {
                lengths: Vec::new(),
                separator: None,
                decimal: None,
                sheet: None,
                header: None,
                joints: self.joints(),
                joint_unit: angle,
                length_unit: slides.then_some(slide),
                flange_from_tool: None,
                session: session.as_ref().map(|(column, _)| self.names[*column].clone()),
                robot: None,
                station: long.as_ref().map(|own| self.names[own.station].clone()),
                target: long.as_ref().map(|own| self.names[own.target].clone()),
                targets: long.map(|own| own.targets).unwrap_or_default(),
                time,
                temperature: temperature.map(|column| self.names[column].clone()),
                missing: MISSING.into(),
                references,
                commanded,
                measured,
            },
            doubts,
            notes,
            arms: arms.known.iter().map(|known| known.file.clone()).collect(),
            arm_is_named: arms.is_named,
            choices: choices.iter().map(|choice| whose_choice(choice, self.names)).collect(),
            commands,
            base: self.placement.map(|placement| placement.tracker_from_base),
            sessions: session.map(|(_, names)| names).unwrap_or_default(),
            verdict: self.verdict,
        }
    }

    fn used(&self, roles: &Roles) -> Vec<usize> {
        let joints = self.choice.joints.columns.iter().copied();
        roles.used().into_iter().chain(self.choice.placed()).chain(joints).collect()
    }

    /// Positions that stand still while the arm moves.
    fn references(&self, roles: &Roles, doubts: &mut Vec<Doubt>) -> Vec<ReferenceColumns> {
        let still = roles.positions.iter();
        let still = still.filter(|own| !own.moves && own.whose != Whose::Command);
        let of_columns = |own: &Placed| ReferenceColumns {
            name: choices::name(self.columns, own),
            on: StandsOn::Base,
            position: Some(self.three(own.columns)),
            unit: Some(self.units.2),
        };
        let all: Vec<ReferenceColumns> = still.map(of_columns).collect();
        if !all.is_empty() {
            doubts.push(Doubt {
                key: Key::Reference,
                words: "it does not move with the arm, so it stands on the robot's base or on the floor: write \"floor\" where it does"
                    .to_owned(),
            });
        }
        all
    }

    fn commands(&self, roles: &Roles) -> Option<Commands> {
        let of_command = roles.positions.iter().find(|own| own.whose == Whose::Command)?;
        let is_measured = self.choice.placed().any(|column| of_command.columns.contains(&column));
        if is_measured || self.flanges.is_empty() {
            return None;
        }
        commands(self.table, of_command, &self.flanges)
    }

    fn commanded(&self, own: &Commands, doubts: &mut Vec<Doubt>) -> PoseColumns {
        doubts.push(Doubt {
            key: Key::Commanded,
            words: format!(
                "as found from this table, to {:.2} mm in the median; write the controller's own",
                own.median_mm
            ),
        });
        PoseColumns {
            position: self.three(own.placed.columns),
            unit: own.unit,
            orientation: own.turned.as_ref().map(|turned| self.columns_of(&turned.form, None)),
        }
    }

    fn notes(&self, roles: &Roles, has_commands: bool) -> Vec<String> {
        let mut notes = roles.notes.clone();
        let chosen: Vec<usize> = self.choice.placed().collect();
        let is_chosen = |columns: &[usize; 3]| columns.iter().any(|own| chosen.contains(own));
        for own in roles.positions.iter().filter(|own| own.moves && !is_chosen(&own.columns)) {
            let why = match own.whose {
                Whose::Command if has_commands => continue,
                Whose::Command => {
                    "is commanded or nominal by its name, and is not near the arm in any unit: state its frame in [commanded] to use it"
                }
                Whose::Controller => "is the controller's own position by its name",
                Whose::Measured | Whose::Unknown => "is another position",
            };
            notes.push(format!("{} {why}: it is not used", self.three(own.columns).join(", ")));
        }
        notes
    }
}

/// Joints and main position of a choice, with whose position it is where that is not an instrument's.
fn whose_choice(choice: &Choice, names: &[String]) -> String {
    let whose = match (choice.whose, choice.part) {
        (_, Part::Base) => " (the position without the differences)",
        (Whose::Command, _) => " (commanded or nominal by its name)",
        (Whose::Controller, _) => " (the controller's own by its name)",
        _ => "",
    };
    in_words(choice, names) + whose
}

fn in_words(choice: &Choice, names: &[String]) -> String {
    let joints: Vec<&str> =
        choice.joints.columns.iter().map(|&column| names[column].as_str()).collect();
    let joints = match &joints[..] {
        [first, .., last] => format!("{first} … {last}"),
        _ => joints.concat(),
    };
    let position = choice
        .targets
        .first()
        .map(|target| target.position.each_ref().map(|sum| sum.text(names)).join(", "));
    format!("joints {joints}, position {}", position.unwrap_or_default())
}

fn angle_by_size(columns: &[ColumnSummary], choice: &Choice) -> AngleUnit {
    let largest = largest(columns, choice.joints.columns.iter().copied());
    let by_size = if largest > LARGEST_RAD { AngleUnit::Deg } else { AngleUnit::Rad };
    stated_angle(columns, choice).unwrap_or(by_size)
}

fn length_by_size(columns: &[ColumnSummary], choice: &Choice) -> LengthUnit {
    let largest = largest(columns, choice.placed());
    let by_size = if largest > LARGEST_M { LengthUnit::Mm } else { LengthUnit::M };
    stated_length(columns, choice).unwrap_or(by_size)
}

fn stated_angle(columns: &[ColumnSummary], choice: &Choice) -> Option<AngleUnit> {
    choice.joints.columns.iter().find_map(|&column| match columns[column].named.unit {
        Some(StatedUnit::Angle(unit)) => Some(unit),
        _ => None,
    })
}

fn stated_length(columns: &[ColumnSummary], choice: &Choice) -> Option<LengthUnit> {
    choice.placed().find_map(|column| match columns[column].named.unit {
        Some(StatedUnit::Length(unit)) => Some(unit),
        _ => None,
    })
}
