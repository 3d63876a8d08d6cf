//! The processor: whether it has the instructions that the program was built with, and how to hide its cache misses.
//!
//! `.cargo/config.toml` builds for x86-64-v3. `is_x86_feature_detected!` is no help: where a feature is enabled at
//! build time it is simply `true`. So the kernel is asked, which lists the features as `flags` in `/proc/cpuinfo`.

use crate::error::{Error, ErrorKind, Result};

/// Features of x86-64-v3 by the kernel's names.
const NEEDED: [&str; 5] = ["avx2", "bmi2", "f16c", "fma", "movbe"];

/// Reads values from memory that several steps are about to use one after the other, so that the processor waits for
/// all of them at once.
#[inline(always)]
pub fn prefetch<T>(values: impl IntoIterator<Item = T>) {
    for value in values {
        // The compiler may not drop the read.
        std::hint::black_box(value);
    }
}

/// Checks the processor; without the instructions the program would end with a signal somewhere in the middle.
///
/// # Errors
/// An instruction is lacking.
pub fn check() -> Result<()> {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux", target_feature = "avx2")) {
        return Ok(());
    }
    let lacking = std::fs::read_to_string("/proc/cpuinfo").map(|text| lacking(&text)).unwrap_or_default();
    if lacking.is_empty() {
        return Ok(());
    }
    let cause = format!("it lacks instructions that this build needs ({})", lacking.join(", "));
    Err(Error::new(ErrorKind::Library, "processor", cause)
        .hint("use a processor made since 2013, or build from source without the flags in .cargo/config.toml"))
}

/// Needed features that the first processor does not list; none where nothing is listed.
fn lacking(cpuinfo: &str) -> Vec<&'static str> {
    let flags = cpuinfo.lines().find_map(|line| line.strip_prefix("flags")?.split_once(':'));
    let Some((_, flags)) = flags else { return Vec::new() };
    NEEDED.into_iter().filter(|needed| !flags.split_whitespace().any(|flag| flag == *needed)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_features_are_named() {
        let modern = "processor\t: 0\nflags\t\t: fpu avx2 bmi2 f16c fma movbe sse2\nbogomips\t: 1\n";
        assert!(lacking(modern).is_empty() && lacking("no such line").is_empty());
        assert_eq!(lacking("flags\t\t: fpu sse2 avx f16c movbe"), ["avx2", "bmi2", "fma"]);
    }
}
