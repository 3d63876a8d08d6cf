//! Measures time and memory for one picture at each quality, and prints whether all numbers of threads give the same
//! bytes.
//!
//! `cargo run --release -p caustique-oidn --example denoise [WIDTH HEIGHT [THREADS...]]`

#![allow(clippy::disallowed_methods, reason = "benchmarks are what clocks are for")]

use std::time::Instant;

use caustique_oidn::{Device, Error, Folders, Input, Library, Quality};

/// Random pixels whose values span several decades, like those of a render with few samples.
fn noise(count: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut state = seed;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    (0..count).map(|_| std::array::from_fn(|_| 4.0 * unit().powi(3))).collect()
}

/// Core-seconds that this process has used; zero if the system does not report them.
fn core_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The 12th and 13th number behind the name, which may contain any character. In hundredths of a second.
    let rest = text.rsplit(')').next().unwrap_or_default();
    rest.split_whitespace().skip(11).take(2).flat_map(str::parse::<f64>).sum::<f64>() / 100.0
}

/// Peak memory of this process (MiB); zero if the system does not report it.
fn peak_memory() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse().unwrap_or(0) / 1024
}

/// FNV-1a hash of the bytes of a picture's pixels.
fn fingerprint(pixels: &[[f32; 3]]) -> u64 {
    let bytes = pixels.iter().flatten().flat_map(|value| value.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn main() -> Result<(), Error> {
    let numbers: Vec<usize> = std::env::args().skip(1).flat_map(|text| text.parse()).collect();
    let (width, height) = if let [width, height, ..] = numbers[..] { (width, height) } else { (1280, 720) };
    let threads = numbers.get(2..).filter(|list| !list.is_empty()).unwrap_or(&[1, 2]);
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../.deps/oidn");
    let library = Library::load(&Folders { last: vec![own.into()], ..Folders::default() })?;
    println!("{library:?}, {width}x{height}; the second time of two in one filter");
    let pixels = width.saturating_mul(height);
    let (color, albedo, normal) = (noise(pixels, 1), noise(pixels, 2), noise(pixels, 3));
    for quality in [Quality::Fast, Quality::Balanced, Quality::High] {
        for (guided, memory) in [(false, None), (true, None), (true, Some(256))] {
            for &threads in threads {
                let mut filter = Device::new(&library, threads)?.filter()?;
                let mut input = Input::new(width, height, &color);
                input.quality = quality;
                input.albedo = guided.then_some(&albedo[..]);
                input.normal = guided.then_some(&normal[..]);
                input.max_memory_mib = memory;
                let mut prints = Vec::new();
                let (mut seconds, mut cores) = (0.0, 0.0);
                for _ in 0..2 {
                    let (start, before) = (Instant::now(), core_seconds());
                    prints.push(fingerprint(&filter.denoise(&input)?));
                    (seconds, cores) = (start.elapsed().as_secs_f64(), core_seconds() - before);
                }
                let guides = if guided { "guided" } else { "alone" };
                println!(
                    "{quality:?}, {guides}, memory {memory:?}, {threads} threads: {seconds:.2} s, {cores:.2} \
                     core-seconds, peak {} MiB, {prints:x?}",
                    peak_memory()
                );
            }
        }
    }
    Ok(())
}
