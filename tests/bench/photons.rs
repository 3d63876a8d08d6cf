//! Compares data structures for range queries: this project's implicit tree, a hash grid and a kd-tree, on typical
//! photon distributions (a plane, a caustic in a room, a focus), with bandwidths over a factor of a hundred. All
//! interleaved in one run; only ratios count.

#![allow(clippy::disallowed_methods, reason = "benchmarks are what clocks are for")]

use caustique::math::{Rgb, Vec3};
use caustique::photon::{Nearest, Photon, PhotonFlags, PhotonMap, PhotonTag, ThinningKey};
use caustique::random::{Domain, Purpose, Stream};

use std::time::Instant;

const PHOTONS: u64 = 200_000;
const QUERIES: usize = 100_000;

/// Photons of a distribution, then query points: positions of photons, in the order of pixels.
fn distribution(name: &str, i: u64) -> Vec3 {
    let draws = Stream::new(5, 0, Domain::Test, i).vertex(0);
    let u = draws.two(Purpose::Pixel);
    let v = draws.two(Purpose::Lens);
    match name {
        "plane" => Vec3::new(u.x * 4.0, 0.0, u.y * 4.0),
        // Walls of a room, and half of the photons on caustic curves of a millimetre's width.
        "caustic" if i.is_multiple_of(2) => {
            let phi = u.x * 6.0;
            let r = 0.2 + 0.05 * (3.0 * phi).sin() + 1e-3 * (v.x + v.y - 1.0);
            Vec3::new(1.0 + r * phi.cos(), 0.0, 1.0 + r * phi.sin())
        }
        // A perfect focus: density proportional to 1 / r^2 over four decades.
        "focus" if i.is_multiple_of(2) => {
            let r = 0.5 * 10f32.powf(-4.0 * u.x);
            let phi = u.y * std::f32::consts::TAU;
            Vec3::new(2.0 + r * phi.cos(), 0.0, 2.0 + r * phi.sin())
        }
        _ => match i % 6 {
            1 => Vec3::new(u.x * 4.0, 0.0, u.y * 4.0),
            3 => Vec3::new(u.x * 4.0, u.y * 3.0, 0.0),
            _ => Vec3::new(0.0, u.x * 3.0, u.y * 4.0),
        },
    }
}

/// Counting-sorted hash grid with cells of twice the radius. Queries compare cell coordinates, so that no photon counts
/// twice.
struct Grid {
    cell: f32,
    mask: u32,
    starts: Vec<u32>,
    photons: Vec<(Vec3, [i32; 3])>,
}

impl Grid {
    fn cell_of(p: Vec3, cell: f32) -> [i32; 3] {
        [(p.x / cell).floor() as i32, (p.y / cell).floor() as i32, (p.z / cell).floor() as i32]
    }

    fn hash(c: [i32; 3], mask: u32) -> usize {
        ((c[0] as u32).wrapping_mul(73_856_093)
            ^ (c[1] as u32).wrapping_mul(19_349_663)
            ^ (c[2] as u32).wrapping_mul(83_492_791)) as usize
            & mask as usize
    }

    fn build(points: &[Vec3], radius: f32) -> Grid {
        let cell = 2.0 * radius;
        let mask = (points.len().next_power_of_two() - 1) as u32;
        let cells: Vec<[i32; 3]> = points.iter().map(|&p| Self::cell_of(p, cell)).collect();
        let mut starts = vec![0u32; mask as usize + 2];
        for &c in &cells {
            starts[Self::hash(c, mask) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut photons = vec![(Vec3::ZERO, [0; 3]); points.len()];
        for (&p, &c) in points.iter().zip(&cells) {
            let at = &mut next[Self::hash(c, mask)];
            photons[*at as usize] = (p, c);
            *at += 1;
        }
        Grid { cell, mask, starts, photons }
    }

    fn within(&self, p: Vec3, radius: f32, mut visit: impl FnMut(f32)) {
        let low = Self::cell_of(p - Vec3::splat(radius), self.cell);
        let high = Self::cell_of(p + Vec3::splat(radius), self.cell);
        let radius2 = radius * radius;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let h = Self::hash([x, y, z], self.mask);
                    for (q, c) in &self.photons[self.starts[h] as usize..self.starts[h + 1] as usize] {
                        let d2 = q.distance_squared(p);
                        if *c == [x, y, z] && d2 < radius2 {
                            visit(d2);
                        }
                    }
                }
            }
        }
    }
}

/// Median-split kd-tree in one array, as in Jensen's book.
struct KdTree {
    points: Vec<Vec3>,
    axes: Vec<u8>,
}

impl KdTree {
    fn build(points: &[Vec3]) -> KdTree {
        let mut tree = KdTree { points: points.to_vec(), axes: vec![0; points.len()] };
        let n = points.len();
        tree.split(0, n);
        tree
    }

    fn split(&mut self, begin: usize, end: usize) {
        if end - begin < 2 {
            return;
        }
        let part = &mut self.points[begin..end];
        let low = part.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let high = part.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        let e = high - low;
        let axis = if e.x >= e.y && e.x >= e.z {
            0
        } else if e.y >= e.z {
            1
        } else {
            2
        };
        let middle = part.len() / 2;
        part.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        self.axes[begin + middle] = axis as u8;
        self.split(begin, begin + middle);
        self.split(begin + middle + 1, end);
    }

    fn within(&self, p: Vec3, radius2: f32, visit: &mut impl FnMut(f32), begin: usize, end: usize) {
        if begin >= end {
            return;
        }
        let middle = begin + (end - begin) / 2;
        let q = self.points[middle];
        let d2 = q.distance_squared(p);
        if d2 < radius2 {
            visit(d2);
        }
        let axis = usize::from(self.axes[middle]);
        let d = p[axis] - q[axis];
        if d <= 0.0 || d * d < radius2 {
            self.within(p, radius2, visit, begin, middle);
        }
        if d >= 0.0 || d * d < radius2 {
            self.within(p, radius2, visit, middle + 1, end);
        }
    }
}

fn main() {
    println!("{PHOTONS} photons, {QUERIES} queries, k = 20 bandwidths (spread: largest over smallest), 1 thread");
    println!(
        "{:<10}{:>9}{:>9}{:>12}{:>12}{:>12}   build ms: tree grid kd",
        "photons", "spread", "found", "tree us", "grid us", "kd-tree us"
    );
    for name in ["plane", "caustic", "focus"] {
        let points: Vec<Vec3> = (0..PHOTONS).map(|i| distribution(name, i)).collect();
        let photon = |&p: &Vec3| Photon {
            p,
            wi: Vec3::Y,
            ng: Vec3::Y,
            flux: Rgb::ONE,
            flags: PhotonFlags::default(),
            depth: 2,
            tag: PhotonTag::default(),
            thinning_key: ThinningKey::default(),
        };
        let t = Instant::now();
        let map = PhotonMap::build(points.iter().map(photon).collect());
        let build_tree = t.elapsed();
        // Neighbouring pixels see neighbouring points, so queries follow the order of the map in runs.
        let mut nearest = Nearest::<Photon>::default();
        let queries: Vec<(Vec3, f32)> = (0..QUERIES)
            .map(|i| {
                let p = map.photons()[i * map.photons().len() / QUERIES].p;
                let r2 = nearest.radius2(&map, p, Vec3::Y, 20, f32::INFINITY).unwrap_or(1.0).max(1e-12);
                (p, r2 * 1.0001)
            })
            .collect();
        let (mut least, mut most) = (f32::INFINITY, 0f32);
        for &(_, r2) in &queries {
            least = least.min(r2);
            most = most.max(r2);
        }
        let mut sorted: Vec<f32> = queries.iter().map(|q| q.1.sqrt()).collect();
        sorted.sort_by(f32::total_cmp);
        // A grid has one cell size. SmallVCM and pbrt use the largest radius; the 99th percentile favours the grid.
        let t = Instant::now();
        let grid = Grid::build(&points, sorted[sorted.len() * 99 / 100]);
        let build_grid = t.elapsed();
        let t = Instant::now();
        let kd = KdTree::build(&points);
        let build_kd = t.elapsed();
        let mut best = [f64::INFINITY; 3];
        let mut found = [0u64; 3];
        for _ in 0..3 {
            for structure in 0..3 {
                let mut n = 0u64;
                let t = Instant::now();
                for &(p, r2) in &queries {
                    match structure {
                        0 => map.within(p, r2, |_, _| n += 1),
                        1 => grid.within(p, r2.sqrt(), |_| n += 1),
                        _ => kd.within(p, r2, &mut |_| n += 1, 0, kd.points.len()),
                    }
                }
                best[structure] = best[structure].min(t.elapsed().as_secs_f64());
                found[structure] = n;
            }
        }
        assert!(found.iter().all(|&n| n.abs_diff(found[0]) < found[0] / 1000), "the structures disagree: {found:?}");
        let us = best.map(|t| t / QUERIES as f64 * 1e6);
        println!(
            "{:<10}{:>9.0}{:>9.1}{:>12.3}{:>12.3}{:>12.3}   {:.1} {:.1} {:.1}",
            name,
            (most / least).sqrt(),
            found[0] as f64 / QUERIES as f64,
            us[0],
            us[1],
            us[2],
            build_tree.as_secs_f64() * 1e3,
            build_grid.as_secs_f64() * 1e3,
            build_kd.as_secs_f64() * 1e3
        );
    }
}
