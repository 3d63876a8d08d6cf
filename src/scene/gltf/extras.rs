//! `extras.caustique`: properties that glTF cannot express. Each kind of part has its own keys; an unknown key gives a
//! warning with a suggestion.

use super::container::malformed;
use super::fault;
use super::texture::Info;
use crate::error::Result;
use crate::material::MediumParameters;
use crate::math::Rgb;
use crate::scene::description::{Contrast, Linked, ToneMap};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Content of `extras.caustique` of a scene.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct SceneExtras {
    pub(super) environment: Option<EnvironmentExtras>,
    pub(super) medium: Option<Medium>,
    pub(super) light_units: Option<Units>,
    pub(super) losses: Vec<String>,
    pub(super) resolution: Option<[u32; 2]>,
    pub(super) exposure: Option<f32>,
    pub(super) tonemap: Option<ToneMap>,
    pub(super) contrast: Option<Contrast>,
    pub(super) crop: Option<[f64; 4]>,
    pub(super) film_transparent: bool,
    pub(super) frame: Option<i32>,
    pub(super) frame_rate: Option<Rate>,
    pub(super) shutter: Option<[f64; 2]>,
    /// Time of the frame in the animations of a file that has only one frame (seconds).
    pub(super) time: Option<f64>,
}

/// Frames per second of a scene: a whole number or a fraction.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "a whole number, or two for a fraction as in [24000, 1001]")]
pub(super) enum Rate {
    Whole(u32),
    Fraction([u32; 2]),
}

impl Rate {
    /// Numerator and denominator of the number of frames per second.
    pub(super) fn fraction(self) -> [u32; 2] {
        match self {
            Rate::Whole(rate) => [rate, 1],
            Rate::Fraction(fraction) => fraction,
        }
    }
}

/// Whether cameras see an object. Other rays hit the object in any case.
#[derive(Deserialize)]
#[serde(default)]
pub(super) struct Visible {
    pub(super) camera: bool,
}

impl Default for Visible {
    fn default() -> Self {
        Visible { camera: true }
    }
}

/// Content of `extras.caustique.environment`, and of its `background`: a colour or an image file.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct EnvironmentExtras {
    pub(super) color: Option<[f32; 3]>,
    pub(super) file: Option<String>,
    pub(super) rotation_deg: f32,
    pub(super) strength: Option<f32>,
    pub(super) visible: Visible,
    pub(super) light_group: Option<String>,
    /// The environment that cameras see instead.
    pub(super) background: Option<Box<EnvironmentExtras>>,
}

/// Units of the intensities of punctual lights, as the file states them.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Units {
    Radiometric,
    Photometric,
}

/// A participating medium, with coefficients in 1/m.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Medium {
    sigma_a: [f32; 3],
    sigma_s: [f32; 3],
    g: f32,
    /// Factor of the coefficients, which makes the medium heterogeneous.
    pub(super) density: Option<GridExtras>,
    /// Light that a heterogeneous medium emits.
    pub(super) emission: Option<EmissionExtras>,
}

/// Content of `extras.caustique.medium.density`: a grid in a file.
#[derive(Deserialize)]
pub(super) struct GridExtras {
    pub(super) file: String,
}

impl Medium {
    pub(super) fn parameters(&self, place: &str) -> Result<MediumParameters> {
        let coefficients = self.sigma_a.iter().chain(&self.sigma_s);
        if !coefficients.into_iter().all(|x| x.is_finite() && *x >= 0.0) {
            return Err(fault(place, "sigma_a and sigma_s of a medium must be finite and not negative"));
        }
        if !(self.g > -1.0 && self.g < 1.0) {
            return Err(fault(place, format!("g of a medium must lie between -1 and 1, it is {}", self.g)));
        }
        let (sigma_a, sigma_s) = (Rgb::from_array(self.sigma_a), Rgb::from_array(self.sigma_s));
        Ok(MediumParameters { sigma_a, sigma_s, g: self.g })
    }
}

/// Content of `extras.caustique.medium.emission`: a grid in a file, and its colour (W/sr/m3).
#[derive(Deserialize)]
pub(super) struct EmissionExtras {
    pub(super) file: String,
    #[serde(default = "white")]
    pub(super) color: [f32; 3],
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// Contact between a material and opaque surfaces that touch it.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Contact {
    /// A film of air is between the material and the opaque surface.
    Air,
    /// No air is between the material and the opaque surface.
    Optical,
}

/// The model of sheen.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sheen {
    #[default]
    Charlie,
    Fibers,
}

/// Content of `extras.caustique` of a material.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialExtras {
    pub(super) medium: Option<Medium>,
    pub(super) priority: i32,
    pub(super) contact: Option<Contact>,
    pub(super) null_bsdf: bool,
    pub(super) spread_deg: Option<f32>,
    pub(super) diffuse_roughness: Option<f32>,
    pub(super) diffuse_roughness_texture: Option<Info>,
    pub(super) coat_ior: Option<f32>,
    pub(super) coat_ior_texture: Option<Info>,
    pub(super) coat_color: Option<[f32; 3]>,
    pub(super) coat_color_texture: Option<Info>,
    pub(super) sheen_model: Sheen,
    pub(super) reflection_color: Option<[f32; 3]>,
    pub(super) single_scattering: bool,
}

/// Content of `extras.caustique` of a node with a mesh.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct ObjectExtras {
    pub(super) visible: Visible,
    pub(super) light_group: Option<String>,
    pub(super) shadow_catcher: bool,
    pub(super) holdout: bool,
}

/// Light linking and shadow linking in `extras.caustique` of a node with a mesh or a light.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct LinkExtras {
    pub(super) collections: Vec<String>,
    pub(super) receivers: Linked,
    pub(super) blockers: Linked,
}

/// Content of `extras.caustique` of a camera, or of its node.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct CameraExtras {
    pub(super) aperture_radius: Option<f32>,
    pub(super) focus_distance: Option<f32>,
    pub(super) shift: Option<[f32; 2]>,
    pub(super) panorama: Option<PanoramaExtras>,
}

/// Content of `extras.caustique.panorama`.
#[derive(Clone, Copy, Deserialize)]
#[serde(default)]
pub(super) struct PanoramaExtras {
    /// Ranges of an equirectangular picture (degrees).
    pub(super) longitude_deg: [f32; 2],
    pub(super) latitude_deg: [f32; 2],
    /// The kind of fisheye, if it is one.
    pub(super) fisheye: Option<FisheyeKind>,
    pub(super) fov_deg: f32,
    pub(super) half_size: Option<[f32; 2]>,
}

/// How the distance from the centre of a fisheye's picture depends on the angle to the axis.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum FisheyeKind {
    /// It is the angle.
    Equidistant,
    /// It is 2 sin(angle / 2).
    Equisolid,
}

impl Default for PanoramaExtras {
    fn default() -> Self {
        PanoramaExtras {
            longitude_deg: [-180.0, 180.0],
            latitude_deg: [-90.0, 90.0],
            fisheye: None,
            fov_deg: 180.0,
            half_size: None,
        }
    }
}

/// Content of `extras.caustique` of a light's node, or of the light.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct LightExtras {
    pub(super) radius: Option<f32>,
    pub(super) angle_deg: Option<f32>,
    pub(super) blend: Option<f32>,
    pub(super) visible: Option<Visible>,
    pub(super) light_group: Option<String>,
    pub(super) ies: Option<IesExtras>,
    pub(super) gobo: Option<GoboExtras>,
    pub(super) null_bsdf: Option<bool>,
    pub(super) bulb: Option<bool>,
}

/// Content of `extras.caustique.ies`: a photometric profile in a file or in a buffer view.
#[derive(Clone, Default, Deserialize)]
#[serde(default)]
pub(super) struct IesExtras {
    pub(super) file: Option<String>,
    #[serde(rename = "bufferView")]
    pub(super) buffer_view: Option<u32>,
    pub(super) rotation_deg: f32,
    pub(super) clockwise: bool,
    pub(super) normalize: Normalize,
    pub(super) angle_scale: f32,
}

/// What the intensities of a profile are divided by.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "true, false or \"power\"")]
pub(super) enum Normalize {
    /// The largest one, or nothing.
    Peak(bool),
    Flux(Power),
}

/// The word for division by the flux.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Power {
    Power,
}

impl Default for Normalize {
    fn default() -> Self {
        Normalize::Peak(false)
    }
}

/// Content of `extras.caustique.gobo`: a picture that a spot throws.
#[derive(Clone, Deserialize)]
pub(super) struct GoboExtras {
    pub(super) texture: u32,
    #[serde(default)]
    pub(super) view_deg: Option<f32>,
}

/// Keys of `extras.caustique` that the reader knows in a scene; keys of nested objects follow a dot.
pub(super) const SCENE: &[&str] = &[
    "environment",
    "environment.color",
    "environment.file",
    "environment.rotation_deg",
    "environment.strength",
    "environment.visible",
    "environment.visible.camera",
    "environment.light_group",
    "environment.background",
    "environment.background.color",
    "environment.background.file",
    "environment.background.rotation_deg",
    "environment.background.strength",
    "medium",
    "medium.sigma_a",
    "medium.sigma_s",
    "medium.g",
    "medium.density",
    "light_units",
    "losses",
    "resolution",
    "exposure",
    "tonemap",
    "contrast",
    "crop",
    "film_transparent",
    "frame",
    "frame_rate",
    "shutter",
    "time",
];
pub(super) const MATERIAL: &[&str] = &[
    "medium",
    "medium.sigma_a",
    "medium.sigma_s",
    "medium.g",
    "medium.density",
    "medium.density.file",
    "medium.emission",
    "medium.emission.file",
    "medium.emission.color",
    "priority",
    "contact",
    "null_bsdf",
    "spread_deg",
    "diffuse_roughness",
    "diffuse_roughness_texture",
    "coat_ior",
    "coat_ior_texture",
    "coat_color",
    "coat_color_texture",
    "sheen_model",
    "reflection_color",
    "single_scattering",
];
pub(super) const CAMERA: &[&str] = &[
    "aperture_radius",
    "focus_distance",
    "shift",
    "panorama",
    "panorama.longitude_deg",
    "panorama.latitude_deg",
    "panorama.fisheye",
    "panorama.fov_deg",
    "panorama.half_size",
];
pub(super) const LIGHT: &[&str] = &[
    "radius",
    "angle_deg",
    "blend",
    "visible",
    "visible.camera",
    "light_group",
    "ies",
    "ies.file",
    "ies.bufferView",
    "ies.rotation_deg",
    "ies.clockwise",
    "ies.normalize",
    "ies.angle_scale",
    "null_bsdf",
    "bulb",
    "gobo",
    "gobo.texture",
    "gobo.view_deg",
];
/// Keys of nodes, beside those of the cameras and lights that they place.
pub(super) const NODE: &[&str] = &[
    "shadow_catcher",
    "holdout",
    "collections",
    "receivers",
    "receivers.include",
    "receivers.exclude",
    "blockers",
    "blockers.include",
    "blockers.exclude",
];

/// Reads `extras.caustique` of a part of the document; the default if there are no extras. `place` names the part in
/// errors.
pub(super) fn read<T: Default + DeserializeOwned>(part: &Value, place: &str) -> Result<T> {
    match part.get("extras").and_then(|extras| extras.get("caustique")) {
        None | Some(Value::Null) => Ok(T::default()),
        Some(value) => T::deserialize(value).map_err(|e| {
            let mut error = malformed(format!("{place}, extras.caustique"), &e);
            error.hint = Some("the documentation lists the keys and their types".into());
            error
        }),
    }
}

/// Adds a warning for each key in `extras.caustique` that is in none of the lists `known`.
pub(super) fn check_keys(part: &Value, known: &[&[&str]], place: &str, warnings: &mut Vec<String>) {
    if let Some(value) = part.get("extras").and_then(|extras| extras.get("caustique")) {
        check_object(value, "", known, place, warnings);
    }
}

fn check_object(value: &Value, prefix: &str, known: &[&[&str]], place: &str, warnings: &mut Vec<String>) {
    for (key, item) in value.as_object().into_iter().flatten() {
        let path = format!("{prefix}{key}");
        if known.iter().any(|keys| keys.contains(&path.as_str())) {
            // The content of a texture's reference is glTF's own.
            if path.ends_with("_texture") {
                continue;
            }
            check_object(item, &format!("{path}."), known, place, warnings);
            continue;
        }
        let near = known.iter().copied().flatten().map(|k| (strsim::levenshtein(&path, k), k)).min();
        let near = near.filter(|(d, k)| *d <= 3 || k.starts_with(&path));
        let advice = near.map_or_else(String::new, |(_, k)| format!(" (did you mean \"{k}\"?)"));
        warnings.push(format!("{place}: extras.caustique has no key \"{path}\"{advice}"));
    }
}
