//! Distance to the k-th nearest photon, for initial bandwidths.

use super::map::Located;
use super::near::{Near, same_surface};
use super::{Photon, PhotonMap};
use crate::math::Vec3;

/// Largest k in a search for the k-th nearest photon.
pub const MAX_NEIGHBOURS: usize = 1024;

/// First search radius over the distance that the previous search found; a little larger than 1, so that it mostly
/// suffices.
const GUESS_RATIO: f32 = 1.3;

/// Searches a photon map for the k-th nearest photon. Each thread has one per map. The result of the last search is the
/// first guess of the next, which affects the time only.
pub struct Nearest<P = Photon> {
    near: Near<P>,
    distances2: Vec<f32>,
    /// Squared distance (square scene units) found by the previous search.
    last2: f32,
}

impl<P> Default for Nearest<P> {
    fn default() -> Self {
        Nearest { near: Near::default(), distances2: Vec::new(), last2: 0.0 }
    }
}

impl<P: Located> Nearest<P> {
    /// Squared distance from `p` to its `k`-th nearest photon on the surface with normal `ng`, among those nearer than
    /// `sqrt(limit2)`; `None` if there are fewer than `k`. `1 <= k <=` [`MAX_NEIGHBOURS`].
    pub fn bandwidth2(&mut self, map: &PhotonMap<P>, p: Vec3, ng: Vec3, k: usize, limit2: f32) -> Option<f32> {
        let guess2 = (self.last2 * (GUESS_RATIO * GUESS_RATIO)).min(limit2);
        let mut found = None;
        if guess2 > 0.0 {
            self.distances2.clear();
            map.gather(&mut self.near, p, ng, guess2, |_, distance2| self.distances2.push(distance2));
            // At least k photons within the guessed radius: the k-th of them is the k-th of all.
            if self.distances2.len() >= k {
                found = Some(*self.distances2.select_nth_unstable_by(k - 1, f32::total_cmp).1);
            } else if guess2 == limit2 {
                return None;
            }
        }
        found = found.or_else(|| self.search(map, p, ng, k, limit2));
        self.last2 = found.unwrap_or(limit2);
        found
    }

    /// As [`Nearest::bandwidth2`], without a guess of the distance.
    fn search(&mut self, map: &PhotonMap<P>, p: Vec3, ng: Vec3, k: usize, limit2: f32) -> Option<f32> {
        // The k smallest distances, sorted: k is small, and an insertion moves half of them.
        let best = &mut self.distances2;
        best.clear();
        // Photons near `p` on the Morton curve bound the distance, so that the tree search starts with a small radius.
        let mut bound = limit2;
        for photon in map.around(p, 2 * k) {
            let distance2 = photon.position().distance_squared(p);
            if distance2 < bound && same_surface(photon, ng) {
                bound = insert(best, k, distance2, bound);
            }
        }
        best.clear();
        // A photon lies at the bound itself, so the start is just above it.
        let start = if bound < limit2 { bound.next_up() } else { limit2 };
        map.traverse(p, start, |photon, distance2, bandwidth2| {
            // The leaf was tested before the radius shrank.
            if distance2 >= bandwidth2 || !same_surface(photon, ng) {
                bandwidth2
            } else {
                insert(best, k, distance2, bandwidth2)
            }
        });
        (best.len() == k).then(|| best[k - 1])
    }
}

/// Inserts a squared distance into `best`, the `k` smallest so far in ascending order. Returns the squared bandwidth
/// within which further photons matter.
fn insert(best: &mut Vec<f32>, k: usize, distance2: f32, bandwidth2: f32) -> f32 {
    best.insert(best.partition_point(|&d| d <= distance2), distance2);
    best.truncate(k);
    // Only photons strictly nearer can replace the k-th.
    if best.len() == k { best[k - 1].min(bandwidth2) } else { bandwidth2 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::PhotonTag;
    use crate::photon::{PhotonFlags, ThinningKey};
    use crate::random::{Domain, Purpose, Stream};

    #[test]
    fn the_kth_nearest_agrees_with_sorting() {
        let photons: Vec<Photon> = (0..3000)
            .map(|i| {
                let draws = Stream::new(3, 0, Domain::Test, i).vertex(0);
                let u = draws.two(Purpose::Pixel);
                let p = Vec3::new(u.x, u.y, 0.01 * draws.one(Purpose::Lobe));
                Photon {
                    p,
                    wi: Vec3::Z,
                    ng: if i % 3 == 0 { Vec3::NEG_Z } else { Vec3::Z },
                    flux: Vec3::ONE,
                    flags: PhotonFlags::default(),
                    depth: 2,
                    tag: PhotonTag::default(),
                    thinning_key: ThinningKey::default(),
                }
            })
            .collect();
        let map = PhotonMap::build(photons.clone());
        let mut nearest = Nearest::<Photon>::default();
        for q in 0..200 {
            let k = [1, 10, 20, 500][q as usize % 4];
            // Queries near the previous one, and far from it.
            let u = Stream::new(4, 0, Domain::Test, q / 8).vertex((q % 8) as u32).two(Purpose::Pixel);
            let base = Stream::new(4, 1, Domain::Test, q / 8).vertex(0).two(Purpose::Pixel);
            let p = Vec3::new(base.x, base.y, 0.0) + 0.01 * Vec3::new(u.x, u.y, 0.0);
            let mut distances: Vec<f32> =
                photons.iter().filter(|photon| photon.ng.z > 0.0).map(|photon| photon.p.distance_squared(p)).collect();
            distances.sort_by(f32::total_cmp);
            assert_eq!(nearest.bandwidth2(&map, p, Vec3::Z, k, f32::INFINITY), Some(distances[k - 1]));
            assert_eq!(nearest.bandwidth2(&map, p, Vec3::Z, k, distances[k - 1]), None);
        }
    }
}
