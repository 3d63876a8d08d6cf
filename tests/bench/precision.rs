//! Errors of f32 where f64 or two-part sums could be used, and the costs of both, in one run. Errors are relative to
//! numbers with more digits.
//!
//! `cargo bench --bench precision`. The figures are in the section "Precision" of `docs/lab/hard-cases.md`.

use caustique::estimator::rule::memoryless::bandwidth2_factor;
use caustique::math::{Affine3A, DAffine3, DVec3, Vec3};
use caustique::random::{Domain, Purpose, Stream};
use caustique::render::Clock;
use caustique::stat::sum::{Grid, Sum};
use std::hint::black_box;

const MILLION: u32 = 1_000_000;
/// Number of runs, of which the fastest counts.
const RUNS: usize = 5;

fn main() {
    println!("{:<44}{:>12}{:>12}{:>10}{:>10}", "", "f32 is off", "f64 is off", "f32, ns", "f64, ns");
    pixel_sums();
    radii();
    weights::<4>("weights, densities over 10^+-4", 4.0);
    weights::<4>("weights, densities over 10^+-12", 12.0);
    weights::<4>("weights, densities over 10^+-30", 30.0);
    transmittance();
    choices();
    transforms();
}

fn row(what: &str, [single, double]: [f64; 2], [ns_single, ns_double]: [f64; 2]) {
    println!("{what:<44}{single:>12.1e}{double:>12.1e}{ns_single:>10.2}{ns_double:>10.2}");
}

/// Nanoseconds per step of `run`, which has `count` steps, and its result.
fn timed<T>(count: u32, run: impl Fn() -> T) -> (f64, T) {
    let mut result = black_box(run());
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Clock::start();
        result = black_box(run());
        best = best.min(start.seconds());
    }
    (1e9 * best / f64::from(count), result)
}

fn uniform(index: u32, vertex: u32) -> f32 {
    Stream::new(51, 0, Domain::Test, u64::from(index)).vertex(vertex).one(Purpose::Pixel)
}

/// A million samples, of which a few are a million times as bright as the rest: summed in f32, in f64, and as pixels
/// are.
fn pixel_sums() {
    let values: Vec<f32> = (0..MILLION).map(|i| 10f32.powf(6.0 * uniform(i, 0).powi(8) - 3.0)).collect();
    // Multiples of 2^-40, whose sum is exact.
    let exact: i128 = values.iter().map(|value| (f64::from(*value) * 2f64.powi(40)) as i128).sum();
    let exact = exact as f64 * 2f64.powi(-40);
    let error = |sum: f64| (sum / exact - 1.0).abs();
    let (ns_single, single) = timed(MILLION, || values.iter().fold(0f32, |sum, value| sum + value));
    let (ns_double, double) = timed(MILLION, || values.iter().fold(0f64, |sum, value| sum + f64::from(*value)));
    row("a pixel's sum, plain", [error(f64::from(single)), error(double)], [ns_single, ns_double]);
    let rounding = Grid::default().with_room_for(2000.0).rounding();
    let (ns, sum) = timed(MILLION, || {
        let mut sum = Sum::<f64>::default();
        values.iter().for_each(|value| sum.add(f64::from(*value), rounding));
        sum.value()
    });
    row("a pixel's sum, on two grids", [error(f64::from(single)), error(sum)], [ns_single, ns]);
}

/// A squared radius multiplied by its factor a million times, compared with the explicit form.
fn radii() {
    const ALPHA: f64 = 2.0 / 3.0;
    let exact = bandwidth2_factor(u64::from(MILLION), ALPHA);
    let factor = |i: u32| (f64::from(i) + ALPHA) / (f64::from(i) + 1.0);
    let (ns_single, single) =
        timed(MILLION, || (1..MILLION).fold(1f32, |bandwidth2, i| (f64::from(bandwidth2) * factor(i)) as f32));
    let (ns_double, double) = timed(MILLION, || (1..MILLION).fold(1f64, |bandwidth2, i| bandwidth2 * factor(i)));
    let error = |bandwidth2: f64| (bandwidth2 / exact - 1.0).abs();
    row("a radius kept over 10^6 iterations", [error(f64::from(single)), error(double)], [ns_single, ns_double]);
}

/// Weights of connecting a path of `N` vertices at each of its edges, by partial sums along the path [Georgiev 2012],
/// in either precision: the largest deviation of their sum from one; infinite if one is not finite.
macro_rules! partial_sums {
    ($name:ident, $real:ty) => {
        fn $name<const N: usize>(forward: &[f32; N], reverse: &[f32; N]) -> f64 {
            // `light[s]`: densities of all edges before `s` over that of `s`; `eye` likewise from the camera.
            let (mut light, mut eye) = ([0.0 as $real; N], [0.0 as $real; N]);
            for s in 1..N {
                light[s] = (reverse[s - 1] as $real / forward[s - 1] as $real) * (1.0 + light[s - 1]);
            }
            for s in (0..N - 1).rev() {
                eye[s] = (forward[s] as $real / reverse[s] as $real) * (1.0 + eye[s + 1]);
            }
            let sum: f64 = (0..N).map(|s| (1.0 / (light[s] + 1.0 + eye[s])) as f64).sum();
            if sum.is_nan() { f64::INFINITY } else { (sum - 1.0).abs() }
        }
    };
}
partial_sums!(in_single, f32);
partial_sums!(in_double, f64);

fn weights<const N: usize>(what: &str, span: f32) {
    const PATHS: u32 = 100_000;
    let draw = |path: u32, from: u32| -> [f32; N] {
        std::array::from_fn(|k| 10f32.powf(span * (2.0 * uniform(path, from + k as u32) - 1.0)))
    };
    let paths: Vec<[[f32; N]; 2]> = (0..PATHS).map(|path| [draw(path, 0), draw(path, N as u32)]).collect();
    let worst = |of: fn(&[f32; N], &[f32; N]) -> f64| {
        timed(PATHS, || paths.iter().map(|[forward, reverse]| of(forward, reverse)).fold(0.0, f64::max))
    };
    let ((ns_single, single), (ns_double, double)) = (worst(in_single::<N>), worst(in_double::<N>));
    row(what, [single, double], [ns_single, ns_double]);
}

/// exp(-x) of optical depths up to 40, compared with f64.
fn transmittance() {
    let depths: Vec<[f32; 2]> = (0..MILLION).map(|i| [40.0 * uniform(i, 0).sqrt(), uniform(i, 1).sqrt()]).collect();
    let (ns_single, _) = timed(MILLION, || depths.iter().map(|[sigma, d]| (-sigma * d).exp()).sum::<f32>());
    let (ns_double, _) =
        timed(MILLION, || depths.iter().map(|[sigma, d]| (-f64::from(*sigma) * f64::from(*d)).exp()).sum::<f64>());
    let error = |[sigma, d]: &[f32; 2]| {
        let exact = (-f64::from(*sigma) * f64::from(*d)).exp();
        (f64::from((-sigma * d).exp()) / exact - 1.0).abs()
    };
    let worst = depths.iter().map(error).fold(0.0, f64::max);
    row("transmittance, optical depths up to 40", [worst, f64::EPSILON], [ns_single, ns_double]);
}

/// A million equal lamps chosen by running sums: the largest relative error of a probability.
fn choices() {
    let share = 1.0 / f64::from(MILLION);
    let (ns_single, single) = timed(MILLION, || {
        let (mut sum, mut worst) = (0f32, 0f64);
        for _ in 0..MILLION {
            let next = sum + share as f32;
            worst = worst.max((f64::from(next - sum) / share - 1.0).abs());
            sum = next;
        }
        worst
    });
    let (ns_double, double) = timed(MILLION, || {
        let (mut sum, mut worst) = (0f64, 0f64);
        for _ in 0..MILLION {
            let next = sum + share;
            worst = worst.max(((next - sum) / share - 1.0).abs());
            sum = next;
        }
        worst
    });
    row("probabilities of 10^6 lamps, running sums", [single, double], [ns_single, ns_double]);
}

/// A rotated child of a rotated node, 1,300 km from the origin, seen from nearby: errors in metres.
fn transforms() {
    let turn = |angle: f64| DAffine3::from_rotation_y(angle);
    let away = DAffine3::from_translation(DVec3::new(1.3e6, 10.0, -2.0e5));
    let nodes = [away, turn(0.3), DAffine3::from_translation(DVec3::X * 7.0), turn(1.1)];
    let near = DVec3::new(1.3e6 + 2.0, 11.0, -2.0e5);
    let p = DVec3::new(0.2, 0.3, -0.4);
    let compose = || nodes.iter().fold(DAffine3::IDENTITY, |all, node| all * *black_box(node));
    let singles = nodes.map(|node| Affine3A::from_mat3_translation(node.matrix3.as_mat3(), node.translation.as_vec3()));
    let (ns_double, double) = timed(1, || compose().transform_point3(p) - near);
    let (ns_single, single) = timed(1, || {
        let all = singles.iter().fold(Affine3A::IDENTITY, |all, node| all * *black_box(node));
        all.transform_point3(p.as_vec3()) - near.as_vec3()
    });
    // Recentred: transforms are composed in f64 and moved to the camera before rounding.
    let recentred: Vec3 = double.as_vec3();
    let errors = [(single.as_dvec3() - double).length(), (recentred.as_dvec3() - double).length()];
    row("a part 1,300 km away, metres", errors, [ns_single, ns_double]);
}
