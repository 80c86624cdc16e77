//! Everything that a run finds beside its summary, as lines for a person.

pub(super) mod references;
pub(super) mod rounded;

use crate::figures::expanded;
use crate::fit::Corrects;
use crate::fit::full::FullModel;
use crate::fit::model::PartEvidence;
use crate::fit::stated_size::FoundSize;
use crate::join::TargetId;
use crate::judgement::{JoinedSession, Outcome, ShownFlange, Source, sizes};
use crate::report::verdict::{self, Judge, figure_of_model};
use crate::report::{Accuracy, BaseRefit, Model, Moment, Split};
use crate::units::NS_PER_S;

/// Findings that a page has no section for: named scales, and stations with little weight in the full error model.
pub(super) fn notes(outcome: &Outcome<'_>) -> Vec<String> {
    let named = several_sources(outcome).chain(sizes::named(&outcome.scales));
    let named =
        references::followed(outcome).into_iter().chain(several_targets(outcome)).chain(named);
    let more = far_stations(outcome).into_iter().chain(left_out(outcome));
    let stated = stated_words(outcome).collect::<Vec<String>>();
    named.chain(stated).chain(more).collect()
}

/// The results that the summary leaves out.
pub(super) fn words(outcome: &Outcome<'_>) -> Vec<String> {
    let pooled = outcome.training.len() > 1;
    let sessions = outcome.training.iter().chain(&outcome.test);
    let headlines = outcome.accuracy.iter().filter(|a| is_headline(a));
    let mut words: Vec<String> = sessions.map(session_words).collect();
    words.extend(references::followed(outcome));
    words.extend(several_targets(outcome));
    words.extend(several_sources(outcome));
    words.extend(headlines.filter_map(|accuracy| figure_words(accuracy, pooled)));
    words.extend(outcome.full.as_ref().map(part_words));
    words.extend(camera_words(outcome));
    words.extend(stated_words(outcome));
    words.extend(sizes::named(&outcome.scales));
    words.extend(far_stations(outcome));
    words.push(format!("grid: {}", outcome.grids.choice.words));
    words.extend(judged_by(outcome));
    words.push(format!("beside it: {}", outcome.verdict.other_statement()));
    words
}

/// The size of a camera's noise.
fn camera_words(outcome: &Outcome<'_>) -> Option<String> {
    let found = outcome.camera_size?;
    Some(format!(
        "camera: noise {:.2} ± {:.2} times what is stated for it, by likelihood over {} readings, beside {:.3} mm per axis that is not the \
         camera's",
        found.size,
        expanded(found.size_se),
        found.readings,
        found.beside_mm
    ))
}

/// The size of the covariances that readings state, for each session and source that determine one.
fn stated_words(outcome: &Outcome<'_>) -> impl Iterator<Item = String> {
    let words = |own: &FoundSize| {
        let session = &outcome.training[own.session].name;
        let (size, error) = (&own.size, &own.standard_error);
        let of_turns = || {
            let expanded = expanded(error.orientation);
            format!(" of positions, {:.2} ± {expanded:.2} times of orientations", size.orientation)
        };
        let turns = if own.is_apart { of_turns() } else { String::new() };
        format!(
            "{session}: the noise of its readings is {:.2} ± {:.2} times what they state of themselves{turns}, by likelihood over {} \
             readings, beside {:.3} mm per axis of the arm",
            size.position,
            expanded(error.position),
            own.readings,
            own.beside_mm
        )
    };
    outcome.stated_sizes.iter().map(words)
}

/// The judgement of each judge, where a test session is one; and of the sessions of a pool that were left out in turn.
fn judged_by(outcome: &Outcome<'_>) -> Vec<String> {
    let judges = outcome.verdict.judges();
    let line = |judge: &Judge| format!("judged by {}", judge.line());
    judges.iter().filter(|_| judges.len() > 1).map(line).chain(left_out(outcome)).collect()
}

/// Sessions of a pool, each by an estimate that did not see it. They inform and decide nothing: no such estimate is
/// published, and the published one was learnt from them.
fn left_out(outcome: &Outcome<'_>) -> Option<String> {
    let verdict = |session: &JoinedSession| {
        let figure = figure_of_model(&outcome.accuracy, &session.name)?;
        Some(format!("{} {}", session.name, verdict::word(&figure.verdict)))
    };
    let verdicts: Vec<String> = outcome.training.iter().filter_map(verdict).collect();
    (!verdicts.is_empty()).then(|| {
        format!(
            "each session by an estimate of the others, which informs and decides nothing: {}",
            verdicts.join(", ")
        )
    })
}

fn session_words(session: &JoinedSession) -> String {
    let (name, all) = (&session.name, session.joined.stations.len());
    let paired = session.joined.paired();
    let counted = format!("{name}: {all} stations, {paired} measured, {} not", all - paired);
    let clock = &session.joined.clock;
    if clock.matched_edges == 0 {
        return format!("{counted}; {}", clock.method);
    }
    let (ahead_s, ppm) = (clock.model.offset_ns / NS_PER_S, clock.model.drift * 1e6);
    format!("{counted}; tracker clock {ahead_s:+.4} s ahead, drift {ppm:+.2} ppm")
}

/// For each session with several targets what stands for the readings of its stations.
fn several_targets(outcome: &Outcome<'_>) -> impl Iterator<Item = String> {
    let main = TargetId::MAIN.name(&outcome.targets.names);
    let words = move |shown: &ShownFlange| {
        format!(
            "{}: errors are of target {main}: at {} stations with the orientation that three or more targets show, at {} by its own \
             position, at {} stations neither (their readings count in the fit)",
            shown.session, shown.poses, shown.points, shown.neither
        )
    };
    outcome.targets.sessions.iter().map(words)
}

/// For each source beside others, or of one length, the size of its noise and its share of the information on the geometry.
fn several_sources(outcome: &Outcome<'_>) -> impl Iterator<Item = String> {
    let geometric = |own: &&Source| own.model == Model::Geometric;
    let own: Vec<&Source> = outcome.sources.iter().filter(geometric).collect();
    let is_plain = own.iter().all(|own| !own.size.kind.is_length());
    let words = |own: &Source| {
        let size = &own.size;
        let error = size
            .factor_error()
            .map_or_else(String::new, |error| format!(" ± {:.2}", expanded(error)));
        let left = own.held_out_rms_mm.map_or_else(String::new, |rms_mm| {
            let full = outcome.sources.iter().filter(|other| other.model == Model::Full);
            let mut full = full.filter(|other| other.size.source == size.source);
            let full_mm = full.next().and_then(|other| other.held_out_rms_mm);
            let full_mm = full_mm.map_or_else(String::new, |rms_mm| {
                format!(", {rms_mm:.3} mm by the full error model")
            });
            format!("; held out rms {rms_mm:.3} mm by the geometry{full_mm}")
        });
        format!(
            "source {}: {} readings, noise {:.2}{error} times the stated {:.3} mm in the geometry's fit, {:.0} % of the information{left}",
            own.name,
            size.readings,
            size.factor,
            size.stated_mm,
            100.0 * size.share
        )
    };
    own.into_iter().filter(|_| !is_plain).map(words).collect::<Vec<String>>().into_iter()
}

fn part_words(full: &FullModel) -> String {
    let part = |part: &PartEvidence| {
        let disposition = if part.kept { "kept" } else { "dropped" };
        format!("{} {disposition} ({:+.0} nats)", part.name, part.gain)
    };
    let parts: Vec<String> = full.trained.parts.iter().map(part).collect();
    format!("parts of the model by evidence: {}", parts.join(", "))
}

/// Largest weight in the full error model of a station that counts as far from the others' prediction.
const FAR: f64 = 0.25;
/// Most stations that are named.
const NAMED: usize = 5;

/// Stations with little weight in the full error model, the smallest weight first, with their distance from the others'
/// prediction.
fn far_stations(outcome: &Outcome<'_>) -> Option<String> {
    let full = outcome.full.as_ref()?;
    let angles = Model::Full.about().angles.first();
    let paired = outcome.training.iter().flat_map(|session| {
        // The residuals of training are in the order of the observations, of which a station may have several.
        let sets = outcome.residuals.iter().filter(|set| {
            let own = &set.subject;
            (own.model, own.split) == (Model::Full, Split::None)
                && Some(&own.angles) == angles
                && own.of_session == session.name
        });
        let read = sets.flat_map(|set| &set.residuals);
        read.map(|residual| (session.name.as_str(), residual.station))
    });
    // Lengths have no residual of a position.
    let weighed = full.trained.weights.iter().zip(&full.left_out);
    let weighed = weighed.filter(|(_, left_out)| left_out.len() >= 3);
    let judged = paired.zip(weighed);
    let mut far: Vec<(f64, String)> = judged
        .filter(|(_, (weight, _))| **weight < FAR)
        .map(|((session, station), (weight, left_out))| {
            let away = left_out.rows(0, 3).norm();
            (*weight, format!("{session} {station} ({away:.2} mm)"))
        })
        .collect();
    far.sort_by(|a, b| a.0.total_cmp(&b.0));
    (!far.is_empty()).then(|| {
        let named = some_of(far.into_iter().map(|(_, name)| name), NAMED, "more");
        format!("stations far from the prediction of all others, with little weight: {named}; see weight in residuals")
    })
}

/// So many of the names at most, the first ones, with the number of the others, which are called `others`.
pub(crate) fn some_of(
    names: impl ExactSizeIterator<Item = String>,
    most: usize,
    others: &str,
) -> String {
    let more = names.len().saturating_sub(most);
    let first = names.take(most).collect::<Vec<_>>().join(", ");
    if more == 0 { first } else { format!("{first} and {more} {others}") }
}

/// Whether the figures are on stations that took no part, or of the raw command.
fn is_headline(accuracy: &Accuracy) -> bool {
    let subject = &accuracy.subject;
    subject.model.about().corrects == Corrects::Nothing
        || (subject.split != Split::None && subject.base_refit != BaseRefit::All)
}

fn judged_on(accuracy: &Accuracy, pooled: bool) -> String {
    let subject = &accuracy.subject;
    match (subject.split, subject.base_refit) {
        (Split::None, _) => String::new(),
        _ if accuracy.moment == Moment::MeasuredAfter => {
            " that drove this session, MEASURED AFTER with the base from its first stations"
                .to_owned()
        }
        _ if accuracy.driven_by.is_some() => ", the same stations".to_owned(),
        (Split::Blocks, _) if pooled => format!(", held-out blocks of {}", subject.of_session),
        (Split::Blocks, _) => ", held-out blocks".to_owned(),
        (Split::Session, BaseRefit::None) => format!(", unseen session {}", subject.of_session),
        (Split::Session, _) => {
            let found = accuracy.finders.as_ref();
            let found = found.map_or_else(String::new, |own| format!(", {}", own.words()));
            format!(", unseen session {}{found}", subject.of_session)
        }
    }
}

fn figure_words(accuracy: &Accuracy, pooled: bool) -> Option<String> {
    let figures = accuracy.figures?;
    let subject = &accuracy.subject;
    let mut model = subject.model.name_at(subject.angles);
    if subject.model.about().corrects == Corrects::Nothing {
        model.insert_str(0, "error relative to the ");
    }
    let judged = judged_on(accuracy, pooled);
    let bound = accuracy
        .bound
        .map_or_else(|| "bound not shown".to_owned(), |bound| format!("bound {bound:.3} mm"));
    Some(format!(
        "{model}{judged}: mean {:.3}, p95 {:.3}, max {:.3} mm, {bound} ({})",
        figures.mean, figures.p95, figures.max, accuracy.counted
    ))
}
