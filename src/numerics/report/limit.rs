//! What limits a result that does not meet the tolerance, and what would change it.

/// Parts of errors, from the judge to the arm, and what would change each.
const PARTS: [(&str, &str); 5] = [
    ("what may change between sessions", "measure another session and learn from both"),
    ("the session's base", "let more stations find it ([report] locate)"),
    ("interpolation", "correct by the identified arm, or make [grid] steps_mm smaller"),
    ("repeatability", "look for play, loose parts and short dwells"),
    ("the number of poses", "measure more, which `posegrid plan` chooses"),
];

/// The geometry of all poses leaves less of any arm in the mean, mm.
const MOST_OF_AN_ARM_MM: f64 = 2.0;

/// A squared error with one of its parts and without it, mm²: of the bound the first, of mean squares the others. Without what may change
/// between sessions it is the largest of the session's own errors. Without the base of a test session they are those with the
/// base from all of its stations, without interpolation those of the model at the same stations, without what does not repeat what is left
/// beside the nugget of the model's semivariogram, and with poses enough those where the model was trained.
pub type WithAndWithout = Option<[f64; 2]>;

/// Held-out errors of the geometry by the number of poses that train it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ByPoses {
    /// Mean errors with a quarter, half and all of them, mm.
    pub means_mm: [f64; 3],
    /// Whether all leave less than half do, by more than two standard errors and by what a table may be worse than its model.
    pub falls: bool,
}

/// What most of the errors come from, and what would change it, in words: the first part without which less than half of their square is
/// left. Where none is, it is the number of poses while errors fall with it. `noise_mm2` is of the measurement.
pub fn limit(noise_mm2: f64, parts: [WithAndWithout; 5], by_poses: Option<ByPoses>) -> String {
    for ((part, change), squares) in PARTS.iter().zip(parts) {
        if let Some([with, without]) = squares.filter(|[with, without]| *without < with / 2.0) {
            let [own, all, noise] = [with - without, with, noise_mm2].map(f64::sqrt);
            return format!(
                "{part} limits the accuracy: {own:.3} mm of {all:.3} mm come from it, {noise:.3} mm from the measurement; {change}"
            );
        }
    }
    let means = by_poses.map_or_else(String::new, |own| {
        let [quarter, half, all] = own.means_mm;
        format!(
            " (by the geometry of a quarter, half and all {quarter:.3}, {half:.3} and {all:.3} mm)"
        )
    });
    let (poses, measure) = PARTS[4];
    let is_of_no_arm =
        |own: ByPoses| own.means_mm[2] > (own.means_mm[0] / 2.0).max(MOST_OF_AN_ARM_MM);
    if by_poses.is_some_and(is_of_no_arm) {
        format!(
            "joint angles, readings or the set-up are wrong, if only for some stations: no arm leaves as much{means}; see on the page at which"
        )
    } else if by_poses.is_some_and(|own| own.falls) {
        format!("{poses} limits the accuracy{means}: {measure}")
    } else {
        format!(
            "no single part limits the accuracy, and more poses change nothing{means}: see on the page what the errors go with"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of 0.4 mm, 0.16 mm², and a noise of 0.003 mm²: what is left without each part, mm².
    fn limited(without_mm2: [Option<f64>; 5], by_poses: Option<ByPoses>) -> String {
        limit(0.003, without_mm2.map(|own| Some([0.16, own?])), by_poses)
    }

    #[test]
    fn the_first_part_that_is_most_of_the_errors_limits() {
        // A worn arm: near stations do not share 0.15 of 0.16 mm²; from 980 stations, it is as bad where it was trained.
        let worn = limited([Some(0.15), None, Some(0.15), Some(0.01), Some(0.15)], None);
        assert_eq!(
            worn,
            "repeatability limits the accuracy: 0.387 mm of 0.400 mm come from it, 0.055 mm from the measurement; look for play, loose \
             parts and short dwells"
        );
        // A table of 0.4 mm where the model itself leaves 0.2 mm: √(0.16 − 0.04).
        let coarse = limited([None, None, Some(0.04), Some(0.15), Some(0.03)], None);
        assert!(
            coarse.starts_with("interpolation limits the accuracy: 0.346 mm of 0.400 mm"),
            "{coarse}"
        );
        // 0.09 of 0.16 mm² are left with the base from all stations, which is more than half; then 0.04 mm².
        let based = |mm2| limited([Some(0.15), Some(mm2), None, Some(0.15), Some(0.15)], None);
        assert!(based(0.09).contains("more poses change nothing:"), "{}", based(0.09));
        assert!(based(0.04).starts_with("the session's base limits"), "{}", based(0.04));
        // A bound of 0.4 mm where the largest of the session's own errors is 0.1 mm.
        let changes = limited([Some(0.01), None, None, Some(0.01), None], None);
        assert!(
            changes.starts_with(
                "what may change between sessions limits the accuracy: 0.387 mm of 0.400 mm"
            ),
            "{changes}"
        );
    }

    #[test]
    fn more_poses_are_asked_for_only_where_poses_are_missing() {
        let parts = [None, None, None, Some(0.15), Some(0.12)];
        let by = |means_mm, falls| limited(parts, Some(ByPoses { means_mm, falls }));
        let fallen = by([0.6, 0.45, 0.36], true);
        assert!(fallen.starts_with("the number of poses limits the accuracy (by the geometry of a quarter, half and all 0.600, 0.450 and 0.360 mm)"), "{fallen}");
        let flat = by([0.337, 0.36, 0.366], false);
        assert!(
            flat.contains("more poses change nothing (") && !flat.contains("measure more"),
            "{flat}"
        );
        let frozen = by([5.152, 4.563, 4.314], true);
        assert!(frozen.starts_with("joint angles, readings or the set-up are wrong"), "{frozen}");
        assert!(by([60.0, 20.0, 5.0], true).starts_with("the number of poses"));
        // Learnt by heart: 0.1 mm where it was trained.
        let heart = limited([None, None, None, Some(0.15), Some(0.01)], None);
        assert!(heart.ends_with("measure more, which `posegrid plan` chooses"), "{heart}");
    }
}
