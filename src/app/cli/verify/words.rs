//! The outcome of a verification, as lines of text.

use std::collections::BTreeSet;

use crate::cli::messages::Printable;
use crate::files::table::compare::{ColumnDifference, Comparison, OneSided};
use crate::io::lake::Stage;
use crate::manifest::RunKey;
use crate::pipeline::verify::{
    Anew, ChangedInput, ChangedSetting, Citation, ComparedFile, FileOutcome, Found, Left, Output,
    Recomputed, Role, Selected, StageVerified, Verdict, Verified,
};

/// A run by robot, session and name.
pub(super) fn name(key: &RunKey) -> String {
    format!("{}/{} run {}", key.robot, key.session, key.run)
}

pub(super) fn line(name: &str, verdict: &Verdict) -> String {
    let words = match verdict {
        Verdict::NotRecomputed(reason) => format!("not recomputed: {reason}"),
        Verdict::RowUnreadable(reason) => format!("row of runs not readable: {reason}"),
        Verdict::SameValues { largest } => {
            format!("the same values in other bytes, largest relative difference {largest:.1e}")
        }
        Verdict::Removed { superseded_by } => {
            format!("removed: of its files none is there; run {superseded_by} had taken its place")
        }
        other => word(other).to_owned(),
    };
    let line = format!("{name}: {words}");
    Printable(&line).to_string()
}

const fn word(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::OutputsAltered => "outputs altered",
        Verdict::RowAltered => "row of runs altered",
        Verdict::RowUnreadable(_) => "row of runs not readable",
        Verdict::Removed { .. } => "removed, superseded",
        Verdict::OutputsMissing => "outputs missing",
        Verdict::InputsMissing => "not recomputed, inputs missing",
        Verdict::InputsAltered => "inputs altered",
        Verdict::SettingsDiffer => "settings differ",
        Verdict::NotRecomputed(_) => "not recomputed",
        Verdict::Differs => "differs",
        Verdict::CitedMissing => "what it cites is missing or changed",
        Verdict::SameValues { .. } => "the same values in other bytes",
        Verdict::Same => "the same",
    }
}

/// The results of a stage: a line for each that was changed, differs, or could not be made anew, then how many there are; `shown` are
/// those that recomputed runs showed.
pub(super) fn stage(stage: Stage, verified: &[StageVerified], shown: &BTreeSet<String>) -> String {
    let mut lines: Vec<String> = verified.iter().flat_map(|own| problems(stage, own)).collect();
    let count = |is: fn(&StageVerified) -> bool| verified.iter().filter(|own| is(own)).count();
    let changed = count(StageVerified::is_mismatch);
    let same = count(|own| own.anew == Some(Anew::Same));
    let keys = verified.iter().filter_map(|own| own.key.as_ref());
    let of_runs = keys.filter(|key| shown.contains(&key.run)).count();
    lines.push(format!(
        "{}: {} in the lake, {} as written, {changed} changed; {same} {} anew and the same, {of_runs} by runs that were recomputed",
        stage.names[1],
        verified.len(),
        verified.len() - changed,
        stage.done
    ));
    lines.join("\n")
}

fn problems(stage: Stage, verified: &StageVerified) -> Vec<String> {
    let (what, done) = (stage.names[0], stage.done);
    let subject = match &verified.key {
        Some(key) => format!("{}/{} {what} {}", key.robot, key.session, key.run),
        None => verified.place.display().to_string(),
    };
    let anew = match &verified.anew {
        Some(Anew::Differs(tables)) => {
            Some(format!("{done} anew it differs in {}", tables.join(", ")))
        }
        Some(Anew::No(reason)) => Some(format!("not {done} anew: {reason}")),
        Some(Anew::Same) | None => None,
    };
    let told = verified.problems.iter().cloned().chain(anew);
    told.map(|words| Printable(&format!("{subject}: {words}")).to_string()).collect()
}

/// The number of runs with each verdict, and of runs that were not looked at.
pub(super) fn summary(verdicts: &[Verdict], selected: &Selected, asked: bool) -> String {
    let mut words: Vec<(&str, usize)> = Vec::new();
    for verdict in verdicts {
        let word = word(verdict);
        match words.iter_mut().find(|(own, _)| *own == word) {
            Some((_, count)) => *count += 1,
            None => words.push((word, 1)),
        }
    }
    let counts: Vec<String> = words.iter().map(|(word, count)| format!("{count} {word}")).collect();
    let runs = if verdicts.len() == 1 { "run" } else { "runs" };
    let counts = if counts.is_empty() { String::new() } else { format!(": {}", counts.join(", ")) };
    let mut parts = vec![format!("\n{} {runs}{counts}", verdicts.len())];
    let open = verdicts.iter().filter(|verdict| verdict.is_open()).count();
    if !asked && open > 0 {
        let open = format!("only the digests of these {open} were compared");
        parts.push(format!("{open}: recompute with --pipeline"));
    }
    if selected.not_drawn > 0 {
        parts.push(format!("{} not drawn", selected.not_drawn));
    }
    parts.extend(selected.by_others.iter().map(|(pipeline, count)| {
        format!("{count} by the pipeline file {} not looked at", Printable(pipeline))
    }));
    parts.join("; ")
}

/// All findings about a run, one per line.
pub(super) fn details(verified: &Verified) -> Vec<String> {
    let mut lines = verified.claim.elsewhere();
    if !verified.claim.is_digest_due() {
        lines.push(format!(
            "runs: written before rows carried a digest (version {} of the table), so not every change of it can be detected",
            verified.claim.table_version
        ));
    }
    let contradictions = verified.contradictions.iter();
    lines.extend(contradictions.map(|found| format!("runs: {found}")));
    lines.extend(outputs(verified));
    lines.extend(verified.cited.iter().filter_map(citation));
    lines.extend(verified.inputs.iter().map(input));
    lines.extend(verified.settings.iter().map(setting));
    match &verified.recomputed {
        Recomputed::No(reason) if !matches!(verified.verdict(), Verdict::NotRecomputed(_)) => {
            lines.push(format!("not recomputed: {reason}"));
        }
        Recomputed::No(_) => {}
        Recomputed::OtherWork => {
            lines.push("not recomputed, as inputs or settings differ".to_owned());
        }
        Recomputed::Yes { same, others } => {
            let files = if *same == 1 { "file" } else { "files" };
            lines.push(format!("{same} {files} recomputed, byte for byte the same"));
            lines.extend(others.iter().flat_map(file));
        }
    }
    lines
}

/// The files that differ from the row; or, where nothing was recomputed, a line that none does.
fn outputs(verified: &Verified) -> Vec<String> {
    let outputs = &verified.outputs;
    if matches!(verified.verdict(), Verdict::Removed { .. }) {
        return vec![format!("none of its {} files is there", outputs.len())];
    }
    let others = outputs.iter().filter(|output| !output.is_sound());
    let others: Vec<String> = others.map(|own| output(own, &verified.recomputed)).collect();
    if others.is_empty() && !matches!(verified.recomputed, Recomputed::Yes { .. }) {
        return vec![format!(
            "its {} files have the digests that its row states: no byte of them has changed",
            outputs.len()
        )];
    }
    others
}

const NOT_COMPARED_AGAIN: &str = "its promise cannot be compared with the session again";

/// A line about another run that this one depends on.
fn citation(cited: &Citation) -> Option<String> {
    let (as_what, lost) = match cited.role {
        Role::Replaced => ("whose place it took", "what that one replaced counts as current again"),
        Role::Drove => ("whose table drove the session", NOT_COMPARED_AGAIN),
        Role::Planned => ("the plan it was measured by", NOT_COMPARED_AGAIN),
        Role::KnownArm => ("whose arm it starts from", "it cannot be planned again"),
    };
    let run = &cited.run;
    let left = match &cited.left {
        Left::Whole(Some(by)) if cited.role != Role::Replaced => {
            format!("there, and superseded by run {by}")
        }
        Left::Whole(_) => return None,
        Left::Without(tables) => format!("its {} missing; {lost}", tables.join(", ")),
        Left::OtherRow => "its row in runs is not the one that it was then".to_owned(),
        Left::Nothing => format!("the lake has no row of it; {lost}"),
    };
    Some(format!("cites run {run}, {as_what}: {left}"))
}

fn output(output: &Output, recomputed: &Recomputed) -> String {
    let found = match &output.found {
        Found::Digest(digest) => format!("digest {digest}"),
        Found::Missing => "missing, and cited by its run's row and page".to_owned(),
        Found::Unreadable(reason) => reason.clone(),
    };
    let again = match recomputed {
        Recomputed::Yes { others, .. } => {
            let own = others.iter().find(|file| file.name == output.name);
            own.and_then(|file| file.computed.as_ref())
        }
        Recomputed::No(_) | Recomputed::OtherWork => None,
    };
    let judged = match again {
        Some(digest) if *digest == output.claimed => "; recomputed, it is as the row states",
        Some(_) => "; recomputed, it is neither",
        None => "",
    };
    format!("output {}: {found}, the row states {}{judged}", output.name, output.claimed)
}

fn input(input: &ChangedInput) -> String {
    let file = |(bytes, digest): &(u64, String)| format!("{bytes} bytes, digest {digest}");
    let found = match &input.found {
        Ok(found) => file(found),
        Err(reason) => reason.clone(),
    };
    let claimed = input.claimed.as_ref().map_or_else(|| "no such input".to_owned(), file);
    format!("input {}: {found}; the row states {claimed}", input.name)
}

fn setting(setting: &ChangedSetting) -> String {
    let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    let (found, claimed) = (shown(&setting.found), shown(&setting.claimed));
    format!("setting {}: {found}, the row states {claimed}", setting.key)
}

fn file(file: &ComparedFile) -> Vec<String> {
    let name = &file.name;
    match &file.outcome {
        FileOutcome::Values(comparison) => values(name, comparison),
        FileOutcome::OnlyPublished => vec![format!("{name}: computing gave no such file")],
        FileOutcome::OnlyComputed => {
            vec![format!("{name}: computing gave it, and it is not published")]
        }
        FileOutcome::PageOfOtherBytes => {
            vec![format!("{name}: the same but for digests of tables")]
        }
        FileOutcome::Page => vec![format!("{name}: the page says something else")],
        FileOutcome::PageFromElsewhere => {
            vec![format!("{name}: pages are not compared across versions and machines")]
        }
        FileOutcome::Unreadable(reason) => vec![format!("{name}: not compared: {reason}")],
    }
}

fn values(name: &str, comparison: &Comparison) -> Vec<String> {
    let mut lines: Vec<String> =
        comparison.columns.iter().map(|column| format!("{name}: {}", difference(column))).collect();
    let mut side = |rows: &OneSided, which: &str| {
        if let Some(first) = &rows.first {
            lines.push(format!("{name}: {} rows only {which}, first {first}", rows.rows));
        }
    };
    side(&comparison.only_published, "published");
    side(&comparison.only_computed, "computed");
    if lines.is_empty() {
        lines.push(format!("{name}: the same values in other bytes"));
    }
    lines
}

fn difference(column: &ColumnDifference) -> String {
    let ColumnDifference { column: name, cells, compared, .. } = column;
    let mut parts = vec![format!("column {name}: {cells} of {compared} cells differ")];
    parts.extend(column.largest.as_ref().map(|largest| {
        format!(
            "by at most {:.3e} (relative {:.3e}: {:?} published, {:?} computed, at {})",
            largest.absolute, largest.relative, largest.published, largest.computed, largest.row
        )
    }));
    parts.extend(column.unlike.as_ref().map(|unlike| {
        let (published, computed, row) = (&unlike.published, &unlike.computed, &unlike.row);
        format!("first {published:?} published, {computed:?} computed, at {row}")
    }));
    parts.join(", ")
}
