//! Rectangles of pixels, and the output of a network over one.

/// A rectangle of pixels: x0 <= x < x1, y0 <= y < y1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Rect {
    pub x0: usize,
    pub y0: usize,
    pub x1: usize,
    pub y1: usize,
}

impl Rect {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.y1 - self.y0
    }
}

/// Output of the network over the rectangle of pixels of its input.
#[derive(Debug)]
pub struct NetworkOutput {
    /// The rectangle of pixels that the output covers.
    pub rect: Rect,
    /// Pixels along the side of the window of equation (6).
    pub window: usize,
    /// Distances of the window's pixels in pixels of the image, one for each group of channels.
    pub dilations: Vec<usize>,
    /// Pairs of levels whose z_c has a weight of its own, in the last channels.
    pub identities: Vec<usize>,
    /// Output values, indexed `[channel][y][x]` within the rectangle.
    pub data: Vec<f32>,
}

impl NetworkOutput {
    /// The output of a network with one window of adjacent pixels.
    #[cfg(test)]
    pub fn new(rect: Rect, window: usize, data: Vec<f32>) -> Self {
        NetworkOutput { rect, window, dilations: vec![1], identities: Vec::new(), data }
    }

    /// Number of channels of one window, for all pairs.
    pub fn group_channels(&self) -> usize {
        let channels = self.data.len() / (self.rect.width() * self.rect.height());
        (channels - self.identities.len()) / self.dilations.len()
    }

    /// The values of a channel in row `y` of the image, from the left edge of the rectangle.
    pub fn row(&self, channel: usize, y: usize) -> &[f32] {
        let width = self.rect.width();
        let start = (channel * self.rect.height() + y - self.rect.y0) * width;
        &self.data[start..start + width]
    }
}
