//! Photons sorted along a Morton curve, eight to a leaf, under a complete 8-ary tree of bounding boxes.
//!
//! The tree has no pointers: the children of node `i` are the nodes `8 i .. 8 i + 8` of the next level. A query tests
//! the eight boxes of a node, or the eight photons of a leaf, with one vector instruction each. Unlike a grid, the tree
//! is insensitive to clusters of photons (caustics) and to the range of bandwidths, and it never finds a photon twice.

use super::ThinningKey;
use crate::math::{Rgb, Vec3};
use crate::spectrum::Band;
use rayon::prelude::*;
use wide::{CmpLt, f32x8};

/// Number of photons per leaf of the tree, and of children per node.
const WIDTH: usize = 8;
/// Number of node levels of the tree over 2^32 photons: log8(2^32 / 8), rounded up.
const MAX_LEVELS: usize = 10;
/// Bits per axis of the Morton code by which photons are sorted.
const MORTON_BITS: u32 = 21;

/// Whether, and how likely, camera paths find the light of a photon on their own. Known only if all bounces of its
/// light path were delta; unknown (0) for other photons.
///
/// One byte: 1 for a delta light, otherwise twice the biased exponent of the density of emission. So the density is
/// known up to a factor of two, and no density is stored as 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct PhotonFlags(u8);

impl PhotonFlags {
    /// Flags of a photon from a delta light: no continued camera path can find it.
    pub const UNREACHABLE: PhotonFlags = PhotonFlags(1);
    /// Bias of the stored exponents, and the range of exponents.
    const BIAS: i32 = 64;
    const EXPONENTS: (i32, i32) = (-63, 63);

    /// Flags of a photon from a light with a size that emits with this density per area and solid angle
    /// ([`crate::light::EmissionDensity::ray_density`]).
    #[inline]
    pub fn from_area_light(density: f32) -> PhotonFlags {
        let exponent = (density.to_bits() >> 23 & 0xff) as i32 - 127;
        let (least, largest) = Self::EXPONENTS;
        PhotonFlags(((exponent.clamp(least, largest) + Self::BIAS) << 1) as u8)
    }

    /// Density of emission per area and solid angle, rounded down to a power of two; 0 if it is unknown or the light is
    /// a delta light.
    #[inline]
    pub fn density(self) -> f32 {
        if self.0 < 2 { 0.0 } else { f32::from_bits(((i32::from(self.0 >> 1) - Self::BIAS + 127) as u32) << 23) }
    }
}

/// What decides which camera paths gather a photon, in one byte: the band of the light path's wavelength, and the code
/// (0 to 15) of the solids around that alpha lets not exist for the light path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct PhotonTag(u8);

impl PhotonTag {
    /// Packs a band and a code.
    #[inline]
    pub fn new(band: Band, absent: u8) -> PhotonTag {
        PhotonTag(band.bits() << 4 | absent & 15)
    }

    /// Band of the light path's wavelength; [`Band::WHITE`] for a path without one, which has not met dispersive glass.
    #[inline]
    pub fn band(self) -> Band {
        Band::from_bits(self.0 >> 4)
    }

    /// Code of the absent solids.
    #[inline]
    pub fn absent(self) -> u8 {
        self.0 & 15
    }
}

/// A photon on a surface: a vertex of a light path, reduced to the data that gathering needs, in the order in which
/// gathering loads it.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct Photon {
    /// World position.
    pub p: Vec3,
    /// Unit direction towards the previous vertex of the light path.
    pub wi: Vec3,
    /// Unit geometric normal of the surface.
    pub ng: Vec3,
    /// Flux (W), already divided by the number of light paths of the iteration.
    pub flux: Rgb,
    /// Number of segments of the light path up to the photon.
    pub depth: u16,
    /// Whether, and how likely, camera paths find the light of the photon on their own.
    pub flags: PhotonFlags,
    /// Band of the light path's wavelength, and the absent solids around the photon.
    pub tag: PhotonTag,
    /// Weight and rank, for bandwidth rules that count photons; zero if light paths are not guided.
    pub thinning_key: ThinningKey,
}

impl Photon {
    /// Cosine between the direction of the photon and its normal.
    #[inline]
    pub fn cosine(&self) -> f32 {
        self.wi.dot(self.ng).abs()
    }
}

/// Leaf of the tree: positions of eight photons for SIMD; absent photons are infinitely far away.
#[derive(Clone, Copy)]
struct Leaf {
    x: f32x8,
    y: f32x8,
    z: f32x8,
}

/// Inner node of the tree: bounding boxes of its eight children; boxes of absent children are empty.
#[derive(Clone, Copy)]
struct Node {
    min: [f32x8; 3],
    max: [f32x8; 3],
}

/// A photon that a map can store.
pub trait Located: Copy + Send + Sync {
    /// World position.
    fn position(&self) -> Vec3;
    /// Unit geometric normal of the surface.
    fn normal(&self) -> Vec3;
    /// Whether all data of the photon are finite.
    fn is_finite(&self) -> bool;
}

impl Located for Photon {
    #[inline]
    fn position(&self) -> Vec3 {
        self.p
    }

    #[inline]
    fn normal(&self) -> Vec3 {
        self.ng
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.p.is_finite() && self.flux.is_finite()
    }
}

/// Photons of one iteration with a tree for range queries.
pub struct PhotonMap<P = Photon> {
    photons: Vec<P>,
    /// Number of photons that were left out because a value was not finite.
    rejected: u64,
    paths: u32,
    leaves: Vec<Leaf>,
    quantiser: Quantiser,
    /// Nodes of the tree by level. `levels[0]` has the root node; the children of the last level are leaves.
    levels: Vec<Vec<Node>>,
}

/// Spreads the low 21 bits of `v`: two zeros between neighbouring bits.
#[inline]
fn spread(v: u64) -> u64 {
    let mut x = v & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Maps positions in a bounding box to Morton codes.
#[derive(Clone, Copy)]
struct Quantiser {
    min: Vec3,
    scale: f32,
}

impl Quantiser {
    #[inline]
    fn code(&self, p: Vec3) -> u64 {
        let q = ((p - self.min) * self.scale).clamp(Vec3::ZERO, Vec3::splat(((1u32 << MORTON_BITS) - 1) as f32));
        spread(q.x as u64) | spread(q.y as u64) << 1 | spread(q.z as u64) << 2
    }
}

#[derive(Clone, Copy)]
struct Aabb {
    min: Vec3,
    max: Vec3,
}

impl Aabb {
    const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    #[inline]
    fn of(photon: &impl Located) -> Aabb {
        Aabb { min: photon.position(), max: photon.position() }
    }

    #[inline]
    fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}

impl<P: Located> PhotonMap<P> {
    /// Builds a map. The order of `photons` must be fixed (by path, then vertex): photons with equal Morton codes stay
    /// in it, so the order in which queries visit photons depends on the photons alone. Photons that are not finite are
    /// left out.
    pub fn build(mut photons: Vec<P>) -> PhotonMap<P> {
        let all = photons.len();
        photons.retain(P::is_finite);
        let rejected = (all - photons.len()) as u64;
        let bounds = photons.iter().fold(Aabb::EMPTY, |b, p| b.union(Aabb::of(p)));
        let extent = (bounds.max - bounds.min).max_element().max(f32::MIN_POSITIVE);
        let quantiser = Quantiser { min: bounds.min, scale: ((1u32 << MORTON_BITS) - 1) as f32 / extent };
        let mut order: Vec<(u64, usize)> =
            photons.par_iter().enumerate().map(|(i, photon)| (quantiser.code(photon.position()), i)).collect();
        order.par_sort_unstable();
        let photons: Vec<P> = order.par_iter().map(|&(_, i)| photons[i]).collect();

        let far = f32::INFINITY;
        let (leaves, mut boxes): (Vec<Leaf>, Vec<Aabb>) = photons
            .par_chunks(WIDTH)
            .map(|chunk| {
                let axis = |a: usize| {
                    f32x8::from(std::array::from_fn::<f32, WIDTH, _>(|i| chunk.get(i).map_or(far, |p| p.position()[a])))
                };
                let aabb = chunk.iter().fold(Aabb::EMPTY, |b, p| b.union(Aabb::of(p)));
                (Leaf { x: axis(0), y: axis(1), z: axis(2) }, aabb)
            })
            .unzip();
        let mut levels = Vec::new();
        while !boxes.is_empty() {
            let (nodes, parents): (Vec<Node>, Vec<Aabb>) = boxes
                .par_chunks(WIDTH)
                .map(|chunk| {
                    let side = |a: usize, f: &dyn Fn(&Aabb) -> Vec3, absent: f32| {
                        f32x8::from(std::array::from_fn::<f32, WIDTH, _>(|i| chunk.get(i).map_or(absent, |b| f(b)[a])))
                    };
                    let node = Node {
                        min: std::array::from_fn(|a| side(a, &|b| b.min, f32::INFINITY)),
                        max: std::array::from_fn(|a| side(a, &|b| b.max, f32::NEG_INFINITY)),
                    };
                    (node, chunk.iter().fold(Aabb::EMPTY, |b, &c| b.union(c)))
                })
                .unzip();
            levels.push(nodes);
            if parents.len() == 1 {
                break;
            }
            boxes = parents;
        }
        levels.reverse();
        debug_assert!(levels.len() <= MAX_LEVELS);
        PhotonMap { photons, rejected, paths: 0, leaves, quantiser, levels }
    }

    /// Sets the number of light paths that left the photons, from which expected numbers of photons are derived.
    #[must_use]
    pub fn of_paths(self, paths: u32) -> PhotonMap<P> {
        PhotonMap { paths, ..self }
    }

    /// Number of light paths that left the photons; 0 if unknown.
    #[inline]
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Number of photons that were left out because they were not finite.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// The photons, in Morton order.
    pub fn photons(&self) -> &[P] {
        &self.photons
    }

    /// Memory that the map uses, in bytes.
    pub fn bytes(&self) -> usize {
        self.photons.len() * size_of::<P>()
            + self.leaves.len() * size_of::<Leaf>()
            + self.levels.iter().map(|l| l.len() * size_of::<Node>()).sum::<usize>()
    }

    /// About `2 * reach` photons before and after `p` along the Morton curve, most of which are near `p`.
    pub(super) fn around(&self, p: Vec3, reach: usize) -> &[P] {
        let code = self.quantiser.code(p);
        let at = self.photons.partition_point(|photon| self.quantiser.code(photon.position()) < code);
        &self.photons[at.saturating_sub(reach)..(at + reach).min(self.photons.len())]
    }

    /// Calls `visit(photon, squared distance)` for every photon strictly nearer to `p` than `sqrt(radius2)`, in Morton
    /// order.
    #[inline]
    pub fn within(&self, p: Vec3, radius2: f32, mut visit: impl FnMut(&P, f32)) {
        self.traverse(p, radius2, |photon, distance2, radius2| {
            visit(photon, distance2);
            radius2
        });
    }

    /// Calls `visit(photon, squared distance, squared radius)` for every photon nearer to `p` than the radius, in
    /// Morton order. `visit` returns the squared radius for the rest of the search, which must not be larger.
    #[inline]
    pub(super) fn traverse(&self, p: Vec3, mut radius2: f32, mut visit: impl FnMut(&P, f32, f32) -> f32) {
        if self.levels.is_empty() {
            return;
        }
        let (px, py, pz) = (f32x8::splat(p.x), f32x8::splat(p.y), f32x8::splat(p.z));
        let leaf_level = self.levels.len();
        // For each level: the node being visited, and the bits of its children still to visit.
        let mut stack = [(0u32, 0u32); MAX_LEVELS];
        let mut level = 0;
        stack[0] = (0, self.hit_children(0, 0, px, py, pz, radius2));
        loop {
            let (node, mask) = stack[level];
            if mask == 0 {
                if level == 0 {
                    return;
                }
                level -= 1;
                continue;
            }
            stack[level].1 = mask & (mask - 1);
            let child = node as usize * WIDTH + mask.trailing_zeros() as usize;
            if level + 1 < leaf_level {
                level += 1;
                stack[level] = (child as u32, self.hit_children(level, child, px, py, pz, radius2));
                continue;
            }
            let leaf = &self.leaves[child];
            let (dx, dy, dz) = (leaf.x - px, leaf.y - py, leaf.z - pz);
            let distance2 = dx * dx + dy * dy + dz * dz;
            let mut inside = distance2.cmp_lt(f32x8::splat(radius2)).move_mask() as u32;
            let distance2 = distance2.to_array();
            while inside != 0 {
                let i = inside.trailing_zeros() as usize;
                inside &= inside - 1;
                radius2 = visit(&self.photons[child * WIDTH + i], distance2[i], radius2);
            }
        }
    }

    /// Bit mask of the children of a node whose boxes are nearer to the query point than the radius.
    #[inline]
    fn hit_children(&self, level: usize, node: usize, px: f32x8, py: f32x8, pz: f32x8, radius2: f32) -> u32 {
        let node = &self.levels[level][node];
        let zero = f32x8::ZERO;
        let gap = |min: f32x8, max: f32x8, p: f32x8| (min - p).fast_max(p - max).fast_max(zero);
        let dx = gap(node.min[0], node.max[0], px);
        let dy = gap(node.min[1], node.max[1], py);
        let dz = gap(node.min[2], node.max[2], pz);
        (dx * dx + dy * dy + dz * dz).cmp_lt(f32x8::splat(radius2)).move_mask() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// Photons on a sheet, in a tight cluster, at one point, and scattered.
    fn photons(n: u64) -> Vec<Photon> {
        (0..n)
            .map(|i| {
                let draws = Stream::new(7, 0, Domain::Test, i).vertex(0);
                let u = draws.two(Purpose::Pixel);
                let v = draws.one(Purpose::Lobe);
                let p = match i % 4 {
                    0 => Vec3::new(u.x * 10.0, 0.0, u.y * 10.0),
                    1 => Vec3::new(3.0 + 1e-3 * u.x, 1e-3 * v, 4.0 + 1e-3 * u.y),
                    2 => Vec3::new(5.0, 5.0, 5.0),
                    _ => Vec3::new(u.x, u.y, v) * 10.0,
                };
                Photon {
                    p,
                    wi: Vec3::Y,
                    ng: Vec3::Y,
                    flux: Vec3::splat(i as f32),
                    flags: PhotonFlags(0),
                    depth: 2,
                    tag: PhotonTag::default(),
                    thinning_key: ThinningKey::default(),
                }
            })
            .collect()
    }

    #[test]
    fn queries_find_exactly_what_brute_force_finds() {
        for n in [0u64, 1, 7, 8, 9, 64, 65, 513, 5000] {
            let all = photons(n);
            let map = PhotonMap::build(all.clone());
            assert_eq!(map.photons().len(), n as usize);
            for q in 0..200u64 {
                let draws = Stream::new(8, 0, Domain::Test, q).vertex(0);
                let u = draws.two(Purpose::Pixel);
                let p = if q % 3 == 0 {
                    Vec3::new(5.0, 5.0, 5.0)
                } else {
                    Vec3::new(u.x * 10.0, draws.one(Purpose::Lobe), u.y * 10.0)
                };
                let radius2 = 10f32.powf(-6.0 + 7.0 * draws.one(Purpose::Roulette));
                let mut found: Vec<u32> = Vec::new();
                map.within(p, radius2, |photon, _| found.push(photon.flux.x as u32));
                found.sort_unstable();
                let expected: Vec<u32> =
                    (0..n as u32).filter(|&i| all[i as usize].p.distance_squared(p) < radius2).collect();
                assert_eq!(found, expected, "{n} photons, query {q}");
            }
        }
    }

    /// The kernel of equation (3) is strict: a photon exactly on the rim is not counted.
    #[test]
    fn photons_on_the_rim_are_not_found() {
        let map = PhotonMap::build(vec![Photon {
            p: Vec3::X,
            wi: Vec3::Y,
            ng: Vec3::Y,
            flux: Vec3::ONE,
            flags: PhotonFlags(0),
            depth: 2,
            tag: PhotonTag::default(),
            thinning_key: ThinningKey::default(),
        }]);
        let count = |radius2| {
            let mut n = 0;
            map.within(Vec3::ZERO, radius2, |_, _| n += 1);
            n
        };
        assert_eq!(count(1.0), 0);
        assert_eq!(count(1.0f32.next_up()), 1);
    }
}
