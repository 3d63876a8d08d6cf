//! Cache for range queries at neighbouring points: the photons around a point are copied and scanned.
//!
//! Camera paths of neighbouring pixels gather within a fraction of the bandwidth of each other. A scan visits the
//! photons that the tree would visit, in the order of the tree, so results do not depend on the state of the cache.

use super::map::{Located, PhotonMap};
use crate::math::Vec3;
use wide::{CmpGt, CmpLt, f32x8};

/// Smallest cosine between the normals of a photon and of a gathering point at which both lie on one surface.
const NORMAL_COSINE: f32 = 0.7;

/// Whether the normal of a photon is close enough to `ng`, the geometric normal of a gathering point, to lie on the
/// same surface.
#[inline]
pub fn same_surface(photon: &impl Located, ng: Vec3) -> bool {
    photon.normal().dot(ng) > NORMAL_COSINE
}

/// Radius of the photon cache over the radius of the query that filled it. A larger cache serves more queries but takes
/// longer to scan.
const CACHE_RADIUS_RATIO: f32 = 1.75;
/// Largest number of cached photons; with more, a search of the tree is faster.
const MAX_CACHED: usize = 512;
/// A query fills the photon cache if its distance from the previous query, as a multiple of the radius, is below this.
const MAX_MOVE: f32 = 0.75;
/// Bound of the relative rounding error of distances.
const ROUNDING: f32 = 1e-4;

/// Positions and normals of eight photons for SIMD; absent photons are infinitely far away.
#[derive(Clone, Copy)]
struct Eight {
    p: [f32x8; 3],
    n: [f32x8; 3],
}

/// Which photons of an [`Eight`] a query has found.
#[derive(Clone, Copy)]
struct Hits {
    distance2: f32x8,
    /// Bit mask with a bit for each of the eight photons that is within the radius and on the surface.
    inside: u32,
    /// Index in the cache of the first photon of the eight.
    first: u32,
}

/// Cache of the photons of one map around a point, which speeds up nearby queries. Each thread has one per map.
pub struct Near<P> {
    center: Vec3,
    /// Radius of the ball around the centre of the cache (scene units) in which all photons are cached; 0 if none are.
    radius: f32,
    /// Position of the previous query.
    last: Vec3,
    photons: Vec<P>,
    eights: Vec<Eight>,
    /// Photons found by the last scan of the cache. Its length is the number of eights plus one.
    hits: Vec<Hits>,
}

impl<P> Default for Near<P> {
    fn default() -> Self {
        let nowhere = Vec3::splat(f32::INFINITY);
        Near { center: nowhere, radius: 0.0, last: nowhere, photons: Vec::new(), eights: Vec::new(), hits: Vec::new() }
    }
}

impl<P: Located> PhotonMap<P> {
    /// Calls `visit(photon, squared distance)` for every photon strictly nearer to `p` than `sqrt(radius2)` on the
    /// surface with normal `ng`, in Morton order.
    #[inline]
    pub fn gather(&self, near: &mut Near<P>, p: Vec3, ng: Vec3, radius2: f32, mut visit: impl FnMut(&P, f32)) {
        let radius = radius2.sqrt();
        let moved = near.last.distance_squared(p);
        near.last = p;
        let covered = (near.center.distance(p) + radius) * (1.0 + ROUNDING) <= near.radius;
        if covered || (moved < MAX_MOVE * MAX_MOVE * radius2 && self.fill(near, p, radius * CACHE_RADIUS_RATIO)) {
            near.scan(p, ng, radius2, visit);
        } else {
            self.within(p, radius2, |photon, distance2| {
                if same_surface(photon, ng) {
                    visit(photon, distance2);
                }
            });
        }
    }

    /// Caches all photons within `radius` of `center`. Returns false, with an empty cache, if they are more than
    /// [`MAX_CACHED`].
    #[cold]
    fn fill(&self, near: &mut Near<P>, center: Vec3, radius: f32) -> bool {
        near.photons.clear();
        near.eights.clear();
        self.traverse(center, radius * radius, |photon, _, radius2| {
            near.photons.push(*photon);
            // A radius of zero ends the search.
            if near.photons.len() > MAX_CACHED { 0.0 } else { radius2 }
        });
        if near.photons.len() > MAX_CACHED {
            near.radius = 0.0;
            return false;
        }
        for photons in near.photons.chunks(8) {
            let row = |k: usize| {
                let Some(photon) = photons.get(k) else { return f32x8::splat(f32::INFINITY) };
                let (p, n) = (photon.position(), photon.normal());
                f32x8::from([p.x, p.y, p.z, n.x, n.y, n.z, 0.0, 0.0])
            };
            let [px, py, pz, nx, ny, nz, ..] = f32x8::transpose(std::array::from_fn(row));
            near.eights.push(Eight { p: [px, py, pz], n: [nx, ny, nz] });
        }
        near.hits.resize(near.eights.len() + 1, Hits { distance2: f32x8::ZERO, inside: 0, first: 0 });
        (near.center, near.radius) = (center, radius);
        true
    }
}

impl<P: Located> Near<P> {
    #[inline]
    fn scan(&mut self, p: Vec3, ng: Vec3, radius2: f32, mut visit: impl FnMut(&P, f32)) {
        // All distances first, without branches or calls between them, then the visits.
        let found = self.find(p, ng, radius2);
        for hits in &self.hits[..found] {
            let (photons, distance2) = (&self.photons[hits.first as usize..], hits.distance2.to_array());
            let mut inside = hits.inside;
            while inside != 0 {
                let i = inside.trailing_zeros() as usize;
                inside &= inside - 1;
                visit(&photons[i], distance2[i]);
            }
        }
    }

    /// Writes the cached photons within `sqrt(radius2)` of `p` on the surface with normal `ng` to [`Near::hits`] and
    /// returns the number of entries.
    #[inline(never)]
    fn find(&mut self, p: Vec3, ng: Vec3, radius2: f32) -> usize {
        let (p, ng) = (p.to_array().map(f32x8::splat), ng.to_array().map(f32x8::splat));
        let (radius2, cosine) = (f32x8::splat(radius2), f32x8::splat(NORMAL_COSINE));
        let mut found = 0;
        for (k, eight) in self.eights.iter().enumerate() {
            let d: [f32x8; 3] = std::array::from_fn(|a| eight.p[a] - p[a]);
            let distance2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            // In the order of `Vec3::dot`.
            let cos = eight.n[0] * ng[0] + eight.n[1] * ng[1] + eight.n[2] * ng[2];
            let inside = (distance2.cmp_lt(radius2) & cos.cmp_gt(cosine)).move_mask() as u32;
            // An entry without hits is overwritten by the next.
            self.hits[found] = Hits { distance2, inside, first: 8 * k as u32 };
            found += usize::from(inside != 0);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::PhotonTag;
    use crate::photon::{Photon, PhotonFlags, ThinningKey};
    use crate::random::{Domain, Purpose, Stream};

    /// Clusters, coincident photons and a sheet with two normals; queries that walk, jump and change their radius.
    #[test]
    fn cached_queries_find_what_the_tree_finds() {
        let photons: Vec<Photon> = (0..20_000)
            .map(|i| {
                let draws = Stream::new(5, 0, Domain::Test, i).vertex(0);
                let (u, v) = (draws.two(Purpose::Pixel), draws.one(Purpose::Lobe));
                let p = match i % 5 {
                    0 => Vec3::new(0.5 + 1e-3 * u.x, 1e-3 * v, 0.5 + 1e-3 * u.y),
                    1 => Vec3::new(0.25, 0.0, 0.25),
                    _ => Vec3::new(u.x, 1e-3 * v, u.y),
                };
                let ng = if i % 3 == 0 { Vec3::Z } else { Vec3::Y };
                Photon {
                    p,
                    wi: Vec3::Y,
                    ng,
                    flux: Vec3::splat(i as f32),
                    flags: PhotonFlags::default(),
                    depth: 2,
                    tag: PhotonTag::default(),
                    thinning_key: ThinningKey::default(),
                }
            })
            .collect();
        let map = PhotonMap::build(photons);
        let mut near = Near::default();
        let (mut p, mut radius, mut kept) = (Vec3::new(0.3, 0.0, 0.3), 0.02, 0);
        for q in 0..20_000 {
            let draws = Stream::new(6, 0, Domain::Test, q).vertex(0);
            let (u, v) = (draws.two(Purpose::Pixel), draws.one(Purpose::Lobe));
            if v < 0.01 {
                p = Vec3::new(u.x, 0.0, u.y);
                radius = 10f32.powf(-4.0 + 3.0 * draws.one(Purpose::Roulette));
            } else {
                p += Vec3::new(u.x - 0.5, 0.0, u.y - 0.5) * radius;
            }
            let ng = Vec3::new(0.1, 0.9, 0.1).normalize();
            let radius2 = radius * radius * if q % 2 == 0 { 1.0 } else { 0.125 };
            let (mut found, mut expected) = (Vec::new(), Vec::new());
            map.gather(&mut near, p, ng, radius2, |photon, d2| found.push((photon.flux.x as u32, d2.to_bits())));
            map.within(p, radius2, |photon, d2| {
                if same_surface(photon, ng) {
                    expected.push((photon.flux.x as u32, d2.to_bits()));
                }
            });
            assert_eq!(found, expected, "query {q} at {p}, radius {radius}");
            kept += usize::from(near.radius > 0.0 && near.center.distance(p) < near.radius);
        }
        assert!(kept > 5000, "only {kept} queries were served by what was kept");
    }
}
