//! Cutting an image into tiles that give what the whole image would give, in bounded memory.
//!
//! A tile's core is its part of the result. Its input reaches further on every side: by the window's radius where
//! neighbours need network outputs of their own, and by the network's halo (its receptive radius). Inputs start
//! at multiples of the network's stride, so that its coarser grids fall on the same pixels in every tile; at the
//! image's edge they end where the whole image does, so that zero padding acts in the same place.

use super::map::Rect;
use super::model::Facts;
use crate::film::Size;

/// A part of the image and what the network must see for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Pixels that this tile yields, inside the image.
    pub core: Rect,
    /// Pixels that the network sees; may pass the image's right and bottom edge by less than a stride.
    pub input: Rect,
}

/// Tiles of about `pixels` pixels each, whose cores cover the image once.
pub fn tiles(Size { width, height }: Size, facts: &Facts, pixels: usize) -> Vec<Tile> {
    let side = pixels.isqrt();
    // A quarter wider than high: two by two tiles for a 16:9 picture at the usual size.
    let columns = spans(width, (side / 4).saturating_mul(5), facts);
    let rows = spans(height, (side / 5).saturating_mul(4), facts);
    let tile = |(y, v): &(Span, Span), (x, u): &(Span, Span)| Tile {
        core: Rect { x0: x.0, y0: y.0, x1: x.1, y1: y.1 },
        input: Rect { x0: u.0, y0: v.0, x1: u.1, y1: v.1 },
    };
    rows.iter().flat_map(|row| columns.iter().map(move |column| tile(row, column))).collect()
}

type Span = (usize, usize);

/// Cores and inputs along one axis: equal parts no longer than `longest`, at least a stride.
fn spans(size: usize, longest: usize, facts: &Facts) -> Vec<(Span, Span)> {
    let stride = facts.stride;
    let parts = size.div_ceil(longest.max(stride));
    let step = size.div_ceil(parts).next_multiple_of(stride);
    let reach = (facts.halo + facts.neighbour_radius()).next_multiple_of(stride);
    let padded = size.next_multiple_of(stride);
    let span = |start: usize| {
        let end = (start + step).min(size);
        ((start, end), (start.saturating_sub(reach), (start + step + reach).min(padded)))
    };
    (0..size).step_by(step).map(span).collect()
}
