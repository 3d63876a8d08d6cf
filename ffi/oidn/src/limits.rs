//! Sizes that the library is asked for at most.

/// The most threads that a device is made for. The library sets a place aside for each, used or not.
pub const MAX_THREADS: usize = 4096;

/// The longest side of a picture.
pub const MAX_SIDE: usize = 65_536;
