//! Splits an image into tiles with the result of the whole image, in bounded memory.
//!
//! The core of a tile is its part of the result. Its input extends the core on every side by the window's radius, if the
//! weights need the network's output at neighbours, and by the network's halo (its receptive radius). Inputs start at
//! multiples of the network's stride, so that its coarser grids fall on the same pixels in every tile. At the border of the
//! image they end where the whole image ends, so that zero padding acts at the same place.

use super::model::Metadata;
use super::output::Rect;
use crate::film::Size;

/// A rectangle of the image, and the larger rectangle that the network reads for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Pixels whose result the tile gives, inside the image.
    pub core: Rect,
    /// Pixels that the network reads. They can exceed the image at the right and bottom by less than a stride.
    pub input: Rect,
}

/// Tiles of about `pixels` pixels each. Their cores cover the image once.
pub fn tiles(Size { width, height }: Size, metadata: &Metadata, pixels: usize) -> Vec<Tile> {
    let side = pixels.isqrt();
    // Tiles of 25:16 split common 16:9 pictures into two by two.
    let columns = spans(width, (side / 4).saturating_mul(5), metadata);
    let rows = spans(height, (side / 5).saturating_mul(4), metadata);
    let tile = |(y, v): &(Span, Span), (x, u): &(Span, Span)| Tile {
        core: Rect { x0: x.0, y0: y.0, x1: x.1, y1: y.1 },
        input: Rect { x0: u.0, y0: v.0, x1: u.1, y1: v.1 },
    };
    rows.iter().flat_map(|row| columns.iter().map(move |column| tile(row, column))).collect()
}

/// Index of the first pixel along one axis, and index behind the last.
type Span = (usize, usize);

/// Cores and inputs of the tiles along one axis: equal parts of at most `longest` pixels, or of the network's stride if
/// that is longer.
fn spans(size: usize, longest: usize, metadata: &Metadata) -> Vec<(Span, Span)> {
    let stride = metadata.stride;
    let parts = size.div_ceil(longest.max(stride));
    let step = size.div_ceil(parts).next_multiple_of(stride);
    let reach = (metadata.halo + metadata.neighbour_radius()).next_multiple_of(stride);
    let padded = size.next_multiple_of(stride);
    let span = |start: usize| {
        let end = (start + step).min(size);
        ((start, end), (start.saturating_sub(reach), (start + step + reach).min(padded)))
    };
    (0..size).step_by(step).map(span).collect()
}
