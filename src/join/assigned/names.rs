//! Places that the readings show → the targets that they are of, by what is stated.
//!
//! Every permutation has a cost: squared deviations of the places from the stated ones, less the shift that all share (base and targets
//! trade it), and of measured distances from the stated ones, each by its standard uncertainty.

use nalgebra::Vector3;

use super::clusters::Clusters;
use super::{AssignError, DECIDED, Stated};

/// Uncertainty that a nominal arm leaves in the places at the flange, mm per axis.
const PLACE_MM: f64 = 1.0;
/// Uncertainty of a distance measured within stations, mm: the instrument's.
const DISTANCE_MM: f64 = 0.05;
/// Beyond this, and three stated uncertainties, the best permutation does not agree with what is stated, mm.
const AGREES_MM: f64 = 5.0;

/// The target of each cluster.
pub(super) fn of_clusters(clusters: &Clusters, stated: &Stated) -> Result<Vec<usize>, AssignError> {
    let all = permutations(stated.count());
    let mut judged: Vec<(f64, f64, Vec<usize>)> = all
        .into_iter()
        .map(|own| {
            let (cost, misfit_mm) = cost(clusters, stated, &own);
            (cost, misfit_mm, own)
        })
        .collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut judged = judged.into_iter();
    let Some((cost, best_mm, names)) = judged.next() else {
        return Ok(Vec::new());
    };
    let Some((other_cost, second_mm, other)) = judged.next() else {
        return Ok(names);
    };
    if best_mm > AGREES_MM + 3.0 * largest_sd_mm(stated) {
        return Err(AssignError::NotAsStated { best_mm, second_mm });
    }
    if other_cost - cost < DECIDED {
        return Err(AssignError::Alike {
            targets: differing(&names, &other, stated),
            best_mm,
            second_mm,
        });
    }
    Ok(names)
}

/// Names of the targets at which two permutations differ.
fn differing(one: &[usize], other: &[usize], stated: &Stated) -> String {
    let mut targets: Vec<usize> =
        one.iter().zip(other).filter(|(a, b)| a != b).map(|(a, _)| *a).collect();
    targets.sort_unstable();
    let names: Vec<String> =
        targets.iter().map(|target| format!("{:?}", stated.names[*target])).collect();
    names.join(" and ")
}

fn largest_sd_mm(stated: &Stated) -> f64 {
    let places = stated.places.iter().flatten().map(|(_, sd)| *sd);
    let distances = stated.distances.iter().map(|own| own.sd_mm);
    places.chain(distances).fold(0.0, f64::max)
}

/// The cost of a permutation, and the root mean square of its deviations, mm.
fn cost(clusters: &Clusters, stated: &Stated, names: &[usize]) -> (f64, f64) {
    let off = deviations(clusters, stated, names);
    let cost = off.iter().map(|(mm, sd_mm)| (mm / sd_mm).powi(2)).sum();
    let squares: f64 = off.iter().map(|(mm, _)| mm * mm).sum();
    (cost, (squares / off.len().max(1) as f64).sqrt())
}

/// Deviations from what is stated under a permutation, and their standard uncertainties, mm.
fn deviations(clusters: &Clusters, stated: &Stated, names: &[usize]) -> Vec<(f64, f64)> {
    let mut all = of_places(clusters, stated, names);
    for (pair, measured_mm, _) in &clusters.distances {
        let [one, other] = pair.map(|cluster| names[cluster]);
        let is_stated = |own: &&super::StatedDistance| {
            own.between == [one, other] || own.between == [other, one]
        };
        if let Some(own) = stated.distances.iter().find(is_stated) {
            all.push((measured_mm - own.mm, own.sd_mm.hypot(DISTANCE_MM)));
        }
    }
    all
}

/// Deviations of places from the stated ones, less their common shift.
fn of_places(clusters: &Clusters, stated: &Stated, names: &[usize]) -> Vec<(f64, f64)> {
    let off = clusters.places.iter().zip(names).zip(&clusters.readings);
    let off = off.filter_map(|((place, target), readings)| {
        let (at, sd_mm) = stated.places[*target].filter(|_| *readings > 0)?;
        Some((place.coords - at, sd_mm.hypot(PLACE_MM)))
    });
    let off: Vec<(Vector3<f64>, f64)> = off.collect();
    let weights: f64 = off.iter().map(|(_, sd)| sd.powi(-2)).sum();
    let sum: Vector3<f64> = off.iter().map(|(away, sd)| away * sd.powi(-2)).sum();
    let shift = sum / weights.max(f64::MIN_POSITIVE);
    let of_axes = off.iter().flat_map(|(away, sd)| {
        let left: [f64; 3] = (away - shift).into();
        left.map(|mm| (mm, *sd))
    });
    of_axes.collect()
}

/// All orders of the numbers below `count`.
fn permutations(count: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..count {
        let longer = all.iter().flat_map(|own: &Vec<usize>| {
            (0..count).filter(|next| !own.contains(next)).map(|next| {
                let mut own = own.clone();
                own.push(next);
                own
            })
        });
        all = longer.collect();
    }
    all
}
