//! What a scene file says, as plain data: what readers (glTF, USD) produce and `Scene::build` takes.

use crate::geometry::Mesh;
use crate::light::SpotEdge;
use crate::material::{Material, MediumParameters};
use crate::math::{DAffine3, Rgb};
use crate::texture::Texture;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Everything a reader found in a scene file. Indices are valid; numbers are finite; transforms can be inverted.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// The file it was read from.
    pub source: PathBuf,
    /// Hash of what a converter has made of it and of all files that it names.
    pub converted: Option<String>,
    /// Meshes in local space, each once however often it stands in the scene.
    pub meshes: Vec<Mesh>,
    /// Where they stand.
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
    /// In what units the lights' numbers were taken, where that is a guess.
    pub guessed_units: Option<GuessedUnits>,
    /// Light from infinity.
    pub environment: Option<EnvironmentDescription>,
    /// Cameras do not see it; it lights the scene all the same.
    pub environment_hidden_from_camera: bool,
    /// Group of its light.
    pub environment_light_group: Option<String>,
    /// The file's writer leaves light from infinity out, and nothing in the file says that there is none.
    pub environment_unknown: bool,
    /// The medium that fills the space.
    pub medium: Option<MediumParameters>,
    /// The picture that the scene was made for.
    pub picture: PictureDefaults,
    /// Whatever was ignored or approximated, one sentence each: `material "glass": ...`.
    pub warnings: Vec<String>,
}

/// A mesh placed in the scene.
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
    /// Cameras look through it; all else meets it.
    pub hidden_from_camera: bool,
    /// Group of its light, if it glows.
    pub light_group: Option<String>,
    /// Local to world, composed in f64.
    pub to_world: DAffine3,
}

/// A camera; it looks along -Z of its node, +Y up.
#[derive(Clone, Debug)]
pub struct CameraDescription {
    /// Name of the node.
    pub name: String,
    /// Camera to world; orthonormal up to scale, which is ignored.
    pub to_world: DAffine3,
    /// Projection.
    pub projection: Projection,
    /// Radius of the lens (m); 0 is a pinhole.
    pub aperture_radius: f32,
    /// Distance of the plane in focus (m).
    pub focus_distance: f32,
    /// Where the middle of the picture is, in widths to the right and heights up of the camera's axis.
    pub shift: [f32; 2],
}

/// The picture that a scene was made for: what is taken where the user asks for nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureDefaults {
    /// Width and height in pixels.
    pub resolution: Option<[u32; 2]>,
    /// Exposure in stops when it is looked at.
    pub exposure: Option<f32>,
    /// From light to a display's colours.
    pub tonemap: Option<ToneMap>,
    /// Cameras see nothing where no surface is, and alpha tells how much of a pixel that is.
    pub film_transparent: bool,
    /// The window that is rendered: left edge, top edge, width and height, in shares of the whole picture.
    pub crop: Option<[f64; 4]>,
    /// Its number in a film.
    pub frame: Option<i32>,
    /// Frames in a second, as a fraction of two numbers above zero.
    pub frame_rate: Option<[u32; 2]>,
}

/// The curve between scene-linear light and a display.
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
    /// Vertical field of view (radians) and aspect ratio (width / height) if the file gives one.
    Perspective {
        /// Vertical field of view, radians.
        yfov: f32,
        /// Width over height.
        aspect: Option<f32>,
    },
    /// Half width and half height of the view (m).
    Orthographic {
        /// Half width.
        xmag: f32,
        /// Half height.
        ymag: f32,
    },
}

/// A light of KHR_lights_punctual in radiometric units; it shines along -Z of its node.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Name of the node.
    pub name: String,
    /// Light to world.
    pub to_world: DAffine3,
    /// Radiant intensity (W/sr) of points and spots, irradiance (W/m2) of suns, per channel.
    pub intensity: Rgb,
    /// Shape of the emission.
    pub kind: PunctualKind,
    /// Radius of the lamp (m): a point light's sphere, the disc that a spot shines from; 0 is a mathematical point.
    pub radius: f32,
    /// Cameras do not see it.
    pub hidden_from_camera: bool,
    /// Group of its light.
    pub light_group: Option<String>,
}

impl PunctualLight {
    /// Whether it becomes a glowing sphere.
    pub fn is_sphere(&self) -> bool {
        self.kind == PunctualKind::Point && self.radius > 0.0
    }
}

/// Units of punctual lights that neither the file nor the user states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GuessedUnits {
    /// Lumens, of which 683 were taken for a watt; watts otherwise.
    pub photometric: bool,
    /// What the guess is from, in words.
    pub from: String,
}

/// Kind of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// All directions alike.
    Point,
    /// A cone with an edge between two half angles (radians).
    Spot {
        /// Half angle of full intensity.
        inner: f32,
        /// Half angle of no intensity.
        outer: f32,
        /// How it falls off between them.
        edge: SpotEdge,
    },
    /// From infinity, spread over a cone.
    Sun {
        /// Angular diameter (radians); 0 is exactly parallel.
        angle: f32,
    },
}

/// Light from infinity.
#[derive(Clone, Debug)]
pub struct EnvironmentDescription {
    /// Radiance.
    pub source: EnvironmentSource,
    /// Counter-clockwise turn about +Y seen from above (degrees).
    pub rotation_deg: f32,
    /// Factor on the radiance.
    pub strength: f32,
}

/// Radiance of an environment.
#[derive(Clone, Debug)]
pub enum EnvironmentSource {
    /// The same from everywhere.
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
