//! Sine and cosine of a block of angles at once, by polynomials that the compiler turns into vector instructions.
//!
//! 1. `x = k π/2 + r` with `|r| ≤ π/4`: π/2 in three parts, of which the first two times k are exact (Cody and Waite 1980).
//! 2. `sin r` and `cos r` by polynomials in r², interpolated at Chebyshev nodes with 60 digits; their truncation error is
//!    below 2⁻⁵⁶ of the result.
//! 3. k modulo 4 decides which polynomial is the sine, which the cosine, and their signs.
//!
//! Errors stay below one unit in the last place; angles beyond [`LARGEST`] go to the standard library. Products and
//! sums are rounded one by one (no fused multiply-add), so the bytes do not depend on the processor.

/// Poses computed together: enough for the vector units, few enough that all of a block stays in the fastest cache.
pub const BLOCK: usize = 64;

pub type Block = [f64; BLOCK];

/// The largest angle (rad) computed here: up to it, k has 17 bits and its products with the parts of π/2 are exact.
const LARGEST: f64 = 1e5;

/// Adding 1.5 · 2⁵² rounds to a whole number, which the lowest bits then hold.
const TO_WHOLE: f64 = 6_755_399_441_055_744.0;

/// π/2 in three parts: its first 33 bits, the next 33, and the remainder.
const HALF_PI: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// `(sin r / r − 1) / r²` in powers of r².
const SIN: [f64; 6] = [
    -0.166_666_666_666_666_66,
    0.008_333_333_333_330_948,
    -0.000_198_412_698_367_585_57,
    2.755_731_610_254_309_6e-6,
    -2.505_113_184_305_603_4e-8,
    1.591_812_915_455_054_4e-10,
];

/// `(cos r − 1 + r²/2) / r⁴` in powers of r².
const COS: [f64; 6] = [
    0.041_666_666_666_666_664,
    -0.001_388_888_888_888_739_8,
    2.480_158_729_876_567_6e-5,
    -2.755_731_727_172_395e-7,
    2.087_614_626_718_481e-9,
    -1.138_263_233_774_121_4e-11,
];

pub fn sin_cos(angles: &Block, sin: &mut Block, cos: &mut Block) {
    let mut beyond = false;
    for place in 0..BLOCK {
        (sin[place], cos[place]) = by_polynomials(angles[place]);
        beyond |= is_beyond(angles[place]);
    }
    if beyond {
        one_by_one(angles, sin, cos);
    }
}

#[cold]
fn one_by_one(angles: &Block, sin: &mut Block, cos: &mut Block) {
    for place in 0..BLOCK {
        if is_beyond(angles[place]) {
            (sin[place], cos[place]) = angles[place].sin_cos();
        }
    }
}

/// Whether an angle is too large for the polynomials, or not a number.
#[inline]
fn is_beyond(angle: f64) -> bool {
    angle.abs() > LARGEST || angle.is_nan()
}

#[inline]
fn by_polynomials(x: f64) -> (f64, f64) {
    let rounded = x * std::f64::consts::FRAC_2_PI + TO_WHOLE;
    let quadrant = rounded.to_bits();
    let k = rounded - TO_WHOLE;
    // r and its rounding error.
    let coarse = x - k * HALF_PI[0];
    let step = k * HALF_PI[1];
    let middle = coarse - step;
    let below = ((coarse - middle) - step) - k * HALF_PI[2];
    let r = middle + below;
    let rest = (middle - r) + below;

    let z = r * r;
    let half = 0.5 * z;
    let sin = r + (r * (z * polynomial(&SIN, z)) + rest * (1.0 - half));
    let most = 1.0 - half;
    let cos = most + (((1.0 - most) - half) + (z * z * polynomial(&COS, z) - r * rest));

    // Odd quadrants swap the two; the second bit turns the sine's sign, both bits together the cosine's.
    let (sin_bits, cos_bits) = (sin.to_bits(), cos.to_bits());
    let swap = (quadrant & 1).wrapping_neg();
    let sin_sign = (quadrant & 2) << 62;
    let cos_sign = (quadrant.wrapping_add(1) & 2) << 62;
    (
        f64::from_bits(((sin_bits & !swap) | (cos_bits & swap)) ^ sin_sign),
        f64::from_bits(((cos_bits & !swap) | (sin_bits & swap)) ^ cos_sign),
    )
}

#[inline]
fn polynomial(c: &[f64; 6], z: f64) -> f64 {
    c[0] + z * (c[1] + z * (c[2] + z * (c[3] + z * (c[4] + z * c[5]))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(angles: &Block) -> (Block, Block) {
        let (mut sin, mut cos) = ([0.0; BLOCK], [0.0; BLOCK]);
        sin_cos(angles, &mut sin, &mut cos);
        (sin, cos)
    }

    /// Distance in units of the last place of `wanted`.
    fn apart(found: f64, wanted: f64) -> f64 {
        let unit = f64::from_bits(wanted.abs().to_bits() + 1) - wanted.abs();
        (found - wanted).abs() / unit
    }

    /// Angles through several turns, near every multiple of π/4, and tiny ones. The standard library's error is below
    /// one unit in the last place and so is ours: the two may differ by up to two units.
    #[test]
    fn sine_and_cosine_are_within_two_units_of_the_standard_library() {
        let mut worst = 0.0_f64;
        for block in 0..4000_i32 {
            let angle = |place: usize| {
                let step = f64::from(block * 64) + place as f64;
                match block % 4 {
                    0 => step * 1e-4 - 12.0,
                    1 => (step - 128_000.0).floor() * std::f64::consts::FRAC_PI_4,
                    2 => (step * 0.618_033_988_749_895).fract() * 1e5,
                    _ => (step * 1e-7).powi(3),
                }
            };
            let angles: Block = std::array::from_fn(angle);
            let (sin, cos) = both(&angles);
            for (place, angle) in angles.iter().enumerate() {
                worst = worst.max(apart(sin[place], angle.sin()));
                worst = worst.max(apart(cos[place], angle.cos()));
            }
        }
        eprintln!("worst {worst} units");
        assert!(worst <= 2.0, "{worst} units in the last place");
    }

    #[test]
    fn very_large_angles_use_the_standard_library() {
        let mut angles = [0.25; BLOCK];
        (angles[3], angles[4], angles[5]) = (1e9, f64::NAN, f64::INFINITY);
        let (sin, cos) = both(&angles);
        assert_eq!((sin[3], cos[3]), 1e9_f64.sin_cos());
        assert!(sin[4].is_nan() && cos[4].is_nan() && sin[5].is_nan());
        assert!(apart(sin[0], 0.25_f64.sin()) <= 1.0);
    }
}
