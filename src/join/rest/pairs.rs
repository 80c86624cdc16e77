//! Columns four by four: what is done to one value is done to the four at once.

/// The values of four columns at one sample.
pub type Quad = [f64; 4];

/// The larger of each two.
#[inline]
pub fn largest(a: Quad, b: Quad) -> Quad {
    [
        larger(a[0], b[0]),
        larger(a[1], b[1]),
        larger(a[2], b[2]),
        larger(a[3], b[3]),
    ]
}

/// The smaller of each two.
#[inline]
pub fn smallest(a: Quad, b: Quad) -> Quad {
    [
        smaller(a[0], b[0]),
        smaller(a[1], b[1]),
        smaller(a[2], b[2]),
        smaller(a[3], b[3]),
    ]
}

/// The largest difference between each two.
#[inline]
pub fn widest(high: Quad, low: Quad) -> f64 {
    let [a, b, c, d] = [
        high[0] - low[0],
        high[1] - low[1],
        high[2] - low[2],
        high[3] - low[3],
    ];
    larger(larger(a, b), larger(c, d))
}

/// Values are numbers: what `f64::max` does about others would cost as much again.
#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Groups of four that so many columns make.
pub const fn groups(columns: usize) -> usize {
    columns.div_ceil(4)
}

/// Adds samples of the columns to each group; a group that is not full has its last column more than once.
pub fn append(groups: &mut [Vec<Quad>], columns: &[&[f64]]) {
    for (group, quads) in groups.iter_mut().enumerate() {
        let column = |place: usize| columns[(4 * group + place).min(columns.len() - 1)];
        let [a, b, c, d] = std::array::from_fn(column);
        let values = a.iter().zip(b).zip(c).zip(d);
        quads.extend(values.map(|(((&a, &b), &c), &d)| [a, b, c, d]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "picked, not computed")]
    fn six_columns_are_two_groups() {
        let columns: Vec<Vec<f64>> = (0..6).map(|k| vec![f64::from(k), 10.0]).collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let mut quads = vec![Vec::new(); groups(6)];
        append(&mut quads, &columns);
        assert_eq!(quads[0], [[0.0, 1.0, 2.0, 3.0], [10.0; 4]]);
        assert_eq!(quads[1], [[4.0, 5.0, 5.0, 5.0], [10.0; 4]]);
        assert_eq!(
            largest([1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0]),
            [4.0, 3.0, 3.0, 4.0]
        );
        assert_eq!(
            smallest([1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0]),
            [1.0, 2.0, 2.0, 1.0]
        );
    }
}
