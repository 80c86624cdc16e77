//! Whole files of targets in memory, up to a bound.

use std::path::Path;

use super::{TargetsError, TargetsErrorKind};
use crate::input::{self, Bound};

pub(super) fn read(path: &Path, bound: Bound) -> Result<Vec<u8>, TargetsError> {
    input::bytes(path, bound).map_err(|source| TargetsErrorKind::Read(source).at(path))
}
