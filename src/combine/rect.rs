//! Rectangles of pixels.

/// Pixels x0 <= x < x1, y0 <= y < y1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Rect {
    pub x0: usize,
    pub y0: usize,
    pub x1: usize,
    pub y1: usize,
}

impl Rect {
    /// x1 - x0.
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// y1 - y0.
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }
}
