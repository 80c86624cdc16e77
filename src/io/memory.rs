//! Freed memory that will be needed again.

/// Just below the largest block that the C library's rule considers.
const LARGEST: usize = (32 << 20) - (64 << 10);

/// Keeps freed memory for later buffers, instead of returning it to the system.
///
/// The GNU C library returns blocks above a size as soon as they are freed, and the next block costs a page fault for each
/// of its pages, which takes as long as all the work in it. The library raises that size to that of the first such block
/// freed. The block freed here is never touched, so it takes no memory. Other C libraries are not affected.
pub fn keep_what_is_freed() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST)));
}
