//! With positive weights the result of equation (6) is a mean of the terms `y_i + z_c - z_i`, and lies between them.

use super::*;

/// Pixels to each side of the shipped network's window.
const REACH: usize = 7;
/// Rounding error of a mean of some hundreds of terms, relative to the largest number that is summed.
const ROUNDING: f32 = 1e-5;

/// Least and largest term of equation (6) in channel `c` of a pixel, and the rounding error of their mean.
fn hull(stack: &LevelStack, valid: &[bool], pixel: usize, c: usize) -> (f32, f32, f32) {
    let (x, y) = (pixel % stack.size.width, pixel / stack.size.width);
    let (mut least, mut most, mut largest) = (f32::INFINITY, f32::NEG_INFINITY, 0f32);
    for v in y.saturating_sub(REACH)..(y + REACH + 1).min(stack.size.height) {
        for u in x.saturating_sub(REACH)..(x + REACH + 1).min(stack.size.width) {
            let i = v * stack.size.width + u;
            if !valid[i] {
                continue;
            }
            for z in &stack.levels[1..] {
                let (own, there, here) = (stack.levels[0][i][c], z[i][c], z[pixel][c]);
                let term = own + here - there;
                (least, most) = (least.min(term), most.max(term));
                largest = largest.max(own.abs()).max(there.abs()).max(here.abs());
            }
        }
    }
    (least, most, ROUNDING * largest)
}

/// Number of pixels whose result lies outside the range of their terms.
fn outside(stack: &LevelStack, image: &Picture) -> usize {
    let valid = stack.valid();
    let beyond = |pixel: usize, c: usize| {
        let (least, most, allowed) = hull(stack, &valid, pixel, c);
        !(least - allowed..=most + allowed).contains(&image[pixel][c])
    };
    (0..image.len()).filter(|&pixel| valid[pixel] && (0..3).any(|c| beyond(pixel, c))).count()
}

/// A stack of bandwidth levels that are a function `of` the pixel's index, times noise with mean 1.
fn picture(width: usize, height: usize, noise: f32, of: impl Fn(usize) -> f32) -> LevelStack {
    let mut stack = Random(12).stack(width, height, 5);
    let mut random = Random(13);
    for level in &mut stack.levels {
        for (index, rgb) in level.iter_mut().enumerate() {
            *rgb = std::array::from_fn(|_| of(index) * (1.0 + noise * (random.next() - 0.5)));
        }
    }
    stack
}

/// Constant and black pictures, pictures with a half or single pixels a million times as bright as the rest, and values
/// that are not finite, for pictures of one pixel, a row, a column, or more. The test detects a result that leaves the
/// range by a thousandth.
#[test]
fn results_lie_between_their_terms() {
    let mut combiner = combiner();
    for (width, height) in [(1, 1), (1, 40), (40, 1), (2, 3), (33, 26)] {
        let half = |index: usize| if 2 * (index % width) < width { 1e6 } else { 1.0 };
        let sparks = |index: usize| if index % 11 == 3 { 1e6 } else { 1.0 };
        let constant = picture(width, height, 0.0, |_| 3.0);
        let image = combiner.run(&constant).unwrap();
        assert_eq!(outside(&constant, &image), 0, "{width} x {height}");
        let wrong = image.map(|value| 1.001 * value);
        assert_eq!(outside(&constant, &wrong), width * height);
        let black = picture(width, height, 0.0, |_| 0.0);
        assert!(combiner.run(&black).unwrap().iter().flatten().all(|value| *value == 0.0));
        for noise in [0.0, 1.0] {
            for mut stack in [picture(width, height, noise, half), picture(width, height, noise, sparks)] {
                let image = combiner.run(&stack).unwrap();
                assert_eq!(outside(&stack, &image), 0, "{width} x {height}, noise {noise}");
                for (k, value) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
                    let level = &mut stack.levels[k + 1];
                    level.iter_mut().skip(3 * k + 1).step_by(13).for_each(|rgb| rgb[k] = value);
                }
                let image = combiner.run(&stack).unwrap();
                assert!(image.iter().flatten().all(|value| value.is_finite()), "{width} x {height}");
                assert_eq!(outside(&stack, &image), 0, "{width} x {height}, noise {noise}, not finite");
            }
        }
    }
}
