//! The shipped network on whole images: sizes, tiles, threads, units, bad input.

use super::output::Rect;
use super::*;

#[test]
fn equal_levels_give_that_image_at_any_size() {
    let (mut random, mut combiner) = (Random(5), combiner());
    for (width, height) in [(1, 1), (1, 7), (2, 2), (3, 5), (17, 33), (67, 45)] {
        let mut stack = random.stack(width, height, 5);
        stack.levels = vec![stack.levels[0].clone(); 5];
        let image = combiner.run(&stack).unwrap();
        assert!(distance(&image, &stack.levels[0], 1.0) < 2e-6, "{width} x {height}");
    }
}

#[test]
fn tiles_leave_no_seams() {
    let (mut random, mut combiner) = (Random(6), combiner());
    for (width, height) in [(211, 150), (97, 260)] {
        let stack = random.stack(width, height, 5);
        let whole = combiner.run_tiled(&stack, usize::MAX).unwrap();
        for pixels in [50 * 50, 90 * 90] {
            let tiled = combiner.run_tiled(&stack, pixels).unwrap();
            let error = distance(&tiled, &whole, 1.0);
            assert!(error < 1e-5, "{width} x {height} in tiles of {pixels}: {error}");
        }
    }
}

#[test]
fn the_receptive_radius_of_the_network_is_its_halo() {
    let (stack, mut combiner) = (Random(6).stack(212, 152, 5), combiner());
    let halo = combiner.metadata().halo;
    let normalisation = Normalisation::of(&stack);
    let mut output = |rect: Rect| combiner.network.run(&tensor::fill(&stack, &normalisation, rect), rect).unwrap();
    let whole = output(Rect { x0: 0, y0: 0, x1: 212, y1: 152 });
    let tile = output(Rect { x0: 100, y0: 40, x1: 200, y1: 140 });
    let difference = |x: usize, y: usize| {
        let channels = 0..whole.data.len() / (212 * 152);
        channels.map(|k| (whole.row(k, y)[x] - tile.row(k, y)[x - 100]).abs()).fold(0.0, f32::max)
    };
    assert!(difference(100 + halo, 40 + halo) < 1e-5);
    assert!(difference(199 - halo, 139 - halo) < 1e-5);
    // A tile without a halo would show seams: the tests above can fail.
    assert!(difference(100, 90) > 1e-3 && difference(150, 139) > 1e-3);
}

#[test]
fn cores_cover_the_image_once_and_inputs_keep_the_stride() {
    let metadata = combiner().metadata().clone();
    for (width, height, pixels) in [(1, 1, 1), (5, 3, 1), (211, 150, 2500), (1280, 720, 1 << 18), (3840, 2160, 1 << 18)]
    {
        let mut count = vec![0u8; width * height];
        for tile in tile::tiles(Size { width, height }, &metadata, pixels) {
            for y in tile.core.y0..tile.core.y1 {
                count[y * width + tile.core.x0..y * width + tile.core.x1].iter_mut().for_each(|n| *n += 1);
            }
            for edge in [tile.input.x0, tile.input.y0, tile.input.x1, tile.input.y1] {
                assert_eq!(edge % metadata.stride, 0);
            }
        }
        assert!(count.iter().all(|n| *n == 1), "{width} x {height}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let stack = Random(7).stack(150, 90, 5);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| combiner().run_tiled(&stack, 64 * 64).unwrap())
    };
    let one = run(1);
    for threads in [2, 3] {
        assert_eq!(bits(&run(threads)), bits(&one), "{threads} threads");
    }
}

#[test]
fn light_units_do_not_matter() {
    let (mut combiner, mut stack) = (combiner(), Random(8).stack(60, 40, 5));
    let image = combiner.run(&stack).unwrap();
    // A power of two, so that not even rounding differs.
    stack.levels.iter_mut().flatten().for_each(|rgb| *rgb = rgb.map(|v| v * 1024.0));
    stack.variances.iter_mut().flatten().for_each(|rgb| *rgb = rgb.map(|v| v * (1024.0 * 1024.0)));
    stack.depth.iter_mut().for_each(|d| *d *= 0.25);
    let scaled = combiner.run(&stack).unwrap();
    let expected: Vec<_> = image.iter().map(|rgb| rgb.map(|v| v * 1024.0)).collect();
    assert!(distance(&scaled, &expected, 1024.0) < 1e-5);
}

#[test]
fn values_that_are_not_finite_stay_where_they_are() {
    let (mut combiner, mut stack) = (combiner(), Random(9).stack(64, 48, 5));
    let at = |x: usize, y: usize| y * 64 + x;
    let lost = at(20, 20);
    stack.levels.iter_mut().for_each(|level| level[lost] = [f32::NAN; 3]);
    stack.levels[0][at(5, 30)] = [f32::INFINITY, 1.0, 1.0];
    stack.levels[1][at(5, 30)] = [7.0, 8.0, 9.0];
    stack.variances[2][at(40, 10)] = [f32::NAN; 3];
    stack.normal[at(41, 10)] = [f32::NAN; 3];
    stack.albedo[at(42, 10)] = [f32::INFINITY; 3];
    stack.depth[at(43, 10)] = f32::NAN;
    let image = combiner.run(&stack).unwrap();
    assert!(image.iter().flatten().all(|v| v.is_finite()));
    assert_eq!(image[at(5, 30)], [7.0, 8.0, 9.0]);
    // No level is finite: the pixel gets the mean of its neighbours.
    assert!(image[lost].iter().all(|v| (0.5..4.0).contains(v)), "{:?}", image[lost]);
    // No pixel is finite.
    stack.levels.iter_mut().flatten().for_each(|rgb| *rgb = [f32::NAN; 3]);
    assert!(combiner.run(&stack).unwrap().iter().all(|rgb| *rgb == [0.0; 3]));
}

#[test]
fn extreme_images_stay_finite() {
    let mut combiner = combiner();
    for value in [0.0, 1e-38, 1e-20, 1e20, 1e30] {
        let mut stack = Random(10).stack(20, 20, 5);
        stack.levels.iter_mut().flatten().for_each(|rgb| *rgb = rgb.map(|v| v * value));
        stack.variances.iter_mut().flatten().for_each(|rgb| *rgb = rgb.map(|v| v * value * value));
        stack.depth.fill(1e10);
        let image = combiner.run(&stack).unwrap();
        assert!(image.iter().flatten().all(|v| v.is_finite()), "levels of about {value}");
    }
}

#[test]
fn input_of_the_wrong_shape_is_an_error_that_says_so() {
    let mut combiner = combiner();
    let message = |combiner: &mut Combiner, change: &dyn Fn(&mut LevelStack)| {
        let mut stack = Random(11).stack(4, 3, 5);
        change(&mut stack);
        let error = combiner.run(&stack).unwrap_err();
        assert_eq!(error.kind, ErrorKind::Image);
        error.to_string()
    };
    assert_eq!(message(&mut combiner, &|s| s.levels.truncate(3)), "the image has 3 levels, the network takes 5");
    assert_eq!(
        message(&mut combiner, &|s| s.variances.truncate(4)),
        "layer Variance5: the layer holds 0 pixels, the image 12"
    );
    assert_eq!(message(&mut combiner, &|s| s.depth.truncate(7)), "layer depth: the layer holds 7 pixels, the image 12");
    assert_eq!(message(&mut combiner, &|s| s.size.width = 0), "an image of 0 x 3 pixels");
}

fn bits(image: &Picture) -> Vec<[u32; 3]> {
    image.iter().map(|rgb| rgb.map(f32::to_bits)).collect()
}
