//! A sample of very many looks, by which the sizes of noise, walk and shocks are found as well as by all of them.
//!
//! Noise, shocks and a fast walk show from one look to the next: for them there are stretches of consecutive looks. A slow walk shows
//! over the whole session only: for it there are means of looks, spread over all of it, with room between them so that the walk
//! within a mean is small beside the walk from one to the next.

use std::borrow::Cow;

use nalgebra::{Matrix6, Vector6};

use super::walk::{Look, Moves};

/// Looks up to which all of them are taken.
pub(super) const ALL: usize = 4000;
/// Stretches of consecutive looks.
const STRETCHES: usize = 8;
const LONG: usize = 250;
const MEANS: usize = 1000;
/// One look of so many is in a mean.
const SPARSE: usize = 4;

/// The looks where they are few; otherwise stretches of them and then means, each of the two as if all before it were unknown.
pub(super) fn sample(looks: &[Look], moves: Moves) -> Cow<'_, [Look]> {
    if looks.len() <= ALL {
        return Cow::Borrowed(looks);
    }
    let mut sample = Vec::with_capacity(STRETCHES * LONG + MEANS);
    for stretch in 0..STRETCHES {
        let first = stretch * (looks.len() - LONG) / (STRETCHES - 1);
        let from = sample.len();
        sample.extend_from_slice(&looks[first..first + LONG]);
        sample[from].jumps = true;
    }
    let from = sample.len();
    add_means(looks, moves, &mut sample);
    if let Some(first) = sample.get_mut(from) {
        first.jumps = true;
    }
    Cow::Owned(sample)
}

/// Adds means spread over all looks; one with a jump inside is left out, and the next one jumps.
fn add_means(looks: &[Look], moves: Moves, sample: &mut Vec<Look>) {
    let mut jumps = false;
    for mean in 0..MEANS {
        let (first, next) = (mean * looks.len() / MEANS, (mean + 1) * looks.len() / MEANS);
        let behind = first + ((next - first) / SPARSE).max(1);
        let own = &looks[first..behind];
        jumps |= own[0].jumps;
        let is_whole = own[1..].iter().all(|look| !look.jumps);
        if let Some(mean) = mean_of(own, moves).filter(|_| is_whole) {
            sample.push(Look { jumps, ..mean });
            jumps = false;
        }
        jumps |= looks[first + 1..next].iter().any(|look| look.jumps);
    }
}

/// The mean of looks without those that were shaken; `None` where they do not tell every motion.
fn mean_of(looks: &[Look], moves: Moves) -> Option<Look> {
    let (mut information, mut score) = (Matrix6::zeros(), Vector6::zeros());
    let (mut count, mut seconds) = (0.0, 0.0);
    for look in looks.iter().filter(|look| look.rows > 0 && !look.shaken) {
        information += look.information;
        score += look.score;
        count += 1.0;
        seconds += look.at_s;
    }
    // What is not told to move has no information: there the inverse of 1 changes nothing.
    let mut told = information;
    (moves.freedom()..6).for_each(|own| told[(own, own)] = 1.0);
    let state = told.cholesky()?.solve(&score);
    Some(Look {
        at_s: seconds / count,
        information,
        squares: state.dot(&score),
        score,
        rows: moves.freedom(),
        looks: count,
        jumps: false,
        shaken: false,
    })
}
