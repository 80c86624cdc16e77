use crate::fit::conversion::tests::{FILES, Truth};
use crate::fit::{Calibration, FitSettings, Freedom, identify_from};

/// An arm whose errors are so many times 0.2 mm and 0.2 mrad, fitted with the default prior of 3 mm and 3 mrad.
fn fitted(factor: f64) -> (Truth, Calibration) {
    let truth = Truth::new(FILES[1], [60.0, -35.0, 110.0]).times(factor);
    let seen = truth.observed(false);
    let starts = std::slice::from_ref(&truth.frames);
    let settings = FitSettings::default();
    let found = identify_from(&truth.arm, &seen, starts, Freedom::Geometry, &settings);
    (truth, found)
}

#[test]
fn the_stated_size_stays_where_it_is_large_enough() {
    let (_, found) = fitted(1.0);
    assert_eq!(found.geometry_prior(), Some((3.0, 3e-3)));
    let (_, found) = fitted(5.0);
    assert_eq!(found.geometry_prior(), Some((3.0, 3e-3)));
}

#[test]
fn larger_errors_make_the_prior_larger() {
    // Errors of 12 mm and 12 mrad, four times what is stated.
    let (truth, found) = fitted(60.0);
    let (length_mm, angle_rad) = found.geometry_prior().expect("a prior");
    assert!((6.0..40.0).contains(&length_mm), "{length_mm} mm");
    assert!((6e-3..40e-3).contains(&angle_rad), "{angle_rad} rad");
    // Where nothing is beyond the geometry, what is left is the noise of the readings.
    assert!((found.misfit_mm - 0.02).abs() < 2e-3, "{} mm", found.misfit_mm);
    // Each fit begins where the one before ended; the last is that of an arm whose prior is stated so.
    let settings = FitSettings {
        prior_length_mm: length_mm,
        prior_angle_mrad: 1e3 * angle_rad,
        ..FitSettings::default()
    };
    let (seen, starts) = (truth.observed(false), std::slice::from_ref(&truth.frames));
    let stated = identify_from(&truth.arm, &seen, starts, Freedom::Geometry, &settings);
    for place in 0..found.unknowns.len() {
        let apart = stated.solution.offsets[place] - found.solution.offsets[place];
        let sd = stated.covariance[(place, place)].sqrt();
        assert!(apart.abs() < 1e-4 * sd, "{:?}: {apart}", found.unknowns[place]);
    }
    assert_eq!(stated.nominal_structure.rank, found.nominal_structure.rank);
}

#[test]
fn no_prior_stays_none() {
    let truth = Truth::new(FILES[1], [60.0, -35.0, 110.0]);
    let seen = truth.observed(false);
    let settings = FitSettings { prior_length_mm: 0.0, ..FitSettings::default() };
    let starts = std::slice::from_ref(&truth.frames);
    let found = identify_from(&truth.arm, &seen, starts, Freedom::Geometry, &settings);
    assert_eq!(found.geometry_prior(), None);
}
