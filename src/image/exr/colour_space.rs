//! Colour spaces of an EXR's pictures. The program computes in linear Rec. 709; the writer converts to the space that
//! the user asks for, and the reader converts back from the space that the header declares.

use exr::meta::attribute::Chromaticities;
use rayon::prelude::*;
use serde::Serialize;

use crate::film::{Layer, LayerSet};
use crate::math::{DMat3, DVec3};
use crate::spectrum::primaries::{AP1, REC_709, conversion, to_rec_709};

/// Linear colour space of the pictures in an EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum), value(rename_all = "lowercase"))]
#[serde(rename_all = "lowercase")]
pub enum ColourSpace {
    /// Linear Rec. 709 (sRGB primaries, D65)
    #[default]
    Rec709,
    /// ACEScg: AP1 primaries, the white of ACES
    AcesCg,
}

impl ColourSpace {
    /// Chromaticities of the primaries and the white point, for the header.
    pub(super) fn chromaticities(self) -> Chromaticities {
        match self {
            ColourSpace::Rec709 => REC_709,
            ColourSpace::AcesCg => AP1,
        }
    }

    /// The set with its pictures converted from Rec. 709; `None` if they are in this space already.
    pub(super) fn converted(self, set: &LayerSet) -> Option<LayerSet> {
        let matrix = conversion(&REC_709, &self.chromaticities()).filter(|_| self != ColourSpace::Rec709)?;
        let mut set = set.clone();
        convert(&mut set, matrix);
        Some(set)
    }
}

/// Converts the pictures of a file to Rec. 709. Files without chromaticities, or with such as define no colour space,
/// count as Rec. 709.
pub(super) fn convert_to_rec_709(set: &mut LayerSet, declared: Option<&Chromaticities>) {
    if let Some(matrix) = declared.and_then(to_rec_709) {
        convert(set, matrix);
    }
}

/// Converts all layers with R, G and B. Noise is alike in the three channels, so that standard errors are converted like
/// radiance; variances are squares of standard errors. Where noise differs between channels, the result is an upper
/// bound as long as the matrix has no negative elements, which is so from Rec. 709 to ACEScg.
fn convert(set: &mut LayerSet, matrix: DMat3) {
    for layer in &mut set.layers {
        let squared = layer.name.rsplit('.').next().is_some_and(|name| name.starts_with("Variance"));
        convert_layer(layer, matrix, squared);
    }
}

/// Converts a layer with R, G and B; others stay as they are.
fn convert_layer(layer: &mut Layer, matrix: DMat3, squared: bool) {
    let index = |component: &str| layer.planes.iter().position(|plane| plane.component == component);
    let (Some(red), Some(green), Some(blue)) = (index("R"), index("G"), index("B")) else { return };
    let [r, g, b] = [red, green, blue].map(|plane| std::mem::take(&mut layer.planes[plane].values));
    let converted: Vec<[f32; 3]> = (&r, &g, &b)
        .into_par_iter()
        .map(|(&r, &g, &b)| {
            let value = DVec3::new(r.into(), g.into(), b.into());
            let root = if squared { value.max(DVec3::ZERO).map(f64::sqrt) } else { value };
            let moved = matrix * root;
            (if squared { moved * moved } else { moved }).as_vec3().to_array()
        })
        .collect();
    for (component, plane) in [red, green, blue].into_iter().enumerate() {
        layer.planes[plane].values = converted.iter().map(|pixel| pixel[component]).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::math::Vec2;

    /// White stays white, and the way back restores every layer; other layers do not change.
    #[test]
    fn conversion_keeps_white_and_can_be_undone() {
        let mut set = LayerSet::new(2, 1);
        set.push(Layer::interleaved("", "RGBA", [[1.0, 1.0, 1.0, 0.5], [0.2, 3.0, 0.7, 1.0]])).expect("fits");
        set.push(Layer::interleaved("Variance2", "RGB", [[0.04, 0.04, 0.04], [0.09, 0.16, 0.01]])).expect("fits");
        set.push(Layer::interleaved("normal", "XYZ", [[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])).expect("fits");
        let mut moved = ColourSpace::AcesCg.converted(&set).expect("another space");
        assert!(ColourSpace::Rec709.converted(&set).is_none());
        for (name, white) in [("", 1.0), ("Variance2", 0.04)] {
            for plane in &moved.get(name).expect("kept").planes[..3] {
                assert!((plane.values[0] - white).abs() < 1e-5, "{name} {}", plane.values[0]);
            }
        }
        assert!((moved.layers[0].planes[1].values[1] - set.layers[0].planes[1].values[1]).abs() > 0.1);
        assert_eq!(moved.get("normal"), set.get("normal"));
        assert_eq!(moved.layers[0].plane("A"), set.layers[0].plane("A"));
        convert_to_rec_709(&mut moved, Some(&AP1));
        for (layer, wanted) in moved.layers.iter().zip(&set.layers) {
            for (plane, wanted) in layer.planes.iter().zip(&wanted.planes) {
                for (value, wanted) in plane.values.iter().zip(&wanted.values) {
                    assert!((value - wanted).abs() <= 1e-5 * wanted.abs().max(0.1), "{}", layer.name);
                }
            }
        }
    }

    /// Chromaticities that define no colour space leave the picture unchanged.
    #[test]
    fn impossible_chromaticities_are_ignored() {
        let mut set = LayerSet::new(1, 1);
        set.push(Layer::interleaved("", "RGB", [[0.3, 0.4, 0.5]])).expect("fits");
        let before = set.clone();
        let zero = Vec2(0.0, 0.0);
        let equal = Chromaticities { red: zero, green: zero, blue: zero, white: zero };
        let line = Chromaticities { green: Vec2(0.3, 0.3), blue: Vec2(0.2, 0.2), red: Vec2(0.4, 0.4), ..AP1 };
        let nan = Chromaticities { white: Vec2(f32::NAN, 0.3), ..AP1 };
        for declared in [None, Some(&equal), Some(&line), Some(&nan), Some(&REC_709)] {
            convert_to_rec_709(&mut set, declared);
            assert_eq!(set, before, "{declared:?}");
        }
    }
}
