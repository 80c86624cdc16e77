//! Variance components: the size of each part of the model, estimated from the session itself.
//!
//! A component has a size `a` and a profile over columns; a column's prior variance is the sum of its components'. The
//! update is `MacKay`'s fixed point on the marginal likelihood, split among components by their share in each column, with
//! a weak gamma prior on `a` (shape 1 + ν₀/2, mode at a₀). Its fixed points are those of the likelihood's gradient
//! `½ (μ_k²/v_k + Σ_kk/v_k − 1)`.

use std::ops::Range;

use nalgebra::DVector;

use super::layout::{Block, Layout};
use super::repairs::ZERO_SD_RAD;
use super::settings::FullSettings;
use super::spectrum::{Kernel, Spectra, smooth_variances};
use crate::units::{SLIDE_MM_PER_RAD, per_radian};

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    ShortCurve(usize),
    LongCurve(usize),
    Gravity,
    ApproachOffset,
    WarmUp,
    Drift,
    SessionCurve,
    Ageing,
    SessionCommandWeight,
    Line { joint: usize, cycles: f64 },
}

#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    pub part: Part,
    /// Its size: a variance in the square of the part's unit (rad, mm or 1).
    pub size: f64,
    profiles: Vec<(Range<usize>, Vec<f64>)>,
    expected: f64,
    weight: f64,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Components {
    pub all: Vec<Component>,
    fixed: Vec<f64>,
}

pub(super) const WEIGHT: f64 = 2.0;
/// A step of the fixed point is damped by this power, so that parts that share columns do not oscillate.
const DAMPING: f64 = 0.8;
const LARGEST_CHANGE: f64 = 20.0;

impl Components {
    /// The components of `layout` at their expected sizes; `unknowns` are prior variances of the problem's unknowns.
    pub fn new(layout: &Layout, unknowns: &[f64], settings: &FullSettings, span: f64) -> Self {
        let mut components = Self { all: Vec::new(), fixed: vec![0.0; layout.size()] };
        let mut spectra = Spectra::default();
        for (block, columns) in layout.blocks() {
            components.add(layout, (block, columns), (unknowns, &mut spectra), settings, span);
        }
        components
    }

    /// Adds the gear lines of `layout` that are not among the components yet, at their expected sizes.
    pub(super) fn add_lines(&mut self, layout: &Layout, settings: &FullSettings) {
        let known = self.fixed.len();
        self.fixed.resize(layout.size(), 0.0);
        for (block, columns) in layout.blocks().filter(|(_, own)| own.start >= known) {
            if let Block::Line { joint, cycles } = block {
                self.add_line(joint, cycles, columns, settings);
            }
        }
    }

    pub fn variances(&self) -> DVector<f64> {
        let mut variances = DVector::from_column_slice(&self.fixed);
        for component in &self.all {
            for (columns, profile) in &component.profiles {
                for (column, share) in columns.clone().zip(profile) {
                    variances[column] += component.size * share;
                }
            }
        }
        variances
    }

    /// One step of the fixed point: `squares` are `μ_k²/v_k`, `determined` is `1 − Σ_kk/v_k`, at prior variances `v`.
    pub fn update(
        &mut self,
        squares: &DVector<f64>,
        determined: &DVector<f64>,
        variances: &DVector<f64>,
    ) {
        for component in &mut self.all {
            let (squared, counted) = component.shown(squares, determined, variances);
            let weight = component.weight;
            let ratio =
                (squared + weight) / (counted + weight * component.size / component.expected);
            component.size *= ratio.clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE).powf(DAMPING);
        }
    }

    /// Those of the first columns of each block: as many as `narrow` has of `wide`, their layout.
    pub(super) fn narrowed(&self, wide: &Layout, narrow: &Layout) -> Self {
        let blocks = wide.blocks().zip(narrow.blocks());
        let stays =
            blocks.flat_map(|((_, own), (_, kept))| (0..own.len()).map(move |k| k < kept.len()));
        let stays: Vec<bool> = stays.collect();
        let place = |column: usize| stays[..column].iter().filter(|&&stays| stays).count();
        let mut narrowed = self.clone();
        let mut each = stays.iter();
        narrowed.fixed.retain(|_| each.next() == Some(&true));
        for (columns, profile) in narrowed.all.iter_mut().flat_map(|own| &mut own.profiles) {
            *columns = place(columns.start)..place(columns.end);
            profile.truncate(columns.len());
        }
        narrowed
    }

    /// Takes the sizes of the same components of another layout.
    pub(super) fn take_sizes(&mut self, other: &Self) {
        for (own, other) in self.all.iter_mut().zip(&other.all) {
            own.size = other.size;
        }
    }

    pub fn size(&self, part: Part) -> Option<f64> {
        self.all.iter().find(|component| component.part == part).map(|component| component.size)
    }

    /// Sets the size of every component for which `is_of` is true to zero: the model without that part.
    pub(super) fn drop_parts(&mut self, is_of: impl Fn(Part) -> bool) {
        for component in self.all.iter_mut().filter(|component| is_of(component.part)) {
            component.size = 0.0;
        }
    }

    fn add(
        &mut self,
        layout: &Layout,
        (block, columns): (Block, Range<usize>),
        (unknowns, spectra): (&[f64], &mut Spectra),
        settings: &FullSettings,
        span: f64,
    ) {
        let s = settings;
        match block {
            Block::Unknowns => self.fixed[columns].copy_from_slice(unknowns),
            Block::CommandWeight | Block::OwnCommandWeight(_) => {
                self.fixed[columns].fill(s.command_weight_sd.powi(2));
            }
            Block::Scale(_) => self.fixed[columns].fill((1e-6 * s.session_scale_ppm).powi(2)),
            Block::Gravity => {
                let profile = gravity_profile(layout, s, columns.len());
                self.join(Part::Gravity, s.gravity_sd, columns, profile);
            }
            Block::ApproachOffset => {
                let profile = approach_profile(layout, columns.len());
                self.join(Part::ApproachOffset, s.approach_offset_sd_rad, columns, profile);
            }
            Block::SessionCommandWeight(_) => {
                let even = vec![1.0; columns.len()];
                self.join(Part::SessionCommandWeight, s.session_command_weight_sd, columns, even);
            }
            Block::WarmUp | Block::Drift(_) => {
                let part = if block == Block::WarmUp { Part::WarmUp } else { Part::Drift };
                let profile = drift_profile(s, span, columns.len());
                self.join(part, s.drift_sd_mm, columns, profile);
            }
            Block::Curve(joint) => self.add_curve(layout, joint, columns, spectra, s),
            Block::Earlier { joint, .. } => {
                let slides = layout.slide_period_mm(joint).is_some();
                self.fixed[columns.start] = (ZERO_SD_RAD * per_radian(slides)).powi(2);
                self.add_curve(layout, joint, columns.start + 1..columns.end, spectra, s);
            }
            Block::SessionCurve { joint, .. } => {
                let profile = change_profile(layout, s, joint, columns.len(), spectra);
                self.join(Part::SessionCurve, s.session_curve_sd_rad, columns, profile);
            }
            Block::Ageing { joint, step } => {
                let mut profile = change_profile(layout, s, joint, columns.len(), spectra);
                let years = super::ageing::years(step);
                for share in &mut profile {
                    *share *= years;
                }
                self.join(Part::Ageing, s.session_curve_sd_rad, columns, profile);
            }
            Block::Line { joint, cycles } => self.add_line(joint, cycles, columns, s),
        }
    }

    fn add_curve(
        &mut self,
        layout: &Layout,
        joint: usize,
        columns: Range<usize>,
        spectra: &mut Spectra,
        settings: &FullSettings,
    ) {
        let ([short, long], sd) = curve_sizes(layout, settings, joint);
        let (short, long) = (Kernel::Matern52(short), Kernel::SquaredExponential(long));
        for (part, kernel) in [(Part::ShortCurve(joint), short), (Part::LongCurve(joint), long)] {
            let profile = pairs(&spectra.variances(kernel, columns.len() / 2)[1..]);
            self.join(part, sd, columns.clone(), profile);
        }
    }

    fn add_line(
        &mut self,
        joint: usize,
        cycles: f64,
        columns: Range<usize>,
        settings: &FullSettings,
    ) {
        let even = vec![1.0; columns.len()];
        self.join(Part::Line { joint, cycles }, settings.line_sd_rad, columns, even);
    }

    fn join(&mut self, part: Part, sd: f64, columns: Range<usize>, profile: Vec<f64>) {
        // A gear line has two columns: a prior of two observations would outweigh them.
        let weight = if matches!(part, Part::Line { .. }) { 1.0 } else { WEIGHT };
        if let Some(own) = self.all.iter_mut().find(|component| component.part == part) {
            own.profiles.push((columns, profile));
            return;
        }
        let size = sd * sd;
        self.all.push(Component {
            part,
            size,
            profiles: vec![(columns, profile)],
            expected: size,
            weight,
        });
    }
}

impl Component {
    /// Its share of the squares and of what is determined, as of [`Components::update`].
    fn shown(
        &self,
        squares: &DVector<f64>,
        determined: &DVector<f64>,
        variances: &DVector<f64>,
    ) -> (f64, f64) {
        let (mut squared, mut counted) = (0.0, 0.0);
        for (columns, profile) in &self.profiles {
            for (column, share) in columns.clone().zip(profile) {
                if variances[column] > 0.0 {
                    let own = self.size * share / variances[column];
                    squared += own * squares[column];
                    counted += own * determined[column];
                }
            }
        }
        (squared, counted)
    }
}

/// Lengths of the short and the long kernel of a joint's curve on its circle, rad, and the expected size of each, rad or mm.
fn curve_sizes(layout: &Layout, settings: &FullSettings, joint: usize) -> ([f64; 2], f64) {
    if layout.slide_period_mm(joint).is_none() {
        let lengths = [settings.short_length_deg, settings.long_length_deg];
        return (lengths.map(|deg| length(settings, deg)), settings.curve_sd_rad);
    }
    let unit = layout.curve_unit(joint);
    let lengths = settings.slide_length_mm.map(|length_mm| length_mm / unit);
    (lengths, settings.slide_sd_mm)
}

/// Shares of the variance of a curve's change between sessions over its `columns` columns: a constant, then pairs.
fn change_profile(
    layout: &Layout,
    settings: &FullSettings,
    joint: usize,
    columns: usize,
    spectra: &mut Spectra,
) -> Vec<f64> {
    let (length, share) = session_curve_sizes(layout, settings, joint);
    let variances = spectra.variances(Kernel::SquaredExponential(length), (columns - 1) / 2);
    let mut profile = vec![variances[0]];
    profile.extend(pairs(&variances[1..]));
    for variance in &mut profile {
        *variance *= share;
    }
    profile
}

/// Length of the kernel of a curve's change between sessions on its circle, rad, and the share of the part's variance that a column
/// has: a slide's change is to its curve as that of a joint that turns.
fn session_curve_sizes(layout: &Layout, settings: &FullSettings, joint: usize) -> (f64, f64) {
    if layout.slide_period_mm(joint).is_none() {
        return (length(settings, settings.session_length_deg), 1.0);
    }
    let share = settings.session_length_deg / settings.long_length_deg;
    let length_mm = share * settings.slide_length_mm[1];
    let sizes = settings.slide_sd_mm / settings.curve_sd_rad;
    (length_mm / layout.curve_unit(joint), sizes * sizes)
}

/// Shares of gravity's variance, a row for each joint: 1 where it turns; where it slides, its deflection in mm under the weight it
/// carries has the expected size of a slide.
fn gravity_profile(layout: &Layout, settings: &FullSettings, columns: usize) -> Vec<f64> {
    let slide = (settings.slide_sd_mm / settings.gravity_sd).powi(2);
    let mut profile = vec![1.0; columns];
    let joints = layout.slide_periods_mm.len();
    let rows = (0..joints).flat_map(|joint| vec![joint; joints - joint]);
    for (share, joint) in profile.iter_mut().zip(rows) {
        if layout.slide_period_mm(joint).is_some() {
            *share = slide;
        }
    }
    profile
}

/// Shares of the approach-direction offset's variance, one for each joint: where it slides, as many mm² as count as a rad².
fn approach_profile(layout: &Layout, joints: usize) -> Vec<f64> {
    let share = |joint| match layout.slide_period_mm(joint) {
        Some(_) => SLIDE_MM_PER_RAD * SLIDE_MM_PER_RAD,
        None => 1.0,
    };
    (0..joints).map(share).collect()
}

/// A kernel's length (rad) on the circle of the curves' period: shorter for a period of several turns.
fn length(settings: &FullSettings, deg: f64) -> f64 {
    deg.to_radians() / f64::from(settings.curve_period_turns)
}

/// The variances of the pairs, each repeated for `cos` and `sin`.
fn pairs(variances: &[f64]) -> Vec<f64> {
    variances.iter().flat_map(|&v| [v, v]).collect()
}

/// The drift's profile over its columns: along x, then y, then z.
fn drift_profile(settings: &FullSettings, span: f64, columns: usize) -> Vec<f64> {
    smooth_variances(span, settings.drift_length_stations, columns / 3).repeat(3)
}
