//! A stated direction against gravity that points the other way: all the fit does is to turn the sign of each joint's compliance, which
//! no arm has negative. Stiff arms do not tell.
//!
//! Equal weights at all points behind a joint make it yield with gravity. The sum of its coefficients says by how much, in standard
//! deviations of the posterior; the joint that says it most clearly decides. Springs that carry an arm act by the angle of their own joint,
//! which its curve takes.

use nalgebra::DMatrix;

use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;

/// Standard deviations beyond which a joint yields with gravity or against it: of real arms none was beyond −1.1, and the clearest at 8 to
/// 50.
pub const SURE: f64 = 6.0;

/// The joint whose yield under the stated gravity is clearest, from 0, and by how many standard deviations: negative against it. `None`
/// without gravity in the model.
pub fn clearest(full: &FullModel, joints: usize) -> Option<(usize, f64)> {
    let yields = yields(full, joints)?.into_iter().enumerate();
    yields.max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))
}

/// The sum of each joint's coefficients, in standard deviations; 0 where it has none.
fn yields(full: &FullModel, joints: usize) -> Option<Vec<f64>> {
    let columns = full.trained.layout.columns(Block::Gravity)?;
    let coefficients = full.coefficients(Block::Gravity)?;
    let (mut rows, mut sums) =
        (DMatrix::zeros(joints, full.trained.layout.size()), vec![0.0; joints]);
    let behind = (0..joints).flat_map(|joint| (joint..joints).map(move |_| joint));
    for ((joint, column), coefficient) in behind.zip(columns).zip(coefficients.iter()) {
        rows[(joint, column)] = 1.0;
        sums[joint] += coefficient;
    }
    let variances = full.covariance_of_rows(&rows).diagonal();
    let sums = sums.iter().zip(&variances);
    Some(sums.map(|(sum, own)| if *own > 0.0 { sum / own.sqrt() } else { 0.0 }).collect())
}
