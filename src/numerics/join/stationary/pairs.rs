//! Columns in pairs, so that the processor's vector units treat two values at once.

/// The values of two columns at one sample.
pub type Pair = [f64; 2];

#[inline]
pub fn plus(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline]
pub fn minus(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

#[inline]
pub fn largest(a: Pair, b: Pair) -> Pair {
    [larger(a[0], b[0]), larger(a[1], b[1])]
}

#[inline]
pub fn smallest(a: Pair, b: Pair) -> Pair {
    [smaller(a[0], b[0]), smaller(a[1], b[1])]
}

/// The larger of the two differences `high − low`.
#[inline]
pub fn widest(high: Pair, low: Pair) -> f64 {
    larger(high[0] - low[0], high[1] - low[1])
}

/// The larger of two numbers. Values are never NaN, so the cost of `f64::max`'s check is saved.
#[inline]
pub fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Number of pairs for `columns` columns.
pub const fn count(columns: usize) -> usize {
    columns.div_ceil(2)
}

/// The columns of a pair; an incomplete pair has its column twice.
pub fn places(columns: usize, pair: usize) -> [usize; 2] {
    [2 * pair, (2 * pair + 1).min(columns - 1)]
}

/// One pair of columns at each sample, from values stored sample after sample; an incomplete pair has its column twice.
pub fn of(values: &[f64], columns: usize, pair: usize) -> impl Iterator<Item = Pair> {
    let [a, b] = places(columns, pair);
    values.chunks_exact(columns).map(move |sample| [sample[a], sample[b]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "picked, not computed")]
    fn three_columns_are_two_pairs() {
        let values = [0.0, 1.0, 2.0, 10.0, 11.0, 12.0];
        assert_eq!(count(3), 2);
        assert!(of(&values, 3, 0).eq([[0.0, 1.0], [10.0, 11.0]]));
        assert!(of(&values, 3, 1).eq([[2.0, 2.0], [12.0, 12.0]]));
        assert_eq!(largest([1.0, 4.0], [2.0, 3.0]), [2.0, 4.0]);
        assert_eq!(smallest([1.0, 4.0], [2.0, 3.0]), [1.0, 3.0]);
        assert_eq!(widest([3.0, 7.0], [1.0, 2.0]), 5.0);
    }
}
