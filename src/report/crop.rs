//! Crops of pictures, at the places where runs differ most, and their heat maps.

use crate::error::Result;
use crate::film::{Picture, Size};
use crate::image::tonemap::Look;
use crate::image::{heat, png, relative_squared_error};
use std::ops::Range;

/// A rectangle of pixels that the report crops out of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Window {
    /// Index of the leftmost column, from 0.
    pub x: usize,
    /// Index of the top row, from 0.
    pub y: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Window {
    /// The window of a whole picture.
    pub fn whole(Size { width, height }: Size) -> Window {
        Window { x: 0, y: 0, width, height }
    }

    /// Whether the window is not empty and lies within a picture of this size.
    pub fn fits(&self, Size { width, height }: Size) -> bool {
        let within = |start: usize, length: usize, size: usize| {
            length > 0 && start.checked_add(length).is_some_and(|end| end <= size)
        };
        within(self.x, self.width, width) && within(self.y, self.height, height)
    }

    fn overlaps(&self, other: &Window) -> bool {
        let span = |start: usize, length: usize| start..start + length;
        let overlap = |a: Range<usize>, b: Range<usize>| a.start < b.end && b.start < a.end;
        overlap(span(self.x, self.width), span(other.x, other.width))
            && overlap(span(self.y, self.height), span(other.y, other.height))
    }

    fn size(self) -> Size {
        Size { width: self.width, height: self.height }
    }

    /// Indices of the window's pixels in a picture that is `width` pixels wide.
    fn indices(self, width: usize) -> impl Iterator<Item = usize> {
        (self.y..self.y + self.height).flat_map(move |y| (self.x..self.x + self.width).map(move |x| y * width + x))
    }
}

/// The relative error of a pixel `x` against its reference `r`, clamped to 1: the root of its term of relMSE.
fn relative_error(x: [f32; 3], r: [f32; 3]) -> f64 {
    let error = relative_squared_error(x, r).sqrt();
    if error.is_nan() { 1.0 } else { error.min(1.0) }
}

/// Chooses up to `count` disjoint windows with the largest difference between the mean errors of the worst and the best
/// picture, or with the largest mean error if there is only one picture.
pub fn choose(pictures: &[Picture], reference: &Picture, count: usize) -> Vec<Window> {
    let Size { width, height } = reference.size();
    let least = width.min(height);
    let side = (least / 4).clamp(least.min(24), least.min(160));
    let (w, h) = (side, side);
    let tables: Vec<Vec<f64>> = pictures.iter().map(|picture| integral(picture, reference)).collect();
    let sum = |table: &Vec<f64>, x: usize, y: usize| {
        let at = |x: usize, y: usize| table[y * (width + 1) + x];
        at(x + w, y + h) - at(x, y + h) - at(x + w, y) + at(x, y)
    };
    let step = (w / 8).max(1);
    let mut scored: Vec<(f64, Window)> = Vec::new();
    for y in (0..=height - h).step_by(step) {
        for x in (0..=width - w).step_by(step) {
            let errors = tables.iter().map(|table| sum(table, x, y));
            let worst = errors.clone().fold(0.0, f64::max);
            let best = if tables.len() > 1 { errors.fold(f64::INFINITY, f64::min) } else { 0.0 };
            scored.push((worst - best, Window { x, y, width: w, height: h }));
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<Window> = Vec::new();
    for (_, window) in scored {
        if chosen.len() < count && chosen.iter().all(|other| !other.overlaps(&window)) {
            chosen.push(window);
        }
    }
    chosen
}

/// Summed-area table of relative errors, with one row and column more than the picture.
fn integral(picture: &Picture, reference: &Picture) -> Vec<f64> {
    let width = reference.size().width;
    let mut table = vec![0.0; width + 1];
    for (row, reference) in picture.chunks(width).zip(reference.chunks(width)) {
        let above = table.len() - (width + 1);
        let mut sum = 0.0;
        table.push(0.0);
        for (x, (&value, &truth)) in row.iter().zip(reference).enumerate() {
            sum += relative_error(value, truth);
            table.push(table[above + x + 1] + sum);
        }
    }
    table
}

/// The relative error with the palest colour of the heat maps: the 95th percentile over all pictures within the windows,
/// so that fireflies do not make the rest black.
pub fn scale(pictures: &[Picture], reference: &Picture, windows: &[Window]) -> f64 {
    let pixels = windows.iter().flat_map(|window| window.indices(reference.size().width));
    let mut errors: Vec<f64> =
        pixels.flat_map(|i| pictures.iter().map(move |picture| relative_error(picture[i], reference[i]))).collect();
    errors.sort_unstable_by(f64::total_cmp);
    errors.get(errors.len() * 95 / 100).copied().unwrap_or(1.0).max(1e-6)
}

/// A window of a picture, exposed and tone-mapped, as the bytes of a PNG.
///
/// # Errors
/// The window is empty.
pub fn picture(picture: &Picture, window: Window, look: Look) -> Result<Vec<u8>> {
    let pixels = window.indices(picture.size().width);
    png::encode(window.size(), pixels.map(|i| look.display(picture[i].into())))
}

/// Heat map of a picture's relative error in a window, as the bytes of a PNG; the error `largest` has the palest
/// colour.
///
/// # Errors
/// The window is empty.
pub fn heat_map(picture: &Picture, reference: &Picture, window: Window, largest: f64) -> Result<Vec<u8>> {
    let error = |i: usize| relative_error(picture[i], reference[i]) / largest;
    png::encode(window.size(), window.indices(reference.size().width).map(|i| heat::magma(error(i) as f32)))
}

/// The colour scale of the heat maps, from no error on the left, as the bytes of a PNG.
///
/// # Errors
/// None beyond lack of memory.
pub fn heat_bar() -> Result<Vec<u8>> {
    png::encode(Size { width: 256, height: 1 }, (0..256).map(|i| heat::magma(i as f32 / 255.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_windows_are_disjoint_and_where_pictures_differ() {
        let size = Size { width: 96, height: 64 };
        let reference = Picture::filled(size, [1.0; 3]);
        let with = |x: Range<usize>, y: Range<usize>, value: f32| {
            let mut picture = Picture::filled(size, [1.1; 3]);
            y.for_each(|y| x.clone().for_each(|x| picture[y * size.width + x] = [value; 3]));
            picture
        };
        let pictures = [with(60..70, 30..40, 1.6), with(10..16, 5..11, 1.3)];
        let windows = choose(&pictures, &reference, 2);
        let holds =
            |w: &Window, x: usize, y: usize| (w.x..w.x + w.width).contains(&x) && (w.y..w.y + w.height).contains(&y);
        assert_eq!(windows.len(), 2);
        assert!(holds(&windows[0], 65, 35) && holds(&windows[1], 13, 8), "{windows:?}");
        assert!(!windows[0].overlaps(&windows[1]) && windows.iter().all(|w| w.fits(size)));
        assert!(!Window { x: 90, y: 0, width: 7, height: 1 }.fits(size));
        assert!(!Window { x: usize::MAX, y: 0, width: 7, height: 1 }.fits(size));
        let largest = scale(&pictures, &reference, &[Window::whole(size)]);
        assert!((0.09..0.61).contains(&largest), "{largest}");
    }
}
