//! Compares error metrics with closed forms and with the reference implementation of FLIP, and tone curves with
//! published values.

use caustique::film::cryptomatte::{Cryptomatte, PixelRanks};
use caustique::film::{CRYPTOMATTES, Layer, LayerSet, Picture, Size};
use caustique::image::exr::{self, Attributes, Frame};
use caustique::image::tonemap::{Contrast, Look, ToneMap, srgb_decode};
use caustique::image::{
    Floor, SMOOTH_MATERIALS, compare, compare_windows, compare_with_floor, flip, heat, metrics, smooth_pixels,
};
use caustique::math::Rgb;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
const SIZE: Size = Size { width: WIDTH, height: HEIGHT };

/// Two pictures: edges in every direction and a bright square, and the same with noise on each channel. `scale` is 1
/// for HDR and 1/2 for LDR.
///
/// The expected FLIP values are from the authors' implementation, PyPI flip-evaluator 1.7, on the same pixels:
/// `flip_evaluator.evaluate(reference, test, "HDR", inputsRGB=False, applyMagma=False)`, and `"LDR"` on halved and
/// clipped ones.
fn fixture(scale: f32) -> (Picture, Picture) {
    let (mut reference, mut test) = (Vec::new(), Vec::new());
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let lit = (20..30).contains(&x) && (10..20).contains(&y);
            let base =
                |c: usize| if lit { 20.0 } else { (0.05 + ((x * (c + 1) * 7 + y * 13) % 64) as f64 / 64.0) as f32 };
            let noise = |c: usize| ((x * 73_856_093) ^ (y * 19_349_663) ^ (c * 83_492_791)) % 256;
            let factor = |c: usize| (0.75 + 0.5 * noise(c) as f64 / 255.0) as f32;
            reference.push([0, 1, 2].map(|c| base(c) * scale));
            test.push([0, 1, 2].map(|c| base(c) * factor(c) * scale));
        }
    }
    (Picture::new(SIZE, reference), Picture::new(SIZE, test))
}

fn check_flip(map: &[f32], mean: f64, pixels: [(usize, usize, f32); 4]) {
    let found = map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64;
    assert!((found - mean).abs() < 1e-4, "mean {found}, expected {mean}");
    for (x, y, value) in pixels {
        let found = map[y * WIDTH + x];
        assert!((found - value).abs() < 1e-3, "({x}, {y}): {found}, expected {value}");
    }
}

#[test]
fn hdr_flip_agrees_with_the_authors() {
    let (reference, test) = fixture(1.0);
    let map = flip::hdr(&reference, &test);
    check_flip(&map, 0.074_488, [(0, 0, 0.093_322), (25, 15, 0.026_383), (70, 40, 0.070_447), (95, 63, 0.203_080)]);
}

#[test]
fn ldr_flip_agrees_with_the_authors() {
    let (reference, test) = fixture(0.5);
    let map = flip::ldr(&reference, &test);
    check_flip(&map, 0.073_109, [(0, 0, 0.024_880), (25, 15, 0.002_049), (70, 40, 0.069_052), (95, 63, 0.205_435)]);
}

#[test]
fn flip_of_odd_pictures() {
    // Equal pictures of any size do not differ; a picture and black differ.
    for (width, height) in [(1, 1), (3, 2), (1, 40)] {
        let size = Size { width, height };
        let picture = Picture::from_fn(size, |i| [i as f32; 3]);
        assert!(flip::hdr(&picture, &picture).iter().all(|&v| v == 0.0));
        let black = Picture::filled(size, [0.0; 3]);
        for (a, b) in [(&picture, &black), (&black, &picture)] {
            let map = flip::hdr(a, b);
            assert!(map.iter().all(|v| (0.0..=1.0).contains(v)), "{map:?}");
        }
    }
    // A caustic on a black floor: the median luminance is zero, and the difference must still be visible.
    let black = Picture::filled(Size { width: 10, height: 10 }, [0.0; 3]);
    let mut reference = black.clone();
    reference[55] = [4.0; 3];
    let map = flip::hdr(&reference, &black);
    assert!(map[55] > 0.3 && map[0] == 0.0, "{} {}", map[55], map[0]);
}

fn picture(width: usize, height: usize, pixel: impl Fn(usize) -> [f32; 3]) -> LayerSet {
    let mut set = LayerSet::new(width, height);
    set.push(Layer::interleaved("", "RGB", (0..width * height).map(pixel))).unwrap();
    set
}

#[test]
fn metrics_in_closed_form() {
    // The reference is 1, 2, 3 everywhere. Half of the pixels are off by 0.3 in one channel.
    let b = picture(40, 50, |_| [1.0, 2.0, 3.0]);
    let a = picture(40, 50, |i| if i % 2 == 0 { [1.3, 2.0, 3.0] } else { [1.0, 2.0, 3.0] });
    let result = compare(&a, &b).unwrap();
    let pixel = 0.3f64.powi(2) / 3.0;
    assert!((result.mse - pixel / 2.0).abs() < 1e-8);
    assert!((result.relmse - pixel / (4.0 + 0.01) / 2.0).abs() < 1e-8);
    // Ten of 2000 pixels are left out, all of them wrong ones.
    assert!((result.relmse_trimmed - pixel / 4.01 * 990.0 / 1990.0).abs() < 1e-8);
    assert!((result.mean_ratio.unwrap() - (6.0 + 0.15) / 6.0).abs() < 1e-6);
    assert_eq!(result.pixels_not_finite, 0);
    assert!(result.flip > 0.0);

    let equal = compare(&b, &b).unwrap();
    assert_eq!((equal.relmse, equal.relmse_trimmed, equal.mse, equal.flip), (0.0, 0.0, 0.0, 0.0));
    assert_eq!(equal.mean_ratio, Some(1.0));
}

#[test]
fn trimming_leaves_out_the_worst_half_per_cent() {
    let b = picture(100, 20, |_| [1.0; 3]);
    let a = |wrong: usize| picture(100, 20, move |i| if i < wrong { [1e4; 3] } else { [1.1; 3] });
    let result = compare(&a(10), &b).unwrap();
    assert!((result.relmse_trimmed - 0.01 / 1.01).abs() < 1e-6, "{}", result.relmse_trimmed);
    assert!(result.relmse > 1e4);
    assert!(compare(&a(11), &b).unwrap().relmse_trimmed > 1e4);
}

/// White noise of mean 0 and variance 1: the sum of four uniform numbers of SplitMix64, minus its mean, times the
/// square root of three.
fn white(i: usize, channel: usize) -> f32 {
    let uniform = |k: usize| {
        let mut z = (((i * 3 + channel) * 4 + k) as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(64)
    };
    (3f64.sqrt() * ((0..4).map(uniform).sum::<f64>() - 2.0)) as f32
}

#[test]
fn grain_in_closed_form() {
    let (width, height) = (200, 150);
    let b = picture(width, height, |_| [1.0, 2.0, 3.0]);
    let grain = |pixel: &dyn Fn(usize) -> [f32; 3]| compare(&picture(width, height, pixel), &b).unwrap().grain;
    assert_eq!(grain(&|_| [1.0, 2.0, 3.0]), 0.0);
    // A constant offset has no grain, except rounding errors of the blur. A ramp has grain only at the border.
    assert!(grain(&|_| [1.5, 2.25, 2.0]) < 1e-25);
    assert!(grain(&|i| [1.0 + (i % width) as f32 * 0.25, 2.0, 3.0]) < 0.25 / 4.01 / 3.0 * 2.0 / width as f64);
    // White noise: blurring over n pixels leaves a share 1 - 1/n of its variance as grain. For 90,000 numbers, five
    // standard errors are 2.4 %.
    let noisy = |i: usize| [0, 1, 2].map(|c| 1.0 + c as f32 + 0.1 * white(i, c));
    let (rim, corners) = ((2 * (width + height) - 8) as f64, 4.0);
    let inside = (width * height) as f64 - rim - corners;
    let kept = (inside * 8.0 / 9.0 + rim * 5.0 / 6.0 + corners * 3.0 / 4.0) / (width * height) as f64;
    let expected = 0.01 * kept / 4.01;
    assert!((grain(&noisy) / expected - 1.0).abs() < 0.024, "{} for {expected}", grain(&noisy));
    // One pixel is off by 0.9 in one channel: the grain is 8/9 of it there, and a ninth in each of eight neighbours.
    let planted = grain(&|i| if i == 75 * width + 100 { [1.9, 2.0, 3.0] } else { [1.0, 2.0, 3.0] });
    let squares = (0.8f64.powi(2) + 8.0 * 0.1f64.powi(2)) / 3.0 / 4.01;
    assert!((planted / (squares / (width * height) as f64) - 1.0).abs() < 1e-6, "{planted}");
    // In a corner: three quarters of it there, a sixth in the two adjacent pixels, a ninth in the diagonal one.
    let planted = grain(&|i| if i == 0 { [1.9, 2.0, 3.0] } else { [1.0, 2.0, 3.0] });
    let shares = 0.75f64.powi(2) + 1.0 / 81.0 + 2.0 / 36.0;
    let expected = 0.81 * shares / 3.0 / 4.01 / (width * height) as f64;
    assert!((planted / expected - 1.0).abs() < 1e-6, "{planted} for {expected}");
}

#[test]
fn grain_ignores_pixels_that_are_not_finite() {
    // Without the infinite pixel, which the blur would spread, only a constant offset is left.
    let b = picture(9, 7, |i| if i == 30 { [f32::INFINITY; 3] } else { [1.0; 3] });
    let a = picture(9, 7, |i| if i == 12 { [f32::NAN, 1.5, 1.5] } else { [1.5; 3] });
    assert!(compare(&a, &b).unwrap().grain < 1e-25);
    let filled = |width, height, value| Picture::filled(Size { width, height }, [value; 3]);
    assert_eq!(metrics::grain(&filled(3, 2, f32::NAN), &filled(3, 2, 1.0)), None);
    assert_eq!(metrics::grain(&filled(3, 2, 1.0), &filled(2, 2, 1.0)), None);
}

#[test]
fn pixels_that_are_not_finite_are_counted_and_left_out() {
    let b = picture(10, 10, |i| if i == 3 { [0.0, f32::INFINITY, 0.0] } else { [1.0; 3] });
    let a = picture(10, 10, |i| if i == 4 { [f32::NAN; 3] } else { [1.0; 3] });
    let result = compare(&a, &b).unwrap();
    assert_eq!((result.pixels_not_finite, result.relmse, result.flip), (2, 0.0, 0.0));
    assert_eq!((result.flip_map[3], result.flip_map[4], result.flip_map[5]), (1.0, 1.0, 0.0));
    let error = compare(&picture(2, 2, |_| [f32::NAN; 3]), &picture(2, 2, |_| [1.0; 3])).unwrap_err();
    assert!(error.cause.contains("no pixel"), "{error}");
}

#[test]
fn incomparable_pictures_are_an_error() {
    let error = compare(&picture(4, 2, |_| [0.0; 3]), &picture(2, 4, |_| [0.0; 3])).unwrap_err();
    assert_eq!(error.cause, "pictures of 4 x 2 and 2 x 4 pixels");
    let mut empty = LayerSet::new(4, 2);
    empty.push(Layer::interleaved("depth", "Z", [[0.0]; 8])).unwrap();
    let error = compare(&empty, &picture(4, 2, |_| [0.0; 3])).unwrap_err();
    assert!(error.cause.contains("no picture among the layers (depth)"), "{error}");
    let black = |width, height| Picture::filled(Size { width, height }, [0.0; 3]);
    assert!(metrics::compare_pictures(&black(2, 2), &black(3, 1), Floor::Papers, 0).is_err());
}

#[test]
fn the_errors_inside_glass_are_those_of_the_pixels_with_smooth_materials() {
    let (width, height) = (6, 4);
    // Glass covers the left third, and a seventh of the next pixel of each row.
    let mattes = Cryptomatte::new(CRYPTOMATTES[1], ["wall", "glass"].map(String::from));
    let ranks: Vec<PixelRanks> = (0..width * height)
        .map(|i| {
            let mut ranks = PixelRanks::default();
            let glass = [1.0, 0.75, 0.125, 0.0, 0.0, 0.0][i % width];
            [(1, glass), (0, 1.0 - glass)].iter().filter(|(_, share)| *share > 0.0).for_each(|&(material, share)| {
                ranks.add(mattes.ids()[material], share);
            });
            ranks
        })
        .collect();
    let b = picture(width, height, |_| [1.0; 3]);
    let mut a =
        picture(width, height, |i| if i == 0 { [f32::NAN; 3] } else { [if i % width < 2 { 1.3 } else { 2.0 }; 3] });
    mattes.layers(&ranks, 1.0).into_iter().for_each(|layer| a.push(layer).unwrap());
    let header = |names: &[&str]| Attributes::of(&serde_json::json!({SMOOTH_MATERIALS: names})).unwrap();
    let inside = smooth_pixels(&a, &header(&["glass"])).unwrap();
    assert!((0..width * height).all(|i| inside[i] == (i % width < 2)));
    let mut result = compare(&a, &b).unwrap();
    result.measure_inside(&inside);
    let found = result.inside.unwrap();
    assert_eq!(found.pixels, 7);
    assert!((found.relmse - 0.09 / 1.01).abs() < 1e-6, "{}", found.relmse);
    let flips = (1..width * height).filter(|i| i % width < 2).map(|i| f64::from(result.flip_map[i]));
    assert!(found.flip > 0.0 && (found.flip - flips.sum::<f64>() / 7.0).abs() < 1e-9);
    assert!(found.grain > 0.0);
    // Without such materials there are no such pixels, and without their names nothing is known.
    result.measure_inside(&smooth_pixels(&a, &header(&[])).unwrap());
    assert_eq!(result.inside, None);
    assert_eq!(smooth_pixels(&a, &Attributes::default()), None);
    assert_eq!(smooth_pixels(&b, &header(&["glass"])), None);
}

#[test]
fn the_json_has_the_promised_keys() {
    let b = picture(2, 2, |_| [0.0; 3]);
    let json = serde_json::to_value(compare(&b, &b).unwrap()).unwrap();
    let keys: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
    let mut expected =
        ["relmse", "relmse_trimmed", "mse", "mean_ratio", "flip", "grain", "floor", "pixels_not_finite", "inside"];
    expected.sort_unstable();
    let mut found = keys.clone();
    found.sort_unstable();
    assert_eq!(found, expected);
    assert!(json["mean_ratio"].is_null());
}

#[test]
fn results_do_not_depend_on_threads() {
    let (reference, test) = fixture(1.0);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| flip::hdr(&reference, &test))
    };
    let first = with(1);
    assert!(with(2) == first && with(3) == first);
}

#[test]
fn heat_grows_lighter() {
    let light = |v: f32| caustique::math::luminance(Rgb::from_array(heat::magma(v).to_array().map(srgb_decode)));
    let mut last = -1.0;
    for i in 0..=1000 {
        let now = light(i as f32 / 1000.0);
        assert!(now >= last, "at {i}");
        last = now;
    }
    assert_eq!(heat::magma(f32::NAN), heat::magma(1.0));
    assert_eq!(heat::magma(-3.0), heat::magma(0.0));
}

/// Display colours of Blender 4.5 for scene-linear colours: view transform AgX, no look, display sRGB.
const BLENDER_AGX: [([f32; 3], [f32; 3]); 8] = [
    ([0.18, 0.18, 0.18], [0.4614, 0.4613, 0.4613]),
    ([1.0, 1.0, 1.0], [0.771, 0.771, 0.771]),
    ([0.5, 0.1, 0.05], [0.6973, 0.3518, 0.2416]),
    ([4.0, 0.2, 0.1], [0.9908, 0.6461, 0.594]),
    ([0.02, 0.3, 2.0], [0.4532, 0.6269, 0.8934]),
    ([10.0, 10.0, 10.0], [0.9746, 0.9746, 0.9746]),
    ([0.001, 0.002, 0.004], [0.0025, 0.0114, 0.0255]),
    ([0.0, 1.0, 0.0], [0.4325, 0.7726, 0.3184]),
];

#[test]
fn agx_looks_like_blenders() {
    for (scene, display) in BLENDER_AGX {
        let found = Look::from(ToneMap::Agx).display(Rgb::from_array(scene));
        for c in 0..3 {
            assert!((found[c] - display[c]).abs() < 0.006, "{scene:?}: {found}, expected {display:?}");
        }
    }
}

/// Display colours of Blender 4.5 for scene-linear colours: view transform AgX, the look of this contrast, display sRGB.
const BLENDER_AGX_LOOKS: [(Contrast, [f32; 3], [f32; 3]); 7] = [
    (Contrast::VeryHigh, [0.18, 0.18, 0.18], [0.4614, 0.4613, 0.4613]),
    (Contrast::VeryHigh, [0.5, 0.1, 0.05], [0.7718, 0.2867, 0.0909]),
    (Contrast::VeryHigh, [0.02, 0.3, 2.0], [0.5145, 0.6961, 0.9960]),
    (Contrast::MediumHigh, [0.5, 0.1, 0.05], [0.7352, 0.3234, 0.1824]),
    (Contrast::Low, [0.18, 0.18, 0.18], [0.4613, 0.4613, 0.4613]),
    (Contrast::Low, [0.5, 0.1, 0.05], [0.6739, 0.3689, 0.2729]),
    (Contrast::Low, [0.004, 0.002, 0.001], [0.0640, 0.0328, 0.0150]),
];

#[test]
fn contrasts_of_agx_look_like_blenders() {
    for (contrast, scene, display) in BLENDER_AGX_LOOKS {
        let found = Look { contrast, ..ToneMap::Agx.into() }.display(Rgb::from_array(scene));
        let error = (found - Rgb::from_array(display)).abs().max_element();
        assert!(error < 0.009, "{contrast:?} of {scene:?}: {found}, expected {display:?}");
    }
}

/// Rows of the table: contrast, scene-linear colour, and display value in 255ths.
fn blenders_filmic() -> Vec<(Contrast, Rgb, Rgb)> {
    let rows = include_str!("filmic.csv").lines().filter(|line| !line.starts_with('#'));
    let row = |line: &str| {
        let (contrast, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f32> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
        let contrast = serde_json::from_value(contrast.into()).unwrap();
        (contrast, Rgb::from_slice(&numbers[..3]), Rgb::from_slice(&numbers[3..]))
    };
    rows.map(row).collect()
}

#[test]
fn filmic_is_blenders() {
    let grey = Look::from(ToneMap::Filmic).display(Rgb::splat(0.0509)) * 255.0;
    assert_eq!(grey.round(), Rgb::splat(70.0));
    for (contrast, colour, expected) in blenders_filmic() {
        let shown = Look { contrast, ..ToneMap::Filmic.into() }.display(colour) * 255.0;
        assert!((shown - expected).abs().max_element() < 0.2, "{contrast:?} of {colour}: {shown}, expected {expected}");
    }
}

#[test]
fn every_curve_keeps_order_and_bounds() {
    let contrasts = [Contrast::VeryHigh, Contrast::Medium, Contrast::VeryLow];
    let curves = [ToneMap::Agx, ToneMap::Filmic, ToneMap::Neutral, ToneMap::Srgb];
    for look in curves.iter().flat_map(|&curve| contrasts.map(|contrast| Look { contrast, ..curve.into() })) {
        assert!(look.display(Rgb::ZERO).max_element() < 0.003, "{look:?}");
        let mut last = -1.0;
        for i in -40..=40 {
            let shown = look.display(Rgb::splat((i as f32 / 2.0).exp2()));
            assert!(shown.min_element() >= 0.0 && shown.max_element() <= 1.0);
            assert!(shown.x >= last, "{look:?} at {i}");
            last = shown.x;
        }
        assert!(last > 0.99, "{look:?}: {last}");
        // One stop of exposure doubles the light.
        let exposed = |exposure| Look { exposure, ..look };
        let (a, b) = (exposed(1.0).display(Rgb::new(0.2, 0.1, 0.4)), look.display(Rgb::new(0.4, 0.2, 0.8)));
        assert!((a - b).abs().max_element() < 1e-6);
        for wild in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1.0] {
            for ev in [-200.0, 0.0, 200.0] {
                let shown = exposed(ev).display(Rgb::new(wild, 0.5, wild));
                let bounded = shown.min_element() >= 0.0 && shown.max_element() <= 1.0;
                assert!(shown.is_finite() && bounded, "{look:?} {wild}");
            }
        }
        assert!(look.display(Rgb::NAN).max_element() < 0.003);
    }
}

/// Values of the published GLSL function, computed in double precision.
#[test]
fn neutral_is_the_published_curve() {
    for (colour, expected) in [
        ([0.18, 0.18, 0.18], [0.14, 0.14, 0.14]),
        ([0.5, 0.2, 0.06], [0.4625, 0.1625, 0.0225]),
        ([0.04, 0.04, 0.04], [0.01, 0.01, 0.01]),
        ([2.0, 0.5, 0.25], [0.96, 0.321_136, 0.214_658]),
        ([10.0, 10.0, 10.0], [0.993_898, 0.993_898, 0.993_898]),
    ] {
        let shown = Look::from(ToneMap::Neutral).display(Rgb::from_array(colour)).to_array().map(srgb_decode);
        for (shown, expected) in shown.into_iter().zip(expected) {
            assert!((shown - expected).abs() < 1e-4, "{colour:?}: {shown} instead of {expected}");
        }
    }
}

/// Pictures of which files hold small windows have the same errors as whole ones, and take little memory.
#[test]
fn windows_have_the_errors_of_whole_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let (reference, test) = fixture(1.0);
    let write = |name: &str, picture: &Picture, whole: [u32; 2], corner: [u32; 2]| {
        let mut set = LayerSet::new(WIDTH, HEIGHT);
        set.push(Layer::interleaved("", "RGB", picture.iter().copied())).expect("it fits");
        let frame = Frame { display: whole, corner, world_to_camera: [0.0; 16], world_to_ndc: Some([0.0; 16]) };
        let path = folder.path().join(name);
        let attributes = Attributes { frame: Some(frame), ..Attributes::default() };
        exr::write(&path, &set, &attributes, exr::Options::default()).expect("it can be written");
        path
    };
    for (whole, [one, other]) in [([140, 100], [[7, 5], [40, 30]]), ([96, 150], [[0, 40], [0, 86]])] {
        let paths = [write("a.exr", &test, whole, one), write("b.exr", &reference, whole, other)];
        let [a, b] = paths.each_ref().map(|path| exr::read_window(path).expect("it can be read").0);
        let [c, d] = paths.each_ref().map(|path| exr::read(path).expect("it can be read").0);
        assert_eq!((a.set.size(), a.expand().expect("there is memory")), (SIZE, c.clone()));
        for floor in [Floor::Papers, Floor::Relative] {
            let (found, [joined, _]) = compare_windows(&a, &b, floor).expect("they can be compared");
            let expected = compare_with_floor(&c, &d, floor).expect("they can be compared");
            for (found, expected) in [
                (found.relmse, expected.relmse),
                (found.relmse_trimmed, expected.relmse_trimmed),
                (found.mse, expected.mse),
                (found.flip, expected.flip),
                (found.grain, expected.grain),
                (found.floor, expected.floor),
                (found.mean_ratio.expect("it is not black"), expected.mean_ratio.expect("it is not black")),
            ] {
                assert!((found - expected).abs() <= 1e-12 * expected, "{found} {expected}");
            }
            let map = joined.expand_values(&found.flip_map).expect("there is memory");
            assert_eq!(map, expected.flip_map);
        }
    }
    // A display window of a million rows costs nothing.
    let paths = [write("a.exr", &test, [96, 1 << 20], [0, 5]), write("b.exr", &reference, [96, 1 << 20], [0, 9])];
    let [a, b] = paths.each_ref().map(|path| exr::read_window(path).expect("it can be read").0);
    let (_, [joined, _]) = compare_windows(&a, &b, Floor::Papers).expect("they can be compared");
    assert_eq!((a.set.size(), joined.set.size().height), (SIZE, 9 + HEIGHT + 16));
}
