//! Symmetric matrices as the six numbers that files and tables state: xx xy xz yy yz zz.

use nalgebra::Matrix3;

pub const fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// The entries on and above the diagonal, row by row.
pub fn upper(matrix: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_numbers_come_back() {
        let six = [1.0, 0.1, 0.2, 2.0, 0.3, 3.0];
        let matrix = symmetric(six);
        assert_eq!(matrix, matrix.transpose());
        assert_eq!((matrix[(1, 2)], upper(&matrix)), (0.3, six));
    }
}
