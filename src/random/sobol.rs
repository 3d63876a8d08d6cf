//! Owen-scrambled Sobol' points in padded pairs of dimensions \[Burley 2020, "Practical Hash-based Owen Scrambling"\].
//!
//! Each pair of dimensions is the (0,2)-sequence of the first two Sobol' dimensions with its own shuffle of
//! the index and its own scramble, both keyed by a seed that must change every pass: points that repeat from pass to
//! pass would make per-pass variances lie.

use super::mix;
use glam::Vec2;

/// Laine-Karras style hash: a random binary-tree permutation when applied to bit-reversed integers
/// (constants by Vegdahl 2021, which pass more tests than the original ones).
#[inline]
fn tree_hash(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

#[inline]
fn nested_uniform_scramble(x: u32, seed: u32) -> u32 {
    tree_hash(x.reverse_bits(), seed).reverse_bits()
}

/// Second Sobol' dimension of `index`, bits most significant first.
#[inline]
fn sobol_second(mut index: u32) -> u32 {
    // Direction numbers of the primitive polynomial x + 1: v_k = v_{k-1} ^ (v_{k-1} >> 1).
    let mut direction = 0x8000_0000u32;
    let mut x = 0;
    while index != 0 {
        if index & 1 != 0 {
            x ^= direction;
        }
        direction ^= direction >> 1;
        index >>= 1;
    }
    x
}

/// One scrambled pair of dimensions; make one per pass and dimension pair.
#[derive(Clone, Copy, Debug)]
pub struct SobolPair {
    shuffle: u32,
    scramble: [u32; 2],
}

impl SobolPair {
    /// The pair keyed by `seed` (64 hashed bits, different for every pass and pair).
    pub fn new(seed: u64) -> SobolPair {
        let a = mix(seed);
        let b = mix(a ^ 0x5851_f42d_4c95_7f2d);
        SobolPair { shuffle: a as u32, scramble: [b as u32, (b >> 32) as u32] }
    }

    /// Point `index` of the sequence, in `[0, 1)^2`.
    #[inline]
    pub fn point(&self, index: u32) -> Vec2 {
        let index = nested_uniform_scramble(index, self.shuffle);
        let x = nested_uniform_scramble(index.reverse_bits(), self.scramble[0]);
        let y = nested_uniform_scramble(sobol_second(index), self.scramble[1]);
        Vec2::new(super::unit(x), super::unit(y))
    }
}

/// Point `index` of the pair keyed by `seed`.
#[inline]
pub fn owen_sobol(index: u32, seed: u64) -> Vec2 {
    SobolPair::new(seed).point(index)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any 2^m points of a (0,2)-sequence put one point in every elementary interval of area 2^-m.
    #[test]
    fn every_elementary_interval_has_one_point() {
        for seed in 0..8 {
            let pair = SobolPair::new(mix(seed));
            for m in [4u32, 8] {
                let n = 1u32 << m;
                for split in 0..=m {
                    let (nx, ny) = (1u32 << split, 1u32 << (m - split));
                    let mut seen = vec![0; n as usize];
                    for i in 0..n {
                        let p = pair.point(i);
                        seen[((p.x * nx as f32) as u32 * ny + (p.y * ny as f32) as u32) as usize] += 1;
                    }
                    assert!(seen.iter().all(|&c| c == 1), "seed {seed}, {nx} x {ny}");
                }
            }
        }
    }
}
