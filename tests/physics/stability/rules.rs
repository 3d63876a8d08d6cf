//! Bandwidth rules over a million iterations, compared with the same recursions with twice the digits of f64.

use super::exact::Exact;
use caustique::estimator::rule::adaptive::Adaptive;
use caustique::estimator::rule::chi_squared::{ChiSquared, ChiSquaredSettings, MIN_BOUND};
use caustique::estimator::rule::local::LocalStatistics;
use caustique::estimator::rule::thinned::Thinned;
use caustique::estimator::rule::{CountingRule, memoryless, volume};
use caustique::math::{Frame, Vec3};
use caustique::photon::kernel::laplacian;
use caustique::photon::{Kernel, ThinningKey};
use caustique::transport::FoundPhotons;
use std::f64::consts::PI;
use wide::f32x8;

const MILLION: u64 = 1_000_000;

/// The memoryless rules agree with their product in every iteration within 1e-12.
#[test]
fn memoryless_rules_follow_their_product() {
    for alpha in [memoryless::ALPHA, volume::ALPHA] {
        let (mut product, mut worst) = (Exact::new(1.0), [0.0f64; 2]);
        for i in 1..=MILLION {
            if i % 16 == 1 {
                let cube = volume::bandwidth_factor(i, alpha);
                let cube = Exact::new(cube) * Exact::new(cube) * Exact::new(cube);
                worst[0] = worst[0].max(product.error_of(memoryless::bandwidth2_factor(i, alpha)));
                worst[1] = worst[1].max(product.error_of(cube.value()));
            }
            let k = Exact::new(i as f64);
            product = product * (k + Exact::new(alpha)) / (k + Exact::new(1.0));
        }
        println!("alpha {alpha:.3}: off by {worst:?}");
        assert!(worst.iter().all(|&worst| worst < 1e-12), "{worst:?}");
    }
}

/// Local statistics with one photon per iteration agree within 1e-9. With radii in f32 the error would be above 1e-6.
#[test]
fn local_statistics_follow_their_recursion() {
    let rule = LocalStatistics { alpha: 2.0 / 3.0 };
    let mut ours = [rule.initial(1.0, 10.0, 0)];
    let (mut bandwidth2, mut photons, mut single) = (Exact::new(1.0), Exact::default(), 1.0f32);
    let alpha = Exact::new(rule.alpha);
    for i in 1..=MILLION {
        let found = (i % 3 + 1) as u32;
        rule.update(i, &mut ours, &mut [], &mut [found, 0, 0, 0, 0]);
        let new = Exact::new(f64::from(found));
        let factor = (photons + alpha * new) / (photons + new);
        (photons, bandwidth2) = (photons + alpha * new, bandwidth2 * factor);
        single = (f64::from(single) * factor.value()) as f32;
    }
    let errors = [bandwidth2.error_of(ours[0].squared), photons.error_of(ours[0].photons)];
    let in_f32 = bandwidth2.error_of(f64::from(single));
    println!("radius squared and photons off by {errors:?}, a radius in f32 by {in_f32:.1e}");
    assert!(errors.iter().all(|&error| error < 1e-9), "{errors:?}");
    assert!(in_f32 > 1e-6, "{in_f32:e}");
}

/// A photon in the frame of +Z: its distance as a share of the radius, and its azimuth as a share of the circle.
fn found(bandwidth2: f32, distance: f32, turn: f32) -> FoundPhotons {
    let (sin, cos) = (std::f32::consts::TAU * turn).sin_cos();
    let distance = distance * bandwidth2.sqrt();
    let frame = Frame::from_normal(Vec3::Z);
    FoundPhotons::one((frame.t * cos + frame.b * sin) * distance, distance * distance, 1.0, ThinningKey::new(1.0, 0.5))
}

/// The chi-squared rule with integer counts, for two annuli of six sectors.
struct Oracle {
    counts: [u64; 12],
    bandwidth2: Exact,
    bound: Exact,
    /// Number of reductions.
    reductions: u32,
}

impl Oracle {
    /// Adds a photon. Arguments: its cell, the rounded bound, and the critical values for twelve cells and for six.
    fn after(&mut self, cell: usize, bound: f64, critical: [f64; 2]) {
        self.counts[cell] += 1;
        let passes = |counts: &[u64], critical: f64| {
            let (total, squares) = counts.iter().fold((0, 0), |(total, squares), n| (total + n, squares + n * n));
            let excess = (squares * counts.len() as u64) as f64 / total as f64 - total as f64;
            total > 0 && excess <= critical
        };
        let total: u64 = self.counts.iter().sum();
        if (total as f64) < bound || passes(&self.counts, critical[0]) {
            return;
        }
        let factor = if passes(&self.counts[..6], critical[1]) { 0.5 } else { 0.8 };
        self.bandwidth2 = self.bandwidth2 * Exact::new(factor);
        self.bound = self.bound * Exact::new(1.2);
        (self.counts, self.reductions) = ([0; 12], self.reductions + 1);
    }
}

/// A million photons, one per iteration, in a field that is uniform in some phases and not in others, with sectors that
/// are empty for long. The rule decides as exact counts do in every iteration. Each reduction rounds radius and bound
/// once, with errors of 2^-24 and of their factors, together 1.2e-7. The rule for photons of different weights, here
/// all equal, agrees to the bit.
#[test]
fn the_chi_squared_rule_decides_as_exact_counts_do() {
    let settings = ChiSquaredSettings { significance: 1e-3, ..ChiSquaredSettings::default() };
    let (rule, thinned) = (ChiSquared::new(&settings), Thinned::new(&settings));
    let frame = Frame::from_normal(Vec3::Z);
    let (mut ours, mut counts) = ([rule.initial(1.0, 10.0, 0)], [0u32; 12]);
    let (mut alike, mut alike_counts) = ([thinned.initial(1.0, 10.0, 0)], [0u32; 13]);
    let bound = Exact::new(f64::from(MIN_BOUND));
    let mut oracle = Oracle { counts: [0; 12], bandwidth2: Exact::new(1.0), bound, reductions: 0 };
    // Quantiles for 11 and 5 degrees of freedom at 1e-3.
    let critical = [31.264_133_6, 20.515_005_7];
    for i in 1..=MILLION {
        // Phases: in one sector, in the outer annulus, rarely in the inner one, and everywhere.
        let (sector, outer) = match i / 50_000 % 4 {
            0 => (0, i % 2),
            1 => (i % 6, 1),
            2 => (i / 5 % 6, u64::from(!i.is_multiple_of(5))),
            _ => (i % 6, i / 6 % 2),
        };
        let photon = found(ours[0].squared, 0.5 + 0.4 * outer as f32, (sector as f32 + 0.5) / 6.0);
        let (mut tally, mut alike_tally) = Default::default();
        let least = f64::from(ours[0].bound);
        // The lower half is numbered in reverse.
        let cell = 6 * outer + if sector < 3 { sector } else { 8 - sector };
        rule.count(&ours, &mut counts, &mut tally, &frame, &photon);
        rule.update(i, &mut ours, &mut counts, &mut tally);
        thinned.count(&alike, &mut alike_counts, &mut alike_tally, &frame, &photon);
        thinned.update(i, &mut alike, &mut alike_counts, &mut alike_tally);
        oracle.after(cell as usize, least, critical);
        assert!(counts.iter().zip(&oracle.counts).all(|(a, b)| u64::from(*a) == *b), "iteration {i}");
        assert_eq!(alike[0], ours[0], "iteration {i}");
    }
    let allowed = 1.2e-7 * f64::from(oracle.reductions);
    let errors =
        [oracle.bandwidth2.error_of(f64::from(ours[0].squared)), oracle.bound.error_of(f64::from(ours[0].bound))];
    println!("{} reductions: radius squared and bound off by {errors:?}", oracle.reductions);
    assert!(oracle.reductions > 20 && errors.iter().all(|&error| error < allowed), "{errors:?}, {allowed:e}");
}

/// The adaptive rule in a field with curvature: after a million iterations the bandwidth agrees with its sums within
/// 1e-5, the error of the f32 sums of contributions within a path.
#[test]
fn the_adaptive_rule_follows_its_sums() {
    let rule = Adaptive { kernel: Kernel::Box };
    let (mut ours, frame) = ([rule.initial(1.0, 10.0, 0)], Frame::from_normal(Vec3::Z));
    let (mut shot, mut curvature, mut noise) = (Exact::default(), Exact::default(), Exact::default());
    let initial = 1.0f64;
    let mut pilot2 = 4.0f32;
    for i in 1..=MILLION {
        // Within the bandwidth, then within the kernel of the Laplacian.
        let bandwidth2 = f64::from(ours[0].squared);
        let photon = match i % 2 {
            0 => found(ours[0].squared, 0.3, 0.1),
            _ => found(pilot2, 0.3 + 0.4 * (i % 17) as f32 / 17.0, 0.1),
        };
        let mut tally = Default::default();
        rule.count(&ours, &mut [], &mut tally, &frame, &photon);
        rule.update(i, &mut ours, &mut [], &mut tally);
        let [distance2, ..] = photon.distance2.to_array();
        let [part, ..] = laplacian(f32x8::splat(distance2 / pilot2)).to_array();
        let scale = f64::from(pilot2).powi(-2);
        let within = if f64::from(distance2) < bandwidth2 { 1.0 } else { 0.0 };
        shot = shot + Exact::new(within) / (Exact::new(PI) * Exact::new(bandwidth2));
        let part = Exact::new(f64::from(part)) * Exact::new(scale);
        (curvature, noise) = (curvature + part, noise + part * part);
        pilot2 = (4.0 * initial * ((i + 1) as f64).powf(-0.2)) as f32;
    }
    let n = MILLION as f64;
    let squared = (curvature * curvature - noise).value() / (n * n);
    let bias2 = f64::from(Kernel::Box.second_moment()).powi(2) * squared;
    let optimum = 2.0 * shot.value() / n * f64::from(Kernel::Box.roughness()) / (3.0 * PI * n * bias2);
    let usual = memoryless::bandwidth2_factor(MILLION + 1, 2.0 / 3.0);
    let expected = optimum.cbrt().clamp(usual / 64.0, 4.0 * usual);
    let error = (f64::from(ours[0].squared) / expected - 1.0).abs();
    println!("radius squared {:e} off by {error:.1e}; the memoryless rule's is {usual:e}", ours[0].squared);
    assert!(error < 1e-5, "{error:e}");
    assert!(optimum.cbrt() > usual / 64.0 && optimum.cbrt() < 4.0 * usual, "a bound, not sums, sets the bandwidth");
}

/// For no photons, photons in one sector, and photons in one annulus, statistics are finite, and without photons the
/// test passes.
#[test]
fn statistics_of_empty_sectors_are_numbers() {
    assert_eq!(ChiSquared::statistic(&[0; 12]), 0.0);
    assert_eq!(ChiSquared::statistic(&[5; 12]), 0.0);
    for n in [1u32, 1000, 1 << 30] {
        let mut counts = [0; 12];
        counts[4] = n;
        assert_eq!(ChiSquared::statistic(&counts), 11.0 * f64::from(n));
    }
    for settings in [ChiSquaredSettings::default(), ChiSquaredSettings { annuli: 1, sectors: 1, ..Default::default() }]
    {
        let rule = ChiSquared::new(&settings);
        let (mut bandwidth, mut counts) = ([rule.initial(1.0, 0.0, 0)], vec![0u32; rule.counts()]);
        rule.update(1, &mut bandwidth, &mut counts, &mut Default::default());
        assert_eq!((bandwidth[0].squared, bandwidth[0].bound), (1.0, MIN_BOUND));
    }
}
