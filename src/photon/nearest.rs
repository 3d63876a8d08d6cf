//! k-th nearest neighbour, for initial bandwidths.

use super::{Photon, PhotonMap};
use crate::math::Vec3;

/// Most neighbours that can be asked for.
pub const MAX_NEIGHBOURS: usize = 1024;

/// Puts a distance into the sorted run of the `k` best; returns the radius squared that matters from now on.
fn insert(best: &mut Vec<f32>, k: usize, distance2: f32, radius2: f32) -> f32 {
    best.insert(best.partition_point(|&d| d <= distance2), distance2);
    best.truncate(k);
    // Strictly nearer photons only may still displace the k-th.
    if best.len() == k { best[k - 1].min(radius2) } else { radius2 }
}

/// Squared distance from `p` to its `k`-th nearest photon among those that `accept` takes and that lie nearer than
/// `sqrt(limit2)`; `None` when there are fewer than `k`. `1 <= k <=` [`MAX_NEIGHBOURS`].
pub fn nearest_radius2(
    map: &PhotonMap,
    p: Vec3,
    k: usize,
    limit2: f32,
    accept: impl Fn(&Photon) -> bool,
) -> Option<f32> {
    // A sorted run of the best distances: k is small, and an insertion moves half of it.
    let mut best: Vec<f32> = Vec::with_capacity(k + 1);
    // The neighbourhood along the curve bounds the distance, so that the search proper starts small.
    let mut bound = limit2;
    for photon in map.around(p, 2 * k) {
        let distance2 = photon.p.distance_squared(p);
        if distance2 < bound && accept(photon) {
            bound = insert(&mut best, k, distance2, bound);
        }
    }
    best.clear();
    // The bound itself was reached by some photon: it must stay within.
    let start = if bound < limit2 { bound.next_up() } else { limit2 };
    map.traverse(p, start, |photon, distance2, radius2| {
        // The other photons of a leaf were found before the radius shrank.
        if distance2 >= radius2 || !accept(photon) { radius2 } else { insert(&mut best, k, distance2, radius2) }
    });
    (best.len() == k).then(|| best[k - 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::PhotonFlags;
    use crate::random::{Domain, Purpose, Stream};

    #[test]
    fn agrees_with_sorting() {
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
                    flags: PhotonFlags(0),
                    depth: 2,
                }
            })
            .collect();
        let map = PhotonMap::build(photons.clone());
        for (q, k) in [(0, 1), (1, 10), (2, 20), (3, 500)] {
            let u = Stream::new(4, 0, Domain::Test, q).vertex(0).two(Purpose::Pixel);
            let p = Vec3::new(u.x, u.y, 0.0);
            let mut distances: Vec<f32> =
                photons.iter().filter(|photon| photon.ng.z > 0.0).map(|photon| photon.p.distance_squared(p)).collect();
            distances.sort_by(f32::total_cmp);
            assert_eq!(nearest_radius2(&map, p, k, f32::INFINITY, |photon| photon.ng.z > 0.0), Some(distances[k - 1]));
            assert_eq!(nearest_radius2(&map, p, k, distances[k - 1], |photon| photon.ng.z > 0.0), None);
        }
    }
}
