//! Owen-scrambled Sobol' points in padded pairs of dimensions \[Burley 2020, "Practical Hash-based Owen Scrambling"\].
//!
//! Each pair of dimensions is the (0,2)-sequence of the first two Sobol' dimensions with its own shuffle of the index
//! and its own scramble, both keyed by a seed. Pairs of different seeds are independent. Points of one sequence are
//! negatively correlated, so a variance must be estimated from sums over different seeds.
//!
//! A scramble works on bits in reverse order, least significant first. Where one scramble follows another, the two
//! reversals between them cancel and are left out.

use super::mix;
use glam::{DVec2, Vec2};

/// Laine-Karras style hash: a random binary-tree permutation of bit-reversed integers. The constants are from Vegdahl
/// 2021.
#[inline]
fn tree_hash(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Second Sobol' dimension of `index`, bits least significant first.
///
/// The generator matrix is Pascal's triangle modulo 2. The bit of weight 2^(-1-j) is the sum modulo 2 of the bits k of
/// the index for which the binomial coefficient "k over j" is odd. By Lucas' theorem these are the k whose binary
/// digits include those of j. The sums over all such k are accumulated digit by digit, five digits for 32 bits.
#[inline]
fn sobol_second(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^ (x >> 16)
}

/// One scrambled pair of dimensions of the Sobol' sequence.
#[derive(Clone, Copy, Debug)]
pub struct SobolPair {
    shuffle: u32,
    scramble: [u32; 2],
}

impl SobolPair {
    /// The pair of dimensions scrambled by `seed`, which may be any number.
    pub fn new(seed: u64) -> SobolPair {
        let a = mix(seed);
        let b = mix(a ^ 0x5851_f42d_4c95_7f2d);
        SobolPair { shuffle: a as u32, scramble: [b as u32, (b >> 32) as u32] }
    }

    /// The pair of dimensions scrambled by 64 random bits. The first dimension uses them directly; only the second
    /// costs a hash.
    #[inline]
    pub(super) fn keyed(bits: u64) -> SobolPair {
        let second = mix(bits ^ 0x5851_f42d_4c95_7f2d);
        SobolPair { shuffle: bits as u32, scramble: [(bits >> 32) as u32, second as u32] }
    }

    /// Point number `index` of the sequence, in `[0, 1)^2`.
    #[inline]
    pub fn point(&self, index: u32) -> Vec2 {
        self.point_reversed(index.reverse_bits())
    }

    /// Point of the sequence in `[0, 1)^2`; `reversed` is its index with the bits in reverse order.
    #[inline]
    pub(super) fn point_reversed(&self, reversed: u32) -> Vec2 {
        let index = self.shuffled(reversed);
        let [x, y] = [tree_hash(index, self.scramble[0]), tree_hash(sobol_second(index), self.scramble[1])];
        // One reversal of 64 bits takes half as long as two of 32.
        let both = (u64::from(x) << 32 | u64::from(y)).reverse_bits();
        Vec2::new(super::unit(both as u32), super::unit((both >> 32) as u32))
    }

    /// First coordinate of a point, in `[0, 1)`; `reversed` is its index with the bits in reverse order.
    #[inline]
    pub(super) fn first_reversed(&self, reversed: u32) -> f32 {
        super::unit(self.first_bits(reversed))
    }

    /// First coordinate of a point as a 32-bit fixed-point number; `reversed` is its index with the bits in reverse
    /// order.
    #[inline]
    pub(super) fn first_bits(&self, reversed: u32) -> u32 {
        self.bits_of(self.shuffled(reversed))
    }

    /// Point number `index` of the sequence in `[0, 1)^2`, with all 32 bits of each coordinate.
    #[inline]
    pub fn point_f64(&self, index: u32) -> DVec2 {
        let index = self.shuffled(index.reverse_bits());
        let y = tree_hash(sobol_second(index), self.scramble[1]).reverse_bits();
        DVec2::new(super::unit_f64(self.bits_of(index)), super::unit_f64(y))
    }

    #[inline]
    fn shuffled(&self, reversed: u32) -> u32 {
        tree_hash(reversed, self.shuffle).reverse_bits()
    }

    /// First coordinate of the point at a shuffled index. The first dimension is the radical inverse: with bits least
    /// significant first, it is the index itself.
    #[inline]
    fn bits_of(&self, index: u32) -> u32 {
        tree_hash(index, self.scramble[0]).reverse_bits()
    }
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

    /// The direction numbers of the primitive polynomial x + 1 are v_k = v_{k-1} ^ (v_{k-1} >> 1).
    #[test]
    fn the_second_dimension_agrees_with_its_direction_numbers() {
        for k in 0..100_000u64 {
            let index = mix(k) as u32;
            let (mut direction, mut x) = (0x8000_0000u32, 0);
            for bit in 0..32 {
                if index >> bit & 1 != 0 {
                    x ^= direction;
                }
                direction ^= direction >> 1;
            }
            assert_eq!(sobol_second(index).reverse_bits(), x, "{index:#x}");
        }
    }
}
