//! Numbers saved to the last bit: a number read back is the number written, and results from it have the same bytes.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub mod number {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "serde hands the field over by reference"
    )]
    pub fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        value.to_bits().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(f64::from_bits(u64::deserialize(from)?))
    }
}

/// A number that may be absent.
pub mod optional {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::ref_option, reason = "serde hands the field over by reference")]
    pub fn serialize<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
        value.map(f64::to_bits).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
        Ok(Option::<u64>::deserialize(from)?.map(f64::from_bits))
    }
}

pub mod vector {
    use nalgebra::DVector;

    use super::{Deserializer, Serializer, numbers, write};

    pub fn serialize<S: Serializer>(value: &DVector<f64>, to: S) -> Result<S::Ok, S::Error> {
        write(value.as_slice(), to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<DVector<f64>, D::Error> {
        Ok(DVector::from_vec(numbers(from)?))
    }
}

pub mod matrix {
    use nalgebra::DMatrix;
    use serde::de::Error as _;

    use super::{Deserializer, Serializer, numbers, write};

    pub fn serialize<S: Serializer>(value: &DMatrix<f64>, to: S) -> Result<S::Ok, S::Error> {
        write(value.as_slice(), to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<DMatrix<f64>, D::Error> {
        let values = numbers(from)?;
        let size = values.len().isqrt();
        if size * size == values.len() {
            return Ok(DMatrix::from_vec(size, size, values));
        }
        Err(D::Error::custom(format!("{} numbers make no square matrix", values.len())))
    }
}

/// A frame that may be absent: its position, then its quaternion.
pub mod frame {
    use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
    use serde::de::Error as _;

    use super::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::ref_option, reason = "serde hands the field over by reference")]
    pub fn serialize<S: Serializer>(
        value: &Option<Isometry3<f64>>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let numbers = value.map(|placed| {
            let (t, r) = (placed.translation.vector, placed.rotation.coords);
            [t.x, t.y, t.z, r.x, r.y, r.z, r.w].map(f64::to_bits)
        });
        numbers.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<Isometry3<f64>>, D::Error> {
        let Some(bits) = Option::<[u64; 7]>::deserialize(from)? else { return Ok(None) };
        let [x, y, z, i, j, k, w] = bits.map(f64::from_bits);
        let quaternion = Quaternion::new(w, i, j, k);
        if (quaternion.norm() - 1.0).abs() > 1e-9 {
            return Err(D::Error::custom("a frame's quaternion has norm 1"));
        }
        // Normalising it a second time would change the last bit.
        let rotation = UnitQuaternion::new_unchecked(quaternion);
        Ok(Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation)))
    }
}

fn write<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
    let bits: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
    bits.serialize(to)
}

fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    Ok(Vec::<u64>::deserialize(from)?.into_iter().map(f64::from_bits).collect())
}
