//! Variance components: how large each part of the model is, estimated from the session itself.
//!
//! A component has a size `a` and a profile over columns; a column's prior variance is the sum of its components'. The
//! update is `MacKay`'s fixed point on the marginal likelihood, split among components by their share in each column, with
//! a weak inverse-gamma prior on `a` (ν₀ observations of a₀). Its fixed points are those of the likelihood's gradient
//! `½ (μ_k²/v_k + Σ_kk/v_k − 1)`.

use std::ops::Range;

use nalgebra::DVector;

use super::layout::{Block, Layout};
use super::settings::FullSettings;
use super::spectrum::{Kernel, smooth_variances};

/// What a component belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// The short kernel of one joint's curve.
    ShortCurve(usize),
    /// The long kernel of one joint's curve.
    LongCurve(usize),
    /// Gravity.
    Gravity,
    /// Stopping short of the command.
    StopShort,
    /// Warming up, common to all sessions.
    WarmUp,
    /// Base drift of single sessions.
    Drift,
    /// How sessions differ in their curves.
    SessionCurve,
    /// How sessions differ in their blend.
    SessionBlend,
    /// One gear line.
    Line {
        /// The joint, from 0.
        joint: usize,
        /// Cycles per turn.
        cycles: f64,
    },
}

/// One variance component.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// What it belongs to.
    pub part: Part,
    /// Its size: a variance in the square of the part's unit (rad, mm or 1).
    pub size: f64,
    profiles: Vec<(Range<usize>, Vec<f64>)>,
    expected: f64,
    weight: f64,
}

/// All components, and the columns whose prior is fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Components {
    /// In the layout's order.
    pub all: Vec<Component>,
    fixed: Vec<f64>,
}

/// A step of the fixed point is damped by this power, which keeps parts that share columns from taking turns.
const DAMPING: f64 = 0.8;
/// A size changes by no more than this factor in a step.
const LARGEST_CHANGE: f64 = 20.0;

impl Components {
    /// The components of `layout` at their expected sizes; `unknowns` are prior variances of the problem's unknowns.
    pub fn new(layout: &Layout, unknowns: &[f64], settings: &FullSettings, span: f64) -> Self {
        let mut components = Self {
            all: Vec::new(),
            fixed: vec![0.0; layout.size()],
        };
        for (block, columns) in layout.blocks() {
            components.add(block, columns, unknowns, settings, span);
        }
        components
    }

    /// Prior variance of every column.
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
            let (mut squared, mut counted) = (0.0, 0.0);
            for (columns, profile) in &component.profiles {
                for (column, share) in columns.clone().zip(profile) {
                    if variances[column] > 0.0 {
                        let own = component.size * share / variances[column];
                        squared += own * squares[column];
                        counted += own * determined[column];
                    }
                }
            }
            let weight = component.weight;
            let ratio =
                (squared + weight) / (counted + weight * component.size / component.expected);
            component.size *= ratio
                .clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE)
                .powf(DAMPING);
        }
    }

    /// Takes over the sizes of parts that `others` has too.
    pub fn inherit(&mut self, others: &Self) {
        for component in &mut self.all {
            if let Some(other) = others.all.iter().find(|other| other.part == component.part) {
                component.size = other.size;
            }
        }
    }

    /// The size of a part; `None` where the model has none.
    pub fn size(&self, part: Part) -> Option<f64> {
        self.all
            .iter()
            .find(|component| component.part == part)
            .map(|component| component.size)
    }

    /// Sets the size of every component that `is_of` picks to zero: the model without that part.
    pub fn drop_parts(&mut self, is_of: impl Fn(Part) -> bool) {
        for component in self
            .all
            .iter_mut()
            .filter(|component| is_of(component.part))
        {
            component.size = 0.0;
        }
    }

    fn add(
        &mut self,
        block: Block,
        columns: Range<usize>,
        unknowns: &[f64],
        settings: &FullSettings,
        span: f64,
    ) {
        // On a circle of several turns a length is a smaller share of it.
        let length = |deg: f64| deg.to_radians() / f64::from(settings.curve_period_turns);
        let even = |columns: &Range<usize>| vec![1.0; columns.len()];
        let pairs =
            |variances: &[f64]| variances.iter().flat_map(|&v| [v, v]).collect::<Vec<f64>>();
        match block {
            Block::Unknowns => self.fixed[columns].copy_from_slice(unknowns),
            Block::Blend | Block::OwnBlend(_) => {
                self.fixed[columns].fill(settings.blend_sd.powi(2));
            }
            Block::Gravity => self.join(
                Part::Gravity,
                settings.gravity_sd,
                columns.clone(),
                even(&columns),
                2.0,
            ),
            Block::StopShort => self.join(
                Part::StopShort,
                settings.stop_short_sd_rad,
                columns.clone(),
                even(&columns),
                2.0,
            ),
            Block::SessionBlend(_) => {
                self.join(
                    Part::SessionBlend,
                    settings.session_blend_sd,
                    columns.clone(),
                    even(&columns),
                    2.0,
                );
            }
            Block::WarmUp | Block::Drift(_) => {
                let part = if block == Block::WarmUp {
                    Part::WarmUp
                } else {
                    Part::Drift
                };
                let shape =
                    smooth_variances(span, settings.drift_length_stations, columns.len() / 3);
                self.join(part, settings.drift_sd_mm, columns, shape.repeat(3), 2.0);
            }
            Block::Curve(joint) => {
                let harmonics = columns.len() / 2;
                let short =
                    Kernel::Matern52(length(settings.short_length_deg)).variances(harmonics);
                let long = Kernel::SquaredExponential(length(settings.long_length_deg))
                    .variances(harmonics);
                self.join(
                    Part::ShortCurve(joint),
                    settings.curve_sd_rad,
                    columns.clone(),
                    pairs(&short[1..]),
                    2.0,
                );
                self.join(
                    Part::LongCurve(joint),
                    settings.curve_sd_rad,
                    columns,
                    pairs(&long[1..]),
                    2.0,
                );
            }
            Block::SessionCurve { .. } => {
                let kernel = Kernel::SquaredExponential(length(settings.session_length_deg));
                let variances = kernel.variances((columns.len() - 1) / 2);
                let mut profile = vec![variances[0]];
                profile.extend(pairs(&variances[1..]));
                self.join(
                    Part::SessionCurve,
                    settings.session_curve_sd_rad,
                    columns,
                    profile,
                    2.0,
                );
            }
            Block::Line { joint, cycles } => {
                let even = even(&columns);
                self.join(
                    Part::Line { joint, cycles },
                    settings.line_sd_rad,
                    columns,
                    even,
                    1.0,
                );
            }
        }
    }

    fn join(&mut self, part: Part, sd: f64, columns: Range<usize>, profile: Vec<f64>, weight: f64) {
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
