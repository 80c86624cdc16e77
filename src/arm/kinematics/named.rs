//! Motions and parameters by their names, as models and estimates are saved.

use std::fmt::Display;
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize as _, Deserializer, Serializer};
use thiserror::Error;

/// A name that this program does not know.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{name:?} is no {what} that this program knows")]
pub struct UnknownName {
    /// The kind of thing named.
    pub what: &'static str,
    pub name: String,
}

/// Writes the name.
pub fn serialize<T: Display, S: Serializer>(named: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(named)
}

/// Reads what has the name.
pub fn deserialize<'de, T, D>(from: D) -> Result<T, D::Error>
where
    T: FromStr<Err = UnknownName>,
    D: Deserializer<'de>,
{
    String::deserialize(from)?.parse().map_err(D::Error::custom)
}
