//! Memory that was freed and will be asked for again.

/// Just below the largest block that the C library's rule for this looks at.
const LARGEST: usize = (32 << 20) - (64 << 10);

/// Keeps what is freed for the buffers to come, instead of giving it back to the system.
///
/// The GNU C library gives blocks above a size back as soon as they are freed, and the next one costs a fault for each of
/// its pages: as much time again as all that is done in them. It raises that size to that of the first such block freed.
/// This one is never touched, so it takes no memory. Elsewhere nothing happens.
pub fn keep_what_is_freed() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST)));
}
