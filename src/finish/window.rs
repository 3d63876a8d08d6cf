//! Windows of pixels around a pixel.

/// Width and height of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// All pixels.
    pub fn pixels(self) -> usize {
        self.width * self.height
    }
}

/// Indices of the pixels within `reach` of pixel `index` in x and y, itself among them, row by row; the picture's edge
/// cuts windows off.
pub fn window(size: Size, index: usize, reach: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % size.width, index / size.width);
    let around = move |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
    around(y, size.height).flat_map(move |y| around(x, size.width).map(move |x| y * size.width + x))
}
