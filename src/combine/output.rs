//! Rectangles of pixels, and the output of a network over one.

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
    /// Pixels per row.
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }
}

/// Output of the network over the rectangle of its input.
#[derive(Debug)]
pub struct NetworkOutput {
    /// The rectangle of pixels.
    pub rect: Rect,
    /// Side of the window of equation (6).
    pub window: usize,
    /// Values, `[channel][y][x]`.
    pub data: Vec<f32>,
}

impl NetworkOutput {
    /// Row `y` of the image in a channel, from the left edge of the rectangle.
    pub fn row(&self, channel: usize, y: usize) -> &[f32] {
        let width = self.rect.width();
        let start = (channel * self.rect.height() + y - self.rect.y0) * width;
        &self.data[start..start + width]
    }
}
