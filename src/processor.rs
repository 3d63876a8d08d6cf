//! Checks that the processor has the instructions that the program was built with, and prefetches memory.
//!
//! `.cargo/config.toml` builds for x86-64-v3. The check reads `flags` in `/proc/cpuinfo`, because
//! `is_x86_feature_detected!` is always true for a feature that is enabled at build time.

use crate::error::{Error, ErrorKind, Result};

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
    if !cfg!(all(target_arch = "x86_64", target_os = "linux", target_feature = "avx2")) {
        return Ok(());
    }
    let missing = std::fs::read_to_string("/proc/cpuinfo").map(|text| missing_features(&text)).unwrap_or_default();
    if missing.is_empty() {
        return Ok(());
    }
    let cause = format!("it lacks instructions that this build needs ({})", missing.join(", "));
    Err(Error::new(ErrorKind::Library, "processor", cause)
        .hint("use a processor made since 2013, or build from source without the flags in .cargo/config.toml"))
}

/// Required processor features that the first processor in the text `cpuinfo` does not list. Empty if it has no list of
/// features.
fn missing_features(cpuinfo: &str) -> Vec<&'static str> {
    let flags = cpuinfo.lines().find_map(|line| line.strip_prefix("flags")?.split_once(':'));
    let Some((_, flags)) = flags else { return Vec::new() };
    REQUIRED_FEATURES.into_iter().filter(|name| !flags.split_whitespace().any(|flag| flag == *name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_features_are_named() {
        let modern = "processor\t: 0\nflags\t\t: fpu avx2 bmi2 f16c fma movbe sse2\nbogomips\t: 1\n";
        assert!(missing_features(modern).is_empty() && missing_features("no such line").is_empty());
        assert_eq!(missing_features("flags\t\t: fpu sse2 avx f16c movbe"), ["avx2", "bmi2", "fma"]);
    }
}
