//! Tests of the combiner: invariants of equation (6), agreement with the training code, tiles, threads, bad input.

mod contract;
mod equation;
mod hull;
mod image;

use super::*;
use crate::error::ErrorKind;
use crate::film::{Picture, Size};

/// Uniform numbers in [0, 1), repeatable (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn fill(&mut self, count: usize, low: f32, high: f32) -> Vec<f32> {
        (0..count).map(|_| low + (high - low) * self.next()).collect()
    }

    fn rgb(&mut self, size: Size, low: f32, high: f32) -> Picture {
        let pixels = (0..size.pixels()).map(|_| std::array::from_fn(|_| low + (high - low) * self.next())).collect();
        Picture::new(size, pixels)
    }

    /// A stack of random bandwidth levels that share a picture and differ by noise.
    fn stack(&mut self, width: usize, height: usize, levels: usize) -> LevelStack {
        let size = Size { width, height };
        let n = size.pixels();
        let base: Vec<f32> =
            (0..n).map(|i| 1.0 + ((i % width) as f32 * 0.3).sin() + (i / width) as f32 * 0.05).collect();
        let level = |random: &mut Self, j: usize| {
            let noise = random.rgb(size, -0.5 / (j + 1) as f32, 0.5 / (j + 1) as f32);
            Picture::from_fn(size, |i| noise[i].map(|e| base[i] * (1.0 + e)))
        };
        LevelStack {
            size,
            levels: (0..levels).map(|j| level(self, j)).collect(),
            variances: (0..levels).map(|_| self.rgb(size, 0.0, 0.1)).collect(),
            albedo: self.rgb(size, 0.0, 1.0),
            normal: self.rgb(size, -1.0, 1.0),
            depth: self.fill(n, 1.0, 5.0),
        }
    }
}

fn combiner() -> Combiner {
    // A machine without ONNX Runtime must fail these tests, not skip them: scripts/setup.sh installs it.
    let runtime = Runtime::find().unwrap();
    Combiner::new(Network::load(&Model::compact(), &runtime, rayon::current_num_threads()).unwrap())
}

/// Largest absolute difference of two images' channels, divided by `scale`.
fn distance(a: &[[f32; 3]], b: &[[f32; 3]], scale: f32) -> f32 {
    assert_eq!(a.len(), b.len());
    let worst = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let differences: Vec<f32> = a.iter().zip(b).map(worst).collect();
    // `max` would drop a NaN.
    assert!(differences.iter().all(|d| d.is_finite()), "values that are not finite");
    differences.into_iter().fold(0.0, f32::max) / scale
}
