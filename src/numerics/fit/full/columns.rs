//! The columns that a training starts with, and the prior variances of geometry and frames.

use std::f64::consts::TAU;

use nalgebra::{DVector, Point3, Vector3};

use super::ageing;
use super::design::gravity_columns;
use super::layout::{Block, Layout};
use super::repairs;
use super::settings::FullSettings;
use crate::figures::extremes;
use crate::fit::frames::Frames;
use crate::fit::observation::Observation;
use crate::fit::problem::{Problem, Unknown, is_turned};
use crate::join::SourceId;
use crate::units::whole;

/// Harmonics of a joint that hardly moves the target.
pub(super) const FEW_HARMONICS: usize = 12;
/// A joint moves the target little when its lever is below this share of the largest.
const LITTLE: f64 = 0.05;

pub(super) fn layout(
    problem: &Problem<'_>,
    offsets: &DVector<f64>,
    settings: &FullSettings,
    has_up: bool,
    span: f64,
) -> Layout {
    let sessions = problem.starts.len();
    let observations = problem.observations;
    let joints = observations.first().map_or(0, |o| o.axes.len());
    let mut layout = Layout::new(settings.curve_period_turns);
    layout.slide_periods_mm = slide_periods_mm(problem, settings);
    let days = days(observations, sessions);
    layout.ages_years = ageing::ages_years(&days);
    layout.repairs_to_come = repairs::to_come(&settings.repaired, &days, joints);
    layout.push(Block::Unknowns, problem.unknowns.len());
    if settings.gravity && has_up {
        layout.push(Block::Gravity, gravity_columns(joints));
    }
    if settings.command_weight {
        command_weights(&mut layout, observations, sessions, joints);
    }
    if settings.drift {
        // Beyond this order the prior has less than a thousandth of its variance.
        let orders = whole((3.0 * span / settings.drift_length_stations).ceil().clamp(6.0, 40.0));
        let drifting: Vec<usize> = (0..sessions).filter(|own| drifts(observations, *own)).collect();
        if !drifting.is_empty() {
            layout.push(Block::WarmUp, 3 * orders);
        }
        for session in drifting {
            layout.push(Block::Drift(session), 3 * orders);
        }
    }
    if settings.session_scale_ppm > 0.0 {
        (0..sessions).for_each(|session| layout.push(Block::Scale(session), 1));
    }
    let harmonics = harmonics(problem, offsets, settings, joints);
    for (joint, harmonics) in harmonics.into_iter().enumerate() {
        let harmonics = layout
            .slide_period_mm(joint)
            .filter(|_| harmonics > 0)
            .map_or(harmonics, |period_mm| slide_harmonics(settings, period_mm));
        layout.push(Block::Curve(joint), 2 * harmonics);
        let to_come = (0..sessions).map(|session| layout.to_come(Some(session), joint));
        for to_come in 1..=to_come.max().unwrap_or(0) {
            layout.push(Block::Earlier { joint, to_come }, 2 * harmonics + 1);
        }
        let coarse = 2 * few_harmonics(settings).min(harmonics) + 1;
        for session in (0..sessions).filter(|_| sessions > 1) {
            layout.push(Block::SessionCurve { session, joint }, coarse);
        }
        for step in 0..ageing::steps(&layout.ages_years) {
            layout.push(Block::Ageing { joint, step }, coarse);
        }
    }
    layout
}

fn days(observations: &[Observation], sessions: usize) -> Vec<Option<f64>> {
    let mut days = vec![None; sessions];
    for observation in observations {
        days[observation.session] = observation.day;
    }
    days
}

/// Whether a session's base may have drifted unseen: references that were followed show the drift itself.
fn drifts(observations: &[Observation], session: usize) -> bool {
    let mut own = observations.iter().filter(|o| o.session == session);
    !own.any(|o| o.follows_references)
}

/// The middle of each session's stations by the nominal arm, in the base frame, mm.
pub(super) fn middles(problem: &Problem<'_>) -> Vec<Point3<f64>> {
    let nominal = problem.held(&DVector::zeros(problem.unknowns.len()));
    // Those that one source saw, in the base frame, and how many there are.
    let seen_by = |session: usize, frames: &Frames, source: SourceId| {
        let own = problem.observations.iter();
        let own = own.filter(|o| (o.session, o.source) == (session, source));
        let (sum, count) = own.fold((Vector3::zeros(), 0_usize), |(sum, count), o| {
            (sum + nominal.of(o.channel()).view(&o.axes).end.translation.vector, count + 1)
        });
        let in_tracker = Point3::from(sum / count.max(1) as f64);
        let base = frames.tracker_from_base(source).isometry();
        (base.inverse_transform_point(&in_tracker), count)
    };
    let middle = |(session, frames): (usize, &Frames)| {
        let sources = (0..frames.sources().len()).map(SourceId);
        let seen = sources.map(|source| seen_by(session, frames, source));
        let middle = seen.reduce(|(middle, before), (other, more)| {
            let share = more as f64 / (before + more).max(1) as f64;
            (middle + (other - middle) * share, before + more)
        });
        middle.map_or_else(Point3::origin, |(middle, _)| middle)
    };
    problem.starts.iter().enumerate().map(middle).collect()
}

fn command_weights(
    layout: &mut Layout,
    observations: &[Observation],
    sessions: usize,
    joints: usize,
) {
    let sent = |session: usize, is_sent: bool| {
        let own = observations.iter().filter(|o| o.session == session);
        own.filter_map(|o| o.settling_error.as_ref())
            .any(|settling_error| settling_error.sent().is_some() == is_sent)
    };
    if (0..sessions).any(|session| sent(session, true)) {
        layout.push(Block::CommandWeight, joints);
        layout.push(Block::ApproachOffset, joints);
    }
    for session in 0..sessions {
        if sessions > 1 && sent(session, true) {
            layout.push(Block::SessionCommandWeight(session), joints);
        }
        if sent(session, false) {
            layout.push(Block::OwnCommandWeight(session), joints);
        }
    }
}

/// Number of harmonics of a coarse curve or of a joint that hardly moves the target.
pub(super) const fn few_harmonics(settings: &FullSettings) -> usize {
    FEW_HARMONICS * settings.curve_period_turns as usize
}

/// Period of the curve of each axis variable that slides, mm, `None` where it turns; empty where all turn.
///
/// A curve lives on a circle. Twice the measured range and two long lengths around, the ends of the range are so far apart that
/// neither says anything of the other: on the range the kernel is that of plain distance.
fn slide_periods_mm(problem: &Problem<'_>, settings: &FullSettings) -> Vec<Option<f64>> {
    let slides = problem.slides();
    if !slides.contains(&true) {
        return Vec::new();
    }
    let period_mm = |(joint, slides): (usize, bool)| {
        let outermost = extremes(problem.observations.iter().map(|o| o.axes[joint]));
        let range_mm = outermost.map_or(0.0, |(low, high)| high - low);
        slides.then_some(2.0 * (range_mm + settings.slide_length_mm[1]))
    };
    slides.into_iter().enumerate().map(period_mm).collect()
}

/// Number of harmonics of the curve of a joint that slides: as fine beside its short length as a turning joint's beside its own.
fn slide_harmonics(settings: &FullSettings, period_mm: f64) -> usize {
    let short_rad = TAU * settings.slide_length_mm[0] / period_mm;
    let all = settings.harmonics as f64;
    let wanted = all * settings.short_length_deg.to_radians() / short_rad;
    whole(wanted.ceil().clamp(1.0, 2.0 * all))
}

fn harmonics(
    problem: &Problem<'_>,
    offsets: &DVector<f64>,
    settings: &FullSettings,
    joints: usize,
) -> Vec<usize> {
    if settings.harmonics == 0 {
        return vec![0; joints];
    }
    let observations = problem.observations;
    let chains = problem.held(offsets);
    let views = observations.iter().map(|o| chains.of(o.channel()).view(&o.axes).joints);
    let levers = views.fold(vec![0.0f64; joints], |largest, twists| {
        largest.iter().zip(twists).map(|(lever, twist)| lever.max(twist.linear.norm())).collect()
    });
    let longest = levers.iter().copied().fold(0.0, f64::max);
    // An orientation shows what a position near the axis does not.
    let turned = is_turned(observations);
    let all = settings.harmonics * settings.curve_period_turns as usize;
    let few = if turned { 2 * all / 3 } else { few_harmonics(settings) };
    let count = |lever: &f64| {
        if *lever > LITTLE * longest { all } else { few }
    };
    levers.iter().map(count).collect()
}

/// Prior variances of the problem's unknowns; those without a prior get one far wider than any error of a frame.
pub(super) fn unknown_variances(problem: &Problem<'_>) -> Vec<f64> {
    const WIDE_MM: f64 = 300.0;
    const WIDE_RAD: f64 = 0.3;
    let variance = |(&p, unknown): (&f64, &Unknown)| {
        let wide = if unknown.parameter.is_angle() { WIDE_RAD } else { WIDE_MM };
        if p > 0.0 { p.recip() } else { wide.powi(2) }
    };
    problem.precision.iter().zip(&problem.unknowns).map(variance).collect()
}
