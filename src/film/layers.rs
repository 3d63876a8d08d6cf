//! Named layers of one picture.
//!
//! A layer has one plane per component: `Level1.R` is the plane `R` of the layer `Level1`. The beauty is the layer with
//! the empty name. A lone channel of a file, such as `Z`, is the only plane `Z` of a layer `Z`.

use super::picture::{Picture, Size};
use crate::error::{Error, ErrorKind, Result};
use rayon::prelude::*;

/// Number format in which a file stores a plane, one component of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sample {
    /// 16 bits; at most 65504, 11 bits of precision.
    Half,
    /// 32 bits.
    Float,
}

/// One component of a layer, with a value for every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Name of the component, one letter in our files: `R G B A`, `X Y Z`, `U V`, `r g b a` for cryptomatte.
    pub component: String,
    /// Number format of the values in a file.
    pub sample: Sample,
    /// One value per pixel, row by row from the top, `width * height` of them.
    pub values: Vec<f32>,
}

/// A named group of planes, such as R, G and B of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// The part of the channel names before the last dot; empty for the beauty.
    pub name: String,
    /// One plane per component, in the order `R G B A`, `X Y Z`, `U V`.
    pub planes: Vec<Plane>,
}

/// All layers of a picture. They have the same size.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct LayerSet {
    /// Pixels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The layers in the order of addition or of the file; names are unique.
    pub layers: Vec<Layer>,
    /// Number of iterations that the layers are means of; `None` if unknown.
    pub iterations: Option<u64>,
}

/// Meaning of a layer that other programs write too, independent of the name that the writing program gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The picture itself.
    Beauty,
    /// Reflectance at the first rough hit.
    Albedo,
    /// Unit normal at the first rough hit.
    Normal,
    /// Distance to the first rough hit.
    Depth,
}

impl Layer {
    /// A layer of float planes from interleaved values: `pixels` yields one array per pixel, row by row from the top,
    /// and `components` has one letter per element, such as `"RGB"`.
    pub fn interleaved<const N: usize>(
        name: impl Into<String>,
        components: &str,
        pixels: impl IntoIterator<Item = [f32; N]>,
    ) -> Self {
        debug_assert_eq!(components.chars().count(), N);
        let pixels = pixels.into_iter();
        let mut values: [Vec<f32>; N] = std::array::from_fn(|_| Vec::with_capacity(pixels.size_hint().0));
        for pixel in pixels {
            for (plane, value) in values.iter_mut().zip(pixel) {
                plane.push(value);
            }
        }
        let planes = components.chars().zip(values);
        let planes = planes.map(|(c, values)| Plane { component: c.into(), sample: Sample::Float, values });
        Layer { name: name.into(), planes: planes.collect() }
    }

    /// The layer with another number format of its planes in files.
    #[must_use]
    pub fn stored_as(mut self, sample: Sample) -> Self {
        self.planes.iter_mut().for_each(|plane| plane.sample = sample);
        self
    }

    /// The layer's plane of a component, by name; `None` if it has none.
    pub fn plane(&self, component: &str) -> Option<&Plane> {
        self.planes.iter().find(|plane| plane.component == component)
    }

    /// The first three planes (`R G B`, `X Y Z`), interleaved by pixel. A layer with one or two planes is read as grey:
    /// its first plane is repeated.
    pub fn triples(&self) -> Vec<[f32; 3]> {
        let [r, g, b] = std::array::from_fn(|i| {
            let index = if self.planes.len() < 3 { 0 } else { i };
            self.planes.get(index).map_or(&[][..], |plane| &plane.values)
        });
        r.par_iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect()
    }
}

impl LayerSet {
    /// A set of no layers, for a picture of this size in pixels.
    pub fn new(width: usize, height: usize) -> Self {
        LayerSet { width, height, ..LayerSet::default() }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        Size { width: self.width, height: self.height }
    }

    /// Adds a layer, or replaces the layer with its name.
    ///
    /// # Errors
    /// A plane has another size than the picture.
    pub fn push(&mut self, layer: Layer) -> Result<()> {
        if let Some(plane) = layer.planes.iter().find(|plane| plane.values.len() != self.pixels()) {
            let cause = format!("{} values for {} x {} pixels", plane.values.len(), self.width, self.height);
            return Err(Error::new(ErrorKind::Image, format!("layer \"{}\"", layer.name), cause));
        }
        match self.layers.iter_mut().find(|old| old.name == layer.name) {
            Some(old) => *old = layer,
            None => self.layers.push(layer),
        }
        Ok(())
    }

    /// The layer of exactly this name; `None` if there is none.
    pub fn get(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// The layer with a role, by the names that caustique, Blender, Mitsuba, pbrt, LuxCore and Arnold use; `None` if
    /// there is none. The name of a view layer or file part may precede it (`ViewLayer.Denoising Albedo`).
    pub fn find(&self, role: Role) -> Option<&Layer> {
        let names: &[&str] = match role {
            Role::Beauty => {
                &["", "Combined", "RGBA", "rgba", "RGB", "rgb", "beauty", "Beauty", "color", "Color", "image"]
            }
            Role::Albedo => &["albedo", "Albedo", "Denoising Albedo", "ALBEDO", "denoise_albedo", "DiffCol", "diffuse"],
            Role::Normal => &[
                "normal",
                "Normal",
                "N",
                "Ns",
                "Denoising Normal",
                "SHADING_NORMAL",
                "denoise_normal",
                "sh_normal",
                "nn",
            ],
            Role::Depth => &["depth", "Depth", "Denoising Depth", "Z", "DEPTH", "distance"],
        };
        let last = |layer: &Layer, name: &str| layer.name.rsplit('.').next() == Some(name);
        let exact = names.iter().find_map(|name| self.get(name));
        exact.or_else(|| names.iter().skip(1).find_map(|name| self.layers.iter().find(|layer| last(layer, name))))
    }

    /// The layer of exactly this name as a picture, see [`Layer::triples`]; `None` if there is none.
    pub fn picture(&self, name: &str) -> Option<Picture> {
        self.get(name).map(|layer| self.picture_of(layer))
    }

    /// A layer of this set as a picture.
    pub fn picture_of(&self, layer: &Layer) -> Picture {
        Picture::new(self.size(), layer.triples())
    }

    /// The beauty, the layer of the picture itself.
    ///
    /// # Errors
    /// No layer has the role [`Role::Beauty`].
    pub fn beauty(&self) -> Result<Picture> {
        let layer = self.find(Role::Beauty).filter(|layer| !layer.planes.is_empty()).ok_or_else(|| {
            let names: Vec<&str> = self.layers.iter().map(|layer| layer.name.as_str()).take(8).collect();
            Error::new(ErrorKind::Image, "", format!("no picture among the layers ({})", names.join(", ")))
                .hint("a picture has the channels R, G, B, or a layer named Combined, beauty or rgba")
        })?;
        Ok(self.picture_of(layer))
    }
}
