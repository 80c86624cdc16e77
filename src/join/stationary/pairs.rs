//! Columns two by two: what is done to one value is done to both at once.

/// The values of two columns at one sample.
pub type Pair = [f64; 2];

/// Each two added.
#[inline]
pub fn plus(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

/// The difference between each two.
#[inline]
pub fn minus(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

/// The larger of each two.
#[inline]
pub fn largest(a: Pair, b: Pair) -> Pair {
    [larger(a[0], b[0]), larger(a[1], b[1])]
}

/// The smaller of each two.
#[inline]
pub fn smallest(a: Pair, b: Pair) -> Pair {
    [smaller(a[0], b[0]), smaller(a[1], b[1])]
}

/// The largest difference between each two.
#[inline]
pub fn widest(high: Pair, low: Pair) -> f64 {
    larger(high[0] - low[0], high[1] - low[1])
}

/// Values are numbers: what `f64::max` does about others would cost as much again.
#[inline]
pub fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// How many pairs so many columns make.
pub const fn count(columns: usize) -> usize {
    columns.div_ceil(2)
}

/// One pair of the columns at each sample, whose values stand one sample behind the other; a pair that is not full has its
/// column twice.
pub fn of(values: &[f64], columns: usize, pair: usize) -> impl Iterator<Item = Pair> {
    let (a, b) = (2 * pair, (2 * pair + 1).min(columns - 1));
    let samples = values.chunks_exact(columns);
    samples.map(move |sample| [sample[a], sample[b]])
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
