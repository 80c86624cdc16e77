//! An acceptance report: rows of a run's tables → a PDF of one or two pages in the order of what ISO 9283 asks of a test report.
//!
//! What the standard asks and the session does not have stands in the first table. Words and figures are those of tables and
//! page; nothing is judged here.

mod asked;
mod sheet;

use krilla::error::KrillaError;
use serde::de::DeserializeOwned;

use super::{accuracy, iso_9283, verdict, words};
use crate::fit::Uncertainty;
use crate::grid::Tolerance;
use crate::io::export::acceptance::AcceptanceRows;
use crate::io::rows::Word as _;
use crate::io::tables::accuracy::{AccuracyRow, FigureKind, FigureName};
use crate::io::tables::calibrations::ArmColumns;
use crate::io::tables::runs::RunRow;
use crate::io::tables::words::TableVerdict;
use crate::manifest::RunKey;
use crate::report::iso_9283::Characteristic::{self, AdP, ApP, DapP, Rd, RpA, RpB, RpC, RpL, VapP};
use crate::report::{BaseRefit, Point, Split, Subject};
use sheet::{Column, Sheet};

/// Most rows of a list: a report has two pages, and the tables have everything.
const MOST: usize = 12;
/// Subjects whose figures of ISO 9283 stand beside each other, and tables of them.
const BESIDE: usize = 3;
const BODY: f32 = 8.0;
const SMALL: f32 = 7.0;

/// Figures of ISO 9283 that have a row: of those along axes the sum has.
const ISO_9283: [Characteristic; 9] = [ApP, RpL, RpA, RpB, RpC, AdP, Rd, VapP, DapP];
const NORMS: [FigureName; 4] =
    [FigureName::Mean, FigureName::P95, FigureName::Max, FigureName::Bound];

struct Report<'a> {
    key: &'a RunKey,
    run: &'a RunRow,
    arm: &'a ArmColumns,
    figures: &'a [AccuracyRow],
    settings: serde_json::Value,
}

pub fn pdf(rows: &AcceptanceRows) -> Result<Vec<u8>, KrillaError> {
    let settings = serde_json::from_str(&rows.run.made.settings).unwrap_or_default();
    let AcceptanceRows { key, run, arm, accuracy: figures } = rows;
    let report = Report { key, run, arm, figures, settings };
    let mut sheet = Sheet::new();
    report.head(&mut sheet);
    sheet.heading("What ISO 9283 asks, and what this session has");
    let columns = [("", 0.15), ("The standard asks", 0.32), ("Here", 0.53)];
    sheet.table(&columns, &asked::rows(&report), BODY);
    report.measured(&mut sheet);
    report.verdict(&mut sheet);
    report.accuracy(&mut sheet);
    report.iso_figures(&mut sheet);
    report.provenance(&mut sheet);
    sheet.heading("Seen by");
    for whom in ["supplier", "customer"] {
        let line = "_".repeat(75);
        sheet.text(&format!("For the {whom}: name, date, signature {line}"), (BODY, false));
    }
    sheet.finish(&format!("Acceptance report · {} · {} · run {}", key.robot, key.session, key.run))
}

impl Report<'_> {
    fn iso_9283(&self) -> impl Iterator<Item = &AccuracyRow> {
        self.figures.iter().filter(|own| own.quantity == FigureKind::Iso9283)
    }

    /// Why no figure of ISO 9283 is shown.
    fn no_visits(&self) -> &str {
        self.iso_9283().find_map(|own| own.reason.as_deref()).unwrap_or("no pose was visited again")
    }

    /// U of the figure that the verdict rests on, the largest of all where it rests on none.
    fn expanded_uncertainty_mm(&self) -> Option<f64> {
        let bound = self.run.ending.bound_mm;
        let bounds = self.figures.iter().filter(|own| own.name == FigureName::Bound);
        let own = bounds.filter(|own| bound.is_none() || own.value == bound);
        own.filter_map(|own| own.expanded_uncertainty).max_by(f64::total_cmp)
    }

    /// Whether the session has figures in a base found from its own stations too, which its verdict is of.
    fn has_better_base(&self, own: &Subject) -> bool {
        let is_found =
            |other: &Subject| matches!(other.base_refit, BaseRefit::First | BaseRefit::Chosen);
        let mut others = self.figures.iter().map(|row| &row.subject);
        (own.split, own.base_refit) == (Split::Session, BaseRefit::None)
            && others.any(|other| other.of_session == own.of_session && is_found(other))
    }

    fn setting<T: DeserializeOwned>(&self, place: &str) -> Option<T> {
        serde_json::from_value(self.settings.pointer(place)?.clone()).ok()
    }

    fn head(&self, sheet: &mut Sheet) {
        sheet.text("Acceptance report", (20.0, true));
        let what = "Position accuracy of a robot arm, in the order of ISO 9283:1998. A report of what was measured and computed; it is no \
                    certificate.";
        sheet.text(what, (BODY, false));
        let RunKey { robot, session, run } = self.key;
        sheet.text(&format!("{robot} · {session} · run {run}"), (BODY, true));
    }

    /// What was measured, with what, in which frame and against which tolerance.
    fn measured(&self, sheet: &mut Sheet) {
        sheet.heading("What was measured");
        let valid = &self.arm.valid_for;
        let [x, y, z] = self.arm.error_frame_target.map(|mm| words::fixed(mm, 2));
        let tool = valid.conditions.tool.as_deref().unwrap_or("not stated");
        let takes_orientations = self.setting("/fit/orientations").unwrap_or_default();
        let tracker = self.setting("/tracker/uncertainty").map(Uncertainty::Tracker);
        let camera = || self.setting("/tracker/camera").map(Uncertainty::Camera);
        let instrument =
            tracker.or_else(camera).map(|of| words::instrument(&of, takes_orientations));
        let base = valid.error_frame.stated().words();
        let facts = [
            ("Session", self.session()),
            ("Measured point", format!("({x}, {y}, {z}) mm from the flange; tool: {tool}")),
            ("Instrument", instrument.unwrap_or_else(|| "not stated".to_owned())),
            ("Base frame", base.trim_start_matches("frame: ").to_owned()),
            ("Tolerance", self.setting("/tolerance").map_or_else(String::new, |of| in_words(&of))),
        ];
        let facts = facts.map(|(what, text)| vec![what.to_owned(), text]);
        sheet.table(&[("", 0.15), ("", 0.85)], &facts, BODY);
    }

    fn session(&self) -> String {
        let run = self.run;
        let began = run.ending.session_started;
        let began = began
            .map_or_else(|| "start not in the logs".to_owned(), |own| format!("began {own} UTC"));
        let tests = run.test_sessions.iter().map(|own| format!("{own} (judges alone)"));
        let all: Vec<String> = run.sessions.iter().cloned().chain(tests).collect();
        let all = if all.len() > 1 { format!("; of {}", all.join(", ")) } else { String::new() };
        format!("{}, {began}{all}", self.key.session)
    }

    /// The verdict, the figures that it rests on, and what has to be known of it.
    fn verdict(&self, sheet: &mut Sheet) {
        let ending = &self.run.ending;
        let colour = match ending.verdict {
            TableVerdict::Met => [214, 238, 220],
            TableVerdict::NotMet => [250, 218, 216],
            TableVerdict::NotShown => [250, 238, 206],
        };
        let of = ending.verdict_of.map_or_else(String::new, |of| format!(" by the {}", of.words()));
        let ((_, sign), headline) = (words::sign(ending.verdict), words::headline(ending.verdict));
        sheet.heading("Verdict");
        sheet.band(&format!("{sign} {headline}{of}"), colour);
        let statement = ending.statement.as_ref().or(ending.reason.as_ref());
        let statement = statement.map_or("its reason is not recorded", |text| text.as_str());
        let statement = verdict::capital(&statement.replace('`', ""));
        sheet.text(&format!("{statement}."), (BODY, false));
        let unknown =
            || vec!["an earlier version made the run, so its page alone has any".to_owned()];
        for warning in ending.warnings.clone().unwrap_or_else(unknown) {
            sheet.text(&format!("Warning: {}.", warning.replace('`', "")), (BODY, true));
        }
    }

    fn accuracy(&self, sheet: &mut Sheet) {
        sheet.heading("Accuracy before and after compensation, mm");
        let ending = &self.run.ending;
        if let Some((before, after)) = ending.mean_before_mm.zip(ending.mean_after_mm) {
            let [before, after] = [before, after].map(|mm| words::fixed(mm, 3));
            let of = ending.means_of.as_deref().unwrap_or_default();
            let means = format!("Mean error {before} mm before, {after} mm after ({of}).");
            sheet.text(&means, (BODY, false));
        }
        let figures = self.figures.iter().filter(|own| own.point != Point::Tip).cloned();
        let mut subjects = accuracy::subjects(&figures.collect::<Vec<_>>());
        subjects.retain(|own| accuracy::is_listed(own) && !self.has_better_base(own));
        let rows = subjects.iter().map(|subject| self.accuracy_row(subject)).collect();
        let columns = [
            ("Corrected by", 0.21),
            ("", 0.11),
            ("Judged on", 0.335),
            ("Poses", 0.05),
            ("Mean", 0.05),
            ("p95", 0.05),
            ("Max", 0.05),
            ("Bound", 0.06),
            ("Verdict", 0.085),
        ];
        listed(sheet, &columns, rows, "accuracy");
    }

    fn accuracy_row(&self, subject: &Subject) -> Vec<String> {
        let own =
            self.figures.iter().filter(|own| own.subject == *subject && own.point != Point::Tip);
        let own: Vec<&AccuracyRow> = own.collect();
        let figure = |name: FigureName| own.iter().find(|own| own.name == name);
        let value = |name: FigureName| figure(name).and_then(|own| own.value);
        let bound = figure(FigureName::Bound);
        let judged = bound.filter(|_| subject.split != Split::None).and_then(|own| own.verdict);
        let mut row = vec![
            subject.model.name_at(subject.angles),
            bound.map_or("", |own| words::evidence(own.evidence)).to_owned(),
            bound.map_or_else(String::new, |own| accuracy::stations(subject, own.evidence)),
            bound.map_or(0, |own| own.n).to_string(),
        ];
        let norms =
            NORMS.map(value).map(|mm| mm.map_or_else(|| "–".to_owned(), |mm| words::fixed(mm, 3)));
        row.extend(norms);
        row.push(judged.map_or("–", words::verdict).to_owned());
        row
    }

    /// The figures of ISO 9283 over all poses, of a few subjects beside each other.
    fn iso_figures(&self, sheet: &mut Sheet) {
        sheet.heading("Figures of ISO 9283");
        let over_all = self.iso_9283().filter(|own| own.pose.is_none() && own.value.is_some());
        let figures: Vec<&AccuracyRow> = over_all.collect();
        let mut subjects = iso_9283::subjects(&figures);
        subjects.retain(|(_, own)| !self.has_better_base(own));
        subjects.sort_by(|(_, a), (_, b)| a.of_session.cmp(&b.of_session));
        if subjects.is_empty() {
            let reason = self.no_visits();
            let text = format!("AP, RP, AD, RD, vAP and drift are not shown: {reason}.");
            sheet.text(&text, (BODY, false));
        }
        let of_sessions = subjects.chunk_by(|(_, a), (_, b)| a.of_session == b.of_session);
        let tables: Vec<_> = of_sessions.flat_map(|own| own.chunks(BESIDE)).collect();
        for beside in tables.iter().take(BESIDE) {
            let headings: Vec<String> = beside.iter().map(iso_9283::whose).collect();
            let mut columns: Vec<Column> = vec![("Figure", 0.08)];
            columns.extend(headings.iter().map(|own| (own.as_str(), 0.15)));
            columns.push(("Limits of the first figure", 0.92 - 0.15 * beside.len() as f32));
            let rows = ISO_9283.iter().filter_map(|name| iso_row(*name, beside, &figures));
            sheet.table(&columns, &rows.collect::<Vec<_>>(), SMALL);
        }
        more(sheet, tables.len().saturating_sub(BESIDE), "accuracy");
    }

    fn provenance(&self, sheet: &mut Sheet) {
        sheet.heading("Made from");
        let (run, made, inputs) = (self.run, &self.run.made, &self.run.inputs);
        let text = format!(
            "Run {}, pipeline file {}, by posegrid {} on {}. BLAKE3 of its row in table runs, which names every input and result: {}; of its \
             settings: {}.",
            self.key.run,
            run.pipeline,
            made.version,
            made.platform,
            run.row_digest.as_deref().unwrap_or("not recorded"),
            made.settings_digest
        );
        sheet.text(&text, (SMALL, false));
        let folders = ["accuracy/", "calibrations/", "compensation/", "report/"];
        let is_of = |name: &&String| folders.iter().any(|own| name.starts_with(own));
        let results =
            run.files.names.iter().zip(&run.files.digests).filter(|(name, _)| is_of(name));
        let results = results.map(|own| ("result", own));
        let inputs = inputs.names.iter().zip(&inputs.digests).map(|own| ("input", own));
        let rows = results
            .chain(inputs)
            .map(|(what, (name, digest))| vec![format!("{what} {name}"), digest.clone()]);
        listed(sheet, &[("File", 0.36), ("BLAKE3", 0.64)], rows.collect(), "runs");
    }
}

fn in_words(tolerance: &Tolerance) -> String {
    let [share, confidence] = [tolerance.share, tolerance.confidence].map(words::percent);
    format!("{} mm for {share} % of positions, with {confidence} % confidence", tolerance.mm)
}

/// A table of [`MOST`] rows at most, and where the others are.
fn listed(sheet: &mut Sheet, columns: &[Column], mut rows: Vec<Vec<String>>, table: &str) {
    let left = rows.len().saturating_sub(MOST);
    rows.truncate(MOST);
    sheet.table(columns, &rows, SMALL);
    more(sheet, left, table);
}

fn more(sheet: &mut Sheet, left: usize, table: &str) {
    if left > 0 {
        sheet.text(&format!("{left} more are in table {table}."), (SMALL, false));
    }
}

/// A figure of each subject, and what limits the first; `None` where none has it.
fn iso_row(
    name: Characteristic,
    subjects: &[iso_9283::Of],
    figures: &[&AccuracyRow],
) -> Option<Vec<String>> {
    let name = FigureName::Iso(name);
    let is_of = |own: &iso_9283::Of, figure: &AccuracyRow| {
        figure.name == name && iso_9283::of(figure) == *own
    };
    let own: Vec<Option<&&AccuracyRow>> =
        subjects.iter().map(|own| figures.iter().find(|figure| is_of(own, figure))).collect();
    let first = own.iter().find_map(|own| *own)?;
    let values = own.iter().map(|own| {
        let written = own.and_then(|own| Some(iso_9283::written(own.value?, own.unit)));
        written.map_or_else(|| "–".to_owned(), |(digits, unit)| format!("{digits} {unit}"))
    });
    let reason = first.reason.clone().unwrap_or_default();
    Some(std::iter::once(name.word().to_owned()).chain(values).chain([reason]).collect())
}
