//! Checks that the processor has the instructions that the program was built with, and prefetches memory.
//!
//! `.cargo/config.toml` builds for x86-64-v3. The check asks the system, because `is_x86_feature_detected!` is always true for a feature that is enabled at build time.

use crate::error::{Error, ErrorKind, Result};
use crate::system;

/// Features of x86-64-v3 by their names in `/proc/cpuinfo`.
const REQUIRED_FEATURES: [&str; 5] = ["avx2", "bmi2", "f16c", "fma", "movbe"];

/// Reads `values` from memory before the code that uses them, so that their cache misses overlap.
#[inline(always)]
pub fn prefetch<T>(values: impl IntoIterator<Item = T>) {
    for value in values {
        // Keeps the compiler from removing the read.
        std::hint::black_box(value);
    }
}

/// Checks that the processor has all required instructions. Without one, the program would die by a signal when it
/// first uses it.
///
/// # Errors
/// An instruction is missing.
pub fn check() -> Result<()> {
    if !cfg!(target_feature = "avx2") {
        return Ok(());
    }
    let missing = system::processor_features().map(|features| missing_features(&features)).unwrap_or_default();
    if missing.is_empty() {
        return Ok(());
    }
    let cause = format!("it lacks instructions that this build needs ({})", missing.join(", "));
    Err(Error::new(ErrorKind::Library, "processor", cause)
        .hint("use a processor made since 2013, or build from source without the flags in .cargo/config.toml"))
}

/// Required processor features that are not among `features`.
fn missing_features(features: &[String]) -> Vec<&'static str> {
    REQUIRED_FEATURES.into_iter().filter(|name| !features.iter().any(|feature| feature == name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_features_are_named() {
        let missing = |features: &str| missing_features(&features.split(' ').map(String::from).collect::<Vec<_>>());
        assert_eq!(missing("fpu avx2 bmi2 f16c fma movbe sse2"), [] as [&str; 0]);
        assert_eq!(missing("fpu sse2 avx f16c movbe"), ["avx2", "bmi2", "fma"]);
    }
}
