//! Rows of blocks that were merged, waiting to be worked on while the next blocks are opened.

use super::block::Extent;

/// The rows of one block, and where it lies.
pub struct BlockRows<R> {
    pub rows: R,
    pub file: String,
    pub place: (u64, u64),
}

/// Rows that wait, in the order they came in.
pub struct Waiting<R> {
    blocks: Vec<BlockRows<R>>,
    /// Buffers for the rows of blocks to come.
    spare: Vec<R>,
}

impl<R: Default> Waiting<R> {
    /// Takes the rows of a block of `file`, and leaves a buffer for those of another.
    pub fn take(&mut self, rows: &mut R, file: &str, extent: &Extent) {
        let spare = self.spare.pop().unwrap_or_default();
        self.blocks.push(BlockRows {
            rows: std::mem::replace(rows, spare),
            file: file.to_owned(),
            place: (extent.start, extent.end),
        });
    }

    /// Works on all that wait.
    pub fn work(&mut self, mut on: impl FnMut(&BlockRows<R>)) {
        for block in self.blocks.drain(..) {
            on(&block);
            self.spare.push(block.rows);
        }
    }
}

impl<R> Default for Waiting<R> {
    fn default() -> Self {
        Self {
            blocks: Vec::new(),
            spare: Vec::new(),
        }
    }
}
