//! Square windows around pixels, and means over them.

use crate::film::Size;
use rayon::prelude::*;

/// Indices of the pixels within `reach` of pixel `index` in x and y, the pixel included, row by row. The border of the
/// picture cuts windows off.
pub fn window(size: Size, index: usize, reach: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % size.width, index / size.width);
    let around = move |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
    around(y, size.height).flat_map(move |y| around(x, size.width).map(move |x| y * size.width + x))
}

/// Means over square windows around every pixel, of only the pixels that count. The border cuts windows off.
pub struct Windows<'a> {
    size: Size,
    reach: usize,
    counts: &'a [bool],
    /// Number of pixels that count in the window of each pixel.
    number: Vec<[f32; 1]>,
}

impl<'a> Windows<'a> {
    /// Windows that extend `reach` pixels to each side. `counts` says for each pixel whether it counts, row by row.
    pub fn new(size: Size, reach: usize, counts: &'a [bool]) -> Windows<'a> {
        let windows = Windows { size, reach, counts, number: Vec::new() };
        let number = windows.sums(|i| [f32::from(u8::from(counts[i]))]);
        Windows { number, ..windows }
    }

    /// The mean of `values` over the window of each pixel; zero if no pixel of it counts.
    pub fn means<const N: usize>(&self, values: &[[f32; N]]) -> Vec<[f32; N]> {
        let mut sums = self.sums(|i| if self.counts[i] { values[i] } else { [0.0; N] });
        sums.par_iter_mut().zip(&self.number).for_each(|(sum, [number])| *sum = sum.map(|sum| sum / number.max(1.0)));
        sums
    }

    /// Sums of `value`, a function of the pixel's index, over windows, by differences of running sums along rows and
    /// then columns.
    fn sums<const N: usize>(&self, value: impl Fn(usize) -> [f32; N] + Sync) -> Vec<[f32; N]> {
        let (width, height) = (self.size.width, self.size.height);
        let mut rows = vec![[0.0; N]; width * height];
        if rows.is_empty() {
            return Vec::new();
        }
        rows.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let mut running: Vec<[f64; N]> = Vec::with_capacity(width + 1);
            running.push([0.0; N]);
            for x in 0..width {
                let value = value(y * width + x);
                running.push(std::array::from_fn(|c| running[x][c] + f64::from(value[c])));
            }
            for (x, sum) in row.iter_mut().enumerate() {
                let (low, high) = (x.saturating_sub(self.reach), (x + self.reach + 1).min(width));
                *sum = std::array::from_fn(|c| running[high][c] - running[low][c]);
            }
        });
        for i in width..width * height {
            rows[i] = std::array::from_fn(|c| rows[i][c] + rows[i - width][c]);
        }
        let mut sums = vec![[0f32; N]; width * height];
        sums.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            let high = (y + self.reach + 1).min(height) - 1;
            let low = y.checked_sub(self.reach + 1);
            for (x, sum) in out.iter_mut().enumerate() {
                let below = low.map_or([0.0; N], |low| rows[low * width + x]);
                *sum = std::array::from_fn(|c| (rows[high * width + x][c] - below[c]) as f32);
            }
        });
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_equal_those_of_each_window_computed_alone() {
        for (width, height, reach) in [(9, 7, 2), (1, 5, 3), (6, 1, 1), (4, 4, 9)] {
            let size = Size { width, height };
            let counts: Vec<bool> = (0..size.pixels()).map(|i| i % 5 != 3).collect();
            let values: Vec<[f32; 2]> = (0..size.pixels()).map(|i| [(i * i % 17) as f32, -(i as f32)]).collect();
            let means = Windows::new(size, reach, &counts).means(&values);
            for (index, mean) in means.iter().enumerate() {
                let counted: Vec<usize> = window(size, index, reach).filter(|i| counts[*i]).collect();
                for c in 0..2 {
                    let expected = counted.iter().map(|i| values[*i][c]).sum::<f32>() / counted.len().max(1) as f32;
                    assert!((mean[c] - expected).abs() < 1e-5, "{mean:?} {expected}");
                }
            }
        }
        assert!(Windows::new(Size { width: 0, height: 0 }, 3, &[]).means::<1>(&[]).is_empty());
    }
}
