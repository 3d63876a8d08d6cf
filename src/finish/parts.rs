//! Additive parts of the finished picture.
//!
//! Each part is denoised and displaced within the bound of the whole picture. Then all parts are scaled by a common factor
//! per pixel so that they sum to the finished picture. A part is never negative, and converges to the limit of its
//! estimate.

use super::bound::Noise;
use super::conserve::bounded;
use crate::film::Picture;
use rayon::prelude::*;

/// An additive part of the picture, such as its caustics, before the bound: its estimate and its denoised picture.
pub struct Part {
    /// Estimated light of the part.
    pub mean: Picture,
    /// Denoised estimate of the part; the estimate itself if it has no noise.
    pub denoised: Picture,
}

/// Finishes additive parts of a picture so that they sum to the finished picture `whole`. `noise` belongs to the whole
/// picture.
///
/// Light of the whole picture at a pixel where no part has any, which the denoiser has brought from around, goes to the
/// last part. `colors` has a colour for parts that compositors divide by it; such a part gets no light where its colour is
/// black, and the first part, which must not have a colour then, gets light that none of the others can have.
pub fn split(parts: &[Part], whole: &Picture, noise: Noise<'_>, colors: &[Option<&Picture>]) -> Vec<Picture> {
    let mut finished: Vec<Picture> = parts.iter().map(|part| bounded(&part.mean, &part.denoised, noise).0).collect();
    let is_black = |part: usize, index: usize, c: usize| {
        let color = colors.get(part).copied().flatten();
        color.is_some_and(|color| color[index][c] <= 0.0 && parts[part].mean[index][c] <= 0.0)
    };
    for (part, values) in finished.iter_mut().enumerate().filter(|(part, _)| matches!(colors.get(*part), Some(Some(_))))
    {
        values.par_iter_mut().enumerate().for_each(|(index, value)| {
            *value = std::array::from_fn(|c| if is_black(part, index, c) { 0.0 } else { value[c] });
        });
    }
    let Some((last, others)) = finished.split_last_mut() else { return finished };
    let scale = |index: usize, c: usize, last: &[f32; 3], others: &[Picture]| {
        let sum = f64::from(last[c]) + others.iter().map(|part| f64::from(part[index][c])).sum::<f64>();
        if sum > 0.0 { f64::from(whole[index][c]) / sum } else { 0.0 }
    };
    let scales: Vec<[f64; 3]> = (0..whole.len())
        .into_par_iter()
        .map(|index| std::array::from_fn(|c| scale(index, c, &last[index], others)))
        .collect();
    for part in others.iter_mut() {
        part.par_iter_mut().zip(&scales).for_each(|(value, scale)| {
            *value = std::array::from_fn(|c| (f64::from(value[c]) * scale[c]) as f32);
        });
    }
    // The last part takes the remainder, so that the sum has no rounding error.
    last.par_iter_mut().enumerate().for_each(|(index, value)| {
        *value = std::array::from_fn(|c| {
            let sum = others.iter().map(|part| f64::from(part[index][c])).sum::<f64>();
            (f64::from(whole[index][c]) - sum).max(0.0) as f32
        });
    });
    let final_part = parts.len() - 1;
    if let (Some(Some(_)), Some((first, _))) = (colors.get(final_part), others.split_first_mut()) {
        first.par_iter_mut().zip(&mut **last).enumerate().for_each(|(index, (first, last))| {
            for c in (0..3).filter(|c| is_black(final_part, index, *c)) {
                first[c] += std::mem::take(&mut last[c]);
            }
        });
    }
    finished
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::finish::Estimate;
    use crate::random::{Domain, Purpose, Stream};

    /// An estimate with `error` as the standard error of every pixel.
    fn estimate(mean: &Picture, error: f32) -> Estimate {
        let deviation = Picture::filled(mean.size(), [error; 3]);
        Estimate::unguided(mean.clone(), deviation)
    }

    #[test]
    fn parts_sum_to_the_picture_and_are_never_negative() {
        let size = Size { width: 30, height: 20 };
        let plane = |seed: u64| {
            let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            Picture::from_fn(size, |index| [draw(index), if index % 7 == 0 { 0.0 } else { draw(index) }, 0.0])
        };
        let part = |seed| Part { mean: plane(seed), denoised: plane(seed + 10) };
        let parts = [part(1), part(2), Part { mean: Picture::filled(size, [0.0; 3]), denoised: plane(20) }];
        let (whole, spread) = (plane(3), Picture::filled(size, [0.1; 3]));
        let estimate = estimate(&whole, 0.1);
        let noise = Noise::new(&estimate, &spread);
        let finished = split(&parts, &whole, noise, &[]);
        for index in 0..size.pixels() {
            for c in 0..3 {
                let sum: f32 = finished.iter().map(|part| part[index][c]).sum();
                assert!((sum - whole[index][c]).abs() <= 2e-7 * whole[index][c].max(1.0), "{sum}");
                assert!(finished.iter().all(|part| part[index][c] >= 0.0));
            }
        }
        assert!(split(&[], &whole, noise, &[]).is_empty());
    }

    /// With standard errors of zero the finished parts are their estimates.
    #[test]
    fn exact_parts_stay() {
        let size = Size { width: 4, height: 4 };
        let plane = |value: f32| Picture::filled(size, [value; 3]);
        let part = |value: f32| Part { mean: plane(value), denoised: plane(9.0) };
        let whole = plane(0.75);
        let (sure, none) = (estimate(&whole, 0.0), plane(0.0));
        let exact = Noise::new(&sure, &none);
        let finished = split(&[part(0.25), part(0.5)], &whole, exact, &[]);
        assert_eq!(finished, [plane(0.25), plane(0.5)]);
    }

    /// Parts with colours get no light where the colour is black, and all parts still sum to the picture: the others, or
    /// the first one, take the light that the denoiser has brought. Without colours they get some.
    #[test]
    fn parts_of_black_colour_stay_black() {
        let size = Size { width: 30, height: 20 };
        let draw =
            |seed: u64, index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
        // Black in every third pixel, and in one channel of others.
        let dark = |seed: u64, index: usize| [index.is_multiple_of(3), draw(seed + 50, index) < 0.3, false];
        let color =
            |seed: u64| Picture::from_fn(size, |index| dark(seed, index).map(|dark| if dark { 0.0 } else { 0.5 }));
        let part = |seed: u64| Part {
            mean: Picture::from_fn(size, |index| {
                dark(seed, index).map(|dark| if dark { 0.0 } else { draw(seed, index) })
            }),
            denoised: Picture::from_fn(size, |index| [draw(seed + 10, index); 3]),
        };
        let emit = Part { mean: Picture::filled(size, [0.0; 3]), denoised: Picture::filled(size, [0.0; 3]) };
        let parts = [emit, part(1), part(2)];
        let whole = Picture::from_fn(size, |index| [0.2 + draw(30, index); 3]);
        let (spread, estimate) = (Picture::filled(size, [0.5; 3]), estimate(&whole, 0.5));
        let noise = Noise::new(&estimate, &spread);
        let colors = [color(1), color(2)];
        let lit = |finished: &[Picture]| {
            let in_black = |index: usize| {
                (0..2)
                    .flat_map(move |k| (0..3).map(move |c| (k, c)))
                    .any(|(k, c)| colors[k][index][c] == 0.0 && finished[k + 1][index][c] > 0.0)
            };
            (0..size.pixels()).filter(|index| in_black(*index)).count()
        };
        let masked = split(&parts, &whole, noise, &[None, Some(&color(1)), Some(&color(2))]);
        for index in 0..size.pixels() {
            for c in 0..3 {
                let sum: f32 = masked.iter().map(|part| part[index][c]).sum();
                assert!((sum - whole[index][c]).abs() <= 2e-6 * whole[index][c], "{sum}");
            }
        }
        assert_eq!(lit(&masked), 0);
        assert!(lit(&split(&parts, &whole, noise, &[])) > 50);
    }
}
