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
    /// x1 - x0.
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// y1 - y0.
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }
}

/// A network output, `[channel][y][x]`, over the rectangle that the network saw.
#[derive(Debug)]
pub struct Map {
    /// The rectangle.
    pub rect: Rect,
    /// Window side of equation (6).
    pub window: usize,
    /// All channels.
    pub data: Vec<f32>,
}

impl Map {
    /// Row `y` of the image in channel `channel`, from the rectangle's left edge on.
    pub fn row(&self, channel: usize, y: usize) -> &[f32] {
        let width = self.rect.width();
        let start = (channel * self.rect.height() + y - self.rect.y0) * width;
        &self.data[start..start + width]
    }
}
