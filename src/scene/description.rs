//! The content of a scene file as plain data: readers (glTF, USD) produce it, and `Scene::build` consumes it.

use crate::geometry::Mesh;
use crate::light::SpotEdge;
use crate::material::{Material, MediumParameters};
use crate::math::{DAffine3, Rgb};
use crate::texture::Texture;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The content of a scene file. All indices are valid, all numbers finite, all transforms invertible.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// The scene file.
    pub source: PathBuf,
    /// Hash of the .glb that a converter has made of the scene file and of all files that the scene file names; `None`
    /// for a file that is read without a converter.
    pub converted: Option<String>,
    /// Meshes in local space; each is listed once, even with several instances.
    pub meshes: Vec<Mesh>,
    /// Instances of the meshes.
    pub instances: Vec<PlacedMesh>,
    /// Names of objects (nodes that carry a mesh).
    pub objects: Vec<String>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures, decoded.
    pub textures: Vec<Texture>,
    /// Cameras, in the file's order.
    pub cameras: Vec<CameraDescription>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Units of `lights`, if they were guessed.
    pub guessed_units: Option<GuessedUnits>,
    /// The environment.
    pub environment: Option<EnvironmentDescription>,
    /// Whether cameras do not see the environment; it lights the scene anyway.
    pub environment_hidden_from_camera: bool,
    /// Light group of the environment.
    pub environment_light_group: Option<String>,
    /// Whether the original scene may have an environment that the file lacks: the exporter that wrote the file never
    /// writes one.
    pub environment_unknown: bool,
    /// The medium outside all solids.
    pub medium: Option<MediumParameters>,
    /// Settings of the picture.
    pub picture: PictureDefaults,
    /// Warnings about ignored or approximated features, one sentence each: `material "glass": ...`.
    pub warnings: Vec<String>,
}

/// An instance of a mesh.
#[derive(Clone, Debug)]
pub struct PlacedMesh {
    /// Name of the node.
    pub name: String,
    /// Index into [`Description::meshes`].
    pub mesh: u32,
    /// Index into [`Description::materials`].
    pub material: u32,
    /// Index into [`Description::objects`].
    pub object: u32,
    /// Whether camera rays pass through the instance; other rays hit it.
    pub hidden_from_camera: bool,
    /// Light group of the instance, if it is emissive.
    pub light_group: Option<String>,
    /// Transform from local to world space.
    pub to_world: DAffine3,
}

/// A camera; it looks along -Z of its node, +Y up.
#[derive(Clone, Debug)]
pub struct CameraDescription {
    /// Name of the node.
    pub name: String,
    /// Transform from camera to world space; its scale is ignored.
    pub to_world: DAffine3,
    /// Projection.
    pub projection: Projection,
    /// Radius of the lens (m); 0 is a pinhole.
    pub aperture_radius: f32,
    /// Distance of the plane in focus (m).
    pub focus_distance: f32,
    /// Offset of the picture's centre from the camera's axis: to the right in picture widths, up in picture heights.
    pub shift: [f32; 2],
}

/// Settings of the picture in a scene file; options of the user override them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureDefaults {
    /// Width and height in pixels.
    pub resolution: Option<[u32; 2]>,
    /// Exposure for display, in stops.
    pub exposure: Option<f32>,
    /// Tone curve for display.
    pub tonemap: Option<ToneMap>,
    /// Whether the background is transparent: cameras do not see the environment, and alpha is the coverage of a pixel.
    pub film_transparent: bool,
    /// The window to render: left edge, top edge, width and height, in shares of the whole picture.
    pub crop: Option<[f64; 4]>,
    /// Frame number of the picture.
    pub frame: Option<i32>,
    /// Frames per second, as a fraction of two positive numbers.
    pub frame_rate: Option<[u32; 2]>,
}

/// Tone curve from scene-linear light to display colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum ToneMap {
    /// Soft shoulder, highlights lose colour: what Blender shows
    #[default]
    Agx,
    /// A film-like curve per channel: more contrast, bright colours keep their wavelength and clip
    Filmic,
    /// No curve: what is brighter than white is cut off
    Srgb,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective projection.
    Perspective {
        /// Vertical field of view (radians).
        yfov: f32,
        /// Width over height, if the file gives it.
        aspect: Option<f32>,
    },
    /// Orthographic projection.
    Orthographic {
        /// Half the width of the view (m).
        xmag: f32,
        /// Half the height of the view (m).
        ymag: f32,
    },
}

/// A light of KHR_lights_punctual in radiometric units; it shines along -Z of its node.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Name of the node.
    pub name: String,
    /// Transform from the light's space to world space.
    pub to_world: DAffine3,
    /// Radiant intensity (W/sr) of points and spots, irradiance (W/m2) of suns, per channel.
    pub intensity: Rgb,
    /// Kind of the light.
    pub kind: PunctualKind,
    /// Radius (m) of a point light's sphere or of a spot's disc; 0 for a mathematical point.
    pub radius: f32,
    /// Whether cameras do not see the light.
    pub hidden_from_camera: bool,
    /// Light group of the light.
    pub light_group: Option<String>,
}

impl PunctualLight {
    /// Whether the scene has an emissive sphere in place of the light.
    pub fn is_sphere(&self) -> bool {
        self.kind == PunctualKind::Point && self.radius > 0.0
    }
}

/// Units of punctual lights that were guessed, because neither the file nor the user states them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GuessedUnits {
    /// Whether the numbers were taken for lumens, at 683 lumens per watt, or for watts.
    pub photometric: bool,
    /// The reason for the guess, as part of a message.
    pub from: String,
}

/// Kind of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Equal intensity in all directions.
    Point,
    /// Emission into a cone with a soft edge.
    Spot {
        /// Half angle of the cone of full intensity (radians).
        inner: f32,
        /// Half angle from which on the intensity is zero (radians).
        outer: f32,
        /// Falloff between `inner` and `outer`.
        edge: SpotEdge,
    },
    /// Light from infinity, from a cone of directions.
    Sun {
        /// Angular diameter (radians); 0 is exactly parallel light.
        angle: f32,
    },
}

/// An environment light.
#[derive(Clone, Debug)]
pub struct EnvironmentDescription {
    /// Radiance, before `strength`.
    pub source: EnvironmentSource,
    /// Counter-clockwise rotation about +Y seen from above (degrees).
    pub rotation_deg: f32,
    /// Factor on the radiance.
    pub strength: f32,
}

/// Radiance of an environment.
#[derive(Clone, Debug)]
pub enum EnvironmentSource {
    /// Equal radiance from all directions.
    Color(Rgb),
    /// A latitude-longitude image: u = 1/2 + atan2(z, x) / 2 pi, v = acos(y) / pi from the top.
    Image {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Radiance, top row first; finite and not negative.
        texels: Vec<[f32; 3]>,
    },
}
