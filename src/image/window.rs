//! A picture within the window that its file holds, outside which it is black.

use crate::error::{Error, ErrorKind, Result};
use crate::film::{Layer, LayerSet, Plane, Size};
use crate::memory;

/// The layers of a picture within a window of it. Outside the window, it is black.
pub struct Windowed {
    /// The layers within the window.
    pub set: LayerSet,
    /// Size of the whole picture.
    pub whole: Size,
    /// Column and row of the window's top left pixel.
    pub corner: [usize; 2],
}

impl Windowed {
    /// Number of black pixels outside the window.
    pub fn outside(&self) -> usize {
        self.whole.width * self.whole.height - self.set.pixels()
    }

    /// Two pictures of one size in the smallest window that holds both of theirs and `margin` pixels around them.
    ///
    /// # Errors
    /// There is too little memory.
    pub fn join(one: &Windowed, other: &Windowed, margin: usize) -> Result<[Windowed; 2]> {
        let corner = [0, 1].map(|axis| one.corner[axis].min(other.corner[axis]).saturating_sub(margin));
        let end = |of: &Windowed| [of.corner[0] + of.set.width, of.corner[1] + of.set.height];
        let whole = [one.whole.width, one.whole.height];
        let end = [0, 1].map(|axis| (end(one)[axis].max(end(other)[axis]) + margin).min(whole[axis]));
        let size = Size { width: end[0] - corner[0], height: end[1] - corner[1] };
        Ok([one.in_window(corner, size)?, other.in_window(corner, size)?])
    }

    /// The whole picture.
    ///
    /// # Errors
    /// There is too little memory.
    pub fn expand(&self) -> Result<LayerSet> {
        Ok(self.in_window([0, 0], self.whole)?.set)
    }

    /// The values of a plane of this window, in the whole picture.
    ///
    /// # Errors
    /// There is too little memory.
    pub fn expand_values(&self, values: &[f32]) -> Result<Vec<f32>> {
        self.moved(values, [0, 0], self.whole)
    }

    /// The picture in a window that holds this one.
    fn in_window(&self, corner: [usize; 2], size: Size) -> Result<Windowed> {
        let mut set = LayerSet::new(size.width, size.height);
        set.iterations = self.set.iterations;
        for Layer { name, planes } in &self.set.layers {
            let moved = |Plane { component, sample, values }: &Plane| {
                let values = self.moved(values, corner, size)?;
                Ok(Plane { component: component.clone(), sample: *sample, values })
            };
            set.layers.push(Layer { name: name.clone(), planes: planes.iter().map(moved).collect::<Result<_>>()? });
        }
        Ok(Windowed { set, whole: self.whole, corner })
    }

    fn moved(&self, values: &[f32], corner: [usize; 2], size: Size) -> Result<Vec<f32>> {
        let pixels = size.width.saturating_mul(size.height);
        memory::require(4 * pixels as u64, format_args!("{} x {} pixels", size.width, size.height))?;
        let mut out = vec![0.0; pixels];
        let [left, top] = [0, 1].map(|axis| self.corner[axis].saturating_sub(corner[axis]));
        for (row, line) in values.chunks_exact(self.set.width.max(1)).enumerate() {
            let start = (top + row) * size.width + left;
            if let Some(place) = out.get_mut(start..start + line.len()) {
                place.copy_from_slice(line);
            }
        }
        Ok(out)
    }
}

/// Checks that two pictures have the same size.
///
/// # Errors
/// They have not.
pub fn check_sizes(a: Size, b: Size) -> Result<()> {
    if a == b {
        return Ok(());
    }
    let cause = format!("pictures of {} x {} and {} x {} pixels", a.width, a.height, b.width, b.height);
    Err(Error::new(ErrorKind::Image, "", cause).hint("render both with the same --width and --height"))
}
