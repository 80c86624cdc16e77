//! `sources`: the instruments of a run, the size of each one's noise, and its share of the information.

use crate::fit::stated_size::FoundSize;
use crate::fit::{Gauge, sources};
use crate::join::{ReadingKind, SourceId};
use crate::judgement::Source;
use crate::report::Model;
use crate::rows::{row, words};

row! {
    pub struct SourceRow of "sources" {
        model: Model,
        source_index: usize,
        source: String,
        reads: ReadingKind,
        readings: usize,
        numbers: usize,
        stated_sd_mm: f64,
        noise_factor: Option<f64>,
        noise_factor_se: Option<f64>,
        sized_sessions: Vec<String>,
        stated_sizes: Vec<f64>,
        stated_size_ses: Vec<f64>,
        stated_orientation_sizes: Vec<f64>,
        stated_orientation_size_ses: Vec<f64>,
        redundancy: Option<f64>,
        information_share: Option<f64>,
        prior_share: Option<f64>,
        anchor as point: Option<[f64; 3]>,
        anchor_offset_mm: Option<f64>,
        normal as [normal_x, normal_y, normal_z]: Option<[f64; 3]>,
        plane_height_mm: Option<f64>,
        held_out: usize,
        held_out_rms_mm: Option<f64>,
    }
}

words! {
    ReadingKind { Point: "point", Pose: "pose", Distance: "distance", Height: "height" }
}

/// The rows of all sources in all models; none where one instrument measured, whose share is all there is, and its readings do not show
/// the size of what they state. `sessions` are those that trained.
pub fn rows(all: &[Source], sized: &[FoundSize], sessions: &[&str]) -> Vec<SourceRow> {
    let several = all.iter().any(|own| own.size.source != SourceId::ONLY);
    let all = if several || !sized.is_empty() { all } else { &[] };
    let row = |own: &Source| {
        let sized = sized.iter().filter(|of| of.source == own.size.source);
        with_sizes(of_source(own, all), sized, sessions)
    };
    all.iter().map(row).collect()
}

/// A row with the sizes of what the source's readings state.
fn with_sizes<'f>(
    mut row: SourceRow,
    sized: impl Iterator<Item = &'f FoundSize>,
    sessions: &[&str],
) -> SourceRow {
    for own in sized {
        row.sized_sessions.push(sessions[own.session].to_owned());
        row.stated_sizes.push(own.size.position);
        row.stated_size_ses.push(own.standard_error.position);
        if own.has_orientations {
            row.stated_orientation_sizes.push(own.size.orientation);
            row.stated_orientation_size_ses.push(own.standard_error.orientation);
        }
    }
    row
}

fn of_source(own: &Source, all: &[Source]) -> SourceRow {
    let sizes = all.iter().filter(|other| other.model == own.model);
    let sizes: Vec<_> = sizes.map(|other| other.size.clone()).collect();
    let size = &own.size;
    let (anchor, plane) = match &own.gauge {
        Some(Gauge::Distance(anchor)) => (Some(anchor), None),
        Some(Gauge::Height(plane)) => (None, Some(plane)),
        None => (None, None),
    };
    let fitted = |value: f64| own.is_fitted.then_some(value);
    SourceRow {
        model: own.model,
        source_index: size.source.0,
        source: own.name.clone(),
        reads: size.kind,
        readings: size.readings,
        numbers: size.rows,
        stated_sd_mm: size.stated_mm,
        noise_factor: own.factor,
        noise_factor_se: size.factor_error().filter(|_| own.is_fitted),
        sized_sessions: Vec::new(),
        stated_sizes: Vec::new(),
        stated_size_ses: Vec::new(),
        stated_orientation_sizes: Vec::new(),
        stated_orientation_size_ses: Vec::new(),
        redundancy: fitted(size.redundancy),
        information_share: fitted(size.share),
        prior_share: fitted((1.0 - sources::shares(&sizes)).max(0.0)),
        anchor: anchor.map(|anchor| anchor.place.coords.into()),
        anchor_offset_mm: anchor.map(|anchor| anchor.offset_mm),
        normal: plane.map(|plane| plane.normal.into_inner().into()),
        plane_height_mm: plane.map(|plane| plane.height_mm),
        held_out: own.held_out,
        held_out_rms_mm: own.held_out_rms_mm,
    }
}
