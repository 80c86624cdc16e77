//! A run in ten lines for a person: what was read, the frame, the verdict, before and after, what is identified, what to do now.
//!
//! Everything else that a run finds is in `words`, for whoever asks for it.

use super::configuration::Configuration;
use super::damage;
use super::words::{references, rounded, some_of};
use crate::figures::expanded;
use crate::fit::{Identifiability, Model};
use crate::grid::{Tolerance, notices_mm};
use crate::ingest::LossKind;
use crate::io::tables::parameters::{BelongsTo, ParameterQuantity, ParameterRow};
use crate::io::tables::words::Unit;
use crate::join::began;
use crate::judgement::{JoinedSession, Outcome, gravity};
use crate::kinematics::Arm;
use crate::page::percent;
use crate::report::compared::{Compared, Pairs, TableAndArm};
pub use crate::report::next::Next;
use crate::report::next::Stated;
use crate::report::symbols::symbol;
use crate::report::verdict::Applied;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// The sessions that were read: when, and how many of their stations were measured.
    pub read: String,
    /// What has to be known before anything else, a line each; empty where nothing has.
    pub warnings: Vec<String>,
    /// Frame, verdict, errors before and after, and what is identified, a line each.
    pub findings: Vec<String>,
    pub next: Next,
}

/// The tolerance, with its share and its confidence where they are not the usual ones.
fn in_words(tolerance: &Tolerance) -> String {
    let unusual = |share: f64, [before, behind]: [&str; 2]| match percent(share).as_str() {
        "95" => String::new(),
        share => format!(" {before} {share} % {behind}"),
    };
    let share = unusual(tolerance.share, ["for", "of positions"]);
    format!("{} mm{share}{}", tolerance.mm, unusual(tolerance.confidence, ["with", "confidence"]))
}

/// The summary of a run; `table_state` is whether the table that drove it still holds.
pub(super) fn summary(
    outcome: &Outcome<'_>,
    configuration: &Configuration,
    parameters: &[ParameterRow],
    pairs: &Pairs,
    table_state: Option<&str>,
) -> Summary {
    let (verdict, tolerance) = (&outcome.verdict, &configuration.stages.tolerance);
    let mut findings = outcome.frame.lines();
    findings.push(format!("tolerance {}: {}", in_words(tolerance), verdict.statement()));
    findings.extend(before_and_after(pairs, table_state));
    findings.extend(identified(parameters));
    findings.extend(no_gravity(outcome));
    let (stated, doubts) = (stated(outcome, &configuration.arm), outcome.doubts_set_up());
    let next = Next::of(verdict, &outcome.frame, tolerance, stated, doubts);
    Summary { read: read(outcome), warnings: warnings(outcome, tolerance), findings, next }
}

/// What targets have to state: joint angles where poses would be refused, as no tool of the controller is known.
pub(super) fn stated(outcome: &Outcome<'_>, arm: &Arm) -> Stated {
    if outcome.tool_is_target() { Stated::Joints } else { Stated::of(arm) }
}

/// What has to be known of a run before anything else: that its frame is not fixed, where its logs disagree with the stated set-up, and
/// what they lost.
fn warnings(outcome: &Outcome<'_>, tolerance: &Tolerance) -> Vec<String> {
    let least_mm = notices_mm(tolerance.mm, outcome.grids.guard_mm).max(damage::NOTHING);
    let sessions = || outcome.training.iter().chain(&outcome.test);
    let set_up = sessions().filter_map(|session| {
        let finding = session.set_up.as_ref()?;
        Some(format!("{}: check the set-up: {finding}", session.name))
    });
    let lost = sessions().flat_map(|session| damage::words(&session.name, &session.counts));
    let stamps = sessions().flat_map(|session| {
        let stamps = session.log_rejects.iter().filter(|own| own.loss == LossKind::Stamps);
        stamps.map(|own| {
            let topic = own.topic.as_deref().unwrap_or_default();
            format!("{}: topic {topic:?}: {}", session.name, own.reason)
        })
    });
    let open = outcome.frame.open_words().into_iter();
    open.chain(set_up)
        .chain(lost)
        .chain(stamps)
        .chain(references::warned(outcome, least_mm))
        .chain(rounded::warned(outcome, least_mm))
        .chain(upside_down(outcome))
        .collect()
}

/// That the stated direction against gravity points the other way.
fn upside_down(outcome: &Outcome<'_>) -> Option<String> {
    let (joint, sds) = clearest_yield(outcome).filter(|(_, sds)| *sds <= -gravity::SURE)?;
    Some(format!(
        "[robot] up points with gravity: joint {} would yield against its load, by {:.0} standard deviations; write the three numbers \
         with the opposite signs",
        joint + 1,
        -sds
    ))
}

/// That nothing shows which way it points.
fn no_gravity(outcome: &Outcome<'_>) -> Option<String> {
    clearest_yield(outcome).filter(|(_, sds)| sds.abs() < gravity::SURE)?;
    let words = "gravity: no joint yields enough under its load to show that [robot] up points the right way";
    Some(words.to_owned())
}

/// [`gravity::clearest`] of the model that corrects; one that corrects nothing says nothing of it.
fn clearest_yield(outcome: &Outcome<'_>) -> Option<(usize, f64)> {
    if outcome.verdict.applied == Applied::Nothing {
        return None;
    }
    gravity::clearest(outcome.full.as_ref()?, outcome.error_frame.arm.joints().len())
}

/// The sessions, when they were measured, and their stations.
fn read(outcome: &Outcome<'_>) -> String {
    let judged = match &outcome.test[..] {
        [] => String::new(),
        test => format!("; judged by {}", sessions(test)),
    };
    format!("{}{judged}", sessions(&outcome.training))
}

/// One session by its name, several by their number.
fn sessions(sessions: &[JoinedSession]) -> String {
    let stations: usize = sessions.iter().map(|own| own.joined.stations.len()).sum();
    let measured: usize = sessions.iter().map(|own| own.joined.paired()).sum();
    let named = match sessions {
        [one] => {
            began_at(one).map_or_else(|| one.name.clone(), |when| format!("{}, {when}", one.name))
        }
        several => match days(several) {
            Some(days) => format!("{} sessions, {days}", several.len()),
            None => format!("{} sessions", several.len()),
        },
    };
    format!("{named}: {stations} stations, {measured} measured, {} not", stations - measured)
}

/// When the sessions of a run were measured, by their logs; `None` where their clocks do not tell.
pub(super) fn when(outcome: &Outcome<'_>) -> Option<String> {
    match &outcome.training[..] {
        [one] => began_at(one),
        several => Some(format!("{} sessions, {}", several.len(), days(several)?)),
    }
}

/// When a session began, by its logs; `None` where their clocks do not tell.
fn began_at(session: &JoinedSession) -> Option<String> {
    Some(began(&session.joined.clock.model)?.to_string())
}

/// The first and the last day of several sessions; `None` where none has a date.
fn days(sessions: &[JoinedSession]) -> Option<String> {
    let began = sessions.iter().filter_map(|own| began(&own.joined.clock.model));
    let mut days: Vec<String> = began.map(|began| began.day()).collect();
    days.sort_unstable();
    let (first, last) = (days.first()?, days.last()?);
    Some(if first == last { first.clone() } else { format!("{first} to {last}") })
}

/// The errors before and after, with the state of the table that drove the session.
fn before_and_after(pairs: &Pairs, table_state: Option<&str>) -> Vec<String> {
    let words = pairs.stated().and_then(Compared::words);
    let state = table_state.map(|state| format!("driven by a table: {state}"));
    let three = pairs.table_and_arm.as_ref().map(TableAndArm::words);
    words.into_iter().chain(three).chain(state).collect()
}

/// Most parameters that are named because they are not identifiable.
const NAMED: usize = 4;

/// The link parameters that are identified, the clearest of them, and those that are not identifiable.
fn identified(parameters: &[ParameterRow]) -> Option<String> {
    let is_of_links = |own: &&ParameterRow| {
        own.belongs_to == BelongsTo::Link && own.quantity != ParameterQuantity::CommandWeight
    };
    let links = || parameters.iter().filter(is_of_links);
    let of = |model: Model| links().filter(move |own| own.model == model).collect::<Vec<_>>();
    let links = Model::serving().map(of).find(|own| !own.is_empty())?;
    let (found, not): (Vec<&ParameterRow>, Vec<&ParameterRow>) =
        links.iter().partition(|own| own.identifiability == Identifiability::Identifiable);
    let clearest = [Unit::Mm, Unit::Rad].map(|unit| {
        let own = found.iter().filter(|own| own.unit == unit);
        let clearest = own.max_by(|a, b| clarity(a).total_cmp(&clarity(b)));
        clearest.map(|own| value(own))
    });
    let clearest: Vec<String> = clearest.into_iter().flatten().collect();
    let clearest = clearest.join(" and ");
    let clearest = (!clearest.is_empty())
        .then(|| format!(", most clearly {clearest} (± two standard errors)"));
    let not = (!not.is_empty()).then(|| {
        let named = some_of(not.into_iter().map(confounded), NAMED, "more");
        format!("; not identifiable: {named}")
    });
    let identified = format!("identified: {} of {} parameters", found.len(), links.len());
    let [clearest, not] = [clearest, not].map(Option::unwrap_or_default);
    Some(format!("{identified} of the links{clearest}{not}"))
}

/// How many standard errors an offset is large; 0 without one.
fn clarity(parameter: &ParameterRow) -> f64 {
    let error = parameter.standard_error.filter(|error| *error > 0.0);
    error.map_or(0.0, |error| parameter.offset.abs() / error)
}

/// An offset with twice its standard error.
fn value(parameter: &ParameterRow) -> String {
    let (unit, scale) = match parameter.unit {
        Unit::Mm => (" mm", 1.0),
        Unit::Rad => (" mrad", 1e3),
        Unit::One => ("", 1.0),
    };
    let error = parameter.standard_error;
    let error =
        error.map_or_else(String::new, |error| format!(" ± {:.3}", scale * expanded(error)));
    format!("{} {:+.3}{error}{unit}", symbol(&parameter.parameter), scale * parameter.offset)
        .replace('-', "−")
}

/// A parameter with the one that it is confounded with most.
fn confounded(parameter: &ParameterRow) -> String {
    let name = symbol(&parameter.parameter);
    let all = &parameter.confounded_with;
    let most = parameter.most_correlated_with.as_ref();
    match most.filter(|most| all.contains(most)).or(all.first()) {
        Some(other) => format!("{name} (with {})", symbol(other)),
        None => name,
    }
}
