//! The finished picture obeys the bounds of the finish for every estimate.

use caustique::film::{Picture, Size};
use caustique::finish::bound::{LIMIT, REACH, spread};
use caustique::finish::{DenoiserChoice, Estimate, Finish, Windows, window};
use caustique::random::{Domain, Purpose, Stream};

const NONE: f32 = f32::NAN;

/// A picture with different channels and standard errors of a tenth; the guides are those of a flat grey wall.
fn estimate(size: Size, of: impl Fn(usize) -> f32 + Sync + Send) -> Estimate {
    let draw = |index: usize| Stream::new(31, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
    let mean = Picture::from_fn(size, |i| [of(i), 0.5 * of(i), of(i) * (0.9 + 0.2 * draw(i))]);
    let deviation = mean.map(|value| 0.1 * value);
    let (albedo, normal) = (Picture::filled(size, [0.5; 3]), Picture::filled(size, [0.0, 0.0, 1.0]));
    Estimate {
        mean,
        deviation,
        albedo: Some(albedo),
        normal: Some(normal),
        clean_guides: true,
        alpha: None,
        samples: None,
    }
}

/// The pixels of a picture that violate a bound: each channel must be a number between zero and the brightest estimate
/// around, and, if there is a limit, within that distance of its own estimate.
fn outside(estimate: &Estimate, picture: &Picture) -> Vec<usize> {
    let (size, spread) = (picture.size(), spread(estimate));
    let breaks = |index: usize, c: usize| {
        let around = window(size, index, REACH).map(|other| estimate.mean[other][c]).filter(|value| value.is_finite());
        let (value, mean) = (picture[index][c], estimate.mean[index][c]);
        let most = LIMIT * spread[index][c] * 1.0001;
        !(0.0..=around.fold(0.0, f32::max)).contains(&value)
            || (mean.is_finite() && most.is_finite() && (value - mean).abs() > most)
    };
    (0..size.pixels()).filter(|&index| (0..3).any(|c| breaks(index, c))).collect()
}

/// Constant and black pictures, edges and fireflies of a million to one, the largest and smallest values of f32, and
/// estimates that are NaN, in pictures of one pixel, one row, one column and more, with every denoiser.
#[test]
fn no_denoiser_leaves_the_bounds() {
    let sizes = [(1, 1), (1, 30), (30, 1), (24, 17)].map(|(width, height)| Size { width, height });
    let half = |i: usize| if i % 4 < 2 { 1e6 } else { 1.0 };
    let spark = |i: usize| if i % 13 == 5 { 1e6 } else { 1.0 };
    let broken = |i: usize| [1.0, f32::INFINITY, 2.0, NONE, 3.0, f32::NEG_INFINITY, 4.0][i % 7];
    let pictures: [(&str, &(dyn Fn(usize) -> f32 + Sync)); 8] = [
        ("constant", &|_| 3.0),
        ("black", &|_| 0.0),
        ("edges", &half),
        ("sparks", &spark),
        ("large", &|_| 1e37),
        ("small", &|_| 1e-37),
        ("not finite", &broken),
        ("nothing", &|_| NONE),
    ];
    for choice in [DenoiserChoice::None, DenoiserChoice::Own, DenoiserChoice::Oidn] {
        let (mut finish, _) = Finish::open(choice, None).expect("the denoisers are installed");
        for size in sizes {
            for (name, of) in &pictures {
                let estimate = estimate(size, of);
                let picture = finish.picture(&estimate).expect("it is finished");
                let found = outside(&estimate, &picture);
                assert!(found.is_empty(), "{choice:?}, {name}, {size:?}: pixels {found:?} of {picture:?}");
                if *name == "constant" {
                    let wrong = picture.map(|value| 1.5 * value);
                    assert_eq!(outside(&estimate, &wrong).len(), size.pixels(), "what is too bright is not detected");
                }
            }
        }
    }
}

/// Means over sliding windows beside pixels that are 10^12 times as bright, as in squared errors: a pixel that has left
/// the window leaves only the rounding error of f64, 2^-50 of the largest value. In f32 it would leave 2^-24.
#[test]
fn windows_forget_pixels_that_have_left() {
    let (size, reach) = (Size { width: 64, height: 48 }, 3);
    let value = |i: usize| if i % 37 == 5 { 1e12 } else { 1.0 + (i % 7) as f32 };
    let values: Vec<[f32; 1]> = (0..size.pixels()).map(|i| [value(i)]).collect();
    let counts: Vec<bool> = (0..size.pixels()).map(|i| i % 5 != 0).collect();
    let all: f64 = values.iter().map(|[value]| f64::from(*value)).sum();
    let left = |digits: i32| all * 2f64.powi(-digits);
    let means = Windows::new(size, reach, &counts).means(&values);
    let mut dim = 0;
    for (index, [mean]) in means.iter().enumerate() {
        let inside: Vec<f64> =
            window(size, index, reach).filter(|i| counts[*i]).map(|i| f64::from(values[i][0])).collect();
        let expected = inside.iter().sum::<f64>() / inside.len() as f64;
        let allowed = left(50) / inside.len() as f64 + 1e-6 * expected;
        assert!((f64::from(*mean) - expected).abs() < allowed, "pixel {index}: {mean}, not {expected}");
        dim += usize::from(expected < 10.0 && allowed < 0.1 * expected && left(24) > expected);
    }
    assert!(dim > 10, "{dim} windows without a bright pixel");
}
