//! `[[stations.lengths]]` and `[[tracker.lengths]]`: what can be wrong with instruments of one length before a file is opened.

use super::checks::{Check, paths, wrong_if, wrong_unless};
use crate::ingest::{
    LengthColumns, LengthRead, LengthSource, LoggedLength, StandsOn, StationsSettings,
    TrackerSettings,
};

/// Checks the instruments that read one length, in columns of a table.
pub(super) fn columns(stations: &StationsSettings, targets: &[String]) -> Check {
    let named = |name: &str| {
        let mut references = stations.references.iter();
        targets.iter().any(|own| own == name) || references.any(|own| own.name == name)
    };
    let shared = stations.lengths.iter().find(|length| named(&length.name));
    let shared = shared.filter(|_| stations.target.is_some());
    wrong_if(
        shared.map(|own| format!("{:?}, which is a target's or a reference's", own.name)),
        "[[stations.lengths]] name",
        "a name of its own: rows of single readings name the instrument in the column of [stations] target",
    )?;
    let own: Vec<LengthSource<'_>> = stations.lengths.iter().map(LengthColumns::source).collect();
    let references: Vec<StandsOn> = stations.references.iter().map(|own| own.on).collect();
    sources("[[stations.lengths]]", &own, targets, &references)
}

/// Checks the instruments that read one length, in the tracker's log.
pub(super) fn logged(tracker: &TrackerSettings, is_eye_in_hand: bool) -> Check {
    wrong_unless(
        tracker.lengths.is_empty() || !is_eye_in_hand,
        "[[tracker.lengths]]",
        "beside a camera on the flange",
        "left out: they read a target at the flange, and such a camera's is in the cell",
    )?;
    let others = tracker.topics();
    let others: Vec<&str> = others.into_iter().chain(tracker.temperature.as_deref()).collect();
    tracker.lengths.iter().try_for_each(|own| {
        wrong_unless(
            !others.contains(&own.topic.as_str()),
            "[[tracker.lengths]] topic",
            format!(
                "{:?} of {:?}, which is read for positions or temperatures",
                own.topic, own.name
            ),
            "a topic of lengths: several instruments may share one",
        )?;
        let named: Vec<&str> = own.field.iter().map(String::as_str).collect();
        paths("[[tracker.lengths]] field", &named)?;
        let mut alike = tracker.lengths.iter().filter(|other| other.topic == own.topic);
        let differs = alike
            .find(|other| other.stamp != own.stamp || (other.field.is_none() && *other != own));
        wrong_if(
            differs.map(|_| format!("{:?} of several instruments", own.topic)),
            "[[tracker.lengths]] topic",
            "a `field` of each where several share a topic, and one `stamp`",
        )
    })?;
    let own: Vec<LengthSource<'_>> = tracker.lengths.iter().map(LoggedLength::source).collect();
    let references: Vec<StandsOn> = tracker.references.iter().map(|own| own.on).collect();
    sources("[[tracker.lengths]]", &own, &tracker.target_names(), &references)
}

/// Checks what is stated of the instruments that read one length, beside references that stand on these.
fn sources(
    section: &str,
    own: &[LengthSource<'_>],
    targets: &[String],
    references: &[StandsOn],
) -> Check {
    let key = |key: &str| format!("{section} {key}");
    let mut twice = own.iter().enumerate();
    let twice =
        twice.find(|(place, length)| own[..*place].iter().any(|other| other.name == length.name));
    let twice = twice.map(|(_, length)| format!("{:?} twice", length.name));
    wrong_if(twice, key("name"), "names, each of one instrument")?;
    own.iter().try_for_each(|length| {
        let name = length.name;
        let is_anchored = length.place.is_some() || length.offset.is_some();
        wrong_unless(
            length.reads == LengthRead::Distance || !is_anchored,
            key("place and offset"),
            format!("of {name:?}, which reads heights above a plane"),
            "left out: only distances have an anchor",
        )
    })?;
    let stray = own.iter().find(|own| own.target_among(targets).is_none());
    wrong_if(
        stray.map(|length| format!("{:?}", length.target)),
        key("target"),
        if targets.is_empty() {
            "left out: the log has one target, which has no name".to_owned()
        } else {
            format!("one of the targets measured: {}", targets.join(", "))
        },
    )?;
    stand_with_references(section, own, references)
}

/// Checks that instruments of one length keep their places where references on the base follow its motion: an anchor on the floor has
/// another place in the frame of a base that moved.
fn stand_with_references(
    section: &str,
    own: &[LengthSource<'_>],
    references: &[StandsOn],
) -> Check {
    let is_followed = references.contains(&StandsOn::Base);
    let mut own = own.iter();
    let moved = own.find(|own| is_followed && own.on != Some(StandsOn::Base));
    let moved = moved.map(|own| {
        let on = own.on.map_or("nothing", StandsOn::word);
        format!("{on:?} of {:?} beside references on the base", own.name)
    });
    wrong_if(
        moved,
        format!("{section} on"),
        "\"base\" where its anchor or plane stands on the base; one on the floor changes its place in the base's frame when the base \
         moves, which is not followed: leave out that instrument, or the references on the base",
    )
}
