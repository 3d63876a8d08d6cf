//! Limits on the arguments of the library.

/// Largest number of threads of a device. The library allocates memory for each, whether it is used or not.
pub const MAX_THREADS: usize = 4096;

/// Longest side of a picture (pixels).
pub const MAX_SIDE: usize = 65_536;
