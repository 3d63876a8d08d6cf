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

    /// The values of a plane of this window in another window of the picture; 0 or false where this window has none.
    ///
    /// # Errors
    /// There is too little memory.
    pub fn values_in<T: Copy + Default>(&self, other: &Windowed, values: &[T]) -> Result<Vec<T>> {
        self.moved(values, other.corner, other.set.size())
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

    fn moved<T: Copy + Default>(&self, values: &[T], corner: [usize; 2], size: Size) -> Result<Vec<T>> {
        let pixels = size.width.saturating_mul(size.height);
        memory::require((size_of::<T>() * pixels) as u64, format_args!("{} x {} pixels", size.width, size.height))?;
        let mut out = vec![T::default(); pixels];
        let own = self.set.size();
        // The columns and the rows that both windows have.
        let shared = |axis: usize, ours: usize, theirs: usize| {
            self.corner[axis].max(corner[axis])..(self.corner[axis] + ours).min(corner[axis] + theirs)
        };
        let (columns, rows) = (shared(0, own.width, size.width), shared(1, own.height, size.height));
        for y in rows.filter(|_| !columns.is_empty()) {
            let line = |corner: [usize; 2], width: usize| {
                let start = (y - corner[1]) * width + columns.start - corner[0];
                start..start + columns.len()
            };
            out[line(corner, size.width)].copy_from_slice(&values[line(self.corner, own.width)]);
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
