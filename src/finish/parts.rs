//! Additive parts of the finished picture.
//!
//! Each part is denoised and bounded by the whole picture's standard errors, then all are scaled together so that they
//! sum to the finished picture: a part is as clean as the whole, never negative, and tends to what its estimate tends
//! to.

use super::Estimate;
use super::bound::bounded;
use super::conserve::give_back;
use rayon::prelude::*;

/// One part: its estimate and its denoised picture.
pub struct Part {
    /// Estimate.
    pub mean: Vec<[f32; 3]>,
    /// What the denoiser makes of it; the estimate itself where there is nothing to remove.
    pub denoised: Vec<[f32; 3]>,
}

/// Parts that sum to `whole`, in their order; estimate and spread are those of the whole picture.
///
/// Where no part has light but the whole picture does, which is light that the denoiser has brought from around, the
/// last takes it.
pub fn shared(parts: &[Part], whole: &[[f32; 3]], (estimate, spread): (&Estimate, &[[f32; 3]])) -> Vec<Vec<[f32; 3]>> {
    let finish = |part: &Part| {
        let mut picture = bounded(&part.mean, &part.denoised, spread, estimate.size);
        give_back(&mut picture, (&part.mean, &part.denoised), (estimate, spread));
        picture
    };
    let mut finished: Vec<Vec<[f32; 3]>> = parts.iter().map(finish).collect();
    let Some((last, others)) = finished.split_last_mut() else { return finished };
    let scale = |index: usize, c: usize, last: &[f32; 3], others: &[Vec<[f32; 3]>]| {
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
    // What is left, so that rounding does not show in the sum.
    last.par_iter_mut().enumerate().for_each(|(index, value)| {
        *value = std::array::from_fn(|c| {
            let sum = others.iter().map(|part| f64::from(part[index][c])).sum::<f64>();
            (f64::from(whole[index][c]) - sum).max(0.0) as f32
        });
    });
    finished
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finish::Size;
    use crate::random::{Domain, Purpose, Stream};

    /// The whole picture, with the same standard error everywhere.
    fn estimate(size: Size, mean: &[[f32; 3]], error: f32) -> Estimate {
        let deviation = vec![[error; 3]; mean.len()];
        Estimate { size, mean: mean.to_vec(), deviation, albedo: None, normal: None, alpha: None }
    }

    #[test]
    fn parts_sum_to_the_picture_and_are_never_negative() {
        let size = Size { width: 30, height: 20 };
        let plane = |seed: u64| -> Vec<[f32; 3]> {
            let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            (0..size.pixels()).map(|index| [draw(index), if index % 7 == 0 { 0.0 } else { draw(index) }, 0.0]).collect()
        };
        let part = |seed| Part { mean: plane(seed), denoised: plane(seed + 10) };
        let parts = [part(1), part(2), Part { mean: vec![[0.0; 3]; size.pixels()], denoised: plane(20) }];
        let (whole, spread) = (plane(3), vec![[0.1; 3]; size.pixels()]);
        let estimate = estimate(size, &whole, 0.1);
        let finished = shared(&parts, &whole, (&estimate, &spread));
        for index in 0..size.pixels() {
            for c in 0..3 {
                let sum: f32 = finished.iter().map(|part| part[index][c]).sum();
                assert!((sum - whole[index][c]).abs() <= 2e-7 * whole[index][c].max(1.0), "{sum}");
                assert!(finished.iter().all(|part| part[index][c] >= 0.0));
            }
        }
        assert!(shared(&[], &whole, (&estimate, &spread)).is_empty());
    }

    /// With standard errors of zero the parts are their estimates, which sum to the picture.
    #[test]
    fn sure_parts_stay() {
        let size = Size { width: 4, height: 4 };
        let part = |value: f32| Part { mean: vec![[value; 3]; 16], denoised: vec![[9.0; 3]; 16] };
        let whole = [[0.75; 3]; 16];
        let sure = (&estimate(size, &whole, 0.0), &[[0.0; 3]; 16][..]);
        let finished = shared(&[part(0.25), part(0.5)], &whole, sure);
        assert_eq!(finished, [vec![[0.25; 3]; 16], vec![[0.5; 3]; 16]]);
    }
}
