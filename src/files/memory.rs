/// Just below the largest block that the C library's rule considers.
const LARGEST: usize = (32 << 20) - (64 << 10);

/// Keeps freed memory for later buffers: the GNU C library returns large blocks to the system, and a page fault for
/// each page of the next block takes as long as all the work in it. The library raises that size to that of the first
/// such block freed. The block here is never touched, so it takes no memory.
pub fn keep_what_is_freed() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST)));
}
