use std::collections::BTreeMap;

use crate::history::FALSE_ALARM;
use crate::io::tables::past::PastSession;
use crate::pipeline::history::{RobotHistory, RunResult};

/// Most changes printed on stdout, the newest ones.
const PRINTED: usize = 3;

pub(super) fn words(robot: &RobotHistory) -> Vec<String> {
    let count = robot.sessions.len();
    let mut lines = Vec::new();
    if let Some(last) = robot.sessions.last() {
        lines.push(format!("newest: {}", newest(last)));
        lines.extend(robot.results.last().and_then(RunResult::before_and_after));
        lines.push(in_control(last));
    }
    lines.extend(changes(robot));
    lines.extend(robot.sessions.last().and_then(|last| counts(last, robot)));
    lines.extend(left_out(robot));
    let expected = FALSE_ALARM * count as f64;
    lines.push(format!(
        "false alarms to expect of {count} sessions: {expected:.1} by the test, {expected:.1} by the charts, at most"
    ));
    let indented = lines.iter().map(|line| format!("  {line}"));
    [headline(robot)].into_iter().chain(indented).collect()
}

fn headline(robot: &RobotHistory) -> String {
    let ends = robot.sessions.first().zip(robot.sessions.last());
    let ends = ends.map(|(first, last)| format!(", {} to {}", first.key.session, last.key.session));
    format!("{}: {} sessions{}", robot.robot, robot.sessions.len(), ends.unwrap_or_default())
}

fn newest(session: &PastSession) -> String {
    let judged = &session.judged;
    let what = judged.in_words().unwrap_or_else(|| "nothing moved".to_owned());
    match judged.against {
        0 if judged.began.is_empty() => "the first, nothing to compare it with".to_owned(),
        0 => format!(
            "begins segment {}, as {} changed: nothing to compare it with",
            judged.segment,
            judged.began.join(", ")
        ),
        1 => format!("{what}, compared with the session before"),
        count => format!("{what}, compared with {count} sessions before"),
    }
}

fn in_control(session: &PastSession) -> String {
    let charted = &session.judged.charted;
    let out: Vec<&str> = session.judged.out_of_control().collect();
    let shown = charted.iter().filter(|one| one.is_out().is_some()).count();
    if shown == 0 {
        "control charts: not shown, they need three sessions of one segment".to_owned()
    } else if out.is_empty() {
        format!("control charts: all {shown} in control")
    } else {
        format!("control charts: out of control: {}", out.join(", "))
    }
}

/// A session in which something moved, and whether that lasts.
type Changed<'h> = (&'h PastSession, Option<bool>);

fn changes(robot: &RobotHistory) -> Vec<String> {
    let lasting = PastSession::lasting(&robot.sessions);
    let has_moved = |(session, _): &Changed<'_>| session.judged.in_words().is_some();
    let changed: Vec<Changed<'_>> = robot.sessions.iter().zip(lasting).filter(has_moved).collect();
    let is_out = |session: &&PastSession| session.judged.out_of_control().next().is_some();
    let out = robot.sessions.iter().filter(is_out).count();
    let segments = robot.sessions.last().map_or(0, |last| last.judged.segment);
    let count = |lasts| changed.iter().filter(|(_, own)| *own == lasts).count();
    let (all, lasting, alone, open) =
        (changed.len(), count(Some(true)), count(Some(false)), count(None));
    let summary = format!(
        "changes: {all} sessions, {lasting} lasting, {alone} of one session, {open} not settled; out of control: {out} sessions; \
         segments: {segments}"
    );
    let newest = changed.iter().rev().take(PRINTED).rev();
    [summary].into_iter().chain(newest.map(change)).collect()
}

fn change((session, lasting): &Changed<'_>) -> String {
    let words = session.judged.in_words().unwrap_or_default();
    let settled = match lasting {
        Some(true) => "lasts",
        Some(false) => "of this session alone",
        None => "not settled yet",
    };
    format!("  {}: {words} ({settled})", session.key.session)
}

/// The size from which a change counts, and the number of sessions with smaller ones.
fn counts(last: &PastSession, robot: &RobotHistory) -> Option<String> {
    let small = robot.sessions.iter().filter(|own| !own.judged.small.is_empty());
    Some(format!(
        "a change counts where it moves the measured point by {:.3} mm or more (U of the session, a tenth of the tolerance at least and a \
         third at most); significant and smaller: {} sessions",
        last.judged.least_mm?,
        small.count()
    ))
}

fn left_out(robot: &RobotHistory) -> Option<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for left_out in &robot.left_out {
        *counts.entry(left_out.reason.word()).or_default() += 1;
    }
    let words: Vec<String> =
        counts.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
    let (runs, used, words) = (robot.runs, robot.sessions.len(), words.join(", "));
    (!words.is_empty()).then(|| format!("runs: {runs}, {used} used; left out: {words}"))
}
