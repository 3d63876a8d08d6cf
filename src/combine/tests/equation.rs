//! Equation (6) with arbitrary positive weights.

use std::array::from_fn;

use super::output::{NetworkOutput, Rect};
use super::*;

fn whole(width: usize, height: usize) -> Rect {
    Rect { x0: 0, y0: 0, x1: width, y1: height }
}

/// Random weights in both forms for a whole image: features (D = 3, window 7) and explicit ones (window 5).
fn random_weights(random: &mut Random, width: usize, height: usize, levels: usize) -> [Weights; 2] {
    let rect = whole(width, height);
    let (area, pairs) = (width * height, levels - 1);
    let features = random.fill(area * pairs * 6, -1.5, 1.5);
    let weights = random.fill(area * pairs * 25, -6.0, 3.0).into_iter().map(f32::exp).collect();
    [Weights::Features(NetworkOutput::new(rect, 7, features)), Weights::Kernel(NetworkOutput::new(rect, 5, weights))]
}

fn combine(stack: &LevelStack, weights: &Weights) -> Vec<[f32; 3]> {
    let rect = whole(stack.size.width, stack.size.height);
    combine_tile(stack, &stack.valid(), &Tile { core: rect, input: rect }, weights)
}

/// Equation (6) word for word, in f64, with w_i^j from a function of pair, centre and neighbour.
fn oracle(stack: &LevelStack, radius: isize, weight: impl Fn(usize, [isize; 2], [isize; 2]) -> f64) -> Vec<[f32; 3]> {
    oracle_of_windows(stack, radius, &[1], |_, j, c, i| weight(j, c, i), |_, _| 0.0)
}

/// [`oracle`] with several windows, whose pixels have the distances `dilations`: `weight` also gets the index of the window.
/// `alone` is the weight of z_c^j itself.
fn oracle_of_windows(
    stack: &LevelStack,
    radius: isize,
    dilations: &[isize],
    weight: impl Fn(usize, usize, [isize; 2], [isize; 2]) -> f64,
    alone: impl Fn(usize, [isize; 2]) -> f64,
) -> Vec<[f32; 3]> {
    let (width, height) = (stack.size.width as isize, stack.size.height as isize);
    let valid = stack.valid();
    let at = |[x, y]: [isize; 2]| (y * width + x) as usize;
    let pixel = |c: [isize; 2]| {
        let (mut sum, mut total) = ([0.0f64; 3], 0.0);
        for j in 0..stack.levels.len() - 1 {
            let (y, z) = (&stack.levels[0], &stack.levels[j + 1]);
            let steps = || (-radius..=radius).flat_map(|v| (-radius..=radius).map(move |u| [u, v]));
            for (group, [u, v]) in (0..dilations.len()).flat_map(|group| steps().map(move |step| (group, step))) {
                let i = [c[0] + dilations[group] * u, c[1] + dilations[group] * v];
                if i[0] < 0 || i[1] < 0 || i[0] >= width || i[1] >= height || !valid[at(i)] {
                    continue;
                }
                let w = weight(group, j, c, i);
                for k in 0..3 {
                    let (y_i, z_c, z_i) = (y[at(i)][k], z[at(c)][k], z[at(i)][k]);
                    sum[k] += w * (f64::from(y_i) + f64::from(z_c) - f64::from(z_i));
                }
                total += w;
            }
            let w = alone(j, c);
            sum = from_fn(|k| sum[k] + w * f64::from(z[at(c)][k]));
            total += w;
        }
        sum.map(|s| (s / total) as f32)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(pixel).collect()
}

#[test]
fn both_forms_equal_the_equation_word_for_word() {
    let mut random = Random(1);
    for (width, height, levels) in [(1, 1, 2), (3, 2, 3), (23, 17, 5), (9, 30, 2)] {
        let mut stack = random.stack(width, height, levels);
        if width > 3 {
            stack.levels[1][5 * width + 4] = [f32::NAN, 0.0, f32::INFINITY];
        }
        let valid = stack.valid();
        for weights in random_weights(&mut random, width, height, levels) {
            let got = combine(&stack, &weights);
            let want = match &weights {
                Weights::Features(map) => {
                    let value =
                        |channel: usize, [x, y]: [isize; 2]| f64::from(map.row(channel, y as usize)[x as usize]);
                    oracle(&stack, 3, |j, c, i| {
                        let pairs = levels - 1;
                        let phi: f64 = (3 * j..3 * j + 3).map(|k| (value(k, c) - value(k, i)).powi(2)).sum();
                        let squared = ((c[0] - i[0]).pow(2) + (c[1] - i[1]).pow(2)) as f64;
                        let (source, centre) = (value(3 * pairs + j, i), value(4 * pairs + j, c));
                        (source + centre - value(5 * pairs + j, c).min(0.0).exp() * squared - phi).exp()
                    })
                }
                Weights::Kernel(map) => oracle(&stack, 2, |j, c, i| {
                    let (u, v) = (i[0] - c[0] + 2, i[1] - c[1] + 2);
                    f64::from(map.row(25 * j + (5 * v + u) as usize, c[1] as usize)[c[0] as usize])
                }),
            };
            for i in (0..got.len()).filter(|i| valid[*i]) {
                let error = distance(&got[i..=i], &want[i..=i], 1.0);
                assert!(
                    error < 1e-5,
                    "{width} x {height}, {levels} levels, pixel {i}: {:?}, not {:?}",
                    got[i],
                    want[i]
                );
            }
        }
    }
}

#[test]
fn several_windows_and_levels_alone_equal_the_equation_word_for_word() {
    let mut random = Random(11);
    let (width, height, pairs, dilations, identities) = (29, 21, 3, [1isize, 4], [0, 2]);
    let mut stack = random.stack(width, height, pairs + 1);
    stack.levels[1][5 * width + 4] = [f32::NAN, 0.0, f32::INFINITY];
    let channels = dilations.len() * pairs * 6 + identities.len();
    let data = random.fill(width * height * channels, -1.5, 1.5);
    let map = NetworkOutput {
        dilations: dilations.map(|d| d as usize).to_vec(),
        identities: identities.to_vec(),
        ..NetworkOutput::new(whole(width, height), 7, data)
    };
    let value = |channel: usize, [x, y]: [isize; 2]| f64::from(map.row(channel, y as usize)[x as usize]);
    let weight = |group: usize, j: usize, c: [isize; 2], i: [isize; 2]| {
        let (first, step) = (group * pairs * 6, dilations[group]);
        let phi: f64 = (first + 3 * j..first + 3 * j + 3).map(|k| (value(k, c) - value(k, i)).powi(2)).sum();
        let squared = (((c[0] - i[0]) / step).pow(2) + ((c[1] - i[1]) / step).pow(2)) as f64;
        let [source, centre, falloff] = [3, 4, 5].map(|k| first + k * pairs + j);
        (value(source, i) + value(centre, c) - value(falloff, c).min(0.0).exp() * squared - phi).exp()
    };
    let alone = |j: usize, c: [isize; 2]| {
        identities.iter().position(|pair| *pair == j).map_or(0.0, |k| value(2 * pairs * 6 + k, c).exp())
    };
    let want = oracle_of_windows(&stack, 3, &dilations, weight, alone);
    let wrong = oracle_of_windows(&stack, 3, &dilations, weight, |j, c| 1.01 * alone(j, c));
    let valid = stack.valid();
    let differs = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        (0..a.len()).filter(|i| valid[*i]).map(|i| distance(&a[i..=i], &b[i..=i], 1.0)).fold(0.0, f32::max)
    };
    let got = combine(&stack, &Weights::Features(map));
    assert!(differs(&got, &want) < 1e-5);
    assert!(differs(&got, &wrong) > 1e-5, "the test detects a weight that is wrong by a hundredth");
}

#[test]
fn equal_levels_give_that_image_whatever_the_weights() {
    let mut random = Random(2);
    for (width, height) in [(1, 1), (2, 5), (31, 18)] {
        let mut stack = random.stack(width, height, 5);
        // The range of radiance in renders.
        stack.levels[0].iter_mut().for_each(|rgb| *rgb = rgb.map(|v| 10f32.powf(6.0 * v - 8.0)));
        stack.levels = vec![stack.levels[0].clone(); 5];
        for weights in random_weights(&mut random, width, height, 5) {
            for (got, want) in combine(&stack, &weights).iter().zip(&stack.levels[0]) {
                for c in 0..3 {
                    assert!((got[c] / want[c] - 1.0).abs() < 2e-6, "{got:?}, not {want:?}");
                }
            }
        }
    }
}

#[test]
fn a_constant_passes_through_and_the_combination_is_linear() {
    let mut random = Random(3);
    let (width, height) = (19, 12);
    let (one, two) = (random.stack(width, height, 4), random.stack(width, height, 4));
    let mixed = |f: &dyn Fn(f32, f32) -> f32| {
        let mut stack = one.clone();
        for (level, other) in stack.levels.iter_mut().zip(&two.levels) {
            for (a, b) in level.iter_mut().zip(other) {
                *a = std::array::from_fn(|c| f(a[c], b[c]));
            }
        }
        stack
    };
    for weights in random_weights(&mut random, width, height, 4) {
        let (a, b) = (combine(&one, &weights), combine(&two, &weights));
        let shifted = combine(&mixed(&|a, _| a + 3.0), &weights);
        let expected: Vec<_> = a.iter().map(|rgb| rgb.map(|v| v + 3.0)).collect();
        assert!(distance(&shifted, &expected, 1.0) < 1e-5);
        let sum = combine(&mixed(&|a, b| 2.0 * a - 0.5 * b), &weights);
        let expected: Vec<_> =
            a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 2.0 * a[c] - 0.5 * b[c])).collect();
        assert!(distance(&sum, &expected, 1.0) < 1e-5);
    }
}

#[test]
fn weights_that_are_no_numbers_do_not_reach_the_image() {
    let mut random = Random(4);
    let stack = random.stack(12, 12, 3);
    for mut weights in random_weights(&mut random, 12, 12, 3) {
        let (Weights::Features(map) | Weights::Kernel(map)) = &mut weights;
        for (k, value) in map.data.iter_mut().enumerate() {
            *value = match k % 7 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::NEG_INFINITY,
                _ => *value,
            };
        }
        assert!(combine(&stack, &weights).iter().flatten().all(|v| v.is_finite()));
    }
}
