//! The summary of a batch. A line begins with how the session ended, in one word and always in the same columns, so
//! that `grep '^failed'` finds what it says. Sessions stand in the order of the configuration.

use serde::Serialize;

use super::stop::Stop;
use super::work::{Ending, Failure};
use super::{Until, near};
use crate::cli::messages::Printable;
use crate::cli::{DONE, NO_RESULT, NOT_MET};
use crate::files::store::Place;
use crate::grid::Verdict;
use crate::page::alike;
use crate::pipeline::configuration::{SessionFiles, SetAside, Why};
use crate::pipeline::fleet::{Fleet, FleetPiece};
use crate::pipeline::run::Done;
use crate::pipeline::summary::Next;

pub fn work(fleet: &Fleet) -> String {
    let names = |sessions: &[SessionFiles]| {
        let names: Vec<_> = sessions.iter().map(|s| Printable(&s.name).to_string()).collect();
        names.join(", ")
    };
    let line = |own: FleetPiece<'_>| {
        let (label, training, test) = (own.label(), names(&own.piece.training), &own.piece.test);
        let judged = (!test.is_empty()).then(|| format!("; judged on {}", names(test)));
        let judged = judged.unwrap_or_default();
        format!("{}: learns from {training}{judged}\n", Printable(&label))
    };
    fleet.pieces().into_iter().map(line).chain(fleet.set_aside.iter().map(aside_line)).collect()
}

/// Lines, summaries and totals, with all words where it is `verbose`; set aside are the configuration's own, and those that pools had to do without.
pub fn summary(
    fleet: &Fleet,
    endings: &[Ending],
    set_aside: &[SetAside],
    until: Option<Until>,
    verbose: bool,
) -> String {
    let labels: Vec<String> = fleet.pieces().iter().map(FleetPiece::label).collect();
    let labels = labels.iter().map(String::as_str);
    let mut text = lines(labels.clone().zip(endings), set_aside);
    text.push('\n');
    for (label, ending) in labels.zip(endings) {
        text += &paragraph(label, ending, verbose);
    }
    text += &Totals::of(endings, set_aside).words(until, fleet.tolerance_mm());
    text
}

fn lines<'a>(
    endings: impl Iterator<Item = (&'a str, &'a Ending)>,
    set_aside: &[SetAside],
) -> String {
    let lines = endings.map(|(session, ending)| line(session, ending));
    in_order(lines, set_aside, aside_line).concat()
}

/// `of_pieces` in their order, with `of_aside` of each session set aside between them, where the folder lists it.
pub(super) fn in_order<T>(
    of_pieces: impl Iterator<Item = T>,
    set_aside: &[SetAside],
    of_aside: impl Fn(&SetAside) -> T,
) -> Vec<T> {
    let mut aside = set_aside.iter().peekable();
    let mut all = Vec::new();
    for (place, own) in of_pieces.enumerate() {
        while let Some(before) = aside.next_if(|aside| aside.before <= place) {
            all.push(of_aside(before));
        }
        all.push(own);
    }
    all.extend(aside.map(of_aside));
    all
}

fn line(session: &str, ending: &Ending) -> String {
    let words = match ending {
        Ending::Done(done) => outcome(done),
        Ending::OfStage(done) => format!("{}, result {}", done.words, done.run),
        Ending::Failed(Failure { reason, .. }) => format!("no result: {reason}"),
        Ending::Stopped => "ended under way; run it again".to_owned(),
        Ending::NotStarted => "run it again".to_owned(),
    };
    state_line(ending.state(), session, &words)
}

impl Ending {
    /// How a session ended, in a word.
    pub(super) const fn state(&self) -> &'static str {
        match self {
            Self::Done(done) => before_or(done.already_there, "done"),
            Self::OfStage(done) => before_or(done.already_there, done.stage.done),
            Self::Failed(_) => "failed",
            Self::Stopped => "stopped",
            Self::NotStarted => "not-started",
        }
    }
}

/// The state of a result that the lake had already, or that was made now.
const fn before_or(already_there: bool, now: &'static str) -> &'static str {
    if already_there { "done-before" } else { now }
}

fn aside_line(aside: &SetAside) -> String {
    let without = if matches!(aside.why, Why::Bad(_)) { "no result: " } else { "" };
    state_line(aside.state(), &aside.session, &format!("{without}{}", aside.why.reason()))
}

fn state_line(state: &str, session: &str, words: &str) -> String {
    format!("{state:<12} {}: {}\n", Printable(session), Printable(words))
}

fn outcome(done: &Done) -> String {
    let mut parts = vec![verdict(&done.verdict).to_owned()];
    parts.extend(done.verdict_of.map(|of| format!(" by the {}", of.words())));
    parts.extend(done.reason.as_ref().map(|reason| format!(": {reason}")));
    parts.push(format!(", run {}", done.key.run));
    parts.extend(done.rejected.iter().map(|line| format!(", too much rejected: {line}")));
    let page = done.page.as_ref().filter(|_| done.already_there);
    parts.extend(page.map(|page| format!(", page {}", near(page))));
    parts.concat()
}

/// The line of a result that was there before is enough, unless it took the place of another.
fn paragraph(label: &str, ending: &Ending, verbose: bool) -> String {
    let Ending::Done(done) = ending else { return String::new() };
    let Some(summary) = &done.summary else {
        let words = done.took_place.as_ref();
        let line = words.map(|own| format!("{}: {}\n\n", Printable(label), Printable(own)));
        return line.unwrap_or_default();
    };
    let mut lines: Vec<String> = alike(&summary.warnings).iter().map(warning).collect();
    lines.extend(summary.findings.iter().chain(&done.took_place).cloned());
    lines.extend(done.corrects.as_ref().map(|table| now(&summary.next, table)));
    lines.extend(done.page.as_ref().map(|page| format!("page: {}", near(page))));
    if verbose {
        lines.push(format!("run: {}", done.key.run));
        lines.extend(done.words.iter().cloned());
        lines.push(format!("tables: {}", near(&done.tables)));
    }
    let pool = if summary.read.starts_with(label) {
        String::new()
    } else {
        format!("{}: ", Printable(label))
    };
    let line = |line: &String| format!("  {}\n", Printable(line));
    let lines: String = lines.iter().map(line).collect();
    format!("{pool}{}\n{lines}\n", Printable(&summary.read))
}

fn warning((first, others): &(&str, Vec<&str>)) -> String {
    match others.len() {
        0 => format!("warning: {first}"),
        more => format!("warning: {first} ({more} more like it, on the page)"),
    }
}

/// What to do with a result, with the command to type, where there is one, at the end of the line.
fn now(next: &Next, table: &Place) -> String {
    let copied = match table {
        Place::Path(_) => "",
        Place::Url(_) => ", with a copy of the table on this machine",
    };
    let command = next.command(&quoted(&near(table).to_string()));
    let command = command.map_or_else(String::new, |own| format!("{copied}: {own}"));
    format!("now: {}{command}", next.words())
}

fn quoted(path: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-%+:@=,".contains(c);
    if path.chars().all(is_plain) {
        path.to_owned()
    } else {
        format!("'{}'", path.replace('\'', "'\\''"))
    }
}

const fn verdict(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Meets => "within tolerance",
        Verdict::DoesNotMeet => "not within tolerance",
        Verdict::NotShown(_) => "not shown to be within tolerance",
    }
}

#[derive(Debug, Default, Serialize)]
pub(super) struct Totals {
    new: usize,
    before: usize,
    met: usize,
    failed: usize,
    waiting: usize,
    stopped: usize,
}

impl Totals {
    pub(super) fn of(endings: &[Ending], set_aside: &[SetAside]) -> Self {
        let mut totals = Self::default();
        for ending in endings {
            match ending {
                Ending::Done(done) => {
                    totals.add(done.already_there);
                    totals.met += usize::from(done.verdict == Verdict::Meets);
                }
                Ending::OfStage(done) => totals.add(done.already_there),
                Ending::Failed(_) => totals.failed += 1,
                Ending::Stopped | Ending::NotStarted => totals.stopped += 1,
            }
        }
        for aside in set_aside {
            match aside.why {
                Why::Waits(_) => totals.waiting += 1,
                Why::Bad(_) => totals.failed += 1,
            }
        }
        totals
    }

    fn add(&mut self, already_there: bool) {
        self.before += usize::from(already_there);
        self.new += usize::from(!already_there);
    }

    /// The numbers in words, with the tolerance where all robots have one.
    fn words(&self, until: Option<Until>, tolerance_mm: Option<f64>) -> String {
        let Self { new, before, met, failed, waiting, stopped } = self;
        let results = new + before;
        let not_met = results - met;
        let all = results + failed + stopped;
        let tolerance = tolerance_mm
            .map_or_else(|| "their robot's tolerance".to_owned(), |mm| format!("{mm} mm"));
        let stopped = if *stopped > 0 { format!(", {stopped} stopped") } else { String::new() };
        let text = match until {
            None => format!(
                "{met} of {all} within {tolerance}, {failed} without a result: {new} done, {before} done before, \
                 {not_met} not met, {failed} failed, {waiting} waiting"
            ),
            Some(until) => format!(
                "{results} of {all} {}: {new} now, {before} before, {failed} failed, {waiting} waiting",
                until.stage().names[1]
            ),
        };
        text + &stopped + "\n"
    }
}

/// The exit code of a batch: first a signal that left work undone, then a session without a result, then a tolerance.
pub fn exit_code(endings: &[Ending], set_aside: &[SetAside], stop: &Stop) -> u8 {
    let undone = |ending: &Ending| matches!(ending, Ending::Stopped | Ending::NotStarted);
    if let (true, Some(code)) = (endings.iter().any(undone), stop.exit_code()) {
        return code;
    }
    let failed = |ending: &Ending| matches!(ending, Ending::Failed(_));
    let bad = |aside: &SetAside| matches!(aside.why, Why::Bad(_));
    let not_good = |ending: &Ending| matches!(ending, Ending::Done(done) if !done.is_good());
    if endings.iter().any(failed) || set_aside.iter().any(bad) {
        NO_RESULT
    } else if endings.iter().any(not_good) {
        NOT_MET
    } else {
        DONE
    }
}

#[cfg(test)]
mod tests;
