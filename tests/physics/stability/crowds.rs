//! Photon maps with no photon, one photon, fewer photons than requested, and a million photons at one point.

use caustique::math::Vec3;
use caustique::photon::{MAX_NEIGHBOURS, Near, Nearest, Photon, PhotonMap};

fn photon(p: Vec3, flux: f32) -> Photon {
    Photon { p, wi: Vec3::Z, ng: Vec3::Z, flux: Vec3::splat(flux), depth: 2, ..Photon::default() }
}

/// Number of photons that a query visits.
fn visited(map: &PhotonMap, p: Vec3, bandwidth2: f32) -> u64 {
    let mut count = 0;
    map.within(p, bandwidth2, |_, _| count += 1);
    count
}

#[test]
fn maps_of_no_photons_one_and_fewer_than_requested() {
    for count in 0..20usize {
        let map = PhotonMap::build((0..count).map(|k| photon(Vec3::X * k as f32, 1.0)).collect());
        assert_eq!((map.photons().len(), map.rejected()), (count, 0));
        assert_eq!(visited(&map, Vec3::ZERO, 1e9), count as u64);
        assert_eq!(visited(&map, Vec3::ZERO, 0.0), 0);
        let mut nearest = Nearest::default();
        for k in 1..=20 {
            let found = nearest.bandwidth2(&map, Vec3::ZERO, Vec3::Z, k, f32::INFINITY);
            assert_eq!(found, (k <= count).then(|| ((k - 1) * (k - 1)) as f32), "{k} of {count}");
        }
    }
}

/// Photons that are not finite are left out and counted; the others are found.
#[test]
fn photons_that_are_not_finite_are_counted() {
    let broken = [(Vec3::NAN, 1.0), (Vec3::X, f32::INFINITY), (Vec3::Y * f32::INFINITY, 1.0), (Vec3::X, f32::NAN)];
    let all = (0..1000).map(|k| match broken.get(k / 10).filter(|_| k % 10 == 7) {
        Some(&(p, flux)) => photon(p, flux),
        None => photon(Vec3::X * k as f32, 1.0),
    });
    let map = PhotonMap::build(all.collect());
    assert_eq!((map.photons().len(), map.rejected()), (996, 4));
    assert_eq!(visited(&map, Vec3::ZERO, 1e9), 996);
}

/// With a million photons at one point, a query there visits each photon once, a query beside it visits none, the cache
/// for the next query is bounded, and the nearest photons are found quickly.
#[test]
fn a_million_in_one_point() {
    const MILLION: u64 = 1_000_000;
    let p = Vec3::new(0.3, -0.2, 0.7);
    let others = (0..100).map(|k| photon(p + Vec3::X * (0.1 + k as f32), 1.0));
    let map = PhotonMap::build((0..MILLION).map(|_| photon(p, 1.0)).chain(others).collect());
    let beside = p + Vec3::Y * 0.01;
    assert_eq!(visited(&map, p, 1e-4), MILLION);
    assert_eq!(visited(&map, beside, 0.9e-4), 0);
    // Leaves of 96 bytes hold eight photons, and nodes of 192 bytes eight leaves or nodes: no query reads more.
    let bytes = map.bytes() as u64 - 1_000_100 * size_of::<Photon>() as u64;
    assert!(bytes < (MILLION / 8 + 20) * (96 + 32), "{bytes}");
    let mut near = Near::default();
    for _ in 0..3 {
        let mut count = 0;
        map.gather(&mut near, p, Vec3::Z, 1e-4, |_, _| count += 1);
        assert_eq!(count, MILLION);
    }
    let mut nearest = Nearest::default();
    for k in [1, 10, MAX_NEIGHBOURS] {
        assert_eq!(nearest.bandwidth2(&map, p, Vec3::Z, k, f32::INFINITY), Some(0.0));
        let found = nearest.bandwidth2(&map, beside, Vec3::Z, k, f32::INFINITY).expect("there are enough");
        assert!((found.sqrt() - 0.01).abs() < 1e-6, "{found}");
    }
}
