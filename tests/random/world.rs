//! A scene as plain data that can be transformed and then written as glTF.

use caustique::camera::Filter;
use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A whole scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct World {
    /// Seed from which it was generated.
    pub seed: u64,
    /// Length of the room's longest side (m).
    pub size: f64,
    /// The things of the scene. Each becomes a chain of nodes.
    pub things: Vec<Thing>,
    /// Meshes, which things may share.
    pub meshes: Vec<Mesh>,
    /// Materials, which things may share.
    pub materials: Vec<Matter>,
    /// Textures of materials.
    pub textures: Vec<Texture>,
    /// Radiance of a uniform sky.
    pub sky: Option<DVec3>,
    /// The medium that fills the scene.
    pub fog: Option<Medium>,
    /// Whether the scene appears after the frame.
    #[serde(default)]
    pub later: Option<Later>,
    /// Filter of the pixels.
    #[serde(default)]
    pub filter: Filter,
}

/// A scene that appears after its frame 0: lights are dark at the frame and things have other sizes. Frames last a
/// second.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Later {
    /// Seed of the sizes at the frame.
    pub seed: u64,
    /// Times at which the shutter opens and closes (seconds), after [`Later::START`].
    pub shutter: [f64; 2],
}

impl Later {
    /// Time from which the scene is there (seconds).
    pub const START: f64 = 0.25;
}

/// An object, light or camera with its placement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Thing {
    /// Name of its node.
    pub name: String,
    /// Transforms of the nested nodes, from the root to the thing.
    pub chain: Vec<Placement>,
    /// Kind of the thing.
    pub kind: ThingKind,
    /// Index of the rigid body, whose things are lifted together: a vessel and its content.
    pub body: u32,
    /// Whether the body stands on something opaque.
    pub rests: bool,
    /// Whether cameras do not see the thing.
    #[serde(default)]
    pub hidden: bool,
    /// Bodies that do not receive the light of the thing, if it is a light.
    #[serde(default)]
    pub unlit: Vec<u32>,
    /// Bodies that do not block the light of the thing, if it is a light.
    #[serde(default)]
    pub unblocked: Vec<u32>,
}

/// Kind of a thing.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum ThingKind {
    /// A mesh with a material, by index.
    Mesh { mesh: usize, material: usize },
    /// A punctual light.
    Light(Light),
    /// A camera.
    Camera(Lens),
}

/// Transform of a node.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Placement {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

/// A point, spot or directional light.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Light {
    pub kind: LightKind,
    /// Radiant intensity, or irradiance of a sun.
    pub color: DVec3,
}

/// Kind of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum LightKind {
    /// A point, or a sphere of this radius.
    Point { radius: f64 },
    /// A cone with the half angles of full and of zero intensity.
    Spot { inner: f64, outer: f64, radius: f64 },
    /// Light from infinity, with the angle of its disc in degrees.
    Sun { angle: f64 },
}

/// A camera with a square film that looks along -Z of its node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// Field of view (radians), or half the width of an orthographic picture (m).
    pub view: f64,
    pub orthographic: bool,
    pub aperture: f64,
    pub focus: f64,
    /// The directions that the picture shows instead, if it is a panorama.
    #[serde(default)]
    pub panorama: Option<Panorama>,
}

/// A panorama. Angles are in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Panorama {
    Equirectangular { longitude: [f64; 2], latitude: [f64; 2] },
    Fisheye { fov: f64, equisolid: bool },
}

impl Panorama {
    /// All directions.
    pub const WHOLE: Panorama = Panorama::Equirectangular { longitude: [-180.0, 180.0], latitude: [-90.0, 90.0] };
}

/// A triangle mesh.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    /// One per position, or empty for flat shading.
    pub normals: Vec<DVec3>,
    /// One per position.
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
}

/// A homogeneous medium; coefficients in 1/m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Medium {
    pub sigma_a: DVec3,
    pub sigma_s: DVec3,
    pub g: f64,
}

/// A material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Matter {
    pub base: DVec3,
    pub metallic: f64,
    pub roughness: f64,
    /// Factor of the reflection of a dielectric; 0 is purely diffuse.
    pub specular: f64,
    pub transmission: f64,
    /// Whether transmitting faces are the boundary of a solid.
    pub solid: bool,
    pub ior: f64,
    pub emission: DVec3,
    pub medium: Option<Medium>,
    /// Emission of the medium within the box from -0.5 to 0.5 of the mesh (W/sr/m3), where it also absorbs and scatters;
    /// `None` if the medium fills the mesh and does not emit.
    #[serde(default)]
    pub fire: Option<DVec3>,
    pub priority: i32,
    /// Share of the light that the surface or solid exists for.
    #[serde(default = "one")]
    pub alpha: f64,
    /// Texture of the base colour.
    pub texture: Option<usize>,
    /// Strength and texture of a normal map.
    pub bumps: Option<(f64, usize)>,
    pub clearcoat: f64,
}

fn one() -> f64 {
    1.0
}

/// Row-major texels of 8 bits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Texture {
    pub width: u32,
    pub texels: Vec<[u8; 3]>,
    /// Whether texels are sRGB colours, whose channels can be exchanged. Otherwise they are directions.
    pub color: bool,
}

impl Default for Matter {
    fn default() -> Self {
        Matter {
            base: DVec3::splat(0.5),
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            transmission: 0.0,
            solid: true,
            ior: 1.5,
            emission: DVec3::ZERO,
            medium: None,
            fire: None,
            priority: 0,
            alpha: 1.0,
            texture: None,
            bumps: None,
            clearcoat: 0.0,
        }
    }
}

impl Matter {
    /// A purely diffuse material.
    pub fn matte(base: DVec3) -> Matter {
        Matter { base, ..Matter::default() }
    }

    /// A black surface that emits.
    pub fn glowing(emission: DVec3) -> Matter {
        Matter { base: DVec3::ZERO, emission, ..Matter::default() }
    }

    /// Solid glass.
    pub fn glass(ior: f64, roughness: f64) -> Matter {
        Matter { base: DVec3::ONE, roughness, specular: 1.0, transmission: 1.0, ior, ..Matter::default() }
    }

    pub fn is_glass(&self) -> bool {
        self.transmission > 0.0
    }

    pub fn glows(&self) -> bool {
        self.emission.max_element() > 0.0 || self.fire.is_some_and(|fire| fire.max_element() > 0.0)
    }
}

impl Medium {
    /// The medium that gives the same picture in a scene `scale` times as large.
    pub fn scaled(self, scale: f64) -> Medium {
        Medium { sigma_a: self.sigma_a / scale, sigma_s: self.sigma_s / scale, ..self }
    }
}

impl Placement {
    pub const IDENTITY: Placement =
        Placement { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    pub fn at(translation: DVec3) -> Placement {
        Placement { translation, ..Placement::IDENTITY }
    }

    pub fn turned(rotation: DQuat) -> Placement {
        Placement { rotation, ..Placement::IDENTITY }
    }

    pub fn scaled(scale: DVec3) -> Placement {
        Placement { scale, ..Placement::IDENTITY }
    }

    pub fn affine(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

impl Thing {
    /// Transform from local to world space.
    pub fn to_world(&self) -> DAffine3 {
        self.chain.iter().fold(DAffine3::IDENTITY, |to_world, placement| to_world * placement.affine())
    }

    pub fn mesh(&self) -> Option<(usize, usize)> {
        match self.kind {
            ThingKind::Mesh { mesh, material } => Some((mesh, material)),
            _ => None,
        }
    }

    pub fn is_camera(&self) -> bool {
        matches!(self.kind, ThingKind::Camera(_))
    }
}

impl Mesh {
    /// The mesh with transformed vertices. A reflection also flips the triangles.
    pub fn transformed(&self, by: &DAffine3) -> Mesh {
        let mirrored = by.matrix3.determinant() < 0.0;
        let of_normals = by.matrix3.inverse().transpose();
        Mesh {
            positions: self.positions.iter().map(|p| by.transform_point3(*p)).collect(),
            normals: self.normals.iter().map(|n| (of_normals * *n).normalize()).collect(),
            uvs: self.uvs.clone(),
            triangles: self.triangles.iter().map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] }).collect(),
        }
    }

    /// The mesh with the triangles that `keep` selects.
    pub fn part(&self, keep: impl Fn(usize) -> bool) -> Mesh {
        let triangles = self.triangles.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, t)| *t).collect();
        Mesh { triangles, ..self.clone() }
    }
}

impl World {
    /// Adds a mesh with a material.
    pub fn add(&mut self, name: &str, mesh: Mesh, matter: Matter, chain: Vec<Placement>) -> &mut Thing {
        let kind = ThingKind::Mesh { mesh: self.meshes.len(), material: self.materials.len() };
        self.meshes.push(mesh);
        self.materials.push(matter);
        self.add_kind(name, kind, chain)
    }

    /// Adds a thing of any kind.
    pub fn add_kind(&mut self, name: &str, kind: ThingKind, chain: Vec<Placement>) -> &mut Thing {
        let index = self.things.len();
        let body = self.things.iter().map(|thing| thing.body + 1).max().unwrap_or(0);
        self.things.push(Thing {
            name: format!("{name} {index}"),
            chain,
            kind,
            body,
            rests: false,
            hidden: false,
            unlit: vec![],
            unblocked: vec![],
        });
        &mut self.things[index]
    }

    /// Adds a camera that looks from `eye` to `target`.
    pub fn look(&mut self, eye: DVec3, target: DVec3, lens: Lens) {
        let back = (eye - target).normalize();
        let up = if back.y.abs() > 0.99 { DVec3::Z } else { DVec3::Y };
        let right = up.cross(back).normalize();
        let rotation = DQuat::from_mat3(&glam::DMat3::from_cols(right, back.cross(right), back));
        self.add_kind(
            "camera",
            ThingKind::Camera(lens),
            vec![Placement { translation: eye, rotation, ..Placement::IDENTITY }],
        );
    }

    /// The material of a thing.
    pub fn matter(&self, thing: &Thing) -> Option<&Matter> {
        thing.mesh().map(|(_, material)| &self.materials[material])
    }

    /// Names of cameras.
    pub fn cameras(&self) -> Vec<&str> {
        self.things.iter().filter(|thing| thing.is_camera()).map(|thing| thing.name.as_str()).collect()
    }

    /// Radius of a thing's mesh about its centre in world space; 0 for things without a mesh.
    pub fn radius(&self, thing: &Thing) -> f64 {
        let Some((mesh, _)) = thing.mesh() else { return 0.0 };
        let to_world = thing.to_world();
        let points = self.meshes[mesh].positions.iter().map(|p| to_world.transform_point3(*p));
        let (low, high) =
            points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        0.5 * (high - low).length()
    }

    /// Share of a hemisphere's projected solid angle that the smallest light covers, at the distance of the scene's
    /// size; 1 without lights.
    pub fn smallest_light(&self) -> f64 {
        let share = |index: usize| {
            let thing = &self.things[index];
            match thing.kind {
                ThingKind::Light(Light { kind: LightKind::Sun { angle }, .. }) => {
                    (0.5 * angle).to_radians().sin().powi(2)
                }
                ThingKind::Light(Light {
                    kind: LightKind::Point { radius } | LightKind::Spot { radius, .. }, ..
                }) => (radius / self.size).powi(2),
                _ => (self.radius(thing) / self.size).powi(2),
            }
        };
        self.lights().into_iter().map(share).fold(1.0, f64::min)
    }

    /// Indices of the things that emit light.
    pub fn lights(&self) -> Vec<usize> {
        let shines = |thing: &Thing| match thing.kind {
            ThingKind::Mesh { .. } => self.matter(thing).is_some_and(Matter::glows),
            ThingKind::Light(light) => light.color.max_element() > 0.0,
            ThingKind::Camera(_) => false,
        };
        (0..self.things.len()).filter(|i| shines(&self.things[*i])).collect()
    }
}
