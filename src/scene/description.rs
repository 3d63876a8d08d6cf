//! The content of a scene file as plain data: readers (glTF, USD) produce it, and `Scene::build` consumes it.

use crate::error::{Error, ErrorKind};
use crate::geometry::Mesh;
use crate::light::Pattern;
pub use crate::light::PunctualKind;
use crate::material::{Material, MediumParameters};
use crate::math::{DAffine3, DVec3, Rgb, bounding_box_f64};
use crate::texture::Texture;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// The content of a scene file. All indices are valid, all numbers finite, all transforms invertible.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// Path of the scene file.
    pub source: PathBuf,
    /// Paths of all files that the scene names or is read from, the scene file included.
    pub files: Vec<PathBuf>,
    /// Hash of the .glb that a converter has made of the scene file and of all files that the scene file names; `None`
    /// for a file that is read without a converter.
    pub converted: Option<String>,
    /// Meshes in local space; each is listed once, even with several instances.
    pub meshes: Vec<Arc<Mesh>>,
    /// Instances of the meshes: which mesh is placed where, with which material.
    pub instances: Vec<PlacedMesh>,
    /// Names of objects (nodes that carry a mesh).
    pub objects: Vec<String>,
    /// Materials, indexed by [`PlacedMesh::material`].
    pub materials: Vec<Material>,
    /// Textures, decoded.
    pub textures: Vec<Texture>,
    /// Cameras, in the order of the file.
    pub cameras: Vec<CameraDescription>,
    /// Point, spot and directional lights of the file.
    pub lights: Vec<PunctualLight>,
    /// Units of the intensities of `lights`, if they were guessed; otherwise `None`.
    pub guessed_units: Option<GuessedUnits>,
    /// The light from all directions at infinity; `None` if the file has none.
    pub environment: Option<EnvironmentDescription>,
    /// Whether camera rays do not see the environment; it lights the scene anyway.
    pub environment_hidden_from_camera: bool,
    /// The environment that cameras see instead of `environment`; `None` if they see `environment`.
    pub background: Option<EnvironmentDescription>,
    /// Name of the environment's light group (a named set of lights with a layer of its own), if it has one.
    pub environment_light_group: Option<String>,
    /// Whether the original scene may have an environment that the file lacks: the exporter that wrote the file never
    /// writes one.
    pub environment_unknown: bool,
    /// Whether the file itself says that its environment is black.
    pub environment_is_black: bool,
    /// Whether the file has a light at any time besides the environment, shown or hidden. In a file without a camera,
    /// surfaces that glow are no lights.
    pub has_light: bool,
    /// Index of the object that a light preset has added, which views of the whole scene do not frame.
    pub preset_floor: Option<u32>,
    /// The medium that fills the space outside all solids; `None` if it is empty.
    pub medium: Option<MediumParameters>,
    /// Settings of the picture, which options of the user override.
    pub picture: PictureDefaults,
    /// Whether anything in the file depends on the time.
    pub animated: bool,
    /// Times at which the shutter opens and closes, relative to the frame (frames); `None` without motion blur.
    pub shutter: Option<[f64; 2]>,
    /// What the file offers to choose from, and its extensions.
    pub contents: FileContents,
    /// Warnings about ignored or approximated features of the file, one sentence each: `material "glass": ...`.
    pub warnings: Vec<String>,
}

impl Description {
    /// Times at which the shutter opens and closes, relative to the frame (frames); `None` if nothing moves while it is
    /// open.
    pub fn blur(&self) -> Option<[f64; 2]> {
        self.shutter.filter(|_| self.animated)
    }

    /// Whether an object may shine. With motion blur, one that is dark at the frame may do so at another moment. Objects
    /// from `first_light_sphere` on are spheres made for point lights.
    pub(super) fn may_glow(&self, placed: &PlacedMesh, first_light_sphere: u32) -> bool {
        let material = &self.materials[placed.material as usize];
        let glows = material.emits() || material.medium_emission().is_some();
        glows || placed.object >= first_light_sphere || self.blur().is_some()
    }

    /// World-space bounding box of all meshes, in f64. Without meshes, its lower corner is above the upper one.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        bounding_box_f64(self.instances.iter().flat_map(|placed| {
            let positions = self.meshes[placed.mesh as usize].positions.iter();
            positions.map(|p| placed.to_world.transform_point3(p.as_dvec3()))
        }))
    }
}

/// What a glTF file offers to choose from, and the extensions that it uses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileContents {
    /// Names of its scenes; a scene without a name is called by its index, and so are animations.
    pub scenes: Vec<String>,
    /// Index of the scene that was read; `None` if the file has no scene, and all its nodes were read.
    pub scene: Option<usize>,
    /// Its animations.
    pub animations: Vec<AnimationContents>,
    /// Names of its material variants (KHR_materials_variants).
    pub variants: Vec<String>,
    /// The extensions that it uses, in the order of their names.
    pub extensions: Vec<ExtensionContents>,
    /// Whether Blender's exporter wrote the file; our own exporter uses it, too.
    pub is_by_blender: bool,
}

/// An animation of a glTF file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnimationContents {
    /// Its name.
    pub name: String,
    /// Times of its first and its last key (seconds); `None` if the file does not state them.
    pub seconds: Option<[f64; 2]>,
}

/// An extension that a glTF file uses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExtensionContents {
    /// Its name.
    pub name: String,
    /// Whether the file is invalid without it.
    #[serde(rename = "required")]
    pub is_required: bool,
    /// Whether it is read; otherwise it is ignored.
    #[serde(rename = "read")]
    pub is_read: bool,
}

/// An instance of a mesh: its place, material and object.
#[derive(Clone, Debug)]
pub struct PlacedMesh {
    /// Name of the node in the file, for messages.
    pub name: String,
    /// Index of the mesh in [`Description::meshes`].
    pub mesh: u32,
    /// Index of the material in [`Description::materials`].
    pub material: u32,
    /// Index of the object's name in [`Description::objects`].
    pub object: u32,
    /// Whether camera rays pass through the instance; other rays hit it.
    pub hidden_from_camera: bool,
    /// Whether the picture shows only the shadows of other objects on the instance, as alpha, and their light.
    pub shadow_catcher: bool,
    /// Whether cameras see black without coverage where they see the instance.
    pub holdout: bool,
    /// Name of the light group (a named set of lights with a layer of its own) of the instance, if it is emissive.
    pub light_group: Option<String>,
    /// Collections of the instance, and those that receive or block its light; `None` if there are none.
    pub links: Option<Arc<Links>>,
    /// Whether the place or the shape of the instance depends on the time while the shutter is open.
    pub moves: bool,
    /// Transform from local to world space.
    pub to_world: DAffine3,
}

/// Light linking and shadow linking of a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// Names of the collections that the node is in.
    pub collections: Vec<String>,
    /// Collections that receive the light of the node.
    pub receivers: Linked,
    /// Collections that block the light of the node.
    pub blockers: Linked,
}

/// Objects that a light is linked to, by the names of their collections.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Linked {
    /// Collections to which the light is limited; all objects if it is empty.
    pub include: Vec<String>,
    /// Collections that are left out, also of `include`.
    pub exclude: Vec<String>,
}

impl Linked {
    /// Whether the light is linked to all objects.
    pub fn is_all(&self) -> bool {
        self.include.is_empty() && self.exclude.is_empty()
    }

    /// Whether the light is linked to an object that is in these collections.
    pub fn has(&self, collections: &[String]) -> bool {
        let any = |names: &[String]| names.iter().any(|name| collections.contains(name));
        (self.include.is_empty() || any(&self.include)) && !any(&self.exclude)
    }
}

/// A camera; it looks along -Z of its node, +Y up.
#[derive(Clone, Debug)]
pub struct CameraDescription {
    /// Name of the camera's node in the file.
    pub name: String,
    /// Transform from camera to world space; its scale is ignored.
    pub to_world: DAffine3,
    /// Perspective or orthographic projection, with the size of the view.
    pub projection: Projection,
    /// Radius of the camera's lens (m); 0 is a pinhole.
    pub aperture_radius: f32,
    /// Distance from the camera to the plane in focus (m).
    pub focus_distance: f32,
    /// Offset of the picture's centre from the camera's axis: to the right in widths of the picture, up in heights of
    /// the picture.
    pub shift: [f32; 2],
}

/// Settings of the picture in a scene file; options of the user override them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureDefaults {
    /// Width and height of the whole picture in pixels; `None` if the file does not set them.
    pub resolution: Option<[u32; 2]>,
    /// Exposure for display, in stops; `None` if the file does not set it.
    pub exposure: Option<f32>,
    /// Tone curve for display; `None` if the file does not set it.
    pub tonemap: Option<ToneMap>,
    /// Contrast of the tone curve; `None` if the file does not set it.
    pub contrast: Option<Contrast>,
    /// Whether the background is transparent: camera rays do not see the environment, and alpha is the coverage of a
    /// pixel.
    pub film_transparent: bool,
    /// The window to render: left edge, top edge, width and height, in shares (0 to 1) of the whole picture; `None` is
    /// the whole picture.
    pub crop: Option<[f64; 4]>,
    /// Frame number of the picture in an animation; `None` if the file does not set it.
    pub frame: Option<i32>,
    /// Frames per second of animations, as numerator and denominator, both positive; `None` if the file does not set
    /// them.
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
    /// Blender's Filmic, the view of its files before 4.0: more contrast, bright lights turn white
    Filmic,
    /// Khronos PBR Neutral: base colours of products stay as they are, only highlights are compressed
    Neutral,
    /// No curve: what is brighter than white is cut off
    Srgb,
}

/// Contrast of the tone curves AgX and Filmic, as Blender's looks of these names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Contrast {
    /// The steepest curve
    VeryHigh,
    /// A steep curve
    High,
    /// A slightly steeper curve
    MediumHigh,
    /// The curve without a look
    #[default]
    Medium,
    /// A slightly flatter curve
    MediumLow,
    /// A flat curve
    Low,
    /// The flattest curve
    VeryLow,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective projection: nearer things look larger.
    Perspective {
        /// Vertical field of view (radians).
        yfov: f32,
        /// Width over height of the view; `None` if the file does not give it.
        aspect: Option<f32>,
    },
    /// Orthographic projection: all rays are parallel.
    Orthographic {
        /// Half the width of the view (m).
        xmag: f32,
        /// Half the height of the view (m).
        ymag: f32,
    },
    /// Equirectangular projection: all directions between two longitudes, to the right of the camera's axis, and between
    /// two latitudes, above it (radians).
    Equirectangular {
        /// Longitudes of the left and right edge, in ascending order.
        longitude: [f32; 2],
        /// Latitudes of the lower and upper edge, in ascending order.
        latitude: [f32; 2],
    },
    /// Fisheye projection: all directions within an angle to the camera's axis.
    Fisheye {
        /// Angle of the whole view (radians).
        fov: f32,
        /// Whether the distance of a point of the picture from the centre is 2 sin(angle / 2); otherwise it is the angle.
        equal_area: bool,
        /// Half the width and half the height of the picture, in the unit of that distance.
        half_size: [f32; 2],
    },
}

/// A light of KHR_lights_punctual in radiometric units; it shines along -Z of its node.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Name of the light's node in the file.
    pub name: String,
    /// Transform from the light's space to world space.
    pub to_world: DAffine3,
    /// Radiant intensity (W/sr) of points and spots, irradiance (W/m2) of suns, per channel. With a pattern, the intensity
    /// where the pattern is 1.
    pub intensity: Rgb,
    /// Point, spot or sun.
    pub kind: PunctualKind,
    /// Relative intensity of a point or a spot by direction, within the cone of a spot; `None` for equal intensity in
    /// all directions. The x axis of the pattern's frame is that of the light's space.
    pub pattern: Option<Arc<Pattern>>,
    /// Radius (m) of a point light's sphere, of a spot's disc, or of the ball of a light with a pattern or a bulb; 0 for
    /// a mathematical point.
    pub radius: f32,
    /// Whether rays pass through the sphere of a point light, which shines nevertheless.
    pub pass_through: bool,
    /// Whether camera paths see the radius of a spot, or of a light with a pattern, as a ball that rays pass through.
    pub bulb: bool,
    /// Whether camera rays do not see the light; it lights the scene anyway.
    pub hidden_from_camera: bool,
    /// Name of the light's group (a named set of lights with a layer of its own), if it has one.
    pub light_group: Option<String>,
    /// Collections that receive or block its light; `None` if all objects do.
    pub links: Option<Arc<Links>>,
}

impl PunctualLight {
    /// Whether the scene has an emissive sphere in place of the light: it is a point light with a radius, and without a
    /// pattern.
    pub fn is_sphere(&self) -> bool {
        self.kind == PunctualKind::Point && self.radius > 0.0 && self.pattern.is_none()
    }
}

/// Units of the intensities of punctual lights, if they were guessed because neither the file nor the user states them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GuessedUnits {
    /// Whether the intensities were taken for lumens, at 683 lumens per watt; otherwise they were taken for watts.
    pub photometric: bool,
    /// The reason for the guess, as a part of a message.
    pub from: String,
}

/// Light from all directions at infinity, as the scene file describes it.
#[derive(Clone, Debug)]
pub struct EnvironmentDescription {
    /// Radiance per direction, before it is multiplied by `strength`.
    pub source: EnvironmentSource,
    /// Counter-clockwise rotation about +Y seen from above (degrees).
    pub rotation_deg: f32,
    /// Factor on the radiance of `source`.
    pub strength: f32,
}

/// Radiance of an environment light for each direction.
#[derive(Clone, Debug)]
pub enum EnvironmentSource {
    /// Equal radiance from all directions.
    Color(Rgb),
    /// A latitude-longitude image: u = 1/2 + atan2(z, x) / 2 pi, v = acos(y) / pi from the top.
    Image {
        /// Width of the image in texels.
        width: u32,
        /// Height of the image in texels.
        height: u32,
        /// Radiance, top row first; finite and not negative.
        texels: Vec<[f32; 3]>,
    },
}

/// The error about an object that exists only for a part of the time for which the shutter is open.
pub fn missing_at_moments(name: &str) -> Error {
    let cause = format!("object \"{name}\" is there only for a part of the time for which the shutter is open");
    let error = Error::new(ErrorKind::Scene, "", cause);
    error.hint("let it appear between two frames' shutters, or render without blur: --shutter 0")
}
