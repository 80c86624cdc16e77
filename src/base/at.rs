use std::fmt::Display;

use thiserror::Error;

#[derive(Debug, Error)]
#[error("{place}: {kind}")]
pub struct At<K: Display> {
    pub place: String,
    pub kind: K,
}

impl<K: Display> At<K> {
    pub fn new(place: impl Display, kind: impl Into<K>) -> Self {
        Self { place: place.to_string(), kind: kind.into() }
    }
}
