//! What a network puts out.

use super::rect::Rect;

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
