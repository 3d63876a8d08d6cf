//! Measures the speed of ray queries (millions of rays per second) on a mesh of a million triangles, for random rays
//! and for the rays of a pinhole camera.
//!
//! `cargo run --release -p caustique-embree --example rays [THREADS]`; `CAUSTIQUE_EMBREE` chooses the library.

#![allow(clippy::disallowed_methods, reason = "benchmarks are what clocks are for")]

#[path = "../tests/support/mod.rs"]
#[allow(dead_code)]
mod support;

use std::time::Instant;

use caustique_embree::Ray;
use support::{Random, library, million, ray};

const RAYS: usize = 1_000_000;

fn main() {
    let threads = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    println!("{:?}, {threads} threads", library());
    let start = Instant::now();
    let scene = million();
    println!("build      {:6.2} s, with all processors", start.elapsed().as_secs_f64());

    let mut random = Random(1);
    let incoherent: Vec<Ray> = (0..RAYS).map(|_| ray(random.point(), random.direction())).collect();
    let side = (RAYS as f32).sqrt();
    let camera = |k| {
        let (x, y) = (k as f32 % side / side, (k as f32 / side).floor() / side);
        ray([0.5, 0.5, 0.7], [x - 0.5, y - 0.5, -0.7])
    };
    let coherent: Vec<Ray> = (0..RAYS).map(camera).collect();
    for (name, rays) in [("random", &incoherent), ("camera", &coherent)] {
        best(&format!("{name} intersect"), threads, rays, |ray| scene.intersect(ray).is_some());
        eights(&format!("{name} intersect8"), threads, rays, scene);
        best(&format!("{name} occluded"), threads, rays, |ray| scene.occluded(ray));
    }
}

/// Prints the speed of tracing packets with [`Scene::intersect8`](caustique_embree::Scene::intersect8), as [`best`]
/// does.
fn eights(name: &str, threads: usize, rays: &[Ray], scene: &caustique_embree::Scene) {
    let mut seconds = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    let mut hits = 0;
                    for rays in rays.chunks_exact(8) {
                        scene.intersect8(|k| Some(rays[k]), |_, _| hits += 1);
                    }
                    std::hint::black_box(hits)
                });
            }
        });
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    println!("{name:17} {:6.2} Mrays/s", (threads * rays.len()) as f64 / seconds * 1e-6);
}

/// Prints the speed of the fastest of five runs, in which each thread traces all rays.
fn best(name: &str, threads: usize, rays: &[Ray], hit: impl Fn(&Ray) -> bool + Sync) {
    let mut seconds = f64::INFINITY;
    let mut hits = 0;
    for _ in 0..5 {
        let start = Instant::now();
        hits = std::thread::scope(|scope| {
            let work = || rays.iter().filter(|ray| hit(ray)).count();
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            workers.into_iter().filter_map(|worker| worker.join().ok()).sum::<usize>()
        });
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let all = (threads * rays.len()) as f64;
    println!("{name:17} {:6.2} Mrays/s, {:4.1} % hit", all / seconds * 1e-6, 100.0 * hits as f64 / all);
}
