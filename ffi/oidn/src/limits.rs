//! Limits on the arguments of the library.

/// Largest number of threads of a device. Open Image Denoise allocates memory for each, whether it is used or not.
pub const MAX_THREADS: usize = 4096;

/// Longest side in pixels of a picture to denoise.
pub const MAX_SIDE: usize = 65_536;
